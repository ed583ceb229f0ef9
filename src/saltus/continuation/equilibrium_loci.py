"""Continuation of loci of equilibria along two parameters: saddle-nodes, Hopf points, boundary equilibria."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.algebraic_loci import AlgebraicLocusRun
from saltus.continuation.equilibria import joined_fields
from saltus.continuation.equilibrium_locus import EquilibriumLocus
from saltus.continuation.equilibrium_locus_problem import EquilibriumLocusProblem
from saltus.equilibria.critical import Boundary, Hopf, Singular
from saltus.equilibria.equilibrium import Equilibrium, equilibrium_at
from saltus.equilibria.problem import EquilibriumProblem
from saltus.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.monitor import Monitor
    from saltus.continuation.zero_problem import Point
    from saltus.equilibria.critical import Condition

__all__ = ["EquilibriumLocusRun"]

_CRITICAL = 1e-3  # distance of a start from its critical condition, over the largest eigenvalue
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
        values = self.solution.eigenvalues
        A = problem.evaluate(u)[1][:, : problem.n]
        top = max(float(np.linalg.norm(A * sizes / sizes[:, None], 2)), 1e-300)
        if self.kind == "SN":
            distance = float(np.abs(values).min()) / top if problem.n > 1 else 0.0
            self._check_critical(distance, "an eigenvalue 0")
            return Singular(problem, u, sizes), np.empty(0)
        if self.kind == "HB":
            pairs = values[values.imag > 0.0]
            small = np.sort(np.abs(values))[:2]
            if small.size > 1 and small[1] < _CRITICAL * top:  # a double zero, as at a BT
                pair, distance = 0j, float(small[1]) / top
            else:
                distances = np.abs(pairs.real) / top
                distance = float(distances.min(initial=math.inf))
                pair = complex(pairs[np.argmin(distances)]) if pairs.size else 0j
            self._check_critical(distance, "an imaginary pair of eigenvalues")
            condition = Hopf(problem, u, sizes, pair)
            return condition, condition.guess
        heights = {}
        for k in problem.ways_out:
            height, gradient = problem.event(k, u)
            heights[k] = abs(height) / (float(np.abs(gradient[: problem.n]) @ sizes) or 1.0)
        nearest = min(heights, key=heights.__getitem__, default=None)
        if nearest is None or not heights[nearest] < _CRITICAL:
            least = math.inf if nearest is None else heights[nearest]
            raise InputError(
                "start", f"{least:.3g} from the nearest surface", "an equilibrium on one", "a BE lies there"
            )
        return Boundary(problem, nearest), np.empty(0)

    def _check_critical(self, distance: float, wanted: str) -> None:
        if not distance < _CRITICAL:
            found = ", ".join(f"{v:.6g}" for v in self.solution.eigenvalues.tolist())
            raise InputError("start", f"eigenvalues {found}", f"an equilibrium with {wanted}, as every {self.kind} has")
