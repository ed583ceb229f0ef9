"""Least values of convex quadratic functions under linear inequalities, and multipliers of what is active.

References
----------
Lawson and Hanson, Solving Least Squares Problems, Prentice-Hall 1974, ch. 23 (least distance by non-negative least
squares); Byrd and Omojokun in Nocedal and Wright, Numerical Optimization, Springer 2006, ch. 18.5 (relaxed
constraints).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["lagrange_multipliers", "least_quadratic", "reachable_share"]

_EMPTY = 1e-14  # square of the residual below which inequalities have no common point


def least_quadratic(
    hessian: NDArray[np.float64], gradient: NDArray[np.float64], rows: NDArray[np.float64], least: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """Return where ``gradient @ d + d @ hessian @ d / 2`` is least under ``rows @ d >= least``, and the multipliers.

    Parameters
    ----------
    hessian : ndarray, shape (n, n)
        Positive definite.
    gradient : ndarray, shape (n,)
        Of the function at 0.
    rows, least : ndarray, shapes (m, n) and (m,)
        The inequalities.

    Returns
    -------
    (ndarray, ndarray) or None
        Place, shape (n,), and multipliers, shape (m,), not below 0. None where no place meets all inequalities.

    Examples
    --------
    >>> row, least = np.array([[-1.0, 0.0]]), np.array([-1.0])
    >>> place, multipliers = least_quadratic(np.eye(2), np.array([-2.0, 0.0]), row, least)
    >>> place.round(9).tolist(), multipliers.round(9).tolist()
    ([1.0, 0.0], [1.0])
    """
    from scipy.optimize import nnls

    factor = np.linalg.cholesky(hessian)
    centre = np.linalg.solve(factor, gradient)
    across = np.linalg.solve(factor, rows.T)
    heights = least + across.T @ centre
    weights, size = nnls(np.vstack([across, heights]), np.append(np.zeros(len(gradient)), 1.0))
    left = 1.0 - float(heights @ weights)
    if not size**2 > _EMPTY or not left > _EMPTY:
        return None
    multipliers = weights / left
    return np.linalg.solve(factor.T, across @ multipliers - centre), multipliers


def reachable_share(
    values: NDArray[np.float64], jacobian: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64]
) -> float:
    """Return by what share all violations can shrink at once within a box, to first order: 1 where none is left.

    Parameters
    ----------
    values, jacobian : ndarray, shapes (m,) and (m, n)
        Constraints, which are to be 0 or above, and their derivatives.
    low, high : ndarray, shape (n,)
        The box, 0 within.
    """
    if np.all(values >= 0.0):
        return 1.0
    from scipy.optimize import linprog

    short = np.minimum(values, 0.0)
    found = linprog(
        np.append(np.zeros(len(low)), -1.0), A_ub=np.column_stack([-jacobian, -short]), b_ub=np.maximum(values, 0.0),
        bounds=[*zip(low.tolist(), high.tolist(), strict=True), (0.0, 1.0)],
    )  # fmt: skip
    return float(found.x[-1]) if found.status == 0 else 0.0


def lagrange_multipliers(
    gradient: NDArray[np.float64], rows: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return multipliers of active constraints, not below 0, and what is left of the gradient.

    Parameters
    ----------
    gradient : ndarray, shape (n,)
        Of the function that is least.
    rows : ndarray, shape (m, n)
        Derivatives of the active constraints.

    Examples
    --------
    >>> multipliers, left = lagrange_multipliers(np.array([1.0, 0.5]), np.array([[2.0, 0.0]]))
    >>> multipliers.round(9).tolist(), left.round(9).tolist()
    ([0.5], [0.0, 0.5])
    """
    from scipy.optimize import nnls

    if not len(rows):
        return np.zeros(0), gradient.copy()
    found = nnls(rows.T, gradient)[0]
    return found, gradient - rows.T @ found
