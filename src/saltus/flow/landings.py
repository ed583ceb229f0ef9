"""Transitions and starts that lead beyond an event of a mode, where motions of that mode do not come."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from saltus.system.evaluate import evaluate
from saltus.system.parts import at_phases

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.system.hybrid import HybridSystem, Transition

__all__ = ["Landing", "landings_beyond", "warn_behind_wall", "warn_of"]

_LANDED = 1e-9  # of an event function's terms, below which a landing is on its surface
_LOOKED_AT = 16  # landings at which the size of these terms is looked at


@dataclass(frozen=True)
class Landing:
    """A transition that led to the far side of an event of its target mode, which motions of the mode do not reach."""

    time: float  # when
    transition: str
    mode: str  # the target mode
    event: str  # the transition from that mode whose event is passed already
    value: float  # value of this event's function after the landing

    def __str__(self) -> str:
        return (
            f"{self.transition!r} lands beyond event {self.event!r} of mode {self.mode!r} at t = {self.time:.10g}, "
            f"where its function is {self.value:.6g}"
        )


def landings_beyond(
    system: HybridSystem, parameters: Mapping[str, float], events: NDArray[np.void], sizes: NDArray[np.float64]
) -> tuple[Landing, ...]:
    """Return the landings beyond events of the target modes, in order of time.

    Parameters
    ----------
    events : structured ndarray, shape (event,)
        With the fields `time`, `name`, `mode_before`, `mode_after`, `before` and `after` of `Trajectory.events`.
    sizes : ndarray, shape (all states,)
        Sizes of the states along the motion.
    """
    found = []
    for transition in system.transitions:
        landed = events[events["mode_after"] == transition.source]
        if transition.target == transition.source:  # one without a reset counts crossings
            landed = landed[landed["name"] != transition.name] if transition.reset else landed[:0]
        if not landed.size or transition.direction == 0:
            continue
        if at_phases(system, transition):
            continue
        values, there = _beyond(system, parameters, transition, landed["after"], sizes)
        moved = landed["mode_before"] != transition.source
        there &= moved | ~_beyond(system, parameters, transition, landed["before"], sizes)[1]
        for entry, value in zip(landed[there], values[there].tolist(), strict=True):
            name, mode = str(entry["name"]), transition.source
            found.append(Landing(float(entry["time"]), name, mode, transition.name, value))
    return tuple(sorted(found, key=lambda landing: landing.time))


def warn_of(landings: tuple[Landing, ...]) -> None:
    """Warn of the first landing, if there is one, whoever called the caller."""
    if landings:
        warnings.warn(f"saltus: {landings[0]}; the motion goes on as if it were not", RuntimeWarning, stacklevel=3)


def warn_behind_wall(
    system: HybridSystem, p: NDArray[np.float64], x: NDArray[np.float64], mode: int, level: int = 3
) -> None:
    """Warn where a motion starts behind a wall of its mode, whoever called the caller.

    A wall is an event without a condition that leads back to its mode, and whose reset throws motions back: no motion
    gets past it.

    Parameters
    ----------
    p : ndarray, shape (parameters,)
        Parameters.
    x : ndarray, shape (all states,)
        The start.
    mode : int
        Index of its mode.
    level : int, optional
        How many calls lie between this one and the user's, as `warnings.warn` counts them.
    """
    for k, transition in enumerate(system.transitions):
        own = system.mode_index(transition.source) == mode == system.mode_index(transition.target)
        if not own or not transition.direction or not transition.reset or transition.when is not None:
            continue
        if at_phases(system, transition):
            continue
        value = _behind_wall(system, p, x, k)
        if value is not None:
            warnings.warn(
                f"saltus: the motion starts behind event {transition.name!r} of mode {transition.source!r}, where its "
                f"function is {value:.6g}; the motion goes on as if it were not",
                RuntimeWarning,
                stacklevel=level,
            )


def _behind_wall(system: HybridSystem, p: NDArray[np.float64], x: NDArray[np.float64], k: int) -> float | None:
    """Return the event function of transition `k` where a state is clearly behind it and it is a wall; else None.

    At this height the state is given the speed that would bring it there, and the reset is tried.
    """
    n, direction, compiled = x.size, system.transitions[k].direction, system.compiled
    extended, seen, thrown = compiled.extended(p), np.empty(2 + 2 * n), np.empty(n)
    compiled.call("event_x", k, 0, x, extended, seen)
    value, rate = float(seen[0]) * direction, float(seen[1]) * direction
    if not value > 0.0:
        return None
    mode = system.mode_index(system.transitions[k].source)
    bend = abs(float(seen[2 + n :] @ compiled.field(mode, x, p)))
    far = rate * rate / bend if bend > 0.0 else 0.0  # as far as the motion goes on at its speed
    near = _LANDED * (float(np.abs(seen[2 : 2 + n]) @ np.abs(x)) + far)
    if not value > near:
        return None
    compiled.call("reset", k, 0, x, extended, thrown)
    changed, slopes = thrown != x, seen[2:].reshape(2, n).copy()
    turn = direction * seen[2 + n :]
    length, faster = float(turn @ turn), (abs(rate) + float(np.abs(turn) @ np.abs(x))) or 1.0
    moved = x + turn * ((faster - rate) / length if length > 0.0 else 0.0)
    compiled.call("event_x", k, 0, moved, extended, seen)
    if not float(seen[1]) * direction > 0.0:
        return None
    compiled.call("reset", k, 0, moved, extended, thrown)
    if not np.any(slopes[:, changed | (thrown != moved)]):  # a counter: its function knows nothing of what is reset
        return None
    compiled.call("event_x", k, 0, thrown, extended, seen)
    back = float(seen[0]) * direction < -near or float(seen[1]) * direction < 0.0
    return value * direction if back else None


def _beyond(
    system: HybridSystem,
    parameters: Mapping[str, float],
    transition: Transition,
    states: NDArray[np.float64],
    sizes: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Values of an event function, and whether the states are clearly on the far side, its condition holding."""
    mode = system.mode_index(transition.source)
    values = evaluate(system, transition.event, states, mode, parameters)
    past = values * transition.direction > 0.0
    if past.any() and transition.when is not None:
        past &= evaluate(system, transition.when, states, mode, parameters) > 0.0
    if past.any():
        k, n, compiled = system.transitions.index(transition), states.shape[1], system.compiled
        p = compiled.extended(system.parameter_vector(parameters))
        out, slopes = np.empty(2 + 2 * n), np.zeros(n)
        for x in states[past][:_LOOKED_AT]:
            compiled.call("event_x", k, 0, x.copy(), p, out)
            slopes = np.maximum(slopes, np.abs(out[2 : 2 + n]))
        past &= np.abs(values) > _LANDED * float(slopes @ sizes)
    return values, past
