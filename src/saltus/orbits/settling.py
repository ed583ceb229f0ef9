"""Stretches of a motion, counted in steps and transitions; how large its states are; whether it comes to rest."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from saltus.flow.observables import dense_states
from saltus.flow.run import Run, start_state
from saltus.flow.simulate import EventLog, event_log

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.system import HybridSystem

__all__ = ["ATOL", "RTOL", "Sizes", "Stretch", "event_log", "follow", "rest_of", "sizes_along", "sizes_of"]

RTOL, ATOL = 1e-10, 1e-12  # tolerances of a motion's steps; the second for states of size 1 or more
_STEPS_KEPT = 1024
_MOST_KEPT = 200_000  # steps of dense output: some 60 bytes each and state
_SAMPLES = 8  # of a step
_EPSILON = 2.220446049250313e-16
_TOLD = 1e4  # a size has to be so many times what rounding makes of the state for differences of it to be told
_STILL = 1e-9  # change of a state over a stretch, relative to its size, that is none
_NEARER = 1e-2  # share of its distance from an equilibrium that a motion keeps, at the most, where it comes to rest
_NEWTON = 30
_FOR_EVER = 1e200  # time to which the steps of a motion at rest soon grow


@dataclass(frozen=True)
class Stretch:
    """A stretch of a motion.

    Attributes
    ----------
    mode : int
        Index of the mode at the start.
    log : EventLog
        Its events and end.
    events, tries : int
        Transitions passed and steps tried.
    steps : tuple of ndarray
        Start and length, state at the start and dense output of each step; nothing where steps were not kept.
    times : ndarray, shape (sample,)
        Times of samples, some to a step.
    states : ndarray, shape (sample, all states)
        Full states then.
    """

    mode: int
    log: EventLog
    events: int
    tries: int
    steps: tuple[NDArray[np.float64], ...]
    times: NDArray[np.float64]
    states: NDArray[np.float64]

    def at(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return full states at times of the stretch, shape (time, all states)."""
        spans, starts, dense = self.steps
        step = np.clip(np.searchsorted(spans[:, 0], times, side="right") - 1, 0, len(spans) - 1)
        return dense_states(starts[step], dense[step], (times - spans[step, 0]) / spans[step, 1])


@dataclass(frozen=True)
class Sizes:
    """How large states are along a motion, each shape (all states,).

    Attributes
    ----------
    of_states : ndarray
        Largest sizes, where they are more than rounding.
    of_gaps : ndarray
        Against which differences of states are measured: no less than what can be told from rounding.
    """

    of_states: NDArray[np.float64]
    of_gaps: NDArray[np.float64]

    def at_least(self, floor: NDArray[np.float64]) -> Sizes:
        """Return the sizes, none below `floor`, shape (all states,)."""
        return Sizes(np.maximum(self.of_states, floor), np.maximum(self.of_gaps, floor))

    @property
    def atol(self) -> float:
        """Absolute tolerance of the motion's steps."""
        return ATOL * min(1.0, float(self.of_states.min()))


def follow(
    system: HybridSystem,
    p: NDArray[np.float64],
    x: NDArray[np.float64],
    mode: int,
    tries: int,
    n_events: int,
    atol: float,
    *,
    sampled: bool,
) -> Stretch:
    """Follow a motion for so many steps or transitions, whichever comes first; at most 200 000 steps are kept."""
    run = Run(system, p, start_state(system, x), mode, RTOL, atol, steps_kept=_STEPS_KEPT if sampled else 0)
    run.follow_for(min(tries, _MOST_KEPT) if sampled else tries, n_events, t_end=_FOR_EVER, keep=sampled)
    steps: tuple[NDArray[np.float64], ...] = ()
    times, states = np.empty(0), np.empty((0, run.x.size))
    if sampled:
        spans, _, starts, dense = run.steps()
        steps = spans, starts, dense
        at, share = np.repeat(np.arange(len(spans)), _SAMPLES), np.tile(np.arange(_SAMPLES) / _SAMPLES, len(spans))
        times = np.append(spans[at, 0] + share * spans[at, 1], run.time)
        states = np.vstack([dense_states(starts[at], dense[at], share), run.x])
    return Stretch(mode, event_log(run), run.events_passed, run.tries, steps, times, states)


def sizes_of(system: HybridSystem, p: NDArray[np.float64], seen: Stretch) -> Sizes:
    """Return how large states are along a stretch whose steps were kept."""
    return _sizes(system, p, seen.log.x_end, seen.log.mode_end, seen.states, 30.0 * seen.log.t_end / max(seen.tries, 1))


def sizes_along(
    system: HybridSystem, p: NDArray[np.float64], x: NDArray[np.float64], mode: int, time: float, atol: float
) -> Sizes:
    """Return how large states are along a motion for some time, or 200 000 steps if these end before."""
    run = Run(system, p, start_state(system, x), mode, RTOL, atol, steps_kept=_STEPS_KEPT)
    run.follow_for(_MOST_KEPT, _MOST_KEPT, t_end=time)
    return _sizes(system, p, run.x, run.mode, run.steps()[2], time)


def _sizes(
    system: HybridSystem,
    p: NDArray[np.float64],
    x: NDArray[np.float64],
    mode: int,
    states: NDArray[np.float64],
    time: float,
) -> Sizes:
    size = np.max(np.abs(states), axis=0)
    top = max(float(size.max()), 1e-300)
    J = np.abs(_jacobian(system, p, x, mode)[1])
    rounding = _EPSILON * time * (np.where(np.isfinite(J), J, 0.0) @ size)
    size = np.maximum(size, rounding / ATOL)
    size[size == 0.0] = top
    return Sizes(size, np.maximum(size, _TOLD * rounding))


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
    still = bool(np.all(np.abs(rate) * seen.log.t_end <= _STILL * size))
    found = _equilibrium(system, p, after, seen.mode, size)
    if found is None:
        return after if still else None
    x, J = found
    stable = bool(np.all(np.linalg.eigvals(J).real < 0.0))
    gap = np.max(np.abs(np.array([before, after]) - x) / size, axis=1)
    if (stable and gap[1] <= max(_NEARER * gap[0], _STILL)) or (still and gap[1] <= _STILL):
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
        if length < _EPSILON / ATOL:
            return x, J
    return None


def _jacobian(
    system: HybridSystem, p: NDArray[np.float64], x: NDArray[np.float64], mode: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Field and its derivative in the state."""
    return system.compiled.linearised(mode, x, system.compiled.extended(p))
