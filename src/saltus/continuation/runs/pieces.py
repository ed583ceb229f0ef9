"""A branch goes on with its orbits cut into more pieces, in the same direction."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.core.zero_problem import Point, start_point
from saltus.continuation.problems.orbit import OrbitZeroProblem
from saltus.continuation.problems.phase_plane import transferred
from saltus.orbits.cuts import cut, cut_again, squeezed, started_elsewhere, stretched
from saltus.orbits.problem import OrbitProblem

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

__all__ = ["in_more_pieces"]


def in_more_pieces(
    branch: OrbitZeroProblem,
    item: Point,
    zero_problem: Callable[[OrbitProblem, NDArray[np.float64]], OrbitZeroProblem],
    *,
    most: int,
) -> tuple[OrbitZeroProblem, Point] | str | None:
    """Return equations and point of an orbit cut into more pieces, or started elsewhere; None where no cut is due.

    Where more pieces are needed than are allowed, this is told.

    Parameters
    ----------
    branch : OrbitZeroProblem
        The equations of the point.
    item : Point
        The point, with the direction of the branch.
    zero_problem : callable
        Returns the zero problem of segment equations near unknowns.
    most : int
        Most pieces.
    """
    elsewhere = again = None
    if branch.problem.relaxes and (stretched(branch.problem, item.J) or squeezed(branch.problem, item.u)):
        again = cut_again(branch.problem, item.u, item.J)
    if again is not None:
        problem, u = again
    elif stretched(branch.problem, item.J):
        elsewhere = started_elsewhere(branch.problem, item.u) if branch.problem.stiff else None
        problem, u = cut(branch.problem, item.u, item.J) if elsewhere is None else elsewhere
    else:
        return None
    if len(problem.signature) > most:
        return f"an orbit so unstable that it needs more than {most} pieces"
    finer = zero_problem(problem, u)
    try:
        point = start_point(finer, u)
    except ValueError:
        return None
    sense = math.copysign(1.0, _agreement(branch.problem, item, point.tangent, moved=elsewhere is not None))
    point = replace(point, tangent=sense * point.tangent, sign=sense * point.sign, arc=item.arc)
    point.examined = finer.examine(point, None)
    return finer, point


def _agreement(problem: OrbitProblem, item: Point, tangent: NDArray[np.float64], *, moved: bool) -> float:
    """Return the product of a point's tangent with that of its orbit in more pieces: positive in one direction.

    Period and parameter are compared, which no start changes. The first piece starts at the old place, perhaps in
    another phase plane, unless it is `moved` along the orbit. Its states are compared too, but rest where it is slow.
    """
    n, size = problem.n, problem.size
    period = float(item.u[n : size : n + 1].sum())
    slopes = [float(along[n : -1 : n + 1].sum()) / period for along in (item.tangent, tangent)]
    if moved:
        return slopes[0] * slopes[1] + float(item.tangent[-1] * tangent[-1])
    same = item.tangent.copy()
    same[:n], same[-1] = tangent[:n], tangent[-1]
    same = transferred(problem, item.u, same)
    own = np.append(np.arange(n), -1)
    return slopes[0] * slopes[1] + float((item.weights[own] * item.tangent[own]) @ same[own])
