"""The way of an orbit to the values of a family's member, and the branch from there."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from saltus.continuation.arclength import StepControl
from saltus.continuation.branch import Branch
from saltus.continuation.orbits import continue_orbit
from saltus.errors import SaltusError
from saltus.orbits import PeriodicOrbit

__all__ = ["Task", "carried", "is_interrupted"]

_WAY = StepControl(initial=0.05, largest=0.25, most=500)
"""Steps on the way to a member: only its end is wanted."""

_HALVINGS = 4
"""The way along several parameters has at most 2^4 stairs."""


def carried(
    orbit: PeriodicOrbit, places: Sequence[Mapping[str, float]], at_grazing: str
) -> Iterator[tuple[int, PeriodicOrbit | str]]:
    """Yield each member's index and the orbit at its values, or why there is none, the nearest member first.

    Each is carried from the nearest values already reached; where that is blocked, from the given orbit.
    """
    names = list(places[0])
    rows = np.array([[place[name] for name in names] for place in places])
    origin = np.array([orbit.parameters[name] for name in names])
    width = np.ptp(np.vstack([rows, origin]), axis=0)
    rows, origin = rows / np.where(width > 0.0, width, 1.0), origin / np.where(width > 0.0, width, 1.0)
    away = np.linalg.norm(rows - origin, axis=1)
    sources: list[PeriodicOrbit] = [orbit] * len(places)
    left = set(range(len(places)))
    while left:
        index = min(left, key=lambda i: (away[i], i))
        left.remove(index)
        reached = _carry(sources[index], places[index], at_grazing, _HALVINGS)
        if isinstance(reached, str) and sources[index] is not orbit:
            again = _carry(orbit, places[index], at_grazing, _HALVINGS)
            reached = again if isinstance(again, PeriodicOrbit) else reached
        if isinstance(reached, PeriodicOrbit):
            between = np.linalg.norm(rows - rows[index], axis=1)
            for i in left:
                if between[i] < away[i]:
                    away[i], sources[i] = between[i], reached
        yield index, reached


def _carry(orbit: PeriodicOrbit, place: Mapping[str, float], at_grazing: str, halvings: int) -> PeriodicOrbit | str:
    """Return the orbit at other values of parameters, along one after the other, or why the way is blocked."""
    apart = [name for name, value in place.items() if value != orbit.parameters[name]]
    here = orbit
    for name in apart:
        reached = _carry_along(here, name, place[name], at_grazing)
        if isinstance(reached, str):
            break
        here = reached
    else:
        return here
    if len(apart) > 1 and halvings:
        half = {name: 0.5 * (orbit.parameters[name] + place[name]) for name in apart}
        middle = _carry(orbit, half, at_grazing, halvings - 1)
        if isinstance(middle, PeriodicOrbit):
            return _carry(middle, place, at_grazing, halvings - 1)
    return reached


def _carry_along(orbit: PeriodicOrbit, name: str, value: float, at_grazing: str) -> PeriodicOrbit | str:
    """Return the orbit at another value of one parameter, or why there is none."""
    begin = orbit.parameters[name]
    bounds, direction = ((begin, value), "up") if value > begin else ((value, begin), "down")
    way = Task(name, bounds, {"steps": _WAY, "directions": direction, "at_grazing": at_grazing}).trace(orbit)
    blocked = f"no way from {name} = {begin:.9g} to {value:.9g}: "
    if isinstance(way, str):
        return blocked + way
    if is_interrupted(way):
        raise KeyboardInterrupt
    end, rounding = float(way.values[-1]), 1e-9 * abs(value - begin)
    if abs(end - value) > rounding:
        folds = [point.parameters[name] for point in way.special_points if point.type == "SN"]
        turned = folds and abs(end - begin) <= rounding
        return blocked + (f"saddle-node at {name} = {folds[0]:.9g}" if turned else way.stopped[1])
    reached = way.orbit(-1)
    return replace(reached, parameters=dict(reached.parameters) | {name: value})  # the bound, to its last digit


@dataclass(frozen=True)
class Task:
    """What is asked for, of each member: a branch from its start."""

    parameter: str
    bounds: tuple[float, float]
    options: Mapping[str, Any]

    def trace(self, start: PeriodicOrbit, watch: Callable[[int, float], None] | None = None) -> Branch | str:
        """Return a branch, or in words why there is none."""
        try:
            return continue_orbit(start, self.parameter, self.bounds, progress=watch, **self.options)
        except SaltusError as error:
            return str(error)
        except Exception as error:  # whatever it is, the other members are not to be lost
            return f"{type(error).__name__}: {error}"


def is_interrupted(branch: Branch) -> bool:
    """Return whether a branch was given up at Ctrl-C."""
    return "interrupted" in branch.stopped
