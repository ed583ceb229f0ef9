"""Continuation of branches along one parameter: orbits, equilibria, orbits of maps, other kinds."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, overload

from saltus import checks
from saltus.continuation.core.arclength import StepControl
from saltus.continuation.core.interest import Interest
from saltus.continuation.results.auditing import audited
from saltus.continuation.results.branch import Branch
from saltus.continuation.results.equilibrium_branch import EquilibriumBranch
from saltus.continuation.results.map_curve import MapBranch
from saltus.continuation.runs.equilibrium import EquilibriumRun
from saltus.continuation.runs.map import MapRun
from saltus.continuation.runs.one_parameter import branch_run
from saltus.continuation.runs.options import asked_types, read_stops, unit_of
from saltus.continuation.runs.quantity import QuantityRun
from saltus.continuation.runs.run import Asked
from saltus.equilibria import Equilibrium
from saltus.linear_threads import one_thread
from saltus.maps import MapOrbit
from saltus.orbits.orbit import PeriodicOrbit
from saltus.progress import Report, Reporter

__all__ = ["continue_branch", "continue_equilibrium", "continue_orbit", "continue_until"]

_KINDS = (QuantityRun, EquilibriumRun, MapRun)  # each is registered with `branch_run` where it is defined


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
    """Return the branch of periodic orbits, or of orbits of a map, through an orbit, as one parameter varies.

    Saddle-nodes (SN), period doublings (PD), torus bifurcations (TR), branch points (BP) and grazings (GR) are
    located by Newton's method. At a grazing the branch goes on in the neighbouring signature, or ends where there
    is none. An orbit that repeats a shorter one there goes on as the shorter one. `StepControl.at_grazing` and
    `stop_at` change this. A branch of doubled period ends where the period halves. A branch of autonomous cycles
    ends at the Hopf point (HB), or the boundary equilibrium (BE), to which the cycle shrinks. Where its period
    grows without bound it ends at the homoclinic orbit (HOM). Points with a residual above 1e-8 of the orbit's size
    are rejected. Orbits of a map have border collisions (BC) in place of grazings. docs/theory/continuation.md
    derives the method, docs/theory/map_orbits.md that of maps.

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
    checks.instance("orbit", orbit, PeriodicOrbit | MapOrbit)
    branch: Branch | MapBranch = continue_branch(
        orbit, parameter, bounds, steps=steps, directions=directions, events=events, stop_at=stop_at, progress=progress
    )
    return branch


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
    checks.instance("equilibrium", equilibrium, Equilibrium)
    branch: EquilibriumBranch = continue_branch(
        equilibrium, parameter, bounds, steps=steps, directions=directions, events=events, stop_at=stop_at,
        progress=progress,
    )  # fmt: skip
    return branch


def continue_branch(
    start: Any,
    parameter: str,
    bounds: tuple[float, float],
    *,
    steps: StepControl | None = None,
    directions: str = "both",
    events: Mapping[str, float | str] | None = None,
    stop_at: str | Iterable[str] = (),
    progress: bool | Report = False,
) -> Any:
    """Return the branch through a solution of any kind; `continue_orbit` describes the arguments.

    Parameters
    ----------
    start : Solution
        Where the branch starts; `branch_run` knows its kind.
    parameter, bounds, steps, directions, events, stop_at, progress
        As `continue_orbit` takes them.

    Returns
    -------
    SolutionCurve
        A `Branch`, an `EquilibriumBranch`, a `MapBranch`, or the branch of another kind.

    Raises
    ------
    InputError
        A name, bounds or an option that cannot be used, or no solution.

    Examples
    --------
    >>> from saltus import HybridSystem, find_equilibrium
    >>> fold = HybridSystem.smooth({"x": "a - x**2"}, {"a": 1.0})
    >>> branch = continue_branch(find_equilibrium(fold, x0=[1.0]), "a", (-1.0, 4.0))
    >>> print(f"{abs(branch['SN1'].parameters['a']):.6f}")
    0.000000
    """
    return _branch(start, parameter, bounds, None, steps, directions, events, stop_at, progress)


def continue_until(
    start: PeriodicOrbit,
    parameter: str,
    bounds: tuple[float, float],
    until: Callable[[PeriodicOrbit, float], bool],
    *,
    steps: StepControl | None = None,
    progress: bool | Report = False,
) -> Branch:
    """Return the branch through an orbit, in both directions, which ends at the folds that a function chooses.

    Parameters
    ----------
    start, parameter, bounds, steps, progress
        As `continue_orbit` takes them.
    until : callable
        Whether the branch ends at a fold. It is given the orbit there, and -1.0 or 1.0: the sign of the parameter's
        change at the start of this direction. Falling values are followed first.

    Returns
    -------
    Branch

    Raises
    ------
    InputError
        A name, bounds or an option that cannot be used.

    Examples
    --------
    >>> from saltus import HybridSystem, find_orbit
    >>> duffing = HybridSystem.smooth(
    ...     {"x": "v", "v": "A*cos(s) - 0.1*v - x - x**3"}, {"A": 0.3, "w": 1.0}, phase=("s", "w")
    ... )
    >>> folds = []
    >>> def first(orbit, sign):
    ...     folds.append((sign, orbit.parameters["w"]))
    ...     return True
    >>> branch = continue_until(find_orbit(duffing, x0=[0.0, 0.0]), "w", (0.8, 2.0), first)
    >>> [(sign, round(w, 4)) for sign, w in folds], [point.type for point in branch.special_points]
    ([(1.0, 1.7797)], ['SN'])
    """
    branch: Branch = _branch(start, parameter, bounds, until, steps, "both", None, (), progress)
    return branch


def _branch(
    start: Any,
    parameter: str,
    bounds: tuple[float, float],
    until: Callable[[Any, float], bool] | None,
    steps: StepControl | None,
    directions: str,
    events: Mapping[str, float | str] | None,
    stop_at: str | Iterable[str],
    progress: bool | Report,
) -> Any:
    """Return the branch through a solution; see `continue_branch`, and `continue_until` for `until`."""
    control = StepControl() if steps is None else checks.instance("steps", steps, StepControl)
    reporter = Reporter(progress)
    kind = branch_run(start, parameter)
    low, high, value = kind.interval(start, parameter, bounds, directions)
    events = checks.mapping("events", events, "names to values, as {'gap': 0.02}, or to 'extremum'")
    unit = unit_of(low, high, value)
    interest = Interest(low / unit, high / unit, unit, kind.wanted(start, parameter, events))
    stops = read_stops(stop_at, [*kind.types, *asked_types(events)])
    run = kind(start, parameter, interest, Asked(control, directions, stops, reporter, until))
    with one_thread(len(start.system.states)):
        return audited(run.branch(run.options([low, high], events)), last=run.last_row)
