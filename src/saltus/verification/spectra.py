"""Eigenvalues of products of matrices with the digits that they have, and how two sets of eigenvalues correspond."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["matched", "spectrum"]

_ERROR = 1e-10  # relative error of matrices that come from differences
_DIGITS = 60  # of the arithmetic in which a product and its eigenvalues are computed
_SPREAD = 1e5  # ratio of a product's norm to an eigenvalue from which on doubles lose digits
_LEAST = 1e-9  # absolute accuracy that is asked of any eigenvalue


def spectrum(
    steps: Sequence[NDArray[np.float64]], sizes: NDArray[np.float64], dropped: int = 0, error: float = _ERROR
) -> tuple[NDArray[np.complex128], NDArray[np.float64]]:
    """Return the eigenvalues of a product of matrices, the largest modulus first, and how far each may be off.

    Parameters
    ----------
    steps : sequence of ndarray, shape (n, n)
        The factors; the first one acts first.
    sizes : ndarray, shape (n,)
        Sizes of the components.
    dropped : int
        How many eigenvalues are known to be 0 and left out.
    error : float
        Relative error of the factors.
    """
    from scipy.linalg import eig

    product, power = np.eye(sizes.size), 1.0
    for step in steps:
        scaled = step * sizes / sizes[:, None]
        power *= max(float(np.linalg.norm(scaled, 2)), 1e-300)
        product = scaled @ product
    values, left, right = eig(product, left=True)
    values = values.astype(np.complex128)
    norm = float(np.linalg.norm(product, 2))
    if norm > _SPREAD * float(np.abs(values).min(initial=1.0)) or power > _SPREAD * max(norm, 1e-300):
        values = _many_digits([step * sizes / sizes[:, None] for step in steps])
        _, left, right = eig(product, left=True)
        order = _order(values, np.diag(left.conj().T @ product @ right))
        left, right = left[:, order], right[:, order]
    condition = 1.0 / np.maximum(np.abs(np.sum(left.conj() * right, axis=0)), 1e-8)
    level = error * max(norm, power if power < 1e3 * norm else norm)
    uncertain = np.minimum(condition * level, np.sqrt(level * max(norm, 1.0))) + _LEAST
    order = np.argsort(-np.abs(values), kind="stable")[: values.size - dropped]
    return values[order], uncertain[order]


def matched(
    said: NDArray[np.complex128], found: NDArray[np.complex128], uncertain: NDArray[np.float64]
) -> Iterator[tuple[complex, complex, float]]:
    """Yield pairs of eigenvalues, each of one set with its counterpart in the other, and their allowed distance."""
    from scipy.optimize import linear_sum_assignment

    finite = np.flatnonzero(np.isfinite(said))
    distance = np.abs(said[finite, None] - found[None, :])
    rows, columns = linear_sum_assignment(np.log(distance + 1e-12))
    for i, j in zip(rows.tolist(), columns.tolist(), strict=True):
        yield complex(said[finite[i]]), complex(found[j]), float(uncertain[j] + 1e-7 * abs(found[j]))


def _order(values: NDArray[np.complex128], rough: NDArray[np.complex128]) -> NDArray[np.intp]:
    from scipy.optimize import linear_sum_assignment

    return np.asarray(linear_sum_assignment(np.abs(values[:, None] - rough[None, :]))[1])


def _many_digits(steps: Sequence[NDArray[np.float64]]) -> NDArray[np.complex128]:
    """Return the eigenvalues of a product that is computed with many digits."""
    import mpmath

    with mpmath.workdps(_DIGITS):
        product = mpmath.eye(steps[0].shape[0])
        for step in steps:
            product = mpmath.matrix(step.tolist()) * product
        values = mpmath.eig(product, left=False, right=False)
        return np.array([complex(value) for value in values])
