"""Which of two counts of returns is the period, where a motion comes back after both ever more nearly.

Beside a period doubling the deviations after N and after 2 N returns shrink together. Let those after N be A, of normal
form A' = -a A - c A^3, and their decay in a return g. The deviations after 2 N are the changes of A. They decay by
h = 3 g - 2 a: at g where A goes to 0 geometrically, and at 3 g at the doubling, where A does like a power of time.
Where A keeps a size they decay faster. So the sign of 3 g - h decides, from logarithms at the ends of the points alone.

Terms of the next order change 3 g - h by parts of g^2. What is within them, or within the rounding of the points, is
open. docs/decisions/0126-rival-periods-by-their-rates.md has the measurements.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from saltus.flow.recurring.smoothness import weighted_mean
from saltus.scales import NEXT_ORDER, NO_NEARER, Verdict

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

__all__ = ["dies", "prime_factors"]


def dies(apart: Callable[[int], NDArray[np.float64]], fewer: int, more: int, rounding: float) -> Verdict:
    """Whether deviations after `fewer` returns go to 0, of a motion that recurs after `more`, a multiple of them.

    Parameters
    ----------
    apart : callable
        Returns the distances of points from those a count of returns later.
    fewer, more : int
        The counts.
    rounding : float
        Distance that is none.
    """
    steps = apart(more)
    far, close = _windows(apart(fewer), more, len(steps)), _windows(steps, more, len(steps))
    if far is None or close is None:
        return Verdict.UNCLEAR
    sizes, changes = far.means, close.means
    if changes[2] >= NO_NEARER * sizes[2]:
        return Verdict.YES
    if sizes[0] - sizes[2] <= rounding:
        return Verdict.NO
    if not sizes[0] > sizes[2] or changes[0] <= changes[2]:  # what changes them does not die out
        return Verdict.UNCLEAR
    if 2.0 * rounding / changes[2] > NO_NEARER:
        return _by_sizes(far, rounding)
    surplus = 3.0 * math.log(sizes[0] / sizes[2]) - math.log(changes[0] / changes[2])
    rates = [2.0 * changes[i] / (more * sizes[i]) for i in (0, 2)]
    return _sign(surplus, NEXT_ORDER * abs(rates[0] - rates[1]) + 2.0 * rounding / changes[2])


class _Windows(NamedTuple):
    """Geometric means of distances over windows at the beginning, in the middle and at the end of them."""

    means: list[float]
    length: int  # of a window
    between: int  # from one to the next


def _by_sizes(far: _Windows, rounding: float) -> Verdict:
    """Return what `dies` does where the changes from return to return are rounding: by those from window to window.

    1 / A^2 grows geometrically, by exp(3 g - h) in a return. A mean over a window differs from the value in its middle.
    """
    first, middle, last = far.means
    steps = first - middle, middle - last
    if steps[1] <= rounding:
        return Verdict.NO if steps[0] * (last / middle) ** 3 > 2.0 * rounding else Verdict.UNCLEAR
    if steps[0] <= rounding:
        return Verdict.UNCLEAR
    surplus = math.log((last**-2 - middle**-2) / (middle**-2 - first**-2))
    rates = math.log(first / middle) / far.between, math.log(middle / last) / far.between
    order = NEXT_ORDER + 2.0 * max(rates) * far.length**2 / 36.0  # weights spread over a sixth of a window
    return _sign(surplus, order * 2.0 * abs(rates[0] - rates[1]) + rounding / steps[0] + rounding / steps[1])


def _sign(value: float, error: float) -> Verdict:
    """Return whether a value is above 0 by more than its error."""
    if abs(value) <= error:
        return Verdict.UNCLEAR
    return Verdict.YES if value > 0.0 else Verdict.NO


def _windows(apart: NDArray[np.float64], round_: int, count: int) -> _Windows | None:
    """Return means of the first `count` distances over windows of whole rounds; None of too few."""
    length = round_ * max(count // 3 // round_, 1)
    between = round_ * ((count - length) // (2 * round_))
    if between <= 0:
        return None
    logs = np.log(np.maximum(apart, 1e-300))
    means = [float(np.exp(weighted_mean(logs[i : i + length]))) for i in (0, between, 2 * between)]
    return _Windows(means, length, between)


def prime_factors(count: int) -> list[int]:
    """Return the prime factors of a count, the least first, each once."""
    found, rest, factor = [], count, 2
    while rest > 1:
        if factor * factor > rest:
            factor = rest
        if rest % factor == 0:
            found.append(factor)
            while rest % factor == 0:
                rest //= factor
        factor += 1
    return found
