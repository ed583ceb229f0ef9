"""Products of many factors, as test functions are, by sign and size."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


__all__ = ["combined", "pairs"]


@lru_cache(maxsize=64)
def pairs(n: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the places of all pairs of n values."""
    first, second = np.triu_indices(n, 1)
    return first, second


def combined(factors: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return the sign of products of factors, times (sum of 1/abs(factor)^2)^(-1/2): it vanishes as a factor does.

    A product of many factors below 1 would fade with their number. Factors that are complex come in pairs.

    Parameters
    ----------
    factors : ndarray of complex, shape (..., factors)
        Factors of each product.

    Examples
    --------
    >>> import numpy as np
    >>> float(combined(np.array([-0.1 + 0j] * 31))).__round__(6)
    -0.01796
    """
    from saltus.algebraic.kernels.products import combine

    found = np.empty(factors.shape[:-1])
    rows = np.ascontiguousarray(factors, dtype=np.complex128).reshape(found.size, factors.shape[-1])
    combine(rows, found.reshape(-1))
    return found
