"""Stretches of a motion, counted in steps and transitions; how large its states are; whether it comes to rest."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from saltus.flow.event_logs import EventLog, event_log
from saltus.flow.motion import EventDrivenMotion, start_state
from saltus.flow.sizes import ATOL, EPSILON, MOST_KEPT, RTOL, STEPS_KEPT, Sizes, sizes_from
from saltus.flow.stretch import dense_states
from saltus.orbits.signature import EVENT_END, Signature
from saltus.scales import COMES_TO_REST, UNMOVED
from saltus.system.angles import TURN, wrapped

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.system import HybridSystem

__all__ = ["Stretch", "cycle_of", "event_log", "follow", "rest_of", "sizes_of"]

_SAMPLES = 8  # of a step
_NEWTON = 30  # Newton steps to an equilibrium, at most
_FOR_EVER = 1e200  # time to which the steps of a motion at rest soon grow


@dataclass(frozen=True)
class Stretch:
    """A stretch of a motion."""

    mode: int  # index of the mode at the start
    log: EventLog  # its events and end
    # events, tries: transitions passed and steps tried
    events: int
    tries: int
    # start and length, state at the start and dense output of each step; nothing where steps were not kept
    steps: tuple[NDArray[np.float64], ...]
    times: NDArray[np.float64]  # shape (sample,): times of samples, some to a step
    states: NDArray[np.float64]  # shape (sample, all states): full states then
    stiff: bool  # whether stability, not accuracy, held its steps

    def at(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return full states at times of the stretch, shape (time, all states)."""
        spans, starts, dense = self.steps
        step = np.clip(np.searchsorted(spans[:, 0], times, side="right") - 1, 0, len(spans) - 1)
        return dense_states(starts[step], dense[step], (times - spans[step, 0]) / spans[step, 1])


def follow(
    system: HybridSystem,
    p: NDArray[np.float64],
    x: NDArray[np.float64],
    mode: int,
    tries: int,
    n_events: int,
    atol: float,
    limit: float | None = None,
    *,
    sampled: bool,
) -> Stretch:
    """Follow a motion for `tries` steps or `n_events` transitions, whichever is first; keep at most 200 000 steps."""
    run = EventDrivenMotion(
        system, p, start_state(system, x), mode, RTOL, atol, steps_kept=STEPS_KEPT if sampled else 0, limit=limit
    )
    longest = min(_turning_time(system, p, x, mode, tries), _FOR_EVER)
    run.follow_for(min(tries, MOST_KEPT) if sampled else tries, n_events, t_end=longest, keep=sampled)
    steps: tuple[NDArray[np.float64], ...] = ()
    times, states = np.empty(0), np.empty((0, run.x.size))
    if sampled:
        spans, _, starts, dense = run.steps()
        steps = spans, starts, dense
        counts = _samples_of(np.vstack([starts, run.x]), system.angle_places)
        at = np.repeat(np.arange(len(spans)), counts)
        share = (np.arange(at.size) - np.repeat(np.cumsum(counts) - counts, counts)) / counts[at]
        times = np.append(spans[at, 0] + share * spans[at, 1], run.time)
        states = np.vstack([dense_states(starts[at], dense[at], share), run.x])
    return Stretch(mode, event_log(run), run.events_passed, run.tries, steps, times, states, run.stiff)


def _turning_time(system: HybridSystem, p: NDArray[np.float64], x: NDArray[np.float64], mode: int, turns: int) -> float:
    """Return the time of so many turns of the fastest angle; infinite where none turns.

    Steps of a uniform rotation grow without bound: their count bounds neither the time nor the turns.
    """
    if not system.angle_places.size:
        return math.inf
    rates = system.compiled.field(mode, np.ascontiguousarray(start_state(system, x)), p)[system.angle_places]
    fastest = float(np.abs(rates).max())
    return turns * TURN / fastest if fastest > 0.0 else math.inf


def _samples_of(states: NDArray[np.float64], places: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the samples of each step between states: as many to a turn of an angle as there are to a step."""
    turned = np.abs(np.diff(states[:, places], axis=0)).max(axis=1, initial=0.0) / TURN
    return np.asarray(np.maximum(np.ceil(_SAMPLES * turned), _SAMPLES), dtype=np.int64)


def sizes_of(system: HybridSystem, p: NDArray[np.float64], seen: Stretch) -> Sizes:
    """Return how large states are along a stretch whose steps were kept."""
    time, weights = 30.0 * seen.log.t_end / max(seen.tries, 1), np.gradient(seen.times)
    mean = weights @ np.abs(seen.states) / weights.sum()
    return sizes_from(system, p, seen.log.x_end, seen.log.mode_end, seen.states, time, mean)


def rest_of(
    system: HybridSystem,
    p: NDArray[np.float64],
    before: NDArray[np.float64],
    seen: Stretch,
    size: NDArray[np.float64],
) -> NDArray[np.float64] | None:
    """Return the equilibrium to which a motion comes in a stretch without events; None where it does not.

    before : ndarray, shape (n,), a state earlier in the same mode; size : ndarray, shape (n,), of the states.
    """
    after = seen.states[-1]
    rate, _ = _jacobian(system, p, after, seen.mode)
    still = bool(np.all(np.abs(rate) * seen.log.t_end <= UNMOVED * size))
    found = _equilibrium(system, p, after, seen.mode, size)
    if found is None:
        return after if still else None
    x, J = found
    stable = bool(np.all(np.linalg.eigvals(J).real < 0.0))
    gap = np.max(np.abs(wrapped(np.array([before, after]) - x, system.angle_places)) / size, axis=1)
    if (stable and gap[1] <= max(COMES_TO_REST * gap[0], UNMOVED)) or (still and gap[1] <= UNMOVED):
        return x
    return None


def _equilibrium(
    system: HybridSystem, p: NDArray[np.float64], x: NDArray[np.float64], mode: int, size: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """Return the equilibrium near x with the Jacobian there, by Newton's method; None where there is none."""
    x = x.copy()
    for _ in range(_NEWTON):
        rate, J = _jacobian(system, p, x, mode)
        if not (np.isfinite(rate).all() and np.isfinite(J).all()):
            return None
        try:
            step = np.linalg.solve(J * size, -rate)
        except np.linalg.LinAlgError:
            return None
        length = float(np.max(np.abs(step)))
        if not length < math.inf:
            return None
        x += size * step
        if length < EPSILON / ATOL:
            return x, J
    return None


def _jacobian(
    system: HybridSystem, p: NDArray[np.float64], x: NDArray[np.float64], mode: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Field and its derivative in the state."""
    return system.compiled.linearised(mode, x, system.compiled.extended(p))


def cycle_of(
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
