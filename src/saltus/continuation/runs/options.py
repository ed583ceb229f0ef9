"""Arguments of continuations and how they are checked: intervals, events, stops, starts."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from saltus import checks
from saltus.continuation.core.arclength import StepControl
from saltus.continuation.problems.watching import EXTREMUM
from saltus.continuation.results.special_points import SpecialPoint
from saltus.errors import InputError, nearest
from saltus.orbits.observables.quantities import Quantity, read_quantity
from saltus.orbits.orbit import PeriodicOrbit
from saltus.scales import BOUND_MISSED
from saltus.system import HybridSystem, Map

__all__ = [
    "BranchOptions",
    "Plane",
    "asked_types",
    "check_along_parameter",
    "checked_interval",
    "read_events",
    "read_plane",
    "read_range",
    "read_steps",
    "read_stops",
    "read_value",
    "read_varied",
    "unit_of",
]

_DIRECTIONS = ("both", "up", "down")  # ways that the parameter may go at the start
_TYPES = "types of special points"  # what messages ask for in `stop_at`


@dataclass(frozen=True)
class Plane:
    """Two parameters that vary along a locus.

    Attributes
    ----------
    names : tuple of str
        In the system's order.
    intervals : tuple of (float, float)
        Their intervals.
    order : tuple of str
        The names in the order that the user gave.
    """

    names: tuple[str, str]
    intervals: tuple[tuple[float, float], tuple[float, float]]
    order: tuple[str, str]


@dataclass(frozen=True)
class BranchOptions:
    """How each branch of a family is traced; its fields are arguments of `continue_orbit`.

    Parameters
    ----------
    steps : StepControl
        Sizes of steps and their limits. Its `at_grazing` also holds while the orbit is continued to each member.
    directions : {"both", "up", "down"}
        Which way the parameter goes at each start.
    events : mapping of str to float or "extremum"
        Users' events, recorded along each branch, as `continue_orbit` takes them.
    stop_at : str or iterable of str
        Types of special points; each branch ends at the first. Kept as a tuple. With ``"GR"`` the way to each member
        ends at a grazing as well.

    Raises
    ------
    InputError
        A value that cannot be used. Names of events and types are checked when an orbit is at hand.

    Examples
    --------
    >>> BranchOptions(directions="up", stop_at="PD").stop_at
    ('PD',)
    """

    steps: StepControl = field(default_factory=StepControl)
    directions: str = "both"
    events: Mapping[str, float | str] = field(default_factory=dict)
    stop_at: str | Iterable[str] = ()

    def __post_init__(self) -> None:
        checks.instance("BranchOptions.steps", self.steps, StepControl)
        checks.chosen("BranchOptions.directions", self.directions, _DIRECTIONS)
        events = checks.mapping("BranchOptions.events", self.events, "names to values, as {'gap': 0.02}")
        object.__setattr__(self, "events", events)
        stops = (self.stop_at,) if isinstance(self.stop_at, str) else self.stop_at
        object.__setattr__(self, "stop_at", checks.names("BranchOptions.stop_at", stops, _TYPES))


def read_stops(stop_at: object, known: Sequence[str]) -> set[str]:
    """Return the types of special points at which a curve ends, checked."""
    given = [stop_at] if isinstance(stop_at, str) else stop_at
    return {checks.chosen("stop_at", name, known) for name in checks.names("stop_at", given, _TYPES)}


def asked_types(events: Mapping[str, object]) -> list[str]:
    """Return what `stop_at` may name of users' events: their keys, and EX where an extremum is asked for."""
    return [*events, *(["EX"] if any(isinstance(value, str) for value in events.values()) else [])]


def read_steps(steps: object, what: str) -> StepControl:
    """Return the steps of a curve that ends at a grazing, checked; `what` is its name in messages."""
    control = StepControl() if steps is None else checks.instance("steps", steps, StepControl)
    if control.at_grazing != "switch":
        raise InputError("StepControl.at_grazing", control.at_grazing, "left out", f"{what} ends at a grazing")
    return control


def checked_interval(
    system: HybridSystem | Map, parameters: Mapping[str, float], parameter: str, bounds: object, directions: str
) -> tuple[float, float]:
    """Return the interval of a parameter, cut to the values that the system allows; all arguments are checked."""
    checks.chosen("parameter", parameter, system.parameter_names)
    checks.chosen("directions", directions, _DIRECTIONS)
    low, high = checks.interval("bounds", bounds)
    value = parameters[parameter]
    lowest, highest = system.allowed(parameter)
    if (math.isfinite(low) and low < lowest) or (math.isfinite(high) and high > highest):
        raise InputError("bounds", bounds, f"within [{lowest:g}, {highest:g}], where {parameter} may lie")
    low, high = max(low, lowest), min(high, highest)
    if not low < high:
        raise InputError("bounds", bounds, "two numbers, the lower first")
    _check_start(parameter, value, low, high)
    return low, high


def _check_start(name: str, value: float, low: float, high: float) -> None:
    """Raise `InputError` where an interval does not hold the start."""
    slack = BOUND_MISSED * unit_of(low, high, value)
    if not low - slack <= value <= high + slack:
        raise InputError("bounds", (low, high), f"an interval that holds the start, {name} = {value:g}")


def read_varied(orbit: PeriodicOrbit, name: str) -> Quantity | None:
    """Return the quantity along which a branch goes, or None where it goes along a parameter; the name is checked."""
    known = orbit.system.parameter_names
    if orbit.fixed is None or (isinstance(name, str) and name in known):
        hint = ""
        if orbit.fixed is None and isinstance(name, str) and ("(" in name or name.startswith(("min_", "max_", "per"))):
            hint = "a quantity varies along orbits that solve_orbit found with fix={...}"
        checks.chosen("parameter", name, known, hint=hint)
        return None
    return read_quantity(orbit.system, name)


def read_range(name: str, value: float, bounds: tuple[float, float], directions: str) -> tuple[float, float]:
    """Return the interval of a quantity that starts at a value; all arguments are checked."""
    checks.chosen("directions", directions, _DIRECTIONS)
    low, high = checks.interval("bounds", bounds)
    _check_start(name, value, low, high)
    return low, high


def unit_of(low: float, high: float, value: float) -> float:
    """Return the unit of a parameter: the length of its interval; of an infinite one its size at the start."""
    if math.isfinite(high - low):
        return high - low
    return abs(value) or 1.0


def read_value(name: str, given: object) -> float | None:
    """Return the value that a user's event asks for; None for an extremum."""
    if isinstance(given, str) and given == EXTREMUM:
        return None
    return checks.number(f"events[{name!r}]", given, f"a finite number, or {EXTREMUM!r}")


def read_events(
    orbit: PeriodicOrbit, parameter: str, events: Mapping[str, float | str]
) -> tuple[tuple[str, str, float | None], ...]:
    """Return (name, kind, value) for each user's event; kind is ``parameter``, ``observable`` or as ``min_gap``.

    The value is None where an extremum is asked for.
    """
    found: list[tuple[str, str, float | None]] = []
    quantities, free = [*orbit.min], ""
    if orbit.fixed is not None and not orbit.fixed.family and parameter not in orbit.system.parameter_names:
        free = orbit.fixed.free
    for name, given in events.items():
        value = read_value(name, given)
        if value is None and name in (parameter, free):
            raise InputError("events", name, "another quantity", "where the branch turns in it is an SN, or a TP")
        if name == parameter:
            found.append((name, "parameter", value))
        elif name == free:
            found.append((name, "freed", value))
        elif name in quantities:
            found += [(name, f"min_{name}", value), (name, f"max_{name}", value)]
        elif name.startswith(("min_", "max_")) and name[4:] in quantities:
            found.append((name, name, value))
        elif name == "period":
            found.append((name, "observable", value))
        elif not name.isidentifier():
            read_quantity(orbit.system, name)
            found.append((name, "observable", value))
        else:
            known = [parameter, *quantities, *(f"min_{q}" for q in quantities), *(f"max_{q}" for q in quantities)]
            known.append("period")
            instead = f"one of {', '.join(known)}, or an observable, as in 'mean({quantities[0]})'"
            raise InputError("events", name, instead, nearest(name, known))
    return tuple(found)


def check_along_parameter(name: str, point: SpecialPoint[Any]) -> None:
    """Raise `InputError` where a special point belongs to a branch along a quantity, not a parameter."""
    known = point.solution.system.parameter_names
    if not set(point.varied) <= set(known):
        fixed, hint = point.orbit.fixed, ""
        if fixed is not None and fixed.free and not fixed.family:
            hint = f"a branch along {fixed.free!r} through its orbit passes the same point"
        raise InputError(name, f"a point along {point.varied[0]!r}", "a point of a branch along a parameter", hint)


def read_plane(solution: Any, parameters: tuple[str, str], bounds: Mapping[str, tuple[float, float]]) -> Plane:
    """Return the two parameters of the locus through a solution, checked."""
    known = solution.system.parameter_names
    pair = checks.listed("parameters", parameters, "two names, as ('A', 'w')", most=2)
    if len(pair) != 2:
        raise InputError("parameters", parameters, "two names, as ('A', 'w')")
    for name in pair:
        checks.chosen("parameters", name, known)
    if pair[0] == pair[1]:
        raise InputError("parameters", pair, "two different names")
    given = checks.mapping("bounds", bounds, f"{pair[0]} and {pair[1]} to intervals")
    if set(given) != set(pair):
        raise InputError("bounds", bounds, f"a mapping of {pair[0]} and {pair[1]} to intervals")
    first, second = sorted(pair, key=known.index)
    intervals = []
    for name in (first, second):
        low, high = checks.interval(f"bounds[{name!r}]", given[name], finite=True)
        lowest, highest = solution.system.allowed(name)
        if low < lowest or high > highest:
            allowed = f"within [{lowest:g}, {highest:g}], where {name} may lie"
            raise InputError(f"bounds[{name!r}]", bounds[name], allowed)
        slack = BOUND_MISSED * (high - low)
        if not low - slack <= solution.parameters[name] <= high + slack:
            wanted = f"an interval that holds the start, {name} = {solution.parameters[name]:g}"
            raise InputError(f"bounds[{name!r}]", bounds[name], wanted)
        intervals.append((low, high))
    return Plane((first, second), (intervals[0], intervals[1]), (pair[0], pair[1]))
