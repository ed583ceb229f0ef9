"""Zeros of monitor functions between two points of a branch: docs/theory/continuation.md, "Special points"."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.continuation.core.monitor import Monitor
from saltus.continuation.core.signs import changed_signs
from saltus.continuation.core.zero_problem import Event, Point, ZeroProblem, hermite, hermite_slope
from saltus.scales import (
    CROWDED,
    ILL_CONDITIONED,
    LOCATING_STALLED,
    MONITOR_JUMPS,
    MONITOR_SIGN,
    MONITOR_ZERO,
    NEWTON_CONVERGED,
    PLACES_ALIKE,
    RESIDUAL_ROUNDING,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["events_between", "locate"]

_ROOTED = 8  # places tried from which on the function is taken for a root of the distance from its zero
_LONG = 6  # points corrected from which on the last two predict the next one, not the last alone
_HALVED = 16  # the same, from which on the bracket is halved
_FARTHER = 1e3  # how much farther a zero may move than the point at which it was sought


def events_between(problem: ZeroProblem, a: Point, b: Point, before: Point | None = None) -> list[Event] | str:
    """Return the zeros of monitor functions between two examined points, or the reason why the step is rejected.

    The point `before` the first one tells its signs where these are within their errors.
    """
    changed = changed_signs(problem, a, b, before)
    if isinstance(changed, str):
        return changed
    if not changed:
        return []
    events: list[Event] = []
    # next to a singular point the tangent is undetermined, and with it other monitor functions
    for name in sorted(problem.leading(list(changed)), key=lambda name: name not in problem.singular):
        event = _located(problem, name, a, b, *changed[name])
        if event is not None:
            events.append(event)
        elif _runs_out(name, *changed[name]) or (
            b.arc - a.arc > CROWDED and not any(event.name in problem.singular for event in events)
        ):
            return f"location: no zero of {name} between the step's ends"
        elif _happens(problem, name, a, b, *changed[name]):  # located well or not
            events.append(_between(name, a, b, *changed[name]))
    kept = problem.sort_out(sorted(events, key=lambda event: event.point.arc))
    if isinstance(kept, str):
        return kept
    overlooked = _overlooked(kept, a, b, set(changed)) if b.arc - a.arc > CROWDED else None
    return kept if overlooked is None else f"events: {overlooked} vanishes more than once within the step"


def _located(problem: ZeroProblem, name: Any, a: Point, b: Point, fa: float, fb: float) -> Event | None:
    """Return the zero of a monitor function, which is as small there as at a zero; None where there is none.

    A determinant may change by many orders of magnitude in a step: its size is that at the end where it is less. Next
    to the zero, where this is rounding, it is that at the other end.
    """
    least, largest = sorted((abs(fa), abs(fb)))
    wide = name in problem.singular and name not in problem.noise and least > 0.0
    for unit in (least, largest) if wide else (largest,):
        event = locate(problem, name, a, b, fa, fb, unit)
        small = max(MONITOR_JUMPS * least, MONITOR_ZERO * largest) if wide else MONITOR_JUMPS * unit
        if event is not None and abs(event.value) <= small and _lies_between(event.point, a, b):
            return event
    return None


def _on_curve(problem: ZeroProblem, event: Event, slope: NDArray[np.float64]) -> Event:
    """Return an event with the slope of the curve where the equations leave the tangent open."""
    if event.name in problem.singular:
        event.point.tangent = slope
    return event


def _lies_between(point: Point, a: Point, b: Point) -> bool:
    """Return whether a point is no farther from the nearer end of a step than that is long.

    Where the equations are solved again more exactly, Newton's method may lead far away, as to orbits of no period.
    """
    away = min(float(a.weights @ (point.u - end.u) ** 2) for end in (a, b))
    return away <= max(b.arc - a.arc, CROWDED) ** 2


def _runs_out(name: Any, old: float, value: float) -> bool:
    """Return whether a duration runs out: no step, however short, goes on to orbits of negative durations."""
    return isinstance(name, Monitor) and name.kind == "duration" and old > 0.0 > value


def _happens(problem: ZeroProblem, name: Any, a: Point, b: Point, fa: float, fb: float) -> bool:
    """Return whether an event lies in a short step without doubt.

    It does at a bound, where a function that has no poles changes its sign, and at a meeting that changes stability.
    """
    if _certain(problem, name) or (isinstance(name, Monitor) and name.kind in ("low", "high")):
        return True
    counts = [getattr(point.examined.data, "unstable", None) for point in (a, b)]
    meets = name in problem.singular and None not in counts and counts[0] != counts[1]
    return meets and not _has_pole(problem, name, a, b, fa, fb)


def _has_pole(problem: ZeroProblem, name: Any, a: Point, b: Point, fa: float, fb: float) -> bool:
    """Return whether a monitor function changes its sign at a pole, as where the equations are 0/0.

    On its way to a zero a function is less than at the nearer end, where a line through both ends vanishes too. On its
    way to a pole it is greater everywhere in between.
    """
    from saltus.system.numba_tools.linear import bordered

    share, length = fa / (fa - fb), b.arc - a.arc
    u, tangent = hermite(a, b, length, share), hermite_slope(a, b, length, share)
    tangent /= math.sqrt(float(a.weights @ tangent**2))
    F, J = problem.evaluate(u)
    sign, log = bordered(J, F, a.weights * tangent, u, u, problem.scale())[1:3]
    value = problem.monitor(name, replace(b, u=u, J=J, tangent=tangent, sign=sign, log=log))
    return not abs(value) < min(abs(fa), abs(fb))


def _certain(problem: ZeroProblem, name: Any) -> bool:
    """Return whether a monitor function has no poles, so that it vanishes where its sign changes."""
    return isinstance(name, Monitor) and name.kind in problem.continuous


def _between(name: Any, a: Point, b: Point, fa: float, fb: float) -> Event:
    """Return the event at which a bound is passed in a short step, by interpolation alone."""
    share = fa / (fa - fb) if fa != fb else 1.0
    point = replace(b, u=hermite(a, b, b.arc - a.arc, share), arc=a.arc + share * (b.arc - a.arc))
    return Event(name, point, 0.0)


def _overlooked(events: list[Event], a: Point, b: Point, changed: set[Any]) -> Any | None:
    """Return a monitor function whose sign at one of the events contradicts its located zeros; None if none does."""
    places = {event.name: event.point.arc for event in events}
    for event in events:
        for name, value in event.point.examined.monitors.items():
            start = a.examined.monitors.get(name, math.nan)
            end = b.examined.monitors.get(name, math.nan)
            if math.isnan(start) or math.isnan(end) or (name in changed and name not in places) or name == event.name:
                continue
            expected = start if event.point.arc < places.get(name, math.inf) else end
            size = max((abs(x) for x in (start, end) if math.isfinite(x)), default=0.0)
            if (value < 0.0) != (expected < 0.0) and abs(value) > MONITOR_SIGN * size:
                return name
    return None


def locate(
    problem: ZeroProblem, name: Any, a: Point, b: Point, fa: float, fb: float, unit: float | None = None
) -> Event | None:
    """Return the zero of a monitor function between two points of a branch; None where there is no zero.

    The function's size is `unit`, by default that at the end where it is larger.

    Inverse interpolation along the step, within a bracket, gives the place at which the function would vanish. There
    one Newton step corrects the point in the plane normal to the branch. The corrections also measure how the branch
    departs from the cubic through the step's ends. Where the search is long, the last two predict that at the next
    place. At the zero of a `singular` monitor function two branches meet. Next to it Newton steps leave out the
    direction of the other branch. docs/theory/continuation.md, "Special points", describes the method.
    """
    from saltus.system.numba_tools.linear import bordered

    length = b.arc - a.arc
    known = [(0.0, fa), (1.0, fb)]
    low, high, f_low = 0.0, 1.0, fa
    s = fa / (fa - fb)
    bends: list[tuple[float, NDArray[np.float64]]] = []
    near, tried = False, 0
    scale = problem.scale()
    usual = np.maximum(*(_terms(end.J, a.u.size - 1, scale) for end in (a, b)))
    unit = unit or max(abs(fa), abs(fb))
    floor = problem.noise.get(name, MONITOR_ZERO) * unit
    previous, carried = math.inf, getattr(problem, "carried", None)
    flat = 1e-2 if name in problem.singular else 1e-12  # least factor on the departure from the cubic
    for asked in range(60):
        base, tangent = hermite(a, b, length, s), hermite_slope(a, b, length, s)
        tangent /= math.sqrt(float(a.weights @ tangent**2))
        shape = (s * (1.0 - s)) ** 2
        bend = _bend_at(s, bends if asked >= _LONG else bends[-1:], a.u)
        u = base + shape * bend
        row = a.weights * tangent
        F, J = problem.evaluate(u)
        if carried is not None and (further := carried(u, J)) is not None:
            bend, u = bend + (further - u) / max(shape, flat), further
            F, J = problem.evaluate(u)
        steps, sign, log, size, residual = bordered(J, F, row, u, u, scale)
        step = steps[:, 0]
        if near:
            step = _without_kernel(J, F, row, scale)
            size = float(np.abs(step / scale).max())
        if _at_rounding(F, J, usual, scale):
            step, size = np.zeros_like(step), 0.0
        if sign == 0.0 and (
            name in problem.singular or (_certain(problem, name) and abs(s - known[-1][0]) < PLACES_ALIKE)
        ):
            point = Point(u, J, tangent, a.weights, sign, log, residual, 1, a.arc + s * length)
            point.examined = problem.examine(point, None)
            return Event(name, point, 0.0)
        if sign == 0.0 or not size < 1e3:
            return None
        bend = bend + step / max(shape, flat)
        bends = [*[other for other in bends if abs(other[0] - s) > PLACES_ALIKE][-1:], (s, bend)]
        if not problem.accurate():
            continue
        direction = steps[:, 1] / math.sqrt(float(a.weights @ steps[:, 1] ** 2))
        point = Point(u + step, J, direction, a.weights, sign, log, residual, 1, a.arc + s * length)
        f = problem.monitor(name, point)
        if not math.isfinite(f):
            return None
        # badly conditioned equations leave steps that do not shrink further
        settled = size < NEWTON_CONVERGED or (size < LOCATING_STALLED and size > 0.8 * previous)
        previous = size
        if settled and (abs(f) <= floor or high - low < 1e-12):
            before = point.u.copy()
            point.examined = problem.examine(point, None)
            moved = float(np.max(np.abs(before - point.u) / scale))
            if moved <= 1e-12:
                return _on_curve(problem, Event(name, point, f), tangent)
            aside = max(1e-3, _FARTHER * moved / length)  # solved more exactly, the zero lies elsewhere
            low, high, known = max(0.0, s - aside), min(1.0, s + aside), [(0.0, fa), (1.0, fb)]
            continue
        if not settled and abs(f) < 1e3 * size:
            continue
        if not near and name in problem.singular and abs(f) < 1e-3 * unit:
            near, known = True, [(0.0, fa), (1.0, fb)]
            low, high, f_low = max(0.0, s - 0.1), min(1.0, s + 0.1), fa
            continue
        if (f < 0.0) == (f_low < 0.0):
            low, f_low = s, f
        else:
            high = s
        known, tried = [*known[-3:], (s, f)], tried + 1
        # two factors of a product may vanish like the root of the distance, as two real multipliers become a pair
        shaped = known if tried <= _ROOTED else [(place, value * abs(value)) for place, value in known]
        s, previous = _zero(shaped, low, high) if tried <= _HALVED else 0.5 * (low + high), math.inf
    return None


def _at_rounding(
    F: NDArray[np.float64], J: NDArray[np.float64], usual: NDArray[np.float64], scale: NDArray[np.float64]
) -> bool:
    """Return whether what is left of each equation is rounding of what the unknowns' sizes are in it.

    An equation has no unit in common with an unknown: an event function of a billionth is small by itself. Where it
    degenerates, its size is that at the ends of the step.

    J: Jacobian of the equations at the place; usual: what `_terms` makes of those at the ends of the step.
    """
    own = _terms(J, F.size, scale)
    sizes = np.where(own < ILL_CONDITIONED * usual, usual, own)
    return bool((np.abs(F) <= RESIDUAL_ROUNDING * sizes).all())


def _terms(J: NDArray[np.float64], count: int, scale: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the size of the largest term of each equation, shape (count,)."""
    return np.asarray(np.abs(J[:count] * scale).max(axis=1))


def _bend_at(s: float, bends: list[tuple[float, NDArray[np.float64]]], u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how the branch departs from the cubic at a place, on the line through what is known at up to two."""
    if len(bends) < 2:
        return bends[0][1] if bends else np.zeros_like(u)
    (p, one), (q, other) = bends
    return other + (s - q) / (q - p) * (other - one)


def _without_kernel(
    J: NDArray[np.float64], F: NDArray[np.float64], row: NDArray[np.float64], scale: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the Newton step in the plane without its part along the least singular vector of the equations."""
    left, values, right = np.linalg.svd(np.vstack([J, row]) * scale)
    inverse = np.append(1.0 / values[:-1], 0.0)
    return np.asarray(scale * (right.T @ (inverse * (left.T @ np.append(-F, 0.0)))))


def _zero(known: list[tuple[float, float]], low: float, high: float) -> float:
    """Return the zero of the inverse interpolation through the latest values, or the bracket's middle."""
    for count in (3, 2):
        (*others, last) = known[-count:]
        values = [f for _, f in known[-count:]]
        if len(values) < count or len(set(values)) < count:
            continue
        guess = 0.0
        for i, (s, f) in enumerate([*others, last]):
            weight = 1.0
            for j, g in enumerate(values):
                if j != i:
                    weight *= g / (g - f)
            guess += weight * s
        if low < guess < high:
            return guess
    return 0.5 * (low + high)
