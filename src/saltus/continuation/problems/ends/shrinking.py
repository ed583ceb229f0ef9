"""The end of a branch of autonomous cycles at a Hopf point, where the cycle shrinks to an equilibrium, or to a point.

docs/theory/continuation.md, "Special points", explains how the point is found.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from saltus.continuation.core.zero_problem import Examined, Point
from saltus.continuation.problems.boundary import TWO_FOLD
from saltus.continuation.problems.ends.boundary_homoclinic import shrunk_onto
from saltus.continuation.problems.orbit import OrbitZeroProblem
from saltus.continuation.problems.orbit_data import OrbitData
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.signature import CLOSED_END, Signature
from saltus.orbits.stability.hopf import HopfPoint, solve_centre, solve_hopf
from saltus.scales import HOPF_AGREES, HOPF_AGREES_AFAR, MULTIPLIER_CRITICAL, ONE_VALUE, SHRUNK

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.problems.ends.connection import Homoclinic

__all__ = ["Landed", "Shrunk", "at_rest", "centre_ahead", "equilibrium_ahead", "on_boundary_ahead", "shrunk_to"]

_ON_BOUNDARY = "the cycle shrinks to a boundary equilibrium"
# steps, of the last one's length, to the extrapolated zero of the amplitude, within which it is sought;
# amplitudes of the last cycle from its centre, within which an equilibrium is sought
_WITHIN = 5.0
_AFAR = 100.0  # the same for a small cycle round 0: its size is the unit of its steps, and these shrink with it


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
    problem, seen = branch.problem, _extrapolated(branch.problem, before, point)
    if seen is None:
        return None
    value = point.parameter + (point.parameter - before.parameter) * seen.ahead
    found = solve_hopf(problem, seen.centre, value, seen.frequency, _WITHIN * seen.near)
    if found is None or not seen.agrees(problem, found) or not _keeps_stability(point, found.multipliers):
        return None
    if abs(found.parameter - value) > seen.share * abs(value - point.parameter) + ONE_VALUE * max(1.0, abs(value)):
        return None
    low, high = branch.interest.low - ONE_VALUE, branch.interest.high + ONE_VALUE
    if not low <= found.parameter <= high:
        return None
    return _at_rest(branch, point, found)


def _keeps_stability(point: Point, values: NDArray[np.complex128]) -> bool:
    """Return whether no multiplier crosses the unit circle between a cycle and the equilibrium that it shrinks to.

    Of the equilibrium's multipliers the two at 1 belong to the plane of the cycle. Each of the others has its
    counterpart among those of the cycle. Where it lies on the other side of the unit circle, a bifurcation is between.

    Parameters
    ----------
    point : Point
        The last cycle, examined.
    values : ndarray of complex, shape (states,)
        Multipliers of the equilibrium over the period of its cycles.
    """
    from scipy.optimize import linear_sum_assignment

    own = np.array(point.examined.data.followed)
    others = values[np.argsort(np.abs(values - 1.0), kind="stable")[2:]]
    if not others.size or not np.all(np.isfinite(own)):
        return True
    rows, columns = linear_sum_assignment(np.abs(own[:, None] - others[None, :]))
    sides = [
        np.sign(np.abs(kind) - 1.0) * (np.abs(np.abs(kind) - 1.0) > MULTIPLIER_CRITICAL)
        for kind in (own[rows], others[columns])
    ]
    return bool(np.all(sides[0] * sides[1] >= 0.0))


class Shrunk(NamedTuple):
    """The point of a surface to which cycles shrink."""

    kind: str  # of a BE
    told: str


def shrunk_to(problem: OrbitProblem, points: list[tuple[OrbitZeroProblem, Point]], point: Point) -> Shrunk | None:
    """Return what an autonomous cycle at the end of a branch has shrunk to, by the sizes of the branch's cycles.

    Next to an equilibrium on the surface motions are slow: the period keeps its size. At a two-fold both fields are
    tangent to the surface and none vanishes: the period shrinks as the cycle does.
    """
    if problem.system.phase is not None or not points:
        return None
    surveys = [item.examined.data.survey for _, item in points]
    n, own = problem.n, point.examined.data.survey
    largest = np.max([survey.highs[:n] - survey.lows[:n] for survey in surveys], axis=0)
    if not np.all(own.highs[:n] - own.lows[:n] <= SHRUNK * largest):
        return None
    longest = max(_period(piece.problem, item) for piece, item in points)
    if _period(problem, point) <= math.sqrt(SHRUNK) * longest:
        return Shrunk(TWO_FOLD, "the cycle shrinks to a two-fold")
    return Shrunk("", _ON_BOUNDARY)


class Landed(NamedTuple):
    """The boundary equilibrium ahead to which cycles shrink, as the last point of their branch."""

    kind: str  # of a BE
    end: Homoclinic  # the equilibrium with its event
    point: Point
    told: str


def on_boundary_ahead(points: list[tuple[OrbitZeroProblem, Point]]) -> Landed | None:
    """Return the boundary equilibrium ahead to which the last cycles of a branch shrink, or None.

    It is asked for where no step succeeds.

    Size and parameter of such a cycle are linear in the distance from it, until the size is that of rounding. The last
    cycle and one of twice its size tell where that is. The equilibrium's state and parameter have to agree.
    """
    piece, last = points[-1]
    problem, n = piece.problem, piece.problem.n
    if problem.system.phase is not None or len(problem.signature) < 2:
        return None
    near, largest = _amplitude(problem, last), max(_amplitude(problem, point) for _, point in points)
    far = next((point for _, point in reversed(points) if _amplitude(problem, point) >= 2.0 * near > 0.0), None)
    if far is None or near > math.sqrt(SHRUNK) * largest:
        return None
    kind, rest = shrunk_onto(problem, last.u)
    if rest is None:
        return None
    ahead = near / (_amplitude(problem, far) - near)
    value = rest.saddle.parameters[problem.system.parameter_names[problem.active[0]]] / problem.scales[0]
    seen = last.parameter + (last.parameter - far.parameter) * ahead
    here, there = _centre(problem, last), _centre(problem, far)
    missed = np.max(np.abs(here + (here - there) * ahead - rest.saddle.state) / problem.state_scale)
    if abs(value - seen) > HOPF_AGREES * abs(seen - last.parameter) or missed > HOPF_AGREES * near:
        return None
    u = last.u.copy()
    u[: problem.size].reshape(problem.segments, n + 1)[:, :n] = rest.saddle.state
    u[problem.size] = value
    end = at_rest(piece, problem, last, u, last.examined.data.multipliers)[1]
    return Landed(kind, rest, end, _ON_BOUNDARY)


class _Extrapolated(NamedTuple):
    """Where cycles that shrink would come to rest."""

    ahead: float  # change up to there of what differs by the square of the amplitude, over its change in the last step
    # period, last: period there, and of the last cycle
    period: float
    last: float
    centre: NDArray[np.float64]  # shape (states,): centre of the last cycle
    near: float  # amplitude of the last cycle, over the states' sizes
    share: float  # most difference of the equilibrium from the extrapolation, over the distance from the last cycle

    @property
    def frequency(self) -> float:
        return 2.0 * math.pi / self.period

    def agrees(self, problem: OrbitProblem, found: HopfPoint) -> bool:
        """Return whether an equilibrium lies within the last cycle and has the period that was extrapolated."""
        if not np.max(np.abs(found.state - self.centre) / problem.state_scale) < self.near:
            return False
        return abs(found.period - self.period) <= self.share * abs(self.period - self.last) + 1e-3 * self.period


def _extrapolated(problem: OrbitProblem, before: Point, point: Point) -> _Extrapolated | None:
    """Return where the cycles of the last two points would come to rest; None if not within a few steps."""
    if problem.system.phase is not None or problem.n < 2 or len(set(problem.signature.modes)) > 1:
        return None  # one state alone has no pair of eigenvalues
    far, near = _amplitude(problem, before), _amplitude(problem, point)
    if not 0.0 < near < _AFAR * (far - near):
        return None
    share = HOPF_AGREES if near < _WITHIN * (far - near) else HOPF_AGREES_AFAR
    ahead = near * near / (far * far - near * near)
    last, other = _period(problem, point), _period(problem, before)
    return _Extrapolated(ahead, last + (last - other) * ahead, last, _centre(problem, point), near, share)


def centre_ahead(
    problem: OrbitProblem, before: Point, point: Point, *, family: bool
) -> tuple[OrbitProblem, NDArray[np.float64], NDArray[np.complex128]] | None:
    """Return the equilibrium a few steps ahead to which orbits shrink along a quantity, or None.

    In a family it is a centre at the same parameters, else a Hopf point of the freed parameter. Its period must agree
    with the one extrapolated.

    Parameters
    ----------
    problem : OrbitProblem
        Equations of the orbits.
    before, point : Point
        The last two points, examined.
    family : bool
        Whether the orbits are a family at fixed parameters.

    Returns
    -------
    tuple of (OrbitProblem, ndarray, ndarray)
        Equations, unknowns with the further one, and multipliers of the equilibrium as a cycle.
    """
    seen, further = _extrapolated(problem, before, point), float(point.u[problem.size])
    if seen is None:
        return None
    if family:
        found = solve_centre(problem, seen.centre, seen.frequency)
    else:
        found = solve_hopf(problem, seen.centre, further, seen.frequency, _WITHIN * seen.near)
    if found is None or not seen.agrees(problem, found):
        return None
    if not family and not _keeps_stability(point, found.multipliers):
        return None
    signature = Signature((problem.signature.modes[0],), (-1,), (CLOSED_END,), 0)
    rest = OrbitProblem(problem.system, signature, problem.parameters_at(point.u), problem.active, problem.scales)
    rest.tol = problem.tol
    u = np.concatenate([found.state, [found.period, further if family else found.parameter]])
    rest.start(u, problem.state_scale)
    return rest, u, found.multipliers


def at_rest(
    piece: OrbitZeroProblem, old: OrbitProblem, point: Point, u: NDArray[np.float64], values: NDArray[np.complex128]
) -> tuple[OrbitZeroProblem, Point]:
    """Return equations and last point of a branch that ends at an equilibrium with unknowns `u`."""
    away = np.append((u[: old.n] - point.u[: old.n]) / old.state_scale, u[-1] - point.parameter)
    end = Point(u, piece.evaluate(u)[1], np.zeros(u.size), piece.metric(u), 1.0, 0.0, 0.0, arc=point.arc)
    end.arc += float(np.linalg.norm(away))
    unstable = point.examined.data.unstable  # stability of the cycles that shrink to the point
    survey = piece.problem.survey(u)
    followed, tol = tuple(values[:-1].tolist()), piece.problem.tol
    end.examined = Examined({}, None, OrbitData(survey, values, unstable, followed, tolerance=tol))
    return piece, end


def _amplitude(problem: OrbitProblem, point: Point) -> float:
    """Return half the range of the state that varies most, over the states' sizes."""
    survey, n = point.examined.data.survey, problem.n
    return 0.5 * float(np.max((survey.highs[:n] - survey.lows[:n]) / problem.state_scale))


def _centre(problem: OrbitProblem, point: Point) -> NDArray[np.float64]:
    """Return the middle of the range of each state, shape (states,)."""
    survey, n = point.examined.data.survey, problem.n
    return np.asarray(0.5 * (survey.lows[:n] + survey.highs[:n]))


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
    return at_rest(piece, old, point, u, found.multipliers)
