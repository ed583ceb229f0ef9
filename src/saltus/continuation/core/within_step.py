"""Eigenvalues or multipliers that become critical within one step of a branch, and how often: none is passed over.

Values that meet are taken together, since symmetric functions of them stay smooth there. docs/theory/equilibria.md,
"Values within a step", explains the search.
"""

from __future__ import annotations

import cmath
import math
from collections import Counter
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from saltus.continuation.core.value_tests import Tested
from saltus.scales import (
    CROSSES_ONCE,
    MOVES_STEADILY,
    PAIRED,
    PASSES_ONCE,
    TESTED_SIGN,
    TWO_ZEROS,
    VALUES_FOLLOWED,
    ZEROS_ALIKE,
    ZEROS_TOUCH,
)

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Spectra = Callable[[NDArray[np.float64]], NDArray[np.complex128]]

__all__ = [
    "ASIDE",
    "Spectrum",
    "dips",
    "searched",
    "several_critical",
    "steady",
]

ASIDE = 1e-4  # fraction of a step by which values are differentiated
_DEEPEST = 10  # most times that a part of a step is halved
_MOST = 200  # parts looked at, from which on none is halved
_DOUBT = 2.0  # factor on what a cubic misses in the middle of a part
_UNEVEN = 8.0  # factor on the curvature of a function that is taken to change steadily
_BISECTIONS = 30  # of the search for a zero


class Spectrum(NamedTuple):
    """Values at a place of a branch, and those a little aside."""

    values: NDArray[np.complex128]
    beside: NDArray[np.complex128]  # in any order
    away: float  # distance of these, in lengths of the step


class _Place(NamedTuple):
    """A fraction of a step, its values, and those beside in the same order."""

    share: float
    values: list[complex]
    beside: list[complex]
    away: float

    @classmethod
    def at(cls, share: float, values: list[complex], beside: list[complex], away: float) -> _Place:
        """Return a place at which values are known with those beside in any order."""
        return cls(share, values, _matched(values, beside), away)


def steady(rows: Sequence[ArrayLike], lengths: tuple[float, float], tests: Callable[[list[complex]], Tested]) -> bool:
    """Return whether values move so steadily that none becomes critical and comes back in the last of two steps.

    Parameters
    ----------
    rows : sequence of three array_like of complex
        The values at three points, each at the index of its predecessor.
    lengths : pair of float
        Arclengths of the steps between the points.
    tests : callable
        `circle_tests` or `border_tests`.
    """
    before, first, last = (r if isinstance(r, list) else np.asarray(r, np.complex128).tolist() for r in rows)
    ratio = lengths[1] / lengths[0]
    ahead = [value + (value - old) * ratio for old, value in zip(before, first, strict=True)]
    if any(near != value for near, value in zip(_matched(ahead, last), last, strict=True)):
        return False  # two values may have changed places
    groups: list[tuple[bool, list[Tested]]] = []
    near: list[tuple[complex, float]] = []
    for row in zip(before, first, last, strict=True):
        known = [tests([value]) for value in row]
        if known[0].far and known[1].far and known[2].far:
            continue
        moved = max(abs(row[1] - row[0]), abs(row[2] - row[1]))
        if any(abs(row[1] - other) <= moved + way and row[1] != other.conjugate() for other, way in near):
            return False  # which of both is which is not told by where they are
        near.append((row[1], moved))
        if moved > MOVES_STEADILY * min(test.scale for test in known):
            return False
        above, below = {value.imag > 0.0 for value in row}, {value.imag < 0.0 for value in row}
        if len(above) > 1 or len(below) > 1:
            return False
        if True in above:
            groups.append((True, [tests([value, value.conjugate()]) for value in row]))
        elif True not in below:
            groups.append((False, known))
    changed: Counter[tuple[bool, int]] = Counter()
    for paired, group in groups:
        for kind, (back, start, end) in enumerate(zip(*(own.values for own in group), strict=True)):
            if dips([back, start, end], *lengths, _UNEVEN):
                return False
            changed[paired, kind] += (start < 0.0) != (end < 0.0)
    return max(changed.values(), default=0) < 2


def searched(
    spectra: Spectra,
    rows: Sequence[NDArray[np.complex128]],
    lengths: tuple[float, ...],
    tests: Callable[[list[complex]], Tested],
    *,
    touches: bool = False,
) -> bool | None:
    """Return what `several_critical` does of the last step, without spectra where all values move steadily.

    Parameters
    ----------
    spectra : callable
        See `several_critical`.
    rows : sequence of two or three ndarray
        The values at the point before the step, if there is one, and at its ends.
    lengths : tuple of float
        Arclengths of the steps between those points.
    tests, touches
        As `several_critical` takes them.
    """
    *before, first, last = rows
    if before:
        at = first.tolist()
        known = _matched(at, before[0].tolist()), at, _matched(at, last.tolist())
        if steady(known, (lengths[0], lengths[1]), tests):
            return False
    start, centre, end = spectra(np.array([ASIDE, 0.5, 1.0 - ASIDE]))
    ends = Spectrum(first, start, ASIDE), Spectrum(last, end, -ASIDE)
    return several_critical(spectra, *ends, tests, touches=touches, centre=centre)


def several_critical(
    spectra: Spectra,
    first: Spectrum,
    last: Spectrum,
    tests: Callable[[list[complex]], Tested],
    most: int | None = None,
    *,
    touches: bool = False,
    centre: NDArray[np.complex128] | None = None,
) -> bool | None:
    """Return whether values become critical at more than one place of a step in the same way; None if it is not known.

    Parameters
    ----------
    spectra : callable
        Values at fractions of the step, (places,) -> (places, values), in any order.
    first, last : Spectrum
        The values at the step's ends.
    tests : callable
        `circle_tests` or `border_tests`.
    most : int, optional
        Parts of the step that are looked at before it is not known; by default as many as it takes.
    touches : bool
        Whether the first function is known to vanish twice, as at the vertex of a pitchfork.
    centre : ndarray, optional
        The values in the middle of the step, where these are known.
    """
    centre = spectra(np.array([0.5]))[0] if centre is None else centre
    middle, *ends = known = [values.tolist() for values in (centre, *first[:2], *last[:2])]
    if not all(all(map(cmath.isfinite, values)) for values in known):
        return None
    zeros: list[list[float]] = [[], [], []]
    start, end = _Place.at(0.0, ends[0], ends[1], first.away), _Place.at(1.0, ends[2], ends[3], last.away)
    parts = [(start, end, middle, 0)]
    looked = 0
    while parts:
        left, right, middle, depth = parts.pop()
        looked += 1
        found = _zeros_of_part(left, right, middle, tests, final=depth == _DEEPEST or looked >= _MOST)
        if found is None and looked == most:
            return None
        if found is None:
            quarter = 0.25 * (right.share - left.share)
            at = left.share + 2.0 * quarter
            more = spectra(np.array([at - quarter, at + ASIDE, at + quarter]))
            if not np.isfinite(more).all():
                return None
            first_middle, beside, last_middle = more.tolist()
            half = _Place(at, middle, _matched(middle, beside), ASIDE)
            parts += [(left, half, first_middle, depth + 1), (half, right, last_middle, depth + 1)]
            continue
        for kind, (known, new) in enumerate(zip(zeros, found, strict=False)):
            known += new
            if known and max(known) - min(known) > ZEROS_ALIKE and not (touches and kind == 0 and _two_alike(known)):
                return True
    return False


def _two_alike(zeros: list[float]) -> bool:
    """Return whether zeros lie at two places near each other."""
    first, last = min(zeros), max(zeros)
    return last - first <= ZEROS_TOUCH and all(min(zero - first, last - zero) <= ZEROS_ALIKE for zero in zeros)


def _matched(values: list[complex], others: list[complex]) -> list[complex]:
    """Return the other values, each at the place of that one to which it is nearest."""
    return [others[k] for k in _order(values, others)]


def _groups(first: list[complex], last: list[complex]) -> list[list[int]]:
    """Return the places of values that belong together: complex ones at either end with their conjugates."""
    size = len(first)
    if size < 3:
        return [list(range(size))]
    group = list(range(size))
    for known in (first, last):
        open_pairs = [i for i in range(size) if known[i].imag > PAIRED * abs(known[i])]
        below = [i for i in range(size) if known[i].imag < -PAIRED * abs(known[i])]
        for i in open_pairs:
            j = min(below, key=lambda k: abs(known[k] - known[i].conjugate()))
            below.remove(j)
            old, new = group[j], group[i]
            group = [new if g == old else g for g in group]
    found: dict[int, list[int]] = {}
    for i, g in enumerate(group):
        found.setdefault(g, []).append(i)
    return list(found.values())


def _cubic(f: float, df: float, g: float, dg: float, s: float) -> float:
    """Return the cubic with values f and g and slopes df and dg at 0 and 1."""
    return f + s * (df + s * (3.0 * (g - f) - 2.0 * df - dg + s * (2.0 * (f - g) + df + dg)))


def _slope(f: float, df: float, g: float, dg: float, s: float) -> float:
    """Return the slope of that cubic."""
    return df + s * (2.0 * (3.0 * (g - f) - 2.0 * df - dg) + 3.0 * s * (2.0 * (f - g) + df + dg))


def _inflection(f: float, df: float, g: float, dg: float) -> list[float]:
    """Return where the slope of that cubic turns within 0 and 1."""
    bend, twist = 3.0 * (g - f) - 2.0 * df - dg, 3.0 * (2.0 * (f - g) + df + dg)
    return [-bend / twist] if 0.0 < -bend * twist < twist * twist else []


def _turning(f: float, df: float, g: float, dg: float) -> list[float]:
    """Return where that cubic has its extrema within 0 and 1, in order."""
    a, b, c = 3.0 * (2.0 * (f - g) + df + dg), 2.0 * (3.0 * (g - f) - 2.0 * df - dg), df
    inner = b * b - 4.0 * a * c
    if inner <= 0.0:
        return []
    q = -0.5 * (b + math.copysign(math.sqrt(inner), b))
    found = [x for x in (q / a if a != 0.0 else math.inf, c / q if q != 0.0 else math.inf) if 0.0 < x < 1.0]
    return sorted(found)


def _roots(coefficients: list[tuple[float, float, float, float]]) -> list[complex]:
    """Return the values in the middle of a part, by cubics of one value, or of the sum and product of two."""
    middles = [_cubic(*known, 0.5) for known in coefficients]
    if len(middles) == 1:
        return [complex(middles[0])]
    half, product = 0.5 * middles[0], middles[1]
    square = half * half - product
    root = complex(0.0, math.sqrt(-square)) if square < 0.0 else math.sqrt(square)
    return [complex(half + root), complex(half - root)]


def _zeros_of_part(
    left: _Place,
    right: _Place,
    middle: list[complex],
    tests: Callable[[list[complex]], Tested],
    *,
    final: bool,
) -> list[list[float]] | None:
    """Return the zeros of each function in a part of a step, in steps; None where halves must tell."""
    length = right.share - left.share
    slopes = length / left.away, length / right.away
    ways = [_way(left, right, middle, slopes, order) for order in _orders(left, right, slopes)]
    sets, there, _ = ways[0] if len(ways) == 1 else min(ways, key=lambda way: way.missed)
    found: list[list[float]] = [[], [], []]
    at = 0
    for own in sets:
        count = len(own[0])
        inside = there[at : at + count]
        at += count
        start, beside, end, behind = (tests(values) for values in own)
        now = tests(inside).like(start)
        end = end.like(now)
        results = start, beside.like(start), end, behind.like(end)
        if now.far and all(result.far for result in results):
            continue
        meets = count == 1 and abs(inside[0].imag) > PAIRED * abs(inside[0])
        if (meets or count > 2) and not final:
            return None
        turning = results[0].turns, now.turns, results[2].turns
        for kind in range(len(now.values)):
            paired = kind == len(now.values) - 1 and count == 2
            if paired and not any(turning):
                continue
            known = _slopes([result.values[kind] for result in results], slopes)
            floors = TESTED_SIGN * results[0].sizes[kind], TESTED_SIGN * results[2].sizes[kind]
            zeros = _zeros(known, now.values[kind], floors, final=final)
            if zeros is None:
                return None
            if paired and zeros and not all(turning):
                if not final:
                    return None
                continue
            found[2 if paired else kind] += [left.share + length * zero for zero in zeros]
    return found


class _Way(NamedTuple):
    """What becomes of values in a part of a step."""

    sets: list[list[list[complex]]]  # values that belong together, at an end and beside it, at both ends
    there: list[complex]  # those in the middle, in the same order
    missed: float  # distance of these from the cubics through the ends


def _way(first: _Place, last: _Place, middle: list[complex], slopes: tuple[float, float], order: Sequence[int]) -> _Way:
    """Return the way of values through the middle of a part to those at its end, which are taken in an order."""
    ends = [first.values, first.beside, [last.values[k] for k in order], [last.beside[k] for k in order]]
    sets = [[[values[k] for k in group] for values in ends] for group in _groups(ends[0], ends[2])]
    expected: list[complex] = []
    for own in sets:
        if len(own[0]) > 2:
            expected += [0.5 * (a + b) for a, b in zip(own[0], own[2], strict=True)]
        elif len(own[0]) == 2:
            totals, products = [(a + b).real for a, b in own], [(a * b).real for a, b in own]
            expected += _roots([_slopes(totals, slopes), _slopes(products, slopes)])
        else:
            expected += _roots([_slopes([value.real for (value,) in own], slopes)])
    there = _matched(expected, middle)
    return _Way(sets, there, sum(abs(a - b) for a, b in zip(there, expected, strict=True)))


def _orders(first: _Place, last: _Place, slopes: tuple[float, float]) -> list[Sequence[int]]:
    """Return the orders of the values at the end of a part: of the nearest ones, and as their slopes tell."""
    nearest = _order(first.values, last.values)
    if len(first.values) < 3:  # they are taken together
        return [nearest]
    from scipy.optimize import linear_sum_assignment

    starts, ends = np.array(first.values), np.array(last.values)
    ahead = starts + (np.array(first.beside) - starts) * slopes[0]
    behind = ends - (np.array(last.beside) - ends) * slopes[1]
    apart = np.abs(ahead[:, None] - ends) + np.abs(starts[:, None] - behind)
    led: list[int] = linear_sum_assignment(apart)[1].tolist()
    same = all(last.values[i] == last.values[k] for i, k in zip(led, nearest, strict=True))
    return [nearest] if same else [nearest, led]


def _slopes(known: Sequence[float], scale: tuple[float, float]) -> tuple[float, float, float, float]:
    """Return value and slope at both ends of a part: of the cubic that a function's values there and beside lie on."""
    f, beside, g, other = known
    first, last = (beside - f) * scale[0], (other - g) * scale[1]
    df, dg = first, last
    for _ in range(2):  # each leaves the share of a part that lies between an end and the place beside
        bend, twist = 3.0 * (g - f) - 2.0 * df - dg, 2.0 * (f - g) + df + dg
        df = first - (bend + twist / scale[0]) / scale[0]
        dg = last - (bend + 3.0 * twist + twist / scale[1]) / scale[1]
    return f, df, g, dg


def _order(values: list[complex], others: list[complex]) -> Sequence[int]:
    """Return the places of the other values in the order of those to which they are nearest."""
    if len(values) < 2:
        return range(len(values))
    if len(values) == 2:
        (a, b), (c, d) = values, others
        return (1, 0) if abs(a - d) + abs(b - c) < abs(a - c) + abs(b - d) else (0, 1)
    from scipy.optimize import linear_sum_assignment

    order: list[int] = linear_sum_assignment(np.abs(np.array(values)[:, None] - np.array(others)))[1].tolist()
    return order


def _zeros(
    known: tuple[float, float, float, float], middle: float, floors: tuple[float, float], *, final: bool
) -> list[float] | None:
    """Return the zeros of a function by its values and slopes at both ends of a part; None where it may have others.

    The cubic through them must lead to the value in the middle but for a small part of its distance from 0.
    """
    f, _, g, _ = known
    if abs(f) <= floors[0] and abs(g) <= floors[1] and abs(middle) <= max(floors):
        return []  # it vanishes all along, as 1 - mu1 mu2 does in a map that keeps areas
    missed = _DOUBT * abs(_cubic(*known, 0.5) - middle)
    if missed > VALUES_FOLLOWED and not final:
        return None
    inner = [(s, _cubic(*known, s)) for s in _turning(*known)]
    row = [(0.0, f)] * (abs(f) > floors[0]) + inner + [(1.0, g)] * (abs(g) > floors[1])
    if final:
        row = [(0.0, f), (1.0, g)]
    elif any(abs(value) < missed for _, value in row) or any(abs(value) < min(floors) for _, value in inner):
        return None
    found = []
    for (s, a), (t, b) in pairwise(row):
        if (a < 0.0) != (b < 0.0):
            if missed > CROSSES_ONCE * abs(b - a) and not final:
                return None
            found.append(_zero(known, s, t))
    flat = (s for s in (*found, *_inflection(*known)) if abs(_cubic(*known, s)) < missed)
    if not final and any(missed > PASSES_ONCE * abs(_slope(*known, s)) for s in flat):
        return None
    return found


def _zero(known: tuple[float, float, float, float], low: float, high: float) -> float:
    """Return the zero of a cubic between two places at which its signs differ."""
    start = _cubic(*known, low) < 0.0
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if (_cubic(*known, middle) < 0.0) == start else (low, middle)
    return 0.5 * (low + high)


def dips(values: list[float | None], back: float, ahead: float, factor: float = TWO_ZEROS) -> bool:
    """Whether a function may vanish twice in a step, from its values before the step, where it begins and at its end.

    It has one sign at both ends. A parabola through the three, its curvature times a factor, gives its least
    value within.
    """
    other, start, end = values
    if other is None or start is None or end is None:
        return False
    change = end - start
    dip = factor * (change / ahead - (start - other) / back) / (ahead + back) * ahead * ahead
    if start < 0.0:
        start, change, dip = -start, -change, -dip
    # start + change s - dip s (1 - s) has its least value within the step
    return (
        0.0 < start > -change
        and abs(change) < dip < math.inf
        and start + 0.5 * change < 0.25 * (dip + change * change / dip)
    )
