"""The adding-sliding ahead, where an excursion from a sliding segment shrinks to nothing.

The excursion's end is a double root of its event there, so steps along the branch fail just before. Without the
excursion the equations are regular, and the adding-sliding is where the sliding segment touches the border of sliding.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.core.arclength import StepControl, follow
from saltus.continuation.core.monitor import Monitor
from saltus.continuation.core.zero_problem import Event, Point, start_point
from saltus.continuation.problems.grazing import Neighbour, neighbour
from saltus.continuation.problems.orbit import OrbitZeroProblem
from saltus.continuation.runs.two_sided import turned
from saltus.scales import EXCURSION_SHORT

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.orbits.signature import Signature

__all__ = ["adding_sliding_ahead"]

_STEPS = 24  # steps along the branch without the excursion in which its touch is sought
_AROUND = 6  # the same from one step aside
_CONTROL = StepControl(initial=1e-5, largest=2e-2)


def adding_sliding_ahead(
    points: list[tuple[OrbitZeroProblem, Point]],
    equations: Callable[[Signature, NDArray[np.float64]], OrbitZeroProblem],
) -> tuple[OrbitZeroProblem, Event, Point] | None:
    """Return equations without the excursion that vanishes, the touch, and a point behind it; None where there is none.

    Parameters
    ----------
    points : list of (OrbitZeroProblem, Point)
        The points of a branch, behind the last of which no step succeeds.
    equations : callable
        Returns the equations of a signature near given unknowns.
    """
    branch, last = points[-1]
    found = _without(branch, last)
    if found is None:
        return None
    fresh = equations(found.signature, found.u)
    try:
        begun = start_point(fresh, found.u)
    except ValueError:
        return None
    begun.examined = fresh.examine(begun, None)
    if begun.examined.data is None:
        return None
    for sign in (1.0, -1.0):
        if (touch := _touch(fresh, turned(begun, sign, fresh.odd), _STEPS)) is not None:
            return fresh, *touch
    # steps may come so near that rounding has put the orbit on the touch or past it: it is met from either side
    for sign in (1.0, -1.0):
        steps = itertools.islice(follow(fresh, turned(begun, -sign, fresh.odd), _CONTROL, log=[]), _AROUND)
        aside = next((item for item in steps if isinstance(item, Point)), None)
        if aside is not None and (touch := _touch(fresh, turned(aside, -1.0, fresh.odd), _AROUND)) is not None:
            return fresh, *touch
    return None


def _touch(fresh: OrbitZeroProblem, begun: Point, count: int) -> tuple[Event, Point] | None:
    """Return the touch that is met within so many steps along a branch, and the first admissible point behind it."""
    met: Event | None = None
    for item in itertools.islice(follow(fresh, begun, _CONTROL, log=[]), count):
        if isinstance(item, Event) and item.name.kind == "margin":
            met = item
        elif isinstance(item, Point) and met is not None and _is_behind(item, met):
            return met, item
    return None


def _is_behind(item: Point, met: Event) -> bool:
    """Return whether an orbit is admissible, and not past the touch by rounding, where it still counts as such."""
    return item.examined.data.survey.admissible and item.examined.monitors.get(met.name, 0.0) > 0.0


def _without(branch: OrbitZeroProblem, point: Point) -> Neighbour | None:
    """Return the orbit of a point without the shortest excursion between two sliding segments."""
    problem, n = branch.problem, branch.n
    system, modes = problem.system, problem.signature.modes
    slides = [system.modes[system.mode_names[mode]].surface is not None for mode in modes]
    durations, count = point.u[n : problem.size : n + 1], len(modes)
    short = EXCURSION_SHORT * float(np.abs(durations).sum())
    for i in np.argsort(durations).tolist():
        if count > 2 and not slides[i] and slides[i - 1] and modes[i - 1] == modes[(i + 1) % count]:
            if not durations[i] < short:
                return None
            beside = neighbour(problem, Monitor("duration", i), point.u)
            return beside if isinstance(beside, Neighbour) and math.isfinite(float(beside.u.sum())) else None
    return None
