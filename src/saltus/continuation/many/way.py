"""Continuation of an orbit to the parameters of each member of a family, and the member's branch."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from saltus.continuation.branches import continue_orbit
from saltus.continuation.core.arclength import StepControl
from saltus.continuation.results.branch import Branch
from saltus.continuation.runs.options import BranchOptions
from saltus.errors import SaltusError
from saltus.orbits import PeriodicOrbit
from saltus.progress import Report

__all__ = ["Task", "carried", "is_interrupted"]

_WAY = StepControl(
    initial=0.05, largest=0.25, max_points=500
)  # steps on the way to a member: long, only its end matters
_HALVINGS = 4  # binary logarithm of the most stairs of a way along several parameters


def carried(
    orbit: PeriodicOrbit, places: Sequence[Mapping[str, float]], options: BranchOptions
) -> Iterator[tuple[int, PeriodicOrbit | str]]:
    """Yield each member's index and the orbit at its values, or the reason why there is none; nearest member first.

    A member's orbit is continued from the nearest member already reached, or, if that way is blocked, from the given
    orbit. `StepControl.at_grazing` and ``"GR"`` in `stop_at` of the `options` hold on the way too.
    """
    way = BranchOptions(
        replace(_WAY, at_grazing=options.steps.at_grazing), stop_at=("GR",) if "GR" in options.stop_at else ()
    )
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
        reached = _carry(sources[index], places[index], way, _HALVINGS)
        if isinstance(reached, str) and sources[index] is not orbit:
            again = _carry(orbit, places[index], way, _HALVINGS)
            reached = reached if isinstance(again, str) else again
        if not isinstance(reached, str):
            between = np.linalg.norm(rows - rows[index], axis=1)
            for i in left:
                if between[i] < away[i]:
                    away[i], sources[i] = between[i], reached
        yield index, reached


def _carry(
    orbit: PeriodicOrbit, place: Mapping[str, float], options: BranchOptions, halvings: int
) -> PeriodicOrbit | str:
    """Return the orbit at other values of parameters, varied one after the other, or why the way is blocked."""
    apart = [name for name, value in place.items() if value != orbit.parameters[name]]
    here = orbit
    for name in apart:
        reached = _carry_along(here, name, place[name], options)
        if isinstance(reached, str):
            break
        here = reached
    else:
        return here
    if len(apart) > 1 and halvings:
        half = {name: 0.5 * (orbit.parameters[name] + place[name]) for name in apart}
        middle = _carry(orbit, half, options, halvings - 1)
        if not isinstance(middle, str):
            return _carry(middle, place, options, halvings - 1)
    return reached


def _carry_along(orbit: PeriodicOrbit, name: str, value: float, options: BranchOptions) -> PeriodicOrbit | str:
    """Return the orbit at another value of one parameter, or why there is none."""
    begin = orbit.parameters[name]
    bounds, direction = ((begin, value), "up") if value > begin else ((value, begin), "down")
    way = Task(name, bounds, replace(options, directions=direction)).trace(orbit)
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
    reached = way.solution(-1)
    return replace(reached, parameters=dict(reached.parameters) | {name: value})  # exactly the member's value


@dataclass(frozen=True)
class Task:
    """Arguments of a member's branch: parameter, bounds and options."""

    parameter: str
    bounds: tuple[float, float]
    options: BranchOptions

    def branch(self, start: PeriodicOrbit, progress: bool | Report = False) -> Branch:
        """Return the branch through an orbit."""
        options = self.options
        return continue_orbit(
            start, self.parameter, self.bounds, steps=options.steps, directions=options.directions,
            events=options.events, stop_at=options.stop_at, progress=progress,
        )  # fmt: skip

    def trace(self, start: PeriodicOrbit, progress: bool | Report = False) -> Branch | str:
        """Return the branch through an orbit, or the reason why there is none."""
        try:
            return self.branch(start, progress)
        except SaltusError as error:
            return str(error)
        except Exception as error:  # one member's failure must not lose the others
            return f"{type(error).__name__}: {error}"


def is_interrupted(branch: Branch) -> bool:
    """Return whether a branch was interrupted (Ctrl-C)."""
    return "interrupted" in branch.stopped
