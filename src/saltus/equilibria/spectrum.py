"""Eigenvalues of an equilibrium: order, stability, test functions. docs/theory/equilibria.md, "Test functions"."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus.algebraic.products import combined, pairs

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = [
    "FAINT",
    "NEUTRAL",
    "eigenvalues",
    "kind_of",
    "multiplicity",
    "pair_product",
    "unstable_count",
]

NEUTRAL = 1e-9  # real part of an eigenvalue, over the largest modulus, up to which it is rounding of 0
_CRITICAL = 1e-6  # distance from the imaginary axis, over the largest modulus, up to which an eigenvalue is on it
FAINT = 1e-13  # sum of two eigenvalues, over their moduli, up to which it is rounding


def eigenvalues(A: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return the eigenvalues of a matrix, the largest real part first, of a pair the positive imaginary part first."""
    values = np.linalg.eigvals(A).astype(np.complex128)
    return np.asarray(values[np.lexsort((-values.imag, -values.real))])


def unstable_count(values: NDArray[np.complex128]) -> int:
    """Return the number of eigenvalues with positive real part, those at 0 but for rounding left out."""
    return int(np.sum(values.real > NEUTRAL * float(np.abs(values).max(initial=0.0))))


def multiplicity(values: NDArray[np.complex128], kind: str, unit: float = 0.0) -> int:
    """Return how many eigenvalues (SN, BP) or pairs (HB) are critical at once; at least 1.

    Parameters
    ----------
    values : ndarray of complex, shape (n,)
        Eigenvalues at a special point.
    kind : str
        Type of the point; 1 for all others.
    unit : float
        Modulus of eigenvalues elsewhere, where all of them may vanish at the point.
    """
    top = float(np.abs(values).max(initial=unit))
    if kind == "HB":
        return max(int(np.sum((np.abs(values.real) <= _CRITICAL * top) & (values.imag > _CRITICAL * top))), 1)
    return max(int(np.sum(np.abs(values) <= _CRITICAL * top)), 1) if kind in ("SN", "BP") else 1


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


def pair_product(values: NDArray[np.complex128]) -> float:
    """Return a test function with the sign of the product of all sums of two eigenvalues, each over its moduli.

    The product is the determinant of the bialternate product 2 A (.) I, over its size. It vanishes where a complex pair
    is imaginary, or where two real eigenvalues differ in sign alone. `combined` keeps its size from fading with the
    number of pairs.

    Parameters
    ----------
    values : ndarray of complex, shape (n,)
        Eigenvalues.
    """
    first, second = pairs(values.size)
    sizes = np.abs(values[first]) + np.abs(values[second])
    return float(combined((values[first] + values[second]) / np.where(sizes > 0.0, sizes, np.inf)))
