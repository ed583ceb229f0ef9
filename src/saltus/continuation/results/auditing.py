"""The audit of a curve: what always holds, whatever the solutions are, is checked on points and special points alone.

docs/theory/continuation.md, "The audit", derives the checks. A check that cannot tell says nothing.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from saltus.continuation.core.point_types import CHANGES
from saltus.continuation.results.audit import Audit, Breach
from saltus.continuation.results.checks.afresh import afresh
from saltus.continuation.results.checks.liouville import liouville
from saltus.continuation.results.curve import SolutionCurve
from saltus.continuation.results.locus_ledger import holds, other_values, signs_of_coefficient
from saltus.continuation.results.stability_ledger import (
    at_one,
    contradicted_labels,
    critical_rows,
    growing,
    unexplained,
)
from saltus.errors import SaltusError
from saltus.orbits.records import changes_nothing
from saltus.orbits.signature import Signature
from saltus.scales import LOCATED, NEWTON_AT_ROUNDING, ON_LINE, Verdict, followed, same, zero

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["audited"]

Curve = TypeVar("Curve", bound=SolutionCurve[Any])

# types of special points at which a parameter may turn; TP are those of a locus and of a branch along a quantity
_TURNING = frozenset({"SN", "BP", "TP", "BE", "HOM", "SNIC", "CP", "BT", *CHANGES})
_BESIDE = 6  # points on each side of a turn whose solutions are compared
_ROW = 3  # consecutive points that lie on an earlier part of a curve
_CHUNK = 256  # points that are looked at together


def audited(curve: Curve, remarks: Sequence[str] = (), last: tuple[Any, Any] | None = None) -> Curve:
    """Return a curve with its audit.

    remarks: what its run says of places where the equations degenerate. last: equations and point with which it ends,
    as they were left.
    """
    if len(curve) < 2:
        return curve._with_audit(Audit((), (("forward", 0),), tuple(remarks)))
    seen, counts = _Seen.of(curve), growing(curve)
    told = {
        "forward": _forward(seen, counts),
        "twice": _twice(seen),
        "ledger": unexplained(curve, counts),
        "label": contradicted_labels(curve, counts),
        "Liouville": liouville(curve, last),
        "afresh": afresh(curve),
    }
    if len(curve.varied) > 1:
        told |= {
            "condition": holds(curve),
            "coefficient": signs_of_coefficient(curve),
            "other values": other_values(curve),
        }
    breaches = [
        Breach(name, text, place, _values_at(seen, place)) for name, (found, _) in told.items() for place, text in found
    ]
    checked = tuple((name, count) for name, (_, count) in told.items())
    return curve._with_audit(Audit(tuple(breaches), checked, (*remarks, *_families(seen))))


@dataclass(frozen=True, eq=False)
class _Seen:
    """What is seen of a curve: parameters, and quantities that no shift of time along an orbit changes."""

    curve: Any
    values: NDArray[np.float64]  # (point, parameter)
    rounding: NDArray[np.float64]  # (parameter,): changes that are none

    @classmethod
    def of(cls, curve: Any) -> _Seen:
        values = curve.values.reshape(len(curve), -1)
        # what is left of the equations' error moves the parameters, in units of their intervals
        solved = followed(curve.tolerance) if "tolerance" in vars(curve) else NEWTON_AT_ROUNDING
        rounding = []
        for column, width in zip(values.T.tolist(), _intervals(curve), strict=True):
            first, last = min(column), max(column)
            rounding.append(LOCATED * 1e-2 * (last - first) + solved * max(abs(first), abs(last), width))
        return cls(curve, values, np.array(rounding))

    @property
    def closed(self) -> bool:
        """Whether the curve ends where it began."""
        return any("closed" in reason for reason in self.curve.stopped)

    @cached_property
    def size(self) -> float:
        """Size of the largest state."""
        lows, highs = self.curve.extremes
        return float(np.maximum(np.abs(lows).max(initial=0.0), np.abs(highs).max(initial=0.0))) or 1.0

    @cached_property
    def quantities(self) -> NDArray[np.float64]:
        """The quantities, (point, quantity), each over its range along the curve."""
        curve = self.curve
        table = np.hstack([*curve.extremes, *(np.reshape(column, (len(curve), -1)) for column in _further(curve))])
        sizes = np.abs(table).max(axis=0, initial=0.0)
        if (means := vars(curve).get("means")) is not None:
            # a mean that is 0 by symmetry is rounding of what it is the mean of
            known = np.maximum(np.abs(curve.lows), np.abs(curve.highs)).max(axis=0, initial=0.0)
            sizes[-means.shape[1] :] = known[: means.shape[1]]
        finite = np.isfinite(table).all(axis=0)
        table, sizes = table[:, finite], sizes[finite]
        ranges = np.ptp(table, axis=0)
        kept = ranges > LOCATED * sizes
        return np.asarray(table[:, kept] / ranges[kept])

    @cached_property
    def uncounted(self) -> NDArray[np.float64]:
        """What the number of hits does not change, (point, quantity): by it orbits with different hits are compared.

        The extremes of a drive's phase depend on where the first segment starts, and are left out. A hit of tiny speed
        changes neither harmonics nor the multipliers that are not tiny; behind a grazing a multiplier leaps.
        """
        curve = self.curve
        if "harmonics" not in vars(curve):
            return self.quantities
        states, sizes = len(curve.system.states), np.maximum(np.abs(curve.lows), np.abs(curve.highs)).max(axis=0)
        waves = np.abs(curve.harmonics[:, :states]).reshape(len(curve), -1)
        table = np.hstack([curve.lows[:, :states], curve.highs[:, :states], curve.means[:, :states], waves])
        known = np.append(np.tile(sizes[:states], 3), np.abs(waves).max(axis=0))
        ranges = np.ptp(table, axis=0)
        kept = np.isfinite(table).all(axis=0) & (ranges > LOCATED * known)
        shares = 1.0 - 1.0 / (1.0 + np.abs(curve.multipliers))
        shares[np.isnan(shares)] = 1.0  # unknown ones are large, as infinite ones are
        periods = curve.period[:, None] / np.abs(curve.period).max()
        return np.hstack([table[:, kept] / ranges[kept], periods, shares])

    @cached_property
    def events(self) -> list[list[int]]:
        """The transitions that make each point's orbit of a flow, as often as they happen; none of other solutions."""
        curve = self.curve
        if "forms" not in vars(curve) or not isinstance(curve.forms[0], Signature):
            return [[]] * len(curve)
        makes = [not changes_nothing(transition) for transition in curve.system.transitions]
        found = [sorted(k for k in form.transitions if k >= 0 and makes[k]) for form in curve.forms]
        return [found[k] for k in curve.form.tolist()]

    @cached_property
    def columns(self) -> list[list[float]]:
        """The values of each parameter."""
        found: list[list[float]] = self.values.T.tolist()
        return found

    @cached_property
    def moves(self) -> list[list[float]]:
        """Changes of each parameter from point to point."""
        return [[b - a for a, b in pairwise(column)] for column in self.columns]

    @cached_property
    def turns(self) -> list[list[tuple[int, int]]]:
        """Between which points, the first and the last of a turn, each parameter turns."""
        found: list[list[tuple[int, int]]] = []
        for moves, rounding in zip(self.moves, self.rounding.tolist(), strict=True):
            if min(moves) > rounding or max(moves) < -rounding:  # nearly all curves
                found.append([])
                continue
            moving = [i for i, move in enumerate(moves) if abs(move) > rounding]
            found.append([(i, j + 1) for i, j in pairwise(moving) if moves[i] * moves[j] < 0.0])
        return found


def _intervals(curve: Any) -> list[float]:
    """Return the widths of the intervals of the parameters; 0 where there is none."""
    bounds = curve.options.get("bounds", ())
    listed = (
        [bounds.get(name, ()) for name in curve.varied] if isinstance(bounds, Mapping) else [bounds] * len(curve.varied)
    )
    widths = [abs(pair[1] - pair[0]) if len(pair) == 2 else 0.0 for pair in listed]
    return [width if math.isfinite(width) else 0.0 for width in widths]


def _further(curve: Any) -> list[NDArray[np.float64]]:
    """Return further quantities of orbits that no shift of time changes."""
    return [curve.period, curve.means] if "means" in vars(curve) else []


def _values_at(seen: _Seen, place: float) -> tuple[float, ...]:
    """Return the parameters at a place among the points."""
    at = min(max(place, 0.0), len(seen.values) - 1.0)
    first = int(at)
    last = min(first + 1, len(seen.values) - 1)
    found = seen.values[first] + (at - first) * (seen.values[last] - seen.values[first])
    return tuple(float(value) for value in found)


def _told(seen: _Seen, place: float) -> str:
    values = _values_at(seen, place)
    return ", ".join(f"{name} = {value:.9g}" for name, value in zip(seen.curve.varied, values, strict=True))


def _families(seen: _Seen) -> list[str]:
    """Return where the parameter of a branch rests within its error while solutions differ, and one value is critical.

    Along a canard, and next to a homoclinic orbit, the parameter rests as well, but no multiplier stays at 1. Where it
    turns, as at a pitchfork, solutions differ by the root of its error at most, or by the fourth root.
    """
    if seen.values.shape[1] > 1 or vars(seen.curve).get("fixed") is not None:
        return []
    rounding = float(seen.rounding[0])
    if not any(abs(move) <= rounding for move in seen.moves[0]):
        return []
    rests, family = np.abs(np.array(seen.moves[0])) <= rounding, at_one(seen.curve)
    rests &= family[1:] & family[:-1]
    differ = np.abs(np.diff(seen.quantities, axis=0)).max(axis=1, initial=0.0) > LOCATED
    edges = np.flatnonzero(np.diff(np.concatenate([[0], rests & differ, [0]])))
    name, wide = seen.curve.varied[0], float(np.ptp(seen.values))
    turn = (seen.rounding[0] / wide) ** 0.25 if wide > seen.rounding[0] else 0.0
    return [
        f"points {i} to {j}: {name} rests at {seen.values[i, 0]:.9g} within its error, as along a family of solutions"
        for i, j in edges.reshape(-1, 2).tolist()
        if j - i >= _ROW and float(np.ptp(seen.quantities[i : j + 1], axis=0).max()) > turn
    ]


def _forward(seen: _Seen, counts: NDArray[np.int64] | None) -> tuple[list[tuple[float, str]], int]:
    """Return where a parameter turns without a point that explains it, and where a curve goes back on itself."""
    found, count = [], 0
    if vars(seen.curve).get("fixed") is not None:  # along a quantity, which turns as it likes
        return [], 0
    places = [point.position for point in seen.curve.special_points if point.type in _TURNING]
    turns = [(k, name, *ends) for k, name in enumerate(seen.curve.varied) for ends in seen.turns[k]]
    if turns:
        critical = critical_rows(seen.curve, counts)  # where a branch starts at a fold, this is no special point of it
        for k, name, i, j in turns:
            count += 1
            middle = 0.5 * (i + j)
            at = _told(seen, middle)
            if _retraced(seen, k, i, j):
                found.append((middle, f"{name} turns at {at}, and the same solutions follow on both sides"))
            elif not any(i - 1.0 <= place <= j + 1.0 for place in places) and not critical[i : j + 1].any():
                found.append((middle, f"{name} turns at {at} without a special point"))
    return found, count


def _retraced(seen: _Seen, k: int, i: int, j: int) -> bool:
    """Return whether the solutions behind a turn lie on the line through those before it, at the same parameter."""
    before = range(i, max(i - _BESIDE, -1), -1)
    count, values, rounding = 0, seen.columns[k], float(seen.rounding[k])
    for b in range(j, min(j + _BESIDE, len(values))):
        for a, c in pairwise(before):
            start, width = values[a], values[c] - values[a]
            if abs(width) <= rounding or not 0.0 <= (share := (values[b] - start) / width) <= 1.0:
                continue
            # hits of tiny speed come and go, and nothing else of the orbit changes
            alike = seen.events[a] == seen.events[c] == seen.events[b]
            away = _off_line(seen.quantities if alike else seen.uncounted, (a, c), share, b)
            if away is None:
                continue
            if not away < ON_LINE:
                return False
            count += 1
            break
    return count > 1


def _off_line(table: NDArray[np.float64], segment: tuple[int, int], share: float, b: int) -> float | None:
    """Return the distance of a point from the line through two others, over theirs; None where these are the same."""
    a, c = segment
    chord = table[c] - table[a]
    line = table[a] + share * chord
    length = float(np.abs(chord).max(initial=0.0))
    return float(np.abs(table[b] - line).max(initial=0.0)) / length if length > 0.0 else None


def _twice(seen: _Seen) -> tuple[list[tuple[float, str]], int]:
    """Return special points that are there twice, and where a branch covers solutions that it had before."""
    found = []
    points = list(seen.curve.special_points)
    several = len(points) > 1
    wide = (LOCATED * np.maximum(np.ptp(seen.values, axis=0), seen.rounding)).tolist() if several else []
    values = [[point.value(name) for name in seen.curve.varied] for point in points] if several else []
    for i, point in enumerate(points):
        for k in range(i):
            near = all(map(same, values[i], values[k], wide))
            if near and _is_once_more(seen, point, points[k]):
                found.append((point.position, f"{point.label} is {points[k].label} once more"))
    # a parameter that never turns comes to no value twice
    if seen.values.shape[1] == 1 and seen.turns[0] and (place := _covered(seen)) is not None:
        found.append((float(place), f"from {_told(seen, place)} on, solutions are there a second time"))
    return found, len(points)


def _is_once_more(seen: _Seen, point: Any, other: Any) -> bool:
    """Return whether two special points at the same parameters, apart along the curve, are one solution."""
    if (point.type, point.of) != (other.type, other.of):
        return False
    alike = _events_of(point) == _events_of(other)
    if not alike and not _at_one_place(seen, point, other):
        return False
    if zero(point.arclength - other.arclength, LOCATED) is not Verdict.NO:
        return False
    # next to a homoclinic orbit cycles differ by their periods alone
    longer, shorter = (getattr(one.solution, "period", 0.0) for one in (point, other))
    extent, known = seen.curve._extent(point.solution), seen.curve._extent(other.solution)
    return (
        extent.shape == known.shape
        and bool(same(extent, known, LOCATED * seen.size))
        and bool(same(longer, shorter, LOCATED * abs(longer)))
        and _alongside(seen.quantities if alike else seen.uncounted, point.position, other.position)
    )


def _at_one_place(seen: _Seen, point: Any, other: Any) -> bool:
    """Return whether the parameters of two points are the same by their errors.

    Where hits accumulate, special points do so too, each of orbits with a hit more.
    """
    values = ([one.value(name) for name in seen.curve.varied] for one in (point, other))
    return all(map(same, *values, seen.rounding.tolist()))


def _events_of(point: Any) -> list[int]:
    """Return the transitions of a special point's orbit, each as often as it happens; none where they change there."""
    form = getattr(point.solution, "form", None)
    if not isinstance(form, Signature) or point.type in CHANGES:
        return []
    return sorted(k for k in form.transitions if k >= 0)


def _alongside(table: NDArray[np.float64], place: float, other: float) -> bool:
    """Return whether two places of a curve may have one solution, by what the points next to them have.

    Mirror images have the same extremes, and means of their own.
    """
    last = len(table) - 1
    rows = [np.clip([int(at), int(at) + 1], 0, last) for at in (place, other)]
    lows, highs = (np.array([reach(table[pair], axis=0) for pair in rows]) for reach in (np.min, np.max))
    room = np.max(highs - lows, axis=0) + LOCATED
    return bool(np.all(lows.max(axis=0) - highs.min(axis=0) <= room))


def _covered(seen: _Seen) -> int | None:
    """Return the first of several points in a row that lie on an earlier part of a branch; None where none does."""
    count, row, last = len(seen.values), 0, -1
    for b in range(_ROW, count - 1 if seen.closed else count, _CHUNK):
        for at in _on_earlier(seen, np.arange(b, min(b + _CHUNK, count - seen.closed))):
            row = 1 if at != last + 1 or row == _ROW else row + 1
            last = at
            if row == _ROW and _alike(seen, float(seen.values[at - 1, 0])):
                return at - _ROW + 1
    return None


def _on_earlier(seen: _Seen, points: NDArray[np.intp]) -> list[int]:
    """Return which points lie on the line through two neighbours that come at least three points before."""
    v, q = seen.values[:, 0], seen.quantities
    low, high = np.minimum(v[:-1], v[1:]), np.maximum(v[:-1], v[1:])
    joined = (high - low > seen.rounding[0]) & (np.diff(seen.curve.equations) == 0)
    inside = (low <= v[points][:, None]) & (v[points][:, None] <= high) & joined
    which, i = np.nonzero(inside & (np.arange(v.size - 1) < points[:, None] - 2))
    b = points[which]
    chords = q[i + 1] - q[i]
    away = np.abs(q[b] - q[i] - ((v[b] - v[i]) / (v[i + 1] - v[i]))[:, None] * chords).max(axis=1, initial=0.0)
    on = away < 0.1 * ON_LINE * np.abs(chords).max(axis=1, initial=0.0)
    found: list[int] = np.unique(b[on]).tolist()
    return found


def _alike(seen: _Seen, value: float) -> bool:
    """Return whether two of the solutions at a value of the parameter, each solved there, are the same."""
    try:
        solutions = seen.curve.at(value)
    except SaltusError:  # none is found between two points: it cannot be told
        return False
    rows = [np.concatenate([*one.extremes, np.atleast_1d(getattr(one, "period", 0.0))]) for one in solutions]
    size = float(np.max([np.abs(row).max(initial=0.0) for row in rows], initial=math.ulp(0.0)))
    return any(bool(same(a, b, LOCATED * size)) for i, a in enumerate(rows) for b in rows[:i])
