"""Eigenvalues or multipliers that become critical within one step of a branch, and how often: none is passed over.

Values that meet are taken together, since symmetric functions of them stay smooth there. docs/theory/equilibria.md,
"Values within a step", explains the search.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Spectra = Callable[[NDArray[np.float64]], NDArray[np.complex128]]
    Tests = Callable[[list[complex]], tuple[list[float], float, bool]]

__all__ = ["border_tests", "circle_tests", "several_critical"]

_ASIDE = 1e-4  # fraction of a step by which values are differentiated
_DEEPEST = 10  # most times that a part of a step is halved
_MOST = 200  # parts looked at, from which on none is halved
_DOUBT = 2.0  # factor on what a cubic misses in the middle of a part
_BENT = 0.25  # the same over the change in the part, up to which a function that changes its sign does so once
_ROUNDED = 1e-9  # function over its size, up to which its sign is rounding
_BISECTIONS = 30  # of the search for a zero
_ALIKE = 1e-5  # distance of two zeros, in steps, up to which they are one of equal values
_PAIRED = 1e-12  # imaginary part over the size, from which on a value is one of a complex pair


class _Place(NamedTuple):
    """The values at a fraction of a step, and those beside it in the same order."""

    share: float
    values: NDArray[np.complex128]
    beside: tuple[NDArray[np.complex128], NDArray[np.complex128]]


def circle_tests(values: list[complex]) -> tuple[list[float], float, bool]:
    """Return functions of multipliers that vanish at 1, at -1, and for a pair at the unit circle; see `_zeros`."""
    one, other, size = 1.0 + 0.0j, 1.0 + 0.0j, 1.0
    for value in values:
        one, other, size = one * (1.0 - value), other * (1.0 + value), size * (1.0 + abs(value))
    found = [one.real, other.real]
    if len(values) == 2:
        found.append(1.0 - (values[0] * values[1]).real)
    return found, size, _turns(values)


def border_tests(values: list[complex]) -> tuple[list[float], float, bool]:
    """Return functions of eigenvalues that vanish at 0, and for a pair at the imaginary axis; see `_zeros`."""
    product, size = 1.0 + 0.0j, 1.0
    for value in values:
        product, size = product * value, size * (1e-3 + abs(value))
    found = [product.real]
    if len(values) == 2:
        found.append((values[0] + values[1]).real)
        size = min(size, 1e-3 + abs(values[0]))
    return found, size, _turns(values)


def _turns(values: list[complex]) -> bool:
    return len(values) == 2 and abs(values[0].imag) > _PAIRED * abs(values[0])


def several_critical(
    spectra: Spectra, ends: tuple[NDArray[np.complex128], NDArray[np.complex128]], tests: Tests
) -> bool:
    """Return whether values become critical at more than one place of a step in the same way.

    Parameters
    ----------
    spectra : callable
        Values at fractions of the step, (places,) -> (places, values), in any order.
    ends : pair of ndarray, shape (values,)
        The values at the step's ends.
    tests : callable
        `circle_tests` or `border_tests`.
    """
    around = spectra(np.array([-_ASIDE, _ASIDE, 0.5, 1.0 - _ASIDE, 1.0 + _ASIDE]))
    if not (np.all(np.isfinite(around)) and all(np.all(np.isfinite(end)) for end in ends)):
        return False
    first, last = _place(0.0, ends[0], around[:2]), _place(1.0, ends[1], around[3:])
    zeros: list[list[float]] = [[], [], []]
    parts = [(first, last, around[2], 0)]
    looked = 0
    while parts:
        left, right, middle, depth = parts.pop()
        looked += 1
        found = _zeros_of_part(left, right, middle, tests, final=depth == _DEEPEST or looked >= _MOST)
        if found is None:
            quarter = 0.25 * (right.share - left.share)
            at = left.share + 2.0 * quarter
            more = spectra(np.array([at - quarter, at - _ASIDE, at + _ASIDE, at + quarter]))
            if not np.all(np.isfinite(more)):
                return False
            centre = _place(at, middle, more[1:3])
            parts += [(left, centre, more[0], depth + 1), (centre, right, more[3], depth + 1)]
            continue
        for known, new in zip(zeros, found, strict=False):
            known += new
            if known and max(known) - min(known) > _ALIKE:
                return True
    return False


def _place(share: float, values: NDArray[np.complex128], beside: NDArray[np.complex128]) -> _Place:
    return _Place(share, values, (_matched(values, beside[0]), _matched(values, beside[1])))


def _matched(values: NDArray[np.complex128], others: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return the other values, each at the place of that one to which it is nearest."""
    return np.asarray(others[_order(values, others)])


def _groups(first: NDArray[np.complex128], last: NDArray[np.complex128]) -> list[list[int]]:
    """Return the places of values that belong together: complex ones at either end with their conjugates."""
    size = first.size
    if size < 3:
        return [list(range(size))]
    group = list(range(size))
    for values in (first, last):
        known: list[complex] = values.tolist()
        open_pairs = [i for i in range(size) if known[i].imag > _PAIRED * abs(known[i])]
        below = [i for i in range(size) if known[i].imag < -_PAIRED * abs(known[i])]
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
    root = np.emath.sqrt(half * half - product)
    return [complex(half + root), complex(half - root)]


def _zeros_of_part(
    left: _Place, right: _Place, middle: NDArray[np.complex128], tests: Tests, *, final: bool
) -> list[list[float]] | None:
    """Return the zeros of each function in a part of a step, in steps; None where halves must tell."""
    order = _order(left.values, right.values)
    length = right.share - left.share
    scale = length / (2.0 * _ASIDE)
    ends = [left.values, *left.beside, right.values[order], *(values[order] for values in right.beside)]
    groups = _groups(ends[0], ends[3])
    sets = [[values[group].tolist() for values in ends] for group in groups]
    expected: list[complex] = []
    for own in sets:
        if len(own[0]) > 2:
            expected += [0.5 * (a + b) for a, b in zip(own[0], own[3], strict=True)]
            continue
        rows = [[sum(v).real] if len(v) == 1 else [sum(v).real, (v[0] * v[1]).real] for v in own]
        expected += _roots([(f, (h - g) * scale, k, (m - n) * scale) for f, g, h, k, n, m in zip(*rows, strict=True)])
    there: list[complex] = _matched(np.array(expected), middle).tolist()
    found: list[list[float]] = [[], [], []]
    at = 0
    for own in sets:
        count = len(own[0])
        inside = there[at : at + count]
        at += count
        meets = count == 1 and abs(inside[0].imag) > _PAIRED * abs(inside[0])
        if (meets or count > 2) and not final:
            return None
        results, now = [tests(values) for values in own], tests(inside)
        turning = results[0][2], now[2], results[3][2]
        for kind in range(len(now[0])):
            paired = kind == len(now[0]) - 1 and count == 2
            if paired and not any(turning):
                continue
            f, g, h, k, n, m = (result[0][kind] for result in results)
            floors = _ROUNDED * results[0][1], _ROUNDED * results[3][1]
            zeros = _zeros((f, (h - g) * scale, k, (m - n) * scale), now[0][kind], floors, final=final)
            if zeros is None:
                return None
            if paired and zeros and not all(turning):
                if not final:
                    return None
                continue
            found[2 if paired else kind] += [left.share + length * zero for zero in zeros]
    return found


def _order(values: NDArray[np.complex128], others: NDArray[np.complex128]) -> NDArray[np.intp]:
    """Return the places of the other values in the order of those to which they are nearest."""
    if values.size < 3:
        return np.arange(values.size)
    from scipy.optimize import linear_sum_assignment

    return np.asarray(linear_sum_assignment(np.abs(values[:, None] - others))[1])


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
    inner = [(s, _cubic(*known, s)) for s in _turning(*known)]
    row = [(0.0, f)] * (abs(f) > floors[0]) + inner + [(1.0, g)] * (abs(g) > floors[1])
    if final:
        row = [(0.0, f), (1.0, g)]
    elif any(abs(value) < missed for _, value in row) or any(abs(value) < min(floors) for _, value in inner):
        return None
    found = []
    for (s, a), (t, b) in pairwise(row):
        if (a < 0.0) != (b < 0.0):
            if missed > _BENT * abs(b - a) and not final:
                return None
            found.append(_zero(known, s, t))
    return found


def _zero(known: tuple[float, float, float, float], low: float, high: float) -> float:
    """Return the zero of a cubic between two places at which its signs differ."""
    start = _cubic(*known, low) < 0.0
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if (_cubic(*known, middle) < 0.0) == start else (low, middle)
    return 0.5 * (low + high)
