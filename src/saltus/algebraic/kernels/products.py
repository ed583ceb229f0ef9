"""Products of factors whose size does not fade with their number."""

from __future__ import annotations

import math

import numpy as np

from saltus.system.numba_tools.machine_code import njit


@njit(cache=True, error_model="numpy")
def combine(factors, found):
    """Write `saltus.algebraic.products.combined` of each row of factors, (rows, factors), complex, to found, (rows,)."""
    for i in range(found.size):
        least, total, product = math.inf, 0.0, complex(1.0)
        for factor in factors[i]:
            least = min(least, abs(factor))
        for factor in factors[i]:
            size = abs(factor)
            total += 1.0 if size == 0.0 else (least / size) ** 2
            product *= 0.0 if size == 0.0 else factor / size
        found[i] = least / math.sqrt(total) * np.sign(product.real) if math.isfinite(total) and total > 0.0 else 1.0
