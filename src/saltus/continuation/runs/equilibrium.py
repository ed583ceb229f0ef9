"""Continuation of equilibria along one parameter, across boundaries of modes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.continuation.core.arclength import StepControl
from saltus.continuation.core.interest import Interest
from saltus.continuation.core.monitor import Monitor
from saltus.continuation.core.zero_problem import Event
from saltus.continuation.problems.boundary import beyond_boundary
from saltus.continuation.problems.equilibrium import CRITICAL, EquilibriumZeroProblem
from saltus.continuation.problems.extents import extents
from saltus.continuation.results.equilibrium_branch import EquilibriumBranch
from saltus.continuation.runs.algebraic import AlgebraicRun, read_point_events
from saltus.continuation.runs.options import asked_types, checked_interval, read_stops, unit_of
from saltus.equilibria import Equilibrium
from saltus.equilibria.equilibrium import equilibrium_at
from saltus.equilibria.problem import EquilibriumProblem, check_autonomous
from saltus.progress import Report, Reporter

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.core.zero_problem import Point
    from saltus.continuation.problems.boundary import Crossing
    from saltus.continuation.runs.two_sided import BothSides

__all__ = ["continue_equilibrium", "joined_fields"]


def continue_equilibrium(
    equilibrium: Equilibrium,
    parameter: str,
    bounds: tuple[float, float],
    *,
    steps: StepControl | None = None,
    directions: str = "both",
    events: Mapping[str, float | str] | None = None,
    stop_at: str | Iterable[str] = (),
    progress: bool | Report = False,
) -> EquilibriumBranch:
    """Return the branch of equilibria through an equilibrium, as one parameter varies.

    Saddle-nodes (SN), Hopf points (HB), branch points (BP) and boundary equilibria (BE) are located by Newton's method.
    At a BE the branch goes on in the neighbouring mode, where the field is continuous; else it ends.
    docs/theory/equilibria.md derives the test functions.

    Parameters
    ----------
    equilibrium : Equilibrium
        Where the branch starts.
    parameter : str
        The parameter that varies.
    bounds : (float, float)
        Interval of the parameter; the start must lie in it.
    steps : StepControl, optional
        Sizes of steps and their limits. With ``at_grazing="pass"`` the branch goes on in the same mode at a BE, its
        equilibria virtual.
    directions : {"both", "up", "down"}
        Which way the parameter goes at the start.
    events : mapping of str to float or "extremum", optional
        Users' events: ``{"x": 0.5}`` records where a state, an output or the parameter passes the value. ``{"x":
        "extremum"}`` records where the state or output has an extremum along the branch, of type ``EX``.
    stop_at : str or iterable of str, optional
        Types of special points, as ``"HB"`` or a key of `events`; the branch ends at the first.
    progress : bool or callable
        True for a bar on stderr, or a function called with a `saltus.Progress` after each point.

    Returns
    -------
    EquilibriumBranch
        All points found, however the branch ended: `stopped` says why. An interrupt (Ctrl-C) ends it likewise.

    Raises
    ------
    InputError
        A name, bounds or an option that cannot be used.

    Examples
    --------
    >>> from saltus import HybridSystem, Mode, find_equilibrium
    >>> brusselator = HybridSystem(
    ...     ("x", "y"), {"A": 1.0, "B": 1.5}, {"flow": Mode({"x": "A - (B + 1)*x + x**2*y", "y": "B*x - x**2*y"})}
    ... )
    >>> branch = continue_equilibrium(find_equilibrium(brusselator, x0=[1.0, 1.0]), "B", (1.0, 3.0))
    >>> branch["HB1"].parameters["B"], branch["HB1"].normal_form.criticality
    (2.0, 'supercritical')
    """
    control = StepControl() if steps is None else checks.instance("steps", steps, StepControl)
    checks.instance("equilibrium", equilibrium, Equilibrium)
    reporter = Reporter(progress)
    system = equilibrium.system
    check_autonomous(system)
    low, high = checked_interval(system, equilibrium.parameters, parameter, bounds, directions)
    events = checks.mapping("events", events, "names to values, as {'x': 0.5}, or to 'extremum'")
    scale = unit_of(low, high, equilibrium.parameters[parameter])
    interest = Interest(low / scale, high / scale, scale, read_point_events(equilibrium, parameter, events))
    run = _EquilibriumRun(
        equilibrium, parameter, interest, control, read_stops(stop_at, [*CRITICAL, *asked_types(events)]), reporter
    )
    joined = run.joined(directions)
    return EquilibriumBranch(
        options=run.options([low, high], directions, events), **run.branch_fields(joined), **joined_fields(joined)
    )


def joined_fields(joined: BothSides) -> dict[str, Any]:
    """Return the fields of `EquilibriumCurve` that a branch and a locus fill in the same way."""
    n = joined.rows[0][0].n
    data = [point.examined.data for _, point in joined.rows]
    return {
        "states": np.array([point.u[:n] for _, point in joined.rows]),
        "eigenvalues": np.array([d.values for d in data]),
        "stable": np.array([d.stable for d in data]),
        "regular": np.array([not d.reasons for d in data]),
        "mode": np.array([piece.problem.mode for piece, _ in joined.rows]),
        "residual": np.array([point.residual for _, point in joined.rows]),
        "arclength": np.array(joined.arcs) - joined.arcs[0],
        "stopped": joined.stopped,
    }


class _EquilibriumRun(AlgebraicRun):
    """One call of `continue_equilibrium`."""

    solution: Equilibrium
    what = "equilibrium"
    border = "BE"
    at_border = "boundary equilibrium"

    def equations(self, form: int, u: NDArray[np.float64], sizes: NDArray[np.float64] | None) -> EquilibriumZeroProblem:
        """See `AlgebraicRun.equations`; `form` is the mode."""
        system = self.solution.system
        p, index = system.parameter_vector(self.solution.parameters), system.parameter_names.index(self.name)
        problem = EquilibriumProblem(system, form, p, [index], np.array([self.scale]))
        return EquilibriumZeroProblem(problem, extents(problem, u) if sizes is None else sizes, self.interest)

    def given(self) -> tuple[int, NDArray[np.float64]]:
        """See `AlgebraicRun.given`."""
        return self.solution.system.mode_index(self.solution.mode), self.solution.state

    def solution_at(self, branch: EquilibriumZeroProblem, u: NDArray[np.float64]) -> Equilibrium:
        """See `AlgebraicRun.solution_at`."""
        return equilibrium_at(branch.problem, u, branch.sizes)

    def crossing(self, branch: EquilibriumZeroProblem, event: Event) -> tuple[str, Crossing]:
        """See `AlgebraicRun.crossing`."""
        at, point = event.name.transition, event.point
        found = beyond_boundary(branch.problem, at, point.u, point.tangent, branch.sizes)
        return branch.problem.system.transitions[at].name, found

    def inside(self, branch: EquilibriumZeroProblem, event: Monitor) -> float:
        """See `AlgebraicRun.inside`."""
        return -float(branch.problem.system.transitions[event.transition].direction or 1)

    def ended(self, branch: EquilibriumZeroProblem, point: Point, kind: str) -> str | None:
        """See `AlgebraicRun.ended`."""
        return f"the domain of mode {self.solution.mode} ends" if kind == "domain" else None
