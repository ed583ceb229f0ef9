"""Continuation of loci of cycles of maps along two parameters: critical multipliers, border collisions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.problems.critical_points import critical_cycle
from saltus.continuation.problems.map import grows_without_bound, in_lockstep
from saltus.continuation.problems.map_locus import CycleLocusProblem
from saltus.continuation.results.map_locus import MapLocus
from saltus.continuation.runs.algebraic_locus import AlgebraicLocusRun
from saltus.continuation.runs.map import cycle_fields
from saltus.maps.orbit import MapOrbit, cycle_at, itinerary_of
from saltus.maps.problem import CycleProblem

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.algebraic.conditions import Condition
    from saltus.continuation.core.monitor import Monitor
    from saltus.continuation.core.zero_problem import Point

__all__ = ["CycleLocusRun"]

_ENDS = {
    "R1": "beyond it two real multipliers have the product 1",
    "R2": "beyond it two real multipliers have the product 1",
    "BC": "cycles beyond it belong to another itinerary",
}  # special points at which a locus ends, and why


class CycleLocusRun(AlgebraicLocusRun):
    """One call of `continue_locus` from a cycle of a map; see `AlgebraicLocusRun`."""

    solution: MapOrbit
    codimension_two = ("CP", "GPD", "CH", "R1", "R2", "R3", "R4", "FF")
    zero_problem = CycleLocusProblem

    def locus(self, order: tuple[str, ...], directions: str) -> MapLocus:
        """Return the locus, its parameters in the order that the user gave."""
        joined = self.joined(order, directions)
        data = [point.examined.data for _, point in joined.rows]
        return MapLocus(
            system=self.solution.system,
            parameters=dict(self.solution.parameters),
            angle=np.array([d.angle for d in data]),
            **self.fields(joined, order, self.locus_options(directions)),
            **cycle_fields(joined),
        )

    def equations(self, p: NDArray[np.float64], active: list[int]) -> CycleProblem:
        """See `AlgebraicLocusRun.equations`."""
        system = self.solution.system
        return CycleProblem(system, itinerary_of(system, self.solution.itinerary), p, active, self.scales)

    def given(self) -> NDArray[np.float64]:
        """See `AlgebraicLocusRun.given`."""
        return self.solution.points.ravel().copy()

    def extents(self, problem: CycleProblem, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `AlgebraicLocusRun.extents`."""
        return in_lockstep(super().extents(problem, u), problem.period)

    def solution_at(self, u: NDArray[np.float64], sizes: NDArray[np.float64]) -> MapOrbit:
        """See `AlgebraicLocusRun.solution_at`."""
        return cycle_at(self.branch.problem, u, sizes)

    def end(self, kind: str) -> str | None:
        """See `AlgebraicLocusRun.end`."""
        return _ENDS[kind] if kind in _ENDS and (kind == "BC" or self.kind == "TR") else None

    def met(self, name: Monitor) -> str:
        """See `AlgebraicLocusRun.met`."""
        system = self.solution.system
        texts = [text for conditions in system.conditions.values() for text in conditions]
        return texts[name.transition - len(system.pieces)] if name.kind == "BC" else ""

    def passed(self, point: Point) -> str | None:
        """See `AlgebraicLocusRun.passed`."""
        cosine = float(point.u[-3]) if self.kind == "TR" else 0.0
        return None if abs(cosine) < 1.0 else f"{'R1' if cosine > 0.0 else 'R2'}: {_ENDS['R1']}"

    def unbounded(self, point: Point) -> str | None:
        """See `AlgebraicLocusRun.unbounded`."""
        return grows_without_bound(self.branch.sizes, self.first_sizes, point.tangent[-2:])

    def condition(
        self, problem: CycleProblem, u: NDArray[np.float64], sizes: NDArray[np.float64]
    ) -> tuple[Condition, NDArray[np.float64]]:
        """See `AlgebraicLocusRun.condition`."""
        return critical_cycle(self.kind, self.solution, problem, u, sizes)
