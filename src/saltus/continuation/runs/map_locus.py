"""A locus of critical orbits of maps under way: critical multipliers, border collisions."""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING

from saltus.continuation.core.point_types import loci_through
from saltus.continuation.problems.map import grows_without_bound
from saltus.continuation.problems.map_locus import MapLocusProblem
from saltus.continuation.results.map_locus import MapLocus
from saltus.continuation.runs.algebraic_locus import AlgebraicLocusRun
from saltus.continuation.runs.map import begun_anywhere, map_orbit_columns
from saltus.continuation.runs.two_parameters import locus_run
from saltus.maps.orbit import MapOrbit

if TYPE_CHECKING:
    from saltus.continuation.core.monitor import Monitor
    from saltus.continuation.core.zero_problem import Point

__all__ = ["MapLocusRun"]


class MapLocusRun(AlgebraicLocusRun):
    """One call of `continue_locus` from an orbit of a map; see `AlgebraicLocusRun`."""

    solution: MapOrbit
    zero_problem = MapLocusProblem
    result = MapLocus
    columns = staticmethod(map_orbit_columns)
    measured = ("coefficient", "angle")
    loci = loci_through("map")
    ends_at = MappingProxyType(
        {
            "R1": "beyond it two real multipliers have the product 1",
            "R2": "beyond it two real multipliers have the product 1",
            "BC": "orbits beyond it belong to another itinerary",
        }
    )

    def end(self, kind: str) -> str | None:
        """See `AlgebraicLocusRun.end`."""
        return super().end(kind) if kind == "BC" or self.kind == "TR" else None

    def starts(self, piece: MapLocusProblem, origin: Point) -> list[Point]:
        """See `AlgebraicLocusRun.starts`."""
        return begun_anywhere(piece.problem, origin)

    def met(self, name: Monitor) -> str:
        """See `AlgebraicLocusRun.met`."""
        system = self.solution.system
        texts = [text for conditions in system.conditions.values() for text in conditions]
        return texts[name.transition - len(system.pieces)] if name.kind == "BC" else ""

    def passed(self, piece: MapLocusProblem, point: Point) -> str | None:
        """See `Run.passed`."""
        cosine = float(point.u[-3]) if self.kind == "TR" else 0.0
        return None if abs(cosine) < 1.0 else f"{'R1' if cosine > 0.0 else 'R2'}: {self.ends_at['R1']}"

    def unbounded(self, point: Point) -> str | None:
        """See `AlgebraicLocusRun.unbounded`."""
        return grows_without_bound(self.branch.sizes, self.first_sizes, point.tangent[-2:])


@locus_run.register
def _(solution: MapOrbit) -> type[MapLocusRun]:
    return MapLocusRun
