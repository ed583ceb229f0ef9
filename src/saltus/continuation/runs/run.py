"""What a call of a continuation does in the same way for orbits and equilibria: places, bounds, both directions."""

from __future__ import annotations

import math
import warnings
from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from saltus.continuation.core.monitor import Monitor
from saltus.continuation.core.zero_problem import SAME
from saltus.continuation.runs.options import ROUNDING
from saltus.continuation.runs.two_sided import BothSides, Found, OneSide, turned
from saltus.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.core.arclength import Failure, StepControl
    from saltus.continuation.core.interest import Interest
    from saltus.continuation.core.zero_problem import Point
    from saltus.progress import Reporter

__all__ = ["Going", "OneParameterRun", "TwoParameterRun"]

_NOTHING = 1e-14  # parameter, over its interval, up to which it reads 0

Going = tuple[Any, "Point", float]  # equations, point and first step with which a branch goes on


class _Run:
    """Steps, types of special points that end the curve, progress, and rejected steps."""

    odd: ClassVar[Collection[Monitor]]  # monitor functions that change sign with the tangent's direction

    def __init__(self, control: StepControl, stops: set[str], reporter: Reporter) -> None:
        self.control, self.stops, self.reporter = control, stops, reporter
        self.log: list[Failure] = []

    def place(self, point: Point) -> str:
        """Return the parameters of a point as text."""
        raise NotImplementedError

    def told(self, point: Point) -> str:
        """Return the parameters of a point as progress shows them."""
        raise NotImplementedError

    def keep(self, half: OneSide, piece: Any, point: Point) -> str | None:
        """Add a point to a direction; return the reason why the curve ends with it, or None."""
        half.points.append((piece, point))
        if self.reporter.report is not None:
            self.reporter.step(1, self.told(point))
        most = self.control.max_points
        return f"{self.place(point)}: {most} points" if len(half.points) >= most else None

    def options(self, bounds: Any, directions: str, events: Mapping[str, Any] | None = None) -> dict[str, Any]:
        """Return the arguments of the continuation, as a curve holds them."""
        own = {} if events is None else {"events": {name: _plain(value) for name, value in events.items()}}
        kept = {"bounds": bounds, "steps": asdict(self.control), "directions": directions}
        return kept | own | {"stop_at": sorted(self.stops)}


class OneParameterRun(_Run, ABC):
    """One call that traces a branch.

    Parameters
    ----------
    name : str
        The parameter that varies.
    interest : Interest
        Its bounds and unit, users' events.
    control, stops, reporter
        Steps, types of special points that end the branch, progress.
    """

    def __init__(
        self, name: str, interest: Interest, control: StepControl, stops: set[str], reporter: Reporter
    ) -> None:
        super().__init__(control, stops, reporter)
        self.name, self.interest, self.scale = name, interest, interest.scale
        self._unmet: set[str] = set()  # users' events that have been told of

    def keep(self, half: OneSide, piece: Any, point: Point) -> str | None:
        """See `_Run.keep`; warn where a user's event asks for what is no longer a number."""
        for name, value in point.examined.monitors.items():
            if name.kind in ("event", "EX") and math.isnan(value):
                asked = self.interest.events[name.segment][0]
                if asked not in self._unmet and not asked.startswith("velocity("):
                    self._unmet.add(asked)
                    told = f"saltus: {asked!r} is no number at {self.place(point)}: its event is not met there"
                    warnings.warn(told, RuntimeWarning, stacklevel=2)
        return super().keep(half, piece, point)

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
        """Return the rejected steps, with their reasons."""
        return tuple(
            f"{self.name} = {failure.parameter * self.scale:.9g}, step {failure.step:.3g}: {failure.reason}"
            for failure in self.log
        )

    def trace(self, start: tuple[Any, Point], sign: float) -> OneSide:
        """Return one direction of the branch, followed to its end."""
        half = OneSide()
        branch, origin = start
        point = turned(origin, sign, self.odd)
        outwards = math.copysign(1.0, float(point.tangent[-1]))
        if outwards * (point.parameter - (self.interest.high if outwards > 0.0 else self.interest.low)) > -ROUNDING:
            half.stopped = f"{self.place(point)}: bound reached"
            return half
        self._meet_bounds(point)
        first: float | None = None
        try:
            while True:
                ended = self.piece(half, branch, point, start, first)
                if isinstance(ended, str):
                    half.stopped = ended
                    return half
                branch, point, first = ended
        except KeyboardInterrupt:
            half.stopped, half.interrupted = "interrupted", True
            return half

    def _meet_bounds(self, point: Point) -> None:
        """Take a start that misses a bound by rounding as one on it: a step away from the bound does not reach it."""
        ends = {Monitor("low"): self.interest.low, Monitor("high"): self.interest.high}
        met = {name: 0.0 for name, bound in ends.items() if abs(point.parameter - bound) < ROUNDING}
        if met:
            point.examined = replace(point.examined, monitors={**point.examined.monitors, **met})

    @abstractmethod
    def piece(
        self, half: OneSide, branch: Any, point: Point, start: tuple[Any, Point], first: float | None
    ) -> str | Going:
        """Follow the solutions of one set of equations; return why the branch ended, or what it goes on with."""

    def at_bound(self, half: OneSide, branch: Any, point: Point, kind: str) -> str:
        """End a branch at the ``low`` or ``high`` bound."""
        point.u[-1] = self.interest.low if kind == "low" else self.interest.high
        half.points.append((branch, point))
        return f"{self.place(point)}: bound reached"

    def asked(self, name: Monitor) -> tuple[str, str, str]:
        """Return type and quantity of a special point that a user asks for, and its name in `stop_at`."""
        key, kind, _ = self.interest.events[name.segment]
        if name.kind == "event":
            return key, "", key
        of = kind if kind.startswith(("min_", "max_")) else key
        return "EX", of, key if key in self.stops else "EX"

    def end_at(self, half: OneSide, branch: Any, point: Point, name: str) -> str | None:
        """End a branch at a special point where `stop_at` has its type."""
        if name not in self.stops:
            return None
        half.points.append((branch, point))
        return f"{self.place(point)}: {name}"


def _plain(value: Any) -> float | str:
    """Return what a user's event asks for as a curve holds it."""
    return str(value) if isinstance(value, str) else float(value)


class TwoParameterRun(_Run, ABC):
    """One call that traces a locus.

    Parameters
    ----------
    names : tuple of str
        The two parameters in the system's order.
    intervals : tuple of (float, float)
        Their intervals.
    kind : str
        Type of the locus.
    control, stops, reporter
        Steps, types of special points that end the locus, progress.
    """

    branch: Any  # the equations, known when the first point is

    def __init__(
        self,
        names: tuple[str, str],
        intervals: tuple[tuple[float, float], tuple[float, float]],
        kind: str,
        control: StepControl,
        stops: set[str],
        reporter: Reporter,
    ) -> None:
        super().__init__(control, stops, reporter)
        self.names, self.kind, self.intervals = names, kind, intervals
        self.scales = np.array([high - low for low, high in intervals])
        first, second = ((low / unit, high / unit) for (low, high), unit in
                         zip(intervals, self.scales.tolist(), strict=True))  # fmt: skip
        self.bounds = (first, second)

    def start_values(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the parameters at the start, in their units; bounds that are missed by rounding are met."""
        values = values / self.scales
        for i, interval in enumerate(self.bounds):
            for bound in interval:
                values[i] = bound if abs(values[i] - bound) < ROUNDING else values[i]
        return values

    def place(self, point: Point) -> str:
        """Return the parameters of a point as text."""
        values = point.u[-2:] * self.scales
        return ", ".join(f"{name} = {value:.9g}" for name, value in zip(self.names, values, strict=True))

    def told(self, point: Point) -> str:
        """See `_Run.told`."""
        pairs = zip(self.names, point.u[-2:] * self.scales, strict=True)
        return ", ".join(f"{name} = {value:.6g}" for name, value in pairs)

    def irregular(self, reason: str) -> InputError:
        """Return the error of a start at which the parameters have no regular locus."""
        wanted = f"two parameters in which the {self.kind} has a regular locus"
        return InputError("parameters", self.names, wanted, reason)

    def trace(self, origin: Point, sign: float) -> OneSide:
        """Return one direction of the locus, followed to its end."""
        half = OneSide()
        point = turned(self.ready(origin), sign, self.odd)
        for i, (low, high) in enumerate(self.bounds):
            along = float(point.tangent[i - 2])
            beyond = math.copysign(1.0, along) * (float(point.u[i - 2]) - (high if along > 0.0 else low))
            if beyond > -ROUNDING and abs(along) > ROUNDING:
                half.stopped = f"{self.place(point)}: bound reached"
                return half
        try:
            half.stopped = self.followed(half, point, origin)
        except KeyboardInterrupt:
            half.stopped, half.interrupted = "interrupted", True
        return half

    def ready(self, origin: Point) -> Point:
        """Return the start, ready to be followed."""
        return replace(origin, u=origin.u.copy())

    @abstractmethod
    def followed(self, half: OneSide, point: Point, origin: Point) -> str:
        """Follow one direction from a point; return why it ended."""

    def bound_met(self, point: Point, at: int, kind: str) -> str:
        """Put a point on the bound of a parameter; return why the locus ends there."""
        point.u[at - 2] = self.bounds[at][kind == "high"]
        return "bound reached"

    def with_start(self, joined: BothSides, own: Found | None) -> BothSides:
        """Return the joined directions with the start among the special points, unless it was found again."""
        if own is not None and all(found.name != own.name or abs(arc) > SAME for found, _, arc in joined.specials):
            joined.specials = sorted([*joined.specials, (own, float(joined.offset), 0.0)], key=lambda item: item[2])
        return joined

    def fields(self, joined: BothSides, order: tuple[str, ...], options: dict[str, Any]) -> dict[str, Any]:
        """Return the fields that a locus of orbits and one of equilibria have in common, parameters in `order`."""
        columns = [self.names.index(name) for name in order]
        return {
            "type": self.kind,
            "names": (order[0], order[1]),
            "values": np.array([point.u[-2:] * self.scales for _, point in joined.rows])[:, columns],
            "special_points": joined.special_points(order, self.kind),
            "rejected": tuple(
                f"{self.names[1]} = {failure.parameter * self.scales[1]:.9g}, step {failure.step:.3g}: {failure.reason}"
                for failure in self.log
            ),
            "options": options,
            "coefficient": np.array([point.examined.data.coefficient for _, point in joined.rows]),
        }

    def locus_options(self, directions: str) -> dict[str, Any]:
        """Return the arguments of the continuation, as a locus holds them."""
        bounds = {name: list(interval) for name, interval in zip(self.names, self.intervals, strict=True)}
        return self.options(bounds, directions)
