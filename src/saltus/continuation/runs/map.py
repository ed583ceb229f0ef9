"""A branch of fixed points and orbits of maps under way, across borders of pieces."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.continuation.problems.border import beyond_border, shrinks_to
from saltus.continuation.problems.map import MapZeroProblem
from saltus.continuation.results.map_curve import MapBranch
from saltus.continuation.runs.algebraic import AlgebraicRun, algebraic_columns
from saltus.continuation.runs.one_parameter import branch_run
from saltus.maps.orbit import MapOrbit
from saltus.scales import BORDERS_ALIKE, HALVES_OF_MAP, MET
from saltus.system.angles import wrapped

if TYPE_CHECKING:
    from saltus.continuation.core.zero_problem import Event, Point
    from saltus.continuation.problems.boundary import Crossing
    from saltus.continuation.runs.two_sided import BothSides, OneSide
    from saltus.maps.problem import MapOrbitProblem

__all__ = ["MapRun", "begun_anywhere", "map_orbit_columns"]


def map_orbit_columns(joined: BothSides) -> dict[str, Any]:
    """Return the fields of `MapCurve` that a branch and a locus fill in the same way."""
    forms = list(dict.fromkeys(piece.problem.itinerary for piece, _ in joined.rows))
    return algebraic_columns(joined) | {
        "points": np.array([piece.problem.points(point.u) for piece, point in joined.rows]),
        "multipliers": np.array([point.examined.data.values for _, point in joined.rows]),
        "forms": tuple(forms),
        "form": np.array([forms.index(piece.problem.itinerary) for piece, _ in joined.rows]),
    }


def begun_anywhere(problem: MapOrbitProblem, origin: Point) -> list[Point]:
    """Return the start of a curve of orbits with each of the orbit's points as the first one.

    A curve round a tongue, or once round a circle, comes back to its start with another point first.
    """
    itinerary, found = problem.itinerary, []
    for k in range(problem.period):
        if itinerary[k:] + itinerary[:k] == itinerary:
            u, tangent = (
                np.append(np.roll(problem.points(part), -k, axis=0).ravel(), part[problem.n :])
                for part in (origin.u, origin.tangent)
            )
            found.append(replace(origin, u=u, tangent=tangent))
    return found


class MapRun(AlgebraicRun):
    """One call of `continue_branch` from an orbit of a map; see `AlgebraicRun`."""

    solution: MapOrbit
    zero_problem = MapZeroProblem
    result = MapBranch
    columns = staticmethod(map_orbit_columns)
    types = MapZeroProblem.critical
    what = "orbit"
    border = "BC"
    at_border = "border collision"

    def crossing(self, branch: MapZeroProblem, event: Event) -> tuple[str, Crossing]:
        """See `AlgebraicRun.crossing`."""
        problem, (_, point, guard, _) = branch.problem, event.name
        found = beyond_border(problem, point, guard, event.point.u, branch.sizes)
        texts = [text for conditions in problem.system.conditions.values() for text in conditions]
        return texts[guard - len(problem.system.pieces)], found

    def returned(self, half: OneSide, branch: MapZeroProblem, point: Point) -> bool:
        """See `AlgebraicRun.returned`; another of the orbit's points may be the first one by then."""
        here = MapOrbit.from_unknowns(branch.problem, point.u, branch.sizes)
        sizes = branch.sizes[: branch.problem.states]
        for old in (found.solution for found in half.specials if found.name == self.border):
            near = abs(old.parameters[self.name] - self.value(point)) <= BORDERS_ALIKE * self.scale
            for k in range(here.period if near else 0):
                turned = (*old.itinerary[k:], *old.itinerary[:k])
                away = np.abs(wrapped(np.roll(old.points, -k, axis=0) - here.points, here.system.angle_places))
                if turned == here.itinerary and np.all(away <= BORDERS_ALIKE * sizes):
                    return True
        return False

    def leaves(self, before: MapZeroProblem, branch: MapZeroProblem, point: Point) -> str | None:
        """See `AlgebraicRun.leaves`: of several points on borders, each must move into its new piece.

        Where the orbits behind are those before it, begun at another point, the branch has come to an end.
        """
        problem = branch.problem
        for i, guard, height in problem.heights(point.u):
            gradient = problem.border(i, guard, point.u)[1]
            terms = np.abs(gradient[: problem.n]) @ branch.sizes
            if abs(height) <= MET * terms and float(gradient @ point.tangent) < -MET * terms:
                return "several points meet borders at once, and move to different sides of them"
        period = shrinks_to(before.problem, problem.itinerary, point.u, branch.sizes)
        return None if period is None else f"the orbit shrinks to one of period {period}"

    def starts(self, branch: MapZeroProblem, origin: Point) -> list[Point]:
        """See `AlgebraicRun.starts`."""
        return begun_anywhere(branch.problem, origin)

    def closed_up(self, branch: MapZeroProblem, point: Point) -> str | None:
        """See `AlgebraicRun.closed_up`: where the second half of an orbit meets the first one, its period halves."""
        problem = branch.problem
        half, odd = divmod(problem.period, 2)
        if odd or problem.itinerary[:half] != problem.itinerary[half:]:
            return None
        points, sizes = problem.points(point.u), branch.sizes[: problem.states]
        gaps = wrapped(points[:half] - points[half:], problem.system.angle_places)
        apart = float(np.max(np.abs(gaps) / sizes))
        return "the period halves" if apart < HALVES_OF_MAP else None


@branch_run.register
def _(start: MapOrbit, parameter: str) -> type[MapRun]:
    return MapRun
