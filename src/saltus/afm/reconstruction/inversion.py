"""The smoothest force whose averages are the measured ones: linear, with a smoothness that the data tell.

The force at knots has a Gaussian prior of second differences. Their size is that of the greatest evidence, as D. J. C.
MacKay, Neural Comput. 4, 415 (1992), has it. Standard errors are those of the posterior.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import eigh

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Estimate", "inverted"]

_STRENGTHS = np.logspace(-14.0, 14.0, 113)  # of the prior, over that of the data
_ROUNDING = 1e-13  # relative error of a sum of squares that is a difference; below, rounding would choose the force
_AS_GOOD = 5.0  # logarithm of the evidence by which a force without noise must be better than one with noise


@dataclass(frozen=True)
class Estimate:
    """Forces at knots with their standard errors."""

    force: NDArray[np.float64]
    sigma: NDArray[np.float64]
    noise: float  # standard error of the data over the one assumed: 1 where errors are given
    chi2: float  # sum of squares of residuals over the errors


def inverted(
    matrix: NDArray[np.float64],
    values: NDArray[np.float64],
    errors: NDArray[np.float64] | None,
    knots: NDArray[np.float64],
) -> Estimate:
    """Return the forces whose averages by a matrix are given values.

    Parameters
    ----------
    matrix : ndarray, shape (datum, knot)
        Averages of forces at knots.
    values : ndarray, shape (datum,)
        The measured averages.
    errors : ndarray, shape (datum,), optional
        Their standard errors; without them one for all is estimated.
    knots : ndarray, shape (knot,)
        Gaps of the forces.
    """
    count, size = matrix.shape
    scale = np.sqrt(np.mean(values**2)) or 1.0
    weights = np.full(count, 1.0 / scale) if errors is None else 1.0 / errors
    told = matrix * weights[:, None]
    wanted = values * weights
    normal = told.T @ told
    bends = _bends(knots)
    rough = bends.T @ bends
    rough *= np.trace(normal) / np.trace(rough)
    shares, modes = eigh(rough, normal + rough)
    shares = np.clip(shares, 0.0, 1.0)
    along = modes.T @ (told.T @ wanted)
    total = float(wanted @ wanted)
    stiffness = (1.0 - shares)[:, None] + shares[:, None] * _STRENGTHS
    squares = np.maximum(total - np.sum(along[:, None] ** 2 / stiffness, axis=0), _ROUNDING * total)
    fit = squares if errors is not None else (count - 2) * np.log(squares)
    evidence = -0.5 * (fit + np.log(stiffness).sum(axis=0) - (size - 2) * np.log(_STRENGTHS))
    best = _chosen(evidence)
    noise = 1.0 if errors is not None else float(np.sqrt(squares[best] / (count - 2)))
    force = modes @ (along / stiffness[:, best])
    sigma = noise * np.sqrt(np.sum(modes**2 / stiffness[:, best], axis=1))
    residuals = (told @ force - wanted) / noise
    return Estimate(force, sigma, noise if errors is not None else noise * scale, float(residuals @ residuals))


def _bends(knots: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the matrix of second derivatives times the square of the distance of knots: differences where even."""
    steps = np.diff(knots)
    slopes = np.diff(np.eye(len(knots)), axis=0) / steps[:, None]
    between = 0.5 * (steps[1:] + steps[:-1])
    return np.asarray(np.diff(slopes, axis=0) * between[:, None])


def _chosen(evidence: NDArray[np.float64]) -> int:
    """Return the place of the greatest evidence; a peak is preferred to the plateau of data that are all signal."""
    inner = evidence[1:-1]
    peaks = 1 + np.flatnonzero((inner > evidence[:-2]) & (inner >= evidence[2:]))
    best = int(np.argmax(evidence))
    if len(peaks) and evidence[peaks].max() > evidence[best] - _AS_GOOD:
        return int(peaks[np.argmax(evidence[peaks])])
    return best
