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
from typing import TYPE_CHECKING

import numpy as np

from saltus.flow.recurring.smoothness import weighted_mean
from saltus.scales import NEXT_ORDER, Verdict

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

__all__ = ["NO_NEARER", "dies", "prime_factors"]

NO_NEARER = 0.5  # deviations after two counts, one over the other, from which on neither is nearer to a period


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
    far, close = _ends(apart(fewer), more, len(steps)), _ends(steps, more, len(steps))
    if far is None or close is None:
        return Verdict.UNCLEAR
    (first, last), (near, nearer) = far, close
    if nearer >= NO_NEARER * last:
        return Verdict.YES
    if first - last <= rounding:
        return Verdict.NO
    if nearer <= rounding:
        return Verdict.UNCLEAR
    if near <= nearer:  # what changes it does not die out
        return Verdict.UNCLEAR
    surplus = 3.0 * math.log(first / last) - math.log(near / nearer)
    rates = [2.0 * step / (more * size) for step, size in ((near, first), (nearer, last))]
    error = NEXT_ORDER * abs(rates[0] - rates[1]) + 2.0 * rounding / nearer
    if abs(surplus) <= error:
        return Verdict.UNCLEAR
    return Verdict.YES if surplus > 0.0 else Verdict.NO


def _ends(apart: NDArray[np.float64], round_: int, count: int) -> tuple[float, float] | None:
    """Return geometric means of distances over whole rounds at both ends of them; None of too few."""
    length = round_ * max(count // 3 // round_, 1)
    start = round_ * ((count - length) // round_)
    if start <= 0:
        return None
    logs = np.log(np.maximum(apart, 1e-300))
    first, last = (float(np.exp(weighted_mean(logs[i : i + length]))) for i in (0, start))
    return first, last


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
