"""A locus of critical equilibria under way: saddle-nodes, Hopf points, boundary equilibria."""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING

from saltus.continuation.core.point_types import loci_through
from saltus.continuation.problems.equilibrium_locus import EquilibriumLocusProblem
from saltus.continuation.results.equilibrium_locus import EquilibriumLocus
from saltus.continuation.runs.algebraic_locus import AlgebraicLocusRun
from saltus.continuation.runs.equilibrium import equilibrium_columns
from saltus.continuation.runs.two_parameters import locus_run
from saltus.equilibria import Equilibrium

if TYPE_CHECKING:
    from saltus.continuation.core.monitor import Monitor
    from saltus.continuation.core.zero_problem import Point

__all__ = ["EquilibriumLocusRun"]


class EquilibriumLocusRun(AlgebraicLocusRun):
    """One call of `continue_locus` from an equilibrium; see `AlgebraicLocusRun`."""

    solution: Equilibrium
    zero_problem = EquilibriumLocusProblem
    result = EquilibriumLocus
    columns = staticmethod(equilibrium_columns)
    measured = ("coefficient", "frequency")
    loci = loci_through("equilibrium")
    ends_at = MappingProxyType(
        {
            "BT": "beyond it two real eigenvalues differ in sign alone: no Hopf points",
            "BE": "equilibria beyond it belong to another mode",
        }
    )

    def end(self, kind: str) -> str | None:
        """See `AlgebraicLocusRun.end`."""
        return super().end(kind) if kind != "BT" or self.kind == "HB" else None

    def met(self, name: Monitor) -> str:
        """See `AlgebraicLocusRun.met`."""
        return self.solution.system.transitions[name.transition].name if name.kind == "BE" else ""

    def passed(self, piece: EquilibriumLocusProblem, point: Point) -> str | None:
        """See `Run.passed`."""
        ended = self.kind == "HB" and point.examined.data.frequency == 0.0
        return f"BT: {self.ends_at['BT']}" if ended else None


@locus_run.register
def _(solution: Equilibrium) -> type[EquilibriumLocusRun]:
    return EquilibriumLocusRun
