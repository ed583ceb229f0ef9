"""How far exponents may be from their limits: terms that are bounded, and rates that still drift.

The logarithm of a growth is ``S(t) = a t + b(t)`` with the exponent a. Where b is bounded, ``S/t`` errs by no more than
the range of b over t. Where a motion settles like a power of time, b grows like a logarithm, and the rate like
``a + c/(t + s)``. Three means of a rate give the limit a of such a drift. A direction that grows like a power of time
has the exponent 0: the error is no less than the exponent where the logarithm of time fits no worse than time itself.

Where a motion is intermittent, the times in which a length grows by a factor have a tail like ``t**-h``. Their mean has
no limit for h up to 1: growth is slower than any exponential, and the exponent is 0. Hill's estimate of h has the
relative error ``1/sqrt(k)`` from the k longest times. Where h cannot be told from 1, the interval holds 0.

B. M. Hill, A simple general approach to inference about the tail of a distribution, Ann. Statist. 3 (1975) 1163-1174.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.scales import BY_CHANCE, EPS

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["unconverged"]

_BATCHES = 18  # batches by which a drift is told from chance: six in each third


def unconverged(
    times: NDArray[np.float64], logs: NDArray[np.float64], discarded: float = 0.0, rounding: float = 0.0
) -> NDArray[np.float64]:
    """Return how far exponents may be from their limits, shape (exponent,): by what is bounded, or drifts.

    It is infinite where a rate drifts to no limit that could be told, and no less than the rounding.

    Parameters
    ----------
    times : ndarray, shape (row,)
        Ends of the stretches, from the start of the first.
    logs : ndarray, shape (row, exponent)
        Logarithms of the growth in each.
    discarded : float, optional
        Time before the first, in which directions turned as well.
    rounding : float, optional
        Difference of rates that is none.
    """
    grid = np.append(0.0, times)
    finite = np.isfinite(logs).all(axis=0)
    found = np.where(finite, rounding, 0.0)
    # a sum that is added in another order may be greater by its rounding
    rates = np.abs(logs.sum(axis=0) / times[-1]) * (1.0 + EPS * times.size)
    powers = np.log1p(grid / (discarded or times[0]))
    for k in np.flatnonzero(finite):
        sums = np.append(0.0, np.cumsum(logs[:, k]))
        rate = sums[-1] / grid[-1]
        bounded = float(np.ptp(sums - rate * grid))
        found[k] = max(found[k], bounded / grid[-1])
        if float(np.ptp(sums - powers * (sums[-1] / powers[-1]))) <= bounded:  # a power of time fits no worse
            found[k] = max(found[k], rates[k])
        if sums[-1] > 0.0 and not _grows_steadily(grid, sums):
            found[k] = max(found[k], rates[k])
        if times.size >= _BATCHES and _drifts(grid, sums, rounding):
            found[k] = max(found[k], _way(grid, sums, rate))
    # directions that have not changed by a factor e have not turned to their own either: they share what is the sum's
    mixed = finite & (rates * (discarded + times[-1]) < 1.0)
    if mixed.sum() > 1:
        found[mixed] = np.maximum(found[mixed], rates[mixed].max())
    return found


def _grows_steadily(grid: NDArray[np.float64], sums: NDArray[np.float64]) -> bool:
    """Return whether the times in which a length grows by a factor have a mean: the index of their tail is above 1."""
    passed = _passages(grid, sums)
    longest = np.sort(passed)[::-1]
    count = math.isqrt(longest.size)
    if count < 2:
        return False
    spread = float(np.log(longest[:count] / longest[count]).mean())
    return 1.0 - BY_CHANCE / math.sqrt(count) > spread  # index h = 1/spread


def _passages(grid: NDArray[np.float64], sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the times between records of a logarithm that are 1 apart, or what it grows in a row."""
    highest = np.maximum.accumulate(sums)
    levels = max(1.0, highest[-1] / (grid.size - 1)) * np.arange(highest[-1] + 1.0)
    levels = levels[levels <= highest[-1]]
    after = np.clip(np.searchsorted(highest, levels), 1, grid.size - 1)
    low, high = highest[after - 1], highest[after]
    part = (levels - low) / np.where(high > low, high - low, 1.0)
    return np.diff(grid[after - 1] + part * (grid[after] - grid[after - 1]))


def _rates(grid: NDArray[np.float64], sums: NDArray[np.float64], first: float, count: int) -> NDArray[np.float64]:
    """Return the mean rates in equal parts of the time from a share of it on."""
    edges = grid[-1] * np.linspace(first, 1.0, count + 1)
    return np.asarray(np.diff(np.interp(edges, grid, sums)) / np.diff(edges))


def _drifts(grid: NDArray[np.float64], sums: NDArray[np.float64], rounding: float) -> bool:
    """Return whether the rate of the last third differs from that of the first by more than chance and rounding."""
    from scipy.special import stdtrit

    rates, part = _rates(grid, sums, 0.0, _BATCHES), _BATCHES // 3
    # differences of neighbours know no drift; of six each, the means differ by a third of them
    chance = float(np.sqrt(0.5 * np.mean(np.diff(rates) ** 2)) * math.sqrt(2.0 / part))
    apart = abs(float(rates[-part:].mean() - rates[:part].mean()))
    return apart > max(BY_CHANCE * float(stdtrit(_BATCHES - 1, 0.975)) * chance, rounding)


def _way(grid: NDArray[np.float64], sums: NDArray[np.float64], rate: float) -> float:
    """Return the distance of a rate from the limit to which it drifts, with the error of that limit."""
    coarse, fine = (_limit(*_rates(grid, sums, first, 3)) for first in (0.0, 0.5))
    if not math.isfinite(coarse + fine):
        return math.inf
    return abs(rate - fine) + abs(coarse - fine)


def _limit(first: float, second: float, third: float) -> float:
    """Return the limit a of ``a + c/(t + s)`` through three equidistant values that slow down; else inf."""
    before, after = second - first, third - second
    if not 0.0 < after * before < before * before:
        return math.inf
    return (2.0 * first * third - second * (first + third)) / (after - before)
