"""Eigenvalues of an equilibrium: order, stability, test functions. docs/theory/equilibria.md, "Test functions"."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["FAINT", "NEUTRAL", "eigenvalues", "kind_of", "pair_product", "unstable_count"]

NEUTRAL = 1e-9  # real part of an eigenvalue, over the largest modulus, up to which it is rounding of 0
FAINT = 1e-13  # product of the sums of eigenvalues, over that of their moduli, up to which it is rounding


def eigenvalues(A: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return the eigenvalues of a matrix, the largest real part first, of a pair the positive imaginary part first."""
    values = np.linalg.eigvals(A).astype(np.complex128)
    return np.asarray(values[np.lexsort((-values.imag, -values.real))])


def unstable_count(values: NDArray[np.complex128]) -> int:
    """Return the number of eigenvalues with positive real part, those at 0 but for rounding left out."""
    return int(np.sum(values.real > NEUTRAL * float(np.abs(values).max(initial=0.0))))


def kind_of(values: NDArray[np.complex128]) -> str:
    """Return the kind of an equilibrium in words, as ``stable focus`` or ``saddle (1 unstable)``."""
    top = float(np.abs(values).max(initial=0.0))
    if np.any(np.abs(values.real) <= NEUTRAL * top):
        return "not hyperbolic"
    unstable = unstable_count(values)
    if 0 < unstable < values.size:
        return f"saddle ({unstable} unstable)"
    leading = values[np.argmin(np.abs(values.real))]
    shape = "focus" if abs(leading.imag) > NEUTRAL * top else "node"
    return f"{'stable' if unstable == 0 else 'unstable'} {shape}"


def pair_product(values: NDArray[np.complex128], without: tuple[int, ...] = ()) -> float:
    """Return the product of all sums of two eigenvalues, over that of the sums of their moduli.

    It is the determinant of the bialternate product 2 A (.) I, over its size. It vanishes where a complex pair is
    imaginary, or where two real eigenvalues differ in sign alone.

    Parameters
    ----------
    values : ndarray of complex, shape (n,)
        Eigenvalues.
    without : tuple of int
        Those of them that are left out, or for two of them their own sum alone.
    """
    product = complex(1.0)
    for i in range(values.size):
        for j in range(i + 1, values.size):
            if (i in without or j in without) and len(without) == 1:
                continue
            if (i, j) == without:
                continue
            size = abs(values[i]) + abs(values[j])
            product *= (values[i] + values[j]) / size if size > 0.0 else 0.0
    return product.real
