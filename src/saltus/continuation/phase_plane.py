"""The plane that fixes the phase of an autonomous cycle, moved along with the cycle."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from saltus.continuation.zero_problem import Point, ZeroProblem
    from saltus.orbits.problem import OrbitProblem

__all__ = ["astray", "depart"]

_ASTRAY = 0.3  # cosine of the angle between the flow and the plane's normal below which a step is too long
_RENEWED = 0.8  # the same below which the plane is laid anew before the next step


def astray(problem: OrbitProblem, u: NDArray[np.float64]) -> str | None:
    """Return why a point may not follow the one before, where the flow has nearly turned into the plane.

    A plane that is tangent to the flow makes a turning point, and zeros of all determinants, where the orbit has none.
    """
    facing = problem.facing(u)
    return None if facing > _ASTRAY else "phase: the flow at the orbit's start turns too far within the step"


def depart(zero: ZeroProblem, problem: OrbitProblem, u: NDArray[np.float64], point: Point) -> bool:
    """Make the phase condition of `problem` that of a point, whose orbit is `u`; return whether it was laid anew.

    Where it was, Jacobian, tangent and determinant of the point are renewed, too.
    """
    if not problem.slides:
        return False
    if point.frame is not None:
        problem.phase_plane = point.frame
        if problem.facing(u) > _RENEWED:
            return False
    from saltus.flow._linear_kernels import bordered

    problem.fix_phase(u, problem.survey(u))
    point.frame = problem.phase_plane
    F, point.J = zero.evaluate(point.u)
    row = point.weights * point.tangent
    steps, point.sign, point.log, _, _ = bordered(point.J, F, row, point.u, point.u, zero.scale())
    point.tangent = steps[:, 1] / math.sqrt(float(point.weights @ steps[:, 1] ** 2))
    return True
