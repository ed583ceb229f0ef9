"""Periodic orbits from a simulation: settle, recognise period and signature, correct."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import singledispatch
from typing import TYPE_CHECKING, TypeAlias, overload

import numpy as np

from saltus import checks
from saltus.errors import ConvergenceError, DefinitionError, InputError, SaltusError, StiffnessError
from saltus.flow.landings import warn_behind_wall, warn_of
from saltus.flow.motion import EventDrivenMotion, start_state
from saltus.flow.shares import limit_of
from saltus.flow.sizes import ATOL, RTOL, STEPS_KEPT, Sizes, sizes_along, sizes_on_the_way
from saltus.flow.starting import phase_rate
from saltus.linear_threads import one_thread
from saltus.maps import MapOrbit
from saltus.maps.solve import find_map_orbit
from saltus.orbits.drift import drift_of, drift_of_samples
from saltus.orbits.guesses import check_states
from saltus.orbits.naming import UNSETTLED, Unsettled, kind_in_words, plane_returns
from saltus.orbits.orbit import PeriodicOrbit
from saltus.orbits.pieces import in_pieces
from saltus.orbits.rounds import shortest
from saltus.orbits.settling import Stretch, cycle_of, event_log, follow, rest_of, sizes_of
from saltus.orbits.signature import CLOSED_END, PHASE_END, Signature
from saltus.orbits.solve import check_tol, converge
from saltus.scales import DIED_AWAY, RECURS, SETTLES_ON
from saltus.system import HybridSystem
from saltus.system.angles import wrapped
from saltus.system.maps import Map, flowing

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.checks.states import StateLike
    from saltus.flow.event_logs import EventLog

__all__ = ["find_orbit", "once_round", "orbit_near"]

_LONGEST = 16  # periods, or cycles of events, of the longest orbit that is looked for
_STEPS = 1000  # steps allowed for each period or return
_MOST_EVENTS = 100_000  # transitions that are kept at the most
_BATCH = 1000  # steps after which an autonomous motion is first looked at
_EVENTS = 40  # transitions of each kind after which it is first looked at


_USER = 6  # calls from a warning to the user's: by way of the dispatch and of `find_orbit`

_UNKNOWN = f"{UNSETTLED.format(longest=_LONGEST)}: then settle= allows more returns; see it with simulate"

_Wanted: TypeAlias = tuple[float, float]  # tolerance of the orbit's steps, and size that diverges


@overload
def find_orbit(
    system: HybridSystem,
    parameters: Mapping[str, float] | None = None,
    x0: StateLike = (),
    *,
    mode: str | None = None,
    settle: float | None = None,
    tolerance: float = 1e-12,
    limit: float | None = None,
) -> PeriodicOrbit: ...
@overload
def find_orbit(
    system: Map,
    parameters: Mapping[str, float] | None = None,
    x0: StateLike = (),
    *,
    settle: float | None = None,
) -> MapOrbit: ...
def find_orbit(
    system: HybridSystem | Map,
    parameters: Mapping[str, float] | None = None,
    x0: StateLike = (),
    *,
    mode: str | None = None,
    settle: float | None = None,
    tolerance: float = 1e-12,
    limit: float | None = None,
) -> PeriodicOrbit | MapOrbit:
    """Return the periodic orbit on which a motion settles.

    The motion is simulated until it recurs after 1 to 16 periods of the drive (or, in an autonomous system, after a
    cycle of events, or on a section across the motion where there are none); its signature is read off and the orbit
    corrected by Newton's method. What is found is stable and near the motion. A motion of a map is iterated until it
    recurs after 1 to 256 iterations.

    Parameters
    ----------
    system : HybridSystem or Map
        The system.
    parameters : mapping of str to float, optional
        Parameters that differ from the system's defaults.
    x0 : array_like, shape (states,) or (all states,), or mapping of str to float
        Where the motion starts, at phase 0 unless the phase is given, too.
    mode : str, optional
        Mode there; by default the first that the state allows.
    settle : float, optional
        Periods of the phase after which the search is given up; in an autonomous system, transitions, or returns to a
        section across the motion where there are none. By default 3000. It also bounds the steps, 1000 for each. Of a
        map iterations, by default 200 000.
    tolerance : float, optional
        Relative tolerance of the orbit's steps.
    limit : float, optional
        Size beyond which a state that grows has diverged, as in `simulate`.

    Returns
    -------
    PeriodicOrbit or MapOrbit

    Raises
    ------
    InputError
        A start or an option that cannot be used; as a `DefinitionError`, the orbit passes a jump of a mode's field.
    ConvergenceError
        The motion does not become periodic: it is quasi-periodic or chaotic, with the leading Lyapunov exponent, has a
        period above 16, or settles slowly. Or it comes to rest, and where is said.
    StiffnessError
        The steps that `settle` allows do not reach so many periods, and too few of them to tell what the motion is.
    ChatteringError, DivergenceError
        As `simulate`.
    MapDivergenceError
        The motion of a map leaves every bound.

    Warns
    -----
    RuntimeWarning
        A transition of the orbit lands beyond an event of its target mode; see `PeriodicOrbit.landings_beyond`. Or the
        start lies behind a wall, which the motion would never have passed; the warning names the transition.

    Notes
    -----
    Whatever the units of the states and of time, the search counts periods, returns and steps, and measures states by
    their sizes along the motion. It keeps no more than 200 000 steps and 100 000 transitions in memory.

    Examples
    --------
    >>> from saltus import HybridSystem, Mode, Transition
    >>> oscillator = HybridSystem(
    ...     ("x", "v"), {"k": 1.0, "c": 0.1, "d": 1.0, "e": 0.8, "w": 1.0, "A": 1.0},
    ...     {"free": Mode({"x": "v", "v": "A*cos(s) - c*v - k*x"})},
    ...     [Transition("free", "free", "x - d", 1, {"v": "-e*v"}, name="impact")], phase=("s", "w"),
    ... )
    >>> find_orbit(oscillator, x0=[0.0, 0.0]).signature
    (('free', 'impact'),)
    """
    return _found(system, parameters, x0, mode, settle, tolerance, limit)


def orbit_near(
    system: HybridSystem, parameters: Mapping[str, float] | None, x0: StateLike, mode: str, settle: float | None = None
) -> PeriodicOrbit:
    """Return what `find_orbit` does of a start that no user gave: nothing is told of walls that it lies behind."""
    return _hybrid_orbit(system, parameters, x0, mode, settle, 1e-12, None)


@singledispatch
def _found(
    system: HybridSystem | Map, parameters: Mapping[str, float] | None, x0: StateLike, mode: str | None,
    settle: float | None, tolerance: float, limit: float | None,
) -> PeriodicOrbit | MapOrbit:  # fmt: skip
    return _hybrid_orbit(system, parameters, x0, mode, settle, tolerance, limit, told=True)


def _hybrid_orbit(
    system: HybridSystem | Map, parameters: Mapping[str, float] | None, x0: StateLike, mode: str | None,
    settle: float | None, tolerance: float, limit: float | None, *, told: bool = False,
) -> PeriodicOrbit:  # fmt: skip
    from saltus.flow.starting import passed_event, starting_mode

    system = flowing(system)
    check_states(system)
    tol = check_tol(tolerance)
    p = system.parameter_vector(parameters)
    x = wrapped(system.full_state(x0, mode=mode), system.angle_places)
    limit = limit_of(system.compiled, p, x) if limit is None else checks.positive("limit", limit)
    longest = 3000.0 if settle is None else checks.positive("settle", settle)
    start = starting_mode(system, x, p) if mode is None else system.mode_index(mode)
    if told:
        warn_behind_wall(system, p, x, start, level=_USER)
    search = _search_forced if system.phase is not None else _search_autonomous
    try:
        with one_thread(len(system.states)):
            orbit = in_pieces(search(system, p, x, start, longest, (tol, limit)))
    except StiffnessError as error:
        hint = f"settle= allows {_STEPS} steps for each period" + (f"; {error.args[4]}" if error.args[4] else "")
        raise StiffnessError(error.time, error.state, error.mode, error.steps, hint, error.stiff) from None
    if any(passed_event(system, system.mode_index(part.mode), part.state, p) for part in orbit.segments):
        warn_of(orbit.landings_beyond)
    return orbit


@_found.register(Map)
def _found_map_orbit(
    system: Map, parameters: Mapping[str, float] | None, x0: StateLike, mode: object, settle: float | None,
    tolerance: float, limit: float | None,
) -> MapOrbit:  # fmt: skip
    if mode is not None or tolerance != 1e-12 or limit is not None:
        raise InputError("mode, tolerance, limit", "given", "left out for a map", "the state decides on the piece")
    return find_map_orbit(system, parameters, x0, settle)


def _search_forced(
    system: HybridSystem, p: NDArray[np.float64], x: NDArray[np.float64], mode: int, longest: float, wanted: _Wanted
) -> PeriodicOrbit:
    (tol, limit), done, batch, recurrence, atol = wanted, 0, 40, math.inf, ATOL
    failure, ended = "", None
    # the first look takes its periods, however few `settle` asks for
    spent, most = 0, int(_STEPS * max(longest, batch + 2 * _LONGEST + 1))
    floor, size, period = np.zeros(x.size), np.ones(x.size), system.turn / phase_rate(system, p, x, mode)
    while done < longest and ended is None:
        kept = STEPS_KEPT if done == 0 else 0
        runs = [_begun(system, p, x, mode, (atol, limit), most - spent, kept)]
        try:
            if done == 0:  # a motion that dies away has no size of its own
                size = sizes_on_the_way(runs[0], period).of_states
                floor = DIED_AWAY * size
            runs[0].follow(math.inf, batch, None, keep=False)
            runs.append(_begun(system, p, runs[0].x, runs[0].mode, (atol, limit), most - spent - runs[0].tries))
            runs[1].follow(math.inf, 2 * _LONGEST + 1, _MOST_EVENTS)
        except StiffnessError as error:
            ended = error
            done, spent = done + sum(run.wraps for run in runs), spent + sum(run.tries for run in runs)
            x, mode = wrapped(runs[-1].x, system.angle_places), runs[-1].mode
            break
        run, seen = runs
        log = event_log(seen)
        done += batch + 2 * _LONGEST + 1
        spent += run.tries + seen.tries
        wraps = np.flatnonzero(log.transition == -1)
        if wraps.size <= 2 * _LONGEST:
            hint = f"{_MOST_EVENTS} transitions happen in {wraps.size} periods"
            raise ConvergenceError("periodic attractor", recurrence, done, hint, unit="forcing periods")
        states, places = log.x_after[wraps][:, :-1], system.angle_places
        sizes = sizes_along(system, p, log.x_end, log.mode_end, period, atol)
        floor = np.maximum(floor, DIED_AWAY * sizes.of_states)
        sizes = sizes.at_least(floor)
        scale, atol, size = sizes.of_gaps[:-1], sizes.atol, sizes.of_states
        for turns in range(1, _LONGEST + 1):
            gap = float(np.max(np.abs(wrapped(states[turns:] - states[:-turns], places)) / scale))
            recurrence = min(recurrence, gap)
            if gap < RECURS:
                try:
                    orbit = once_round(converge(system, *_read_forced(log, wraps, turns, system.turn), p, tol))
                except DefinitionError:
                    raise
                except SaltusError as error:
                    failure = str(error)
                    break
                away = float(np.max(np.abs(wrapped(orbit.x0 - states, places)) / scale, axis=1).min())
                if orbit.stable and orbit.admissible and away < _reach(orbit, gap):
                    return orbit
                failure = _why_not(orbit)
                break
        if (drift := drift_of(system, states, scale)) is not None:
            raise ConvergenceError("periodic attractor", recurrence, done, drift, unit="forcing periods")
        x, mode = wrapped(log.x_end, places), log.mode_end
        batch *= 2
    steps = spent / max(done, 1)
    motion = Unsettled(
        system, p, x, mode, atol, size, period, min(longest, most / steps) if done else 0.0, _LONGEST, steps, limit
    )
    words = kind_in_words(motion, slow=not failure) or failure
    if ended is not None and not words:
        raise ended
    raise ConvergenceError("periodic attractor", recurrence, done, words or _UNKNOWN, unit="forcing periods")


def _begun(
    system: HybridSystem, p: NDArray[np.float64], x: NDArray[np.float64], mode: int, within: _Wanted, steps: int,
    kept: int = 0,
) -> EventDrivenMotion:  # fmt: skip
    """Return a motion under way, with an absolute tolerance, a size that diverges, and a limit of steps."""
    atol, limit = within
    start = start_state(system, x)
    return EventDrivenMotion(system, p, start, mode, RTOL, atol, steps_kept=kept, most_steps=steps, limit=limit)


def _reach(orbit: PeriodicOrbit, gap: float) -> float:
    """Return how far a motion that moves by `gap` a period may be from the orbit that it settles on."""
    size = max((abs(value) for value in orbit.multipliers.tolist()), default=0.0)
    return min(max(RECURS, 3.0 * gap / max(1.0 - size, 1e-9)), SETTLES_ON)


def _why_not(orbit: PeriodicOrbit) -> str:
    if not orbit.admissible:
        return "; ".join(orbit.reasons)
    far = "the orbit found is far from the motion, which has not settled: settle= allows more periods"
    return far if orbit.stable else "the orbit near the motion is not stable"


def once_round(orbit: PeriodicOrbit) -> PeriodicOrbit:
    """Return the shortest orbit that an orbit goes round, itself where that is once."""
    once = None if orbit.form.turns == 1 else shortest(orbit.problem(), orbit.unknowns)[1]
    if once is None:
        return orbit
    return converge(orbit.system, *once, orbit.system.parameter_vector(orbit.parameters), orbit.tolerance)


def _read_forced(
    log: EventLog, wraps: NDArray[np.intp], turns: int, turn: float
) -> tuple[Signature, NDArray[np.float64]]:
    """Return signature and unknowns of the last `turns` periods, in each of which the phase goes on by `turn`."""
    first, last = wraps[-1 - turns], wraps[-1]
    period = float(log.time[last] - log.time[first])
    inside = np.arange(first + 1, last + 1)
    events = inside[log.transition[inside] >= 0]
    if not events.size:
        block = np.append(log.x_after[first], period)
        return Signature((int(log.mode_after[first]),), (-1,), (PHASE_END,), turns), block
    wound = turn * np.cumsum(log.transition[inside] == -1)[events - first - 1]
    return cycle_of(log, events, period, wound, turns)


def _search_autonomous(
    system: HybridSystem, p: NDArray[np.float64], x: NDArray[np.float64], mode: int, longest: float, wanted: _Wanted
) -> PeriodicOrbit:
    (tol, limit), done, spent, batch, recurrence, atol = wanted, 0.0, 0, 1, math.inf, ATOL
    failure, places, floor = "", system.angle_places, np.zeros(x.size)
    kinds = max(len(system.transitions), 1)
    while done < longest and spent < _STEPS * longest:
        gone = follow(system, p, x, mode, batch * _BATCH, batch * kinds * _EVENTS, atol, limit, sampled=False)
        begin, x, mode = x, wrapped(gone.log.x_end, places), gone.log.mode_end
        seen = follow(system, p, x, mode, batch * _BATCH, kinds * (2 * _LONGEST + 1), atol, limit, sampled=True)
        spent += gone.tries + seen.tries
        sizes = sizes_of(system, p, seen)
        floor = np.maximum(floor, DIED_AWAY * sizes.of_states)  # a state that dies away has no size of its own
        sizes = sizes.at_least(floor)
        atol = sizes.atol
        if seen.events:
            done += gone.events + seen.events
            found = _read_autonomous(seen.log, sizes.of_gaps, places)
            drift = drift_of(system, seen.log.x_after[:-1], sizes.of_gaps)
        else:
            before = seen.states[0] if gone.events else begin
            if (rest := rest_of(system, p, before, seen, sizes.of_states)) is not None:
                where = ", ".join(
                    f"{name} = {value:.6g}" for name, value in zip(system.states, wrapped(rest, places), strict=True)
                )
                hint = f"the motion comes to rest in mode {system.mode_names[mode]!r} at {where}, an equilibrium"
                gap = float(np.max(np.abs(seen.log.x_end - rest) / sizes.of_states))
                raise ConvergenceError("periodic attractor", gap, spent, hint, unit="steps")
            returns = plane_returns(system, p, seen, sizes.of_gaps)
            done += returns.size * (1.0 + gone.tries / seen.tries)
            found = _read_smooth(seen, returns, sizes.of_gaps, places)
            drift = drift_of_samples(system, seen.states, sizes.of_gaps)
        if found is not None:
            signature, u, gap = found
            recurrence = min(recurrence, gap)
            if gap < RECURS:
                try:
                    orbit = once_round(converge(system, signature, u, p, tol))
                except DefinitionError:
                    raise
                except SaltusError as error:
                    failure = str(error)
                else:
                    if orbit.stable and orbit.admissible:
                        return orbit
                    failure = _why_not(orbit)
        if drift is not None:
            raise ConvergenceError("periodic attractor", recurrence, int(done), drift, unit="returns")
        x, mode = wrapped(seen.log.x_end, places), seen.log.mode_end
        batch *= 2
    motion = _unsettled(system, p, seen, sizes, limit, longest)
    hint = kind_in_words(motion, slow=not failure) or failure or _UNKNOWN
    if hint == _UNKNOWN and done < longest:
        held = "it is stiff there: stability holds its steps" if seen.stiff else "a limit of work: it hardly returns"
        hint = f"{spent} steps are all that settle allows, {held}; pass a larger settle="
    raise ConvergenceError("periodic attractor", recurrence, int(done), hint, unit="returns")


def _unsettled(
    system: HybridSystem, p: NDArray[np.float64], seen: Stretch, sizes: Sizes, limit: float, longest: float
) -> Unsettled:
    """Return an autonomous motion on which no orbit was found, by its last stretch."""
    if seen.events:
        which, counts = np.unique(seen.log.transition, return_counts=True)
        transition, count = int(which[np.argmax(counts)]), int(counts.max())
    else:
        transition, count = -1, plane_returns(system, p, seen, sizes.of_gaps).size
    x, mode = wrapped(seen.log.x_end, system.angle_places), seen.log.mode_end
    time, steps = seen.log.t_end / max(count, 1), seen.tries / max(count, 1)
    left = min(longest, _STEPS * longest / steps) if count else 0.0
    return Unsettled(
        system, p, x, mode, sizes.atol, sizes.of_states, time, left, _LONGEST, steps, limit, transition
    )  # fmt: skip


def _read_autonomous(
    log: EventLog, scale: NDArray[np.float64], places: NDArray[np.int64]
) -> tuple[Signature, NDArray[np.float64], float] | None:
    """Return signature, unknowns and recurrence of the shortest cycle of events that repeats."""
    count = log.time.size
    kinds = max(len(set(log.transition.tolist())), 1)
    best: tuple[float, int] = (math.inf, 0)
    for length in range(1, min(_LONGEST * kinds, (count - 1) // 2) + 1):
        now, before = np.arange(count - length, count), np.arange(count - 2 * length, count - length)
        if before[0] < 0 or not np.array_equal(log.transition[now], log.transition[before]):
            continue
        gap = float(np.max(np.abs(wrapped(log.x_after[now] - log.x_after[before], places)) / scale))
        best = min(best, (gap, length))
        if gap < RECURS:
            break
    gap, length = best
    if not length:
        return None
    events = np.arange(count - length, count)
    period = float(log.time[-1] - log.time[-1 - length])
    return *cycle_of(log, events, period, None, 0), gap


def _read_smooth(
    seen: Stretch, returns: NDArray[np.float64], scale: NDArray[np.float64], places: NDArray[np.int64]
) -> tuple[Signature, NDArray[np.float64], float] | None:
    """Return signature, unknowns and recurrence of a motion without events, by its returns to a plane across it."""
    if not returns.size:
        return None
    x = seen.states[0]
    gaps = np.max(np.abs(wrapped(seen.at(returns) - x, places)) / scale, axis=1)
    first = int(np.argmax(gaps < RECURS)) if np.any(gaps < RECURS) else int(np.argmin(gaps))
    block = np.append(x, returns[first])
    return Signature((seen.mode,), (-1,), (CLOSED_END,), 0), block, float(gaps[first])
