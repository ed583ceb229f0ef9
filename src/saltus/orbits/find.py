"""Periodic orbits from a simulation: settle, recognise period and signature, correct."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from saltus import checks
from saltus.errors import ConvergenceError, SaltusError
from saltus.orbits.orbit import PeriodicOrbit
from saltus.orbits.problem import CLOSED_END, EVENT_END, PHASE_END, Signature
from saltus.orbits.rounds import divided, rounds_of
from saltus.orbits.solve import check_tol, converge, in_pieces
from saltus.system import HybridSystem

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from saltus.flow.simulate import EventLog

__all__ = ["find_orbit"]

_LONGEST = 16
_NEAR = 1e-3
_FAR = 0.1


def find_orbit(
    system: HybridSystem,
    parameters: Mapping[str, float] | None = None,
    x0: ArrayLike = (),
    mode: str | None = None,
    *,
    settle: float | None = None,
    tol: float = 1e-12,
) -> PeriodicOrbit:
    """Return the periodic orbit on which a motion settles.

    The motion is simulated until it recurs after 1 to 16 periods of the phase (or, in an autonomous system, after a
    cycle of events, or on a section across the motion where there are none); its signature is read off and the orbit
    corrected by Newton's method. What is found is stable and near the motion.

    Parameters
    ----------
    system : HybridSystem
        The system.
    parameters : mapping of str to float, optional
        Parameters that differ from the system's defaults.
    x0 : array_like, shape (states,) or (all states,)
        Where the motion starts, at phase 0 unless the phase is given, too.
    mode : str, optional
        Mode there; by default the first that the state allows.
    settle : float, optional
        Periods of the phase (or the time, in an autonomous system) after which the search is given up; 3000 periods, or
        3000 units of time.
    tol : float, optional
        Relative tolerance of the orbit's steps.

    Returns
    -------
    PeriodicOrbit

    Raises
    ------
    InputError
        A start or an option that cannot be used.
    ConvergenceError
        The motion does not become periodic: it is quasi-periodic, chaotic, at rest, or has a period above 16.
    ChatteringError, DivergenceError
        As `simulate`.

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
    from saltus.flow.run import starting_mode

    checks.instance("system", system, HybridSystem)
    tol = check_tol(tol)
    p = system.parameter_vector(parameters)
    x = system.full_state(x0)
    longest = 3000.0 if settle is None else checks.positive("settle", settle)
    start = starting_mode(system, x, p) if mode is None else system.mode_index(mode)
    search = _search_forced if system.phase is not None else _search_autonomous
    return in_pieces(search(system, p, x, start, longest, tol))


def _search_forced(
    system: HybridSystem, p: NDArray[np.float64], x: NDArray[np.float64], mode: int, longest: float, tol: float
) -> PeriodicOrbit:
    from saltus.flow.simulate import events_after, settle

    done, batch, recurrence = 0, 40, math.inf
    failure = ""
    while done < longest:
        x, mode = settle(system, p, x, mode, periods=batch)
        log = events_after(system, p, x, mode, periods=2 * _LONGEST + 1)
        done += batch + 2 * _LONGEST + 1
        wraps = np.flatnonzero(log.transition == -1)
        states = log.x_after[wraps][:, :-1]
        scale = _scale(np.vstack([log.x_before, log.x_after])[:, :-1])
        for turns in range(1, _LONGEST + 1):
            gap = float(np.max(np.abs(states[turns:] - states[:-turns]) / scale))
            recurrence = min(recurrence, gap)
            if gap < _NEAR:
                try:
                    orbit = _once_round(system, converge(system, *_read_forced(log, wraps, turns), p, tol), p)
                except SaltusError as error:
                    failure = str(error)
                    break
                away = float(np.max(np.abs(np.asarray(orbit.x0) - states) / scale, axis=1).min())
                if orbit.stable and orbit.admissible and away < _reach(orbit, gap):
                    return orbit
                failure = _why_not(orbit)
                break
        x, mode = log.x_end, log.mode_end
        batch *= 2
    hint = failure or "the motion is quasi-periodic or chaotic, or its period is above 16; see it with simulate"
    raise ConvergenceError("periodic attractor", recurrence, done, hint, unit="forcing periods")


def _reach(orbit: PeriodicOrbit, gap: float) -> float:
    """Return how far a motion that moves by `gap` a period may be from the orbit that it settles on."""
    size = max((abs(value) for value in orbit.multipliers.tolist()), default=0.0)
    return min(max(_NEAR, 3.0 * gap / max(1.0 - size, 1e-9)), _FAR)


def _why_not(orbit: PeriodicOrbit) -> str:
    if not orbit.admissible:
        return "; ".join(orbit.reasons)
    return "the orbit found is far from the motion" if orbit.stable else "the orbit near the motion is not stable"


def _once_round(system: HybridSystem, orbit: PeriodicOrbit, p: NDArray[np.float64]) -> PeriodicOrbit:
    """Return an orbit once round, where it was found as several rounds of a shorter one."""
    problem, u = orbit.problem(), orbit.unknowns
    count = rounds_of(problem, u)
    once = divided(problem, u, count) if count > 1 else None
    return orbit if once is None else converge(system, *once, p, orbit.tol)


def _scale(states: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the size of each state among those given; where one is nearly zero throughout, a little of the largest."""
    size = np.maximum(np.max(np.abs(states), axis=0), np.ptp(states, axis=0))
    return np.asarray(np.maximum(size, max(1e-3 * float(size.max()), 1e-12)))


def _read_forced(log: EventLog, wraps: NDArray[np.intp], turns: int) -> tuple[Signature, NDArray[np.float64]]:
    """Return signature and unknowns of the last `turns` periods."""
    first, last = wraps[-1 - turns], wraps[-1]
    period = float(log.time[last] - log.time[first])
    inside = np.arange(first + 1, last + 1)
    events = inside[log.transition[inside] >= 0]
    if not events.size:
        block = np.append(log.x_after[first], period)
        return Signature((int(log.mode_after[first]),), (-1,), (PHASE_END,), turns), block
    wound = 2.0 * math.pi * np.cumsum(log.transition[inside] == -1)[events - first - 1]
    return _cycle(log, events, period, wound, turns)


def _cycle(
    log: EventLog, events: NDArray[np.intp], period: float, wound: NDArray[np.float64] | None, turns: int
) -> tuple[Signature, NDArray[np.float64]]:
    """Return signature and unknowns of segments that start after the given events."""
    times = log.time[events]
    durations = np.append(np.diff(times), times[0] + period - times[-1])
    starts = log.x_after[events].copy()
    if wound is not None:
        starts[:, -1] += wound
    signature = Signature(
        tuple(log.mode_after[events].tolist()),
        tuple(np.roll(log.transition[events], -1).tolist()),
        (EVENT_END,) * len(events),
        turns,
    )
    return signature, np.column_stack([starts, durations]).ravel()


def _search_autonomous(
    system: HybridSystem, p: NDArray[np.float64], x: NDArray[np.float64], mode: int, longest: float, tol: float
) -> PeriodicOrbit:
    from saltus.flow.simulate import events_after, settle

    done, batch, recurrence = 0.0, min(50.0, longest), math.inf
    failure = ""
    while done < longest:
        x, mode = settle(system, p, x, mode, t=batch)
        log = events_after(system, p, x, mode, t=batch)
        done += 2.0 * batch
        found = _read_autonomous(log) if log.time.size else _read_smooth(system, p, x, mode, batch)
        if found is not None:
            signature, u, gap = found
            recurrence = min(recurrence, gap)
            if gap < _NEAR:
                try:
                    orbit = _once_round(system, converge(system, signature, u, p, tol), p)
                except SaltusError as error:
                    failure = str(error)
                else:
                    if orbit.stable and orbit.admissible:
                        return orbit
                    failure = _why_not(orbit)
        x, mode = log.x_end, log.mode_end
        batch = min(2.0 * batch, max(longest - done, 1.0) / 2.0) if done < longest else batch
    hint = failure or "the motion is quasi-periodic or chaotic, at rest, or slower than the time allowed; pass settle="
    raise ConvergenceError("periodic attractor", recurrence, int(done), hint, unit="units of time")


def _read_autonomous(log: EventLog) -> tuple[Signature, NDArray[np.float64], float] | None:
    """Return signature, unknowns and recurrence of the shortest cycle of events that repeats."""
    count = log.time.size
    kinds = max(len(set(log.transition.tolist())), 1)
    scale = _scale(np.vstack([log.x_before, log.x_after]))
    best: tuple[float, int] = (math.inf, 0)
    for length in range(1, min(_LONGEST * kinds, (count - 1) // 2) + 1):
        now, before = np.arange(count - length, count), np.arange(count - 2 * length, count - length)
        if before[0] < 0 or not np.array_equal(log.transition[now], log.transition[before]):
            continue
        gap = float(np.max(np.abs(log.x_after[now] - log.x_after[before]) / scale))
        best = min(best, (gap, length))
        if gap < _NEAR:
            break
    gap, length = best
    if not length:
        return None
    events = np.arange(count - length, count)
    period = float(log.time[-1] - log.time[-1 - length])
    return *_cycle(log, events, period, None, 0), gap


def _read_smooth(
    system: HybridSystem, p: NDArray[np.float64], x: NDArray[np.float64], mode: int, time: float
) -> tuple[Signature, NDArray[np.float64], float] | None:
    """Return signature, unknowns and recurrence of a motion without events, by its returns to a plane across it."""
    from saltus.flow.simulate import simulate

    parameters = dict(zip(system.parameter_names, p.tolist(), strict=True))
    path = simulate(system, parameters, x, mode=system.mode_names[mode], t_end=time)
    slope = system.compiled.field(mode, np.ascontiguousarray(x), p)
    times = np.linspace(0.0, time, 20_000)
    states = path(times)
    scale = _scale(states)
    if np.max(np.ptp(states, axis=0)) < 1e-9:
        return None
    across = (states - x) @ slope
    crossing = np.flatnonzero((across[:-1] < 0.0) & (across[1:] >= 0.0))
    if not crossing.size:
        return None
    share = -across[crossing] / (across[crossing + 1] - across[crossing])
    returns = times[crossing] + share * (times[crossing + 1] - times[crossing])
    gaps = np.max(np.abs(path(returns) - x) / scale, axis=1)
    first = int(np.argmax(gaps < _NEAR)) if np.any(gaps < _NEAR) else int(np.argmin(gaps))
    block = np.append(x, returns[first])
    return Signature((mode,), (-1,), (CLOSED_END,), 0), block, float(gaps[first])
