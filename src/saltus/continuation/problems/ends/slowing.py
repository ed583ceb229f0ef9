"""The grazing at which an event is met ever more slowly, sought directly where steps along the branch fail.

Where a segment's end loses its speed, its duration moves by far more than any state. The arclength, which is that of
the states, runs out just before. The grazing itself is a regular point of the equations and of the speed.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.core.monitor import Monitor
from saltus.continuation.core.zero_problem import Event, Point
from saltus.orbits.signature import EVENT_END
from saltus.scales import NEWTON_CONVERGED, ONE_VALUE

if TYPE_CHECKING:
    from saltus.continuation.problems.orbit import OrbitZeroProblem

__all__ = ["grazing_ahead"]

_ITERATIONS = 12  # Newton steps, at most
_SLOWED = 0.1  # speed of an event, over the largest on the branch, below which its zero is sought
_WITHIN = 3.0  # distance of the grazing, over that at which the speed's square vanishes by its last two values


def grazing_ahead(points: list[tuple[OrbitZeroProblem, Point]]) -> Event | None:
    """Return the grazing just ahead of a branch's last point, where an event loses its speed; None if there is none.

    The square of the speed vanishes linearly in the parameter.

    Parameters
    ----------
    points : list of (OrbitZeroProblem, Point)
        The points of the branch, behind the last of which no step succeeds.
    """
    if len(points) < 3:
        return None
    branch, last = points[-1]
    before = points[-2][1]
    if points[-2][0] is not branch or points[-3][0] is not branch:
        return None
    own = [np.abs(point.examined.data.survey.rates[:, 0]) for piece, point in points if piece is branch]
    near, far, top = own[-1], own[-2], np.max(own, axis=0)
    for segment, i in enumerate(branch.problem.signature.tails):
        if branch.problem.kinds[i] != EVENT_END or not (
            0.0 < near[i] < far[i] < own[-3][i] and near[i] < _SLOWED * top[i]
        ):
            continue
        found = _located(branch, before, last, i, float(near[i] / (far[i] - near[i])))
        ahead = (last.parameter - before.parameter) * float(near[i] ** 2 / (far[i] ** 2 - near[i] ** 2))
        if found is not None and abs(found.parameter - last.parameter) <= _WITHIN * abs(ahead) + ONE_VALUE:
            return Event(Monitor("rate", segment), found, 0.0)
    return None


def _located(branch: OrbitZeroProblem, before: Point, last: Point, segment: int, share: float) -> Point | None:
    """Return the point at which the speed of a segment's event vanishes, by Newton's method; None if there is none."""
    problem, u = branch.problem, last.u + share * (last.u - before.u)
    for _ in range(_ITERATIONS):
        F, J = branch.evaluate(u)
        value, gradient = problem.rate(u, segment)
        matrix, residual = np.vstack([J, gradient]), np.append(F, value)
        if not (np.all(np.isfinite(matrix)) and np.all(np.isfinite(residual))):
            return None
        try:
            step = np.linalg.solve(matrix, -residual)
        except np.linalg.LinAlgError:
            return None
        u = u + step
        if np.max(np.abs(step) / branch.scale()) < NEWTON_CONVERGED and branch.accurate():
            point = replace(last, u=u, J=branch.evaluate(u)[1])
            found = branch.examine(point, None)
            return None if found.data is None else replace(point, examined=found)
    return None
