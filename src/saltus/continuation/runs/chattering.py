"""A branch of orbits at an accumulation of hits: it is located, and the branch goes on with orbits that rest."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, TypeAlias

import numpy as np

from saltus.continuation.core.point_types import ACCUMULATION, meaning_of
from saltus.continuation.core.zero_problem import Point
from saltus.continuation.problems.ends.accumulating import accumulating
from saltus.continuation.problems.ends.accumulation import Accumulated, accumulated_near
from saltus.continuation.problems.orbit import OrbitZeroProblem
from saltus.continuation.runs import beyond
from saltus.continuation.runs.seen import apart, seen_beyond
from saltus.continuation.runs.two_sided import Found, turned
from saltus.scales import EXTREMES_BEYOND, SAME_POINT, SIDE_POINTS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.runs.run import Going
    from saltus.continuation.runs.two_sided import OneSide
    from saltus.orbits.orbit import PeriodicOrbit
    from saltus.orbits.problem import OrbitProblem
    from saltus.orbits.signature import Signature
    from saltus.orbits.unfolding import Fixed

__all__ = ["accumulation_between", "ended_at", "from_accumulation"]


class Orbits(Protocol):
    """What is asked here of the run of a branch of orbits: see `OrbitRun`."""

    stops: set[str]
    fixed: Fixed | None

    @property
    def wide(self) -> float:
        """The parameter's interval, in its unit."""

    @property
    def first_step(self) -> float:
        """The first step behind a change of signature."""

    def place(self, point: Point) -> str:
        """Return the parameter of a point as text."""

    def equations(self, signature: Signature, u: NDArray[np.float64]) -> OrbitZeroProblem:
        """Return the zero problem of a signature near `u`."""

    def orbit_of(self, branch: OrbitZeroProblem, point: Point) -> PeriodicOrbit:
        """Return the orbit of a point."""


_Located: TypeAlias = tuple[Accumulated, OrbitZeroProblem, Point]


def _rests(problem: OrbitProblem) -> bool:
    """Return whether an orbit comes to rest behind hits, of which the last ones are summed up."""
    transitions = problem.system.transitions
    return any(k >= 0 and transitions[k].sums for k in problem.signature.transitions)


def _located(run: Orbits, branch: OrbitZeroProblem, point: Point) -> _Located | None:
    """Return the accumulation near a point of a branch, with equations and point of orbits without rest; or None."""
    if run.fixed is not None or (found := accumulated_near(branch.problem, point.u)) is None:
        return None
    signature, u = found.among_flights()
    fresh = run.equations(signature, u)
    F, J = fresh.problem.resolve(u)
    along = np.zeros(u.size)
    along[-1] = 1.0
    there = Point(u, J, along, fresh.metric(u), 1.0, 0.0, float(np.abs(F).max()))
    there.examined = fresh.examine(there, None)
    if there.examined.data is None or not apart(fresh, there, point) < EXTREMES_BEYOND:
        return None
    there.examined = beyond.without_rounding(there.examined)
    return found, fresh, there


def _keep(run: Orbits, half: OneSide, located: _Located) -> Point:
    """Add the accumulation to a direction, as a special point and as a point of the curve; return this.

    Orbits with hops below the flow's error may lie beyond it, and are dropped.
    """
    found, fresh, there = located
    rows = [point.parameter - there.parameter for _, point in half.points]
    side = max(rows[-SIDE_POINTS:], key=abs)
    while len(rows) > 1 and rows[-1] * side < 0.0:
        rows.pop()
        half.points.pop()
    half.specials = [known for known in half.specials if known.after <= len(half.points)]
    there = turned(there, -side, fresh.odd)
    there.arc = half.points[-1][1].arc + abs(rows[-1])
    of, orbit = fresh.problem.system.transitions[found.impact].name, run.orbit_of(fresh, there)
    half.specials.append(Found(ACCUMULATION, orbit, found.value, len(half.points), there.arc, of))
    half.points.append((fresh, there))
    return there


def accumulation_between(run: Orbits, half: OneSide, going: Going) -> Going:
    """Return what a branch goes on with; where it stops or begins to rest, the accumulation between is kept before."""
    if not half.points:
        return going
    (old, last), (fresh, later, step) = half.points[-1], going
    kept = half.specials[-1:]
    known = bool(kept) and kept[0].name == ACCUMULATION and kept[0].after == len(half.points) - 1
    if known or _rests(old.problem) == _rests(fresh.problem):
        return going
    located = _located(run, old, last) or _located(run, fresh, later)
    if located is None:
        return going
    there, ends = located[2], sorted([last.parameter, later.parameter])
    if not ends[0] <= there.parameter <= ends[1]:
        return going
    there = _keep(run, half, located)
    later.arc = max(later.arc, there.arc + abs(later.parameter - there.parameter))
    return fresh, later, step


def from_accumulation(
    run: Orbits, half: OneSide, at: tuple[OrbitZeroProblem, Point], told: str
) -> str | Going | None:  # fmt: skip
    """Keep the accumulation at the end of a branch; return why the branch ends there, or what it goes on with.

    None where no accumulation is found. at: equations and point of the last orbit. told: what an end says.
    """
    if not half.points or (located := _located(run, *at)) is None:
        return None
    fresh, there = located[1], _keep(run, half, located)
    if ACCUMULATION in run.stops:
        return f"{run.place(there)}: {meaning_of(ACCUMULATION)}"
    went = None
    if any(transition.sums for transition in fresh.problem.system.transitions):
        went = seen_beyond(fresh, there, run.equations, run.wide, ways=(1.0,), rounds=2)
    if went is None or not (_rests(went[0].problem) or _rests(at[0].problem)):
        return f"{run.place(there)}: {told}"
    return *went, run.first_step


def ended_at(run: Orbits, half: OneSide, at: tuple[OrbitZeroProblem, Point], told: str) -> str | Going:
    """Return what `from_accumulation` does where hits accumulate at a branch's last point; else why the branch ends.

    The branch may have turned back next to the accumulation, and come to an earlier special point: it is cut there.
    """
    ended = None
    if accumulating(at[0].problem, at[1].u) is not None:
        kept = half.points[:], half.specials[:]
        _cut_back(half)
        if (ended := from_accumulation(run, half, half.points[-1], told)) is None:
            half.points[:], half.specials[:] = kept
    return ended or f"{run.place(at[1])}: {told}"


def _cut_back(half: OneSide) -> None:
    """Cut a direction at the special point before its last one that is the same, if there is one."""
    own = half.specials[-1]
    for i, old in enumerate(half.specials[:-1]):
        values = zip(own.solution.parameters.values(), old.solution.parameters.values(), strict=True)
        near = all(abs(one - other) <= SAME_POINT * abs(other) for one, other in values)
        if near and old.name == own.name and old.solution.form.whole == own.solution.form.whole:
            half.points, half.specials = half.points[: old.after + 1], half.specials[: i + 1]
            return
