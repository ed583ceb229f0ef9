"""Continuation of loci of equilibria along two parameters: saddle-nodes, Hopf points, boundary equilibria."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.problems.critical_points import critical_equilibrium
from saltus.continuation.problems.equilibrium_locus import EquilibriumLocusProblem
from saltus.continuation.results.equilibrium_locus import EquilibriumLocus
from saltus.continuation.runs.algebraic_locus import AlgebraicLocusRun
from saltus.continuation.runs.equilibrium import joined_fields
from saltus.equilibria.equilibrium import Equilibrium, equilibrium_at
from saltus.equilibria.problem import EquilibriumProblem

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.algebraic.conditions import Condition
    from saltus.continuation.core.monitor import Monitor
    from saltus.continuation.core.zero_problem import Point

__all__ = ["EquilibriumLocusRun"]

_ENDS = {
    "BT": "beyond it two real eigenvalues differ in sign alone: no Hopf points",
    "BE": "equilibria beyond it belong to another mode",
}  # special points at which a locus ends, and why


class EquilibriumLocusRun(AlgebraicLocusRun):
    """One call of `continue_locus` from an equilibrium; see `AlgebraicLocusRun`."""

    solution: Equilibrium
    codimension_two = ("CP", "BT", "GH", "ZH", "HH")
    zero_problem = EquilibriumLocusProblem

    def locus(self, order: tuple[str, ...], directions: str) -> EquilibriumLocus:
        """Return the locus, its parameters in the order that the user gave."""
        joined = self.joined(order, directions)
        return EquilibriumLocus(
            system=self.solution.system,
            parameters=dict(self.solution.parameters),
            frequency=np.array([point.examined.data.frequency for _, point in joined.rows]),
            **self.fields(joined, order, self.locus_options(directions)),
            **joined_fields(joined),
        )

    def equations(self, p: NDArray[np.float64], active: list[int]) -> EquilibriumProblem:
        """See `AlgebraicLocusRun.equations`."""
        system = self.solution.system
        return EquilibriumProblem(system, system.mode_index(self.solution.mode), p, active, self.scales)

    def given(self) -> NDArray[np.float64]:
        """See `AlgebraicLocusRun.given`."""
        return self.solution.state

    def solution_at(self, u: NDArray[np.float64], sizes: NDArray[np.float64]) -> Equilibrium:
        """See `AlgebraicLocusRun.solution_at`."""
        return equilibrium_at(self.branch.problem, u, sizes)

    def end(self, kind: str) -> str | None:
        """See `AlgebraicLocusRun.end`."""
        return _ENDS[kind] if kind in _ENDS and (kind != "BT" or self.kind == "HB") else None

    def met(self, name: Monitor) -> str:
        """See `AlgebraicLocusRun.met`."""
        return self.solution.system.transitions[name.transition].name if name.kind == "BE" else ""

    def passed(self, point: Point) -> str | None:
        """See `AlgebraicLocusRun.passed`."""
        return f"BT: {_ENDS['BT']}" if self.kind == "HB" and point.examined.data.frequency == 0.0 else None

    def condition(
        self, problem: EquilibriumProblem, u: NDArray[np.float64], sizes: NDArray[np.float64]
    ) -> tuple[Condition, NDArray[np.float64]]:
        """See `AlgebraicLocusRun.condition`."""
        return critical_equilibrium(self.kind, self.solution, problem, u, sizes)
