"""Following a cascade of period doublings: from each doubling along the doubled orbits to the next."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, replace
from functools import partial, singledispatch
from typing import Any, NamedTuple, overload

from saltus import checks
from saltus.continuation.branches import continue_branch
from saltus.continuation.core.arclength import StepControl
from saltus.continuation.results.cascade import Cascade
from saltus.continuation.results.map_cascade import MapCascade
from saltus.continuation.results.special_points import SpecialPoint
from saltus.continuation.runs.map_switching import doubled_map_orbit
from saltus.continuation.runs.options import check_along_parameter, checked_interval, read_steps
from saltus.continuation.switching import doubled_orbit
from saltus.errors import ConvergenceError, InputError
from saltus.maps import MapOrbit
from saltus.orbits.orbit import PeriodicOrbit
from saltus.progress import Progress, Report, Reporter
from saltus.solution import Solution

__all__ = ["follow_cascade"]


@overload
def follow_cascade(
    start: SpecialPoint,
    bounds: tuple[float, float],
    *,
    doublings: int = 4,
    steps: StepControl | None = None,
    progress: bool | Report = False,
) -> Cascade: ...
@overload
def follow_cascade(
    start: SpecialPoint[MapOrbit],
    bounds: tuple[float, float],
    *,
    doublings: int = 4,
    steps: StepControl | None = None,
    progress: bool | Report = False,
) -> MapCascade: ...
def follow_cascade(
    start: SpecialPoint | SpecialPoint[MapOrbit],
    bounds: tuple[float, float],
    *,
    doublings: int = 4,
    steps: StepControl | None = None,
    progress: bool | Report = False,
) -> Cascade | MapCascade:
    """Return the cascade of period doublings that begins at a given one.

    docs/theory/loci.md, "Other branches", describes the steps from each doubling to the next.

    Parameters
    ----------
    start : SpecialPoint
        A PD of a branch.
    bounds : (float, float)
        Interval of the parameter along which the doubling was found.
    doublings : int
        Most branches of doubled orbits that are followed; 4 lead to the doubling of the orbit of period 16.
    steps : StepControl, optional
        Sizes of steps along the first branch; the greatest step is halved from each branch to the next. A cascade ends
        at a grazing: `StepControl.at_grazing` must have its default.
    progress : bool or callable
        True for a bar on stderr, or a function called with a `saltus.Progress` after each point of all branches.

    Returns
    -------
    Cascade or MapCascade
        The doublings found, however the cascade ended: `Cascade.stopped` says why. It ends at a grazing, since
        doublings beyond it belong to other orbits; that of a map at a border collision.

    Raises
    ------
    InputError
        The start is no PD of a branch, or an option cannot be used.

    References
    ----------
    Feigenbaum, J. Stat. Phys. 19 (1978) 25-52.

    Examples
    --------
    >>> from saltus import HybridSystem, Mode, Transition, continue_orbit, solve_orbit
    >>> logistic = HybridSystem(
    ...     ("x", "s"), {"r": 2.8}, {"carry": Mode({"x": "0", "s": "1"})},
    ...     [Transition("carry", "carry", "s - 1", 1, {"x": "r*x*(1 - x)", "s": "0"}, name="map")],
    ... )
    >>> orbit = solve_orbit(logistic, {}, [("carry", "map", [0.64, 0.0], 1.0)])
    >>> branch = continue_branch(orbit, "r", (2.5, 3.4))
    >>> cascade = follow_cascade(branch["PD1"], (2.5, 4.0), doublings=2)
    >>> [f"{value:.9f}" for value in cascade.values]
    ['3.000000000', '3.449489743', '3.544090360']
    """
    checks.instance("start", start, SpecialPoint)
    if start.type != "PD" or len(start.varied) != 1:
        raise InputError("start", start.type, "a PD of a branch", "branch['PD1'] is one")
    check_along_parameter("start", start)
    doublings = checks.count("doublings", doublings)
    name = start.varied[0]
    low, high = checked_interval(start.solution.system, start.parameters, name, bounds, "both")
    control = read_steps(steps, "a cascade")
    options = {"bounds": [low, high], "doublings": doublings, "steps": asdict(control)}
    kind = doubling(start.solution)
    with Reporter(progress) as reporter:
        branches, stopped = _followed(start, kind, bounds, doublings, control, reporter)
    found: Cascade | MapCascade = kind.cascade(start, tuple(branches), stopped, options)
    return found


class Doubling(NamedTuple):
    """How the doublings of one kind of solution are followed."""

    # makes the solution of doubled period beside a PD, at a level of the cascade
    double: Callable[[SpecialPoint[Any], int], Any]
    border: str  # type of special points beyond which doublings belong to other solutions
    cascade: type[Any]  # what comes back


@singledispatch
def doubling(solution: Solution) -> Doubling:
    """Return how the doublings of a solution are followed; each kind that has any registers its own."""
    raise InputError("start", solution.noun, "a PD of periodic orbits or of orbits of a map")


@doubling.register
def _(solution: PeriodicOrbit) -> Doubling:
    return Doubling(doubled_orbit, "GR", Cascade)


@doubling.register
def _(solution: MapOrbit) -> Doubling:
    return Doubling(doubled_map_orbit, "BC", MapCascade)


def _followed(
    start: SpecialPoint[Any],
    kind: Doubling,
    bounds: tuple[float, float],
    doublings: int,
    control: StepControl,
    reporter: Reporter,
) -> tuple[list[Any], str]:
    """Return the branches of doubled orbits, and the reason why the cascade ended."""
    branches: list[Any] = []
    name, point = start.varied[0], start
    for level in range(doublings):
        try:
            orbit = kind.double(point, level)
        except ConvergenceError as error:
            return branches, str(error)
        report = partial(_told, reporter, 2 ** (level + 1)) if reporter.report is not None else False
        way = "up" if orbit.parameters[name] > point.parameters[name] else "down"
        branch = continue_branch(
            orbit, name, bounds, steps=control, directions=way, stop_at=("PD", kind.border), progress=report
        )
        branches.append(branch)
        found = branch.special_points.of_type("PD")
        if not found:
            return branches, branch.stopped[-1]
        point = found[0]
        shrunk = max(control.largest / 2.0, 10.0 * control.smallest)
        control = replace(control, initial=min(control.initial, shrunk), largest=shrunk)
    many = "1 branch" if doublings == 1 else f"{doublings} branches"
    return branches, f"after {many} of doubled orbits, as many as `doublings` allows"


def _told(reporter: Reporter, times: int, progress: Progress) -> None:
    """Report a point of a branch whose period is `times` the first period."""
    reporter.step(1, f"period {times}: {progress.text}")
