"""Clouds of the points that motions visit, and a test whether two motions visit the same set."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


__all__ = ["EXTENT", "Cloud", "distances"]

_OVERLAP = 0.9  # share of a cloud's points within reach of another cloud that makes both one attractor's
_REACH = 3.0  # reach of a point, in typical distances of neighbours
_TYPICAL = 0.98  # quantile of the neighbours' distances that is typical

EXTENT = 1e-9  # least extent of a cloud, over the states' scale


class Cloud:
    """Points that one motion visits, in units of their extent, and the typical distance of neighbours."""

    def __init__(self, points: NDArray[np.float64], scale: NDArray[np.float64]) -> None:
        self.unit = np.maximum(np.ptp(points, axis=0), EXTENT * scale)
        self.points = points / self.unit
        self.reach = _REACH * max(float(np.quantile(distances(self.points[::2], self.points[1::2]), _TYPICAL)), 1e-6)

    def stationary(self) -> bool:
        """Return whether the second half of the motion visits the set of the first half."""
        return self._alike(*np.array_split(self.points, 2))

    def holds(self, points: NDArray[np.float64]) -> bool:
        """Return whether all of some points are near those of the set."""
        return bool((distances(self.points, points / self.unit) <= self.reach).all())

    def same(self, points: NDArray[np.float64]) -> bool:
        """Return whether another motion visits the same set."""
        return self._alike(self.points, points / self.unit)

    def _alike(self, these: NDArray[np.float64], those: NDArray[np.float64]) -> bool:
        both = (distances(these, those), distances(those, these))
        return all(float(np.mean(distances <= self.reach)) >= _OVERLAP for distances in both)


def distances(these: NDArray[np.float64], those: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the distance of each point of `those` from the nearest point of `these`."""
    from scipy.spatial import cKDTree

    return np.asarray(cKDTree(these).query(those)[0])
