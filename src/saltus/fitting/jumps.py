"""Jumps in data: where they are, and which end of a sheet each belongs to."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from saltus import checks
from saltus.continuation.core.point_types import CHANGES
from saltus.continuation.results.sheets import MOVING, Sheet
from saltus.errors import InputError
from saltus.fitting.measured import Measured, MeasuredPoint

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation import Branch, SpecialPoint

__all__ = ["DOWN", "beyond", "jumps_in", "point_near", "read_points"]

_LEAST = 10.0  # least change of the data at a jump, in standard errors
_STEEP = 3.0  # change at a jump over the largest of the changes around it, at least
_AROUND = 2  # changes on each side that are compared
UP = "up"  # the way on which the parameter grows
DOWN = "down"  # the way on which it falls
_SIGNS = {UP: 1.0, DOWN: -1.0, "retract": 1.0, "approach": -1.0}  # the parameter may be a distance
_NAMES = {1.0: UP, -1.0: DOWN}


def jumps_in(measured: Measured, reach: float = 0.0) -> list[MeasuredPoint]:
    """Return the jumps in data: steps between neighbours on one way that are much larger than those around them.

    The jump is between both data. Its value is the middle, its standard error that of an equal distribution.

    Parameters
    ----------
    measured : Measured
        The data. Those of one direction are taken as one way.
    reach : float, optional
        How far behind a jump its fold may lie.

    Returns
    -------
    list of MeasuredPoint
        Folds, with the way on which each was passed.
    """
    found = []
    for name in dict.fromkeys(measured.direction):
        rows = np.flatnonzero([way == name for way in measured.direction])
        sign = _sign_of(name, measured.x[rows])
        if not sign:
            continue
        rows = rows[np.argsort(sign * measured.x[rows], kind="stable")]
        steps = _steps(measured, rows)
        for k, step in enumerate(steps):
            near = np.concatenate([steps[max(0, k - _AROUND) : k], steps[k + 1 : k + 1 + _AROUND]])
            if step > _LEAST and near.size and step > _STEEP * float(np.max(near)):
                a, b = float(measured.x[rows[k]]), float(measured.x[rows[k + 1]])
                if a != b:
                    way = UP if sign > 0.0 else DOWN
                    found.append(MeasuredPoint("SN", 0.5 * (a + b), abs(b - a) / math.sqrt(12.0), way, reach))
    return found


def _sign_of(name: str, x: NDArray[np.float64]) -> float:
    """Return whether the parameter grows or falls on a way: by its name, else by the order of its data; 0 for none."""
    if name in _SIGNS:
        return _SIGNS[name]
    steps = np.sign(np.diff(x))
    return float(steps[0]) if steps.size and np.all(steps == steps[0]) else 0.0


def _steps(measured: Measured, rows: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the changes of the data between neighbours, in standard errors, shape (rows - 1,)."""
    total = np.zeros(len(rows) - 1)
    for channel in measured.channels:
        away = np.diff(channel.values[rows])
        if channel.turn:
            away = away - channel.turn * np.round(away / channel.turn)
        total += (np.abs(away) / np.hypot(channel.sigma[rows[:-1]], channel.sigma[rows[1:]])) ** 2
    return np.asarray(np.sqrt(total))


def read_points(
    given: object, measured: Measured, bounds: tuple[float, float], reach: float = 0.0
) -> list[MeasuredPoint]:
    """Return measured special points: those given, or the jumps in the data with a reach.

    Raises
    ------
    InputError
        Neither a bool nor measured points; a type that does not move; a value out of the range.
    """
    if isinstance(given, bool):
        if given and not any(measured.direction):
            raise InputError(
                "jumps", True, "jumps that the data show", "the column 'direction' says which way each datum was on"
            )
        return jumps_in(measured, reach) if given else []
    points = []
    for one in checks.listed("jumps", given, "True, False or several saltus.fitting.MeasuredPoint"):
        point = checks.instance("jumps", one, MeasuredPoint)
        checks.chosen("type", point.type, MOVING)
        checks.between("value of a measured point", point.value, *bounds)
        checks.positive("sigma of a measured point", point.sigma)
        checks.chosen("direction", point.direction, ("", *_SIGNS))
        point = point._replace(direction=_NAMES.get(_SIGNS.get(point.direction, 0.0), ""))
        if checks.non_negative("reach of a measured point", point.reach) and not point.direction:
            raise InputError(
                "reach of a measured point",
                point.reach,
                "0 without a direction",
                "name the way: up, down, approach or retract",
            )
        points.append(point)
    return points


def beyond(point: MeasuredPoint, place: float) -> tuple[float, float]:
    """Return by how much a model's special point lies off a measured one, and the derivative: 0 within the reach.

    A jump comes at its fold or before: the fold lies at the jump, or behind it on the way by the reach at most.

    Examples
    --------
    >>> jump = MeasuredPoint("SN", 2.0, 0.1, "down", 0.5)
    >>> [round(beyond(jump, place)[0], 3) for place in (2.1, 1.8, 1.4)]
    [0.1, 0.0, -0.1]
    """
    away = place - point.value
    low, high = (-point.reach, 0.0) if point.direction == DOWN else (0.0, point.reach)
    nearest = min(max(away, low), high)
    return away - nearest, float(nearest in (low, high))


def point_near(point: MeasuredPoint, sheets: Sequence[Sheet], branches: Sequence[Branch]) -> SpecialPoint | None:
    """Return the model's special point that a measured one belongs to: the nearest of its type.

    A jump belongs to an end of a stable sheet: an upper end where the parameter grows, a lower one where it falls. A
    grazing may leave the motion stable, so that it need not be an end.

    Parameters
    ----------
    point : MeasuredPoint
        The measured point.
    sheets : sequence of Sheet
        Stable sheets.
    branches : sequence of Branch
        Their branches, for points on no end of a sheet.
    """
    if point.direction and point.type not in CHANGES:
        ends = [sheet.ends[point.direction == UP] for sheet in sheets]
        found = [end for end in ends if end is not None and end.type not in CHANGES]
    else:
        found = [one for branch in branches for one in branch.special_points.of_type(point.type)]
    return min(found, key=lambda one: abs(one.value(one.varied[0]) - point.value), default=None)
