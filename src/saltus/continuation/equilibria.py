"""Continuation of equilibria along one parameter, across boundaries of modes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.continuation.arclength import StepControl, follow
from saltus.continuation.boundary import Crossing, beyond_boundary
from saltus.continuation.equilibrium_branch import EquilibriumBranch
from saltus.continuation.equilibrium_problem import CRITICAL, EquilibriumZeroProblem, closes, extents
from saltus.continuation.monitor import Monitor
from saltus.continuation.options import checked_interval, read_stops, unit_of
from saltus.continuation.orbit_problem import Interest
from saltus.continuation.run import Going, OneParameterRun
from saltus.continuation.two_sided import BothSides, Found, OneSide, join, traced, turned
from saltus.continuation.zero_problem import Event, Point, start_point
from saltus.equilibria import Equilibrium
from saltus.equilibria.critical import solve_branch_point, solve_saddle_node
from saltus.equilibria.equilibrium import equilibrium_at
from saltus.equilibria.normal_forms import normal_form
from saltus.equilibria.problem import EquilibriumProblem, check_autonomous
from saltus.errors import InputError, nearest
from saltus.progress import Report, Reporter

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["continue_equilibrium", "joined_fields"]

_AT_START = 1e-10  # test function, over its usual size, up to which a start is critical
_TURNS = 1e-5  # change of the parameter per unit of arclength, up to which a start may be a saddle-node
_ASIDE = 1e-4  # arclength by which a critical start is moved aside
_ON_SURFACE = 1e-9  # event function, over its variation with the states' sizes, up to which a state is on the surface
_NEAR = 1e-3  # distance in arclength between a special point and the zero of its test function


def continue_equilibrium(
    equilibrium: Equilibrium,
    parameter: str,
    bounds: tuple[float, float],
    *,
    steps: StepControl | None = None,
    directions: str = "both",
    events: Mapping[str, float] | None = None,
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
    events : mapping of str to float, optional
        Users' events: ``{"x": 0.5}`` records where a state, an output or the parameter passes the value.
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
    events = checks.mapping("events", events, "names to values, as {'x': 0.5}")
    scale = unit_of(low, high, equilibrium.parameters[parameter])
    interest = Interest(low / scale, high / scale, scale, _read_events(equilibrium, parameter, events))
    run = _Run(equilibrium, parameter, interest, control, read_stops(stop_at, [*CRITICAL, *events]), reporter)
    start = run.begin(directions)
    with reporter:
        halves = traced(lambda sign: run.trace(start, sign), directions)
    joined = join(start, halves, "branch")
    if (fold := run.fold_at_start(*start, halves)) is not None:
        own = (fold, float(joined.offset), 0.0)
        joined.specials = sorted([*joined.specials, own], key=lambda item: item[2])
    return EquilibriumBranch(
        system=system,
        parameter=parameter,
        parameters=dict(equilibrium.parameters),
        values=np.array([point.parameter * scale for _, point in joined.rows]),
        special_points=joined.special_points((parameter,)),
        rejected=run.rejected(),
        options=run.options([low, high], directions, events),
        **joined_fields(joined),
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


def _read_events(
    equilibrium: Equilibrium, parameter: str, events: Mapping[str, float]
) -> tuple[tuple[str, str, float], ...]:
    """Return (name, kind, value) for each user's event; kind is ``parameter``, ``state`` or ``output``."""
    system, found = equilibrium.system, []
    kinds = dict.fromkeys(system.output_names, "output") | dict.fromkeys(system.states, "state")
    kinds |= {parameter: "parameter"}
    for name, given in events.items():
        value = checks.number(f"events[{name!r}]", given)
        if name not in kinds:
            raise InputError("events", name, f"one of {', '.join(kinds)}", nearest(name, kinds))
        found.append((name, kinds[name], value))
    return tuple(found)


class _Run(OneParameterRun):
    """One call of `continue_equilibrium`: start and options, which both directions share."""

    odd = EquilibriumZeroProblem.odd

    def __init__(self, equilibrium: Equilibrium, *options: Any) -> None:
        super().__init__(*options)
        self.equilibrium = equilibrium

    def equations(self, mode: int, u: NDArray[np.float64], sizes: NDArray[np.float64] | None) -> EquilibriumZeroProblem:
        """Return the zero problem of a mode near `u`, the states of the given sizes."""
        system = self.equilibrium.system
        p, index = system.parameter_vector(self.equilibrium.parameters), system.parameter_names.index(self.name)
        problem = EquilibriumProblem(system, mode, p, [index], np.array([self.scale]))
        return EquilibriumZeroProblem(problem, extents(problem, u) if sizes is None else sizes, self.interest)

    def begin(self, directions: str) -> tuple[EquilibriumZeroProblem, Point]:
        """Return the equations and the first point, its tangent towards growing parameter."""
        u = np.append(self.equilibrium.state, self.start_value(self.equilibrium.parameters))
        branch = self.equations(self.equilibrium.system.mode_index(self.equilibrium.mode), u, None)
        try:
            point = start_point(branch, u)
        except (ValueError, np.linalg.LinAlgError) as error:
            hint = f"the equations have no regular branch there: {error}"
            raise InputError("equilibrium", self.equilibrium.mode, "a regular equilibrium", hint) from None
        point.examined = branch.examine(point, None)
        return branch, self._aside(branch, point, directions)

    def _aside(self, branch: EquilibriumZeroProblem, point: Point, directions: str) -> Point:
        """Return a start that is not critical: a critical one is moved a little, away from where the branch goes."""
        critical = [name for name, value in point.examined.monitors.items() if name.kind in CRITICAL
                    and name.kind != "SN" and (abs(value) < _AT_START or math.isnan(value))]  # fmt: skip
        if not critical:
            return point
        sign = 1.0 if directions == "down" else -1.0
        way = turned(point, sign, self.odd)
        short = StepControl(initial=_ASIDE, smallest=_ASIDE / 16.0, largest=_ASIDE)
        for item in follow(branch, way, short, log=[]):
            if isinstance(item, Point):
                inside = self.interest.low < item.parameter < self.interest.high
                if not inside:
                    return point
                item.arc = 0.0
                item.examined = branch.examine(item, None)
                return turned(item, sign, self.odd)
            if isinstance(item, str):
                break
        return point

    def piece(
        self,
        half: OneSide,
        branch: EquilibriumZeroProblem,
        point: Point,
        start: tuple[EquilibriumZeroProblem, Point],
        first: float | None,
    ) -> str | Going:
        """Follow the equilibria of one mode; see `OneParameterRun.piece`."""
        last = point
        ahead = partial(branch.ahead, self.control)
        for item in follow(branch, point, self.control, log=self.log, first_step=first, ahead=ahead):
            if isinstance(item, str):
                return f"{self.place(last)}: {item}"
            if isinstance(item, Event):
                if (end := self._event(half, branch, item)) is not None:
                    return end
                continue
            if branch is start[0] and closes(start[1], last, item, self.control):
                half.points.append(start)
                half.closed = True
                return "the branch is closed"
            if (end := self.keep(half, branch, item)) is not None:
                return end
            last = item
        raise AssertionError("follow ends with a reason")

    def _event(self, half: OneSide, branch: EquilibriumZeroProblem, event: Event) -> str | Going | None:
        kind, point = event.name.kind, event.point
        if kind in ("low", "high"):
            return self.at_bound(half, branch, point, kind)
        if kind == "domain":
            half.points.append((branch, point))
            return f"{self.place(point)}: the domain of mode {self.equilibrium.mode} ends"
        name = self.interest.events[event.name.segment][0] if kind == "event" else kind
        if kind in ("SN", "BP"):
            solve = solve_branch_point if kind == "BP" else solve_saddle_node
            u = solve(branch.problem, point.u, branch.sizes)
            if u is not None and float(point.weights @ (u - point.u) ** 2) < _NEAR**2:
                point.u = u
        if kind != "BE":
            half.specials.append(self._found(name, branch, event, half))
            return self.end_at(half, branch, point, name)
        transition = branch.problem.system.transitions[event.name.transition]
        crossing = beyond_boundary(branch.problem, event.name.transition, point.u, point.tangent, branch.sizes)
        found = self._found(name, branch, event, half)
        half.specials.append(replace(found, of=transition.name, kind=crossing.kind))
        if (end := self.end_at(half, branch, point, name)) is not None:
            return end
        if self.control.at_grazing == "pass":
            return None
        half.points.append((branch, point))
        if crossing.u is None:
            return f"{self.place(point)}: boundary equilibrium, {crossing.reason}"
        return self._switch(branch, crossing, point)

    def _switch(self, branch: EquilibriumZeroProblem, crossing: Crossing, old: Point) -> str | Going:
        """Return equations, point and step to go on with in the neighbouring mode, or why no branch does."""
        assert crossing.u is not None
        beside = self.equations(crossing.mode, crossing.u, branch.sizes)
        try:
            point = start_point(beside, crossing.u)
        except (ValueError, np.linalg.LinAlgError) as error:
            return f"{self.place(old)}: boundary equilibrium, no branch goes on: {error}"
        point = turned(point, crossing.sign(point), self.odd)
        point.arc = old.arc
        found = beside.examine(point, None)
        # on a surface the sign of its event function is rounding: the point counts as on the regular side
        system = beside.problem.system
        monitors = {
            name: -_ON_SURFACE * (system.transitions[name.transition].direction or 1)
            if name.kind == "BE" and abs(value) < _ON_SURFACE else value
            for name, value in found.monitors.items()
        }  # fmt: skip
        point.examined = replace(found, monitors=monitors)
        return beside, point, self.control.initial

    def fold_at_start(self, branch: EquilibriumZeroProblem, origin: Point, halves: list[OneSide]) -> Found | None:
        """Return the saddle-node at which the branch starts; None where it starts at none, or where it was located."""
        located = (found for half in halves for found in half.specials if found.name == "SN")
        if abs(float(origin.tangent[-1])) > _TURNS or any(abs(found.arc) < _ASIDE for found in located):
            return None
        u = solve_saddle_node(branch.problem, origin.u, branch.sizes)
        if u is None or float(origin.weights @ (u - origin.u) ** 2) > _ASIDE**2:
            return None
        if normal_form(branch.problem, u, "SN").coefficient == 0.0:
            return None
        at = replace(origin, u=u)
        return self._found("SN", branch, Event(Monitor("SN"), at, float(origin.tangent[-1])), OneSide())

    def _found(self, name: str, branch: EquilibriumZeroProblem, event: Event, half: OneSide) -> Found:
        point = event.point
        solution = equilibrium_at(branch.problem, point.u, branch.sizes)
        p = {**solution.parameters, self.name: self.value(point)}
        tangent = None
        if name == "BP":  # it is undetermined at the point itself: the last point's is taken
            last = half.points[-1][1] if half.points else point
            tangent = last.tangent.copy()
            tangent[-1] *= self.scale
        solution = replace(solution, parameters=p)
        return Found(
            name, solution, event.value, len(half.points), point.arc, tangent=tangent, scale=branch.sizes.copy()
        )
