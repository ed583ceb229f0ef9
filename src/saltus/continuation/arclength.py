"""Pseudo-arclength continuation of a zero problem: prediction, correction, steps, location. No orbits here."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from saltus import checks
from saltus.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = [
    "RESTS",
    "Event",
    "Failure",
    "Point",
    "StepControl",
    "ZeroProblem",
    "events_between",
    "follow",
    "locate",
    "start_point",
]


@dataclass(frozen=True)
class StepControl:
    """How a branch is stepped along.

    Parameters
    ----------
    initial, smallest, largest : float
        Steps in arclength, measured in units of the orbit's size and of the parameter's interval.
    deviation : float
        Distance between predicted and corrected point at which the step is kept as it is.
    angle : float
        Largest angle between the tangents at a step's two ends, in radians.
    iterations : int
        Newton iterations after which a step is given up.
    most : int
        Points after which a branch stops.
    """

    initial: float = 0.01
    smallest: float = 1e-8
    largest: float = 0.1
    deviation: float = 3e-4
    angle: float = 0.5
    iterations: int = 7
    most: int = 5000

    def __post_init__(self) -> None:
        for name in ("initial", "smallest", "largest", "deviation", "angle"):
            object.__setattr__(self, name, checks.positive(f"StepControl.{name}", getattr(self, name)))
        for name in ("iterations", "most"):
            object.__setattr__(self, name, checks.count(f"StepControl.{name}", getattr(self, name)))
        if not self.smallest <= self.largest:
            raise InputError("StepControl.smallest", self.smallest, f"<= largest, {self.largest!r}")


class ZeroProblem(Protocol):
    """F(u) = 0 with one unknown more than equations; the last unknown is the parameter.

    Its monitor functions go by whatever can be hashed and told. `singular` names those at whose zeros the equations
    bordered by a plane are singular, `noise` gives what rounding leaves of some at their zeros, over their size nearby.
    """

    singular: frozenset[Any]
    noise: Mapping[Any, float]

    def evaluate(self, u: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the residual, shape (m,), and the Jacobian, shape (m, m + 1)."""

    def accurate(self) -> bool:
        """Return whether the discretisation was fine enough at the last evaluation; refine it where it was not."""

    def metric(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return weights, shape (m + 1,): the squared arclength of du is sum weights du^2."""

    def scale(self) -> NDArray[np.float64]:
        """Return typical sizes of the unknowns, shape (m + 1,), for Newton's criterion."""

    def examine(self, point: Point, before: Point | None) -> Examined:
        """Return what is to be known of a corrected point, and whether it may follow the one before."""

    def depart(self, point: Point) -> None:
        """Normalise the equations at a point from which a step is to go; renew what of it depends on that."""

    def recover(self, point: Point) -> bool:
        """Make the discretisation finer where no point is found a step from `point`; return whether it is finer."""

    def leading(self, names: list[Any]) -> list[Any]:
        """Return those of the monitor functions that change sign in a step which are to be located."""

    def sort_out(self, events: list[Event]) -> list[Event] | str:
        """Return the events of one step, in order, without those that are the shadow of another, or why not to take it.

        The step is that between the two points examined last, the second as the successor of the first.
        """

    def crowded(self, names: list[Any]) -> bool:
        """Return whether the events of one step are so many that a shorter one is due."""

    def monitor(self, name: Any, point: Point) -> float:
        """Return one monitor function at a point that need not be quite corrected."""


@dataclass(frozen=True)
class Examined:
    """What a problem says of a point: values of its monitor functions, a fault that forbids it, anything it keeps."""

    monitors: Mapping[Any, float]
    fault: str | None = None
    data: Any = None


@dataclass(eq=False)
class Point:
    """A point of a branch with its tangent (unit arclength) and the sign and log of the bordered determinant.

    `frame` is what the problem normalised its equations by, where it does so from place to place.
    """

    u: NDArray[np.float64]
    J: NDArray[np.float64]
    tangent: NDArray[np.float64]
    weights: NDArray[np.float64]
    sign: float
    log: float
    residual: float
    iterations: int = 0
    arc: float = 0.0
    examined: Examined = field(default_factory=lambda: Examined({}))
    frame: Any = None

    @property
    def parameter(self) -> float:
        """The last unknown."""
        return float(self.u[-1])


@dataclass(frozen=True)
class Failure:
    """A step that was not taken: where, how long, why."""

    parameter: float
    step: float
    reason: str


@dataclass(frozen=True, eq=False)
class Event:
    """A zero of a monitor function, located."""

    name: Any
    point: Point
    value: float


RESTS = 1e-9
"""Slope of the parameter, in units of arclength, below which it rests: a family at one value has one of rounding."""

_ACCEPT, _REMESHED, _CROWDED, _ZERO, _JUMP, _BENT = 2e-9, 20, 1e-5, 1e-6, 1e-3, 2.0
"""Newton step at which a point is taken; evaluations more in which the mesh may become fine enough for a point that is
found; step below which several events may share it; value of a monitor function, over those at the step's ends, that is
rounding of a zero, and above which a change of sign is a jump; what the curvature of a monitor function is multiplied
with where a zero may be overlooked."""

_SETTLED, _STALLED, _EXACT = 1e-9, 1e-7, 1e-11
"""Newton step at which a located point is taken; below which it may be where steps no longer shrink; value of a monitor
function, over those at the step's ends, that counts as a zero."""


def correct(
    problem: ZeroProblem,
    guess: NDArray[np.float64],
    tangent: NDArray[np.float64],
    weights: NDArray[np.float64],
    iterations: int,
) -> Point | str:
    """Return the point of the branch in the hyperplane through `guess` normal to `tangent`, or why there is none."""
    from saltus.flow._linear_kernels import bordered

    u = guess.copy()
    row, scale = weights * tangent, problem.scale()
    previous, remeshed = math.inf, 0
    for iteration in range(1, iterations + _REMESHED + 1):
        F, J = problem.evaluate(u)
        steps, sign, log, size, residual = bordered(J, F, row, u, guess, scale)
        if sign == 0.0 or not math.isfinite(log):
            return "Newton: the equations are singular there"
        if not size < 1e6:
            return "Newton: the flow cannot be followed there"
        u = u + steps[:, 0]
        if problem.accurate() and size < _ACCEPT:
            direction = steps[:, 1] / math.sqrt(float(weights @ steps[:, 1] ** 2))
            return Point(u, J, direction, weights, sign, log, residual, iteration)
        if size > 0.7 * previous and size > 1e-5:
            return "Newton: no contraction"
        remeshed += size < _ACCEPT
        if iteration - remeshed >= iterations:
            break
        previous = size
    return "Newton: too many iterations"


def start_point(problem: ZeroProblem, u: NDArray[np.float64], orientation: float = 1.0) -> Point:
    """Return the point nearest to `u` on the branch through it; the parameter grows along it if `orientation` > 0.

    Raises
    ------
    ValueError
        There is no branch near `u`.
    """
    weights = problem.metric(u)
    root = np.sqrt(np.maximum(weights, 1e-12))
    J = np.empty(0)
    for _ in range(6 + _REMESHED):
        F, J = problem.evaluate(u)
        fine = problem.accurate()
        step = np.linalg.lstsq(J / root, -F, rcond=None)[0] / root
        u = u + step
        if fine and np.abs(step / problem.scale()).max() < _ACCEPT:
            break
    null = np.linalg.svd(J / root)[2][-1] / root
    null *= np.sign(orientation * null[-1]) or 1.0
    null /= math.sqrt(float(weights @ null**2))
    point = correct(problem, u, null, weights, 7)
    if isinstance(point, str):
        raise ValueError(point)
    return point


def follow(
    problem: ZeroProblem,
    start: Point,
    control: StepControl,
    *,
    log: list[Failure],
    first_step: float | None = None,
) -> Iterator[Point | Event | str]:
    """Yield points of a branch from `start` on (itself not) and the events between them, at last why it ended.

    Parameters
    ----------
    problem : ZeroProblem
        What is continued.
    start : Point
        Where, and by its tangent in which direction; examined.
    control : StepControl
        Steps.
    log : list of Failure
        Takes each rejected step.
    first_step : float, optional
        Instead of `control.initial`.
    """
    h = min(first_step or control.initial, control.largest)
    point, before, earlier = start, None, None
    held = False
    while True:
        step = _attempt(problem, before, point, h, control)
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
                h, held = 0.5 * (point.arc - before.arc), False
                log.append(Failure(before.parameter, 2.0 * h, doubt))
                point, before, earlier = before, earlier, None
                continue
            yield point
        yield from step.events
        # the next step may tell that something was passed over, so one without events is not yet final
        held = not step.events
        if not held:
            yield step.point
        earlier, before, point = before, point, step.point
        h = min(h * step.growth, control.largest)


@dataclass(frozen=True, eq=False)
class _Step:
    """A step that can be taken: where it ends, what lies in it, by how much the next may be longer."""

    point: Point
    events: list[Event]
    growth: float


def _attempt(problem: ZeroProblem, before: Point | None, point: Point, h: float, control: StepControl) -> _Step | str:
    """Return the step of length `h` from `point`, or why it is not to be taken."""
    problem.depart(point)
    guess = _predict(point, before, h)
    new = correct(problem, guess, point.tangent, point.weights, control.iterations)
    if isinstance(new, str) and problem.recover(point):
        new = correct(problem, guess, point.tangent, point.weights, control.iterations)
    if isinstance(new, str):
        return new
    new.frame = point.frame
    new.arc = point.arc + _distance(point, new)
    moved, angle = math.sqrt(float(point.weights @ (new.u - guess) ** 2)), _angle(point, new)
    if (misstep := _misstep(point, new, moved, angle, control)) is not None:
        return misstep
    new.examined = problem.examine(new, point)
    doubt = new.examined.fault or _returns(before, point, new)
    if doubt is not None:
        return doubt
    events = events_between(problem, point, new)
    if isinstance(events, str):
        return events
    if h > _CROWDED and problem.crowded([event.name for event in events]):
        return "events: more than one bifurcation within the step"
    growth = min(2.0, max(0.3, (control.deviation / max(moved, 1e-12)) ** 0.25))
    if new.iterations > 3:
        growth = min(growth, 1.2 if new.iterations == 4 else 0.7)
    return _Step(new, events, min(growth, 0.8) if angle > 0.5 * control.angle else growth)


def _predict(point: Point, before: Point | None, h: float) -> NDArray[np.float64]:
    """Return the point a step on, by the cubic through the last two points and their tangents."""
    apart = before is None or before.u.size != point.u.size or before.frame is not point.frame
    if before is None or apart or point.arc <= before.arc:
        return point.u + h * point.tangent
    length = point.arc - before.arc
    if h > 3.0 * length:
        bend = (point.tangent - before.tangent) / length
        return point.u + h * point.tangent + 0.5 * h * h * bend
    return _hermite(before, point, length, 1.0 + h / length)


def _distance(a: Point, b: Point) -> float:
    return math.sqrt(float(a.weights @ (b.u - a.u) ** 2))


def _angle(a: Point, b: Point) -> float:
    cosine = float(a.weights @ (a.tangent * b.tangent)) / math.sqrt(float(a.weights @ b.tangent**2))
    return math.acos(min(1.0, max(-1.0, cosine)))


def _misstep(point: Point, new: Point, moved: float, angle: float, control: StepControl) -> str | None:
    length = new.arc - point.arc
    if angle > control.angle:
        return "angle: the branch turns too sharply for the step"
    if moved > 15.0 * control.deviation or moved > 0.5 * length:
        return "deviation: the corrected point lies too far from the predicted one"
    if _turns_twice(float(point.tangent[-1]), float(new.tangent[-1]), float(new.u[-1] - point.u[-1]) / length):
        return "folds: the parameter turns twice within the step"
    return None


def _turns_twice(a: float, b: float, chord: float) -> bool:
    """Whether the cubic with slopes a and b at a step's ends and `chord` between them has two turning points inside."""
    if a * b <= 0.0 or max(abs(a), abs(b), abs(chord)) < RESTS:
        return False
    side = math.copysign(1.0, a)
    a, b, chord = a * side, b * side, chord * side
    bottom = a + b - 2.0 * chord
    if bottom <= 0.0:
        return False
    s = (2.0 * a + b - 3.0 * chord) / (3.0 * bottom)
    return 0.0 < s < 1.0 and a - 3.0 * bottom * s * s < 0.0


def _returns(before: Point | None, a: Point, b: Point) -> str | None:
    """Return why the step from `a` to `b` may hold two zeros of a monitor function, of one sign at its ends, if it may.

    The parabola through both and a third point, on the other side of `a`, tells, its curvature taken larger than it is.
    """
    if before is None or before.arc == a.arc or abs(b.arc - a.arc) < _CROWDED:
        return None
    back, ahead = abs(a.arc - before.arc), abs(b.arc - a.arc)
    other, here = before.examined.monitors, a.examined.monitors
    for name, value in b.examined.monitors.items():
        if name not in here or name not in other:
            continue
        start, change = here[name], value - here[name]
        dip = _BENT * (change / ahead - (start - other[name]) / back) / (ahead + back) * ahead * ahead
        if start < 0.0:
            start, change, dip = -start, -change, -dip
        # start + change s - dip s (1 - s) has its least value within the step
        if (
            0.0 < start > -change
            and abs(change) < dip < math.inf
            and start + 0.5 * change < 0.25 * (dip + change * change / dip)
        ):
            return f"events: {name} may vanish twice within the step"
    return None


def events_between(problem: ZeroProblem, a: Point, b: Point) -> list[Event] | str:
    """Return the zeros of monitor functions between two examined points, or why the step is not to be taken."""
    changed = {}
    before = a.examined.monitors
    for name, value in b.examined.monitors.items():
        old = before.get(name, math.nan)
        if ((old < 0.0) != (value < 0.0) or value == 0.0) and old != 0.0 and math.isfinite(old + value):
            changed[name] = (old, value)
    if not changed:
        return []
    events: list[Event] = []
    # next to a singular point the tangent is not determined, nor what is read off it
    for name in sorted(problem.leading(list(changed)), key=lambda name: name not in problem.singular):
        event = locate(problem, name, a, b, *changed[name])
        if event is not None and abs(event.value) <= _JUMP * max(abs(value) for value in changed[name]):
            events.append(event)
        elif b.arc - a.arc > _CROWDED and not any(event.name in problem.singular for event in events):
            return f"location: no zero of {name} between the step's ends"
    kept = problem.sort_out(sorted(events, key=lambda event: event.point.arc))
    if isinstance(kept, str):
        return kept
    overlooked = _overlooked(kept, a, b, set(changed)) if b.arc - a.arc > _CROWDED else None
    return kept if overlooked is None else f"events: {overlooked} vanishes more than once within the step"


def _overlooked(events: list[Event], a: Point, b: Point, changed: set[Any]) -> Any | None:
    """Return a monitor function whose sign at one of the events is not what its located zeros make it."""
    places = {event.name: event.point.arc for event in events}
    for event in events:
        for name, value in event.point.examined.monitors.items():
            start = a.examined.monitors.get(name, math.nan)
            end = b.examined.monitors.get(name, math.nan)
            if math.isnan(start) or math.isnan(end) or (name in changed and name not in places) or name == event.name:
                continue
            expected = start if event.point.arc < places.get(name, math.inf) else end
            size = max((abs(x) for x in (start, end) if math.isfinite(x)), default=0.0)
            if (value < 0.0) != (expected < 0.0) and abs(value) > _ZERO * size:
                return name
    return None


def locate(problem: ZeroProblem, name: Any, a: Point, b: Point, fa: float, fb: float) -> Event | None:
    """Return the zero of a monitor function between two points, by Newton in the branch and interpolation along it.

    Each iterate is one Newton step of the equations bordered by the plane normal to the branch, at the place along the
    step where the interpolated monitor function vanishes, kept within the bracket. The branch's departure from the
    cubic through the step's ends is learnt on the way. Next to the zero of a `singular` monitor function, where Newton
    would run off along another branch, its steps leave that direction out.
    """
    from saltus.flow._linear_kernels import bordered

    length = b.arc - a.arc
    known = [(0.0, fa), (1.0, fb)]
    low, high, f_low = 0.0, 1.0, fa
    s = fa / (fa - fb)
    bend, near = np.zeros_like(a.u), False
    scale = problem.scale()
    floor = problem.noise.get(name, _EXACT) * max(abs(fa), abs(fb))
    previous = math.inf
    for _ in range(60):
        base, tangent = _hermite(a, b, length, s), _hermite_slope(a, b, length, s)
        tangent /= math.sqrt(float(a.weights @ tangent**2))
        shape = (s * (1.0 - s)) ** 2
        u = base + shape * bend
        row = a.weights * tangent
        F, J = problem.evaluate(u)
        steps, sign, log, size, residual = bordered(J, F, row, u, u, scale)
        step = steps[:, 0]
        if near:
            step = _without_kernel(J, F, row, scale)
            size = float(np.abs(step / scale).max())
        if residual <= 1e-13:
            step, size = np.zeros_like(step), 0.0
        if sign == 0.0 and name in problem.singular:  # met exactly
            point = Point(u, J, tangent, a.weights, sign, log, residual, 1, a.arc + s * length)
            point.examined = problem.examine(point, None)
            return Event(name, point, 0.0)
        if sign == 0.0 or not size < 1e3:
            return None
        bend = bend + step / max(shape, 1e-2 if name in problem.singular else 1e-12)
        if not problem.accurate():
            continue
        direction = steps[:, 1] / math.sqrt(float(a.weights @ steps[:, 1] ** 2))
        point = Point(u + step, J, direction, a.weights, sign, log, residual, 1, a.arc + s * length)
        f = problem.monitor(name, point)
        if not math.isfinite(f):
            return None
        # badly conditioned equations leave steps that do not shrink further
        settled = size < _SETTLED or (size < _STALLED and size > 0.8 * previous)
        previous = size
        if settled and (abs(f) <= floor or high - low < 1e-12):
            before = point.u.copy()
            point.examined = problem.examine(point, None)
            if np.all(np.abs(before - point.u) <= 1e-12 * scale):
                return Event(name, point, f)
            low, high, known = max(0.0, s - 1e-3), min(1.0, s + 1e-3), [(0.0, fa), (1.0, fb)]
            continue
        if not settled and abs(f) < 1e3 * size:
            continue
        if not near and name in problem.singular and abs(f) < 1e-3 * max(abs(fa), abs(fb)):
            near, known = True, [(0.0, fa), (1.0, fb)]
            low, high, f_low = max(0.0, s - 0.1), min(1.0, s + 0.1), fa
            continue
        if (f < 0.0) == (f_low < 0.0):
            low, f_low = s, f
        else:
            high = s
        known = [*known[-3:], (s, f)]
        s, previous = _zero(known, low, high), math.inf
    return None


def _without_kernel(
    J: NDArray[np.float64], F: NDArray[np.float64], row: NDArray[np.float64], scale: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the Newton step in the plane without its part along the direction that the equations hardly determine."""
    left, values, right = np.linalg.svd(np.vstack([J, row]) * scale)
    inverse = np.append(1.0 / values[:-1], 0.0)
    return np.asarray(scale * (right.T @ (inverse * (left.T @ np.append(-F, 0.0)))))


def _zero(known: list[tuple[float, float]], low: float, high: float) -> float:
    """Return the zero of the inverse interpolation through the latest values, or the bracket's middle."""
    for count in (3, 2):
        (*others, last) = known[-count:]
        values = [f for _, f in known[-count:]]
        if len(values) < count or len(set(values)) < count:
            continue
        guess = 0.0
        for i, (s, f) in enumerate([*others, last]):
            weight = 1.0
            for j, g in enumerate(values):
                if j != i:
                    weight *= g / (g - f)
            guess += weight * s
        if low < guess < high:
            return guess
    return 0.5 * (low + high)


def _hermite(a: Point, b: Point, length: float, s: float) -> NDArray[np.float64]:
    """Return the cubic through both points with their tangents, at a fraction of the step."""
    end, off = s * s * (3.0 - 2.0 * s), s * (1.0 - s) * length
    return (1.0 - end) * a.u + end * b.u + ((1.0 - s) * off) * a.tangent - (s * off) * b.tangent


def _hermite_slope(a: Point, b: Point, length: float, s: float) -> NDArray[np.float64]:
    """Return the derivative of that cubic by the fraction."""
    left, right = (1.0 - s) * (1.0 - 3.0 * s) * length, s * (3.0 * s - 2.0) * length
    return (6.0 * s * (1.0 - s)) * (b.u - a.u) + left * a.tangent + right * b.tangent
