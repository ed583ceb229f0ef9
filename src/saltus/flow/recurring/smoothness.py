"""Whether points go round smoothly, as on a torus, or roughly, as on a strange attractor; and whether they drift.

Means with the weights of Das et al. (2017) converge faster than any power of the count where a motion is smooth and
quasi-periodic. Where it is chaotic, or goes round a strange set, they converge like the root of the count at best. A
motion that has not settled drifts: its means go on in one direction.

Where a motion visits bands in turn, each is looked at by itself, in parts of its own extent.

References
----------
S. Das, Y. Saiki, E. Sander, J. A. Yorke, Quantitative quasiperiodicity, Nonlinearity 30 (2017) 4111-4140.
"""

from __future__ import annotations

import math
from itertools import combinations
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["STILL", "Course", "course_of", "is_rough", "weighted_mean"]

_BAND = 0.25  # largest extent of a band, over that of all points
_FEWEST = 48  # points of a band below which nothing is said
_FLAT = 1e-3  # extent of a state, over the largest one's, below which it is constant
# The length of a graph over the circle comes to an end when its points become more. That of a strange set grows with a
# power of their count. From these factors on it has none.
_LONGER = 2.0  # for 16 times as many points
STILL = 1.2  # for 4 times as many


class Course(NamedTuple):
    """How the means of a motion go.

    `error` is the difference of means over the halves of its points, in spreads, and `points` is their count; `drifts`
    says whether means go on in one direction.
    """

    error: float
    points: int
    drifts: bool

    @property
    def smooth(self) -> bool:
        """Whether means converge faster than those of a motion that goes round a curve with jumps."""
        return self.error * self.points <= 1.0


def weighted_mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return means along the first axis with the weights exp(-1 / (s (1 - s))), s from 0 to 1 along the values."""
    s = np.arange(1, len(values) + 1) / (len(values) + 1.0)
    weights = np.exp(-1.0 / (s * (1.0 - s)))
    return np.asarray(weights @ values / weights.sum())


def course_of(cloud: NDArray[np.float64]) -> Course:
    """Return how the means of states and of their products go along the points of a motion."""
    bands = _bands(cloud)
    if bands == 1:
        return _course(cloud)
    courses = [course_of(cloud[i::bands]) for i in range(bands)]
    worst = max(courses, key=lambda one: one.error * one.points)
    return Course(worst.error, worst.points, any(one.drifts for one in courses))


def _bands(cloud: NDArray[np.float64]) -> int:
    """Return the fewest bands that points visit in turn, each of them small; 1 where there are none.

    A motion stays in its bands. One that turns by nearly a fraction passes through what so few points take for one.
    """
    extent = np.ptp(cloud, axis=0)
    wide = extent > _FLAT * float(extent.max(initial=0.0))
    for count in range(2, len(cloud) // _FEWEST + 1):
        # the first points tell most counts that are none
        if all(
            np.all(np.ptp(part[i::count, wide], axis=0) <= _BAND * extent[wide])
            for part in (cloud[: 8 * count], cloud)
            for i in range(count)
        ) and all(_stays(cloud[i::count, wide]) for i in range(count)):
            return count
    return 1


def _stays(points: NDArray[np.float64]) -> bool:
    """Return whether points do not pass on: the middle of each of their halves lies within the range of the other."""
    extent = np.ptp(points, axis=0)
    moving = points[:, extent > _FLAT * float(extent.max())]
    halves = moving[: len(moving) // 2], moving[len(moving) // 2 :]
    return all(
        bool(np.all((a.min(axis=0) <= middle) & (middle <= a.max(axis=0))))
        for a, b in (halves, halves[::-1])
        for middle in (np.median(b, axis=0),)
    )


def _course(points: NDArray[np.float64]) -> Course:
    n = len(points)
    if n < _FEWEST:
        return Course(math.inf, n, drifts=False)
    values = _observed(points)
    change = weighted_mean(values[n // 2 :]) - weighted_mean(values[: n // 2])
    quarters = np.array([weighted_mean(part) for part in np.array_split(values, 4)])
    most = int(np.argmax(np.abs(change)))
    steps = np.diff(quarters[:, most])
    return Course(float(np.abs(change).max()), n, bool(np.all(steps > 0.0) or np.all(steps < 0.0)))


def _observed(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return states over their spread, and their products at a return and at neighbouring returns."""
    spread = points.std(axis=0)
    wide = spread > _FLAT * float(spread.max(initial=0.0))
    scaled = (points[:, wide] - points[:, wide].mean(axis=0)) / spread[wide]
    here, on = scaled[:-1], scaled[1:]
    products = [here[:, i] * here[:, j] for i in range(here.shape[1]) for j in range(i + 1)]
    return np.column_stack([here, *products, here * on, here**3])


def is_rough(cloud: NDArray[np.float64]) -> bool:
    """Return whether points go round a circle smoothly in two of the states, and are nowhere smooth over it in another.

    Over the circle a smooth graph has a length: neighbours come nearer as there are more. On a strange set they do not.
    """
    spread = cloud.std(axis=0)
    wide = np.flatnonzero(spread > _FLAT * float(spread.max(initial=0.0)))
    for i, j in combinations(wide.tolist(), 2):
        pair = cloud[:, [i, j]]
        radius = np.linalg.norm((pair - 0.5 * (pair.min(axis=0) + pair.max(axis=0))) / np.ptp(pair, axis=0), axis=1)
        if radius.min() < 0.25 or not _course(pair).smooth:
            continue
        centred = pair - pair.mean(axis=0)
        angles = np.arctan2(centred[:, 1], centred[:, 0])
        others = [k for k in wide.tolist() if k not in (i, j)]
        if any(_has_no_length(angles, cloud[:, k]) for k in others):
            return True
    return False


def _has_no_length(angles: NDArray[np.float64], heights: NDArray[np.float64]) -> bool:
    """Whether the graph of heights over angles becomes longer with its points, to the end."""
    n = len(angles)
    lengths = [float(np.abs(np.diff(heights[-m:][np.argsort(angles[-m:])])).sum()) for m in (n // 16, n // 4, n)]
    return lengths[2] >= _LONGER * lengths[0] > 0.0 and lengths[2] >= STILL * lengths[1]
