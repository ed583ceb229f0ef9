"""Eigenvalues or multipliers that cross their border and come back within one step of a branch.

docs/theory/equilibria.md, "Test functions", explains the search.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["crosses_back", "doubtful", "may_return"]

_PLACES = (0.25, 0.75)  # of a step, at which its values are looked at where its middle leaves a doubt
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
    growth: Callable[[float], NDArray[np.float64]], before: NDArray[np.float64], after: NDArray[np.float64]
) -> bool:
    """Return whether a value changes its sign more than once within a step.

    Parameters
    ----------
    growth : callable
        Growth of all values at a fraction of the step, in the order of size.
    before, after : ndarray, shape (values,)
        The same at the step's ends.
    """
    kept = _resolved(before, after)
    before, middle, after = before[kept], growth(0.5)[kept], after[kept]
    if np.all(_is_plain(before, after, np.abs(middle - 0.5 * (before + after)))):
        return False
    known, wanted = {0.0: before, 0.5: middle, 1.0: after}, set(_PLACES)
    for _ in range(_LOOKS):
        known |= {share: growth(share)[kept] for share in wanted}
        places = np.array(sorted(known))
        table = np.array([known[share] for share in places])
        if any(_turns(column) > 1 for column in table.T):
            return True
        wanted = {share for column in table.T for share in _dips(places, column)} | _near(places, table)
        if not wanted:
            return False
    return False


def _is_plain(before: NDArray[np.float64], after: NDArray[np.float64], bent: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return for each step whether all values bend so little within it that none changes its sign twice.

    A parabola is monotonic if it leaves its chord, in the middle, by at most a quarter of what it changes.
    """
    margin = np.maximum(np.minimum(np.abs(before), np.abs(after)), np.abs(after - before))
    most = np.maximum(_BENT * bent, _BENT_OTHERS * bent.max(axis=-1, keepdims=True, initial=0.0))
    return np.asarray(np.all((margin > most) | ~_resolved(before, after), axis=-1))


def doubtful(growth: NDArray[np.float64], lengths: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the steps in which a value may change its sign twice, as far as points beside them tell.

    Parameters
    ----------
    growth : ndarray, shape (steps + 1, values)
        Growth of all values at the steps' ends, in the order of size.
    lengths : ndarray, shape (steps,)
        Arclengths of the steps.
    """
    before, after = growth[:-1], growth[1:]
    doubt = may_return(before, after)
    if len(lengths) > 1:
        slopes = (after - before) / lengths[:, None]
        bends = np.abs(np.diff(slopes, axis=0)) / (lengths[1:] + lengths[:-1])[:, None]
        bent = np.maximum(np.vstack([bends[:1], bends]), np.vstack([bends, bends[-1:]])) * lengths[:, None] ** 2 / 4.0
        doubt &= ~_is_plain(before, after, _BESIDE * bent)
    return np.flatnonzero(doubt)


def _turns(values: NDArray[np.float64]) -> int:
    """Return how often the sign changes."""
    signs = np.sign(values[np.abs(values) > _ROUNDED])
    return int(np.sum(signs[1:] != signs[:-1]))


def _near(places: NDArray[np.float64], table: NDArray[np.float64]) -> set[float]:
    """Return the middles between places of one sign where a value comes to 0 if it changes as fast as the fastest.

    Where real values become a pair, the order of size has corners, which no parabola shows.
    """
    gaps, sizes = np.diff(places), np.abs(table)
    fastest = float((np.abs(np.diff(table, axis=0)) / gaps[:, None]).max(initial=0.0))
    same = np.sign(table[1:]) == np.sign(table[:-1])
    reached = same & (sizes[1:] + sizes[:-1] < fastest * gaps[:, None]) & (gaps > 2.0 * _APART)[:, None]
    return set((0.5 * (places[1:] + places[:-1]))[np.any(reached, axis=1)].tolist())


def _dips(places: NDArray[np.float64], values: NDArray[np.float64]) -> list[float]:
    """Return where a function may come to 0 between places of one sign, if it may come much nearer than it is there."""
    found = []
    for k in range(1, places.size - 1):
        (a, b, c), (fa, fb, fc) = places[k - 1 : k + 2], np.sign(values[k]) * values[k - 1 : k + 2]
        left, right = (fb - fa) / (b - a), (fc - fb) / (c - b)
        bend = (right - left) / (c - a)
        if min(fa, fc) <= 0.0 or bend <= 0.0:
            continue
        s = float(0.5 * (a + b - left / bend))
        deepest = fa + left * (s - a) + bend * (s - a) * (s - b)
        if a < s < c and deepest < _DEEPER * min(fa, fb, fc) and float(np.abs(places - s).min()) > _APART:
            found.append(s)
    return found
