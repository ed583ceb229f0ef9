"""Eigenvalues or multipliers that cross their border and come back within one step of a branch.

docs/theory/equilibria.md, "Test functions", explains the search.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Growth = Callable[[NDArray[np.float64]], NDArray[np.float64]]
    GrowthOfMany = Callable[[NDArray[np.intp], NDArray[np.float64]], NDArray[np.float64]]

__all__ = ["crosses_back", "first_return", "may_return"]

_MIDDLE = np.array([0.5])
_PLACES = np.array([0.25, 0.75])  # of a step, at which its values are looked at where its middle leaves a doubt
_BENT = 4.0  # margin over what a value leaves its chord by in the middle, from which on there is none
_BENT_OTHERS = 2.0  # the same over what any value leaves its chord by
_OWN = 2.0  # reach of a value within a step, over its change in it
_OTHERS = 0.5  # the same, over the largest change of all values
_ROUNDED = 1e-7  # growth up to which its sign is rounding
_BESIDE = 2.0  # factor on how values bend beside a step
_LOOKS = 6  # most times that places are added where a value comes nearest to 0
_DEEPER = 0.5  # expected least value there, over the least one known, up to which it is worth a look
_APART = 1e-3  # of a step, between two places


def may_return(before: NDArray[np.float64], after: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return for each step whether a value changes its sign, or is within reach of 0 with one sign at both ends.

    before, after : ndarray, shape (..., values)
        Growth of all values at the steps' ends, in the order of size.
    """
    moved = np.abs(after - before)
    reach = np.maximum(_OWN * moved, _OTHERS * moved.max(axis=-1, keepdims=True, initial=0.0))
    near = (np.sign(before) != np.sign(after)) | (np.minimum(np.abs(before), np.abs(after)) < reach)
    return np.asarray(np.any(near & _resolved(before, after), axis=-1))


def _resolved(before: NDArray[np.float64], after: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which values have a sign at both ends of a step."""
    return np.asarray(np.minimum(np.abs(before), np.abs(after)) > _ROUNDED)


def crosses_back(
    growth: Growth,
    before: NDArray[np.float64],
    after: NDArray[np.float64],
) -> bool:
    """Return whether a value changes its sign more than once within a step.

    Parameters
    ----------
    growth : callable
        Growth of all values at fractions of the step, (places,) -> (places, values), in the order of size.
    before, after : ndarray, shape (values,)
        The same at the step's ends.
    """
    middle = growth(_MIDDLE)[0]
    return not bool(_is_plain(before, middle, after)) and _turns_twice(growth, before, middle, after)


def first_return(
    growth: GrowthOfMany,
    table: NDArray[np.float64],
    lengths: NDArray[np.float64],
) -> int:
    """Return the first of many steps within which a value changes its sign more than once, or their number.

    Parameters
    ----------
    growth : callable
        Growth of all values in steps at fractions of them, (places,), (places,) -> (places, values), in the order of
        size.
    table : ndarray, shape (steps + 1, values)
        The same at the steps' ends.
    lengths : ndarray, shape (steps,)
        Arclengths of the steps.
    """
    steps = _doubtful(table, lengths)
    if steps.size:
        middles = growth(steps, np.full(steps.size, _MIDDLE[0]))
        for k in np.flatnonzero(~_is_plain(table[steps], middles, table[steps + 1])).tolist():
            i = int(steps[k])
            if _turns_twice(partial(_within, growth, i), table[i], middles[k], table[i + 1]):
                return i
    return len(lengths)


def _within(growth: GrowthOfMany, step: int, shares: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the growth of all values at fractions of one of many steps."""
    return growth(np.full(shares.size, step), shares)


def _turns_twice(
    growth: Growth,
    before: NDArray[np.float64],
    middle: NDArray[np.float64],
    after: NDArray[np.float64],
) -> bool:
    """Return whether a value changes its sign more than once, by more and more places within the step."""
    kept = _resolved(before, after)
    places, table = np.array([0.0, 0.5, 1.0]), np.array([before, middle, after])[:, kept]
    wanted = _PLACES
    for _ in range(_LOOKS):
        places = np.concatenate([places, wanted])
        table = np.vstack([table, growth(wanted)[:, kept]])
        order = np.argsort(places)
        places, table = places[order], table[order]
        if any(_turns(column) > 1 for column in table.T):
            return True
        wanted = np.unique(np.concatenate([_dips(places, table), _near(places, table)]))
        if not wanted.size:
            return False
    return False


def _is_plain(
    before: NDArray[np.float64], middle: NDArray[np.float64], after: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Return for each step whether all values bend so little within it that none changes its sign twice."""
    return _is_straight(before, after, np.abs(middle - 0.5 * (before + after)))


def _is_straight(
    before: NDArray[np.float64], after: NDArray[np.float64], bent: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Return `_is_plain` by how far values leave their chords in the middle.

    A parabola is monotonic if it leaves its chord, in the middle, by at most a quarter of what it changes.
    """
    margin = np.maximum(np.minimum(np.abs(before), np.abs(after)), np.abs(after - before))
    beside = _meeting(np.minimum(before, after) - bent, np.maximum(before, after) + bent)
    most = np.maximum(_BENT * bent, _BENT_OTHERS * (beside * bent[..., None, :]).max(axis=-1, initial=0.0))
    return np.asarray(np.all((margin > most) | ~_resolved(before, after), axis=-1))


def _doubtful(growth: NDArray[np.float64], lengths: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the steps in which a value may change its sign twice, as far as points beside them tell."""
    before, after = growth[:-1], growth[1:]
    doubt = may_return(before, after)
    if len(lengths) > 1:
        slopes = (after - before) / lengths[:, None]
        bends = np.abs(np.diff(slopes, axis=0)) / (lengths[1:] + lengths[:-1])[:, None]
        bent = np.maximum(np.vstack([bends[:1], bends]), np.vstack([bends, bends[-1:]])) * lengths[:, None] ** 2 / 4.0
        doubt &= ~_is_straight(before, after, _BESIDE * bent)
    return np.flatnonzero(doubt)


def _meeting(low: NDArray[np.float64], high: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which values may meet in a step, (..., values, values): their ranges, thrice as wide, overlap.

    Where two real values meet and become a pair, or pass each other, the order of size has a corner.
    """
    wide = high - low
    below = (low - wide)[..., :, None] <= (high + wide)[..., None, :]
    return np.asarray(below & np.swapaxes(below, -1, -2))


def _turns(values: NDArray[np.float64]) -> int:
    """Return how often the sign changes."""
    signs = np.sign(values[np.abs(values) > _ROUNDED])
    return int(np.sum(signs[1:] != signs[:-1]))


def _near(places: NDArray[np.float64], table: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the middles between places of one sign where a value comes to 0 if it changes as fast as others near it.

    Where real values become a pair, the order of size has corners, which no parabola shows.
    """
    gaps, sizes = np.diff(places), np.abs(table)
    speeds = (np.abs(np.diff(table, axis=0)) / gaps[:, None]).max(axis=0)
    fastest = (_meeting(table.min(axis=0), table.max(axis=0)) * speeds).max(axis=1, initial=0.0)
    same = np.sign(table[1:]) == np.sign(table[:-1])
    reached = same & (sizes[1:] + sizes[:-1] < fastest * gaps[:, None]) & (gaps > 2.0 * _APART)[:, None]
    return np.asarray((0.5 * (places[1:] + places[:-1]))[np.any(reached, axis=1)])


def _dips(places: NDArray[np.float64], table: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return where a value may come to 0 between places of one sign, if it may come much nearer than it is there."""
    a, b, c = (places[k : k + places.size - 2, None] for k in range(3))
    fa, fb, fc = (np.sign(table[1:-1]) * table[k : k + places.size - 2] for k in range(3))
    left, right = (fb - fa) / (b - a), (fc - fb) / (c - b)
    bend = (right - left) / (c - a)
    open_up = bend > 0.0
    s = 0.5 * (a + b - left / np.where(open_up, bend, 1.0))
    deepest = fa + left * (s - a) + bend * (s - a) * (s - b)
    ends = np.minimum(fa, fc)
    found = s[open_up & (ends > 0.0) & (a < s) & (s < c) & (deepest < _DEEPER * np.minimum(ends, fb))]
    return np.asarray(found[np.abs(places[:, None] - found).min(axis=0) > _APART])
