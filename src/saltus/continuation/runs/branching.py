"""Steps from a special point onto another branch, of equilibria or of orbits of a map.

docs/theory/equilibria.md, "Other branches", derives the directions.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.algebraic.newton import state_sizes, without_rounding
from saltus.continuation.core.germ import Germ
from saltus.continuation.core.interest import Interest
from saltus.continuation.core.multiple import branches_at, crossing, equation_sizes
from saltus.continuation.core.zero_problem import Point, correct
from saltus.errors import ConvergenceError, InputError
from saltus.scales import DIRECTIONS_ALIKE, SINGULAR_AT_POINT

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.algebraic.protocol import AlgebraicProblem
    from saltus.continuation.problems.algebraic import AlgebraicZeroProblem

__all__ = ["everywhere", "other_branches", "parameter_scale", "stepped"]

_SHIFTS = (1e-3, 1e-4, 1e-5, 1e-2)  # changes of the parameter by a first step, over the one that alters the Jacobian
_ITERATIONS = 12  # most Newton steps to a first solution

NONE_REAL = "no other real branch meets there: an eigenvalue touches 0"


def everywhere(scale: float) -> Interest:
    """Return no bounds and no events, of a parameter in the given unit."""
    return Interest(-math.inf, math.inf, scale)


def parameter_scale(
    problem: AlgebraicProblem, u: NDArray[np.float64], known: NDArray[np.float64] | None = None
) -> float:
    """Return the change of the parameter that alters the Jacobian by its own size, along the branch.

    A Jacobian may vanish as a whole, as at a branch point of one state. It then has the size of its change over `known`
    sizes of the unknowns, the same to both sides as at a pitchfork, or not.
    """
    n = problem.n
    J = problem.evaluate(u)[1]
    known = state_sizes(problem, u, J) if known is None else known
    sizes = np.maximum(known, 1e-300)
    moved = np.linalg.lstsq(J[:, :n], -J[:, n], rcond=1e-8)[0]
    ways = [np.append(moved, 1.0), np.append(known, 0.0)]
    change, *bend = (problem.second(u, way)[:, :n] for way in ways)
    own, by_parameter, *rest = (
        float(np.linalg.norm(part * sizes / sizes[:, None])) for part in (J[:, :n], change, *bend)
    )
    bent, value = max(rest), abs(float(u[n]))
    even = _even(problem, u, J, sizes)
    # what is 0 there is known to the error of the point, and what is bent by as much to the root of that
    if own < SINGULAR_AT_POINT * even and bent < math.sqrt(SINGULAR_AT_POINT) * even and own + bent > 0.0:
        by_parameter = float(np.linalg.norm(problem.second(u, np.eye(n + 1)[n])[:, :n] * sizes / sizes[:, None]))
        bent = even
    own = max(own, bent)
    scale = own / by_parameter if own > 0.0 and by_parameter > 0.0 else value or 1.0
    return _by_change(problem, u, J, sizes, own, scale) if own > 0.0 else scale


def _by_change(
    problem: AlgebraicProblem,
    u: NDArray[np.float64],
    J: NDArray[np.float64],
    sizes: NDArray[np.float64],
    own: float,
    scale: float,
) -> float:
    """Return a change of the parameter, or where it alters the Jacobian far too much or little that which does not.

    An eigenvalue that touches 0 there does not change to first order.
    """
    n = problem.n

    def change(by: float) -> float:
        way = np.append(np.zeros(n), by)
        with np.errstate(all="ignore"):
            moved = [problem.evaluate(u + side * way)[1][:, :n] - J[:, :n] for side in (-1.0, 1.0)]
            found = max(float(np.linalg.norm(part * sizes / sizes[:, None])) for part in moved)
        return found if not math.isnan(found) else math.inf

    if SINGULAR_AT_POINT * own <= (known := change(scale)) <= own / SINGULAR_AT_POINT or known == 0.0:
        return scale
    factor, far = (0.5, known > own) if known > own else (2.0, False)
    for _ in range(300):
        scale *= factor
        if (change(scale) > own) != far:
            break
    return scale


def _even(
    problem: AlgebraicProblem, u: NDArray[np.float64], J: NDArray[np.float64], sizes: NDArray[np.float64]
) -> float:
    """Return by how much the Jacobian changes alike to both sides, over the sizes; 0 where it has no value there."""
    n, way = problem.n, np.append(sizes, 0.0)
    with np.errstate(all="ignore"):
        beside = sum(problem.evaluate(u + side * way)[1][:, :n] for side in (-0.5, 0.5))
        change = float(np.linalg.norm((0.5 * beside - J[:, :n]) * sizes / sizes[:, None]))
    return change if math.isfinite(change) else 0.0


def other_branches(
    problem: AlgebraicProblem,
    u: NDArray[np.float64],
    tangent: NDArray[np.float64] | None,
    zero_problem: type[AlgebraicZeroProblem],
    known: NDArray[np.float64] | None = None,
) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Return a solution of each other branch at a branch point, a short step from the point, and sizes, (n,).

    Parameters
    ----------
    problem : AlgebraicProblem
        The equations, one parameter active in unit 1; its unit is chosen here.
    u : ndarray, shape (n + 1,)
        The branch point, located.
    tangent : ndarray, shape (n + 1,), or None
        Tangent of the point's own branch.
    zero_problem : type
        How the equations are followed.
    known : ndarray, shape (n,), optional
        Sizes of the unknowns along the point's own branch.

    Raises
    ------
    InputError
        The point has no branch of its own.
    ConvergenceError
        No solution of the other branch was found.
    """
    if tangent is None:
        raise InputError("point", "a BP without tangent", "a branch point of a branch")
    n, scale = problem.n, parameter_scale(problem, u, known)
    problem.scales[0], u = scale, np.append(u[:n], u[n] / scale)
    J = problem.evaluate(u)[1]
    sizes = np.append(state_sizes(problem, u, J) if known is None else known, 1.0)
    rows = 1.0 / equation_sizes(problem.evaluate, u, J, sizes)
    left, values, right = np.linalg.svd(J * sizes * rows[:, None])
    if crossing(values) > 1:
        own = np.append(tangent[:n], tangent[n] / scale)
        several = branches_at(problem.evaluate, u, sizes, own, "other branch")
        return [(found, np.maximum(sizes[:n], np.abs(found[:n]))) for found in several]
    w = left[:, -1] * rows
    first, second = right[-1] * sizes, right[-2] * sizes
    bend = [w @ problem.second(u, v) for v in (first, second)]
    a, b, c = float(bend[0] @ first), float(bend[0] @ second), float(bend[1] @ second)
    along = np.append(tangent[:n], tangent[n] / scale)
    ways = np.abs(along[:n]) / sizes[:n]
    # how far the parameter goes where the unknowns along the branch move by their sizes
    reach = min(1.0, abs(float(along[n])) / float(ways.max())) if np.any(ways > 0.0) else 1.0
    germ = Germ(problem.evaluate, u, np.append(sizes[:n], reach or 1.0), along)
    if germ.degenerates(
        lambda v, other: problem.second(u, v) @ other, lambda *ways: problem.third(u, *(way[:n].copy() for way in ways))
    ):
        return _by_circles(germ, sizes)
    far = -(b + math.copysign(math.sqrt(max(b * b - a * c, 0.0)), b))
    directions = [x * first + y * second for x, y in ((far, a), (c, far)) if (x, y) != (0.0, 0.0)]
    own = np.append(tangent[:n], tangent[n] / scale) / sizes
    likeness = [abs(float(own @ (d / sizes))) / float(np.linalg.norm(own) * np.linalg.norm(d / sizes))
                for d in directions]  # fmt: skip
    if not likeness or min(likeness) > 1.0 - DIRECTIONS_ALIKE:
        return _by_circles(germ, sizes)
    chosen = directions[int(np.argmin(likeness))]
    chosen = chosen / float(np.linalg.norm(chosen / sizes))
    third = w @ problem.third(u, *(3 * [chosen[:n].copy()]))
    pull = abs(float(w @ problem.second(u, np.append(own * sizes, [])) @ chosen)) or 1.0
    reason = ""
    for share in _SHIFTS:
        # a step that moves the parameter by that share: linearly, or by its square where the branch is tangent
        steps = [share / abs(chosen[n]) if abs(chosen[n]) > 1e-6 else math.inf]
        steps += [math.sqrt(share * pull / abs(float(third)))] if float(third) != 0.0 else []
        steps += [math.sqrt(share)]  # third derivatives may vanish: no step is longer, in sizes of the unknowns
        found = stepped(zero_problem(problem, sizes[:n], everywhere(scale)), u, min(steps) * chosen, sizes[:n])
        if not isinstance(found, str):
            found = without_rounding(problem, found, sizes[:n])
            return [(found, np.maximum(sizes[:n], np.abs(found[:n])))]
        reason = found
    raise ConvergenceError("other branch", _SHIFTS[0], len(_SHIFTS), reason)


def _by_circles(germ: Germ, sizes: NDArray[np.float64]) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Return what `other_branches` does where the bifurcation equation has no two directions to second order."""
    found = germ.curves("other branch")
    if not found:
        raise ConvergenceError("other branch", 0.0, 0, NONE_REAL)
    return [(v, np.maximum(sizes[:-1], np.abs(v[:-1]))) for v in found]


def stepped(
    branch: AlgebraicZeroProblem, u: NDArray[np.float64], step: NDArray[np.float64], sizes: NDArray[np.float64]
) -> NDArray[np.float64] | str:
    """Return the solution near `u + step`, corrected normally to the step, or why there is none."""
    weights = np.append(1.0 / sizes**2, 1.0)
    length = math.sqrt(float(weights @ step**2))
    point = correct(branch, u + step, step / length, weights, _ITERATIONS)
    if not isinstance(point, Point):
        return point
    if math.sqrt(float(weights @ (point.u - u - step) ** 2)) > 0.5 * length:
        return "the other branch bends too sharply"
    return point.u
