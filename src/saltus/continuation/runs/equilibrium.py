"""A branch of equilibria under way, across boundaries of modes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.continuation.problems.boundary import TWO_FOLD, Crossing, beyond_boundary
from saltus.continuation.problems.equilibrium import EquilibriumZeroProblem
from saltus.continuation.results.equilibrium_branch import EquilibriumBranch
from saltus.continuation.runs.algebraic import AlgebraicRun, algebraic_columns
from saltus.continuation.runs.one_parameter import branch_run
from saltus.equilibria import Equilibrium
from saltus.equilibria.problem import check_autonomous
from saltus.equilibria.pseudo import beside_two_fold

if TYPE_CHECKING:
    from saltus.continuation.core.monitor import Monitor
    from saltus.continuation.core.zero_problem import Event, Point
    from saltus.continuation.runs.two_sided import BothSides

__all__ = ["EquilibriumRun", "equilibrium_columns"]


def equilibrium_columns(joined: BothSides) -> dict[str, Any]:
    """Return the fields of `EquilibriumCurve` that a branch and a locus fill in the same way."""
    n = joined.rows[0][0].n
    return algebraic_columns(joined) | {
        "states": np.array([point.u[:n] for _, point in joined.rows]),
        "eigenvalues": np.array([point.examined.data.values for _, point in joined.rows]),
        "mode": np.array([piece.problem.mode for piece, _ in joined.rows]),
    }


class EquilibriumRun(AlgebraicRun):
    """One call of `continue_branch` from an equilibrium; see `AlgebraicRun`."""

    solution: Equilibrium
    zero_problem = EquilibriumZeroProblem
    result = EquilibriumBranch
    columns = staticmethod(equilibrium_columns)
    types = EquilibriumZeroProblem.critical
    what = "equilibrium"
    border = "BE"
    at_border = "boundary equilibrium"

    def crossing(self, branch: EquilibriumZeroProblem, event: Event) -> tuple[str, Crossing]:
        """See `AlgebraicRun.crossing`."""
        point = event.point
        if self.passes(branch, point):
            return branch.problem.system.transitions[event.name.transition].name, Crossing(
                TWO_FOLD, branch, point.u, point.tangent
            )
        at = self._happening(branch, event.name.transition, point)
        found = beyond_boundary(branch.problem, at, point.u, point.tangent, branch.sizes)
        return branch.problem.system.transitions[at].name, found

    @staticmethod
    def _happening(branch: EquilibriumZeroProblem, transition: int, point: Point) -> int:
        """Return which of the transitions with the same event happens at a point: one whose condition holds."""
        problem = branch.problem
        transitions, modes = problem.system.transitions, len(problem.system.modes)
        alike = [k for k in problem.ways_out if transitions[k].event == transitions[transition].event]
        return next((k for k in alike if problem.guard(modes + k, point.u) > 0.0), transition)

    def inside(self, branch: EquilibriumZeroProblem, event: Monitor) -> float:
        """See `AlgebraicRun.inside`."""
        return -float(branch.problem.system.transitions[event.transition].direction or 1)

    def ended(self, branch: EquilibriumZeroProblem, point: Point, kind: str) -> str | None:
        """See `AlgebraicRun.ended`."""
        return f"the domain of mode {self.solution.mode} ends" if kind == "domain" else None

    def passes(self, branch: EquilibriumZeroProblem, point: Point) -> bool:
        """See `AlgebraicRun.passes`: at a two-fold the pseudo-equilibrium goes on."""
        return beside_two_fold(branch.problem, point.u, branch.sizes) is not None


@branch_run.register
def _(start: Equilibrium, parameter: str) -> type[EquilibriumRun]:
    check_autonomous(start.system)
    return EquilibriumRun
