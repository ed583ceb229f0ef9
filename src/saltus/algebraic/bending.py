"""Sizes of states near a rest in the origin: where derivatives of fields, resets or maps are other than there."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus.scales import UNIT_DECADES

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

__all__ = ["bending_sizes"]

_POWERS = 19  # of ten, to either side, up to which sizes are sought


def bending_sizes(
    slopes: Callable[[NDArray[np.float64]], Sequence[NDArray[np.float64]]],
    n: int,
    also: Sequence[NDArray[np.float64]],
) -> NDArray[np.float64]:
    """Return sizes of the states near the origin at which derivatives are other than there, shape (n,).

    States that are linked by the derivatives in the origin have sizes that balance these. The largest is 1 where the
    derivatives change within some powers of ten of 1, and where they never do. States that are not linked have units
    of their own: they are moved by themselves, and with all others only if that changes nothing.

    Parameters
    ----------
    slopes : callable
        Takes a state, (n,), and returns matrices of derivatives by their kinds, each (matrices, n, n).
    n : int
        Number of states.
    also : sequence of ndarray, each (matrices, n, n)
        For each kind what its change counts over as well, as the derivatives in the origin may vanish.

    References
    ----------
    B. N. Parlett, C. Reinsch, Balancing a matrix for calculation of eigenvalues and eigenvectors, Numer. Math. 13
    (1969) 293-304.

    Examples
    --------
    >>> bending_sizes(lambda x: [np.diag([-1.0 + 3e18 * x[0] ** 2, 0.5])[None]], 2, [np.zeros((1, 2, 2))]).tolist()
    [1e-10, 1e-10]
    """
    origin = slopes(np.zeros(n))
    if not all(np.all(np.isfinite(matrices)) for matrices in origin):
        return np.ones(n)
    terms = np.max([np.abs(matrices).max(axis=0) for matrices in origin], axis=0)
    first = _linked(terms)
    parts = [first == i for i in np.unique(first).tolist()]
    sizes = np.ones(n)
    for part in parts:
        sizes[part] = _balance(terms[np.ix_(part, part)])
    shape = sizes * (1.0 + 0.5 * np.sin(1.0 + np.arange(n)))

    def power(moved: NDArray[np.bool_], seen: NDArray[np.bool_]) -> int | None:
        def over(matrices: NDArray[np.float64]) -> float:
            return float(np.abs(matrices * sizes / sizes[:, None])[:, seen].max(initial=0.0))

        kinds = list(zip(origin, also, strict=True))
        usual = [max(over(matrices), over(beside)) or 1.0 for matrices, beside in kinds]

        def bends(exponent: int) -> bool:
            with np.errstate(all="ignore"):
                there = slopes(np.where(moved, shape * 10.0**exponent, 0.0))
                changes = [over(now - then) for now, then in zip(there, origin, strict=True)]
            # a change beyond all numbers is one as well
            return any(not change / unit < 1.0 for change, unit in zip(changes, usual, strict=True))

        way = -1 if bends(0) else 1
        near, far = way * UNIT_DECADES, way * (_POWERS - 1)
        if bends(near) == (way > 0):  # no power that is that near counts
            return 0
        if bends(far) != (way > 0):
            return None
        return next(k for k in range(near, far + way, way) if bends(k) == (way > 0))

    together: int | None = None
    for part in parts:
        exponent = power(part, part[:, None] & part)
        if exponent is None:
            together = power(np.ones(n, dtype=bool), np.ones((n, n), dtype=bool)) if together is None else together
            exponent = together = together or 0
        if abs(exponent) > UNIT_DECADES:
            sizes[part] *= 10.0**exponent
    return sizes


def _linked(terms: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return for each state the first of those that the terms of a matrix link it with, directly or by others."""
    linked = (terms + terms.T > 0.0) | np.eye(len(terms), dtype=bool)
    for _ in range(len(terms).bit_length()):
        linked = linked @ linked
    return np.asarray(np.argmax(linked, axis=1))


def _balance(terms: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return sizes that balance a matrix, the largest not below 1 and the least not above it."""
    if len(terms) == 1:
        return np.ones(1)
    from scipy.linalg import matrix_balance

    _, (balance, _) = matrix_balance(terms, permute=False, separate=True)
    return np.asarray(
        balance / (balance.max() if balance.max() < 1.0 else balance.min() if balance.min() > 1.0 else 1.0)
    )
