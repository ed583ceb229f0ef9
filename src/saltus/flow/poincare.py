"""The Poincare map of a hybrid flow: returns of a motion to a section, after some that are dropped."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from saltus.errors import InputError, StiffnessError
from saltus.flow.motion import EventDrivenMotion, check_tolerances, start_state
from saltus.flow.starting import domain_value, passed_event
from saltus.flow.taylor import ORDER, STEPS_A_RETURN, TaylorRun
from saltus.result import frozen

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from saltus.system.hybrid import HybridSystem

__all__ = ["EventSection", "PoincareReturns", "admits", "iterate"]

_BATCH = 1024  # returns between two clearances of what the engine keeps


@dataclass(frozen=True)
class EventSection:
    """A section that a motion passes where one of some transitions happens."""

    transitions: tuple[int, ...]  # their indices
    # time without a return after which the motion is taken not to return; fewer returns are kept then
    longest: float = math.inf


@dataclass(frozen=True)
class PoincareReturns:
    """Returns of a motion to a section, made by `iterate`."""

    # shape (return, all states): full states on the section: at phase 0, or before the transition
    states: NDArray[np.float64]
    modes: NDArray[np.int64]  # shape (return,): indices of the modes there
    times: NDArray[np.float64]  # shape (return,): times since the start
    # shape (all states,): full state from which the motion goes on: after the last return's transition, if it was one
    x_end: NDArray[np.float64]
    mode_end: int  # index of the mode then


def iterate(
    system: HybridSystem,
    p: NDArray[np.float64],
    x: ArrayLike,
    mode: int,
    *,
    discard: int,
    keep: int,
    section: EventSection | None = None,
    tolerance: tuple[float, float] = (1e-10, 1e-12),
    limit: float | None = None,
) -> PoincareReturns:
    """Return the returns of a motion to a section after the first `discard` of them.

    Parameters
    ----------
    system, p, x, mode
        As in `saltus.flow.event_logs.events_after`.
    discard, keep : int
        Returns that are dropped, then kept; what is dropped takes no memory.
    section : EventSection, optional
        The transitions at which the motion returns; by default it does at phase 0.
    tolerance : (float, float), optional
        Relative and absolute tolerance of a step.
    limit : float, optional
        Size beyond which a state that grows has diverged, as in `simulate`.

    Raises
    ------
    InputError
        No section, or tolerances that cannot be used.
    ChatteringError, DivergenceError
        As `simulate`.
    StiffnessError
        The motion takes more than 5000 steps a return.

    Examples
    --------
    >>> from saltus.system.hybrid import HybridSystem, Mode
    >>> turns = HybridSystem(("x",), {"w": 1.0}, {"rest": Mode({"x": "-x"})}, phase=("s", "w"))
    >>> found = iterate(turns, turns.parameter_vector({}), [1.0], 0, discard=1, keep=2)
    >>> (found.times / (2 * np.pi)).round(12).tolist()
    [2.0, 3.0]
    """
    check_tolerances(tolerance)
    if section is None and system.phase is None:
        raise InputError("section", section, "a transition for a system without a phase")
    transitions, longest = (None, math.inf) if section is None else (section.transitions, section.longest)
    series = system.series(ORDER) if limit is None else None  # steps by series have the bound of the problem
    if series is not None:
        motion = TaylorRun(system, series, p, start_state(system, x), mode, transitions, *tolerance)
        with suppress(StiffnessError):  # a stiff motion is followed by implicit steps below
            states, modes, times = motion.follow(discard, keep, longest)
            x_end = frozen(motion.x[:-1])
            return PoincareReturns(frozen(states), frozen(modes, np.int64), frozen(times), x_end, motion.mode)
    most = STEPS_A_RETURN * max(discard + keep, 1)
    run = EventDrivenMotion(system, p, start_state(system, x), mode, *tolerance, most_steps=most, limit=limit)
    log = _to_phase_zero(run, discard, keep) if section is None else _to_events(run, section, discard, keep)
    times, which, ends, _ = log
    states = ends[:, 1] if section is None else ends[:, 0]
    return PoincareReturns(frozen(states), frozen(which[:, 1], np.int64), frozen(times), frozen(run.x), run.mode)


def admits(system: HybridSystem, p: NDArray[np.float64], x: NDArray[np.float64], mode: int) -> bool:
    """Return whether a motion may start at a full state in a mode: in its domain, and past none of its events."""
    return domain_value(system, mode, x, p) > 0.0 and not passed_event(system, mode, x, p)


# Times, transitions with modes, states on both sides, and rates of events.
_Log = tuple["NDArray[np.float64]", "NDArray[np.int64]", "NDArray[np.float64]", "NDArray[np.float64]"]


def _to_phase_zero(run: EventDrivenMotion, discard: int, keep: int) -> _Log:
    run.offset = 0.0  # periods are counted at the wraps, wherever the motion starts
    run.follow(math.inf, discard, None, keep=False)
    kept = []
    while (missing := discard + keep - run.wraps) > 0:
        run.follow(math.inf, run.wraps + min(missing, _BATCH), None)
        kept.append(_take(run, (-1,)))
    return _joined(kept, run)


def _to_events(run: EventDrivenMotion, section: EventSection, discard: int, keep: int) -> _Log:
    """Follow as many events as there are returns missing: so the motion ends at the last return, never past it."""
    kept: list[_Log] = []
    seen, last = 0, 0.0
    while (missing := discard + keep - seen) > 0:
        before = run.events_passed
        most = min(missing, _BATCH)
        run.follow(last + section.longest, None, before + most)
        found = _take(run, section.transitions)
        count = found[0].size
        if count:
            last = float(found[0][-1])
        if seen + count > discard:
            first = max(discard - seen, 0)
            kept.append((found[0][first:], found[1][first:], found[2][first:], found[3][first:]))
        seen += count
        if run.events_passed - before < most:
            break
    return _joined(kept, run)


def _take(run: EventDrivenMotion, section: tuple[int, ...]) -> _Log:
    """Return the returns among the events kept so far, and forget them all."""
    times, which, ends, rates = run.events()
    run.kept_events.clear()
    run.kept_steps.clear()
    chosen = np.isin(which[:, 0], section)
    return times[chosen], which[chosen], ends[chosen], rates[chosen]


def _joined(parts: list[_Log], run: EventDrivenMotion) -> _Log:
    nothing = (np.empty(0), np.empty((0, 3), np.int64), np.empty((0, 2, run.x.size)), np.empty(0))
    times, which, ends, rates = (np.concatenate(part) for part in zip(nothing, *parts, strict=True))
    return times, which, ends, rates
