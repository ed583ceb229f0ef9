"""Steps from a special point onto another branch, of equilibria or of orbits of a map.

docs/theory/equilibria.md, "Other branches", derives the directions.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.algebraic.newton import state_sizes, without_rounding
from saltus.continuation.core.interest import Interest
from saltus.continuation.core.multiple import branches_at, crossing
from saltus.continuation.core.zero_problem import Point, correct
from saltus.errors import ConvergenceError, InputError
from saltus.scales import DIRECTIONS_ALIKE, EPS, TERMS_FAINT

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.algebraic.protocol import AlgebraicProblem
    from saltus.continuation.problems.algebraic import AlgebraicZeroProblem

__all__ = ["everywhere", "other_branches", "parameter_scale", "stepped"]

_SHIFTS = (1e-3, 1e-4, 1e-5, 1e-2)  # changes of the parameter by a first step, over the one that alters the Jacobian
_ITERATIONS = 12  # most Newton steps to a first solution


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
    own, value = max([own, *rest]), abs(float(u[n]))
    if 0.0 < own < math.sqrt(EPS) * (even := _even(problem, u, J, sizes)):  # rounding of what is 0 there
        own = even
    return own / by_parameter if own > 0.0 and by_parameter > 0.0 else value or 1.0


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
    terms = np.abs(J * sizes).max(axis=1)
    rows = 1.0 / np.where(terms > TERMS_FAINT * terms.max(), terms, terms.max() or 1.0)
    left, values, right = np.linalg.svd(J * sizes * rows[:, None])
    if crossing(values) > 1:
        own = np.append(tangent[:n], tangent[n] / scale)
        several = branches_at(problem.evaluate, u, sizes, own, "other branch")
        return [(found, np.maximum(sizes[:n], np.abs(found[:n]))) for found in several]
    w = left[:, -1] * rows
    first, second = right[-1] * sizes, right[-2] * sizes
    bend = [w @ problem.second(u, v) for v in (first, second)]
    a, b, c = float(bend[0] @ first), float(bend[0] @ second), float(bend[1] @ second)
    far = -(b + math.copysign(math.sqrt(max(b * b - a * c, 0.0)), b))
    directions = [x * first + y * second for x, y in ((far, a), (c, far)) if (x, y) != (0.0, 0.0)]
    own = np.append(tangent[:n], tangent[n] / scale) / sizes
    likeness = [abs(float(own @ (d / sizes))) / float(np.linalg.norm(own) * np.linalg.norm(d / sizes))
                for d in directions]  # fmt: skip
    if not likeness or min(likeness) > 1.0 - DIRECTIONS_ALIKE:
        hint = "to second order both branches leave in the same direction"
        raise ConvergenceError("other branch", 0.0, 0, hint)
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
