"""Continuation of branches: periodic orbits along one parameter, through grazings into other signatures."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, overload

import numpy as np

from saltus import checks
from saltus.continuation.core.arclength import StepControl
from saltus.continuation.core.interest import Interest
from saltus.continuation.core.monitor import BIFURCATIONS
from saltus.continuation.core.zero_problem import Point
from saltus.continuation.problems.orbit import OrbitZeroProblem
from saltus.continuation.results.branch import Branch
from saltus.continuation.results.map_curve import MapBranch
from saltus.continuation.runs.map import continue_cycle
from saltus.continuation.runs.options import (
    asked_types,
    read_events,
    read_interval,
    read_range,
    read_stops,
    read_varied,
    unit_of,
)
from saltus.continuation.runs.orbit import BranchRun
from saltus.continuation.runs.quantity import QuantityRun
from saltus.continuation.runs.two_sided import OneSide, join, traced
from saltus.maps import MapOrbit
from saltus.orbits.orbit import PeriodicOrbit
from saltus.progress import Report, Reporter

__all__ = ["continue_orbit"]


@overload
def continue_orbit(
    orbit: PeriodicOrbit,
    parameter: str,
    bounds: tuple[float, float],
    *,
    steps: StepControl | None = None,
    directions: str = "both",
    events: Mapping[str, float | str] | None = None,
    stop_at: str | Iterable[str] = (),
    progress: bool | Report = False,
) -> Branch: ...
@overload
def continue_orbit(
    orbit: MapOrbit,
    parameter: str,
    bounds: tuple[float, float],
    *,
    steps: StepControl | None = None,
    directions: str = "both",
    events: Mapping[str, float | str] | None = None,
    stop_at: str | Iterable[str] = (),
    progress: bool | Report = False,
) -> MapBranch: ...
def continue_orbit(
    orbit: PeriodicOrbit | MapOrbit,
    parameter: str,
    bounds: tuple[float, float],
    *,
    steps: StepControl | None = None,
    directions: str = "both",
    events: Mapping[str, float | str] | None = None,
    stop_at: str | Iterable[str] = (),
    progress: bool | Report = False,
) -> Branch | MapBranch:
    """Return the branch of periodic orbits, or of cycles of a map, through an orbit, as one parameter varies.

    Saddle-nodes (SN), period doublings (PD), torus bifurcations (TR), branch points (BP) and grazings (GR) are
    located by Newton's method. At a grazing the branch goes on in the neighbouring signature, or ends where there
    is none. An orbit that repeats a shorter one there goes on as the shorter one. `StepControl.at_grazing` and
    `stop_at` change this. A branch of doubled period ends where the period halves. A branch of autonomous cycles
    ends at the Hopf point (HB), or the boundary equilibrium (BE), to which the cycle shrinks. Where its period
    grows without bound it ends at the homoclinic orbit (HOM). Points with a residual above 1e-8 of the orbit's size
    are rejected. Cycles of a map have border collisions (BC) in place of grazings. docs/theory/continuation.md
    derives the method, docs/theory/cycles.md that of maps.

    Parameters
    ----------
    orbit : PeriodicOrbit or MapOrbit
        Where the branch starts.
    parameter : str
        The parameter that varies. From an orbit that `solve_orbit` solved with `fix` on, it may be a quantity:
        ``period``, ``max_x``, a constant output or an observable. What was freed there is free along the branch.
    bounds : (float, float)
        Interval of the parameter or quantity; the start must lie in it.
    steps : StepControl, optional
        Sizes of steps and their limits, and how the branch goes on at a grazing.
    directions : {"both", "up", "down"}
        Which way the parameter goes at the start.
    events : mapping of str to float or "extremum", optional
        Users' events. ``{"gap": 0.02}`` records where an extreme of that output or state passes the value. With
        ``"min_gap"`` or ``"max_gap"`` only one extreme counts. A key may also be the parameter, ``"period"`` or an
        observable, as ``"mean(gap)"``. Of a map a state or an output at the cycle's first point passes the value.
        ``{"amplitude(x, 1)": "extremum"}`` records where the quantity has an extremum along the branch, of type ``EX``.
    stop_at : str or iterable of str, optional
        Types of special points, as ``"SN"`` or a key of `events`; the branch ends at the first. Along a quantity
        ``"TP"`` is where the quantity turns.
    progress : bool or callable
        True for a bar on stderr, or a function called with a `saltus.Progress` after each point.

    Returns
    -------
    Branch or MapBranch
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

    The swings of a pendulum, a family at fixed parameters, up to the amplitude 3:

    >>> pendulum = HybridSystem.smooth({"x": "v", "v": "-sin(x)"})
    >>> swing = solve_orbit(pendulum, x0=[1.0, 0.0], period=6.7, fix={"max_x": 1.0})
    >>> swings = continue_orbit(swing, "max_x", (0.1, 3.0))
    >>> print(f"{swings.period[0]:.9f} {swings.period[-1]:.9f}")
    6.287114549 16.155539372
    """
    if isinstance(orbit, MapOrbit):
        return continue_cycle(
            orbit, parameter, bounds, steps=steps, directions=directions, events=events, stop_at=stop_at,
            progress=progress,
        )  # fmt: skip
    control = StepControl() if steps is None else checks.instance("steps", steps, StepControl)
    checks.instance("orbit", orbit, PeriodicOrbit)
    reporter = Reporter(progress)
    varied = read_varied(orbit, parameter)
    if varied is None:
        value = orbit.parameters[parameter]
        low, high = read_interval(orbit, parameter, bounds, directions)
    else:
        value = varied.value(orbit.problem(), orbit.unknowns)
        low, high = read_range(parameter, value, bounds, directions)
    events = checks.mapping("events", events, "names to values, as {'gap': 0.02}, or to 'extremum'")
    wanted = read_events(orbit, parameter, events)
    stops = read_stops(stop_at, [*BIFURCATIONS, *([] if varied is None else ["TP"]), *asked_types(events)])
    scale = unit_of(low, high, value)
    interest = Interest(low / scale, high / scale, scale, wanted)
    kind = BranchRun if varied is None else QuantityRun
    run = kind(orbit, parameter, interest, control, stops, reporter)
    start = run.begin()
    with reporter:
        halves = traced(start, run.begin, run.trace, directions)
    options = run.options([low, high], directions, events)
    return _assemble(orbit, parameter, scale, start, halves, run, options)


def _assemble(
    orbit: PeriodicOrbit,
    parameter: str,
    scale: float,
    start: tuple[OrbitZeroProblem, Point],
    halves: list[OneSide],
    run: BranchRun,
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
        fixed=run.fixed,
        freed=np.array([run.freed(*row) for row in joined.rows]),
        **joined.fields(),
    )
