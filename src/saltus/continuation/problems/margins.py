"""Monitor functions of grazings: how far an orbit stays from surfaces that it could meet, and which vanish at once."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.core.monitor import Monitor
from saltus.continuation.problems.signatures.rebounds import rebound, rebounds
from saltus.orbits.cuts import whole
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.signature import DIRECTION, DURATION, EARLY, EVENT_END, MEAN_END, WHEN, WHOLE, Signature, Survey
from saltus.orbits.stability.critical import Grazing
from saltus.scales import CONDITIONS_ALIKE, SPEEDLESS, TOUCHING, Verdict, followed, zero
from saltus.system.expressions import NAME
from saltus.system.parts import at_phases

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.core.zero_problem import Point
    from saltus.system.hybrid import HybridSystem

__all__ = [
    "duration_of",
    "grazed_with",
    "grazing_monitors",
    "holds_at",
    "on_border",
    "passing",
    "places_touched",
    "rebound_ceases",
    "run_out",
    "same_phase",
    "side_of",
    "speed_at",
    "still_ahead",
    "timed",
    "touched",
    "touches_again",
    "vanishing",
    "vanishing_with",
    "without_shadows",
    "without_speed",
]

_MET = ("ahead", "behind", "unmet")  # monitor functions of events that a segment meets, and that do not end it
_PLACES = 400  # states of a segment at which it is seen where the segment passes a surface
_STEP = 1e-3  # change of a state, over its size, by which it is seen how a condition varies


def grazing_monitors(problem: OrbitProblem) -> dict[Monitor, Callable[[Survey], float]]:
    """Return the monitor functions of changes of signature that a survey gives: all but durations.

    Each is positive on the admissible side. A ``side`` of an event in both directions has no admissible side. They name
    segments, however these are cut: a survey tells of a flight where its event is, of a smooth orbit where it begins.
    """
    found: dict[Monitor, Callable[[Survey], float]] = {}
    system, signature, rows = problem.system, problem.signature.whole, _rows(problem.signature)
    for i, (mode, end, row) in enumerate(zip(signature.modes, signature.transitions, rows, strict=True)):
        own = system.transitions[end].event if end >= 0 else ""
        for k, transition in enumerate(system.transitions):
            if transition.source == system.mode_names[mode]:
                if end >= 0 and transition.event != own:
                    found[Monitor("ahead", i, k)] = lambda s, at=(row, k): float(s.ahead[at])  # type: ignore[misc]
                if signature.transitions[i - 1] >= 0:
                    found[Monitor("behind", i, k)] = lambda s, at=(row, k): float(s.behind[at])  # type: ignore[misc]
                if transition.when is not None and k not in system.velocity_conditions:
                    found[Monitor("unmet", i, k)] = lambda s, at=(row, k): float(s.unmet[at])  # type: ignore[misc]
                found[Monitor("margin", i, k)] = lambda s, at=(row, k): (  # type: ignore[misc]
                    float(s.margins[at]) if s.places[at] != WHOLE else math.inf
                )
                found[Monitor("side", i, k)] = lambda s, at=(row, k): (  # type: ignore[misc]
                    float(s.margins[at]) if s.places[at] == WHOLE else math.nan
                )
        if end >= 0:
            way = float(system.transitions[end].direction or -1)
            found[Monitor("rate", i)] = lambda s, i=row, way=way: way * float(s.rates[i, 0])  # type: ignore[misc]
            if system.transitions[end].when is not None and end not in system.velocity_conditions:
                found[Monitor("condition", i)] = lambda s, i=row: float(s.rates[i, 3])  # type: ignore[misc]
    for name in rebounds(system, signature):
        start, before = problem.signature.heads[name.segment], problem.signature.tails[name.segment - 1]
        found[name] = lambda s, name=name, start=start, before=before: rebound(  # type: ignore[misc]
            problem, name, start, float(s.rates[before, 0])
        )
    return found


def _rows(signature: Signature) -> tuple[int, ...]:
    """Return the row of each segment in a survey."""
    return signature.tails if signature.flies else signature.heads


def timed(system: HybridSystem, signature: Signature) -> dict[Monitor, int]:
    """Return the monitor functions of segments whose duration may vanish, each with the index of its last piece.

    Between two events at fixed phases no time can vanish: it is a share of the period, or nothing all along.
    """
    if len(signature.heads) < 2:
        return {}
    form, tails = signature.whole, signature.tails
    fixed = [k >= 0 and _at_fixed_phases(system, k) for k in form.transitions]
    ends = [i for i, kind in enumerate(form.kinds) if kind in (EVENT_END, MEAN_END)]
    return {Monitor("duration", i): tails[i] for i in ends if not (fixed[i] and fixed[i - 1])}


def _at_fixed_phases(system: HybridSystem, k: int) -> bool:
    """Return whether an event function knows the phase alone, and no parameter."""
    transition = system.transitions[k]
    return at_phases(system, transition) and not set(system.parameters) & set(NAME.findall(transition.event))


def same_phase(system: HybridSystem, k: int, other: int) -> bool:
    """Return whether two events know the phase alone and are due at one phase, or at fixed ones: none follows at once.

    A motion that has made the one goes on for a share of the period before it can make the other.
    """
    fixed = _at_fixed_phases(system, k) and _at_fixed_phases(system, other)
    own, its = system.transitions[k], system.transitions[other]
    return fixed or (at_phases(system, own) and own.event == its.event)


def side_of(problem: OrbitProblem, monitor: Monitor, u: NDArray[np.float64]) -> float:
    """Return a monitor function of kind ``side`` for an orbit that may be corrected roughly only."""
    return problem.distance(u, problem.signature.heads[monitor.segment], monitor.transition)[0]


def _stays(problem: OrbitProblem, name: Monitor, values: tuple[float, float]) -> bool:
    """Return whether an event of two neighbouring orbits is 0 at a segment's end or start within their error.

    values: of its monitor function; the first is NaN where it has been dropped already.
    """
    if name.kind not in ("ahead", "behind") or not abs(values[1]) < math.inf:
        return False
    place = float(name.kind == "ahead")
    piece = (problem.signature.tails if place else problem.signature.heads)[name.segment]
    size = problem.event_size(name.transition, problem.state_on(piece, place))
    error = followed(problem.tol) * size
    return all(math.isnan(value) or zero(value, error) is not Verdict.NO for value in values)


def run_out(problem: OrbitProblem, u: NDArray[np.float64], survey: Survey) -> list[Monitor]:
    """Return the monitor functions of conditions, and of further events at segments' ends, that vanish at an orbit.

    The orbit's segments are in one piece each.
    """
    found = []
    for i, k in enumerate(problem.signature.transitions):
        if k < 0:
            continue
        held = problem.system.transitions[k].when is None or k in problem.system.velocity_conditions
        size = math.nan if held else _condition_size(problem, k, problem.state_on(i, 1.0))
        if abs(survey.rates[i, 3]) < TOUCHING * size:
            found.append(Monitor("condition", i))
    for name, value in grazing_monitors(problem).items():
        size = problem.event_size(name.transition, u[: problem.n]) if name.kind in ("ahead", "behind") else math.nan
        if name.kind == "unmet" and math.isfinite(value(survey)):
            place = passing(problem, name.segment, name.transition)
            size = _condition_size(problem, name.transition, problem.state_on(name.segment, place))
        if abs(value(survey)) < TOUCHING * size:
            found.append(name)
    return found


def still_ahead(problem: OrbitProblem, monitors: dict[Monitor, float], survey: Survey, before: Point | None) -> None:
    """Drop events that segments have passed, unless they were ahead at the point before.

    A condition that holds is that of the same meeting only where the surface is met as often as before. An event that
    stays at the instant of another one is no border: the sign of its distance is rounding.
    """
    known = {} if before is None else before.examined.monitors
    data = None if before is None else before.examined.data
    same = None if data is None else data.survey.counts
    if same is not None and same.shape != survey.counts.shape:
        same = None
    rows = _rows(problem.signature)
    for name, value in monitors.items():
        at = (rows[name.segment], name.transition) if name.kind == "unmet" else (0, 0)
        other = name.kind == "unmet" and same is not None and same[at] != survey.counts[at]
        earlier = known.get(name, math.nan)
        passed = name.kind in _MET and value < 0.0 and not earlier > 0.0
        if other or passed or (before is not None and _stays(problem, name, (earlier, value))):
            monitors[name] = math.nan


def without_shadows(names: Iterable[Monitor], vanishing: Iterable[int], count: int) -> list[Monitor]:
    """Return the monitor functions without those that vanish only since some segments have no length.

    Parameters
    ----------
    names : iterable of Monitor
        The monitor functions.
    vanishing : iterable of int
        The segments without length.
    count : int
        Segments in all.
    """
    beside = {i for j in vanishing for i in (j, (j - 1) % count)}
    return [
        name for name in names if not (name.kind in ("rate", "condition", "rebound", *_MET) and name.segment in beside)
    ]


def on_border(problem: OrbitProblem, grazing: Grazing, u: NDArray[np.float64], survey: Survey) -> Survey:
    """Return a survey without the faults that are rounding where a quantity vanishes all along the locus."""
    if grazing.kind == "rate":
        end = problem.signature.transitions[grazing.segment]
        failed = np.delete(survey.rates[:, 3], grazing.segment) <= 0.0
        kept = ~DIRECTION if end not in problem.system.velocity_conditions or failed.any() else ~(DIRECTION | WHEN)
        return survey._replace(faults=survey.faults & kept)
    kept, durations = survey.faults, u[problem.n : problem.size : problem.n + 1]
    zero = np.flatnonzero(np.abs(durations) < TOUCHING * np.abs(durations).sum()).tolist()
    beside = {grazing.segment, *zero, *((i - 1) % problem.segments for i in zero)}
    others = [i for i in range(problem.segments) if i not in beside]
    if np.all(survey.rates[others, 3] > 0.0):
        kept &= ~WHEN
    if grazing.kind == "unmet":
        kept &= ~EARLY
    if grazing.kind == "duration" and np.all(durations[others] > 0.0):
        kept &= ~DURATION
    if survey.faults & DIRECTION:
        slow = {name.segment for name in without_speed(problem, u)}
        if _wrong_ways(problem, survey) <= beside & slow:
            kept &= ~DIRECTION
    return survey._replace(faults=kept)


def _wrong_ways(problem: OrbitProblem, survey: Survey) -> set[int]:
    """Return the segments whose event has a rate against its direction."""
    ends = enumerate(problem.signature.transitions)
    ways = {i: problem.system.transitions[k].direction for i, k in ends if k >= 0}
    return {i for i, way in ways.items() if way * survey.rates[i, 0] < 0.0}


def passing(problem: OrbitProblem, segment: int, transition: int) -> float:
    """Return the place where a segment, as last surveyed, meets the surface of a transition whose condition is near 0.

    That is 1 at the segment's end, whose event may be on the same surface.
    """
    from scipy.optimize import brentq  # 0.3 s of a processor, which few orbits need

    system, event, guard = problem.system, np.empty(2), np.empty(1)

    def height(place: float) -> float:
        system.compiled.call("event", transition, 0, problem.state_on(segment, place), problem.extended, event)
        return float(event[0])

    def condition(place: float) -> float:
        state, at = problem.state_on(segment, place), len(system.modes) + transition
        system.compiled.call("guard", at, 0, state, problem.extended, guard)
        return abs(float(guard[0]))

    places = np.linspace(0.0, 1.0, _PLACES)
    heights = np.array([height(place) for place in places.tolist()])
    passed = np.flatnonzero(heights[1:-2] * heights[2:-1] < 0.0) + 1
    met = [brentq(height, places[j], places[j + 1], xtol=1e-14) for j in passed.tolist()]
    end = problem.signature.transitions[segment]
    if not met or (end >= 0 and system.transitions[end].event == system.transitions[transition].event):
        met.append(1.0)
    return float(min(met, key=condition))


def holds_at(problem: OrbitProblem, transition: int, x: NDArray[np.float64]) -> bool:
    """Return whether the condition of a transition holds in a full state, or is 0 there within its error."""
    if problem.system.transitions[transition].when is None:
        return True
    guard, x = np.empty(1), np.ascontiguousarray(x)
    at = len(problem.system.modes) + transition
    problem.system.compiled.call("guard", at, 0, x, problem.extended, guard)
    return bool(guard[0] > -TOUCHING * _condition_size(problem, transition, x))


def _condition_size(problem: OrbitProblem, transition: int, x: NDArray[np.float64]) -> float:
    """Return how much the condition of a transition varies near a full state with the states' sizes."""
    here, there = np.empty(1), np.empty(1)
    place, compiled = len(problem.system.modes) + transition, problem.system.compiled
    compiled.call("guard", place, 0, np.ascontiguousarray(x), problem.extended, here)
    total = 0.0
    for k, step in enumerate((_STEP * problem.state_scale).tolist()):
        moved = x.copy()
        moved[k] += step
        compiled.call("guard", place, 0, moved, problem.extended, there)
        total += abs(float(there[0] - here[0]))
    return total / _STEP


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


def places_touched(problem: OrbitProblem, segment: int, transition: int, own: float) -> list[float]:
    """Return the places where a segment, as last surveyed, touches a transition's surface, first its survey's, `own`.

    One event function may have several surfaces, as x^2 - 1 has two. A segment of a symmetric orbit touches both.
    """
    from scipy.optimize import brentq  # 0.3 s of a processor, which few orbits need

    compiled, event = problem.system.compiled, np.empty(2 + 2 * problem.n)

    def met(place: float) -> tuple[float, float]:
        x = np.ascontiguousarray(problem.state_on(segment, place))
        compiled.call("event_x", transition, 0, x, problem.extended, event)
        return float(event[0]), float(event[1])

    places = np.linspace(0.0, 1.0, _PLACES)
    rates = np.array([met(place)[1] for place in places.tolist()])
    found = [own]
    for j in np.flatnonzero(rates[:-1] * rates[1:] < 0.0).tolist():
        place = float(brentq(lambda at: met(at)[1], places[j], places[j + 1], xtol=1e-14))
        near = abs(met(place)[0]) <= TOUCHING * problem.event_size(transition, problem.state_on(segment, place))
        if near and min(abs(place - other) for other in found) > places[1]:
            found.append(place)
    return found


def touches_again(problem: OrbitProblem, monitor: Monitor, u: NDArray[np.float64]) -> bool:
    """Return whether a segment touches the surface of a monitor function of kind ``margin`` at several places."""
    if monitor.kind != "margin":
        return False
    problem, u = whole(problem, u)
    _, i, k, _ = monitor
    return len(places_touched(problem, i, k, float(problem.survey(u).places[i, k]))) > 1


def without_speed(problem: OrbitProblem, u: NDArray[np.float64]) -> list[Monitor]:
    """Return the monitor functions of events that an orbit meets without speed."""
    period = float(np.abs(u[problem.n : problem.size : problem.n + 1]).sum())
    problem.survey(u)
    ends = [(i, k) for i, k in enumerate(problem.signature.transitions) if k >= 0]
    slow = [i for i, k in ends if speed_at(problem, k, problem.state_on(i, 1.0), period) < SPEEDLESS]
    return [Monitor("rate", i) for i in slow]


def rebound_ceases(problem: OrbitProblem, u: NDArray[np.float64], segment: int) -> bool:
    """Return whether a segment without length lies between two events on one surface, of which the first one stays.

    That one is met with speed, and its reset leaves the motion on the surface without any: the second one vanishes.
    Where impacts accumulate, or a motion grazes, both are met without speed.
    """
    problem, u = whole(problem, u)
    ends, transitions = problem.signature.transitions, problem.system.transitions
    here = {name.segment for name in rebounds(problem.system, problem.signature)}
    if segment not in here or transitions[ends[segment]].event != transitions[ends[segment - 1]].event:
        return False
    before, period = (
        segment - 1 if segment > 0 else problem.segments - 1,
        float(np.abs(u[problem.n : problem.size : problem.n + 1]).sum()),
    )
    problem.survey(u)
    return not speed_at(problem, ends[before], problem.state_on(before, 1.0), period) < SPEEDLESS


def duration_of(problem: OrbitProblem, u: NDArray[np.float64], i: int) -> float:
    """Return the duration of segment `i`."""
    return float(u[i * (problem.n + 1) + problem.n])


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
