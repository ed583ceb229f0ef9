"""Transitions that are due at one instant and do not commute: the definition's order decides, and that is told."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from saltus.scales import EPS
from saltus.system.evaluate import evaluate

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.system.hybrid import HybridSystem

__all__ = ["Clash", "clashes_of", "warn_of_clashes"]

_ROUNDINGS = 64.0  # of an event function, within which it is 0 where another one is landed on
_LOOKED_AT = 1e-9  # value of an event function, over its largest one, up to which it is looked at closely


@dataclass(frozen=True)
class Clash:
    """Two transitions that were due at one instant, and lead elsewhere in the other order."""

    time: float
    first: str  # the one that was made first
    second: str
    mode: str  # that both leave

    def __str__(self) -> str:
        return (
            f"transitions {self.first!r} and {self.second!r} of mode {self.mode!r} are due at the same time, t = "
            f"{self.time:.10g}, and lead elsewhere in the other order; the first in the definition came first"
        )


def clashes_of(system: HybridSystem, parameters: Mapping[str, float], events: NDArray[np.void]) -> Iterator[Clash]:
    """Yield pairs of transitions that were due at one instant and do not commute, transition by transition.

    Parameters
    ----------
    events : structured ndarray, shape (event,)
        The events of a motion, as `Trajectory.events` has them.
    """
    sources = [transition.source for transition in system.transitions]
    if len(set(sources)) == len(sources):
        return
    log = events[events["kind"] == "event"]
    p = system.compiled.extended(system.parameter_vector(parameters))
    for k, transition in enumerate(system.transitions):
        rows = log[(log["mode_before"] == transition.source) & (log["name"] != transition.name)]
        if not rows.size:
            continue
        mode = system.mode_index(transition.source)
        values = np.abs(evaluate(system, transition.event, rows["before"], mode, parameters))
        near = values <= _LOOKED_AT * np.max(values, initial=0.0)
        for row in rows[near | (values <= _ROUNDINGS * EPS)]:
            other, x = system.transition_names.index(str(row["name"])), np.ascontiguousarray(row["before"])
            if other >= k or _are_choices(system, other, k):
                continue
            if _is_due(system, k, x, p) and not _commute(system, other, k, x, p):
                yield Clash(float(row["time"]), str(row["name"]), transition.name, transition.source)


def warn_of_clashes(system: HybridSystem, parameters: Mapping[str, float], events: NDArray[np.void]) -> None:
    """Warn of the first pair, if there is one, whoever called the caller."""
    clash = next(clashes_of(system, parameters, events), None)
    if clash is not None:
        warnings.warn(f"saltus: {clash}", RuntimeWarning, stacklevel=3)


def _are_choices(system: HybridSystem, one: int, other: int) -> bool:
    """Return whether two transitions are ways out of a mode by one event, of which the first that holds is meant."""
    a, b = system.transitions[one], system.transitions[other]
    return a.event == b.event and a.target != a.source


def _is_due(system: HybridSystem, k: int, x: NDArray[np.float64], p: NDArray[np.float64]) -> bool:
    """Return whether a transition happens at a state: on its surface, in its direction, its condition holding."""
    compiled, value, rounding, guard = system.compiled, np.empty(2), np.empty(1), np.empty(1)
    compiled.call("event", k, 0, x, p, value)
    compiled.call("rounding", k, 0, np.concatenate([x, np.abs(x)]), p, rounding)
    direction = system.transitions[k].direction
    if not abs(value[0]) <= _ROUNDINGS * EPS * rounding[0] or not value[1] * (direction or value[1]) > 0.0:
        return False
    compiled.call("guard", len(system.modes) + k, 0, x, p, guard)
    return bool(guard[0] > 0.0)


def _commute(system: HybridSystem, one: int, other: int, x: NDArray[np.float64], p: NDArray[np.float64]) -> bool:
    """Return whether two transitions lead to the same state and mode in either order.

    One that leaves the mode is the last to be made.
    """
    ends = []
    for order in ((one, other), (other, one)):
        state, mode = x, system.transitions[one].source
        for k in order:
            if system.transitions[k].source == mode:
                after = np.empty_like(x)
                system.compiled.call("reset", k, 0, state, p, after)
                state, mode = after, system.transitions[k].target
        ends.append((state, mode))
    (a, mode_a), (b, mode_b) = ends
    return mode_a == mode_b and bool(np.all(np.abs(a - b) <= _ROUNDINGS * EPS * (np.abs(a) + np.abs(b) + np.abs(x))))
