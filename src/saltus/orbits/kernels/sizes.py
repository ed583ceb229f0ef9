"""Compiled typical sizes of states, and which states rest at zero: docs/theory/orbits.md, "Discretisation"."""

from __future__ import annotations

import math

import numpy as np

from saltus.system.numba_tools.machine_code import kernel, njit


@njit(cache=True, error_model="numpy")
def resting(sizes, moves, small):
    """Return 1 for states that rest at zero, else 0: sizes below `small` times the largest, moved by no other state.

    sizes: (states,); moves: (n, n), whether the state of a column is in the rate of the state of a row.
    """
    rests, largest = np.zeros(moves.shape[0], np.int64), 0.0
    for e in range(sizes.size):
        largest = max(largest, sizes[e])
    for e in range(sizes.size):
        rests[e] = 1 if sizes[e] < small * largest else 0
    again = True
    while again:
        again = False
        for e in range(sizes.size):
            for by in range(rests.size):
                if rests[e] != 0 and rests[by] == 0 and moves[e, by]:
                    rests[e], again = 0, True
    return rests[: sizes.size]


@njit(cache=True, error_model="numpy")
def resized(lows, highs, limits, least, moves, largest, scale):
    """Take the sizes of states from the extremes of an orbit; none shrinks below a hundredth of what it was.

    Parameters
    ----------
    lows, highs : (states or more,)
        Extremes.
    limits : (float, float)
        Size of a state, over the largest, below which it rests. Least modulus of a state that keeps its sign, over its
        largest, from which it does not come near 0.
    least : (states or more,)
        Sizes below which states are not resolved.
    moves : (n, n)
        Whether the state of a column is in the rate of the state of a row.
    largest, scale : (states,) and (n,)
        Largest sizes so far, and typical ones; written.

    Returns
    -------
    (bool, bool)
        Whether all sizes are finite, without which nothing is written; whether a state comes near 0 and keeps its sign.
    """
    near, count = False, largest.size
    sizes, known = np.empty(count), np.empty(count)
    for e in range(count):
        low, high = abs(lows[e]), abs(highs[e])
        sizes[e] = max(low, high)
        if not (math.isfinite(low) and math.isfinite(high)):
            return False, False
        known[e] = max(max(sizes[e], 0.01 * largest[e]), least[e])
        if lows[e] > 0.0 or highs[e] < 0.0:
            near |= min(low, high) / max(sizes[e], 1e-300) < limits[1]
    top = 1e-300
    for e in range(count):
        top = max(top, known[e])
    # a state at rest has no size of its own, and is given one for good
    rests = resting(known, moves, limits[0])
    for e in range(count):
        if rests[e] != 0:
            known[e] = top
            largest[e] = 100.0 * top
        scale[e] = known[e]
        largest[e] = max(largest[e], sizes[e])
    return True, near


@kernel
def swollen(before, now, count, ratio, faint):
    """Return whether a state's range is many times what it was, or the state as far away; where one is NaN it is not.

    Parameters
    ----------
    before, now : (lows, highs), each (count or more,)
        Extremes of an orbit before and now.
    count : int
        How many states there are.
    ratio, faint : float
        How many times. Size of a state before, over the largest, that it has at least.
    """
    lows, highs, low, high = before[0], before[1], now[0], now[1]
    top, known = 0.0, True
    for e in range(count):
        known = known and not math.isnan(lows[e] + highs[e])
        top = max(top, max(abs(lows[e]), abs(highs[e])))
    least = faint * top if faint * top > 0.0 else 1e-300
    for e in range(count):
        if high[e] - low[e] > ratio * (highs[e] - lows[e]):
            return True
        if known and not math.isnan(low[e] + high[e]):
            reach = max(high[e], highs[e]) - min(low[e], lows[e])
            if reach > ratio * max(max(abs(lows[e]), abs(highs[e])), least):
                return True
    return False
