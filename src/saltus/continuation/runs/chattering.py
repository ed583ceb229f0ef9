"""A branch of orbits at an accumulation of hits: it is located, and the branch goes on with orbits that rest."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, TypeAlias

from saltus.continuation.core.point_types import ACCUMULATION, meaning_of
from saltus.continuation.core.zero_problem import Point, start_point
from saltus.continuation.problems.ends.accumulation import Accumulated, accumulated_near
from saltus.continuation.problems.orbit import OrbitZeroProblem
from saltus.continuation.runs import beyond
from saltus.continuation.runs.two_sided import Found, turned
from saltus.scales import EXTREMES_BEYOND

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from saltus.continuation.runs.run import Going
    from saltus.continuation.runs.two_sided import OneSide
    from saltus.orbits.orbit import PeriodicOrbit
    from saltus.orbits.problem import OrbitProblem
    from saltus.orbits.signature import Signature
    from saltus.orbits.unfolding import Fixed

__all__ = ["accumulation_between", "from_accumulation"]


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
    if (flies := found.among_flights(branch.problem.system, branch.problem.tol)) is None:
        return None
    fresh = run.equations(flies[0].signature, flies[1])
    try:
        there = start_point(fresh, flies[1])
    except ValueError:
        return None
    there.u[-1] = found.u[-1]
    there.examined = fresh.examine(there, None)
    if there.examined.data is None or not beyond.apart(fresh, there, point) < EXTREMES_BEYOND:
        return None
    there.examined = beyond.without_rounding(there.examined)
    onward = there.parameter - point.parameter
    there = turned(there, onward * float(there.tangent[-1]), fresh.odd)
    there.arc = point.arc + abs(onward)
    return found, fresh, there


def _keep(run: Orbits, half: OneSide, located: _Located) -> None:
    """Add the accumulation to a direction, as a special point and as a point of the curve."""
    found, fresh, there = located
    of, orbit = fresh.problem.system.transitions[found.impact].name, run.orbit_of(fresh, there)
    half.specials.append(Found(ACCUMULATION, orbit, found.value, len(half.points), there.arc, of))
    half.points.append((fresh, there))


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
    there.arc = last.arc + abs(there.parameter - last.parameter)
    later.arc = max(later.arc, there.arc + abs(later.parameter - there.parameter))
    _keep(run, half, located)
    return fresh, later, step


def from_accumulation(
    run: Orbits, half: OneSide, at: tuple[OrbitZeroProblem, Point], told: str
) -> str | Going | None:  # fmt: skip
    """Keep the accumulation at the end of a branch; return why the branch ends there, or what it goes on with.

    None where no accumulation is found. at: equations and point of the last orbit. told: what an end says.
    """
    if (located := _located(run, *at)) is None:
        return None
    _keep(run, half, located)
    _, fresh, there = located
    if ACCUMULATION in run.stops:
        return f"{run.place(there)}: {meaning_of(ACCUMULATION)}"
    went = beyond.seen_beyond(fresh, there, run.equations, run.wide, ways=(1.0,), rounds=2)
    return f"{run.place(there)}: {told}" if went is None else (*went, run.first_step)
