"""Continuation of loci: critical orbits, equilibria and orbits of maps along two parameters."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, overload

from saltus import checks
from saltus.continuation.core.arclength import StepControl
from saltus.continuation.core.point_types import ACCUMULATION, POINT_TYPES, accumulates
from saltus.continuation.results.auditing import audited
from saltus.continuation.results.equilibrium_locus import EquilibriumLocus
from saltus.continuation.results.locus import Locus
from saltus.continuation.results.map_locus import MapLocus
from saltus.continuation.results.special_points import SpecialPoint
from saltus.continuation.runs.accumulation_locus import AccumulationLocusRun
from saltus.continuation.runs.equilibrium_locus import EquilibriumLocusRun
from saltus.continuation.runs.map_locus import MapLocusRun
from saltus.continuation.runs.options import read_plane, read_steps, read_stops
from saltus.continuation.runs.orbit_locus import OrbitLocusRun
from saltus.continuation.runs.run import Asked
from saltus.continuation.runs.two_parameters import TwoParameterRun, locus_run
from saltus.equilibria import Equilibrium
from saltus.errors import InputError
from saltus.linear_threads import one_thread
from saltus.maps import MapOrbit
from saltus.orbits.orbit import PeriodicOrbit
from saltus.progress import Report, Reporter

__all__ = ["continue_locus"]

_KINDS = (OrbitLocusRun, EquilibriumLocusRun, MapLocusRun)  # each is registered with `locus_run` where it is defined


@overload
def continue_locus(
    start: SpecialPoint | PeriodicOrbit,
    parameters: tuple[str, str],
    bounds: Mapping[str, tuple[float, float]],
    *,
    type: str | None = None,
    steps: StepControl | None = None,
    directions: str = "both",
    stop_at: str | Iterable[str] = (),
    progress: bool | Report = False,
) -> Locus: ...
@overload
def continue_locus(
    start: SpecialPoint[Equilibrium] | Equilibrium,
    parameters: tuple[str, str],
    bounds: Mapping[str, tuple[float, float]],
    *,
    type: str | None = None,
    steps: StepControl | None = None,
    directions: str = "both",
    stop_at: str | Iterable[str] = (),
    progress: bool | Report = False,
) -> EquilibriumLocus: ...
@overload
def continue_locus(
    start: SpecialPoint[MapOrbit] | MapOrbit,
    parameters: tuple[str, str],
    bounds: Mapping[str, tuple[float, float]],
    *,
    type: str | None = None,
    steps: StepControl | None = None,
    directions: str = "both",
    stop_at: str | Iterable[str] = (),
    progress: bool | Report = False,
) -> MapLocus: ...
def continue_locus(
    start: SpecialPoint | SpecialPoint[Equilibrium] | SpecialPoint[MapOrbit] | PeriodicOrbit | Equilibrium | MapOrbit,
    parameters: tuple[str, str],
    bounds: Mapping[str, tuple[float, float]],
    *,
    type: str | None = None,
    steps: StepControl | None = None,
    directions: str = "both",
    stop_at: str | Iterable[str] = (),
    progress: bool | Report = False,
) -> Locus | EquilibriumLocus | MapLocus:
    """Return the locus of critical orbits or equilibria through a special point, as two parameters vary.

    At a point of a user's event, the locus has the solutions of which the quantity keeps its value. A branch records
    such points with ``events={"min_z": 0.1}``.

    Every point is a corrected critical orbit. A multiplier is 1 (SN), -1 (PD) or on the unit circle (TR), a contact is
    tangential (GR), or branches meet (BP). Hits accumulate just where their surface lets the motion go (CH). An
    equilibrium has an eigenvalue 0 (SN), an imaginary pair (HB), or lies on a boundary of its mode (BE). An orbit of a
    map has a point on a border (BC) in place of a contact. Points of codimension two are located. docs/theory/loci.md,
    docs/theory/chatter.md, docs/theory/equilibria.md and docs/theory/map_orbits.md derive the equations.

    Parameters
    ----------
    start : SpecialPoint, PeriodicOrbit, Equilibrium or MapOrbit
        Where the locus starts: a special point of a branch or of a locus, a `Locus.point`, or a solution with `type`.
    parameters : (str, str)
        The two parameters that vary.
    bounds : mapping of str to (float, float)
        Interval of each of the two parameters; the start must lie in both.
    type : {"SN", "PD", "TR", "BP", "GR", "CH", "HB", "BE", "BC"}, optional
        Type of the locus. By default that of the start; at a point of codimension two the simplest through it.
    steps : StepControl, optional
        Sizes of steps and their limits. A locus ends at a grazing: `StepControl.at_grazing` must have its default.
    directions : {"both", "up", "down"}
        Which way the second parameter goes at the start.
    stop_at : str or iterable of str, optional
        Types of special points; the locus ends at the first.
    progress : bool or callable
        True for a bar on stderr, or a function called with a `saltus.Progress` after each point.

    Returns
    -------
    Locus, EquilibriumLocus or MapLocus
        All points found, however the locus ended: `Locus.stopped` says why. An interrupt (Ctrl-C) ends it likewise. A
        locus ends at a grazing, since orbits beyond have another signature. A TR locus also ends at R1 and R2. One of
        equilibria ends at a boundary of its mode, an HB locus also at BT.

    Raises
    ------
    InputError
        Names, bounds or an option that cannot be used. A start of a type without a locus, or one that is not critical.
        A start at which the two parameters have no regular locus. A field whose slope is infinite where a segment
        begins, as of a root of the distance to the event there: it has no second derivatives.

    References
    ----------
    Govaerts, Numerical Methods for Bifurcations of Dynamical Equilibria, SIAM 2000; `saltus.orbits.stability.critical`.

    Examples
    --------
    >>> from saltus import HybridSystem, Mode, Transition, continue_orbit, solve_orbit
    >>> cusp = HybridSystem(
    ...     ("x", "s"), {"r": 0.0, "h": 1.5}, {"carry": Mode({"x": "0", "s": "1"})},
    ...     [Transition("carry", "carry", "s - 1", 1, {"x": "r + h*x - x**3", "s": "0"}, name="map")],
    ... )
    >>> orbit = solve_orbit(cusp, {}, [("carry", "map", [0.7, 0.0], 1.0)])
    >>> branch = continue_orbit(orbit, "r", (-1.0, 1.0))
    >>> locus = continue_locus(branch["SN1"], ("r", "h"), {"r": (-1.0, 1.0), "h": (0.5, 2.0)})
    >>> f"{locus['CP1'].parameters['h']:.9f}"
    '1.000000000'
    """
    control = read_steps(steps, "a locus")
    reporter = Reporter(progress)
    # a special point, or a solution of any kind with its type
    point = start.itself if isinstance(start, SpecialPoint) else None
    solution: Any = start if point is None else point.solution
    run = locus_run(solution)
    kind = _type_of(point, solution, run, type)
    plane = read_plane(solution, parameters, bounds)
    checks.chosen("directions", directions, ("both", "up", "down"))
    asked = Asked(control, directions, read_stops(stop_at, run.points()), reporter)
    with one_thread(len(solution.system.states)):
        followed = AccumulationLocusRun if kind == ACCUMULATION and run is OrbitLocusRun else run
        following = followed(point, solution, kind, plane, asked)
        return audited(following.locus(), following.remarks)  # type: ignore[no-any-return]


def _type_of(point: SpecialPoint[Any] | None, solution: Any, run: type[TwoParameterRun], given: str | None) -> str:
    """Return the type of the locus that starts at a special point, or at a solution."""
    if given is not None:
        checks.chosen("type", given, run.types())
    run.check(solution)
    if given is not None:
        return given
    if point is None:
        name = type(solution).__name__
        what = f"{'an' if name[0] in 'AEIO' else 'a'} {name}"
        raise InputError("start", what, f"a special point, or {solution.noun} with its type", "type='SN'")
    if accumulates(point.type, point.locus):
        return ACCUMULATION
    kind = run.loci.get(point.type, point.locus if point.type == "TP" else None)
    if kind is None and point.type not in POINT_TYPES:
        run.check_quantity(point)
        return point.type
    if kind is None:
        allowed = f"a point of type {', '.join(run.loci)}, or of a user's event"
        raise InputError("start", point.type, allowed, "no locus belongs to this type")
    return kind
