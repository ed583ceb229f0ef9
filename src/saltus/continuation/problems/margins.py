"""Monitor functions of grazings: how far the segments of an orbit stay from the surfaces that they could meet."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.core.monitor import Monitor
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.signature import EVENT_END, MEAN_END, WHOLE, Signature, Survey

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["grazing_monitors", "shadowed", "side_of", "timed"]


def grazing_monitors(problem: OrbitProblem) -> dict[Monitor, Callable[[Survey], float]]:
    """Return the monitor functions of grazings that a survey gives: margins, sides, rates and conditions.

    Each is positive on the admissible side. A ``side`` of an event in both directions has no admissible side.
    """
    found: dict[Monitor, Callable[[Survey], float]] = {}
    system, signature = problem.system, problem.signature
    for i, (mode, end) in enumerate(zip(signature.modes, signature.transitions, strict=True)):
        for k, transition in enumerate(system.transitions):
            if transition.source == system.mode_names[mode]:
                found[Monitor("margin", i, k)] = lambda s, at=(i, k): (  # type: ignore[misc]
                    float(s.margins[at]) if s.places[at] != WHOLE else math.inf
                )
                found[Monitor("side", i, k)] = lambda s, at=(i, k): (  # type: ignore[misc]
                    float(s.margins[at]) if s.places[at] == WHOLE else math.nan
                )
        if end >= 0:
            way = float(system.transitions[end].direction or -1)
            found[Monitor("rate", i)] = lambda s, i=i, way=way: way * float(s.rates[i, 0])  # type: ignore[misc]
            if system.transitions[end].when is not None:
                found[Monitor("condition", i)] = lambda s, i=i: float(s.rates[i, 3])  # type: ignore[misc]
    return found


def timed(signature: Signature) -> dict[Monitor, int]:
    """Return the monitor functions of segments whose duration may vanish, each with the index of its segment."""
    if len(signature.heads) < 2:
        return {}
    return {Monitor("duration", i): i for i, kind in enumerate(signature.kinds) if kind in (EVENT_END, MEAN_END)}


def side_of(problem: OrbitProblem, monitor: Monitor, u: NDArray[np.float64]) -> float:
    """Return a monitor function of kind ``side`` for an orbit that may be corrected roughly only."""
    return problem.distance(u, monitor.segment, monitor.transition)[0]


def shadowed(vanishing: list[int], count: int) -> set[Monitor]:
    """Return the rates and conditions that vanish since one of the segments `vanishing`, of `count`, has no length."""
    return {Monitor(kind, i) for j in vanishing for i in (j, (j - 1) % count) for kind in ("rate", "condition")}
