"""Closed curves on which the points of a motion lie, how many are visited in turn, and the turns round them.

Points on a closed curve are recognised from their middle, in the plane in which they spread most. No gap between
neighbours is wider than `Criteria.gap`. The map keeps their order round the curve, but for a part `Criteria.disorder`
of the way that their images go.

A circle on the section may be cut by a reset, as that of a neuron's firing is. It then lies along one state. Its points
are recognised where the map keeps their order along this state, but for whole turns.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.flow.recurring.recurrence import extent_of
from saltus.flow.recurring.smoothness import STILL, weighted_mean

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.flow.recurring.criteria import Criteria

__all__ = ["cut_circle", "has_length", "locked_turns", "rotation_number"]

_SMALLEST = 1e-3  # spread of a state, over the largest one's, below which it is constant
_ENOUGH = 16  # fewest points whose order round a curve is looked at: fewer lie too far apart, unless they recur
_BACKWARDS = 0.01  # most disorder of points on a circle that is cut: the firing maps of neurons have none
_NEIGHBOURS = (
    0.8  # least share of points on a curve whose nearest one is as many returns away: of any nine, 1e-4 have it
)
_FRACTION = 1e-4  # distance of a rotation number from a fraction below which points may lie on several curves


def locked_turns(cloud: NDArray[np.float64], limits: Criteria, period: int) -> tuple[float, int]:
    """Return the turns in a return round a closed curve of a motion that recurs, a fraction, and how many curves.

    NaN and 0 where it has not more than `Criteria.longest` returns, doublings apart, or winds round no curve. Only its
    last returns are looked at, so that the answer does not depend on their count.
    """
    base = _base(cloud, period, limits)
    if base <= limits.longest:
        return math.nan, 0
    rounds = np.tile(cloud[-period:], (2, 1))
    rotation, curves = rotation_number(rounds, limits, period)
    if curves:
        return round(rotation * (period // curves)) / (period // curves), curves
    places = _places_on(cloud[-period:].reshape(-1, base, cloud.shape[1]).mean(axis=0))
    return (places / base, 1) if places else (math.nan, 0)


def _places_on(points: NDArray[np.float64]) -> int:
    """Return by how many places round a closed curve a point's image is on, of a motion that recurs; 0 without a curve.

    On a curve, however it is bent, the nearest of the other points is a neighbour: for most of them the one that is a
    fixed count of returns earlier or later.
    """
    n = len(points)
    size = np.ptp(points, axis=0)
    scaled = points[:, size > 0.0] / size[size > 0.0]
    apart = np.linalg.norm(scaled[:, None] - scaled[None], axis=2)
    np.fill_diagonal(apart, math.inf)
    later = (np.argmin(apart, axis=1) - np.arange(n)) % n
    counts = np.bincount(np.minimum(later, n - later), minlength=n // 2 + 1)
    count = int(np.argmax(counts))
    if counts[count] < _NEIGHBOURS * n or math.gcd(count, n) > 1 or scaled.shape[1] < 2:
        return 0
    places = pow(count, -1, n)
    return min(places, n - places)


def rotation_number(cloud: NDArray[np.float64], limits: Criteria, period: int = 0) -> tuple[float, int]:
    """Return the turns in a return round a closed curve, and how many curves are visited in turn.

    The points are seen from their middle, in the plane in which they spread most; the mean of their angles' increments
    is weighted so that it converges faster than any power of their count where the motion is quasi-periodic.

    Parameters
    ----------
    cloud : ndarray, shape (return, state)
        States on the section.
    limits : Criteria
        What a closed curve is: `gap` and `disorder`; and how many curves there are at most, `longest`.
    period : int, optional
        Returns after which the points recur, 0 where they do not.

    Returns
    -------
    rotation : float
        Between 0 and 1/2, the side from which the curve is seen being left open; NaN where there is no closed curve.
        With several curves, the turns round one of them in as many returns.
    curves : int
        0 where there is none.

    References
    ----------
    S. Das, Y. Saiki, E. Sander, J. A. Yorke, Quantitative quasiperiodicity, Nonlinearity 30 (2017) 4111-4140.
    """
    first: tuple[float, int] = (math.nan, 0)
    wanted = list(range(1, limits.longest + 1)) if cloud.shape[1] > 1 else []
    tried: set[int] = set()
    while wanted:
        curves = wanted.pop(0)
        tried.add(curves)
        if period and (period % curves or period // curves <= limits.longest):
            continue  # too few points on each curve to tell one
        distinct = period // curves
        if found := _turns_of_each(cloud, curves, limits, distinct):
            rotation = float(np.mean(found))
            parts = rotation * np.arange(1, limits.longest + 1)
            as_good_as = np.flatnonzero(np.abs(parts - np.round(parts)) < _FRACTION)
            if not as_good_as.size:
                return rotation, curves
            if not first[1]:
                first = (rotation, curves)
            # as good as a fraction: every curve, or every second, third ..., seen from the middle of them all
            parts_seen = int(as_good_as[0] + 1)
            counts = {parts_seen * i for i in range(1, curves + 1) if curves % i == 0}
            wanted = sorted(count for count in counts - tried if count <= limits.longest)
    return first


def _turns_of_each(cloud: NDArray[np.float64], curves: int, limits: Criteria, distinct: int) -> list[float]:
    """Turns round each of so many curves that are visited in turn; empty where one of them is not closed."""
    found = []
    for i in range(curves):
        turns = _turns(cloud[i::curves], limits, distinct)
        if turns is None:
            return []
        found.append(turns)
    return found


def _turns(points: NDArray[np.float64], limits: Criteria, distinct: int) -> float | None:
    """Turns in a step round one closed curve, None where the points do not show one; `distinct` of them, 0 for all."""
    spread = points.std(axis=0) if len(points) > 2 else np.zeros(1)
    wide = spread > _SMALLEST * spread.max() if spread.max() > 0.0 else spread > 0.0
    if wide.sum() < 2 or (len(points) < _ENOUGH and not distinct):
        return None
    scaled = (points - points.mean(axis=0))[:, wide] / spread[wide]
    plane = np.linalg.svd(scaled, full_matrices=False)[2][:2]
    angles = np.arctan2(scaled @ plane[1], scaled @ plane[0]) / (2.0 * math.pi)
    ordered = np.sort(angles[-distinct:])
    if max(float(np.diff(ordered).max(initial=0.0)), ordered[0] + 1.0 - ordered[-1]) > limits.gap:
        return None
    if _disorder(angles[-distinct:]) > limits.disorder:
        return None
    increments = np.diff(angles)
    # each increment is known up to whole turns: all are taken from the one turn about their mean direction
    mean = np.angle(np.exp(2j * math.pi * increments).sum()) / (2.0 * math.pi)
    increments = mean + (increments - mean + 0.5) % 1.0 - 0.5
    turns = float(weighted_mean(increments)) % 1.0
    return float(min(turns, 1.0 - turns))


def has_length(cloud: NDArray[np.float64], curves: int) -> bool:
    """Return whether points on curves, in their order round them, have a length that more points do not change.

    A strange set over a circle has its order, and no length.
    """
    for i in range(curves):
        points = cloud[i::curves]
        spread = points.std(axis=0)
        wide = spread > _SMALLEST * spread.max()
        scaled = (points - points.mean(axis=0))[:, wide] / spread[wide]
        plane = np.linalg.svd(scaled, full_matrices=False)[2][:2]
        places = np.arctan2(scaled @ plane[1], scaled @ plane[0]) if wide.sum() > 1 else scaled[:, 0]
        lengths = [
            float(np.abs(np.diff(scaled[-count:][np.argsort(places[-count:])], axis=0)).sum())
            for count in (len(points) // 4, len(points))
        ]
        if lengths[1] > STILL * lengths[0]:
            return False
    return True


def cut_circle(cloud: NDArray[np.float64]) -> tuple[float, int]:
    """Rotation number, and 1, where the points lie on a circle that a reset has cut; NaN and 0 where they do not.

    The circle then lies along one of the states, its ends being one place. A map that keeps the order of the points
    round it is invertible there, and not chaotic.
    """
    if len(cloud) < _ENOUGH:
        return math.nan, 0
    for column in cloud.T[np.ptp(cloud, axis=0) > 0.0]:
        angles = np.argsort(np.argsort(column, kind="stable"), kind="stable") / column.size
        if _disorder(angles) <= _BACKWARDS:
            turns = float(weighted_mean(np.diff(angles) % 1.0)) % 1.0
            return min(turns, 1.0 - turns), 1
    return math.nan, 0


def _disorder(angles: NDArray[np.float64]) -> float:
    """Part of the way backwards when the points are gone through round the curve and their images are watched."""
    images = angles[1:][np.argsort(angles[:-1], kind="stable")]
    steps = (np.diff(np.append(images, images[0])) + 0.5) % 1.0 - 0.5
    backwards = min(float(-steps[steps < 0.0].sum()), float(steps[steps > 0.0].sum()))
    return backwards / max(float(np.abs(steps).sum()), 1e-300)


def _base(cloud: NDArray[np.float64], period: int, limits: Criteria) -> int:
    """The period before its doublings."""
    points = cloud[-period:]
    extent = max(extent_of(points), 1e-300)
    base = period
    while base % 2 == 0 and base > limits.longest:
        turned = np.roll(points, base // 2, axis=0)
        if float(np.max(np.abs(turned - points))) > limits.doubling * extent:
            break
        base //= 2
    return base
