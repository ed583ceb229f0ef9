"""Clouds of the points that motions visit, and a test whether two motions visit the same set."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus.system.angles import TURN, on_circles

if TYPE_CHECKING:
    from numpy.typing import NDArray


__all__ = ["EXTENT", "Cloud", "distances", "extent_of"]

_OVERLAP = 0.9  # share of a cloud's points within reach of another cloud that makes both one attractor's
_REACH = 3.0  # reach of a point, in typical distances of neighbours
_TYPICAL = 0.98  # quantile of the neighbours' distances that is typical

EXTENT = 1e-9  # least extent of a cloud, over the states' scale


class Cloud:
    """Points that one motion visits, in units of their extent, and the typical distance of neighbours.

    Parameters
    ----------
    points : ndarray, shape (k, n)
    scale : ndarray, shape (n,)
        Size of each state.
    circles : ndarray of int
        Places of the angles, which are seen by cosine and sine.
    """

    def __init__(self, points: NDArray[np.float64], scale: NDArray[np.float64], circles: NDArray[np.int64]) -> None:
        self.circles, count = circles, circles.size
        table, sizes = on_circles(points, scale, circles)
        self.unit = np.maximum(np.ptp(table, axis=0), EXTENT * sizes)
        if count:  # one circle, one unit
            both = np.maximum(self.unit[-2 * count : -count], self.unit[-count:])
            self.unit[-2 * count :] = np.concatenate([both, both])
        self.points = table / self.unit
        self.reach = _REACH * max(float(np.quantile(distances(self.points[::2], self.points[1::2]), _TYPICAL)), 1e-6)

    def stationary(self) -> bool:
        """Return whether the second half of the motion visits the set of the first half."""
        return self._alike(*np.array_split(self.points, 2))

    def holds(self, points: NDArray[np.float64]) -> bool:
        """Return whether all of some points are near those of the set."""
        return bool((distances(self.points, self._seen(points)) <= self.reach).all())

    def same(self, points: NDArray[np.float64]) -> bool:
        """Return whether another motion visits the same set."""
        return self._alike(self.points, self._seen(points))

    def _seen(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        table = on_circles(points, np.zeros(points.shape[1]), self.circles)[0]
        return np.asarray(table / self.unit)

    def _alike(self, these: NDArray[np.float64], those: NDArray[np.float64]) -> bool:
        both = (distances(these, those), distances(those, these))
        return all(float(np.mean(distances <= self.reach)) >= _OVERLAP for distances in both)


def extent_of(points: NDArray[np.float64], circles: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the extent of points in each state, shape (n,); on a circle, a turn without the widest gap."""
    extent = np.ptp(points, axis=0)
    for place in circles:
        angle = np.sort(points[:, place])
        extent[place] = TURN - np.diff(angle, append=angle[0] + TURN).max()
    return np.asarray(extent)


def distances(these: NDArray[np.float64], those: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the distance of each point of `those` from the nearest point of `these`."""
    from scipy.spatial import cKDTree

    return np.asarray(cKDTree(these).query(those)[0])
