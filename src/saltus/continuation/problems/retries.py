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
        self.solved = False  # whether the end of a step was examined since a point was left
        self._doubtful = False  # whether a step from the point left last was rejected for what lies in it
        self._left: list[tuple[Point, Mapping[str, Any]]] = []

    def leave(self, point: Point) -> bool:
        """Take meshes and sizes back where a point is left again; return whether it is."""
        self._doubtful, self.solved = self.solved, False
        for known, kept in self._left:
            if known is point:
                self._problem.take(kept)
                return True
        self._doubtful = False
        self.keep(point)
        return False

    def rough(self, point: Point) -> bool:
        """Return whether a point just left is to be solved more exactly, since a looser tolerance cannot tell.

        It cannot where a step was solved and then rejected for what lies in it.
        """
        if self._doubtful:
            self._problem.tighten()
        data = point.examined.data
        return data is not None and data.tolerance > self._problem.tol

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
