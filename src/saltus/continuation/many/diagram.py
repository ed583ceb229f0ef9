"""Whole bifurcation diagrams: from equilibria, or fixed points of a map, to cycles and their doublings."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from functools import singledispatch
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.continuation.branches import continue_branch
from saltus.continuation.core.arclength import StepControl
from saltus.continuation.results.diagram import Diagram, DiagramBranch, Origin, Place, kind_of, place_of
from saltus.continuation.switching import other_solutions
from saltus.equilibria import find_equilibrium
from saltus.equilibria.problem import check_autonomous
from saltus.errors import InputError, SaltusError
from saltus.orbits import solve_orbit
from saltus.progress import Progress, Report, Reporter
from saltus.scales import RESTING
from saltus.solution import Solution
from saltus.system import HybridSystem, Map
from saltus.system.angles import wrapped

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.checks.states import StateLike
    from saltus.continuation.results.special_points import SpecialPoint

__all__ = ["DiagramOptions", "diagram"]

# Special points from which other branches are sought, by what a branch consists of.
_SWITCHED = {"equilibria": ("HB", "BP"), "orbits": ("PD", "BP"), "map orbits": ("PD", "BP")}
_INTERRUPTED = "interrupted"


@dataclass(frozen=True)
class DiagramOptions:
    """How the branches of a diagram are traced.

    Parameters
    ----------
    depth : int
        Most special points between a branch and a start: 0 for the equilibria through the starts alone, 1 for what
        meets them as well (cycles at HB, equilibria at BP), 2 for doubled cycles too. Of a map 1 has the orbits of
        period 2, 2 those of period 4.
    max_branches : int
        Most branches.
    equilibria, orbits : StepControl
        Steps along branches of equilibria, and along those of orbits or of orbits of a map.

    Raises
    ------
    InputError
        A value that cannot be used; the message names it.

    Examples
    --------
    >>> DiagramOptions(depth=1).max_branches
    40
    """

    depth: int = 2
    max_branches: int = 40
    equilibria: StepControl = field(default_factory=StepControl)
    orbits: StepControl = field(default_factory=lambda: StepControl(max_points=400))

    def __post_init__(self) -> None:
        object.__setattr__(self, "depth", checks.count("DiagramOptions.depth", self.depth, 0))
        object.__setattr__(self, "max_branches", checks.count("DiagramOptions.max_branches", self.max_branches))
        for name in ("equilibria", "orbits"):
            checks.instance(f"DiagramOptions.{name}", getattr(self, name), StepControl)


def diagram(
    system: HybridSystem | Map,
    parameter: str,
    bounds: tuple[float, float],
    *,
    parameters: Mapping[str, float] | None = None,
    x0: StateLike | None = None,
    options: DiagramOptions | None = None,
    progress: bool | Report = False,
) -> Diagram:
    """Return the bifurcation diagram of an autonomous system or a map to a stated depth.

    The equilibria, or a map's fixed points, through each start are followed to both bounds. Cycles are followed from
    each Hopf point, other equilibria or cycles from each branch point, doubled cycles from each period doubling. A
    point that two branches share is followed once.

    Parameters
    ----------
    system : HybridSystem or Map
        An autonomous system, or a map.
    parameter : str
        The parameter that varies.
    bounds : (float, float)
        Its interval. The starts have the parameter's given value, or the middle of the interval if that lies outside.
    parameters : mapping of str to float, optional
        Parameters that differ from the system's defaults.
    x0 : array_like, shape (states,) or (starts, states), or mapping of str to float, optional
        States near equilibria or fixed points, one or several; by default the origin.
    options : DiagramOptions, optional
        Depth, most branches, steps.
    progress : bool or callable
        True for a bar on stderr, or a function called with a `saltus.Progress` after each point. It is told as
        well at which special point branches are looked for.

    Returns
    -------
    Diagram
        All branches found, however the search ended: `Diagram.stopped` says why. An interrupt (Ctrl-C) ends it too.

    Raises
    ------
    InputError
        The system is forced; names, bounds, states or options that cannot be used.
    ConvergenceError
        There is no equilibrium or fixed point near a start.

    Examples
    --------
    >>> from saltus import HybridSystem, Mode
    >>> brusselator = HybridSystem(
    ...     ("x", "y"), {"A": 1.0, "B": 1.5}, {"flow": Mode({"x": "A - (B + 1)*x + x**2*y", "y": "B*x - x**2*y"})}
    ... )
    >>> found = diagram(brusselator, "B", (1.0, 3.0), x0=[1.0, 1.0])
    >>> [len(branch) > 9 for branch in found], [point.label for point in found.special_points]
    ([True, True], ['HB1'])
    """
    near = solution_near(system)
    chosen = DiagramOptions() if options is None else checks.instance("options", options, DiagramOptions)
    low, high = checks.interval("bounds", bounds, finite=True)
    values = system.resolve(parameters)
    if not low <= values[checks.chosen("parameter", parameter, system.parameter_names)] <= high:
        values[parameter] = 0.5 * (low + high)
    starts = np.array([system.full_state(start)[: len(system.states)] for start in _starts(x0, len(system.states))])
    reporter = Reporter(progress)
    run = _Run(system, parameter, (low, high), chosen, reporter)
    solved = [near(system, values, state) for state in starts]
    with reporter:
        stopped = run.trace(solved)
    told = {
        "bounds": [low, high],
        "depth": chosen.depth,
        "max_branches": chosen.max_branches,
        "equilibria": asdict(chosen.equilibria),
        "orbits": asdict(chosen.orbits),
        "x0": starts.tolist(),
    }
    return Diagram(system, parameter, tuple(run.branches), tuple(run.origins), tuple(run.failures), stopped, told)


def _starts(x0: Any, states: int) -> list[Any]:
    """Return the states at which a diagram starts: one, or a list of them, each as numbers or a mapping."""
    if x0 is None:
        return [np.zeros(states)]
    several = not isinstance(x0, Mapping) and np.ndim(np.asarray(x0, dtype=object)) > 1
    named = isinstance(x0, list | tuple) and any(isinstance(start, Mapping) for start in x0)
    return list(x0) if several or named else [x0]


@singledispatch
def solution_near(system: object) -> Callable[..., Any]:
    """Return what solves for the solution near a state at which a diagram of a kind of system starts."""
    raise InputError("system", system, "a HybridSystem or a Map")


@solution_near.register
def _(system: HybridSystem) -> Callable[..., Any]:
    check_autonomous(system)
    return find_equilibrium


@solution_near.register
def _(system: Map) -> Callable[..., Any]:
    return lambda system, parameters, state: solve_orbit(system, parameters, x0=state)


@dataclass
class _Run:
    """One call of `diagram`: branches found so far, and special points at which others may begin."""

    system: HybridSystem | Map
    parameter: str
    bounds: tuple[float, float]
    options: DiagramOptions
    reporter: Reporter

    def __post_init__(self) -> None:
        self.branches: list[DiagramBranch] = []
        self.origins: list[Origin] = []
        self.failures: list[str] = []
        self._known: list[Place] = []
        self._solved: list[Place] = []  # where several directions are critical at once, and all branches are known
        self._unsolved: list[tuple[Place, str]] = []  # where they are not, and why
        self._waiting: list[tuple[int, SpecialPoint[Any]]] = []

    def trace(self, starts: list[Solution]) -> str:
        """Follow all branches; return why the search ended."""
        try:
            for start in starts:
                if not self._lies_on_a_branch(start) and (end := self._follow(start, Origin(-1, "", 0))):
                    return end
            while self._waiting:
                if len(self.branches) >= self.options.max_branches:
                    return f"{self.options.max_branches} branches: {len(self._waiting)} special points are left"
                parent, point = self._waiting.pop(0)
                origin = Origin(parent, point.label, self.origins[parent].depth + 1)
                for other in self._others(parent, point):
                    if len(self.branches) >= self.options.max_branches:
                        return f"{self.options.max_branches} branches: others meet at {point.label} of branch {parent}"
                    if end := self._follow(other, origin, perhaps_known=point.multiplicity > 1):
                        return end
        except KeyboardInterrupt:
            return _INTERRUPTED
        finally:
            self.failures += [told for _, told in self._unsolved]
        return f"all branches to depth {self.options.depth}"

    def _others(self, parent: int, point: SpecialPoint[Any]) -> list[Solution]:
        """Return a solution of each other branch at a special point, of those that begin within the bounds."""
        told = f"{point.label} of branch {parent}"
        self.reporter.step(0, f"branches at {told}")
        try:
            found = other_solutions(point.solution, point)
        except SaltusError as error:
            if point.multiplicity > 1:  # another branch may lead to the same place
                self._unsolved.append((place_of(point, self.parameter), f"{told}: {error}"))
            else:
                self.failures.append(f"{told}: {error}")
            return []
        if point.multiplicity > 1 and len(found) >= point.multiplicity:
            self._solved.append(place_of(point, self.parameter))
            self._drop(self._solved[-1])
        elif point.multiplicity > 1:  # more are found from another branch, as from the one that the others leave
            several = f"{point.multiplicity} directions are critical at once"
            few = f"{told}: {several}, and {len(found)} other branches are found"
            self._unsolved.append((place_of(point, self.parameter), few))
        kept = []
        for solution in found:
            value = solution.parameters[self.parameter]
            if self.bounds[0] <= value <= self.bounds[1]:
                kept.append(solution)
            else:
                text = f"the other branch begins out of bounds, at {self.parameter} = {value:.9g}"
                self.failures.append(f"{told}: {text}")
        return kept

    def _follow(self, start: Solution, origin: Origin, *, perhaps_known: bool = False) -> str:
        """Follow the branch through a solution; return why the search must end, or an empty text."""
        index = len(self.branches)

        def told(progress: Progress) -> None:
            self.reporter.step(1, f"branch {index}, {progress.text}")

        report: bool | Report = False if self.reporter.report is None else told
        branch: DiagramBranch
        try:
            steps = self.options.equilibria if start.at_rest else self.options.orbits
            branch = continue_branch(start, self.parameter, self.bounds, steps=steps, progress=report)
        except InputError as error:
            self.failures.append(f"{origin.label or 'the start'} of branch {origin.parent}: {error}")
            return ""
        if perhaps_known and self._is_known(branch):
            return ""
        self.branches.append(branch)
        self.origins.append(origin)
        self._gather(index, branch)
        return _INTERRUPTED if _INTERRUPTED in branch.stopped else ""

    def _gather(self, index: int, branch: DiagramBranch) -> None:
        """Note the special points of a new branch; those that other branches share are not followed again."""
        kinds = _SWITCHED[kind_of(branch)]
        width = self.bounds[1] - self.bounds[0]
        ranges = self._ranges()
        for point in branch.special_points:
            if point.type not in (*kinds, "HB"):
                continue
            place = place_of(point, self.parameter)
            # two branches meet at a point; where more do, all may begin at a branch that comes later
            known = self._known if point.multiplicity == 1 else self._solved
            if any(place.is_same(other, width, ranges) for other in known):
                self._drop(place)
                continue
            self._known.append(place)
            if point.type in kinds and self.origins[index].depth < self.options.depth:
                self._waiting.append((index, point))

    def _ranges(self) -> NDArray[np.float64]:
        """Return the ranges of states over all branches; that of a state that is 0 on all is more than its rounding."""
        ranges = Diagram(self.system, self.parameter, tuple(self.branches), ()).ranges
        return np.maximum(ranges, max(RESTING * float(ranges.max()), 1e-300))

    def _drop(self, place: Place) -> None:
        """Wait no longer for the special points at a place."""
        width = self.bounds[1] - self.bounds[0]
        ranges = self._ranges()
        self._waiting = [(i, other) for i, other in self._waiting
                         if not place_of(other, self.parameter).is_same(place, width, ranges)]  # fmt: skip
        self._unsolved = [(known, told) for known, told in self._unsolved if not known.is_same(place, width, ranges)]

    def _is_known(self, branch: DiagramBranch) -> bool:
        """Return whether a branch has been followed before, by solutions away from the point at which it began."""
        return all(
            self._lies_on_a_branch(branch._solution(i)) for i in (len(branch) // 8, len(branch) - 1 - len(branch) // 8)
        )

    def _lies_on_a_branch(self, start: Solution) -> bool:
        """Return whether an equilibrium or a fixed point lies on a branch that is known; of cycles this is not told."""
        state, highest = start.extremes
        if np.any(state != highest):
            return False
        value = start.parameters[self.parameter]
        for branch in self.branches:
            states, highs = branch.extremes
            if np.any(states != highs):
                continue
            for i in range(len(branch) - 1):
                first, last = branch.values[i], branch.values[i + 1]
                if (first - value) * (last - value) > 0.0:
                    continue
                share = (value - first) / (last - first) if last != first else 0.0
                there = states[i] + share * (states[i + 1] - states[i])
                reach = np.abs(states[i + 1] - states[i]) + 1e-6 * np.ptp(states, axis=0)
                if np.all(
                    np.abs(wrapped(state - there, self.system.angle_places)) <= np.maximum(reach, 1e-9 * np.abs(state))
                ):
                    return True
        return False
