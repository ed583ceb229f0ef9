"""Periodic orbits of which a quantity is fixed: one of a family, or one whose parameter is sought.

docs/theory/conservative.md derives the equations.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus import checks
from saltus.errors import ConvergenceError, InputError
from saltus.orbits.cuts import cut
from saltus.orbits.observables.quantities import Quantity, read_quantity, sizes_of_unknowns
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.releasing import giving_way
from saltus.orbits.stability.families import dimension_nearby, of_a_family
from saltus.orbits.unfolding import Fixed, UnfoldedEquations, unit_of_parameter
from saltus.scales import PARAMETER_KEPT, SINGULAR, SINGULAR_FAMILY, SLIGHT, UNFORCED, VARIES

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from saltus.system import HybridSystem

    Solver = Callable[..., tuple[NDArray[np.float64], NDArray[np.float64]]]  # `saltus.orbits.solve.solve_unknowns`

__all__ = ["Wish", "check_family", "read_fix", "solve_fixed", "unfolded_at", "within_family"]

_FIRST = 0.25  # first step, over the way from the guess's value to the wanted one
_LEAST = 1e-2  # least step that is tried, over the first one
_GROWTH = 1.7  # factor on the step after two successes
_BRISK = 8, 0.2  # Newton steps to an orbit on that way, at most, and the least factor on one: a shorter way costs less
_NEAR = 0.3  # largest change of an orbit's states and durations, over their sizes, from one to the next on that way
_LONG = 1.5  # factor on the period on that way from which on it is told
_MOST = 200  # orbits on that way, at most
_MANY = "the orbits there are a family of more than one dimension, as with a symmetry"


class Wish:
    """What is to be fixed, and what is freed.

    Parameters
    ----------
    quantity : Quantity
        What is fixed.
    value : float
        At which value.
    free : str
        Name of the parameter that is freed; empty where none is.
    """

    def __init__(self, quantity: Quantity, value: float, free: str) -> None:
        self.quantity, self.value, self.free = quantity, value, free

    def __str__(self) -> str:
        return f"{self.quantity.name} = {self.value:.9g}"


def read_fix(system: HybridSystem, fix: object, free: object) -> Wish | None:
    """Return what is fixed and freed, checked; None where nothing is.

    Raises
    ------
    InputError
        Unknown names, a value that is no number, several fixed quantities, a freed parameter without a fixed quantity.
    """
    if fix is None:
        if free is not None:
            raise InputError("free", free, "left out without fix", "fix={'max_x': 1.0} says what the parameter is for")
        return None
    given = checks.mapping("fix", fix, "a name to a value, as {'max_x': 1.0}")
    if free is not None:
        checks.chosen("free", free, system.parameter_names)
    if len(given) != 1:
        names = ", ".join(map(str, given)) or "none"
        hint = "one further unknown, a parameter or a family, meets one condition"
        raise InputError("fix", names, "one quantity", hint)
    ((name, wanted),) = given.items()
    quantity = read_quantity(system, name)
    value = checks.number(f"fix[{name!r}]", wanted)
    if quantity.kind == "period" or (quantity.kind == "observable" and name.startswith("amplitude")):
        value = checks.positive(f"fix[{name!r}]", wanted)
    if free is None and not system.parameter_names and system.phase is not None:
        raise InputError("free", free, "a parameter")
    return Wish(quantity, value, "" if free is None else str(free))


def unfolded_at(
    like: OrbitProblem, u: NDArray[np.float64], wish: Wish
) -> tuple[UnfoldedEquations, NDArray[np.float64]]:
    """Return the equations with a quantity fixed and their unknowns, near an orbit or a guess.

    Parameters
    ----------
    like : OrbitProblem
        Segment equations with the same system, signature and parameters.
    u : ndarray, shape (size,) or longer
        States and durations, then the active parameters of `like`.
    wish : Wish
        What is fixed and freed.

    Raises
    ------
    InputError
        Nothing moves the quantity; the freed parameter moves no orbit; a state or output was fixed that varies.
    ConvergenceError
        The flow cannot be followed from the guess.
    """
    system, signature, p, tol = like.system, like.signature, like.parameters_at(u), like.tol
    active = [system.parameter_names.index(wish.free)] if wish.free else []
    alone = OrbitProblem(system, signature, p, tol=tol)
    kept = giving_way(like, alone, u, wish.quantity, wish.free) or like.conserving
    problem = OrbitProblem(system, signature, p, active, np.ones(len(active)), tol, kept)
    unknowns = np.append(u[: like.size], p[active] if active else 0.0)
    _follow(problem, unknowns)
    J = problem.resolve(unknowns)[1]
    if active:
        unit = unit_of_parameter(problem, unknowns, J)
        if not 0.0 < unit < math.inf:
            raise InputError("free", wish.free, "a parameter that moves the orbit", "no equation of the orbit has it")
        problem = OrbitProblem(system, signature, p, active, np.array([unit]), tol, kept)
        unknowns[-1] = p[active[0]] / unit
        _follow(problem, unknowns)
        J = problem.resolve(unknowns)[1]
    equations = UnfoldedEquations(problem, wish.quantity, wish.value)
    value = wish.quantity.value(problem, unknowns)
    if not math.isfinite(value):
        raise InputError("fix", wish.quantity.name, "a quantity that the guess has", f"its value there is {value}")
    equations.turn_gap(unknowns, J)
    equations.measure(unknowns)
    wish.quantity.check_constant(problem, unknowns, equations.size, VARIES)
    if not equations.size > 0.0:
        raise InputError("fix", wish.quantity.name, "a quantity that varies with the orbit", "no state moves it there")
    return equations, unknowns


def _follow(problem: OrbitProblem, u: NDArray[np.float64]) -> None:
    if problem.start(u) is not None:
        hint = "the field is singular or the state diverges there; start from a nearer guess"
        raise ConvergenceError("flow of a segment", math.inf, 0, hint)


def solve_fixed(
    equations: UnfoldedEquations, guess: NDArray[np.float64], wish: Wish, solve: Solver
) -> tuple[UnfoldedEquations, NDArray[np.float64], NDArray[np.float64]]:
    """Return equations, unknowns and Jacobian of the orbit with a quantity fixed.

    Newton's method starts at the guess. Where that fails or leads far away, the quantity goes step by step from its
    value on the orbit nearest to the guess. A smooth orbit may be cut into pieces on the way.

    Raises
    ------
    ConvergenceError
        No such orbit is found; the hint says why, or how near the quantity came.
    """
    quantity, wanted = equations.quantity, equations.value
    look, found = _Look(equations.problem, guess), None
    residual, iterations, why = math.inf, 0, "the orbits with that value are far from the guess"
    try:
        found = solve(equations.problem, guess, equations)
        if look.near(found[0]):
            return equations, *found
    except ConvergenceError as error:
        residual, iterations, why = error.residual, error.iterations, str(error.args[3])
    _follow(equations.problem, guess)
    begin = quantity.value(equations.problem, guess)
    try:
        equations.value = begin
        start = solve(equations.problem, guess, equations)
        begun = look.near(start[0], 1.0)
    except ConvergenceError:
        begun = False
    finally:
        equations.value = wanted
    if begun:
        reached, finer, u, J = _approach(equations, start, wish, solve)
        if reached == wanted:
            return finer, u, J
        side = "up" if quantity.beyond(wanted, begin) > 0.0 else "down"
        why = f"orbits next to the guess have {quantity.name} {side} to {reached:.6g}"
        periods = _period(equations.problem, guess), _period(finer.problem, u)
        if quantity.kind != "period" and periods[1] > _LONG * periods[0]:
            why += f", where the period has grown from {periods[0]:.6g} to {periods[1]:.6g}, as next to a saddle"
    elif found is not None:  # a guess from which no way begins is as rough as one at fixed parameters may be
        _follow(equations.problem, found[0])
        return equations, *solve(equations.problem, found[0], equations)
    why = _diagnosis(equations, guess, wish, solve) or why
    raise ConvergenceError(f"orbit with {quantity.name} = {wanted:.6g}", residual, iterations, why)


def _period(problem: OrbitProblem, u: NDArray[np.float64]) -> float:
    return float(u[problem.n : problem.size : problem.n + 1].sum())


class _Look:
    """An orbit's unknowns and extremes, with which another orbit is compared."""

    def __init__(self, problem: OrbitProblem, u: NDArray[np.float64]) -> None:
        self.problem, count = problem, len(problem.system.states)
        self._sizes = np.concatenate([sizes_of_unknowns(problem, u), np.tile(problem.state_scale[:count], 2)])
        self._seen = self._all(u)

    def _all(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        survey, count = self.problem.survey(u), len(self.problem.system.states)
        return np.concatenate([u[: self.problem.size], survey.lows[:count], survey.highs[:count]])

    def near(self, u: NDArray[np.float64], most: float = _NEAR) -> bool:
        """Return whether an orbit differs by no more than `most` of the sizes."""
        return bool(np.max(np.abs(self._all(u) - self._seen) / self._sizes) < most)


def _approach(
    equations: UnfoldedEquations, start: tuple[NDArray[np.float64], NDArray[np.float64]], wish: Wish, solve: Solver
) -> tuple[float, UnfoldedEquations, NDArray[np.float64], NDArray[np.float64]]:
    """Return the value that a quantity reached on its way to the wanted one; equations, unknowns, Jacobian there."""
    (u, J), quantity = start, equations.quantity
    at = quantity.value(equations.problem, u)
    share = _FIRST * quantity.beyond(wish.value, at)
    least, last, failed = _LEAST * abs(share), None, False
    for _ in range(_MOST):
        left = quantity.beyond(wish.value, at)
        step = left if abs(share) >= abs(left) else share
        ahead = u if last is None else u + (u - last[1]) * step / last[0]
        equations.value = wish.value if step == left else at + step
        look = _Look(equations.problem, u)
        try:
            found, slopes = solve(equations.problem, ahead, equations, _BRISK)
            near = look.near(found)
        except ConvergenceError:
            near = False
        if near:
            last, u, J, at, share = (step, u), found, slopes, equations.value, step * (1.0 if failed else _GROWTH)
            failed = False
            if step == left:
                break
            continue
        share, failed = 0.5 * step, True
        _follow(equations.problem, u)
        if abs(share) < least:
            problem, pieces = cut(equations.problem, u, J[:-1])
            if problem.segments == equations.problem.segments:
                break
            again = Wish(quantity, at, wish.free)
            equations, u = unfolded_at(problem, pieces, again)
            u, J = solve(equations.problem, u, equations)
            share, last = 100.0 * share, None
    return at, equations, u, J


def _diagnosis(equations: UnfoldedEquations, guess: NDArray[np.float64], wish: Wish, solve: Solver) -> str:
    """Return why a quantity cannot be fixed near a guess; an empty text where nothing is found."""
    problem, name = equations.problem, wish.quantity.name
    p, kept = problem.parameters_at(guess), problem.conserving
    alone = OrbitProblem(problem.system, problem.signature, p, tol=problem.tol, conserving=kept)
    try:
        own = solve(alone, guess[: problem.size], None)[0]
        isolated = not of_a_family(alone, own)
    except ConvergenceError:
        own, isolated = guess[: problem.size], False
    if isolated and not wish.free:
        return "the orbits there are isolated, none of a family: name a parameter to free, as free='c'"
    u = np.append(own, guess[-1])
    _follow(problem, u)
    J = equations.evaluate(u)[1]
    matrix = equations.scaled(u, J)
    if dimension_nearby(alone, own) > 1:
        return _MANY
    _, values, right = np.linalg.svd(matrix[:-1])
    if wish.free and values[-1] < SINGULAR_FAMILY * values[0]:
        return f"the orbits there are a family that {wish.free!r} does not end: free a damping, or leave out `free`"
    if abs(float(matrix[-1] @ right[-1])) < SLIGHT:
        moves = f"with {wish.free!r}" if wish.free else "from orbit to orbit"
        return f"{name!r} hardly changes {moves} there"
    return ""


def check_family(equations: UnfoldedEquations, u: NDArray[np.float64], J: NDArray[np.float64], wish: Wish) -> None:
    """Raise an error where the unfolded equations are singular at their solution, or its gap is not closed.

    Raises
    ------
    ConvergenceError
        The quantity does not tell the orbits apart, or the orbit is isolated and no parameter is freed.
    InputError
        A state or output was fixed that is not constant.
    """
    what = f"orbit with {wish}"
    values = np.linalg.svd(equations.scaled(u, J), compute_uv=False)
    if not values[-1] > SINGULAR * values[0]:
        moves = f"the parameter {wish.free!r} does not move it" if wish.free else "no orbit near it differs in it"
        if equations.deficiency(u, J) > 1:
            moves = _MANY
        raise ConvergenceError(what, 0.0, 0, f"{wish.quantity.name!r} cannot be fixed there: {moves}")
    if not wish.free and not abs(u[-1]) <= UNFORCED * max(1.0, equations.problem.tol / 1e-12):
        hint = "no orbit of a family is near the guess: start from a nearer one, or free a parameter, as free='c'"
        raise ConvergenceError(what, abs(float(u[-1])), 0, hint)
    wish.quantity.check_constant(equations.problem, u, equations.size)


def within_family(
    equations: UnfoldedEquations, u: NDArray[np.float64], p: NDArray[np.float64], wish: Wish
) -> tuple[OrbitProblem, NDArray[np.float64], Fixed]:
    """Return the equations at fixed parameters, the orbit's unknowns, and what was fixed.

    A freed parameter that keeps its value in a family gets this value exactly.
    """
    problem = equations.problem
    own, at = u[: problem.size], problem.parameters_at(u)
    family = not wish.free
    if wish.free:
        low, high = problem.system.allowed(wish.free)
        value = float(at[int(problem.active[0])])
        if not low <= value <= high:
            hint = f"it needs {wish.free} = {value:.6g}, which must lie in [{low:g}, {high:g}]"
            raise ConvergenceError(f"orbit with {wish}", 0.0, 0, hint)
        alone = OrbitProblem(problem.system, problem.signature, at, tol=problem.tol)
        family = of_a_family(alone, own)
        index = int(problem.active[0])
        if family and abs(at[index] - p[index]) <= PARAMETER_KEPT * float(problem.scales[0]):
            at = p.copy()
    alone = OrbitProblem(problem.system, problem.signature, at, tol=problem.tol)
    _follow(alone, own)
    return alone, own, Fixed(wish.quantity.name, wish.value, wish.free, family)
