"""Meshes and sizes with which a run left its last points, so that a step tried again starts from the same data.

A rejected step may have ended far away, on meshes and with sizes for the orbits there.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    import numpy as np
    from numpy.typing import NDArray

    from saltus.continuation.core.zero_problem import Point
    from saltus.continuation.problems.orbit import OrbitZeroProblem
    from saltus.orbits.problem import OrbitProblem

__all__ = ["Retries", "copied"]


class Retries:
    """The data of an orbit's equations at the last two points that steps left.

    Parameters
    ----------
    problem : OrbitProblem
        The equations.
    """

    def __init__(self, problem: OrbitProblem) -> None:
        self._problem = problem
        self._left: list[tuple[Point, Mapping[str, Any]]] = []

    def leave(self, point: Point) -> bool:
        """Take meshes and sizes back where a point is left again; return whether it is."""
        for known, kept in self._left:
            if known is point:
                self._problem.take(kept)
                return True
        self.keep(point)
        return False

    def keep(self, point: Point) -> None:
        """Keep the meshes and sizes of this moment as those of a point."""
        others = [pair for pair in self._left if pair[0] is not point]
        self._left = [*others[-1:], (point, self._problem.kept())]

    def stabilised(self, point: Point, u: NDArray[np.float64]) -> bool:
        """Shorten the steps of a stiff flow near a point with orbit `u` for stability; return whether they were."""
        shorter = self._problem.stabilise(u)
        if shorter:
            self.keep(point)
        return shorter


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
    examined = replace(point.examined, monitors=dict(point.examined.monitors))
    arrays = {name: getattr(point, name).copy() for name in ("u", "J", "tangent", "weights")}
    fresh, first = make(problem, arrays["u"]), replace(point, examined=examined, **arrays)
    fresh.like(branch, arrays["u"])
    return lambda: (fresh, first)
