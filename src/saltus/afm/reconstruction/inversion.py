"""The smoothest force whose averages are the measured ones: linear, with a smoothness that the data tell.

The force at knots has a Gaussian prior of second differences. Their size is that of the greatest evidence, as D. J. C.
MacKay, Neural Comput. 4, 415 (1992), has it. Standard errors are those of the posterior.

A force may bend sharply at one place, as where contact begins. Each place is a model with one unknown more, the change
of the slope there, with a prior that is worth one datum. Models count by their evidence, that without a bend as much as
all others together (J. A. Hoeting et al., Statist. Sci. 14, 382 (1999)). Errors hold what models differ by, and by how
much the smoothness rounds the force.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.linalg import eigh

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.afm.reconstruction.averages import Grid

__all__ = ["Estimate", "inverted"]

_STRENGTHS = np.logspace(-14.0, 14.0, 113)  # of the prior, over that of the data
_ROUNDING = 1e-13  # relative error of a sum of squares that is a difference; below, rounding would choose the force
_ROUNDED = 3.0  # rounding of the true force, over that of the force found, which is rounded already
_COUNTS = 1e-6  # share of a model from which it counts
_AS_GOOD = 5.0  # logarithm of the evidence by which a force without noise must be better than one with noise


@dataclass(frozen=True)
class Estimate:
    """Forces at knots with their standard errors."""

    along: NDArray[np.float64]  # the force at the places of the grid
    force: NDArray[np.float64]
    sigma: NDArray[np.float64]
    noise: float  # standard error of the data over the one assumed: 1 where errors are given
    chi2: float  # sum of squares of residuals over the errors


class _Posterior(NamedTuple):
    """What the data tell with priors of all strengths, without a bend."""

    told: NDArray[np.float64]  # averages of forces at places, over the errors
    wanted: NDArray[np.float64]  # the measured ones
    squares: NDArray[np.float64]  # what is left of these for each strength
    evidence: NDArray[np.float64]
    modes: NDArray[np.float64]
    along: NDArray[np.float64]  # the data in the modes
    stiffness: NDArray[np.float64]  # shape (mode, strength)


def inverted(
    matrix: NDArray[np.float64], values: NDArray[np.float64], errors: NDArray[np.float64] | None, grid: Grid
) -> Estimate:
    """Return the forces whose averages by a matrix are given values.

    Parameters
    ----------
    matrix : ndarray, shape (datum, place)
        Averages of forces at the places of the grid.
    values : ndarray, shape (datum,)
        The measured averages.
    errors : ndarray, shape (datum,), optional
        Their standard errors; without them one for all is estimated.
    grid : Grid
        Gaps of the forces.
    """
    knots, (count, size) = grid.knots, (len(matrix), len(grid.knots))
    scale = np.sqrt(np.mean(values**2)) or 1.0
    weights = np.full(count, 1.0 / scale) if errors is None else 1.0 / errors
    whole = matrix * weights[:, None]
    told = whole @ grid.spread
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
    known = errors is not None
    evidence = _fit(squares, count, known) - 0.5 * (np.log(stiffness).sum(axis=0) - (size - 2) * np.log(_STRENGTHS))
    posterior = _Posterior(whole, wanted, squares, evidence, modes, along, stiffness)
    return _averaged(posterior, grid, scale, known)


def _fit(squares: NDArray[np.float64], count: int, known: bool) -> NDArray[np.float64]:
    """Return the part of the evidence that residuals have, with errors that are known or not."""
    return np.asarray(-0.5 * (squares if known else (count - 2) * np.log(squares)))


def _averaged(found: _Posterior, grid: Grid, scale: float, known: bool) -> Estimate:
    """Return the mean over a force without a bend and forces with one at a place, by their evidence."""
    count, knots = len(found.wanted), grid.knots
    total = float(found.wanted @ found.wanted)
    # where errors are not known, a bend that is free would take what they are for signal
    bends = np.flatnonzero((grid.places > knots[1]) & (grid.places < knots[-2]) & known)
    hinges = np.maximum(grid.places[bends] - grid.places[:, None], 0.0)
    seen = found.told @ hinges
    # without a bend: S = 1 + told P**-1 told' is the covariance of the data; of a hinge h: h' S**-1 h, h' S**-1 data
    mixed = found.modes.T @ (grid.spread.T @ (found.told.T @ seen))
    own = np.sum(seen**2, axis=0)[:, None] - mixed.T**2 @ (1.0 / found.stiffness)
    own = np.maximum(own, _ROUNDING * np.sum(seen**2, axis=0)[:, None])
    told = (seen.T @ found.wanted)[:, None] - mixed.T @ (found.along[:, None] / found.stiffness)
    curvature = own * (1.0 + 1.0 / count)  # of the change of slope: with a prior that is worth one datum
    left = np.maximum(found.squares - told**2 / curvature, _ROUNDING * total)
    plain = _chosen(found.evidence)
    gains = found.evidence - _fit(found.squares, count, known) + _fit(left, count, known) - 0.5 * np.log1p(count)
    best = np.array([_chosen(row) for row in gains], dtype=int)
    rows = np.arange(len(bends))
    every = np.append(gains[rows, best] - np.log(max(len(bends), 1)), found.evidence[plain])
    shares = np.exp(every - every.max())
    shares /= shares.sum()
    counted = np.flatnonzero(shares[:-1] > _COUNTS)
    strengths = np.append(best[counted], plain)
    shares = np.append(shares[counted], shares[-1]) / (shares[counted].sum() + shares[-1])
    slope = np.append((told / curvature)[counted, best[counted]], 0.0)
    error = np.append((1.0 / curvature)[counted, best[counted]], 0.0)
    shift = np.column_stack([mixed[:, counted], np.zeros(len(found.modes))])
    hinge = np.column_stack([hinges[:, counted], np.zeros(len(grid.places))])
    soft = 1.0 / found.stiffness[:, strengths]
    squares = np.append(left[counted, best[counted]], found.squares[plain])
    noise = np.ones(len(shares)) if known else np.sqrt(squares / (count - 2))
    smooth = found.modes @ (soft * (found.along[:, None] - shift * slope))
    along = grid.spread @ smooth + hinge * slope
    at = np.searchsorted(grid.places, knots)
    moves = hinge[at] - found.modes @ (soft * shift)
    variance = noise**2 * (found.modes**2 @ soft + error * moves**2)
    mean = along @ shares
    spread = variance + (along[at] - mean[at][:, None]) ** 2
    level = float(noise @ shares)
    residuals = (found.told @ mean - found.wanted) / level
    # the same of data of this force: by how much the smoothness rounds it, and more so the true one
    again = found.told @ mean
    also = found.modes.T @ (grid.spread.T @ (found.told.T @ again))
    turned = np.append((seen.T @ again)[counted], 0.0) - np.sum(shift * (also[:, None] * soft), axis=0)
    twice = found.modes @ (soft * (also[:, None] - shift * (turned * error)))
    rounding = np.abs((grid.spread @ twice + hinge * (turned * error)) @ shares - mean)[at]
    padded = np.pad(rounding, 1, "edge")
    beside = np.maximum(rounding, np.maximum(padded[:-2], padded[2:]))  # a bend lies between knots
    sigma = np.sqrt(spread @ shares + (_ROUNDED * beside) ** 2)
    return Estimate(mean, mean[at], sigma, level if known else level * scale, float(residuals @ residuals))


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
