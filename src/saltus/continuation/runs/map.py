"""Continuation of fixed points and cycles of maps along one parameter, across borders of pieces."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.continuation.core.arclength import StepControl
from saltus.continuation.core.interest import Interest
from saltus.continuation.problems.border import TOGETHER, beyond_border
from saltus.continuation.problems.extents import extents
from saltus.continuation.problems.map import CYCLE_POINTS, CycleZeroProblem, in_lockstep
from saltus.continuation.results.map_curve import MapBranch
from saltus.continuation.runs.algebraic import AlgebraicRun, read_point_events
from saltus.continuation.runs.options import asked_types, checked_interval, read_stops, unit_of
from saltus.maps.orbit import MapOrbit, cycle_at, itinerary_of
from saltus.maps.problem import CycleProblem
from saltus.progress import Report, Reporter
from saltus.system.angles import wrapped

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.core.monitor import Monitor
    from saltus.continuation.core.zero_problem import Event, Point
    from saltus.continuation.problems.boundary import Crossing
    from saltus.continuation.runs.two_sided import BothSides, OneSide

__all__ = ["continue_cycle", "cycle_fields"]

_RETURNED = 1e-8  # distance, in the states' sizes and the parameter's unit, up to which two border collisions are one
_HALVED = 1e-5  # distance of a cycle's halves, in the states' sizes, at which the period halves


def continue_cycle(
    orbit: MapOrbit,
    parameter: str,
    bounds: tuple[float, float],
    *,
    steps: StepControl | None = None,
    directions: str = "both",
    events: Mapping[str, float | str] | None = None,
    stop_at: str | Iterable[str] = (),
    progress: bool | Report = False,
) -> MapBranch:
    """Return the branch of cycles through a cycle; `continue_orbit` describes the arguments."""
    control = StepControl() if steps is None else checks.instance("steps", steps, StepControl)
    reporter = Reporter(progress)
    system = orbit.system
    low, high = checked_interval(system, orbit.parameters, parameter, bounds, directions)
    events = checks.mapping("events", events, "names to values, as {'x': 0.5}, or to 'extremum'")
    scale = unit_of(low, high, orbit.parameters[parameter])
    interest = Interest(low / scale, high / scale, scale, read_point_events(orbit, parameter, events))
    stops = read_stops(stop_at, [*CYCLE_POINTS, *asked_types(events)])
    run = _CycleRun(orbit, parameter, interest, control, stops, reporter)
    joined = run.joined(directions)
    return MapBranch(
        options=run.options([low, high], directions, events), **run.branch_fields(joined), **cycle_fields(joined)
    )


def cycle_fields(joined: BothSides) -> dict[str, Any]:
    """Return the fields of `MapCurve` that a branch and a locus fill in the same way."""
    forms = list(dict.fromkeys(piece.problem.itinerary for piece, _ in joined.rows))
    data = [point.examined.data for _, point in joined.rows]
    return {
        "points": np.array([piece.problem.points(point.u) for piece, point in joined.rows]),
        "multipliers": np.array([d.values for d in data]),
        "stable": np.array([d.stable for d in data]),
        "regular": np.array([not d.reasons for d in data]),
        "forms": tuple(forms),
        "form": np.array([forms.index(piece.problem.itinerary) for piece, _ in joined.rows]),
        "residual": np.array([point.residual for _, point in joined.rows]),
        "arclength": np.array(joined.arcs) - joined.arcs[0],
        "stopped": joined.stopped,
    }


class _CycleRun(AlgebraicRun):
    """One call of `continue_cycle`."""

    solution: MapOrbit
    what = "cycle"
    border = "BC"
    at_border = "border collision"

    def equations(
        self, form: tuple[int, ...], u: NDArray[np.float64], sizes: NDArray[np.float64] | None
    ) -> CycleZeroProblem:
        """See `AlgebraicRun.equations`; `form` is the itinerary."""
        system = self.solution.system
        p, index = system.parameter_vector(self.solution.parameters), system.parameter_names.index(self.name)
        problem = CycleProblem(system, form, p, [index], np.array([self.scale]))
        if sizes is None:
            sizes = in_lockstep(extents(problem, u), problem.period)
        return CycleZeroProblem(problem, sizes, self.interest)

    def given(self) -> tuple[tuple[int, ...], NDArray[np.float64]]:
        """See `AlgebraicRun.given`."""
        return itinerary_of(self.solution.system, self.solution.itinerary), self.solution.points.ravel().copy()

    def solution_at(self, branch: CycleZeroProblem, u: NDArray[np.float64]) -> MapOrbit:
        """See `AlgebraicRun.solution_at`."""
        return cycle_at(branch.problem, u, branch.sizes)

    def crossing(self, branch: CycleZeroProblem, event: Event) -> tuple[str, Crossing]:
        """See `AlgebraicRun.crossing`."""
        problem, (_, point, guard, _) = branch.problem, event.name
        found = beyond_border(problem, point, guard, event.point.u, branch.sizes)
        texts = [text for conditions in problem.system.conditions.values() for text in conditions]
        return texts[guard - len(problem.system.pieces)], found

    def inside(self, branch: CycleZeroProblem, event: Monitor) -> float:
        """See `AlgebraicRun.inside`."""
        return 1.0

    def returned(self, half: OneSide, branch: CycleZeroProblem, point: Point) -> bool:
        """See `AlgebraicRun.returned`; another of the cycle's points may be the first one by then."""
        here, sizes = self.solution_at(branch, point.u), branch.sizes[: branch.problem.states]
        for old in (found.solution for found in half.specials if found.name == self.border):
            assert isinstance(old, MapOrbit)
            near = abs(old.parameters[self.name] - self.value(point)) <= _RETURNED * self.scale
            for k in range(here.period if near else 0):
                turned = (*old.itinerary[k:], *old.itinerary[:k])
                away = np.abs(wrapped(np.roll(old.points, -k, axis=0) - here.points, here.system.angle_places))
                if turned == here.itinerary and np.all(away <= _RETURNED * sizes):
                    return True
        return False

    def leaves(self, branch: CycleZeroProblem, point: Point) -> str | None:
        """See `AlgebraicRun.leaves`: of several points on borders, each must move into its new piece."""
        problem = branch.problem
        for i, guard, height in problem.heights(point.u):
            gradient = problem.border(i, guard, point.u)[1]
            terms = np.abs(gradient[: problem.n]) @ branch.sizes
            if abs(height) <= TOGETHER * terms and float(gradient @ point.tangent) < -TOGETHER * terms:
                return "several points meet borders at once, and move to different sides of them"
        return None

    def starts(self, branch: CycleZeroProblem, origin: Point) -> list[Point]:
        """See `AlgebraicRun.starts`: gone round a circle, another of a cycle's points may be the first one."""
        problem = branch.problem
        if not problem.circles.size:
            return [origin]
        itinerary, found = problem.itinerary, []
        for k in range(problem.period):
            if itinerary[k:] + itinerary[:k] == itinerary:
                points = np.roll(problem.points(origin.u), -k, axis=0)
                found.append(replace(origin, u=np.append(points.ravel(), origin.u[problem.n :])))
        return found

    def closed_up(self, branch: CycleZeroProblem, point: Point) -> str | None:
        """See `AlgebraicRun.closed_up`: where the second half of a cycle meets the first one, its period halves."""
        problem = branch.problem
        half, odd = divmod(problem.period, 2)
        if odd or problem.itinerary[:half] != problem.itinerary[half:]:
            return None
        points, sizes = problem.points(point.u), branch.sizes[: problem.states]
        gaps = wrapped(points[:half] - points[half:], problem.system.angle_places)
        apart = float(np.max(np.abs(gaps) / sizes))
        return "the period halves" if apart < _HALVED else None
