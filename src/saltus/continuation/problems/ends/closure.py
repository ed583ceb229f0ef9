"""Whether a step of a curve of orbits passes the curve's start, perhaps at another phase of the orbit."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.continuation.core.arclength import StepControl
from saltus.continuation.core.closing import Passed, between, passed, reach
from saltus.continuation.core.zero_problem import Point, ZeroProblem
from saltus.orbits.cuts import clustered, in_shares
from saltus.orbits.signature import EVENT_END, MEAN_END, PHASE_END
from saltus.scales import EPS, SAME_POINT
from saltus.system.angles import TURN, wrapped

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.orbits.problem import OrbitProblem

__all__ = ["alongside", "passes"]

_SAMPLES = 400  # times over a period between which an orbit's crossings of a plane are sought


def alongside(problem: OrbitProblem, u: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a copy of the unknowns `u`, its phase shifted by whole turns to start next to the phase of `other`.

    Angles are moved next to those of `other`, each segment's by itself.
    """
    moved, n = u.copy(), problem.n
    if problem.system.phase is not None:
        turn = problem.system.turn
        shift = turn * round(float(u[n - 1] - other[n - 1]) / turn)
        moved[n - 1 : problem.size : n + 1] -= shift
    for place in problem.system.angle_places:
        at = slice(place, problem.size, n + 1)
        moved[at] -= TURN * np.round((moved[at] - other[at]) / TURN)
    return moved


def passes(
    branch: ZeroProblem,
    problem: OrbitProblem,
    start: tuple[OrbitProblem, Point],
    last: Point,
    new: Point,
    control: StepControl,
    active: slice | None = None,
) -> Passed | None:
    """Return the orbit of the start if the step from `last` to `new` passes it, started where the step's orbits are.

    The plane of the phase condition is that of the step, also where the next one has been tried in another.

    Parameters
    ----------
    branch : ZeroProblem
        The equations of the curve.
    problem : OrbitProblem
        Those of its orbits.
    start : (OrbitProblem, Point)
        The equations with which the curve started, and its first point. Signatures differ at most in cuts.
    last, new : Point
        The step's ends.
    control : StepControl
        Sizes of steps.
    active : slice, optional
        Where the active parameters are among the unknowns of the start; by default they are the last ones.
    """
    if last.arc <= SAME_POINT or not _may_pass(problem, start, last, new, control):
        return None
    active = slice(-len(problem.active), None) if active is None else active
    plane = problem.phase_plane
    if problem.slides and last.frame is not None:
        problem.phase_plane = last.frame
    for same in _phases(problem, start, last, active):
        near = replace(same, u=alongside(problem, same.u, last.u))
        known = near.tangent.size > 0
        if (met := passed(branch, near, last, new, control, known=known)) is not None:
            return met
    problem.phase_plane = plane
    return None


def _may_pass(
    problem: OrbitProblem, start: tuple[OrbitProblem, Point], last: Point, new: Point, control: StepControl
) -> bool:
    """Return whether parameter, period and extremes of the start are those of a step, wherever its orbit starts."""
    begun, origin = start
    length, room = new.arc - last.arc, reach(control, last, new)

    def change(point: Point, row: slice) -> float:
        return length * float(point.tangent[row].sum())

    at = slice(-1, None)
    ends, slopes = (last.parameter, new.parameter), (change(last, at), change(new, at))
    if not between(origin.parameter, ends, slopes, room):
        return False
    own, at = slice(begun.n, begun.size, begun.n + 1), slice(problem.n, problem.size, problem.n + 1)
    period = float(origin.u[own].sum())
    ends, slopes = (float(last.u[at].sum()), float(new.u[at].sum())), (change(last, at), change(new, at))
    return between(period, ends, slopes, room * period) and not _extends_elsewhere(problem, origin, last, new, room)


def _extends_elsewhere(problem: OrbitProblem, origin: Point, last: Point, new: Point, away: float) -> bool:
    """Return whether extremes of the start's states lie clearly outside those of a step, wherever an orbit starts."""
    surveys: list[Any] = [getattr(point.examined.data, "survey", None) for point in (origin, last, new)]
    if any(survey is None for survey in surveys):
        return False
    states = np.setdiff1d(np.arange(len(problem.system.states)), problem.system.angle_places)
    seen = np.array([[survey.lows[states], survey.highs[states]] for survey in surveys])
    room = np.abs(seen[2] - seen[1]) + away * problem.state_scale[states]
    return bool(np.any(np.abs(seen[0] - seen[1]) > room))


def _phases(problem: OrbitProblem, start: tuple[OrbitProblem, Point], last: Point, active: slice) -> Iterator[Point]:
    """Yield a point of a curve with each start of its orbit that `last` may have; only the first has a tangent."""
    begun, origin = start
    signature, n, size = problem.signature, problem.n, problem.size
    if problem.slides:
        yield from _on_plane(problem, start, last, active)
        return
    alike = begun.signature == signature
    if alike:
        yield origin
    if signature.kinds[0] == PHASE_END:
        forced = _round(problem, start, last, active)
        for j in range(int(alike), signature.turns):
            yield forced.begun_at(j / signature.turns)
        return
    blocks, form = origin.u[: begun.size].reshape(begun.segments, n + 1), signature.whole
    # of events on one surface in a row the first alone ends where its function vanishes, wherever an orbit starts
    kinds = tuple(EVENT_END if kind == MEAN_END else kind for kind in form.kinds)
    parts = (form.modes, form.transitions, kinds)
    for j in range(int(alike), len(form)):
        if all(part[j:] + part[:j] == part for part in parts):
            if signature.is_cut or begun.signature.is_cut:
                u = np.append(origin.u[: begun.size], origin.u[active])
                moved = in_shares(begun, u, problem, last.u, j)[:size]
                yield replace(origin, u=np.append(moved, origin.u[begun.size :]), tangent=np.zeros(0))
                continue
            turned = blocks.copy()
            if problem.system.phase is not None:
                turned[:j, n - 1] += problem.system.turn * signature.turns
            moved = origin.u.copy()
            moved[:size] = np.roll(turned, -j, axis=0).ravel()
            yield replace(origin, u=moved, tangent=np.zeros(0))


@dataclass(frozen=True, eq=False)
class _Round:
    """A smooth orbit that was just surveyed, to be started anywhere on itself, in as many pieces as another one."""

    problem: OrbitProblem  # its equations
    origin: Point  # its point
    like: NDArray[np.float64]  # pieces of the other one, shape (pieces, n + 1)

    def at(self, shares: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return full states, shape (share, n), at shares of the period; a phase has turned as often as that says."""
        problem, (rounds, shares) = self.problem, np.divmod(shares, 1.0)
        ends = np.cumsum(self.origin.u[problem.n : problem.size : problem.n + 1])
        pieces = np.minimum(np.searchsorted(ends / ends[-1], shares, side="right"), problem.segments - 1)
        begins = np.append(0.0, ends)[pieces]
        within = np.clip((shares * ends[-1] - begins) / (ends[pieces] - begins), 0.0, 1.0)
        places = zip(pieces.tolist(), within.tolist(), strict=True)
        states = np.array([problem.state_on(piece, clustered(place)) for piece, place in places])
        if problem.system.phase is not None:
            states[:, -1] += problem.system.turn * problem.signature.turns * rounds
        return states

    def begun_at(self, share: float) -> Point:
        """Return the orbit, started at a share of its period; a phase starts where it did."""
        problem, n, rows = self.problem, self.problem.n, self.like.copy()
        shares = np.cumsum(rows[:, n]) / rows[:, n].sum()
        rows[:, :n] = self.at(share + np.append(0.0, shares[:-1]))
        if problem.system.phase is not None:
            rows[:, n - 1] += self.origin.u[n - 1] - rows[0, n - 1]
        period = float(self.origin.u[n : problem.size : n + 1].sum())
        rows[:, n] *= period / rows[:, n].sum()
        u = np.concatenate([rows.ravel(), self.origin.u[problem.size :]])
        return replace(self.origin, u=u, tangent=np.zeros(0))


def _round(problem: OrbitProblem, start: tuple[OrbitProblem, Point], last: Point, active: slice) -> _Round:
    """Return the orbit at the start of a curve, surveyed, to be had in pieces as those of `last`."""
    begun, origin = start
    begun.survey(np.append(origin.u[: begun.size], origin.u[active]))
    return _Round(begun, origin, last.u[: problem.size].reshape(problem.segments, problem.n + 1))


def _on_plane(problem: OrbitProblem, start: tuple[OrbitProblem, Point], last: Point, active: slice) -> Iterator[Point]:
    """Yield the orbit at the start of a curve, begun on the plane of the phase condition, where it crosses that.

    Of several crossings that nearest to the start of `last` is taken. Angles are those next to its own: along a branch
    the start moves in the plane, and may do so by turns.
    """
    from scipy.optimize import brentq

    n, circles, near = problem.n, problem.system.angle_places, last.u[: problem.n]
    point, normal = problem.phase_plane[:n], problem.phase_plane[n : 2 * n]
    whole = _round(problem, start, last, active)

    def away(shares: NDArray[np.float64]) -> NDArray[np.float64]:
        return wrapped(whole.at(shares) - near, circles)

    def height(share: float) -> float:
        return float(((away(np.array([share])) + near - point) @ normal)[0])

    shares = np.linspace(0.0, 1.0, _SAMPLES, endpoint=False)
    heights = (away(shares) + near - point) @ normal
    best: tuple[float, float] | None = None
    for i in np.flatnonzero((heights < 0.0) & (np.roll(heights, -1) >= 0.0)):
        low, high = float(shares[i]), float(shares[i]) + 1.0 / _SAMPLES
        share = float(brentq(height, low, high, xtol=EPS)) if height(high) > 0.0 else high
        distance = float(np.linalg.norm(away(np.array([share]))[0] / problem.state_scale))
        if best is None or distance < best[0]:
            best = distance, share
    if best is not None:
        yield whole.begun_at(best[1])
