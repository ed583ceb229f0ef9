"""Where a branch of doubled period ends: at a period doubling or a grazing of the orbit that it goes round twice."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.arclength import Event, Point, correct, locate, start_point
from saltus.continuation.zero_problem import OrbitBranch
from saltus.orbits.problem import CLOSED_END, PHASE_END, OrbitProblem, Signature

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["halved", "once_round"]

_ALIKE, _SAME, _NEAR, _REACHES = 1e-2, 1e-6, 1e-4, (1e-3, 1e-2)
"""Difference, over the orbit's size, of two halves that may be one, and of two that are; distance between the
parameters of a branch point and of the period doubling that it is; steps along the shorter orbit's branch in which this
is looked for."""


def halved(branch: OrbitBranch, point: Point) -> Point | None:
    """Return a branch point at which the orbit is a shorter one twice, located as that one's period doubling.

    At the branch point itself the equations are singular, and as the parameter turns there, its place along the branch
    is known to half the digits only; the shorter orbit's branch passes it regularly.

    Parameters
    ----------
    branch : OrbitBranch
        The branch of doubled period.
    point : Point
        The branch point, as located on it.

    Returns
    -------
    Point or None
        None where the orbit is not a shorter one twice, or that one does not double its period there.
    """
    short = once_round(branch.problem, point.u, _ALIKE)
    if short is None:
        return None
    signature, u = short
    old = branch.problem
    problem = OrbitProblem(old.system, signature, old.p, old.active, old.scales, old.tol)
    problem.start(u)
    single = OrbitBranch(problem, u, branch.interest)
    doubling = _doubling(single, u)
    if doubling is None or abs(doubling.point.parameter - point.parameter) > _NEAR:
        return None
    u = _twice(problem, doubling.point.u)
    old.start(u)
    found = Point(u, branch.evaluate(u)[1], point.tangent, point.weights, point.sign, point.log, 0.0, 1, point.arc)
    found.examined = branch.examine(found, None)
    return None if found.examined.data is None else found


def once_round(
    problem: OrbitProblem, u: NDArray[np.float64], alike: float = _SAME
) -> tuple[Signature, NDArray[np.float64]] | None:
    """Return signature and unknowns of the orbit that `u` goes round twice, if its halves differ by `alike` at most."""
    signature, n = problem.signature, problem.n
    if signature.turns % 2:
        return None
    blocks = u[: problem.size].reshape(problem.segments, n + 1).copy()
    if signature.kinds[0] in (PHASE_END, CLOSED_END):
        problem.survey(u)
        blocks[0, n] *= 0.5
        blocks = np.vstack([blocks[0], np.append(problem.state_on(0, 0.5), blocks[0, n])])
        modes, transitions, kinds = signature.modes, signature.transitions, signature.kinds
    else:
        half = problem.segments // 2
        modes, transitions, kinds = (part[:half] for part in (signature.modes, signature.transitions, signature.kinds))
        if (modes + modes, transitions + transitions) != (signature.modes, signature.transitions):
            return None
    first, second = blocks[: len(modes)], blocks[len(modes) :]
    if problem.system.phase is not None:
        second[:, n - 1] -= math.pi * signature.turns
    size = np.append(problem.state_scale, np.abs(blocks[:, n]).sum())
    if np.max(np.abs(second - first) / size) > alike:
        return None
    once = Signature(modes, transitions, kinds, signature.turns // 2)
    return once, np.append(0.5 * (first + second), u[problem.size :])


def _doubling(branch: OrbitBranch, u: NDArray[np.float64]) -> Event | None:
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
        values = [end.examined.monitors.get("PD", math.nan) for end in ends]
        if values[0] * values[1] < 0.0:
            return locate(branch, "PD", ends[0], ends[1], *values)
    return None


def _twice(problem: OrbitProblem, u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the unknowns of an orbit gone round twice."""
    n, signature = problem.n, problem.signature
    first = u[: problem.size].reshape(problem.segments, n + 1)
    if signature.kinds[0] in (PHASE_END, CLOSED_END):
        both = first.copy()
        both[0, n] *= 2.0
    else:
        second = first.copy()
        if problem.system.phase is not None:
            second[:, n - 1] += 2.0 * math.pi * signature.turns
        both = np.vstack([first, second])
    return np.append(both, u[problem.size :])
