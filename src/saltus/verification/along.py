"""What a curve says of its course: its ends, the order of its points, the places and names of its special points."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.continuation.core.point_types import CHANGES
from saltus.continuation.results.auditing import audited
from saltus.scales import LOCATED, PRINTED, followed, same
from saltus.verification.names import named_rows
from saltus.verification.table import AGREES, DIFFERS, Row, compared, equal, unchecked

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.results.special_points import SpecialPoint

__all__ = ["course_rows"]

_PLACE = re.compile(r"([A-Za-z_]\w*) = (-?(?:\d[\d.]*(?:e[+-]?\d+)?|inf|nan))(?=[,:]|$)")  # as in "A = 0.5, w = 1: ..."
_AT_POINTS = {
    "the cycle shrinks to an equilibrium": "HB",
    "the cycle shrinks to a boundary equilibrium": "BE",
    "the cycle shrinks to a two-fold": "BE",
}
_GOES_ON = frozenset({"SN", "BP", "BE", "TP", "CP", "BT", "HOM", "SNIC", *CHANGES})  # points beside which it may turn


def course_rows(curve: Any) -> list[Row]:
    """Return the checks of what a curve says of its ends, of its points' order and of its special points."""
    if not len(curve):
        return []
    rows = [_rising(curve), *(row for end in (0, -1) for row in _end(curve, end))]
    rows += [row for point in curve.special_points for row in _placed(curve, point)]
    rows += [*named_rows(curve), *_turns(curve), *_signs(curve), *_audit(curve)]
    return rows


def _rising(curve: Any) -> Row:
    """Return whether the arclength rises from 0; the last point of a closed curve is its start once more."""
    arcs = np.asarray(curve.arclength)
    rising = bool(arcs[0] == 0.0 and np.all(np.diff(arcs[:-1]) > 0.0) and np.all(np.diff(arcs) >= 0.0))
    return equal("arclength rises from 0", True, rising)


def _end(curve: Any, end: int) -> Iterator[Row]:
    """Yield the checks of why a curve ended at its first or at its last point."""
    reason, what = curve.stopped[end], f"stopped, at the {'last' if end else 'first'} point"
    values, room = curve.values.reshape(len(curve), -1), _steps(curve)
    here = dict(zip(curve.varied, zip(values[end].tolist(), room.tolist(), strict=True), strict=True))
    told = {name: float(text) for name, text in _PLACE.findall(reason) if name in here}
    for name, value in told.items():
        at, step = here[name]
        yield _near(f"{what}: {name}", value, at, PRINTED * max(abs(at), abs(value)), step)
    if reason.endswith("bound reached"):
        yield equal(what, "bound reached", "bound reached" if _at_bound(curve, values[end]) else "within the bounds")
    elif reason.endswith(" is closed"):
        yield _near(what, 0.0, float(np.max(np.abs(values[0] - values[-1]) / room)), LOCATED, 1.0)
    elif reason == "the start":
        start = np.array([_started(curve, name, value) for name, value in zip(curve.varied, values[end], strict=True)])
        yield _near(what, 0.0, float(np.max(np.abs(start - values[end]) / room)), LOCATED, 1.0)
    for words, kind in _AT_POINTS.items():
        if reason.endswith(words):
            last = curve.special_points[end].type if len(curve.special_points) else "no point"
            yield equal(what, kind, last)


def _started(curve: Any, name: str, otherwise: float) -> float:
    return float(curve.parameters.get(name, otherwise))


def _steps(curve: Any) -> NDArray[np.float64]:
    """Return the largest step of each parameter from point to point; of one that rests its rounding."""
    values = curve.values.reshape(len(curve), -1)
    steps = np.abs(np.diff(values, axis=0)).max(axis=0, initial=0.0)
    return np.asarray(np.maximum(steps, PRINTED * np.maximum(np.abs(values).max(axis=0), LOCATED)))


def _near(what: str, said: float, found: float, error: float, clear: float) -> Row:
    """Return the row of two numbers that agree within an error, and differ beyond what is `clear`."""
    difference = abs(said - found)
    if error < difference <= clear:
        return unchecked(what, said, f"{found:.9g}, less than a step away")
    return Row(what, said, found, difference, error, AGREES if difference <= error else DIFFERS)


def _at_bound(curve: Any, values: NDArray[np.float64]) -> bool:
    """Return whether a parameter is at one of its bounds, or none are known."""
    bounds = curve.options.get("bounds")
    if not bounds:
        return True
    listed: list[Any] = [bounds.get(name) for name in curve.varied] if isinstance(bounds, Mapping) else [bounds]
    for value, pair in zip(values.tolist(), listed, strict=False):
        for bound in pair or ():
            width = max(abs(one) for one in pair if math.isfinite(one)) if math.isfinite(bound) else 0.0
            if math.isfinite(bound) and same(value, bound, LOCATED * width):
                return True
    return False


def _placed(curve: Any, point: SpecialPoint[Any]) -> Iterator[Row]:
    """Yield whether a special point lies between the points that it says, and in their middle by its number."""
    last, place = len(curve) - 1, point.position
    first = math.floor(place)
    arcs = curve.arclength
    low = arcs[first] if 0 <= first <= last else -math.inf
    high = arcs[first + 1] if first + 1 <= last else math.inf
    room = LOCATED * max(1.0, float(np.abs(arcs).max()))
    inside = -1.0 < place < last + 1.0 and low - room <= point.arclength <= high + room
    inside = inside and (place > 0.0 or point.arclength < high) and (place < last or point.arclength > low)
    yield equal("position by arclength", True, bool(inside))._replace(place=point.label)
    if math.isfinite(place):
        yield compared("position", place, first + 0.5, 0.0)._replace(place=point.label)


def _turns(curve: Any) -> Iterator[Row]:
    """Yield whether the parameter turns at saddle-nodes and nonsmooth folds, or the one that a TP names."""
    values, last = curve.values.reshape(len(curve), -1), len(curve) - 1
    if getattr(curve, "fixed", None) is not None:  # along a quantity, the parameter turns as it likes
        return
    rounding = _rounding(curve)
    places = [point.position for point in curve.special_points if point.type in _GOES_ON]
    for point in curve.special_points:
        first, along = math.floor(point.position), curve.varied.index(point.of) if point.of in curve.varied else 0
        claimed = _claimed_turn(curve, point)
        alone = sum(abs(place - point.position) <= 1.0 for place in places) <= 1
        if claimed is None or not (alone and 0 <= first < last):
            continue
        sides = values[first : first + 2, along] - point.value(curve.varied[along])
        if np.all(np.abs(sides) > rounding[along]):
            turns = float(sides[0] * sides[1]) > 0.0
            yield equal(f"{curve.varied[along]} turns", claimed, turns)._replace(place=point.label)


def _signs(curve: Any) -> Iterator[Row]:
    """Yield whether the coefficient along a locus of folds changes its sign at special points alone."""
    if getattr(curve, "type", "") != "SN" or hasattr(curve, "tolerance"):  # of orbits the audit tells
        return
    signs, met = np.sign(curve.coefficient), [point.position for point in curve.special_points]
    known = np.flatnonzero(np.isfinite(signs) & (signs != 0.0)).tolist()
    changes = [(i, j) for i, j in pairwise(known) if signs[i] != signs[j]]
    told = [pair for pair in changes if any(pair[0] <= place <= pair[1] for place in met)]
    yield equal("changes of the coefficient's sign", len(told), len(changes))


def _claimed_turn(curve: Any, point: SpecialPoint[Any]) -> bool | None:
    """Return whether a parameter turns at a special point by what the point is; None where that tells nothing."""
    if point.type == "TP" or (point.type == "SN" and len(curve.varied) == 1):
        return True
    if len(curve.varied) == 1 and point.kind in ("persistence", "nonsmooth fold"):
        return point.kind == "nonsmooth fold"
    return None


def _rounding(curve: Any) -> NDArray[np.float64]:
    """Return changes of the parameters that are none: what is left of the error of a located point."""
    values = curve.values.reshape(len(curve), -1)
    solved = followed(getattr(curve, "tolerance", 0.0))
    return np.asarray(LOCATED * np.ptp(values, axis=0) + solved * np.abs(values).max(axis=0))


def _audit(curve: Any) -> Iterator[Row]:
    """Yield whether an audit made anew has no breach that the curve does not tell."""
    told = {(breach.check, round(breach.position)) for breach in curve.audit.breaches}
    checks = {name: "passed" for name, _ in curve.audit.checked}
    anew = audited(curve).audit
    for name, _ in anew.checked:
        fresh = [b for b in anew.breaches if b.check == name and (name, round(b.position)) not in told]
        if not fresh:
            yield Row(f"audit, {name}", "nothing else", "nothing else", math.nan, math.nan, AGREES)
        for breach in fresh:
            yield Row(f"audit, {name}", checks.get(name, "none made"), breach.text, math.nan, math.nan, DIFFERS)
