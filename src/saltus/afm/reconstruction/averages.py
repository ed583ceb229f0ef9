"""Averages of a force over a harmonic oscillation as matrices: exact for forces that are linear between knots.

The gap is ``D + A u`` with ``u = cos(angle)``. A hat function of the gap has a mean in closed form: second differences
of the second antiderivative of the weight ``1/(pi sqrt(1 - u**2))``, or of ``u`` times it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.interpolate import CubicSpline

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Fall = Callable[[Any], Any]

__all__ = ["TAIL_POWER", "Grid", "averages", "bent_gaps", "cosines", "grid_of"]

TAIL_POWER = 2.0  # of the force beyond the data, as of van der Waals between a sphere and a flat
_APART = 1e-3  # least distance of knots, over the range of the gaps
_WITHIN = 4  # parts into which each interval between knots is divided
_HARMONICS = 24  # of the tip's motion, at most
_BEYOND = 60  # places beyond the last knot


class Grid:
    """Knots of a force, places between and beyond them, and the matrix from values at knots to values at places.

    Between knots the quantity is a cubic spline. Beyond the last knot it falls as `fall` of the gap says.
    """

    def __init__(self, knots: NDArray[np.float64], end: float, fall: Fall | None = None) -> None:
        self.knots = knots
        last = knots[-1]
        size = last if last > 0.0 else last - knots[0]  # gaps of an unknown origin: the range stands for the gap
        steps = np.linspace(0.0, 1.0, _WITHIN, endpoint=False)
        within = (knots[:-1, None] + np.diff(knots)[:, None] * steps).ravel()
        reach = max(end - last, 1e-6 * size)
        first = min(knots[-1] - knots[-2], 0.5 * reach)
        beyond = last + np.concatenate([[0.0], np.geomspace(first / _WITHIN, reach, _BEYOND)])
        self.places = np.concatenate([within, beyond])
        spline = CubicSpline(knots, np.eye(len(knots)))
        gap = 1.0 + (beyond - last) / size
        tail = np.zeros((len(beyond), len(knots)))
        tail[:, -1] = gap**-TAIL_POWER if fall is None else fall(size * gap) / fall(size)
        self.spread = np.vstack([spline(within), tail])


def grid_of(nearest: NDArray[np.float64], farthest: float, most: int, blur: float = 0.0) -> Grid:
    """Return the grid of data with given least gaps: its knots are among the gaps, at most so many.

    Knots are further apart than `blur`, the error of the gaps: data that lie nearer tell no bend between them.
    """
    found = np.unique(nearest)
    if len(found) > most:
        found = found[np.unique(np.linspace(0, len(found) - 1, most).round().astype(int))]
    apart = max(_APART * (found[-1] - found[0]), blur)
    kept = [found[0]]
    for gap in found[1:]:
        if gap - kept[-1] > apart:
            kept.append(gap)
    return Grid(np.array(kept), farthest)


def averages(
    centre: NDArray[np.float64], amplitude: NDArray[np.float64], grid: Grid
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the matrices from forces at places to ``<F>`` and to ``<F u>``, shape (datum, place) each."""
    u = np.clip((grid.places - centre[:, None]) / amplitude[:, None], -1.0, None)
    inner = np.minimum(u, 1.0)
    root, arc = np.sqrt(1.0 - inner**2), np.arcsin(inner)
    beyond = np.maximum(u - 1.0, 0.0)
    mean = inner * arc + root + 0.5 * np.pi * inner + np.pi * beyond
    moment = -0.5 * (inner * root + arc + 0.5 * np.pi)
    ends = np.arcsin(inner[:, -1]) + 0.5 * np.pi
    return _hats(grid, amplitude, mean, ends), _hats(grid, amplitude, moment, -root[:, -1])


def _hats(
    grid: Grid, amplitude: NDArray[np.float64], twice: NDArray[np.float64], last: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the matrix of a weight with given second antiderivative, and first antiderivative at the last place."""
    slopes = np.diff(twice, axis=1) / (np.diff(grid.places) / amplitude[:, None])
    weights = np.diff(slopes, axis=1, prepend=0.0, append=last[:, None])
    return np.asarray(weights / np.pi)


def cosines(nodes: int) -> NDArray[np.float64]:
    """Return the cosines of multiples of the angle in half a cycle, shape (harmonic, node), the first being 1."""
    angles = (np.arange(nodes) + 0.5) * np.pi / nodes
    return np.asarray(np.cos(np.arange(_HARMONICS + 1)[:, None] * angles))


def bent_gaps(
    force: NDArray[np.float64], centre: NDArray[np.float64], amplitude: NDArray[np.float64], k: float
) -> NDArray[np.float64]:
    """Return the gaps along half a cycle of a tip that a force moves with its higher harmonics too.

    A harmonic n of the force moves an oscillator at its resonance by ``F_n/(k (1 - n**2))``.

    Parameters
    ----------
    force : ndarray, shape (datum, node)
        The force along the motion.
    """
    wave = cosines(force.shape[1])
    orders = np.arange(2, _HARMONICS + 1)
    parts = 2.0 * force @ wave[2:].T / force.shape[1] / (k * (1.0 - orders**2))
    return np.asarray(centre[:, None] + amplitude[:, None] * wave[1] + parts @ wave[2:])
