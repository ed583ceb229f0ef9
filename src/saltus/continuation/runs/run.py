"""One call of a continuation, of any kind of solution: the loop over its steps, places, bounds, both directions."""

from __future__ import annotations

import math
import warnings
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping
from dataclasses import asdict, dataclass, replace
from functools import singledispatch
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from saltus import checks
from saltus.continuation.core.arclength import follow
from saltus.continuation.core.monitor import Monitor
from saltus.continuation.core.zero_problem import SAME, Event, start_point
from saltus.continuation.results.special_points import SpecialPoint
from saltus.continuation.runs.options import ROUNDING, Plane, checked_interval
from saltus.continuation.runs.two_sided import BothSides, Found, OneSide, join, traced, turned
from saltus.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.core.arclength import Failure, StepControl
    from saltus.continuation.core.interest import Interest
    from saltus.continuation.core.zero_problem import Examined, Point
    from saltus.progress import Reporter

__all__ = ["Asked", "Going", "OneParameterRun", "TwoParameterRun", "Wanted", "branch_run", "locus_run"]

_NOTHING = 1e-14  # parameter, over its interval, up to which it reads 0
_MOVED = 1e-3  # change, over the unknowns' sizes, by which the first point of a locus may differ from the start
_REGULAR = 1e-11  # least singular value of the extended equations, over the largest, of a regular start

Going = tuple[Any, "Point", float]  # equations, point and first step with which a branch goes on
Wanted = tuple[str, str, float | None]  # a user's event: name, kind, value; None where an extremum is asked for


@dataclass(frozen=True)
class Asked:
    """What is asked of a curve of any kind.

    Attributes
    ----------
    control : StepControl
        Sizes of steps and their limits.
    directions : {"both", "up", "down"}
        Which way the parameter goes at the start.
    stops : set of str
        Types of special points that end the curve.
    reporter : Reporter
        Who is told of each point.
    """

    control: StepControl
    directions: str
    stops: set[str]
    reporter: Reporter


class _Run(ABC):
    """The loop over the steps of a curve, in both directions, and what it asks of each kind of curve."""

    odd: ClassVar[Collection[Monitor]]  # monitor functions that change sign with the tangent's direction
    curve: ClassVar[str]  # what messages call it

    def __init__(self, asked: Asked) -> None:
        self.asked, self.control, self.stops = asked, asked.control, asked.stops
        self.log: list[Failure] = []

    @abstractmethod
    def begin(self) -> tuple[Any, Point]:
        """Return the equations and the first point, its tangent towards growing parameter."""

    @abstractmethod
    def place(self, point: Point) -> str:
        """Return the parameters of a point as text."""

    @abstractmethod
    def told(self, point: Point) -> str:
        """Return the parameters of a point as progress shows them."""

    @abstractmethod
    def starts_outwards(self, point: Point) -> bool:
        """Return whether a direction leaves its bounds at once."""

    @abstractmethod
    def event(self, half: OneSide, piece: Any, event: Event) -> str | Going | None:
        """Keep a special point; return why the curve ends there, or what it goes on with; None where it passes."""

    @abstractmethod
    def closes(self, half: OneSide, piece: Any, last: Point, point: Point) -> bool:
        """Return whether a step passes the curve's start; the start is appended then."""

    @abstractmethod
    def rejected(self) -> tuple[str, ...]:
        """Return the rejected steps, with their reasons."""

    def joined(self) -> BothSides:
        """Return the curve in the wanted directions."""
        start = self.begin()
        with self.asked.reporter:
            halves = traced(start, self.begin, self.trace, self.asked.directions)
        return join(start, halves, self.curve)

    def trace(self, start: tuple[Any, Point], sign: float) -> OneSide:
        """Return one direction of the curve, followed to its end."""
        piece, step = start[0], None
        point = turned(self.ready(*start), sign, self.odd)
        half = OneSide(start, point)
        if self.starts_outwards(point):
            half.stopped = f"{self.place(point)}: bound reached"
        try:
            while not half.stopped:
                ended = self._followed(half, piece, point, step)
                if isinstance(ended, str):
                    half.stopped = ended
                else:
                    piece, point, step = ended
        except KeyboardInterrupt:
            half.stopped, half.interrupted = "interrupted", True
        return half

    def _followed(self, half: OneSide, piece: Any, point: Point, step: float | None) -> str | Going:
        """Follow the solutions of one set of equations; return why the curve ended, or what it goes on with."""
        last = point
        end: str | Going | None
        for item in follow(piece, point, self.control, log=self.log, first_step=step, ahead=self.ahead(piece)):
            if isinstance(item, str):
                return self.stuck(half, piece, last, item)
            if isinstance(item, Event):
                end = self.event(half, piece, item)
            elif (passed := self.passed(piece, item)) is not None:
                end = f"{self.place(last)}: {passed}"
            elif self.closes(half, piece, last, item):
                half.closed, end = True, f"the {self.curve} is closed"
            else:
                end = self.keep(half, piece, last, item)
                end = self.arrived(half, piece, item) if end is None else end
                last = item
            if end is not None:
                return end
        raise AssertionError("follow ends with a reason")

    def ready(self, piece: Any, origin: Point) -> Point:
        """Return the start, ready to be followed."""
        return origin

    def ahead(self, piece: Any) -> Callable[[Point, Point, float], tuple[list[Point], float]] | None:
        """Return what takes many steps at once, as `follow` asks for it; None where nothing does."""
        return None

    def stuck(self, half: OneSide, piece: Any, last: Point, reason: str) -> str | Going:
        """Return why the curve ends behind a point from which no step succeeds."""
        return f"{self.place(last)}: {reason}"

    def passed(self, piece: Any, point: Point) -> str | None:
        """Return why the curve ended before a point; None where it did not."""
        return None

    def keep(self, half: OneSide, piece: Any, last: Point, point: Point) -> str | None:
        """Add the point behind `last` to a direction; return the reason why the curve ends with it, or None."""
        half.points.append((piece, point))
        if self.asked.reporter.report is not None:
            self.asked.reporter.step(1, self.told(point))
        most = self.control.max_points
        return f"{self.place(point)}: {most} points" if len(half.points) >= most else None

    def arrived(self, half: OneSide, piece: Any, point: Point) -> str | Going | None:
        """Return why the curve ends at a point that was kept, or what it goes on with; None where it just goes on."""
        return None

    def ends(self, half: OneSide, piece: Any, point: Point, reason: str) -> str:
        """End a direction with a point; return the reason with its place."""
        half.points.append((piece, point))
        return f"{self.place(point)}: {reason}"

    def options(self, bounds: Any, events: Mapping[str, Any] | None = None) -> dict[str, Any]:
        """Return the arguments of the continuation, as a curve holds them."""
        own = {} if events is None else {"events": {name: _plain(value) for name, value in events.items()}}
        kept = {"bounds": bounds, "steps": asdict(self.control), "directions": self.asked.directions}
        return kept | own | {"stop_at": sorted(self.stops)}

    def _told_rejected(self, name: str, unit: float) -> tuple[str, ...]:
        """Return the rejected steps by the parameter of that name and unit, the last one of the unknowns."""
        return tuple(
            f"{name} = {failure.parameter * unit:.9g}, step {failure.step:.3g}: {failure.reason}"
            for failure in self.log
        )


@singledispatch
def branch_run(start: object, parameter: str) -> type[OneParameterRun]:
    """Return how the branch through a solution is followed along a parameter; each kind registers its own."""
    raise InputError("start", start, "a solution, as a PeriodicOrbit, an Equilibrium or a MapOrbit")


@singledispatch
def locus_run(solution: object) -> type[TwoParameterRun]:
    """Return how a locus through a critical solution is followed; each kind of solution registers its own."""
    checks.instance("start", solution, SpecialPoint)
    raise AssertionError("a special point has a solution")


class OneParameterRun(_Run):
    """One call that traces a branch.

    Parameters
    ----------
    solution : Solution
        Where the branch starts.
    name : str
        The parameter that varies.
    interest : Interest
        Its bounds and unit, users' events.
    asked : Asked
        Steps, directions, types of special points that end the branch, progress.
    """

    curve = "branch"
    types: ClassVar[tuple[str, ...]]  # types of special points that `stop_at` may name

    def __init__(self, solution: Any, name: str, interest: Interest, asked: Asked) -> None:
        super().__init__(asked)
        self.solution = solution
        self.name, self.interest, self.scale = name, interest, interest.scale
        self._unmet: set[str] = set()  # users' events that have been told of

    @classmethod
    def interval(
        cls, start: Any, name: str, bounds: tuple[float, float], directions: str
    ) -> tuple[float, float, float]:
        """Return the interval of the parameter and its value at the start; all arguments are checked."""
        low, high = checked_interval(start.system, start.parameters, name, bounds, directions)
        return low, high, start.parameters[name]

    @classmethod
    @abstractmethod
    def wanted(cls, start: Any, name: str, events: Mapping[str, float | str]) -> tuple[Wanted, ...]:
        """Return name, kind and value of each user's event, checked."""

    @abstractmethod
    def branch(self, options: dict[str, Any]) -> Any:
        """Return the branch; `options` are the arguments of the continuation."""

    @abstractmethod
    def special(self, half: OneSide, piece: Any, event: Event) -> str | Going | None:
        """Keep a special point that is neither a bound nor a user's event; see `event`."""

    @abstractmethod
    def found(self, name: str, piece: Any, event: Event, half: OneSide) -> Found:
        """Return a special point of one direction, behind the points found so far."""

    def event(self, half: OneSide, piece: Any, event: Event) -> str | Going | None:
        """See `_Run.event`."""
        if event.name.kind in ("low", "high"):
            return self.at_bound(half, piece, event.point, event.name.kind)
        if event.name.kind not in ("event", "EX"):
            return self.special(half, piece, event)
        name, of, stop = self._wanted(event.name)
        half.specials.append(replace(self.found(name, piece, event, half), of=of))
        return self.end_at(half, piece, event.point, stop)

    def keep(self, half: OneSide, piece: Any, last: Point, point: Point) -> str | None:
        """See `_Run.keep`; warn where a user's event asks for what is no longer a number."""
        for name, value in point.examined.monitors.items():
            if name.kind in ("event", "EX") and math.isnan(value):
                wanted = self.interest.events[name.segment][0]
                if wanted not in self._unmet and not wanted.startswith("velocity("):
                    self._unmet.add(wanted)
                    told = f"saltus: {wanted!r} is no number at {self.place(point)}: its event is not met there"
                    warnings.warn(told, RuntimeWarning, stacklevel=2)
        return super().keep(half, piece, last, point)

    def start_value(self, parameters: Mapping[str, float]) -> float:
        """Return the parameter at the start, in its unit; a bound that is missed by rounding is met."""
        return self.met(parameters[self.name] / self.scale)

    def met(self, value: float) -> float:
        """Return the bound, in the parameter's unit, that a value meets but for rounding, or the value itself."""
        for bound in (self.interest.low, self.interest.high):
            value = bound if abs(value - bound) < ROUNDING else value
        return value

    def irregular(self, what: str, value: float, error: Exception, advice: str = "") -> InputError:
        """Return the error of a start at which no one branch goes on; `what` names the start, at that parameter."""
        beside = f"at a branch point start beside it, at another {self.name}; switch_branch goes to the other branch"
        hint = f"the equations have no single branch there: {error}; {advice or beside}"
        return InputError(f"{what} at {self.name}", value, f"a regular {what}", hint)

    def place(self, point: Point) -> str:
        """Return the parameter of a point as text; 0 where it is rounding of the interval."""
        return f"{self.name} = {self.value(point):.9g}"

    def value(self, point: Point) -> float:
        """Return the parameter of a point; 0 where it is rounding of the interval."""
        return point.parameter * self.scale if abs(point.parameter) > _NOTHING else 0.0

    def told(self, point: Point) -> str:
        """See `_Run.told`."""
        return f"{self.name} = {point.parameter * self.scale:.6g}"

    def rejected(self) -> tuple[str, ...]:
        """See `_Run.rejected`."""
        return self._told_rejected(self.name, self.scale)

    def starts_outwards(self, point: Point) -> bool:
        """See `_Run.starts_outwards`."""
        outwards = math.copysign(1.0, float(point.tangent[-1]))
        return outwards * (point.parameter - (self.interest.high if outwards > 0.0 else self.interest.low)) > -ROUNDING

    def ready(self, piece: Any, origin: Point) -> Point:
        """See `_Run.ready`: a start that misses a bound by rounding is on it, and no step away from it reaches it."""
        ends = {Monitor("low"): self.interest.low, Monitor("high"): self.interest.high}
        met = {name: 0.0 for name, bound in ends.items() if abs(origin.parameter - bound) < ROUNDING}
        if met:
            origin.examined = replace(origin.examined, monitors={**origin.examined.monitors, **met})
        return origin

    def at_bound(self, half: OneSide, piece: Any, point: Point, kind: str) -> str:
        """End a branch at the ``low`` or ``high`` bound."""
        point.u[-1] = self.interest.low if kind == "low" else self.interest.high
        return self.ends(half, piece, point, "bound reached")

    def _wanted(self, name: Monitor) -> tuple[str, str, str]:
        """Return type and quantity of a special point that a user asks for, and its name in `stop_at`."""
        key, kind, _ = self.interest.events[name.segment]
        if name.kind == "event":
            return key, "", key
        of = kind if kind.startswith(("min_", "max_")) else key
        return "EX", of, key if key in self.stops else "EX"

    def end_at(self, half: OneSide, piece: Any, point: Point, name: str) -> str | None:
        """End a branch at a special point where `stop_at` has its type."""
        return self.ends(half, piece, point, name) if name in self.stops else None

    def fields(self, joined: BothSides, options: dict[str, Any]) -> dict[str, Any]:
        """Return the fields that all branches have in common."""
        return {
            "system": self.solution.system,
            "parameter": self.name,
            "parameters": dict(self.solution.parameters),
            "values": np.array([self.scale * point.parameter for _, point in joined.rows]),
            "special_points": joined.special_points((self.name,)),
            "rejected": self.rejected(),
            "options": options,
            **joined.ends(),
        }


def _plain(value: Any) -> float | str:
    """Return what a user's event asks for as a curve holds it."""
    return str(value) if isinstance(value, str) else float(value)


class TwoParameterRun(_Run):
    """One call that traces a locus.

    Parameters
    ----------
    start : SpecialPoint or None
        Where the locus starts; None where that is a solution with a type.
    solution : Solution
        The solution there.
    kind : str
        Type of the locus.
    plane : Plane
        The two parameters and their intervals.
    asked : Asked
        Steps, directions, types of special points that end the locus, progress.
    """

    curve = "locus"
    loci: ClassVar[Mapping[str, str]]  # type of the locus that starts at a special point of each type, if none is named
    types: ClassVar[tuple[str, ...]]  # types of loci
    points: ClassVar[tuple[str, ...]]  # types of special points that `stop_at` may name
    measured: ClassVar[tuple[str, ...]] = ("coefficient",)  # data of its points that a locus holds
    branch: Any  # the equations, known when the first point is

    def __init__(self, start: SpecialPoint[Any] | None, solution: Any, kind: str, plane: Plane, asked: Asked) -> None:
        super().__init__(asked)
        self.start, self.solution, self.kind, self.plane = start, solution, kind, plane
        self.names, self.intervals = plane.names, plane.intervals
        self.scales = np.array([high - low for low, high in self.intervals])
        first, second = ((low / unit, high / unit) for (low, high), unit in
                         zip(self.intervals, self.scales.tolist(), strict=True))  # fmt: skip
        self.bounds = (first, second)

    @classmethod
    def check(cls, solution: Any) -> None:
        """Raise `InputError` where no locus starts at a solution, whatever its type."""
        return

    @abstractmethod
    def locus(self) -> Any:
        """Return the locus."""

    @abstractmethod
    def extended(self) -> NDArray[np.float64]:
        """Make the equations, `branch`; return the unknowns of the start."""

    @abstractmethod
    def special(self, half: OneSide, event: Event) -> str | None:
        """Keep a special point that is no bound; return the reason why the locus ends there, or None."""

    @abstractmethod
    def at_start(self, origin: Point) -> Found | None:
        """Return the start as a special point of the locus, if it is one."""

    @abstractmethod
    def moved(self, u: NDArray[np.float64], z: NDArray[np.float64]) -> float:
        """Return how far the first point is from the start, over the unknowns' sizes."""

    def examined(self, point: Point) -> Examined:
        """Return what the first point is."""
        return self.branch.examine(point, None)  # type: ignore[no-any-return]

    def why_irregular(self) -> str:
        """Return why a start has no regular locus."""
        return "the extended equations have more than one solution direction there"

    def begin(self) -> tuple[Any, Point]:
        """Return the equations and the first point, its tangent towards growing values of the user's second one."""
        z = self.extended()
        matrix = self.branch.evaluate(z)[1] * self.branch.scale()
        terms = np.abs(matrix).max(axis=1, keepdims=True)
        found = np.linalg.svd(matrix / np.where(terms > 0.0, terms, 1.0), compute_uv=False)
        if not found[-1] > _REGULAR * found[0]:
            raise self.irregular(self.why_irregular())
        try:
            point = start_point(self.branch, z)
        except (ValueError, np.linalg.LinAlgError) as error:
            raise self.irregular(str(error)) from None
        if (moved := self.moved(point.u, z)) > _MOVED:
            hint = "the nearest one lies that far from it"
            raise InputError("start", f"{moved:.2g} away", f"a located {self.kind}", hint)
        point.examined = self.examined(point)
        towards = self.names.index(self.plane.order[1])
        return self.branch, turned(point, float(point.tangent[towards - 2]), self.odd)

    def joined(self) -> BothSides:
        """See `_Run.joined`; the start is among the special points, unless it was found again."""
        joined = super().joined()
        own = self.at_start(joined.rows[joined.offset][1])
        if own is not None and all(found.name != own.name or abs(arc) > SAME for found, _, arc in joined.specials):
            joined.specials = sorted([*joined.specials, (own, float(joined.offset), 0.0)], key=lambda item: item[2])
        return joined

    def event(self, half: OneSide, piece: Any, event: Event) -> str | None:
        """See `_Run.event`."""
        kind, at = event.name.kind, event.name.segment
        if kind in ("low", "high"):
            event.point.u[at - 2] = self.bounds[at][kind == "high"]
            return self.ends(half, piece, event.point, "bound reached")
        end = self.special(half, event)
        return None if end is None else self.ends(half, piece, event.point, end)

    def start_values(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the parameters at the start, in their units; bounds that are missed by rounding are met."""
        values = values / self.scales
        for i, interval in enumerate(self.bounds):
            for bound in interval:
                values[i] = bound if abs(values[i] - bound) < ROUNDING else values[i]
        return values

    def place(self, point: Point) -> str:
        """See `_Run.place`."""
        values = point.u[-2:] * self.scales
        return ", ".join(f"{name} = {value:.9g}" for name, value in zip(self.names, values, strict=True))

    def told(self, point: Point) -> str:
        """See `_Run.told`."""
        pairs = zip(self.names, point.u[-2:] * self.scales, strict=True)
        return ", ".join(f"{name} = {value:.6g}" for name, value in pairs)

    def rejected(self) -> tuple[str, ...]:
        """See `_Run.rejected`."""
        return self._told_rejected(self.names[1], float(self.scales[1]))

    def irregular(self, reason: str) -> InputError:
        """Return the error of a start at which the parameters have no regular locus."""
        wanted = f"two parameters in which the {self.kind} has a regular locus"
        return InputError("parameters", self.names, wanted, reason)

    def starts_outwards(self, point: Point) -> bool:
        """See `_Run.starts_outwards`."""
        for i, (low, high) in enumerate(self.bounds):
            along = float(point.tangent[i - 2])
            beyond = math.copysign(1.0, along) * (float(point.u[i - 2]) - (high if along > 0.0 else low))
            if beyond > -ROUNDING and abs(along) > ROUNDING:
                return True
        return False

    def ready(self, piece: Any, origin: Point) -> Point:
        """See `_Run.ready`."""
        return replace(origin, u=origin.u.copy())

    def fields(self, joined: BothSides) -> dict[str, Any]:
        """Return the fields that all loci have in common."""
        order = self.plane.order
        columns = [self.names.index(name) for name in order]
        bounds = {name: list(interval) for name, interval in zip(self.names, self.intervals, strict=True)}
        return {
            "system": self.solution.system,
            "parameters": dict(self.solution.parameters),
            "type": self.kind,
            "names": order,
            "values": np.array([point.u[-2:] * self.scales for _, point in joined.rows])[:, columns],
            "special_points": joined.special_points(order, self.kind),
            "rejected": self.rejected(),
            "options": self.options(bounds),
            **joined.ends(),
            **{
                name: np.array([getattr(point.examined.data, name) for _, point in joined.rows])
                for name in self.measured
            },
        }
