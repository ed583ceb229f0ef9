"""Periodic orbits from a guess: Newton's method on the segment equations."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial, singledispatch
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from saltus import checks, scales
from saltus.errors import ConvergenceError, InputError
from saltus.flow.sticking import check_continuous
from saltus.linear_threads import one_thread
from saltus.maps import MapOrbit
from saltus.maps.solve import solve_map_orbit
from saltus.orbits.common_sizes import newton_step
from saltus.orbits.cuts import cut, held, started_elsewhere, stretched
from saltus.orbits.fixing import Wish, check_family, read_fix, solve_fixed, unfolded_at, within_family
from saltus.orbits.guesses import check_size, check_states, read_guess
from saltus.orbits.landing.landed import Landed, before_poles, fitted, rounded, within_reach
from saltus.orbits.landing.upstrokes import solved
from saltus.orbits.maps import check_measured, piece_maps
from saltus.orbits.observables.quantities import sizes_of_unknowns
from saltus.orbits.orbit import PeriodicOrbit, orbit_at
from saltus.orbits.pieces import flown, in_pieces, solved_in_pieces
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.regular_ends import settle_signature
from saltus.orbits.resting import guess_on_plane, on_its_plane
from saltus.orbits.rounds import unwrapped
from saltus.orbits.signature import CLOSED_END, PHASE_END, Signature
from saltus.orbits.soundness import sound_orbit
from saltus.orbits.stability.families import ISOLATED, check_moves, of_a_family, why_a_family
from saltus.orbits.stability.floquet import nontrivial, undecided
from saltus.system import HybridSystem
from saltus.system.maps import Map, flowing

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray

    from saltus.checks.states import StateLike
    from saltus.orbits.signature import Survey
    from saltus.orbits.unfolding import UnfoldedEquations

__all__ = ["check_fields", "check_tol", "converge", "solve_orbit", "solve_unknowns"]

_PATIENCE = 40, 1e-3  # Newton steps, at most, and the least factor on one
_REMESHED = 12  # most times that the meshes of one orbit are moved


@overload
def solve_orbit(
    system: HybridSystem,
    parameters: Mapping[str, float] | None = None,
    segments: Sequence[tuple[str, str | None, ArrayLike, float]] | None = None,
    *,
    x0: StateLike | None = None,
    period: float | None = None,
    fix: Mapping[str, float] | None = None,
    free: str | None = None,
    tolerance: float = 1e-12,
) -> PeriodicOrbit: ...
@overload
def solve_orbit(
    system: Map,
    parameters: Mapping[str, float] | None = None,
    segments: Sequence[str] | None = None,
    *,
    x0: StateLike | None = None,
    period: int | None = None,
) -> MapOrbit: ...
def solve_orbit(
    system: HybridSystem | Map,
    parameters: Mapping[str, float] | None = None,
    segments: Sequence[Any] | None = None,
    *,
    x0: StateLike | None = None,
    period: float | None = None,
    fix: Mapping[str, float] | None = None,
    free: str | None = None,
    tolerance: float = 1e-12,
) -> PeriodicOrbit | MapOrbit:
    """Return the periodic orbit of a system, or the orbit of a map, near a guess, stable or not.

    The guess is either `segments`, or `x0` and `period` of an orbit that meets no event.
    That of a map is `x0` and `period`, or the orbit's itinerary, or both.

    Parameters
    ----------
    system : HybridSystem or Map
        The system.
    parameters : mapping of str to float, optional
        Parameters that differ from the system's defaults.
    segments : sequence of (mode, transition, x0, duration), optional
        The guess, in order: where each segment runs, the transition that ends it, its initial state and its duration.
        With a phase, `x0` may leave it out: the first segment then starts at phase 0, and a last segment whose
        transition is the phase's name ends at phase 0 again. A segment that closes without any event has the phase's
        name, or None, as its transition. Of a map in pieces: the orbit's itinerary, the name of the piece at each
        point. By default the pieces at the guess, then those at the orbit found.
    x0 : array_like or mapping of str to float, optional
        Initial state of a smooth orbit. With a phase, it may leave the phase out. Of a map: a point of the orbit, or
        all of them, shape (period, states). By default the origin, where an itinerary is given.
    period : float, optional
        Period of a smooth orbit, about. With a phase, one forcing period by default. Of a map: how many points are
        sought. By default as many as `segments` or `x0` has, else 1.
    fix : mapping of str to float, optional
        A quantity and the value that it is to have, as ``{"max_x": 1.0}``. It is ``period``, an extreme as ``max_x``,
        or an observable as ``mean(x)``. A state or output alone, as an energy, must be constant along the motion. In a
        conservative system the orbits at given parameters are a family, and the quantity picks one of them.
    free : str, optional
        The parameter that is sought such that the quantity has its value. Without it the orbit must be one of a family.
    tolerance : float, optional
        Relative tolerance of the flow's steps.

    Returns
    -------
    PeriodicOrbit or MapOrbit
        Its `fixed` remembers what was fixed and freed. An orbit of a map has its least period: it may be a divisor of
        `period`.

    Raises
    ------
    InputError
        The guess does not fit the system, or meets an event; a name that is not there; more than one quantity to fix;
        an itinerary names no piece of the map.
    ConvergenceError
        Newton's method finds no orbit near the guess; no orbit has the value of the fixed quantity; the quantity tells
        no orbits apart.
    MapDivergenceError
        The guess of a map orbit leaves every bound.

    Examples
    --------
    The orbit of a ball on a vibrating table that jumps once a period, unstable where it is a saddle:

    >>> from saltus import HybridSystem, Mode, Transition
    >>> ball = HybridSystem(
    ...     ("z", "v"), {"g": 1.0, "e": 0.5, "a": 1.2, "w": 1.0}, {"flight": Mode({"z": "v", "v": "-g"})},
    ...     [Transition("flight", "flight", "z - a*sin(theta)", -1, {"v": "-e*v + (1+e)*a*w*cos(theta)"}, name="hit")],
    ...     phase=("theta", "w"),
    ... )
    >>> orbit = solve_orbit(ball, segments=[("flight", "hit", [0.6, 3.14, 0.5], 6.28)])
    >>> orbit.signature, round(orbit.period, 6)
    ((('flight', 'hit'),), 6.283185)

    The swing of a pendulum whose period is 10, one of a family:

    >>> pendulum = HybridSystem.smooth({"x": "v", "v": "-sin(x)"})
    >>> swing = solve_orbit(pendulum, x0=[2.0, 0.0], period=9.0, fix={"period": 10.0})
    >>> print(f"{swing.max['x']:.9f}")
    2.439906972

    An orbit of a map:

    >>> from saltus import Map
    >>> logistic = Map(("x",), {"r": 3.2}, {"x": "r*x*(1 - x)"}, name="logistic map")
    >>> orbit = solve_orbit(logistic, x0=[0.5], period=2)
    >>> print(orbit.points[:, 0].round(6), orbit.multipliers.real.round(6), orbit.stable)
    [0.513045 0.799455] [0.16] True
    """
    return _solved(system, parameters, segments, x0, period, fix, free, tolerance)


@singledispatch
def _solved(
    system: HybridSystem | Map, parameters: Mapping[str, float] | None, segments: Sequence[Any] | None,
    x0: StateLike | None, period: float | None, fix: Mapping[str, float] | None, free: str | None, tolerance: float,
) -> PeriodicOrbit | MapOrbit:  # fmt: skip
    system = flowing(system)
    check_states(system)
    tol = check_tol(tolerance)
    p = system.parameter_vector(parameters)
    wish = read_fix(system, fix, free)
    signature, u = read_guess(system, p, segments, x0, period)
    with one_thread(len(system.states)):
        if wish is not None and not _has_it(system, signature, p, wish):
            return _converge_fixed(system, signature, u, p, tol, wish)
        return _converged(system, signature, u, p, tol)


def _converged(
    system: HybridSystem, signature: Signature, u: NDArray[np.float64], p: NDArray[np.float64], tol: float
) -> PeriodicOrbit:
    """Return the orbit of a signature near the unknowns `u`, cut where it is sensitive."""
    problem = OrbitProblem(system, signature, p, tol=tol)
    check_moves(problem, u)
    try:
        return in_pieces(converge(system, signature, u, p, tol))
    except ConvergenceError as error:
        if error.args[0] == ISOLATED:
            raise
        if (guess := (held if signature.kinds == (PHASE_END,) else flown)(problem, u)) is None:
            raise
    return solved_in_pieces(*guess)


@_solved.register(Map)
def _solved_map_orbit(
    system: Map, parameters: Mapping[str, float] | None, segments: Sequence[str] | None, x0: StateLike | None,
    period: int | None, fix: object, free: object, tolerance: float,
) -> MapOrbit:  # fmt: skip
    if fix is not None or free is not None or tolerance != 1e-12:
        wanted = "left out for a map"
        raise InputError("fix, free, tolerance", "given", wanted, "x0, period and an itinerary are its guess")
    return solve_map_orbit(system, parameters, segments, x0, period)


def check_tol(tol: object) -> float:
    """Return the relative tolerance of a step; raise `InputError` where there is none."""
    return checks.between("tolerance", tol, 1e-14, 1e-3)


def converge(
    system: HybridSystem, signature: Signature, u: NDArray[np.float64], p: NDArray[np.float64], tol: float
) -> PeriodicOrbit:
    """Return the orbit of a signature near the unknowns `u`, its segments' ends chosen to be regular."""
    check_size(system, signature)
    problem = OrbitProblem(system, signature, p, tol=tol)
    u = guess_on_plane(problem, u)
    given, first = u, problem
    try:
        u, J = solve_unknowns(problem, given)
        chosen, turned = settle_signature(problem, u)
        if chosen != signature:
            problem = OrbitProblem(system, chosen, p, tol=tol)
            u, J = solve_unknowns(problem, turned)
    except ConvergenceError as error:
        if of_a_family(first, given):
            why = why_a_family(first, given)
            raise ConvergenceError(ISOLATED, error.residual, error.iterations, why) from None
        raise
    u = unwrapped(problem, u)
    if stretched(problem, u, J):  # what is left of its equations is judged in pieces
        check_measured(piece_maps(problem, J))
        orbit = solved_in_pieces(*cut(problem, u, J)) if problem.signature.flies else orbit_at(problem, u, J)
    else:
        orbit = sound_orbit(problem, u, J)
    check_fields(problem)
    if undecided(problem, u, J, orbit.multipliers):
        return converge(system, signature, given, p, scales.FINEST)
    inner = nontrivial(orbit.multipliers, autonomous=system.phase is None)
    if np.any(np.abs(inner - 1.0) < scales.PERHAPS_OF_FAMILY) and of_a_family(first, given):
        raise ConvergenceError(ISOLATED, orbit.residual, 0, why_a_family(first, given))
    return orbit


def _has_it(system: HybridSystem, signature: Signature, p: NDArray[np.float64], wish: Wish) -> bool:
    """Return whether all orbits of a signature have the wanted period, which is that of the drive.

    Raises
    ------
    InputError
        The wanted period is another one, and no parameter is freed.
    """
    if wish.quantity.kind != "period" or wish.free or system.phase is None:
        return False
    rate = float(system.compiled.field(0, np.zeros(len(system.all_states)), p)[-1])
    period = system.turn * signature.turns / rate
    if not scales.near(wish.value, period, 0.0, scales.SOLVED):
        allowed = f"{period:.12g}, {signature.turns} periods of the drive"
        raise InputError("fix['period']", wish.value, allowed, "another period needs a parameter to free, as free='w'")
    return True


def _converge_fixed(
    system: HybridSystem, signature: Signature, u: NDArray[np.float64], p: NDArray[np.float64], tol: float, wish: Wish
) -> PeriodicOrbit:
    """Return the orbit of a signature near the unknowns `u` of which a quantity has the wanted value."""
    check_size(system, signature)
    problem = OrbitProblem(system, signature, p, tol=tol)
    equations, guess = unfolded_at(problem, guess_on_plane(problem, u), wish)
    equations, unknowns, J = solve_fixed(equations, guess, wish, solve_unknowns)
    problem = equations.problem
    chosen, turned = settle_signature(problem, unknowns)
    if chosen != problem.signature:
        like = OrbitProblem(system, chosen, problem.parameters_at(unknowns), tol=tol)
        equations, guess = unfolded_at(like, turned, wish)
        equations, unknowns, J = solve_fixed(equations, guess, wish, solve_unknowns)
    if stretched(equations.problem, unknowns, J[:-1]):
        equations, guess = unfolded_at(*cut(equations.problem, unknowns, J[:-1]), wish)
        equations, unknowns, J = solve_fixed(equations, guess, wish, solve_unknowns)
    check_family(equations, unknowns, J, wish)
    problem, own, fixed = within_family(equations, unknowns, p, wish)
    own = unwrapped(problem, own)
    orbit = sound_orbit(problem, own, problem.resolve(own)[1], fixed)
    check_fields(problem)
    return orbit


def check_fields(problem: OrbitProblem) -> None:
    """Raise `DefinitionError` where the orbit last surveyed passes a jump of a field."""
    _, ends, nodes, _ = problem.dense()
    for i, mode in enumerate(problem.signature.modes):
        states = nodes[ends[i] : ends[i + 1]]
        check_continuous(problem.system, np.full(len(states), mode), states, problem.extended)


def solve_unknowns(
    problem: OrbitProblem,
    u: NDArray[np.float64],
    unfolded: UnfoldedEquations | None = None,
    patience: tuple[int, float] = _PATIENCE,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return unknowns and Jacobian of an orbit near `u`, by damped Newton steps.

    Parameters
    ----------
    problem : OrbitProblem
        The segment equations.
    u : ndarray
        A guess.
    unfolded : UnfoldedEquations, optional
        Equations with a quantity fixed, in place of those of `problem` at fixed parameters.
    patience : (int, float), optional
        Newton steps, at most, and the least factor on one.

    Raises
    ------
    ConvergenceError
        The steps do not converge.
    """
    try:
        return _damped(problem, u, unfolded, patience)
    except ConvergenceError:
        sizes = partial(sizes_of_unknowns, problem)
        found = solved(problem, u, patience[0], sizes) if unfolded is None else None
        if found is None:
            raise
        return _accepted(problem, problem.evaluate, None, (found, problem.evaluate(found)[1]), problem.survey(found))


def _damped(
    problem: OrbitProblem, u: NDArray[np.float64], unfolded: UnfoldedEquations | None, patience: tuple[int, float]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return what `solve_unknowns` does, by Newton steps that are halved until the residual falls."""
    given, (most, least), u = u, patience, within_reach(problem, u)
    if problem.stiff and unfolded is None and (moved := started_elsewhere(problem, u)) is not None:
        u = within_reach(problem, moved[1])
    evaluate = problem.evaluate if unfolded is None else unfolded.evaluate
    scale = sizes_of_unknowns(problem, u)
    if unfolded is not None:
        scale = np.append(scale, 1.0)
    else:
        scale[problem.n :: problem.n + 1] /= 2.0 * math.pi  # a radian, within which a step of an orbit stays
    F, J = fitted(problem, evaluate, u)
    size, remeshed, landed, extent = float(np.abs(F).max()), 0, Landed(problem), _extent(problem, u)
    for iteration in range(most):
        if unfolded is not None and unfolded.turn_gap(u, J[:-1]):
            F, J = evaluate(u)
        try:
            step = newton_step(J, -landed.left(F), scale)
        except np.linalg.LinAlgError:
            raise ConvergenceError("periodic orbit", size, iteration, "the equations are singular there") from None
        length = float(np.max(np.abs(step) / scale))
        if not math.isfinite(length):
            break
        factor = min(1.0, 2.0 / length) if length > 2.0 else 1.0
        while True:
            if landed.follows and (there := landed.sought(evaluate, (u, F, J), step)) is not None:
                trial, F_new, J_new = there
                new = float(np.abs(landed.left(F_new)).max())
                break
            trial = u + factor * step
            F_new, J_new = evaluate(trial)
            new = float(np.abs(F_new).max())
            if new <= (1.0 - 0.2 * factor) * size or rounded(problem, length, new, (F_new, J_new, scale)):
                break
            if length < scales.SETTLED and landed.within(trial, F_new, J_new):
                break
            factor *= 0.5
            if factor < least:
                sought = unfolded is None and length < 1e-6
                if not sought or (there := landed.sought(evaluate, (u, F, J), step)) is None:
                    raise ConvergenceError("periodic orbit", size, iteration, _why(problem, u, size, extent))
                trial, F_new, J_new = there
                new, factor = float(np.abs(landed.left(F_new)).max()), 1.0
                break
        u, F, J, size = trial, F_new, J_new, new
        # next to a grazing the equations are so badly conditioned that rounding alone makes longer steps
        largest = float(problem.state_scale.max())
        rounding = size < scales.RESIDUAL_ROUNDING * largest and length < scales.STEP_AT_ROUNDING
        if factor == 1.0 and (length < scales.SETTLED or rounding):
            fine = problem.refine()
            survey = problem.survey(u) if fine else None
            coarse = survey is not None and survey.coarse
            periods = [float(x[problem.n :: problem.n + 1].sum()) for x in (u, given)]
            shrunk = problem.signature.kinds[0] == CLOSED_END and u[problem.n] < 0.2 * given[problem.n]
            if shrunk or periods[0] < scales.VANISHED * periods[1]:
                raise ConvergenceError("periodic orbit", size, iteration, "the period shrinks to nothing")
            if _extent(problem, u) < scales.VANISHED**2 * extent:
                raise ConvergenceError("periodic orbit", size, iteration, _why(problem, u, size, extent))
            if survey is not None and not coarse:
                return _accepted(problem, evaluate, landed if unfolded is None else None, (u, J), survey)
            if remeshed >= _REMESHED:
                raise ConvergenceError(
                    "periodic orbit", size, iteration, "its flow needs finer steps than a mesh can have"
                )
            if coarse:
                problem.start(u)
            remeshed += 1
            u, F, J = before_poles(problem, evaluate, u, scales.followed(problem.tol))
            size = float(np.abs(F).max())
        elif length > 1e-2 or iteration == 0:
            u = within_reach(problem, u)
            F, J = fitted(problem, evaluate, u)
            size = float(np.abs(F).max())
    raise ConvergenceError("periodic orbit", size, most, _why(problem, u, size, extent))


def _accepted(
    problem: OrbitProblem,
    evaluate: Callable[[NDArray[np.float64]], tuple[NDArray[np.float64], NDArray[np.float64]]],
    landed: Landed | None,
    at: tuple[NDArray[np.float64], NDArray[np.float64]],
    survey: Survey,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return unknowns and Jacobian of a solution: on the plane that it lies in, its flow with values on any mesh."""
    u, J = at
    plane = on_its_plane(problem, u, survey)
    if plane is not None and problem.start(plane) is None:
        problem.resolve(plane)  # meshes of what rests say nothing of what is beside it
        u, J = plane, evaluate(plane)[1]
    if landed is not None and landed.steep(u, J) and (safe := landed.on_any_mesh(u)) is not u:
        problem.start(safe)
        return safe, fitted(problem, evaluate, safe)[1]
    return u, J


def _extent(problem: OrbitProblem, u: NDArray[np.float64]) -> float:
    """Return how far an autonomous orbit's states move; 0 of a forced one, whose period a rest may share."""
    if problem.system.phase is not None:
        return 0.0
    survey = problem.survey(u)
    count = len(problem.system.states)
    moved = float(np.max(survey.highs[:count] - survey.lows[:count]))
    return moved if math.isfinite(moved) else 0.0 if problem.slides else math.inf


def _why(problem: OrbitProblem, u: NDArray[np.float64], size: float, extent: float) -> str:
    """Return why Newton's steps lead no further than `u`, with that residual, from an orbit of that extent."""
    if _extent(problem, u) < scales.VANISHED**2 * extent:
        return f"it shrinks to a rest at [{', '.join(f'{value:.6g}' for value in u[: problem.n])}]"
    if size < scales.RESIDUAL_LEAST * float(problem.state_scale.max()):
        return "the equations are singular there, as at a saddle-node or a branch point"
    return "start from a nearer guess"
