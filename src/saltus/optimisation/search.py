"""The search for the best orbit over parameters under constraints: arguments, start, end in words."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import singledispatch
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.continuation import Branch
from saltus.errors import InputError
from saltus.optimisation.carrying import carrying
from saltus.optimisation.expressions import Expressions, Found, is_parameter, read_expression
from saltus.optimisation.optimum import Optimum
from saltus.optimisation.sequential import ACTIVE, Box, Ended, Local, optimality, searched, violation
from saltus.optimisation.task import Limit, Task, worded
from saltus.optimisation.verifying import Verified, verified
from saltus.orbits import PeriodicOrbit
from saltus.progress import Reporter

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.progress import Report
    from saltus.system import HybridSystem

__all__ = ["OptimumOptions", "optimise"]

_STABLE = "stable"  # key of `subject_to` by which orbits must be stable
_MOVED = 1e-11  # change of the objective within a unit of a parameter, over its size, that is none
_PROBES = (3e-2, 1e-3, 1e-5, 1e-7)  # changes of all parameters, in their units, by which the objective's slope is tried
_AGREES = 0.05  # most by which the slope may differ from a change of the objective, over that change
_TRIED = 8  # orbits of a branch, the best ones, that may have no derivatives before the search gives up
_SHORT = 1e-8  # violation, in a constraint's unit, that is met


@dataclass(frozen=True, kw_only=True)
class OptimumOptions:
    """How an optimum is sought.

    Attributes
    ----------
    margin : float
        Distance that multipliers keep from the unit circle under ``stable``.
    reach : float
        Largest change of a parameter in the first step, over its unit. The unit is its range in `vary` and at most ten
        times its value; without bounds it is the value.
    max_orbits : int
        Orbits that the search looks at, at most.

    Examples
    --------
    >>> from saltus.options import OptimumOptions
    >>> OptimumOptions(max_orbits=100).max_orbits
    100
    """

    margin: float = 1e-3
    reach: float = 0.1
    max_orbits: int = 200

    def __post_init__(self) -> None:
        checked = {
            "margin": checks.between("OptimumOptions.margin", self.margin, 1e-8, 0.5),
            "reach": checks.between("OptimumOptions.reach", self.reach, 1e-6, 10.0),
            "max_orbits": checks.count("OptimumOptions.max_orbits", self.max_orbits),
        }
        for name, value in checked.items():
            object.__setattr__(self, name, value)


def optimise(
    start: Branch | PeriodicOrbit,
    *,
    maximise: str = "",
    minimise: str = "",
    vary: Mapping[str, tuple[float | None, float | None]],
    subject_to: Mapping[str, Any] | None = None,
    options: OptimumOptions | None = None,
    progress: bool | Report = False,
) -> Optimum:
    """Return the best orbit over some parameters: a local optimum under constraints, by exact derivatives.

    The orbit is followed on its smooth piece: its sheet, with its sequence of events. A step at whose end no such orbit
    is found is shortened. A grazing ends the smooth piece, and `Optimum.stopped` says so. docs/optimisation.md has
    examples.

    Parameters
    ----------
    start : Branch or PeriodicOrbit
        Where the search starts. Of a branch it is the best admissible orbit that meets the constraints.
    maximise, minimise : str
        The objective, one of both: an observable as ``"amplitude(x, 1)"``, a formula in observables and parameters,
        ``"period"``, or a parameter.
    vary : mapping of str to (float or None, float or None)
        The parameters that vary, each with its lower and upper bound, None where there is none.
    subject_to : mapping, optional
        Lower and upper bounds of observables, None where there is none: ``{"min_gap": (0.0, None)}``. Equal bounds
        hold an observable. ``"stable": True`` keeps all multipliers but the trivial one within the unit circle, with
        `OptimumOptions.margin`.
    options : OptimumOptions, optional
        Margin of stability, first step, number of orbits.
    progress : bool or callable, optional
        True for a bar on stderr, or a function of a `saltus.Progress`. An interrupt (Ctrl-C) ends the search with the
        best so far.

    Returns
    -------
    Optimum

    Raises
    ------
    InputError
        A name, a bound or an option that cannot be used. The start violates `vary`, is unstable under ``stable``, or
        its parameters do not determine it. No parameter moves the objective. No orbit meets all constraints.

    References
    ----------
    Nocedal and Wright, Numerical Optimization, Springer 2006, ch. 18 (sequential quadratic programming). Departs from
    it in steps at whose end there is no orbit: these are shortened.

    Examples
    --------
    >>> from saltus import HybridSystem, find_orbit
    >>> spring = HybridSystem.smooth(
    ...     {"x": "v", "v": "-c*v - k*x + cos(s)"}, {"k": 1.0, "c": 0.4, "w": 0.6}, phase=("s", "w")
    ... )
    >>> peak = optimise(find_orbit(spring, {}, [0.0, 0.0]), maximise="amplitude(x, 1)", vary={"w": (None, None)})
    >>> round(peak["w"] ** 2, 9), round(peak.best ** -2, 9)
    (0.92, 0.1536)
    """
    options = OptimumOptions() if options is None else checks.instance("options", options, OptimumOptions)
    goal, objective = _goal(maximise, minimise)
    known = _start_system(start)
    objective = read_expression(known, objective)
    limited, stable = _constraints(subject_to, known)
    names, ranges = _varied(vary, known)
    expressions = Expressions(known, tuple(dict.fromkeys((objective, *limited))), stable)
    index = {name: i for i, name in enumerate(expressions.names)}
    limits = tuple(
        Limit(index[name], side, limit)
        for name, ends in limited.items()
        for side, limit in zip((-1, 1), ends, strict=True)
        if math.isfinite(limit)
    )
    first = _begun(_orbits(start, expressions, limits, names, ranges, goal), expressions, names)
    with Reporter(progress) as reporter:

        def told(found: Found) -> None:
            reporter.step(1, f"{objective} = {found.values[0]:.6g}, {worded(names, found.carried.values)}")

        sign = -1.0 if goal == "maximise" else 1.0
        task = Task(expressions, names, sign, limits, ranges, 1.0 - options.margin, first, told)
        local = task.local(first)
        if not np.all(np.isfinite(local.jacobian)):
            raise InputError("start", "two multipliers that meet", "an orbit whose multipliers have derivatives")
        box = task.box(options.reach, options.max_orbits)
        _check_moves(task, local, box)
        return _optimum(task, searched(task.at, local, box), box, goal)


def _goal(maximise: object, minimise: object) -> tuple[str, str]:
    """Return whether the objective is maximised or minimised, and the objective."""
    checks.text("maximise", maximise)
    checks.text("minimise", minimise)
    if bool(maximise) == bool(minimise):
        given = "both" if maximise else "neither"
        raise InputError("maximise, minimise", given, "one of both", "as maximise='amplitude(x, 1)'")
    return ("maximise", str(maximise)) if maximise else ("minimise", str(minimise))


def _start_system(start: object) -> HybridSystem:
    given = checks.instance("start", start, Branch | PeriodicOrbit)
    if given.fixed is not None:
        raise InputError("start", "with a quantity fixed", "solved or continued at given parameters", "use subject_to")
    system: HybridSystem = given.system
    return system


def _constraints(given: object, system: HybridSystem) -> tuple[dict[str, tuple[float, float]], bool]:
    """Return bounds of expressions, infinite where there are none, and whether orbits must be stable."""
    wanted = checks.mapping("subject_to", given, "bounds by observable, as {'max_x': (None, 2.0)}")
    stable = checks.flag("subject_to['stable']", wanted.pop(_STABLE, False))
    found = {}
    for name, ends in wanted.items():
        expression = read_expression(system, name)
        if is_parameter(system, expression):
            raise InputError("subject_to", name, "observables", f"vary={{{name!r}: ...}} bounds a parameter")
        found[expression] = _ends(f"subject_to[{name!r}]", ends)
    return found, stable


def _ends(name: str, given: object) -> tuple[float, float]:
    """Return a lower and an upper bound, infinite for None."""
    ends = checks.listed(name, given, "a lower and an upper bound, None for none", most=2)
    if len(ends) != 2:
        raise InputError(name, given, "a lower and an upper bound, None for none")
    low = -math.inf if ends[0] is None else checks.number(name, ends[0], finite=False)
    high = math.inf if ends[1] is None else checks.number(name, ends[1], finite=False)
    if not low <= high or low == math.inf or high == -math.inf:
        raise InputError(name, given, "a lower and an upper bound, the lower first")
    return low, high


def _varied(given: object, system: HybridSystem) -> tuple[tuple[str, ...], NDArray[np.float64]]:
    """Return the parameters that vary and their bounds, shape (2, names), within what the system allows."""
    wanted = checks.mapping("vary", given, "bounds by parameter, as {'w': (0.5, 2.0)}", known=system.parameter_names)
    if not wanted:
        raise InputError("vary", given, "at least one parameter with its bounds, (None, None) for none")
    found = np.array([system.allowed(name) for name in wanted]).T
    for i, (name, ends) in enumerate(wanted.items()):
        low, high = _ends(f"vary[{name!r}]", ends)
        found[:, i] = max(low, found[0, i]), min(high, found[1, i])
        if not found[0, i] < found[1, i]:
            raise InputError(f"vary[{name!r}]", ends, "two numbers, the lower first, that leave a range")
    return tuple(wanted), found


@singledispatch
def _orbits(
    start: PeriodicOrbit | Branch, expressions: Expressions, limits: Sequence[Limit], names: Sequence[str],
    bounds: NDArray[np.float64], goal: str,
) -> Iterator[PeriodicOrbit]:  # fmt: skip
    """Yield the orbits at which the search may start, the best first; raise `InputError` where there is none."""
    orbit = checks.instance("start", start, PeriodicOrbit)
    for name, low, high in zip(names, *bounds, strict=True):
        if not low <= orbit.parameters[name] <= high:
            allowed = f"between {low:.9g} and {high:.9g}, as in `vary`"
            raise InputError(f"{name} of the start", orbit.parameters[name], allowed, "start elsewhere")
    if not orbit.admissible:
        raise InputError("start", "; ".join(orbit.reasons), "an orbit that is a motion of the system")
    if expressions.stable and not orbit.stable:
        largest = float(np.abs(orbit.multipliers).max())
        raise InputError("start", f"unstable, |multiplier| {largest:.6g}", "stable, as in `subject_to`")
    yield orbit


@_orbits.register(Branch)
def _orbits_of_branch(
    start: Branch, expressions: Expressions, limits: Sequence[Limit], names: Sequence[str],
    bounds: NDArray[np.float64], goal: str,
) -> Iterator[PeriodicOrbit]:  # fmt: skip
    usable = start.admissible & (start.stable if expressions.stable else True) & np.isfinite(start.multipliers).all(1)
    for name, low, high in zip(names, *bounds, strict=True):
        known = start.values if name == start.parameter else np.full(len(start), start.parameters[name])
        usable = usable & (known >= low) & (known <= high)
    if not usable.any():
        what = "admissible, stable" if expressions.stable else "admissible"
        raise InputError("start", f"a branch of {len(start)} orbits", f"one with an {what} orbit within `vary`")
    table = np.array([_column(start, name) for name in expressions.names])
    sizes = np.maximum(np.abs(table).max(axis=1), 1e-300)
    short = np.zeros(len(start))
    for limit in limits:
        short = np.maximum(short, limit.side * (table[limit.index] - limit.bound) / sizes[limit.index])
    objective = -table[0] if goal == "maximise" else table[0]
    order = np.lexsort((objective, np.where(short <= _SHORT, 0.0, short)))
    yield from (start.solution(int(i)) for i in order[usable[order]][:_TRIED])


def _column(branch: Branch, name: str) -> NDArray[np.float64]:
    """Return an expression along a branch."""
    if name != branch.parameter and is_parameter(branch.system, name):
        return np.full(len(branch), branch.parameters[name])
    return branch.column(name)


def _begun(orbits: Iterator[PeriodicOrbit], expressions: Expressions, names: Sequence[str]) -> Found:
    """Return what the first orbit with derivatives gives."""
    told: list[str] = []
    for orbit in orbits:
        try:
            found = expressions.at(carrying(orbit, names))
        except InputError as error:
            told.append(str(error))
            continue
        if not isinstance(found, str):
            return found
        told.append(found)
    raise InputError("start", told[0], "an orbit with derivatives", "start elsewhere")


def _check_moves(task: Task, local: Local, box: Box) -> None:
    """Raise `InputError` where the parameters do not move the objective, or by rounding alone.

    A derivative of rounding agrees with no change of the objective, however short the step.
    """
    direction = np.sign(local.gradient) if np.any(local.gradient) else np.ones(len(local.place))
    looked = moved = False
    for step in _PROBES:
        place = local.place + step * direction
        place = np.where((place < box.low) | (place > box.high), local.place - step * direction, place)
        there = task.at(np.clip(place, box.low, box.high), local)
        if isinstance(there, str):
            continue
        looked, way, change = True, there.place - local.place, there.objective - local.objective
        slope = 0.5 * (local.gradient + there.gradient)
        size = float(np.maximum(np.abs(local.gradient), np.abs(there.gradient)) @ np.abs(way))
        moved = moved or max(abs(change), size) > _MOVED
        if moved and abs(change - float(slope @ way)) <= _AGREES * size:
            return
    if looked:
        what = "but for rounding, it is constant next to the start" if moved else "it is constant"
        objective = task.expressions.names[0]
        raise InputError("vary", ", ".join(task.names), f"parameters that move {objective}", f"{what}; choose others")


def _optimum(task: Task, ended: Ended, box: Box, goal: str) -> Optimum:
    """Return the end of a search as a result, looked at again."""
    best, names = ended.best, task.names
    found: Found = best.data
    values = found.carried.values
    if violation(best) > _SHORT and ended.why in ("infeasible", "refused", "stuck"):
        why = f"; the search stops there: {ended.refused}" if ended.refused and ended.why == "refused" else ""
        worst = _worst(task, found, best)
        raise InputError("subject_to", worst, "constraints that an orbit can meet", f"{worded(names, values)}{why}")
    residual, multipliers = optimality(best, box, ended.height)
    # else differences would leave the orbits, or go over a corner
    whole = ended.why == "found" and ended.height == ACTIVE and not ended.corner
    checked = verified(task, best, box) if whole else Verified(math.nan, math.nan, ())
    rows = task.rates(multipliers, found)
    path = [local.data for local in ended.path]
    return Optimum(
        orbit=found.carried.orbit,
        goal=goal,
        objective=task.expressions.names[0],
        over=names,
        values=values,
        start=task.first.carried.values,
        best=float(found.values[0]),
        constraints=tuple(row[0] for row in rows),
        sides=tuple(row[1] for row in rows),
        seen=np.array([row[2] for row in rows]),
        limits=np.array([row[3] for row in rows]),
        multipliers=np.array([row[4] for row in rows]),
        residual=residual,
        mismatch=checked.mismatch,
        curvature=checked.curvature,
        path=np.array([one.carried.values for one in path]),
        path_objective=np.array([one.values[0] for one in path]),
        orbits=ended.looked + 1,
        stopped=_stopped(ended, names, values),
        notes=(*_nearest(ended, task.expressions.names[0], names, values), *checked.notes),
    )


def _nearest(ended: Ended, objective: str, names: tuple[str, ...], values: NDArray[np.float64]) -> tuple[str, ...]:
    """Return in words that an optimum on a bound is come near to only, where orbits end, or lies at a corner."""
    if ended.why == "found" and ended.corner:
        told = f"the optimum lies on a bound, at {worded(names, values)}, and {objective} has a corner there"
        return (f"{told}: its derivatives are those next to the bound",)
    if ended.why != "found" or ended.height == ACTIVE:
        return ()
    return (f"the optimum lies on a bound, next to {worded(names, values)}, where orbits end: {ended.refused}",)


def _worst(task: Task, found: Found, best: Local) -> str:
    """Return in words which constraint is violated most."""
    i = int(np.argmin(best.values))
    if i >= len(task.limits):
        return f"stable: |multipliers| <= {task.radius:.6g}, by OptimumOptions.margin"
    limit = task.limits[i]
    sign = ">=" if limit.side < 0 else "<="
    name = task.expressions.names[limit.index]
    return f"{name} {sign} {limit.bound:.6g}: at best {found.values[limit.index]:.6g}"


def _stopped(ended: Ended, names: tuple[str, ...], values: NDArray[np.float64]) -> str:
    """Return why a search ended, in words."""
    if ended.why == "found":
        return "the optimum is found"
    if ended.why == "refused":
        return f"no optimum: the smooth piece ends next to {worded(names, values)}: {ended.refused}"
    if ended.why == "stuck":
        return "no optimum: no further step improves the objective, as at a corner of it"
    if ended.why == "interrupted":
        return "interrupted: the best so far"
    return "no more orbits are allowed: the best so far"
