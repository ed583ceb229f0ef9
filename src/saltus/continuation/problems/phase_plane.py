"""The plane that fixes the phase of an autonomous cycle, moved along with the cycle.

docs/theory/continuation.md, "Pseudo-arclength", derives it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from saltus.algebraic.newton import REMESHED
from saltus.continuation.core.zero_problem import correct
from saltus.orbits.landing.upstrokes import ROUNDS, shows_last_step
from saltus.scales import SHARPER

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.core.zero_problem import Point, ZeroProblem
    from saltus.orbits.problem import OrbitProblem

__all__ = ["astray", "depart", "log_of_crossings", "sharpen", "solve_again", "transferred"]

_ASTRAY = 0.3  # least cosine of the angle between flow and plane's normal at the end of a step
_RENEWED = 0.8  # the same cosine, up to which the plane is renewed before the next step


def astray(problem: OrbitProblem, u: NDArray[np.float64]) -> str | None:
    """Return the reason if the flow has nearly turned into the plane, so the step to a point is too long; else None.

    Where the plane is tangent to the flow, the equations have a fold and all determinants vanish. The orbits have no
    bifurcation there.
    """
    if not problem.slides or float(problem.facings(u).min()) > _ASTRAY:
        return None
    return "phase: the flow at the orbit's start turns too far within the step"


def depart(
    zero: ZeroProblem,
    problem: OrbitProblem,
    u: NDArray[np.float64],
    point: Point,
    turn: Callable[[NDArray[np.float64]], None] | None = None,
) -> bool:
    """Give `problem` the phase plane of a point with orbit `u`; return whether the plane was renewed.

    With the plane, Jacobian, tangent and determinant of the point are renewed. Before the plane becomes another one,
    `turn` is called with `u`.
    """
    if not problem.slides:
        return False
    if point.frame is not None:
        if turn is not None and point.frame is not problem.phase_plane:
            turn(u)
        problem.phase_plane = point.frame
        if problem.facings(u).min() > _RENEWED:
            return False
    from saltus.system.numba_tools.linear import bordered

    if turn is not None:
        turn(u)
    problem.fix_phase(u, problem.survey(u), cuts=problem.relaxes)
    point.frame = problem.phase_plane
    F, point.J = zero.evaluate(point.u)
    for _ in range(REMESHED if problem.relaxes else 0):
        if zero.accurate():  # a mesh that is too coarse for the sensitivities of long pieces is made finer
            break
        F, point.J = zero.evaluate(point.u)
    row = point.weights * transferred(problem, u, point.tangent)
    steps, point.sign, point.log, _, _ = bordered(point.J, F, row, point.u, point.u, zero.scale())
    point.tangent = steps[:, 1] / math.sqrt(float(point.weights @ steps[:, 1] ** 2))
    return True


def log_of_crossings(problem: OrbitProblem, u: NDArray[np.float64]) -> float:
    """Return the logarithm of the product of the flow's speeds across the planes of further pieces; 0 without any.

    It is a factor of each determinant of the equations, in which these planes take the place of shares of the period.
    """
    planes = problem.phase_plane.reshape(-1, 2, problem.n)
    if len(planes) == 1:
        return 0.0
    speeds = np.sum(planes[1:, 1] * problem.flows_at_starts(u)[1:], axis=1)
    return float(np.log(np.maximum(np.abs(speeds), 1e-300)).sum())


def transferred(problem: OrbitProblem, u: NDArray[np.float64], tangent: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a tangent of cycles, known in another phase plane, as it is in that of `problem`.

    It is known up to a shift of the starts along the flow, which changes neither the period nor parameters. In the
    planes it is therefore the same tangent, and the sense of a branch does not depend on where cycles start. Where only
    the first piece has a plane all starts are shifted by one time. Otherwise durations change by the differences.

    Parameters
    ----------
    problem : OrbitProblem
        The equations, with the plane.
    u : ndarray, shape (size + active,)
        The cycle.
    tangent : ndarray, shape (size,) or longer
        The tangent; further unknowns stay as they are.
    """
    if not problem.slides:
        return tangent
    n, moved = problem.n, tangent.copy()
    rows = moved[: problem.size].reshape(problem.segments, n + 1)
    starts, flows, planes = rows[:, :n], problem.flows_at_starts(u), problem.phase_plane.reshape(-1, 2, n)
    if len(planes) == 1:
        starts -= float(planes[0, 1] @ starts[0]) / float(planes[0, 1] @ flows[0]) * flows
        return moved
    late = np.sum(planes[:, 1] * starts, axis=1) / np.sum(planes[:, 1] * flows, axis=1)
    starts -= late[:, None] * flows
    rows[:, n] += late - np.roll(late, -1)
    return moved


def solve_again(zero: ZeroProblem, problem: OrbitProblem, point: Point, u: NDArray[np.float64]) -> str | None:
    """Solve a point again on new meshes for its orbit `u`, in the same phase plane; return why that failed, or None."""
    plane = problem.phase_plane
    problem.start(u)
    problem.phase_plane = plane
    better = correct(zero, point.u, point.tangent, point.weights, 7)
    if isinstance(better, str):
        return better
    point.u, point.J, point.tangent = better.u, better.J, better.tangent
    point.sign, point.log, point.residual = better.sign, better.log, better.residual
    return None


def sharpen(zero: ZeroProblem, problem: OrbitProblem, point: Point) -> None:
    """Correct an orbit in pieces once more, since the error of the last Newton step shows in its multipliers.

    Where a surface is met so fast that this error shows there, it is corrected down to rounding.
    """
    cut = problem.signature.is_cut
    if not (cut or shows_last_step(problem, point.u, point.J)):
        return
    from saltus.system.numba_tools.linear import bordered

    row, before, carried = point.weights * point.tangent, SHARPER, getattr(zero, "carried", None)
    for _ in range(1 if cut else ROUNDS):
        F, J = zero.evaluate(point.u)
        if not cut and carried is not None and (further := carried(point.u, J)) is not None:
            point.u = further
            F, J = zero.evaluate(further)
        steps, sign, log, size, residual = bordered(J, F, row, point.u, point.u, zero.scale())
        if not (size < before and math.isfinite(log)):
            return
        point.u, point.J, point.residual, before = point.u + steps[:, 0], J, residual, size
        point.tangent = steps[:, 1] / math.sqrt(float(point.weights @ steps[:, 1] ** 2))
        point.sign, point.log = sign, log
