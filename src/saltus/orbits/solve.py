"""Periodic orbits from a guess: Newton's method on the segment equations."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from saltus import checks
from saltus.cycles import MapOrbit
from saltus.cycles.solve import solve_cycle
from saltus.errors import ConvergenceError, InputError, nearest
from saltus.flow.sticking import check_continuous
from saltus.orbits.cuts import cut, stretched
from saltus.orbits.families import of_a_family
from saltus.orbits.floquet import nontrivial
from saltus.orbits.orbit import PeriodicOrbit, orbit_at
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.signature import CLOSED_END, EVENT_END, MEAN_END, PHASE_END, Signature
from saltus.system import HybridSystem
from saltus.system.maps import Map, flowing

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["check_tol", "converge", "in_pieces", "settle_signature", "solve_orbit", "solve_unknowns"]

_MOST_UNKNOWNS = 4000  # unknowns of an orbit's equations, whose Jacobian is dense: 128 MB
_ITERATIONS = 40  # Newton steps, at most
_STEP_ACCEPTED = 1e-11  # largest Newton step, over the unknowns' sizes, of a converged orbit
_STEP_AT_ROUNDING = 1e-6  # the same where the residual is rounding
_RESIDUAL_ROUNDING = 1e-13  # residual, over the largest state's size, that is rounding
_VANISHED = 1e-3  # share of the guess's period below which an orbit has vanished; its square, of the guess's extent
_RESIDUAL_LEAST = 1e-11  # residual, over the largest state's size, that no nearer guess makes smaller
_REMESHED = 12  # most times that the meshes of one orbit are moved
_PERHAPS_ONE = 1e-2  # distance of a multiplier from 1 below which an orbit may be one of a family
_FAMILY = (
    "orbits form a family there at fixed parameters, as in a conservative system: add damping and a drive, or simulate"
)


@overload
def solve_orbit(
    system: HybridSystem,
    parameters: Mapping[str, float] | None = None,
    segments: Sequence[tuple[str, str | None, ArrayLike, float]] = (),
    *,
    tolerance: float = 1e-12,
) -> PeriodicOrbit: ...
@overload
def solve_orbit(
    system: Map,
    parameters: Mapping[str, float] | None = None,
    *,
    x0: ArrayLike | None = None,
    period: int | None = None,
    itinerary: Sequence[str] | None = None,
) -> MapOrbit: ...
def solve_orbit(
    system: HybridSystem | Map,
    parameters: Mapping[str, float] | None = None,
    segments: Sequence[tuple[str, str | None, ArrayLike, float]] = (),
    *,
    tolerance: float = 1e-12,
    x0: ArrayLike | None = None,
    period: int | None = None,
    itinerary: Sequence[str] | None = None,
) -> PeriodicOrbit | MapOrbit:
    """Return the periodic orbit of a system, or the cycle of a map, near a guess, stable or not.

    Parameters
    ----------
    system : HybridSystem or Map
        The system.
    parameters : mapping of str to float, optional
        Parameters that differ from the system's defaults.
    segments : sequence of (mode, transition, x0, duration)
        The guess, in order: where each segment runs, the transition that ends it, its initial state and its duration.
        With a phase, `x0` may leave it out: the first segment then starts at phase 0, and a last segment whose
        transition is the phase's name ends at phase 0 again. A segment that closes without any event has the phase's
        name, or None, as its transition.
    tolerance : float, optional
        Relative tolerance of the flow's steps.
    x0 : array_like, shape (states,) or (period, states), optional
        Of a map: a point of the cycle, or all of them. By default the origin, where an itinerary is given.
    period : int, optional
        Of a map: how many points are sought. By default as many as `itinerary` or `x0` has, else 1.
    itinerary : sequence of str, optional
        Of a map in pieces: the piece at each point. By default those at the guess, then those at the cycle found.

    Returns
    -------
    PeriodicOrbit or MapOrbit
        A cycle of a map has its least period: it may be a divisor of `period`.

    Raises
    ------
    InputError
        The segments do not fit the system, or an itinerary names no piece of the map.
    ConvergenceError
        Newton's method finds no orbit near the guess.
    MapDivergenceError
        The guess of a map's cycle leaves every bound.

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

    A cycle of a map:

    >>> from saltus import Map
    >>> logistic = Map(("x",), {"r": 3.2}, {"x": "r*x*(1 - x)"}, name="logistic map")
    >>> orbit = solve_orbit(logistic, x0=[0.5], period=2)
    >>> print(orbit.points[:, 0].round(6), orbit.multipliers.real.round(6), orbit.stable)
    [0.513045 0.799455] [0.16] True
    """
    if isinstance(system, Map):
        if len(segments) or tolerance != 1e-12:
            raise InputError(
                "segments, tolerance", "given", "left out for a map", "x0, period and itinerary are its guess"
            )
        return solve_cycle(system, parameters, x0, period, itinerary)
    flowing(system)
    if any(option is not None for option in (x0, period, itinerary)):
        raise InputError("x0, period, itinerary", "given", "left out for a HybridSystem", "its guess is in segments")
    tol = check_tol(tolerance)
    p = system.parameter_vector(parameters)
    signature, u = _read_segments(system, p, segments)
    return in_pieces(converge(system, signature, u, p, tol))


def check_tol(tol: object) -> float:
    """Return the relative tolerance of a step; raise `InputError` where there is none."""
    return checks.between("tolerance", tol, 1e-14, 1e-3)


def converge(
    system: HybridSystem, signature: Signature, u: NDArray[np.float64], p: NDArray[np.float64], tol: float
) -> PeriodicOrbit:
    """Return the orbit of a signature near the unknowns `u`, its segments' ends chosen to be regular."""
    most = _MOST_UNKNOWNS // (len(system.all_states) + 1)
    if len(signature) > most:
        raise InputError("segments of the orbit", len(signature), f"at most {most}", "its equations would be too large")
    problem = OrbitProblem(system, signature, p, tol=tol)
    given, first = u, problem
    try:
        u, J = solve_unknowns(problem, given)
        chosen, turned = settle_signature(problem, u)
        if chosen != signature:
            problem = OrbitProblem(system, chosen, p, tol=tol)
            u, J = solve_unknowns(problem, turned)
    except ConvergenceError as error:
        if of_a_family(first, given):
            raise ConvergenceError("isolated periodic orbit", error.residual, error.iterations, _FAMILY) from None
        raise
    orbit = orbit_at(problem, u, J)
    _, ends, nodes, _ = problem.dense()
    for i, mode in enumerate(chosen.modes):
        states = nodes[ends[i] : ends[i + 1]]
        check_continuous(system, np.full(len(states), mode), states, problem.extended)
    inner = nontrivial(orbit.multipliers, autonomous=system.phase is None)
    if np.any(np.abs(inner - 1.0) < _PERHAPS_ONE) and of_a_family(first, given):
        raise ConvergenceError("isolated periodic orbit", orbit.residual, 0, _FAMILY)
    return orbit


def in_pieces(orbit: PeriodicOrbit) -> PeriodicOrbit:
    """Return a smooth orbit cut where its sensitivities grow, solved again; the orbit itself where they do not."""
    if orbit.form.kinds[0] not in (PHASE_END, CLOSED_END):
        return orbit
    problem, u = orbit.problem(), orbit.unknowns
    J = problem.evaluate(u)[1]
    if not stretched(problem, J):
        return orbit
    problem, u = cut(problem, u, J)
    period = float(u[problem.n :: problem.n + 1].sum())
    scale = np.tile(np.append(problem.state_scale, period), problem.segments)
    for _ in range(_ITERATIONS):
        F, J = problem.evaluate(u)
        step = np.linalg.solve(J, -F)
        u = u + step
        if np.max(np.abs(step) / scale) < _STEP_ACCEPTED and problem.refine():
            return orbit_at(problem, u, problem.evaluate(u)[1])
    raise ConvergenceError("periodic orbit in pieces", float(np.abs(F).max()), _ITERATIONS, "start from a nearer guess")


def solve_unknowns(problem: OrbitProblem, u: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return unknowns and Jacobian of an orbit near `u`, by damped Newton steps at fixed parameters.

    Raises
    ------
    ConvergenceError
        The steps do not converge.
    """
    given = u
    u = _within_reach(problem, u)
    scale = np.tile(np.append(problem.state_scale, 1.0), problem.segments)
    F, J = problem.evaluate(u)
    size, remeshed = float(np.abs(F).max()), 0
    extent = _extent(problem, u)
    for iteration in range(_ITERATIONS):
        try:
            step = np.linalg.solve(J, -F)
        except np.linalg.LinAlgError:
            raise ConvergenceError("periodic orbit", size, iteration, "the equations are singular there") from None
        length = float(np.max(np.abs(step) / scale))
        if not math.isfinite(length):
            break
        factor = min(1.0, 2.0 / length) if length > 2.0 else 1.0
        while True:
            trial = u + factor * step
            F_new, J_new = problem.evaluate(trial)
            new = float(np.abs(F_new).max())
            if new <= (1.0 - 0.2 * factor) * size or (length < 1e-6 and new < 1e-6):
                break
            factor *= 0.5
            if factor < 1e-3:
                raise ConvergenceError("periodic orbit", size, iteration, _why(problem, u, size, extent))
        u, F, J, size = trial, F_new, J_new, new
        # next to a grazing the equations are so badly conditioned that rounding alone makes longer steps
        rounding = size < _RESIDUAL_ROUNDING * float(problem.state_scale.max()) and length < _STEP_AT_ROUNDING
        if factor == 1.0 and (length < _STEP_ACCEPTED or rounding):
            fine = problem.refine()
            coarse = fine and problem.survey(u).coarse
            if problem.signature.kinds[0] == CLOSED_END and u[problem.n] < 0.2 * given[problem.n]:
                raise ConvergenceError("periodic orbit", size, iteration, "the period shrinks to nothing")
            if u[problem.n :: problem.n + 1].sum() < _VANISHED * given[problem.n :: problem.n + 1].sum():
                raise ConvergenceError("periodic orbit", size, iteration, "the period shrinks to nothing")
            if _extent(problem, u) < _VANISHED**2 * extent:
                raise ConvergenceError("periodic orbit", size, iteration, _why(problem, u, size, extent))
            if fine and not coarse:
                return u, J
            if remeshed >= _REMESHED:
                raise ConvergenceError(
                    "periodic orbit", size, iteration, "its flow needs finer steps than a mesh can have"
                )
            if coarse:
                problem.start(u)
            remeshed += 1
            F, J = problem.evaluate(u)
            size = float(np.abs(F).max())
        elif length > 1e-2 or iteration == 0:
            u = _within_reach(problem, u)
            F, J = problem.evaluate(u)
            size = float(np.abs(F).max())
    raise ConvergenceError("periodic orbit", size, _ITERATIONS, _why(problem, u, size, extent))


def _extent(problem: OrbitProblem, u: NDArray[np.float64]) -> float:
    """Return how far an autonomous orbit's states move; 0 of a forced one, whose period a rest may share."""
    if problem.system.phase is not None:
        return 0.0
    survey = problem.survey(u)
    count = len(problem.system.states)
    moved = float(np.max(survey.highs[:count] - survey.lows[:count]))
    return moved if math.isfinite(moved) else 0.0


def _why(problem: OrbitProblem, u: NDArray[np.float64], size: float, extent: float) -> str:
    """Return why Newton's steps lead no further than `u`, with that residual, from an orbit of that extent."""
    if _extent(problem, u) < _VANISHED**2 * extent:
        return f"it shrinks to a rest at [{', '.join(f'{value:.6g}' for value in u[: problem.n])}]"
    if size < _RESIDUAL_LEAST * float(problem.state_scale.max()):
        return "the equations are singular there, as at a saddle-node or a branch point"
    return "start from a nearer guess"


def _within_reach(problem: OrbitProblem, u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return unknowns whose flow can be followed: durations that run into a singularity of the field are shortened."""
    u = u.copy()
    for _ in range(40):
        blocked = problem.start(u)
        if blocked is None:
            return u
        u[blocked * (problem.n + 1) + problem.n] *= 0.97
    hint = "the field is singular or the state diverges there"
    raise ConvergenceError("flow of a segment", math.inf, 0, hint)


def settle_signature(problem: OrbitProblem, u: NDArray[np.float64]) -> tuple[Signature, NDArray[np.float64]]:
    """Return signature and unknowns, the longest segment first, with mean-rate ends where one starts on its event.

    A segment that starts on the surface on which it ends has the trivial solution of zero length. That would make the
    equations singular at a grazing (docs/theory/orbits.md). The longest segment keeps its event as its end.
    """
    signature, n = problem.signature, problem.n
    blocks = u[: problem.size].reshape(problem.segments, n + 1).copy()
    if signature.kinds[0] in (PHASE_END, CLOSED_END):
        return signature, u
    first = int(
        np.argmax(blocks[:, n] >= (1.0 - 1e-6) * blocks[:, n].max())
    )  # ties go to the first, whatever the rounding
    if problem.system.phase is not None:
        blocks[:first, n - 1] += 2.0 * math.pi * signature.turns
    blocks = np.roll(blocks, -first, axis=0)
    if problem.system.phase is not None:
        blocks[:, n - 1] -= 2.0 * math.pi * math.floor(blocks[0, n - 1] / (2.0 * math.pi) + 1e-12)
    modes = np.roll(signature.modes, -first)
    transitions = np.roll(signature.transitions, -first)
    kinds = [EVENT_END]
    gradient = np.empty(2 + 2 * n)
    for block, transition in zip(blocks[1:], transitions[1:], strict=True):
        x = np.ascontiguousarray(block[:n])
        problem.system.compiled.call("event_x", int(transition), 0, x, problem.extended, gradient)
        size = float(np.abs(gradient[2 : 2 + n]) @ problem.state_scale)
        kinds.append(MEAN_END if abs(gradient[0]) < 1e-8 * size else EVENT_END)
    chosen = Signature(tuple(modes.tolist()), tuple(transitions.tolist()), tuple(kinds), signature.turns)
    return chosen, blocks.ravel()


def _read_segments(
    system: HybridSystem, p: NDArray[np.float64], given: Sequence[tuple[Any, ...]]
) -> tuple[Signature, NDArray[np.float64]]:
    segments = checks.listed("segments", given, "a sequence of (mode, transition, x0, duration)")
    if not segments:
        raise InputError("segments", segments, "one (mode, transition, x0, duration) or more")
    n = len(system.all_states)
    phase = None if system.phase is None else system.phase[0]
    rate = 0.0
    blocks, modes, transitions = np.empty((len(segments), n + 1)), [], []
    elapsed = 0.0
    for i, segment in enumerate(segments):
        parts = checks.listed(f"segments[{i}]", segment, "(mode, transition, x0, duration)", most=4)
        if len(parts) != 4:
            raise InputError(f"segments[{i}]", segment, "(mode, transition, x0, duration)")
        mode, transition, x0, duration = parts
        modes.append(system.mode_index(mode))
        transitions.append(_transition_index(system, mode, transition, i))
        duration = checks.positive(f"segments[{i}] duration", duration)
        x = system.full_state(x0, f"segments[{i}] x0")
        if phase is not None:
            if i == 0:
                field = system.compiled.field(modes[0], x, p)
                rate, elapsed = float(field[-1]), float(x[-1])
            elif np.size(x0) == len(system.states):
                x[-1] = elapsed
            else:
                x[-1] += 2.0 * math.pi * round((elapsed - x[-1]) / (2.0 * math.pi))
            elapsed += rate * duration
        blocks[i, :n], blocks[i, n] = x, duration
    turns = 0
    if phase is not None:
        turns = round((elapsed - blocks[0, n - 1]) / (2.0 * math.pi))
        if turns < 1:
            wanted = "durations that sum to a whole number of forcing periods, at least one"
            raise InputError(
                "segments", float(blocks[:, n].sum()), wanted, f"the forcing period is {2 * math.pi / rate:g}"
            )
    if transitions[-1] < 0 and len(segments) > 1:
        if modes[-1] != modes[0]:
            raise InputError(
                "segments", segments[-1][0], f"closed in the mode of the first segment, {segments[0][0]!r}"
            )
        last = blocks[-1].copy()
        last[n] += blocks[0, n]
        if phase is not None:
            last[n - 1] -= 2.0 * math.pi * turns
        blocks = np.vstack([last, blocks[1:-1]])
        modes, transitions = modes[:-1], transitions[:-1]
    if any(transition < 0 for transition in transitions[: None if len(transitions) > 1 else 0]):
        raise InputError("segments", [s[1] for s in segments], "a transition for each segment but the last")
    for i, transition in enumerate(transitions):
        if transition >= 0:
            target = system.mode_index(system.transitions[transition].target)
            if target != modes[(i + 1) % len(modes)]:
                name = system.transitions[transition].name
                wanted = f"{system.mode_names[target]!r}, where {name!r} leads"
                raise InputError(
                    f"segments[{(i + 1) % len(modes)}] mode", system.mode_names[modes[(i + 1) % len(modes)]], wanted
                )
    closing = PHASE_END if phase is not None else CLOSED_END
    kinds = (closing,) if transitions[0] < 0 else (EVENT_END,) * len(modes)
    return Signature(tuple(modes), tuple(transitions), kinds, turns), blocks.ravel()


def _transition_index(system: HybridSystem, mode: str, transition: str | None, i: int) -> int:
    closes = isinstance(transition, str) and system.phase is not None and transition == system.phase[0]
    if transition is None or closes:
        return -1
    names = [t.name for t in system.transitions if t.source == mode]
    if not isinstance(transition, str) or transition not in names:
        closing = [] if system.phase is None else [system.phase[0]]
        known = [*names, *closing]
        wanted = f"a transition out of {mode!r}: {', '.join(known) or 'none'}"
        raise InputError(f"segments[{i}] transition", transition, wanted, nearest(transition, known))
    return system.transition_names.index(transition)
