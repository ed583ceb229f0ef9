"""Eigenvalues of an equilibrium: order, stability, test functions. docs/theory/equilibria.md, "Test functions"."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Protocol

import numpy as np

from saltus.algebraic.products import combined, pairs
from saltus.scales import EPS, SEPARATED, SMALLEST

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

__all__ = [
    "FAINT",
    "NEUTRAL",
    "bands",
    "eigenvalues",
    "kind_of",
    "multiplicity",
    "pair_product",
    "sized_eigenvalues",
    "terms_at",
    "unstable_count",
]

NEUTRAL = 1e-9  # real part of an eigenvalue, over its size, up to which it is rounding of 0
_CRITICAL = 1e-6  # distance from the imaginary axis, over its size, up to which an eigenvalue is on it
FAINT = 1e-13  # sum of two eigenvalues, over their moduli, up to which it is rounding
_GAP = 30.0  # ratio of two neighbouring moduli from which on the slower values are first looked for behind it
_LEAST_GAP = 3.0  # least such ratio
_APART = 0.1  # terms of the slower values, over the least of the faster ones, up to which they are computed apart
_MOVED = 2.0**-10  # relative change of an unknown by which it is seen how entries of a Jacobian depend on it


class _Equations(Protocol):
    """Equations with their derivatives, as `AlgebraicProblem` has them."""

    n: int

    def evaluate(self, u: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the equations, and their derivatives by the unknowns."""


def eigenvalues(A: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return the eigenvalues of a matrix, the largest real part first, of a pair the positive imaginary part first."""
    return sized_eigenvalues(A)[0]


def terms_at(problem: _Equations, u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return what each unknown makes of the Jacobian, ``u_k`` times its derivative, shape (unknowns, n, n).

    An entry may be a difference of terms, as the growth of a species next to its threshold. Its terms stay.
    """
    A = problem.evaluate(u)[1][:, : problem.n]
    found = np.zeros((u.size, *A.shape))
    for k in np.flatnonzero(u).tolist():
        moved = u.copy()
        moved[k] *= 1.0 + _MOVED
        change = (problem.evaluate(moved)[1][:, : problem.n] - A) / _MOVED
        found[k] = np.where(np.isfinite(change), change, 0.0)
    return found


def sized_eigenvalues(
    A: NDArray[np.float64],
    terms: Callable[[], NDArray[np.float64]] | None = None,
    values: NDArray[np.complex128] | None = None,
) -> tuple[NDArray[np.complex128], NDArray[np.float64]]:
    """Return `eigenvalues` and the size of each, shape (n,) each.

    An eigenvalue is a sum of terms, ``y A x`` with its left and right vectors: the size is that of the terms. Where no
    values are far slower than others it is the largest modulus, for all of them. docs/theory/equilibria.md, "Values of
    different sizes", explains why slow values have an own one, and how they are computed. `terms` returns what the
    entries are made of besides, shape (any, n, n); it is called where it matters. `values` are those that NumPy
    finds, where they are known.
    """
    values = np.linalg.eigvals(A).astype(np.complex128) if values is None else values
    moduli = np.abs(values).tolist()
    top = max(moduli, default=0.0)
    sizes = np.array([top] * len(moduli))
    if min(moduli, default=math.inf) < SEPARATED * top:
        parts = A[None] if terms is None else np.concatenate([A[None], terms()])
        found = _by_speed(_balanced(parts), top)
        if len(found) > 1:
            values = np.concatenate([own for own, _ in found])
            sizes = np.concatenate([np.full(own.size, size) for own, size in found])
    known = values.tolist()
    order = sorted(range(len(known)), key=lambda i: (-known[i].real, -known[i].imag))
    return np.asarray(values[order]), sizes[order]


def _by_speed(parts: NDArray[np.float64], size: float) -> list[tuple[NDArray[np.complex128], float]]:
    """Return the eigenvalues of a balanced matrix in sets of one size, the fastest first.

    The matrix is the first one, its entries' terms are the others.
    """
    values = np.linalg.eigvals(parts[0]).astype(np.complex128)
    order = np.argsort(-np.abs(values), kind="stable")
    moduli = np.abs(values[order])
    if moduli.size < 2 or moduli[-1] >= SEPARATED * moduli[0]:
        return [(values, size)]
    ratios = moduli[:-1] / np.maximum(np.maximum(moduli[1:], SMALLEST / EPS * moduli[:-1]), SMALLEST)
    wide = np.flatnonzero(ratios >= _GAP)
    for k in (wide if wide.size else np.flatnonzero(ratios == ratios.max())).tolist():
        if ratios[k] >= _LEAST_GAP and (slow := _slow_part(parts, float(moduli[k]), float(moduli[k + 1]))) is not None:
            return [(values[order[: k + 1]], size), *_by_speed(slow[0], min(size, slow[1]))]
    return [(values, size)]


def _slow_part(parts: NDArray[np.float64], fast: float, slow: float) -> tuple[NDArray[np.float64], float] | None:
    """Return balanced matrices of the slow values alone, and the size of their terms; None where they are not apart.

    Right and left invariant subspaces of the slow values have an error of rounding alone, since the fast ones are far
    away. The matrix between them has the square of this error, and the rounding of its own terms.
    """
    from scipy.linalg import schur, solve_sylvester

    between = math.sqrt(fast * slow)
    T, Q, m = schur(parts[0], sort=lambda x, y=0.0: abs(complex(x) + 1j * y) < between)
    right, rest = Q[:, :m], Q[:, m:]
    left = right.T + solve_sylvester(T[:m, :m], -T[m:, m:], T[:m, m:]) @ rest.T
    terms = np.abs(left) @ np.abs(parts).sum(axis=0) @ np.abs(right)
    if not np.isfinite(terms).all():
        return None
    size = float(np.abs(np.linalg.eigvals(terms)).max(initial=0.0))
    # terms that underflow have lost their digits
    if m == 0 or not SMALLEST / EPS < size < _APART * fast:
        return None
    return _balanced(left @ parts @ right), size


def _balanced(parts: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return matrices in units in which rows and columns of the first are of like sizes."""
    from scipy.linalg import matrix_balance

    # scipy reads units as places too, which it does not use; terms beyond the largest double are not apart
    with np.errstate(invalid="ignore", over="ignore"):
        balanced, (units, order) = matrix_balance(parts[0], permute=True, scale=True, separate=True)
        found = parts[:, order[:, None], order] / units[:, None] * units
    found[0] = balanced
    return np.asarray(found)


def bands(values: NDArray[np.complex128], sizes: NDArray[np.float64]) -> list[NDArray[np.complex128]]:
    """Return values in sets of one size, the largest size first."""
    return [values[sizes == size] for size in np.unique(sizes)[::-1]]


def unstable_count(values: NDArray[np.complex128], sizes: NDArray[np.float64] | None = None) -> int:
    """Return the number of eigenvalues with positive real part, those at 0 but for rounding left out.

    The size of each is the largest modulus by default.
    """
    return int(np.count_nonzero(values.real > NEUTRAL * _sizes(values, sizes)))


def _sizes(values: NDArray[np.complex128], sizes: NDArray[np.float64] | None) -> NDArray[np.float64] | float:
    """Return the sizes of eigenvalues, by default the largest modulus."""
    return float(np.abs(values).max(initial=0.0)) if sizes is None else sizes


def multiplicity(
    values: NDArray[np.complex128], kind: str, unit: float = 0.0, sizes: NDArray[np.float64] | None = None
) -> int:
    """Return how many eigenvalues (SN, BP) or pairs (HB) are critical at once; at least 1.

    Parameters
    ----------
    values : ndarray of complex, shape (n,)
        Eigenvalues at a special point.
    kind : str
        Type of the point; 1 for all others.
    unit : float
        Modulus of eigenvalues elsewhere, where all of them may vanish at the point.
    sizes : ndarray, optional
        Sizes of the eigenvalues, where these differ.
    """
    top = _sizes(values, sizes)
    if sizes is None or np.all(sizes == sizes[0]):
        top = float(np.abs(values).max(initial=unit))
    if kind == "HB":
        return max(int(np.sum((np.abs(values.real) <= _CRITICAL * top) & (values.imag > _CRITICAL * top))), 1)
    return max(int(np.sum(np.abs(values) <= _CRITICAL * top)), 1) if kind in ("SN", "BP") else 1


def kind_of(values: NDArray[np.complex128], sizes: NDArray[np.float64] | None = None) -> str:
    """Return the kind of an equilibrium in words, as ``stable focus`` or ``saddle (1 unstable)``."""
    rounding = np.broadcast_to(NEUTRAL * _sizes(values, sizes), values.shape)
    if np.any(np.abs(values.real) <= rounding):
        return "not hyperbolic"
    unstable = unstable_count(values, sizes)
    if 0 < unstable < values.size:
        return f"saddle ({unstable} unstable)"
    leading = np.argmin(np.abs(values.real))
    shape = "focus" if abs(values[leading].imag) > rounding[leading] else "node"
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
    moduli = np.abs(values)
    sizes = moduli[first] + moduli[second]
    sizes[~(sizes > 0.0)] = np.inf
    return float(combined((values[first] + values[second]) / sizes))
