"""What is known of a point on a curve of solutions of algebraic equations: its values, judged by their own sizes.

docs/theory/equilibria.md, "Values of different sizes", says why slow values have a size of their own.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.core.within_step import searched
from saltus.equilibria.spectrum import bands
from saltus.scales import SMALLEST

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.core.value_tests import Tested

    Sized = tuple[NDArray[np.complex128], NDArray[np.float64]]  # values and their sizes

__all__ = ["PointData", "has_pair", "searched_by_size"]


@dataclass(frozen=True)
class PointData:
    """Data of a point."""

    values: NDArray[np.complex128]  # eigenvalues
    unstable: int  # number of unstable ones
    sizes: NDArray[np.float64]  # the size of each
    reasons: tuple[str, ...] = ()  # why the solution is virtual
    behind: tuple[float, Sized] | None = None  # arclength from the point before, and its values

    @property
    def stable(self) -> bool:
        """Whether all eigenvalues have negative real parts."""
        return self.unstable == 0 and bool(np.all(self.values.real < 0.0))


def has_pair(values: NDArray[np.complex128]) -> bool:
    """Return whether the two eigenvalues whose sum is least, over their moduli, are a complex pair."""
    best, pair = math.inf, False
    for i in range(values.size):
        for j in range(i + 1, values.size):
            share = abs(values[i] + values[j]) / max(abs(values[i]) + abs(values[j]), 1e-300)
            if share < best:
                best, pair = share, abs(values[i].imag) > 0.0 and abs(values[j].imag) > 0.0
    return pair


def searched_by_size(
    sized: Callable[[float], Sized],
    rows: list[Sized],
    lengths: tuple[float, ...],
    tests: Callable[[list[complex]], Tested],
    unit: float,
    *,
    touches: bool = False,
) -> bool | None:
    """Return `searched` of values of different sizes: set by set, as those of one size never meet those of another.

    Parameters
    ----------
    sized : callable
        Values and their sizes at a fraction of the step.
    rows, lengths, tests, touches
        See `searched`; the rows come with their sizes.
    unit : float
        Unit of the largest values; that of others is their size where the step begins.
    """
    sets = [bands(*row) for row in rows]
    counts = [own.size for own in sets[0]]
    if any([own.size for own in row] != counts for row in sets):
        return None
    sizes = np.unique(rows[-2][1])[::-1]

    def largest_of(at: int) -> float:
        return max((float(np.abs(row[at]).max()) for row in sets if row[at].size), default=0.0)

    # a quotient of what is far from critical stays below the largest double
    units = [max(size, SMALLEST, SMALLEST * largest_of(i)) for i, size in enumerate([unit, *sizes[1:].tolist()])]

    def spectra(at: int, shares: NDArray[np.float64]) -> NDArray[np.complex128]:
        found = np.full((shares.size, counts[at]), complex(math.nan))
        for row, share in zip(found, shares.tolist(), strict=True):
            own = bands(*sized(share))
            if [values.size for values in own] == counts:
                row[:] = own[at] / units[at]
        return found

    def of_set(at: int) -> bool | None:
        own = [row[at] / units[at] for row in sets]
        return searched(lambda shares: spectra(at, shares), own, lengths, tests, touches=touches)

    told = [of_set(at) for at in range(len(counts))]
    return True if True in told else None if None in told else False
