"""Pseudo-arclength continuation of a zero problem: steps along the branch and their control.

The module knows nothing of orbits. docs/theory/continuation.md, "Pseudo-arclength", derives the method.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from saltus import checks
from saltus.continuation.core.locating import events_between
from saltus.continuation.core.touching import touches_between
from saltus.continuation.core.verdicts import ANGLE, DEVIATION, FOLDS, TAKEN
from saltus.continuation.core.within_step import dips
from saltus.continuation.core.zero_problem import Event, Point, ZeroProblem, correct
from saltus.errors import InputError
from saltus.scales import CROWDED

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Failure", "StepControl", "follow"]

# Why a step is rejected, by what `judge` says of it.
_MISSTEPS = {
    ANGLE: "angle: the branch turns too sharply for the step",
    DEVIATION: "deviation: the corrected point lies too far from the predicted one",
    FOLDS: "folds: the parameter turns twice within the step",
}
_DOUBTS = 100  # most steps that are taken back without getting farther


@dataclass(frozen=True)
class StepControl:
    """Sizes of the steps along a branch or locus, their limits, and how a branch goes on at a grazing.

    Parameters
    ----------
    initial, smallest, largest : float
        First, least and greatest step, in arclength. Its units are the states' sizes and the parameter's interval.
    deviation : float
        Distance between predicted and corrected point, in arclength, at which the step keeps its length.
    angle : float
        Largest angle between the tangents at a step's two ends, in radians.
    iterations : int
        Most Newton iterations; a step that needs more is repeated shorter.
    max_points : int
        Most points of each direction of a branch or locus.
    pieces : int
        Most pieces of a smooth orbit that is cut where its sensitivities grow. A branch of orbits ends where more are
        needed, as its orbits are so unstable that each takes long.
    at_grazing : {"switch", "pass"}
        How a branch of orbits goes on at a grazing: in the neighbouring signature, or in the same one. In the same one
        solutions beyond the grazing are no motion (``admissible`` false). With ``stop_at="GR"`` a branch ends at the
        grazing instead.

    Raises
    ------
    InputError
        A value that cannot be used; the message names it.

    Examples
    --------
    >>> StepControl(largest=0.02).at_grazing
    'switch'
    """

    initial: float = 0.01
    smallest: float = 1e-8
    largest: float = 0.1
    deviation: float = 3e-4
    angle: float = 0.5
    iterations: int = 7
    max_points: int = 5000
    pieces: int = 1024
    at_grazing: str = "switch"

    def __post_init__(self) -> None:
        for name in ("initial", "smallest", "largest", "deviation", "angle"):
            object.__setattr__(self, name, checks.positive(f"StepControl.{name}", getattr(self, name)))
        for name in ("iterations", "max_points", "pieces"):
            object.__setattr__(self, name, checks.count(f"StepControl.{name}", getattr(self, name)))
        checks.chosen("StepControl.at_grazing", self.at_grazing, ("switch", "pass"))
        if not self.smallest <= self.largest:
            raise InputError("StepControl.smallest", self.smallest, f"<= largest, {self.largest!r}")


@dataclass(frozen=True)
class Failure:
    """A rejected step: the parameter where it began, its length in arclength, the reason."""

    parameter: float
    step: float
    reason: str


def follow(
    problem: ZeroProblem,
    start: Point,
    control: StepControl,
    *,
    log: list[Failure],
    first_step: float | None = None,
    ahead: Callable[[Point, Point, float], tuple[list[Point], float]] | None = None,
) -> Iterator[Point | Event | str]:
    """Yield the points of a branch after `start`, the events between them, and last the reason why it ended.

    Parameters
    ----------
    problem : ZeroProblem
        The equations.
    start : Point
        First point, examined; its tangent gives the direction.
    control : StepControl
        Sizes of steps and their limits.
    log : list of Failure
        Each rejected step is appended.
    first_step : float, optional
        Length of the first step in place of `control.initial`.
    ahead : callable, optional
        Takes many steps at once where nothing happens: from the last two points and a step's length it returns further
        points, examined, and the length of the step behind them.
    """
    h = min(first_step or control.initial, control.largest)
    point, before, earlier = start, None, None
    held, rejected, furthest, doubts = False, False, -math.inf, 0
    while True:
        if ahead is not None and held and before is not None and not rejected:
            quiet, h = ahead(before, point, h)
            for new in quiet:
                yield point
                earlier, before, point = before, point, new
        step = _attempt(problem, before, point, h, control)
        rejected = isinstance(step, str)
        if isinstance(step, str):
            log.append(Failure(point.parameter, h, step))
            h *= 0.5
            if h < control.smallest:
                if held:
                    yield point
                yield f"step below {control.smallest:g}: {step}"
                return
            continue
        if held and before is not None:
            if (doubt := _returns(step.point, point, before)) is not None:
                furthest, doubts = (point.arc, 0) if point.arc > furthest else (furthest, doubts + 1)
                if doubts > _DOUBTS:
                    yield f"no step past {doubts} doubts: {doubt}"
                    return
                h, held = 0.5 * (point.arc - before.arc), False
                log.append(Failure(before.parameter, 2.0 * h, doubt))
                point, before, earlier = before, earlier, None
                continue
            yield point
        yield from step.events
        # a step without events is not final yet: the next one may show that zeros were passed over
        held = not step.events
        if not held:
            yield step.point
        earlier, before, point = before, point, step.point
        h = min(h * step.growth, control.largest)


@dataclass(frozen=True, eq=False)
class _Step:
    """A step that can be taken: its end, the events in it, the factor on the length of the next step."""

    point: Point
    events: list[Event]
    growth: float


def _attempt(problem: ZeroProblem, before: Point | None, point: Point, h: float, control: StepControl) -> _Step | str:
    """Return the step of length `h` from `point`, or the reason why it is rejected."""
    from saltus.continuation.core.kernels.control import growth, judge  # with Numba, which takes its time

    problem.depart(point)
    guess = _predict(point, before, h)
    new = correct(problem, guess, point.tangent, point.weights, control.iterations)
    if isinstance(new, str) and problem.recover(point):
        new = correct(problem, guess, point.tangent, point.weights, control.iterations)
    if isinstance(new, str):
        return new
    new.frame = point.frame
    limits = control.deviation, control.angle
    fault, moved, angle, length = judge(point.weights, point.line, new.line, guess, limits)
    new.arc = point.arc + length
    if fault != TAKEN:
        return _MISSTEPS[fault]
    new.examined = problem.examine(new, point)
    doubt = new.examined.fault or _returns(before, point, new)
    touched = doubt is not None and new.examined.fault is None
    touches = touches_between(problem, before, point, new) if touched else []
    if doubt is not None and not touches:
        return doubt
    events = touches or events_between(problem, point, new, before)
    if isinstance(events, str):
        return events
    if h > CROWDED and problem.crowded([event.name for event in events]):
        return "events: more than one bifurcation within the step"
    return _Step(new, events, growth(moved, angle, new.iterations, limits))


def _predict(point: Point, before: Point | None, h: float) -> NDArray[np.float64]:
    """Return the predicted point at step length `h`, on the cubic through the last two points and their tangents."""
    from saltus.continuation.core.kernels.control import predict

    guess, last = np.empty_like(point.u), point.line
    if before is None or before.u.size != point.u.size or before.frame is not point.frame:
        predict(last, last, 0.0, h, guess)
    else:
        predict(last, before.line, point.arc - before.arc, h, guess)
    return guess


def _returns(before: Point | None, a: Point, b: Point) -> str | None:
    """Return the reason why a monitor function may vanish twice in the step from `a` to `b`; None if none may.

    docs/theory/continuation.md, "Special points", explains the test.
    """
    if before is None or before.arc == a.arc or abs(b.arc - a.arc) < CROWDED:
        return None
    back, ahead = abs(a.arc - before.arc), abs(b.arc - a.arc)
    first, second = before.examined.monitors, a.examined.monitors
    later = b if b.arc > a.arc else a
    known = a.examined.doubled | b.examined.doubled | later.examined.once
    for name, end in b.examined.monitors.items():
        if name not in known and dips([first.get(name), second.get(name), end], back, ahead):
            return f"events: {name} may vanish twice within the step"
    return None
