"""Which grazings an orbit has: events met without speed, surfaces that are touched, segments without length."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.core.monitor import Monitor
from saltus.orbits.cuts import whole
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.signature import WHOLE
from saltus.scales import CONDITIONS_ALIKE, SPEEDLESS, TOUCHING

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["grazed_with", "speed_at", "touched", "vanishing", "vanishing_with", "without_speed"]


def grazed_with(problem: OrbitProblem, monitor: Monitor, u: NDArray[np.float64]) -> list[Monitor]:
    """Return the monitor functions of the other grazings of an orbit at one of kind ``margin`` or ``rate``."""
    if monitor.kind not in ("margin", "rate"):
        return []
    problem, u = whole(problem, u)
    slow, near = without_speed(problem, u), touched(problem, u)
    ends, transitions = problem.signature.transitions, problem.system.transitions
    if monitor.kind == "rate":
        known = [(monitor.segment, transitions[ends[monitor.segment]].event)]
    else:
        known = [(monitor.segment, transitions[monitor.transition].event)]
    found = []
    for name in (*slow, *near):
        # a segment that ends where it touches is told by the end's speed alone
        of = name.segment, transitions[ends[name.segment] if name.kind == "rate" else name.transition].event
        if of not in known:
            known.append(of)
            found.append(name)
    return found


def touched(problem: OrbitProblem, u: NDArray[np.float64]) -> list[Monitor]:
    """Return the monitor functions of surfaces that an orbit touches, one for each surface of a segment."""
    survey, transitions = problem.survey(u), problem.system.transitions
    found: dict[tuple[int, str], Monitor] = {}
    for i, k in np.argwhere(np.isfinite(survey.margins) & (survey.places != WHOLE)).tolist():
        size = problem.event_size(k, problem.state_on(i, float(survey.places[i, k])))
        # two transitions that watch one surface are touched as one
        if abs(float(survey.margins[i, k])) <= TOUCHING * size:
            found.setdefault((i, transitions[k].event), Monitor("margin", i, k))
    return list(found.values())


def without_speed(problem: OrbitProblem, u: NDArray[np.float64]) -> list[Monitor]:
    """Return the monitor functions of events that an orbit meets without speed."""
    period = float(np.abs(u[problem.n : problem.size : problem.n + 1]).sum())
    problem.survey(u)
    ends = [(i, k) for i, k in enumerate(problem.signature.transitions) if k >= 0]
    slow = [i for i, k in ends if speed_at(problem, k, problem.state_on(i, 1.0), period) < SPEEDLESS]
    return [Monitor("rate", i) for i in slow]


def speed_at(problem: OrbitProblem, transition: int, x: NDArray[np.float64], period: float) -> float:
    """Return the rate of an event in a full state, over the event's size and by period."""
    event, n = np.empty(2 + 2 * problem.n), problem.n
    problem.system.compiled.call("event_x", transition, 0, np.ascontiguousarray(x), problem.extended, event)
    size = float(np.abs(event[2 : 2 + n]) @ problem.state_scale)
    return abs(float(event[1])) * period / size if size > 0.0 else math.inf


def vanishing(problem: OrbitProblem, blocks: NDArray[np.float64], i: int) -> Monitor:
    """Return the monitor function behind a vanishing rate of segment `i`: a neighbour's duration, or the rate alone."""
    count = problem.segments
    period = float(np.abs(blocks[:, problem.n]).sum())
    for j in (i, (i + 1) % count):
        if count > 1 and abs(blocks[j, problem.n]) < CONDITIONS_ALIKE * period:
            return Monitor("duration", j)
    return Monitor("rate", i)


def vanishing_with(problem: OrbitProblem, blocks: NDArray[np.float64], i: int) -> list[int]:
    """Return segment `i` and those next to it in a row that have no length either; at least one stays."""
    count, n = problem.segments, problem.n
    none = np.abs(blocks[:, n]) < CONDITIONS_ALIKE * float(np.abs(blocks[:, n]).sum())
    before, behind = 0, 0
    while before + behind + 2 < count and none[i - before - 1]:
        before += 1
    while before + behind + 2 < count and none[(i + behind + 1) % count]:
        behind += 1
    return [(i + k) % count for k in range(-before, behind + 1)]
