"""The end of a branch of doubled period, at a period doubling of the orbit of the single period."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.core.locating import locate
from saltus.continuation.core.monitor import Monitor
from saltus.continuation.core.zero_problem import Event, Point, correct, start_point
from saltus.continuation.problems.orbit import OrbitZeroProblem
from saltus.orbits.cuts import in_shares
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.rounds import divided, rounds_of
from saltus.orbits.signature import CLOSED_END, PHASE_END
from saltus.orbits.stability.critical import Branching
from saltus.scales import DOUBLING_AT_HALVING, HALVES_PERHAPS

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["halved"]

_REACHES = (1e-3, 1e-2)  # arclengths, to both sides on the shorter orbit's branch, searched for the doubling


def halved(branch: OrbitZeroProblem, point: Point, points: list[tuple[OrbitZeroProblem, Point]]) -> Point | None:
    """Return a branch point at which the orbit repeats a shorter one, located as the shorter orbit's period doubling.

    At the branch point the equations of the doubled orbit are singular. The parameter turns there, so its place along
    the branch is known to half the digits only. The shorter orbit's branch passes the point regularly.

    The doubled branch leaves the point in the direction of the equations' null space in which no parameter changes.

    Parameters
    ----------
    branch : OrbitZeroProblem
        The branch of doubled period.
    point : Point
        The branch point, as located on it.
    points : list of tuple (OrbitZeroProblem, Point)
        The branch so far. Where its orbits repeat shorter ones too, no period halves at the point.

    Returns
    -------
    Point or None
        None where the orbit repeats no shorter one, or where the shorter one does not double its period.
    """
    short = divided(branch.problem, point.u, 2, HALVES_PERHAPS * branch.problem.state_scale)
    before = next((item for piece, item in reversed(points) if piece is branch and item is not point), None)
    if short is None or (before is not None and rounds_of(branch.problem, before.u) > 1):
        return None
    signature, u = short
    old = branch.problem
    problem = OrbitProblem(old.system, signature, old.p, old.active, old.scales, old.tol)
    problem.start(u, old.state_scale[: len(old.system.states)])  # a rest has no size of its own
    single = OrbitZeroProblem(problem, u, branch.interest)
    doubling = _doubling(single, u)
    if doubling is None or abs(doubling.point.parameter - point.parameter) > DOUBLING_AT_HALVING:
        return None
    u = _twice(problem, doubling.point.u)
    if old.signature.is_cut:
        u = in_shares(problem, doubling.point.u, old, point.u)
    old.start(u)
    J = branch.evaluate(u)[1]
    found = Point(u, J, _of_doubled(branch, u, J), point.weights, point.sign, point.log, 0.0, 1, point.arc)
    found.examined = branch.examine(found, None)
    return None if found.examined.data is None else found


def _doubling(branch: OrbitZeroProblem, u: NDArray[np.float64]) -> Event | None:
    """Return the period doubling of a branch near an orbit."""
    try:
        middle = start_point(branch, u)
    except ValueError:
        return None
    for reach in _REACHES:
        ends = []
        for sign in (-1.0, 1.0):
            end = correct(branch, middle.u + sign * reach * middle.tangent, middle.tangent, middle.weights, 7)
            if isinstance(end, str):
                return None
            end.arc = sign * reach
            end.examined = branch.examine(end, None)
            ends.append(end)
        values = [end.examined.monitors.get(Monitor("PD"), math.nan) for end in ends]
        if values[0] * values[1] < 0.0:
            return locate(branch, Monitor("PD"), ends[0], ends[1], *values)
    return None


def _of_doubled(branch: OrbitZeroProblem, u: NDArray[np.float64], J: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the tangent of the doubled branch at its branch point, of length 1."""
    condition = Branching(branch.problem, 0, u, J)
    condition.evaluate(u, np.zeros(1), J)
    first, second = condition.right
    direction = first * second[-1] - second * first[-1]
    return np.asarray(direction / math.sqrt(float(branch.metric(u) @ direction**2)))


def _twice(problem: OrbitProblem, u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the unknowns of an orbit over two periods."""
    n, signature = problem.n, problem.signature
    first = u[: problem.size].reshape(problem.segments, n + 1)
    if signature.kinds[0] in (PHASE_END, CLOSED_END):
        both = first.copy()
        both[0, n] *= 2.0
    else:
        second = first.copy()
        if problem.system.phase is not None:
            second[:, n - 1] += problem.system.turn * signature.turns
        both = np.vstack([first, second])
    return np.append(both, u[problem.size :])
