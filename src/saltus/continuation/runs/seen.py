"""What a branch of orbits goes on with behind a change of signature, as the motion there shows it."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from saltus.continuation.core.zero_problem import Point, correct, start_point
from saltus.continuation.problems.beside import looks_beside
from saltus.continuation.problems.ends.closure import alongside
from saltus.continuation.problems.grazing import Neighbour
from saltus.continuation.problems.orbit import OrbitZeroProblem
from saltus.continuation.runs.beyond import beyond_changes
from saltus.orbits.cuts import whole
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.signature import EVENT_END, MEAN_END, Signature
from saltus.scales import EXTREMES_BEYOND, NEARER, SAME_POINT

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from saltus.orbits.signature import Survey

__all__ = ["apart", "seen_beyond"]

Beyond: TypeAlias = tuple[OrbitZeroProblem, Point]
Equations: TypeAlias = "Callable[..., OrbitZeroProblem]"

# Shares of the parameter's interval at which an orbit beyond a point is sought.
_PROBES = (1e-7, 1e-6, 1e-5, 1e-4, 1e-3)


def seen_beyond(
    branch: OrbitZeroProblem, old: Point, equations: Equations, wide: float, *, ways: tuple[float, ...] = (1.0, -1.0),
    rounds: int = 1,
) -> Beyond | None:  # fmt: skip
    """Return equations and point to go on with, as the motion beyond a point shows them; None where it shows none.

    Next to an AS the branch has a vertical tangent in the duration that vanishes, so no step begins at the point.

    Parameters
    ----------
    branch : OrbitZeroProblem
        Equations that end at the point.
    old : Point
        The point.
    equations : callable
        Returns the equations of a signature near given unknowns.
    wide : float
        The parameter's interval, in its unit.
    ways : tuple of float, optional
        1 for onward along the parameter, -1 for back: those that are tried.
    rounds : int, optional
        Periods of the motion.
    """
    onward = math.copysign(1.0, float(old.tangent[-1]))
    for probe in _PROBES:
        for sign in (onward * way for way in ways):
            for beside in looks_beside(branch.problem, old.u, sign * probe * wide, rounds):
                if beside.signature == branch.problem.signature.whole or _again(branch, old, beside):
                    continue
                fresh = equations(beside.signature, beside.u)
                if (point := _admitted(fresh, beside, old, sign)) is not None:
                    point.arc = old.arc + probe
                    return fresh, point
    return None


def _again(branch: OrbitZeroProblem, old: Point, beside: Neighbour) -> bool:
    """Return whether an orbit next to a change of signature is of the branch that ends there, perhaps begun elsewhere.

    A motion that jumps away comes to an attractor of the other side. That may be the branch's own orbit, begun at
    another of its events: its signature is then the same one turned, and it solves the branch's equations.
    """
    if not any(True for _ in _turned(beside, branch.problem.signature.whole, branch.problem)):
        return False
    along, guess = np.zeros(old.u.size), old.u.copy()
    along[-1], step = 1.0, float(beside.u[-1]) - old.parameter
    if old.tangent[-1] != 0.0:
        guess += old.tangent * (step / float(old.tangent[-1]))
    own = correct(branch, guess, along, old.weights, 7)
    if isinstance(own, str):
        return False
    problem, u = whole(branch.problem, own.u)
    period = float(np.abs(u[problem.n : problem.size : problem.n + 1]).sum())
    sizes = np.tile(np.append(problem.state_scale, period), problem.segments)
    near = (alongside(problem, moved, u)[: problem.size] for moved in _turned(beside, problem.signature, problem))
    return any(bool(np.all(np.abs(moved - u[: problem.size]) <= SAME_POINT * sizes)) for moved in near)


def _turned(beside: Neighbour, form: Signature, problem: OrbitProblem) -> Iterator[NDArray[np.float64]]:
    """Yield the unknowns of an orbit as begun at each of its events from which its signature is a given one."""
    kinds = [tuple(EVENT_END if kind == MEAN_END else kind for kind in one.kinds) for one in (beside.signature, form)]
    parts = beside.signature.modes, beside.signature.transitions, kinds[0]
    if beside.signature.turns != form.turns:
        return
    n, size = problem.n, len(beside.signature) * (problem.n + 1)
    rows = beside.u[:size].reshape(-1, n + 1)
    for j in range(len(beside.signature)):
        if tuple(part[j:] + part[:j] for part in parts) == (form.modes, form.transitions, kinds[1]):
            moved = rows.copy()
            if problem.system.phase is not None:
                moved[:j, n - 1] += problem.system.turn * form.turns
            yield np.append(np.roll(moved, -j, axis=0).ravel(), beside.u[size:])


def _admitted(fresh: OrbitZeroProblem, beside: Neighbour, old: Point, sign: float) -> Point | None:
    """Return the point of an orbit beyond a change of signature, if it is admissible and next to the change's orbit.

    Parameters
    ----------
    fresh : OrbitZeroProblem
        Equations of its signature.
    beside : Neighbour
        The orbit.
    old : Point
        The point at which the signature changes.
    sign : float
        Which way the parameter goes along the tangent.
    """
    try:
        point = start_point(fresh, beside.u, sign)
    except ValueError:
        return None
    point.examined = fresh.examine(point, None)
    if point.examined.data is None:
        return None
    if not apart(fresh, point, old) < EXTREMES_BEYOND or not beyond_changes(fresh.problem, point):
        return None
    return point if _comes_near(fresh, point, old) else None


def _comes_near(fresh: OrbitZeroProblem, point: Point, old: Point) -> bool:
    """Return whether an orbit beyond a change becomes that of the change as the parameter goes there.

    At a quarter of the way, the distance is a half where it grows like a root, and the same where there is a jump.
    """
    away = apart(fresh, point, old)
    if away <= SAME_POINT:
        return True
    u, along = point.u.copy(), np.zeros(point.u.size)
    u[-1] = old.parameter + 0.25 * (point.parameter - old.parameter)
    along[-1] = 1.0
    closer = correct(fresh, u, along, point.weights, 7)
    if isinstance(closer, str):
        return False
    closer.examined = fresh.examine(closer, None)
    return closer.examined.data is not None and apart(fresh, closer, old) < NEARER * away


def apart(fresh: OrbitZeroProblem, point: Point, old: Point) -> float:
    """Return how far the extremes of an orbit beyond a change are from those at the change, over the states' sizes."""
    count = len(fresh.problem.system.states)
    return float(np.max(np.abs(_ranges(point, count) - _ranges(old, count)) / fresh.problem.state_scale[:count]))


def _ranges(point: Point, count: int) -> NDArray[np.float64]:
    """Return the extremes of the `count` states of a point's orbit, shape (2, count)."""
    survey: Survey = point.examined.data.survey
    return np.stack([survey.lows[:count], survey.highs[:count]])
