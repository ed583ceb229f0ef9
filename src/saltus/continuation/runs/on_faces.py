"""Branches that start where states are 0 and stay there: they go on in this invariant plane."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.core.zero_problem import Point, correct
from saltus.system.faces import EXPONENTIAL, FACE

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.problems.orbit import OrbitZeroProblem

__all__ = ["within_faces"]


def within_faces(branch: OrbitZeroProblem, u: NDArray[np.float64], point: Point) -> Point:
    """Return the first point of a branch, its states and tangent 0 where those of its orbit are, by the formulas.

    Rounding would lead off the plane, and a multiplier of 1e60 across it does the rest.

    Parameters
    ----------
    branch : OrbitZeroProblem
        The equations.
    u : ndarray, shape (size + 1,)
        Unknowns of the orbit at which the branch starts.
    point : Point
        The point that was found from there.
    """
    problem, n = branch.problem, branch.problem.n
    starts = u[: problem.size].reshape(problem.segments, n + 1)[:, :n]
    still = np.all(starts == 0.0, axis=0) & np.isin(problem.system.compiled.kinds, (FACE, EXPONENTIAL))
    if not still.any():
        return point
    places = np.add.outer(np.arange(problem.segments) * (n + 1), np.flatnonzero(still)).ravel()
    within, along = point.u.copy(), point.tangent.copy()
    within[places] = along[places] = 0.0
    if np.any(branch.evaluate(within)[0][places] != 0.0):  # a reset leads off the plane
        return point
    length = math.sqrt(float(point.weights @ along**2))
    found = correct(branch, within, along / length, point.weights, 7) if length > 0.0 else ""
    return point if isinstance(found, str) else replace(found, arc=point.arc)
