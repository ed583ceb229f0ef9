"""What a motion visits, as a cloud of points: whether two motions visit the same."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


__all__ = ["EXTENT", "Cloud", "distances"]

_OVERLAP, _REACH, _TYPICAL = 0.9, 3.0, 0.98
"""Part of a motion's points that lie within so many typical distances of another's; quantile of these distances."""

EXTENT = 1e-9
"""Least extent of what a motion visits, as a part of the states' scale."""


class Cloud:
    """What one motion visits, in units of its extent, and how near to each other its points are."""

    def __init__(self, points: NDArray[np.float64], scale: NDArray[np.float64]) -> None:
        self.unit = np.maximum(np.ptp(points, axis=0), EXTENT * scale)
        self.points = points / self.unit
        self.reach = _REACH * max(float(np.quantile(distances(self.points[::2], self.points[1::2]), _TYPICAL)), 1e-6)

    def stationary(self) -> bool:
        """Whether the second half visits what the first did."""
        return self._alike(*np.array_split(self.points, 2))

    def same(self, points: NDArray[np.float64]) -> bool:
        """Whether another motion visits the same states."""
        return self._alike(self.points, points / self.unit)

    def _alike(self, these: NDArray[np.float64], those: NDArray[np.float64]) -> bool:
        both = (distances(these, those), distances(those, these))
        return all(float(np.mean(distances <= self.reach)) >= _OVERLAP for distances in both)


def distances(these: NDArray[np.float64], those: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance of each of those points from the nearest of these."""
    from scipy.spatial import cKDTree

    return np.asarray(cKDTree(these).query(those)[0])
