"""Meshes and sizes with which a run left its last points, so that a step tried again starts from the same data.

A rejected step may have ended far away, on meshes and with sizes for the orbits there.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np
    from numpy.typing import NDArray

    from saltus.continuation.core.zero_problem import Point
    from saltus.orbits.problem import OrbitProblem

__all__ = ["Retries"]


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
