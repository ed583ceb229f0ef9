"""The events of a motion, without its dense output."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from saltus.flow.motion import EventDrivenMotion, check_tolerances, how_long, start_state
from saltus.result import frozen

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from saltus.system.hybrid import HybridSystem

__all__ = ["EventLog", "event_log", "events_after"]


@dataclass(frozen=True)
class EventLog:
    """Events of a motion, wraps of the phase among them, and where it ends; made by `events_after`."""

    time: NDArray[np.float64]  # shape (event,): times since the start
    transition: NDArray[np.int64]  # shape (event,): index of the transition, -1 for a wrap of the phase
    # x_before, x_after: shape (event, all states): full states on both sides of the event
    x_before: NDArray[np.float64]
    x_after: NDArray[np.float64]
    # mode_before, mode_after: shape (event,): indices of the modes on both sides
    mode_before: NDArray[np.int64]
    mode_after: NDArray[np.int64]
    # shape (event,): rate of the event function along the motion before; of the phase for a wrap
    normal_velocity: NDArray[np.float64]
    t_end: float  # time at the end
    x_end: NDArray[np.float64]  # shape (all states,): full state at the end
    mode_end: int  # index of the mode at the end


def events_after(
    system: HybridSystem,
    p: NDArray[np.float64],
    x: ArrayLike,
    mode: int,
    *,
    periods: int | None = None,
    t_end: float | None = None,
    n_events: int | None = None,
    tolerance: tuple[float, float] = (1e-10, 1e-12),
    most_steps: int | None = None,
) -> EventLog:
    """Return all events of a motion, without its dense output.

    Parameters
    ----------
    x : array_like, shape (states,) or (all states,)
        Start; it may lie on the boundary of the mode's domain.
    periods, t_end : int, float
        How long; exactly one of the two.
    n_events : int, optional
        Transitions after which the motion ends early.
    tolerance : (float, float), optional
        Relative and absolute tolerance of a step.
    most_steps : int, optional
        Limit of work; as many as it takes by default.

    Raises
    ------
    InputError, ChatteringError, DivergenceError
        As `simulate`.
    StiffnessError
        The steps are not enough.
    """
    check_tolerances(tolerance)
    run = EventDrivenMotion(system, p, start_state(system, x), mode, *tolerance, most_steps=most_steps)
    run.follow(*how_long(system, periods, t_end), n_events)
    return event_log(run)


def event_log(run: EventDrivenMotion) -> EventLog:
    """Return the events that a run has kept, and where it is."""
    times, which, ends, rates = run.events()
    return EventLog(
        time=frozen(times),
        transition=frozen(which[:, 0], np.int64),
        x_before=frozen(ends[:, 0]),
        x_after=frozen(ends[:, 1]),
        mode_before=frozen(which[:, 1], np.int64),
        mode_after=frozen(which[:, 2], np.int64),
        normal_velocity=frozen(rates),
        t_end=run.time,
        x_end=frozen(run.x),
        mode_end=run.mode,
    )
