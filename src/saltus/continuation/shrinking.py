"""The end of a branch of autonomous cycles at a Hopf point, where the cycle shrinks to an equilibrium.

docs/theory/continuation.md, "Special points", explains how the point is found.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.orbit_problem import OrbitData, OrbitZeroProblem
from saltus.continuation.zero_problem import Examined, Point
from saltus.orbits.hopf import HopfPoint, solve_hopf
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.signature import CLOSED_END, Signature

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["equilibrium_ahead"]

_WITHIN = 5.0  # steps, of the last one's length, to the extrapolated zero of the amplitude, within which it is sought
_AFAR = 100.0  # the same for a small cycle round 0: its size is the unit of its steps, and these shrink with it
_AGREES = 0.1  # most difference of Hopf point and extrapolation, over the distance from the last cycle
_AGREES_AFAR = 0.01  # the same farther than the nearer number of steps
_ROUNDING = 1e-9  # relative difference of the parameter that is rounding


def equilibrium_ahead(branch: OrbitZeroProblem, before: Point, point: Point) -> tuple[OrbitZeroProblem, Point] | None:
    """Return equations and point of the Hopf equilibrium a few steps ahead to which a cycle shrinks, or None.

    The amplitude of a cycle vanishes linearly in the arclength. Parameter and period differ from those of the Hopf
    point by the square of the amplitude. Newton's method starts from the values extrapolated from the last two cycles.
    The Hopf point is taken if its parameter and period agree with the extrapolation.

    Parameters
    ----------
    branch : OrbitZeroProblem
        Equations of the cycles.
    before, point : Point
        The last two points, examined.
    """
    problem = branch.problem
    if problem.system.phase is not None or len(set(problem.signature.modes)) > 1:
        return None
    far, near = _amplitude(problem, before), _amplitude(problem, point)
    if not 0.0 < near < _AFAR * (far - near):
        return None
    agrees = _AGREES if near < _WITHIN * (far - near) else _AGREES_AFAR
    ahead = near * near / (far * far - near * near)
    last, other = _period(problem, point), _period(problem, before)
    value = point.parameter + (point.parameter - before.parameter) * ahead
    period = last + (last - other) * ahead
    survey, n = point.examined.data.survey, problem.n
    centre = 0.5 * (survey.lows[:n] + survey.highs[:n])
    found = solve_hopf(problem, centre, value, 2.0 * math.pi / period)
    if found is None or not np.max(np.abs(found.state - centre) / problem.state_scale) < near:
        return None
    left = agrees * abs(value - point.parameter) + _ROUNDING * max(1.0, abs(value))
    if abs(found.parameter - value) > left or abs(found.period - period) > agrees * abs(period - last) + 1e-3 * period:
        return None
    return _at_rest(branch, point, found)


def _amplitude(problem: OrbitProblem, point: Point) -> float:
    """Return half the range of the state that varies most, over the states' sizes."""
    survey, n = point.examined.data.survey, problem.n
    return 0.5 * float(np.max((survey.highs[:n] - survey.lows[:n]) / problem.state_scale))


def _period(problem: OrbitProblem, point: Point) -> float:
    return float(point.u[problem.n : problem.size : problem.n + 1].sum())


def _at_rest(branch: OrbitZeroProblem, point: Point, found: HopfPoint) -> tuple[OrbitZeroProblem, Point]:
    """Return equations and last point of a branch that ends at a Hopf point."""
    old = branch.problem
    signature = Signature((old.signature.modes[0],), (-1,), (CLOSED_END,), 0)
    problem = OrbitProblem(old.system, signature, old.p, old.active, old.scales, old.tol)
    u: NDArray[np.float64] = np.concatenate([found.state, [found.period, found.parameter]])
    problem.start(u, old.state_scale)
    piece = OrbitZeroProblem(problem, u, branch.interest)
    away = np.append((u[: old.n] - point.u[: old.n]) / old.state_scale, u[-1] - point.parameter)
    weights = piece.metric(u)
    end = Point(u, problem.evaluate(u)[1], np.zeros(u.size), weights, 1.0, 0.0, 0.0, arc=point.arc)
    end.arc += float(np.linalg.norm(away))
    values = found.multipliers
    unstable = point.examined.data.unstable  # stability of the cycles that shrink to the point
    end.examined = Examined({}, None, OrbitData(problem.survey(u), values, unstable, tuple(values[:-1].tolist())))
    return piece, end
