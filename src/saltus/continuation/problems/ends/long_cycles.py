"""Cycles of given long periods next to a homoclinic orbit: an arc, and pieces at the saddle.

docs/theory/continuation.md, "Homoclinic orbits", derives them.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.core.interest import Interest
from saltus.continuation.core.zero_problem import Examined, Point
from saltus.continuation.problems.ends.homoclinic_problem import Arc, at_rest, pieces_of, solved
from saltus.continuation.problems.guards import residual_fault
from saltus.continuation.problems.orbit import OrbitZeroProblem
from saltus.continuation.problems.orbit_data import OrbitData
from saltus.orbits.stability.floquet import multipliers, nontrivial, unstable_count
from saltus.scales import LONG_CYCLE_AGREES, MAGNIFIED_CURVATURE, NEWTON_CONVERGED

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from saltus.orbits.problem import OrbitProblem

__all__ = ["MOST_UNKNOWNS", "long_cycles"]

MOST_UNKNOWNS = 6000  # unknowns of a long cycle, beyond which its Jacobian, stored densely, takes too much memory
_GROWTH = (10.0, 1e5)  # least and largest growth of a difference over a piece at the saddle
_ITERATIONS = 8  # most Newton steps to a cycle


def long_cycles(
    arc: Arc, interest: Interest, last: Point, period: float, longest: float
) -> Iterator[tuple[OrbitZeroProblem, Point] | str]:
    """Yield cycles of doubled periods up to the longest, with their equations; at last the reason if one fails.

    Parameters
    ----------
    arc : Arc
        The homoclinic orbit.
    interest : Interest
        What the branch looks for.
    last : Point
        The branch's last point.
    period, longest : float
        Period of the last point, and the longest one wanted.
    """
    before = math.nan
    while period < longest:
        period = min(2.0 * period, longest)
        made = _cycle(arc, period)
        if isinstance(made, str):
            yield made
            return
        problem, u, flows = made
        found = _point(problem, u, flows, interest)
        if isinstance(found, str):
            yield found
            return
        piece, point = found
        saddle = np.append(np.tile(np.append(arc.saddle.state, 0.0), problem.segments), arc.parameter)
        own = np.arange(problem.size) % (problem.n + 1) < problem.n
        spread = math.sqrt(float(point.weights[:-1][own] @ (u - saddle)[:-1][own] ** 2))
        # away from the saddle a cycle spends a share of its time that falls like its period's inverse
        earlier = spread * math.sqrt(2.0) if math.isnan(before) else before
        point.arc = last.arc + math.hypot(earlier - spread, u[-1] - last.parameter)
        before, last = spread, point
        yield piece, point


def _cycle(arc: Arc, period: float) -> tuple[OrbitProblem, NDArray[np.float64], NDArray[np.float64]] | str:
    """Return equations, unknowns and the flow's directions of the cycle of a given period that follows an arc."""
    stay = period - arc.duration
    if stay <= 0.0:
        return "the arc is longer than the period"
    near = solved(arc.problem, arc.u, arc.saddle.state, arc.radius, arc.sizes, stay)
    if isinstance(near, str):
        return near
    rest = _at_saddle(near, stay)
    if rest is None:
        return f"longer orbits would have more than {MOST_UNKNOWNS} unknowns"
    n, still = arc.problem.n, at_rest(arc.problem)
    rows = np.vstack([near.u[:-1].reshape(-1, n + 1), rest[0]])
    flows = np.array([still.evaluate(np.append(row[:n], near.u[-1]))[0] for row in rows])
    # next to the saddle rounding would leave the phase undetermined: the cycle starts where the flow is fast
    first = int(np.argmax(np.linalg.norm(flows / arc.sizes, axis=1)))
    flows[-len(rest[1]) :] = rest[1]
    rows, flows = np.roll(rows, -first, axis=0), np.roll(flows, -first, axis=0)
    u = np.append(rows.ravel(), near.u[-1])
    problem = pieces_of(arc.problem, u, (u.size - 1) // (arc.problem.n + 1))
    if problem is None:
        return "its flow cannot be followed"
    closed = _closed(problem, u, arc.sizes)
    if closed is None:
        return "Newton's method does not converge"
    if abs(closed[-1] - near.parameter) > LONG_CYCLE_AGREES * max(1.0, abs(near.parameter)):
        return "the parameters of the cycle and of its arc differ"
    return problem, closed, flows


def _at_saddle(arc: Arc, stay: float) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """Return start and duration of each piece of the stay at a saddle, and the flow's directions; None for too many.

    The flow is that of the linear equations. A piece is the longer, the nearer it is to the saddle.
    """
    saddle, n = arc.saddle, arc.problem.n
    most = MOST_UNKNOWNS // (n + 1) - arc.problem.segments
    slowest = saddle.slowest(0), saddle.slowest(1)
    rows: list[NDArray[np.float64]] = []
    flows: list[NDArray[np.float64]] = []
    time = 0.0
    while time < stay:
        if len(rows) >= most:
            return None
        since = stay - time, time
        # coordinates without the decay of their slowest part, which may underflow, and the exponents of that decay
        out = saddle.moved(0, -since[0], slowest[0] * since[0]) @ arc.leaves
        into = saddle.moved(1, since[1], slowest[1] * since[1]) @ arc.comes
        decay = np.array([-slowest[0] * since[0], -slowest[1] * since[1]])
        left, near = np.exp(decay), np.exp(decay - decay.max())
        away = saddle.ways[0] @ (left[0] * out) + saddle.ways[1] @ (left[1] * into)
        flows.append(
            saddle.ways[0] @ (saddle.rates(0) @ (near[0] * out)) + saddle.ways[1] @ (saddle.rates(1) @ (near[1] * into))
        )
        distance = float(np.max(np.abs(away) / arc.sizes))
        growth = min(max(MAGNIFIED_CURVATURE / max(distance * distance, 1e-300), _GROWTH[0]), _GROWTH[1])
        duration = min(math.log(growth) / saddle.fastest, stay - time)
        if stay - time - duration < 1e-9 * stay:
            duration = stay - time
        rows.append(np.append(saddle.state + away, duration))
        time += duration
    return np.array(rows), np.array(flows)


def _closed(problem: OrbitProblem, u: NDArray[np.float64], sizes: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Return the solution of a cycle's own equations with its period held, by Newton's method; None without one."""
    from scipy.sparse import csr_matrix, diags, vstack
    from scipy.sparse.linalg import splu

    n, m = problem.n, problem.size
    scale = np.append(np.tile(np.append(sizes, float(u[n : m : n + 1].sum())), problem.segments), 1.0)
    scale[-1] = max(abs(float(u[-1])), 1.0)
    for k in range(_ITERATIONS):
        F, J = problem.evaluate(u) if k else problem.resolve(u)
        fine = problem.refine()
        if not np.all(np.isfinite(J)):
            return None
        held = np.zeros(m + 1)
        held[n : m : n + 1] = 1.0
        K = vstack([csr_matrix(J), csr_matrix(held)]) @ diags(scale)
        rows = np.maximum(abs(K).max(axis=1).toarray().ravel(), 1e-300)
        try:
            step = splu((diags(1.0 / rows) @ K).tocsc()).solve(-np.append(F, 0.0) / rows)
        except RuntimeError:  # singular
            return None
        u = u + step * scale
        if fine and float(np.abs(step).max()) < NEWTON_CONVERGED:
            return u
    return None


def _point(
    problem: OrbitProblem, u: NDArray[np.float64], flows: NDArray[np.float64], interest: Interest
) -> tuple[OrbitZeroProblem, Point] | str:
    """Return equations and point of a cycle, examined; the reason where too much is left of its equations."""
    survey = problem.survey(u)
    if (fault := residual_fault(problem, survey, u)) is not None:
        return fault
    if not survey.admissible:
        return "not admissible: " + "; ".join(survey.reasons())
    piece = OrbitZeroProblem(problem, u, interest)
    with np.errstate(over="ignore", invalid="ignore"):
        values = multipliers(problem, u, problem.evaluate(u)[1], flows)
    weights = piece.metric(u)
    point = Point(u, np.empty((0, 0)), np.zeros(u.size), weights, 1.0, 0.0, survey.residual)
    unstable = unstable_count(nontrivial(values, autonomous=True))
    point.examined = Examined({}, None, OrbitData(survey, values, unstable, tolerance=problem.tol))
    return piece, point
