"""One call of a continuation, of any kind of solution: the loop over its steps, places, bounds, both directions."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from saltus.continuation.core.arclength import follow
from saltus.continuation.core.monitor import Monitor
from saltus.continuation.core.zero_problem import Event
from saltus.continuation.runs.two_sided import BothSides, OneSide, join, traced, turned

if TYPE_CHECKING:
    from saltus.continuation.core.arclength import Failure, StepControl
    from saltus.continuation.core.zero_problem import Point
    from saltus.progress import Reporter

__all__ = ["Asked", "Going", "Run"]


Going = tuple[Any, "Point", float]  # equations, point and first step with which a branch goes on


@dataclass(frozen=True)
class Asked:
    """What is asked of a curve of any kind."""

    control: StepControl  # sizes of steps and their limits
    directions: str  # {"both", "up", "down"}: which way the parameter goes at the start
    stops: set[str]  # types of special points that end the curve
    reporter: Reporter  # who is told of each point
    # whether a branch ends at a fold: given the solution there, and the sign of the parameter's way at the start
    until: Callable[[Any, float], bool] | None = None


class Run(ABC):
    """The loop over the steps of a curve, in both directions, and what it asks of each kind of curve."""

    odd: ClassVar[Collection[Monitor]]  # monitor functions that change sign with the tangent's direction
    curve: ClassVar[str]  # what messages call it

    def __init__(self, asked: Asked) -> None:
        self.asked, self.control, self.stops = asked, asked.control, asked.stops
        self.log: list[Failure] = []
        self.last_row: tuple[Any, Point] | None = None  # equations and point with which the curve ends
        self.first_length: float | None = None  # length of the first step where it is not the usual one

    @abstractmethod
    def begin(self) -> tuple[Any, Point]:
        """Return the equations and the first point, its tangent towards growing parameter."""

    def again(self, piece: Any, point: Point) -> Callable[[], tuple[Any, Point]]:
        """Return what makes the equations and the first point once more, as `begin` has just made them."""
        return self.begin

    @abstractmethod
    def place(self, point: Point) -> str:
        """Return the parameters of a point as text."""

    @abstractmethod
    def told(self, point: Point) -> str:
        """Return the parameters of a point as progress shows them."""

    def last(self, piece: Any, point: Point) -> Callable[[], Any] | None:
        """Return what makes the solution at a point, for those who watch; None where nothing does."""
        return None

    @abstractmethod
    def starts_outwards(self, point: Point) -> bool:
        """Return whether a direction leaves its bounds at once."""

    def joined(self) -> BothSides:
        """Return the curve in the wanted directions."""
        start = self.begin()
        with self.asked.reporter:
            halves = traced(start, self.again(*start), self.trace, self.asked.directions)
        joined = join(start, halves, self.curve)
        self.last_row = joined.rows[-1]
        return joined

    def trace(self, start: tuple[Any, Point], sign: float) -> OneSide:
        """Return one direction of the curve, followed to its end."""
        piece, step = start[0], self.first_length
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

    @abstractmethod
    def event(self, half: OneSide, piece: Any, event: Event) -> str | Going | None:
        """Keep a special point; return why the curve ends there, or what it goes on with; None where it passes."""

    @abstractmethod
    def closes(self, half: OneSide, piece: Any, last: Point, point: Point) -> bool:
        """Return whether a step passes the curve's start; the start is appended then."""

    @abstractmethod
    def rejected(self) -> tuple[str, ...]:
        """Return the rejected steps, with their reasons."""

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
            self.asked.reporter.step(1, self.told(point), self.last(piece, point))
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


def _plain(value: Any) -> float | str:
    """Return what a user's event asks for as a curve holds it."""
    return str(value) if isinstance(value, str) else float(value)
