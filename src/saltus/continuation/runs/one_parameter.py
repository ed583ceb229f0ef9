"""A branch under way, of any kind of solution: what a continuation along one parameter does in the same way."""

from __future__ import annotations

import math
import warnings
from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from functools import singledispatch
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from saltus.continuation.core.monitor import Monitor
from saltus.continuation.runs.options import checked_interval
from saltus.continuation.runs.run import Asked, Going, Run
from saltus.continuation.runs.two_sided import BothSides, Found, OneSide
from saltus.errors import InputError
from saltus.scales import AT_NO_VALUE, BOUND_MISSED

if TYPE_CHECKING:
    from saltus.continuation.core.interest import Interest
    from saltus.continuation.core.zero_problem import Event, Point

__all__ = ["OneParameterRun", "Wanted", "branch_run"]

Wanted = tuple[str, str, float | None]  # a user's event: name, kind, value; None where an extremum is asked for


@singledispatch
def branch_run(start: object, parameter: str) -> type[OneParameterRun]:
    """Return how the branch through a solution is followed along a parameter; each kind registers its own."""
    raise InputError("start", start, "a solution, as a PeriodicOrbit, an Equilibrium or a MapOrbit")


class OneParameterRun(Run):
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
        """See `Run.event`."""
        if event.name.kind in ("low", "high"):
            return self.at_bound(half, piece, event.point, event.name.kind)
        if event.name.kind not in ("event", "EX"):
            return self.special(half, piece, event)
        name, of, stop = self._wanted(event.name)
        half.specials.append(replace(self.found(name, piece, event, half), of=of))
        return self.end_at(half, piece, event.point, stop)

    def keep(self, half: OneSide, piece: Any, last: Point, point: Point) -> str | None:
        """See `Run.keep`; warn where a user's event asks for what is no longer a number."""
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
            value = bound if abs(value - bound) < BOUND_MISSED else value
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
        return point.parameter * self.scale if abs(point.parameter) > AT_NO_VALUE else 0.0

    def told(self, point: Point) -> str:
        """See `Run.told`."""
        return f"{self.name} = {point.parameter * self.scale:.6g}"

    def rejected(self) -> tuple[str, ...]:
        """See `Run.rejected`."""
        return self._told_rejected(self.name, self.scale)

    def starts_outwards(self, point: Point) -> bool:
        """See `Run.starts_outwards`."""
        outwards = math.copysign(1.0, float(point.tangent[-1]))
        return (
            outwards * (point.parameter - (self.interest.high if outwards > 0.0 else self.interest.low)) > -BOUND_MISSED
        )

    def ready(self, piece: Any, origin: Point) -> Point:
        """See `Run.ready`: a start that misses a bound by rounding is on it, and no step away from it reaches it."""
        for kind, bound in (("low", self.interest.low), ("high", self.interest.high)):
            if abs(origin.parameter - bound) < BOUND_MISSED:
                origin.u[-1] = bound
                origin.examined = replace(origin.examined, monitors={**origin.examined.monitors, Monitor(kind): 0.0})
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
        """End a branch at the special point found last where `stop_at` has its type, or where it is asked and ends."""
        until, way = self.asked.until, math.copysign(1.0, float(half.first.tangent[-1]))
        stops = name in self.stops or (name == "SN" and until is not None and until(half.specials[-1].solution, way))
        return self.ends(half, piece, point, name) if stops else None

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
