"""Orbits of the other branches that meet at a special point; continuation can start from each."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial, singledispatch
from typing import TYPE_CHECKING, Any, TypeVar, overload

import numpy as np

from saltus import checks
from saltus.continuation.core.interest import Interest
from saltus.continuation.core.monitor import Monitor
from saltus.continuation.core.point_types import CHANGES
from saltus.continuation.core.zero_problem import correct
from saltus.continuation.problems.boundary import TWO_FOLD
from saltus.continuation.problems.ends.boundary_cycles import cycles_at_boundary
from saltus.continuation.problems.grazing import Neighbour, neighbour, sides_met
from saltus.continuation.problems.margins import run_out, timed
from saltus.continuation.problems.orbit import OrbitZeroProblem
from saltus.continuation.results.special_points import SpecialPoint
from saltus.continuation.runs.births import AMPLITUDES, cycle_born, equilibrium_of_cycle, other_equilibria
from saltus.continuation.runs.map_switching import other_orbits
from saltus.continuation.runs.options import check_along_parameter
from saltus.continuation.runs.sizes import other_than, upwards
from saltus.equilibria import Equilibrium
from saltus.errors import ConvergenceError, InputError
from saltus.maps import MapOrbit
from saltus.orbits.cuts import whole
from saltus.orbits.find import once_round
from saltus.orbits.normal_forms import null_vectors
from saltus.orbits.orbit import PeriodicOrbit, orbit_at
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.signature import CLOSED_END, CUT_END, ON_BORDER, PHASE_END, WHOLE, Signature
from saltus.orbits.soundness import sound_orbit
from saltus.orbits.stability.critical import Branching, scaling
from saltus.scales import DIRECTIONS_ALIKE, FINEST, PERHAPS_ZERO, RESTING, TOUCHING, UNCHANGED_ALONE
from saltus.solution import Solution

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["doubled_orbit", "grazing_orbits", "other_solutions", "switch_branch"]

_AMPLITUDES = tuple(1e-3 * 0.25**k for k in range(8))  # steps onto the other branch, in the orbit's sizes, in turn


Wanted = TypeVar("Wanted", bound=Solution)


@overload
def switch_branch(point: SpecialPoint[MapOrbit], which: int = 0) -> MapOrbit: ...
@overload
def switch_branch(
    point: SpecialPoint[PeriodicOrbit] | SpecialPoint[Equilibrium], which: int = 0
) -> PeriodicOrbit | Equilibrium: ...
@overload
def switch_branch(point: SpecialPoint[Any], which: int = 0, *, to: type[Wanted]) -> Wanted: ...
def switch_branch(point: SpecialPoint[Any], which: int = 0, *, to: type[Solution] = Solution) -> Solution:
    """Return a solution of the other branch that meets the point's own branch at a special point.

    docs/theory/loci.md, "Other branches", derives the directions for orbits, docs/theory/equilibria.md those for
    equilibria.

    Parameters
    ----------
    point : SpecialPoint
        Of orbits: a PD, BP, GR, HB or BE of a branch, or a PD or GR of a locus. Of equilibria: an HB, BP or BE of a
        branch. Of orbits of a map: a PD or BP of a branch, or a PD of a locus.
    which : int
        Which of the other branches, from 0 on. There are several where several directions cross at once, as by
        symmetry: at a BP of equilibria, and at a BP or PD of a map. Of periodic orbits one is given then. At a BE there
        may be several cycles.
    to : type
        The class of the solution that is wanted, as ``PeriodicOrbit``; type checkers know by it what comes back. By
        default any: the point's type decides.

    Returns
    -------
    PeriodicOrbit, Equilibrium or MapOrbit
        At a PD an orbit of doubled period, at a BP an orbit of the other branch. Both lie a short step from the point
        and have their own value of the parameter. Where the period halves the orbit is one of the single period. At a
        GR the grazing orbit itself in a neighbouring signature: the second of `grazing_orbits`. `continue_orbit`
        follows the branch through the orbit. At an HB of equilibria a small cycle, at an HB or BE of cycles the
        equilibrium. At a BE of equilibria a small cycle that crosses the surface or slides along it. At a BC where an
        equilibrium meets an event of the cycle this equilibrium. At a BP of equilibria an equilibrium of the other
        branch, for `continue_equilibrium`.

    Raises
    ------
    InputError
        A point of another type, fewer other branches than `which` asks for, or a solution of another class than `to`.
    ConvergenceError
        No orbit of the other branch was found.

    References
    ----------
    Keller, in Applications of Bifurcation Theory, Academic Press 1977, 359-384 (bifurcation equation at a BP).

    Examples
    --------
    >>> from saltus import HybridSystem, Mode, Transition, continue_orbit, solve_orbit
    >>> logistic = HybridSystem(
    ...     ("x", "s"), {"r": 2.8}, {"carry": Mode({"x": "0", "s": "1"})},
    ...     [Transition("carry", "carry", "s - 1", 1, {"x": "r*x*(1 - x)", "s": "0"}, name="map")],
    ... )
    >>> orbit = solve_orbit(logistic, {}, [("carry", "map", [0.64, 0.0], 1.0)])
    >>> doubled = switch_branch(continue_orbit(orbit, "r", (2.5, 3.4))["PD1"])
    >>> len(doubled.signature), doubled.stable, doubled.parameters["r"] > 3.0
    (2, True, True)
    """
    checks.instance("point", point, SpecialPoint)
    chosen, found = checks.count("which", which, 0), other_solutions(point.solution, point)
    if chosen >= len(found):
        reason = f"so many other branches meet at {point.label}"
        if len(found) < point.multiplicity:
            reason = (
                f"{point.multiplicity} multipliers are critical at {point.label}, and of orbits one branch is given; "
                "break the symmetry a little, or solve an orbit beside the point"
            )
        raise InputError("which", which, f"less than {len(found)}", reason)
    return checks.instance(f"solution beside {point.label}", found[chosen], to)


@singledispatch
def other_solutions(solution: Solution, point: SpecialPoint[Any]) -> list[Any]:
    """Return a solution of each other branch at a special point; each kind of solution registers its own way.

    Parameters
    ----------
    solution : Solution
        That of the point.
    point : SpecialPoint
        As `switch_branch` takes it.

    Returns
    -------
    list of Solution

    Raises
    ------
    InputError
        No other branch meets there.
    ConvergenceError
        No solution of another branch was found.
    """
    raise InputError("point", point.type, f"one of {solution.noun} with other branches", "no other branch meets there")


@other_solutions.register
def _(solution: MapOrbit, point: SpecialPoint[Any]) -> list[Any]:
    return list(other_orbits(point))


@other_solutions.register
def _(solution: PeriodicOrbit, point: SpecialPoint[Any]) -> list[Any]:
    if point.type == "HB":
        return [equilibrium_of_cycle(solution)]
    check_along_parameter("point", point)
    if point.homoclinic is not None and point.type in (*CHANGES, "BE"):
        return [point.equilibrium]
    if point.type in CHANGES:
        _, *others = grazing_orbits(point)
        if not others:
            raise ConvergenceError("neighbouring signature", 0.0, 0, "none has the grazing orbit as well")
        return others[:1]
    if point.type == "PD":
        return [doubled_orbit(point)]
    if point.type == "BP":
        return [once_round(_other(point))]
    raise InputError("point", point.type, "of type PD, BP, GR, HB or BE", "no other branch meets there")


@other_solutions.register
def _(solution: Equilibrium, point: SpecialPoint[Any]) -> list[Any]:
    parameter = point.varied[0]
    sizes = np.ones(solution.state.size) if point.scale is None else np.maximum(point.scale, 1e-300)
    if point.type == "HB":
        return [cycle_born(solution, parameter, sizes)]
    if point.type == "BP":
        return other_equilibria(solution, parameter, point.tangent, sizes)
    if point.type == "BE" and point.of and point.kind != TWO_FOLD:
        check_along_parameter("point", point)
        return _born_at_boundary(point, sizes)
    raise InputError("point", point.type, "of type HB, BP or BE", "no other branch meets there")


def _born_at_boundary(point: SpecialPoint[Equilibrium], sizes: NDArray[np.float64]) -> list[PeriodicOrbit]:
    """Return the cycles that are born at a boundary equilibrium, one of each branch."""
    found = cycles_at_boundary(point.equilibrium, point.varied[0], point.of, sizes, AMPLITUDES)
    if not found:
        hint = "no motion beside it closes, by the linear flows on both sides of the surface"
        raise InputError("point", point.label, "a boundary equilibrium at which a cycle is born", hint)
    return found


def _parameter(point: SpecialPoint) -> tuple[int, float]:
    """Return the index of the parameter that varies at the point, and a unit for it.

    The unit is the parameter's value. Where the value may be rounding of zero, the unit is the change that alters the
    Jacobian of the equations by its own size.
    """
    name, orbit = point.varied[-1], point.orbit
    index, value = orbit.system.parameter_names.index(name), abs(point.parameters[name])
    if value > PERHAPS_ZERO:
        return index, value
    problem = orbit.problem(name)
    u = np.append(orbit.unknowns, point.parameters[name])
    columns, rows = scaling(problem, J := problem.resolve(u)[1], u)
    change = problem.second(u, np.append(np.zeros(problem.size), 1.0))
    sizes = [float(np.linalg.norm(rows[:, None] * part[:, : problem.size] * columns)) for part in (J, change)]
    return index, max(value, sizes[0] / sizes[1]) if sizes[1] > 0.0 else value or 1.0


def doubled_orbit(point: SpecialPoint, level: int = 0) -> PeriodicOrbit:
    """Return the orbit of doubled period beside a period doubling, the `level`-th of a cascade, counted from 0."""
    if point.tangent is not None:  # of a file over turns of the phase, in which the drive repeats: a branch point there
        return _other(point)
    orbit = point.orbit
    problem, u = orbit.problem(), orbit.unknowns
    q = null_vectors(problem, u, problem.resolve(u)[1], -1.0)[0].real
    form, n = orbit.form, problem.n
    if len(form) == 1 and form.kinds[0] in (PHASE_END, CLOSED_END):
        signature = Signature(form.modes, form.transitions, form.kinds, 2 * form.turns)
        start, direction = u.copy(), np.append(q[:n], 0.0)
        start[n] *= 2.0
    else:
        kinds = (CUT_END,) * len(form) if CUT_END in form.kinds else form.kinds
        signature = Signature(form.modes * 2, form.transitions * 2, form.kinds + kinds, 2 * form.turns)
        again = u.copy()
        if orbit.system.phase is not None:
            again[n - 1 :: n + 1] += orbit.system.turn * form.turns
        start, direction = np.concatenate([u, again]), np.concatenate([q, -q])
    index, scale = _parameter(point)
    start, direction = np.append(start, orbit_value(orbit, index) / scale), np.append(direction, 0.0)

    def step(sizes: NDArray[np.float64] | None) -> tuple[PeriodicOrbit, float, float]:
        return _step_off(orbit, signature, start, direction, index, scale, "doubled orbit", 0.5**level, sizes)

    return other_than(*_known_sizes(point), step, "doubled orbit")


def _known_sizes(point: SpecialPoint) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return the states' sizes on the point's orbit and in the tangent of its branch, and which states rest at 0.

    States at rest are small, and without them the others' motion is the same.
    """
    orbit = point.orbit
    sizes = np.array([max(abs(orbit.min[name]), abs(orbit.max[name])) for name in orbit.system.states])
    sizes = sizes if point.sizes is None else np.maximum(sizes, point.sizes)
    small = sizes < RESTING * float(sizes.max())
    if np.any(small):
        problem, u = orbit.problem(), orbit.unknowns.copy()
        blocks = u.reshape(problem.segments, problem.n + 1)
        blocks[:, np.flatnonzero(small)] = 0.0
        gaps = np.abs(problem.evaluate(u)[0]).reshape(blocks.shape)[:, : small.size].max(axis=0)
        small &= bool(np.all(gaps[~small] <= UNCHANGED_ALONE * sizes[~small]))
    return sizes, small


def orbit_value(orbit: PeriodicOrbit, index: int) -> float:
    """Return a parameter of an orbit by its index."""
    return orbit.parameters[orbit.system.parameter_names[index]]


def _other(point: SpecialPoint) -> PeriodicOrbit:
    known, resting = _known_sizes(point)
    return other_than(known, resting, partial(_beside, point, resting), "other branch")


def _beside(
    point: SpecialPoint, resting: NDArray[np.bool_], sizes: NDArray[np.float64] | None
) -> tuple[PeriodicOrbit, float, float]:
    """Return an orbit of the other branch at a BP, and how far its parameter and states are from the point's.

    sizes: (states,), if they are not those of the point's own branch.
    """
    orbit, sizes = point.orbit, point.sizes if sizes is None else sizes
    index, scale = _parameter(point)
    p = orbit.system.parameter_vector(orbit.parameters)
    problem = OrbitProblem(orbit.system, orbit.form, p, [index], np.array([scale]), orbit.tolerance)
    u = np.append(orbit.unknowns, orbit_value(orbit, index) / scale)
    problem.start(u, sizes)
    J = problem.resolve(u)[1]
    condition = Branching(problem, 0, u, J)
    condition.evaluate(u, np.zeros(1), J)
    first, second = condition.right
    bend = [condition.left @ problem.second(u, v) for v in (first, second)]
    a, b, c = float(bend[0] @ first), float(bend[0] @ second), float(bend[1] @ second)
    root = math.sqrt(max(b * b - a * c, 0.0))
    # a x^2 + 2 b x y + c y^2 = 0
    far = -(b + math.copysign(root, b))
    ways = [(far, a), (c, far)] if max(abs(far), abs(a), abs(c)) > 0.0 else [(1.0, 0.0), (0.0, 1.0)]
    # at a double root one of the two pairs may be zero
    directions = [x * first + y * second for x, y in ways if (x, y) != (0.0, 0.0)]
    if point.tangent is None:
        raise InputError("point", point.label, "a branch point of a branch", "one of a locus has no branch of its own")
    units = np.append(np.tile(np.append(problem.state_scale, orbit.period), problem.segments), 1.0)
    own = np.append(point.tangent[:-1], point.tangent[-1] / scale) / units
    own /= np.linalg.norm(own)
    likeness = [abs(float(own @ (d / units))) / float(np.linalg.norm(d / units)) for d in directions]
    if min(likeness) > 1.0 - DIRECTIONS_ALIKE:
        hint = "to second order both branches leave in the same direction"
        raise ConvergenceError("other branch", abs(root), 0, hint)
    chosen = directions[int(np.argmin(likeness))]
    if np.any(resting):
        chosen = upwards(chosen, chosen[: resting.size] / problem.state_scale[: resting.size] * resting)
    return _step_off(orbit, orbit.form, u, chosen, index, scale, "other branch", sizes=sizes)


def _step_off(
    orbit: PeriodicOrbit,
    signature: Signature,
    u: NDArray[np.float64],
    direction: NDArray[np.float64],
    index: int,
    scale: float,
    what: str,
    size: float = 1.0,
    sizes: NDArray[np.float64] | None = None,
) -> tuple[PeriodicOrbit, float, float]:
    """Return an orbit a step from `u` along a direction, corrected normally to it with the parameter free.

    How far its parameter, in units of `scale`, and its states at the segments' starts are from those of `u` comes too.
    """
    p = orbit.system.parameter_vector(orbit.parameters)
    reason = ""
    for amplitude in (size * step for step in _AMPLITUDES):
        # so near to the point a looser tolerance cannot tell the branches apart
        tol = min(orbit.tolerance, FINEST)
        problem = OrbitProblem(orbit.system, signature, p, [index], np.array([scale]), tol)
        problem.start(u, sizes)
        branch = OrbitZeroProblem(problem, u, Interest(-math.inf, math.inf, scale))
        weights = branch.metric(u)
        tangent = direction / math.sqrt(float(weights @ direction**2))
        point = correct(branch, u + amplitude * tangent, tangent, weights, 10)
        if isinstance(point, str):
            reason = point
            continue
        moved = point.u - u - amplitude * tangent
        if math.sqrt(float(weights @ moved**2)) > 0.5 * amplitude:
            reason = "it bends too sharply"
            continue
        found = sound_orbit(problem, point.u, problem.evaluate(point.u)[1])
        if found.admissible or not orbit.admissible:
            states = np.abs(point.u - u)[:-1].reshape(problem.segments, problem.n + 1)[:, : len(orbit.system.states)]
            return found, abs(float(point.u[-1] - u[-1])), float(states.max())
        reason = "; ".join(found.reasons)
    raise ConvergenceError(what, _AMPLITUDES[-1], len(_AMPLITUDES), reason)


def grazing_orbits(point: SpecialPoint) -> list[PeriodicOrbit]:
    """Return a grazing orbit in each of the signatures that meet at the grazing.

    docs/theory/continuation.md, "Change of signature at a grazing", describes them.

    Parameters
    ----------
    point : SpecialPoint
        A GR of a branch or of a locus, or another type at which the signature changes.

    Returns
    -------
    list of PeriodicOrbit
        The point's own orbit first. The orbits are one motion, cut into segments in different ways.

    Raises
    ------
    InputError
        A point of another type.

    Examples
    --------
    >>> from saltus import HybridSystem, Mode, Transition, continue_orbit, find_orbit
    >>> oscillator = HybridSystem(
    ...     ("x", "v"), {"c": 0.1, "d": 1.0, "e": 0.8, "w": 0.7, "A": 0.4},
    ...     {"free": Mode({"x": "v", "v": "A*cos(s) - c*v - x"})},
    ...     [Transition("free", "free", "x - d", 1, {"v": "-e*v"}, name="impact")], phase=("s", "w"),
    ... )
    >>> branch = continue_orbit(find_orbit(oscillator, x0=[0.0, 0.0]), "A", (0.4, 0.52), stop_at="GR")
    >>> [orbit.signature for orbit in grazing_orbits(branch["GR1"])]
    [(('free', 's'),), (('free', 'impact'),)]
    """
    if checks.instance("point", point, SpecialPoint).type not in CHANGES:
        raise InputError("point", point.type, f"of type {', '.join(CHANGES)}", "only there signatures meet")
    if point.homoclinic is not None:
        hint = f"at {point.label} an equilibrium meets the event {point.of!r}: switch_branch gives it"
        raise InputError("point", point.label, "one at which two signatures of a cycle meet", hint)
    orbit = point.orbit
    problem, u = orbit.problem(), orbit.unknowns
    if orbit.form.flies:
        problem, u = whole(problem, u)
    found, period, form = [orbit], orbit.period, problem.signature
    survey, durations = problem.survey(u), u[problem.n : problem.size : problem.n + 1]
    touching = [name for name, i in timed(orbit.system, form).items() if abs(durations[i]) < TOUCHING * period]
    touching += [] if touching else run_out(problem, u, survey)
    heights = np.ptp(np.stack([survey.lows, survey.highs]), axis=0)
    size = float(heights[: len(orbit.system.states)].max())
    touching += [
        Monitor("rate", i)
        for i, transition in enumerate(form.transitions)
        if transition >= 0 and abs(survey.rates[i, 0]) * period < TOUCHING * size and not touching
    ]
    near = (np.abs(survey.margins) < TOUCHING * size) & (survey.places != WHOLE)
    touching += [*(Monitor("margin", i, k) for i, k in np.argwhere(near).tolist()), *sorted(sides_met(problem, u))[:1]]
    for monitor in touching:
        beside = neighbour(problem, monitor, u)
        if isinstance(beside, Neighbour):
            p = orbit.system.parameter_vector(orbit.parameters)
            other = OrbitProblem(orbit.system, beside.signature, p, tol=orbit.tolerance)
            other.start(beside.u)
            again = orbit_at(other, beside.u, other.resolve(beside.u)[1])
            found.append(replace(again, faults=again.faults & ~ON_BORDER))
    return found
