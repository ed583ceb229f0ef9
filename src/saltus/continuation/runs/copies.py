"""The start of a branch, copied: its second direction begins from the same data as the first."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import NDArray

    from saltus.continuation.core.zero_problem import Point
    from saltus.continuation.problems.orbit import OrbitZeroProblem
    from saltus.orbits.problem import OrbitProblem

__all__ = ["copied", "fresh_point"]


def copied(
    branch: OrbitZeroProblem, point: Point, make: Callable[[OrbitProblem, NDArray[np.float64]], OrbitZeroProblem]
) -> Callable[[], tuple[OrbitZeroProblem, Point]]:
    """Return what gives equations and first point of a branch as they are now, whatever becomes of these.

    Parameters
    ----------
    branch, point : OrbitZeroProblem, Point
        The equations, and the first point, examined.
    make : callable
        Makes the zero problem of segment equations near unknowns.
    """
    problem = replace(branch.problem)
    problem.take(branch.problem.kept())
    problem.phase_plane = branch.problem.phase_plane.copy()
    first = fresh_point(point)
    fresh = make(problem, first.u)
    fresh.like(branch, first.u)
    return lambda: (fresh, first)


def fresh_point(point: Point) -> Point:
    """Return a point with arrays and monitor functions of its own."""
    found = copy(point)
    found.examined = replace(point.examined, monitors=dict(point.examined.monitors))
    found.u, found.J, found.tangent, found.weights = (
        array.copy() for array in (point.u, point.J, point.tangent, point.weights)
    )
    return found
