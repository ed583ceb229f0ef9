"""Continuation of branches: periodic orbits along one parameter, through grazings into other signatures."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.continuation.arclength import StepControl, follow
from saltus.continuation.branch import Branch
from saltus.continuation.closure import passes
from saltus.continuation.grazing import Neighbour, neighbour
from saltus.continuation.monitor import BIFURCATIONS, at_grazing
from saltus.continuation.options import read_events, read_interval, read_stops, unit_of
from saltus.continuation.orbit_problem import Interest, OrbitData, OrbitZeroProblem
from saltus.continuation.period_halving import halved
from saltus.continuation.run import Going, OneParameterRun
from saltus.continuation.shrinking import equilibrium_ahead
from saltus.continuation.two_sided import SAME, Found, OneSide, join, traced, turned
from saltus.continuation.unbounded import grows_at_last, grows_for_ever, too_stiff
from saltus.continuation.zero_problem import Event, Examined, Point, start_point
from saltus.errors import InputError
from saltus.orbits.critical import solve_branch_point
from saltus.orbits.cuts import cut, stretched
from saltus.orbits.floquet import distance_from_circle
from saltus.orbits.orbit import PeriodicOrbit, orbit_at
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.rounds import divided
from saltus.orbits.signature import Signature, Survey
from saltus.progress import Report, Reporter

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["continue_orbit"]

_TOUCHING = 1e-13  # value given to a monitor function that vanishes at the start: its admissible side
_NEAR = 1e-3  # distance in arclength between a branch point and the zero of its determinant


def continue_orbit(
    orbit: PeriodicOrbit,
    parameter: str,
    bounds: tuple[float, float],
    *,
    steps: StepControl | None = None,
    directions: str = "both",
    events: Mapping[str, float] | None = None,
    stop_at: str | Iterable[str] = (),
    progress: bool | Report = False,
) -> Branch:
    """Return the branch of periodic orbits through an orbit, as one parameter varies.

    Saddle-nodes (SN), period doublings (PD), torus bifurcations (TR), branch points (BP) and grazings (GR) are located
    by Newton's method. At a grazing the branch goes on in the neighbouring signature, or ends where there is none. An
    orbit that repeats a shorter one there goes on as the shorter one. `StepControl.at_grazing` and `stop_at` change
    this. A branch of doubled period ends where the period halves. A branch of autonomous cycles ends at the Hopf point
    (HB) to which the cycle shrinks. Points with a residual above 1e-8 of the orbit's size are rejected.
    docs/theory/continuation.md derives the method.

    Parameters
    ----------
    orbit : PeriodicOrbit
        Where the branch starts.
    parameter : str
        The parameter that varies.
    bounds : (float, float)
        Interval of the parameter; the start must lie in it.
    steps : StepControl, optional
        Sizes of steps and their limits, and how the branch goes on at a grazing.
    directions : {"both", "up", "down"}
        Which way the parameter goes at the start.
    events : mapping of str to float, optional
        Users' events. ``{"gap": 0.02}`` records where an extreme of that output or state passes the value. With
        ``"min_gap"`` or ``"max_gap"`` only one extreme counts. With the parameter's name, the parameter passes the
        value.
    stop_at : str or iterable of str, optional
        Types of special points, as ``"SN"`` or a key of `events`; the branch ends at the first.
    progress : bool or callable
        True for a bar on stderr, or a function called with a `saltus.Progress` after each point.

    Returns
    -------
    Branch
        All points found, however the branch ended: `Branch.stopped` says why. An interrupt (Ctrl-C) ends it likewise.

    Raises
    ------
    InputError
        A name, bounds or an option that cannot be used.

    Examples
    --------
    >>> from saltus import HybridSystem, Mode, Transition, solve_orbit
    >>> oscillator = HybridSystem(
    ...     ("x", "v"), {"k": 1.0, "c": 0.1, "d": 1.0, "e": 0.8, "w": 1.0, "A": 1.0},
    ...     {"free": Mode({"x": "v", "v": "A*cos(s) - c*v - k*x"})},
    ...     [Transition("free", "free", "x - d", 1, {"v": "-e*v"}, name="impact")], phase=("s", "w"),
    ... )
    >>> orbit = solve_orbit(oscillator, {}, [("free", "impact", [1.0, -1.3, 0.1], 6.28)])
    >>> branch = continue_orbit(orbit, "A", (0.05, 1.2))
    >>> f"{branch['SN1'].parameters['A']:.9f} {branch['GR1'].parameters['A']:.9f}"
    '0.099970754 0.100000000'
    """
    control = StepControl() if steps is None else checks.instance("steps", steps, StepControl)
    checks.instance("orbit", orbit, PeriodicOrbit)
    reporter = Reporter(progress)
    low, high = read_interval(orbit, parameter, bounds, directions)
    events = checks.mapping("events", events, "names to values, as {'gap': 0.02}")
    wanted = read_events(orbit, parameter, events)
    stops = read_stops(stop_at, [*BIFURCATIONS, *events])
    scale = unit_of(low, high, orbit.parameters[parameter])
    interest = Interest(low / scale, high / scale, scale, wanted)
    run = _Run(orbit, parameter, interest, control, stops, reporter)
    start = run.begin()
    with reporter:
        halves = traced(lambda sign: run.trace(start, sign), directions)
    options = run.options([low, high], directions, events)
    return _assemble(orbit, parameter, scale, start, halves, run, options)


class _Run(OneParameterRun):
    """One call of `continue_orbit`: start and options, which both directions share."""

    odd = OrbitZeroProblem.odd

    def __init__(self, orbit: PeriodicOrbit, *options: Any) -> None:
        super().__init__(*options)
        self.orbit, self.index = orbit, orbit.system.parameter_names.index(self.name)

    def equations(self, signature: Signature, u: NDArray[np.float64]) -> OrbitZeroProblem:
        """Return the zero problem of a signature near `u`."""
        p = self.orbit.system.parameter_vector(self.orbit.parameters)
        scale, tolerance = np.array([self.scale]), self.orbit.tolerance
        problem = OrbitProblem(self.orbit.system, signature, p, [self.index], scale, tolerance)
        problem.start(u)
        return OrbitZeroProblem(problem, u, self.interest)

    def _cut(
        self, half: OneSide, branch: OrbitZeroProblem, item: Point
    ) -> tuple[OrbitZeroProblem, Point, float] | None:
        """Return the branch with its orbits cut into more pieces, a point and a step; None where no cut is due."""
        if not stretched(branch.problem, item.J):
            return None
        problem, u = cut(branch.problem, item.u, item.J)
        finer = OrbitZeroProblem(problem, u, self.interest)
        try:
            point = start_point(finer, u)
        except ValueError:
            return None
        # the first piece starts at the old place: its tangent gives the direction of the branch
        own = np.append(np.arange(branch.n), -1)
        along = float((item.weights[own] * item.tangent[own]) @ point.tangent[own])
        point = replace(point, tangent=math.copysign(1.0, along) * point.tangent, arc=item.arc)
        point.sign = math.copysign(1.0, along) * point.sign
        point.examined = finer.examine(point, None)
        step = item.arc - half.points[-2][1].arc if len(half.points) > 1 else self.control.initial
        return finer, point, step

    def begin(self) -> tuple[OrbitZeroProblem, Point]:
        """Return the equations and the first point, its tangent towards growing parameter."""
        u = np.append(self.orbit.unknowns, self.start_value(self.orbit.parameters))
        branch = self.equations(self.orbit.form, u)
        try:
            point = start_point(branch, u)
        except ValueError as error:
            hint = f"the equations have no regular branch there: {error}"
            raise InputError("orbit", self.orbit.signature, "a regular periodic orbit", hint) from None
        if stretched(branch.problem, point.J):
            problem, u = cut(branch.problem, point.u, point.J)
            branch = OrbitZeroProblem(problem, u, self.interest)
            point = start_point(branch, u)
        found = branch.examine(point, None)
        # a start at a grazing counts as on its admissible side, whatever the rounding
        monitors = {
            name: _TOUCHING if at_grazing(name) and abs(value) < SAME * SAME else value
            for name, value in found.monitors.items()
        }
        data: OrbitData = found.data
        if any(value == _TOUCHING and name.kind in ("duration", "rate") for name, value in monitors.items()):
            # multipliers mean nothing at a grazing
            monitors = {name: value for name, value in monitors.items() if name.kind != "TR"}
            data = replace(data, followed=())
        point.examined = replace(found, monitors=monitors, data=data)
        return branch, point

    def restart(self, branch: OrbitZeroProblem, origin: Point) -> None:
        """Make meshes for the start: they are still those of the other direction's end."""
        branch.problem.start(origin.u)

    def piece(
        self,
        half: OneSide,
        branch: OrbitZeroProblem,
        point: Point,
        start: tuple[OrbitZeroProblem, Point],
        first: float | None,
    ) -> str | Going:
        """Follow the orbits of one signature; see `OneParameterRun.piece`."""
        last = point
        for item in follow(branch, point, self.control, log=self.log, first_step=first):
            if isinstance(item, str):
                reason = grows_at_last(half.points) or too_stiff(branch.problem) or item
                return f"{self.place(last)}: {reason}"
            if isinstance(item, Event):
                end = self._event(half, branch, item)
                if end is not None:
                    return end
                continue
            same = branch.problem.signature == start[0].problem.signature and not (
                branch is start[0] and last.arc == 0.0
            )
            if same and passes(branch, branch.problem, start[1], last, item, self.control):
                half.points.append((start[0], start[1]))
                half.closed = True
                return "the branch is closed"
            end = self.keep(half, branch, item)
            if (rest := equilibrium_ahead(branch, last, item)) is not None:
                return self._shrunk(half, *rest)
            if end is not None:
                return end
            last = item
            if (grown := grows_for_ever(half.points)) is not None:
                return f"{self.place(item)}: {grown}"
            if (finer := self._cut(half, branch, item)) is not None:
                return finer
        raise AssertionError("follow ends with a reason")

    def _shrunk(self, half: OneSide, piece: OrbitZeroProblem, end: Point) -> str:
        """End a branch at the Hopf point that is its last point."""
        data = end.examined.data
        orbit = orbit_at(piece.problem, end.u, end.J, data.survey, data.multipliers)
        half.specials.append(Found("HB", orbit, _amplitude(orbit), len(half.points), end.arc))
        half.points.append((piece, end))
        return f"{self.place(end)}: the cycle shrinks to an equilibrium"

    def _event(self, half: OneSide, branch: OrbitZeroProblem, event: Event) -> str | Going | None:
        kind = event.name.kind
        point = event.point
        if kind in ("low", "high"):
            return self.at_bound(half, branch, point, kind)
        if kind == "event":
            name = self.interest.events[event.name.segment][0]
        elif at_grazing(event.name):
            name = "GR"
        else:
            name = kind
        if name == "BP" and (birth := halved(branch, point)) is not None:
            half.specials.append(_found(name, branch, replace(event, point=birth), half))
            half.points.append((branch, birth))
            return f"{self.place(birth)}: the period halves"
        if name != "GR":
            if name == "BP":
                event = replace(event, point=_sharpened(branch, point))
            half.specials.append(_found(name, branch, event, half))
            return self.end_at(half, branch, event.point, name)
        if any(s.name == "GR" and abs(s.arc - point.arc) < 1e-9 for s in half.specials):
            return None
        if self.control.at_grazing == "pass":
            half.specials.append(_found(name, branch, event, half))
            return self.end_at(half, branch, point, name)
        found = neighbour(branch.problem, event.name, point.u)
        half.specials.append(_found(name, branch, event, half))
        if isinstance(found, Neighbour) and len(found.signature) < len(branch.problem.signature.heads):
            fewer = self.equations(found.signature, found.u)
            orbit = orbit_at(fewer.problem, found.u, fewer.problem.resolve(found.u)[1])
            half.specials[-1] = replace(half.specials[-1], solution=orbit)
        half.points.append((branch, point))
        if name in self.stops:
            return f"{self.place(point)}: grazing"
        if isinstance(found, str):
            return f"{self.place(point)}: grazing, {found}"
        return self._switch(found, point)

    def _switch(self, found: Neighbour, old: Point) -> str | Going:
        """Return equations, point and step to go on with in the neighbouring signature, or why no branch does.

        The point is a first admissible orbit beyond the grazing.
        """
        branch = self.equations(found.signature, found.u)
        if (once := divided(branch.problem, found.u, 2, SAME * branch.problem.state_scale)) is not None:
            found = Neighbour(*once)
            branch = self.equations(found.signature, found.u)
        try:
            point = start_point(branch, found.u)
        except ValueError as error:
            return f"{self.place(old)}: grazing, no branch goes on: {error}"
        point.arc = old.arc
        onward = math.copysign(1.0, float(old.tangent[-1]))
        for probe in (1e-5, 1e-6, 1e-4):
            for sign in (onward, -onward):
                start = turned(point, sign, OrbitZeroProblem.odd)
                start.examined = Examined({}, None, OrbitData(_INADMISSIBLE, np.empty(0, complex), 0))
                trial = follow(
                    branch, start, StepControl(initial=probe, smallest=probe / 4, largest=probe),
                     log=[],
                )  # fmt: skip
                item = next(trial)
                if isinstance(item, Point) and _beyond_grazings(branch.problem, item):
                    item.arc = old.arc + math.sqrt(float(point.weights @ (item.u - point.u) ** 2))
                    return branch, item, min(self.control.initial, 1e-3)
        return f"{self.place(old)}: grazing, no admissible orbit beyond it"


# Survey of a grazing from which a step is tried: its orbit passes as inadmissible, so the step's end may be so too.
_INADMISSIBLE = Survey(1, False, np.empty(0), np.empty(0), np.empty(0), np.empty(0), np.empty(0), np.empty(0))


def _beyond_grazings(problem: OrbitProblem, point: Point) -> bool:
    """Return whether a point is admissible and all its monitor functions of grazings are on that side."""
    monitors, transitions = point.examined.monitors.items(), problem.system.transitions
    grazings = (
        # an event in both directions has no admissible side
        abs(value) if name.kind == "side" and transitions[name.transition].direction == 0 else value
        for name, value in monitors
        if at_grazing(name) and not math.isnan(value)
    )
    return point.examined.data.survey.admissible and all(value > 0.0 for value in grazings)


def _assemble(
    orbit: PeriodicOrbit,
    parameter: str,
    scale: float,
    start: tuple[OrbitZeroProblem, Point],
    halves: list[OneSide],
    run: _Run,
    options: dict[str, Any],
) -> Branch:
    joined = join(start, halves, "branch")
    return Branch(
        system=orbit.system,
        parameter=parameter,
        parameters=dict(orbit.parameters),
        values=np.array([p.parameter * scale for _, p in joined.rows]),
        special_points=joined.special_points((parameter,)),
        rejected=run.rejected(),
        options=options,
        tolerance=orbit.tolerance,
        **joined.fields(),
    )


def _sharpened(branch: OrbitZeroProblem, point: Point) -> Point:
    """Return a branch point located by equations that are regular there; unchanged where they have no solution."""
    u = solve_branch_point(branch.problem, point.u, branch.evaluate(point.u)[1])
    if u is None or float(point.weights @ (u - point.u) ** 2) > _NEAR**2:
        return point
    found = replace(point, u=u, J=branch.evaluate(u)[1])
    found.examined = branch.examine(found, None)
    return point if found.examined.data is None else found


def _amplitude(orbit: PeriodicOrbit) -> float:
    """Return half the range of the state that varies most."""
    n = len(orbit.system.states)
    return 0.5 * float(np.max(orbit.highs[:n] - orbit.lows[:n]))


def _found(name: str, branch: OrbitZeroProblem, event: Event, half: OneSide) -> Found:
    point, data = event.point, event.point.examined.data
    orbit = orbit_at(branch.problem, point.u, point.J, data.survey, data.multipliers)
    value = event.value
    if name == "PD":
        finite = orbit.multipliers[np.isfinite(orbit.multipliers)]
        value = float(np.abs(finite + 1.0).min())
    elif name == "TR":
        value = distance_from_circle(orbit.multipliers)
    tangent = None
    if name == "BP":  # it is undetermined at the point itself: the last point's is taken
        last = half.points[-1][1] if half.points else point
        tangent = (last if last.u.size == point.u.size else point).tangent.copy()
    return Found(name, orbit, value, len(half.points), point.arc, tangent=tangent)
