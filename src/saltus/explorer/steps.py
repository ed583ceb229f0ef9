"""Steps of a session: each is a call of the package with its arguments, can be kept as JSON and told as Python."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import AliasChoices, BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from saltus.errors import InputError

if TYPE_CHECKING:
    from saltus.progress import Report
    from saltus.result import Result
    from saltus.system import HybridSystem

__all__ = [
    "Attract",
    "Basin",
    "Cascade",
    "Continue",
    "FindEquilibrium",
    "FindOrbit",
    "Follow",
    "Move",
    "Place",
    "Step",
    "Sweep",
    "Switch",
    "step_from",
    "taken",
]


class _Frozen(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Place(_Frozen):
    """A solution in a result: the result itself, a point of a branch, or a special point.

    Attributes
    ----------
    of : str
        Name of the result.
    index : int or None
        Which point of a branch.
    label : str or None
        Which special point of it, as ``"SN1"``.
    """

    of: str
    index: int | None = None
    label: str | None = None

    def text(self, holder: str = "orbit") -> str:
        """Return the place as Python; `holder` is the attribute of a special point that holds the solution."""
        if self.label is not None:
            return f"{self.of}[{self.label!r}].{holder}"
        return self.of if self.index is None else f"{self.of}.solution({self.index})"


def taken(place: Place, results: Mapping[str, Any]) -> Any:
    """Return the solution at a place.

    Parameters
    ----------
    place : Place
        The place.
    results : mapping of str to Result
        The results by name.

    Raises
    ------
    InputError
        There is no such result, point or special point.
    """
    if place.of not in results:
        raise InputError("result", place.of, f"one of {', '.join(results)}" if results else "found first")
    result = results[place.of]
    if place.label is not None:
        return result[place.label].solution
    if place.index is None:
        return result
    return result.solution(place.index)


class Step(_Frozen, ABC):
    """One call of the package."""

    noun: ClassVar[str]  # what its result is called, with a number after it

    @property
    def needs(self) -> tuple[str, ...]:
        """Names of the results that the call takes."""
        return ()

    @abstractmethod
    def run(self, system: HybridSystem, results: Mapping[str, Any], progress: Report | bool) -> Result:
        """Call the package and return the result."""

    @abstractmethod
    def text(self) -> str:
        """Return the call as Python."""


class _Found(Step):
    parameters: dict[str, float] = {}
    x0: tuple[float, ...] = ()
    mode: str | None = None

    def _arguments(self) -> str:
        mode = "" if self.mode is None else f", mode={self.mode!r}"
        return f"system, {self.parameters!r}, x0={list(self.x0)!r}{mode}"


class FindOrbit(_Found):
    """Find the periodic orbit on which the motion from a state settles."""

    kind: Literal["find_orbit"] = "find_orbit"
    settle: Annotated[float, Field(gt=0.0)] | None = None
    noun: ClassVar[str] = "orbit"

    def run(self, system: HybridSystem, results: Mapping[str, Any], progress: Report | bool) -> Result:
        """Call `saltus.find_orbit`."""
        from saltus.orbits import find_orbit

        return find_orbit(system, self.parameters, list(self.x0), mode=self.mode, settle=self.settle)

    def text(self) -> str:
        """Return the call as Python."""
        settle = "" if self.settle is None else f", settle={self.settle!r}"
        return f"saltus.find_orbit({self._arguments()}{settle})"


class FindEquilibrium(_Found):
    """Find an equilibrium near a state."""

    kind: Literal["find_equilibrium"] = "find_equilibrium"
    noun: ClassVar[str] = "equilibrium"

    def run(self, system: HybridSystem, results: Mapping[str, Any], progress: Report | bool) -> Result:
        """Call `saltus.find_equilibrium`."""
        from saltus.equilibria import find_equilibrium

        return find_equilibrium(system, self.parameters, list(self.x0), mode=self.mode)

    def text(self) -> str:
        """Return the call as Python."""
        return f"saltus.find_equilibrium({self._arguments()})"


class _FromPlace(Step):
    place: Place

    @property
    def needs(self) -> tuple[str, ...]:
        """Names of the results that the call takes."""
        return (self.place.of,)

    def _point(self, results: Mapping[str, Any]) -> Any:
        """Return the special point at the place."""
        taken(self.place, results)
        return results[self.place.of][self.place.label]

    def _point_text(self) -> str:
        return f"{self.place.of}[{self.place.label!r}]"


class _Stepped(_FromPlace):
    steps: dict[
        Literal["largest", "deviation", "max_points"], float | int
    ] = {}  # values of a `saltus.StepControl` that differ from its own

    @property
    def _control(self) -> Any:
        from saltus.continuation import StepControl

        return StepControl(**self.steps) if self.steps else None  # type: ignore[arg-type]  # it checks them

    def _control_text(self) -> str:
        values = ", ".join(f"{name}={value!r}" for name, value in self.steps.items())
        return f", steps=saltus.StepControl({values})" if values else ""


class _Followed(_Stepped):
    parameter: str
    bounds: tuple[float, float]
    of: Literal["orbit", "equilibrium", "cycle"] = "orbit"  # what is followed
    directions: Literal["both", "up", "down"] = "both"
    noun: ClassVar[str] = "branch"

    def _follow(self, start: Any, progress: Report | bool) -> Result:
        from saltus.continuation import continue_equilibrium, continue_orbit

        follow: Any = continue_equilibrium if self.of == "equilibrium" else continue_orbit
        options = {"steps": self._control, "directions": self.directions}
        found: Result = follow(start, self.parameter, self.bounds, progress=progress, **options)
        return found

    def _call(self, start: str) -> str:
        name = "continue_equilibrium" if self.of == "equilibrium" else "continue_orbit"
        way = "" if self.directions == "both" else f", directions={self.directions!r}"
        return f"saltus.{name}({start}, {self.parameter!r}, {self.bounds!r}{way}{self._control_text()})"


class Continue(_Followed):
    """Follow the branch through an orbit, an equilibrium or an orbit of a map."""

    kind: Literal["continue"] = "continue"

    def run(self, system: HybridSystem, results: Mapping[str, Any], progress: Report | bool) -> Result:
        """Call `saltus.continue_orbit` or `saltus.continue_equilibrium`."""
        return self._follow(taken(self.place, results), progress)

    def text(self) -> str:
        """Return the call as Python."""
        return self._call(self.place.text(self.of))


class Switch(_Followed):
    """Follow the other branch that meets a special point."""

    kind: Literal["switch"] = "switch"

    def run(self, system: HybridSystem, results: Mapping[str, Any], progress: Report | bool) -> Result:
        """Call `saltus.switch_branch`, and follow the branch of what it returns."""
        from saltus.continuation import switch_branch

        return self._follow(switch_branch(self._point(results)), progress)

    def text(self) -> str:
        """Return the calls as Python."""
        return self._call(f"saltus.switch_branch({self._point_text()})")


class Follow(_Stepped):
    """Follow the locus of a special point over two parameters."""

    kind: Literal["follow"] = "follow"
    parameters: tuple[str, str]
    bounds: tuple[tuple[float, float], tuple[float, float]]
    noun: ClassVar[str] = "locus"

    def run(self, system: HybridSystem, results: Mapping[str, Any], progress: Report | bool) -> Result:
        """Call `saltus.continue_locus`."""
        from saltus.continuation import continue_locus

        bounds = dict(zip(self.parameters, self.bounds, strict=True))
        point, control = self._point(results), self._control
        found: Result = continue_locus(point, self.parameters, bounds, steps=control, progress=progress)
        return found

    def text(self) -> str:
        """Return the call as Python."""
        bounds = dict(zip(self.parameters, self.bounds, strict=True))
        return f"saltus.continue_locus({self._point_text()}, {self.parameters!r}, {bounds!r}{self._control_text()})"


class Cascade(_Stepped):
    """Follow the period doublings after a first one."""

    kind: Literal["cascade"] = "cascade"
    bounds: tuple[float, float]
    doublings: int = 4
    noun: ClassVar[str] = "cascade"

    def run(self, system: HybridSystem, results: Mapping[str, Any], progress: Report | bool) -> Result:
        """Call `saltus.follow_cascade`."""
        from saltus.continuation import follow_cascade

        options = {"doublings": self.doublings, "steps": self._control, "progress": progress}
        found: Result = follow_cascade(self._point(results), self.bounds, **options)
        return found

    def text(self) -> str:
        """Return the call as Python."""
        given = f"{self.bounds!r}, doublings={self.doublings}{self._control_text()}"
        return f"saltus.follow_cascade({self._point_text()}, {given})"


class Sweep(Step):
    """Follow the attractor as a parameter goes up or down."""

    kind: Literal["sweep"] = "sweep"
    parameter: str
    bounds: tuple[float, float]
    count: Annotated[int, Field(ge=2, le=10_000)] = 200
    direction: Literal["up", "down"] = "up"
    observables: tuple[str, ...] = ()
    parameters: dict[str, float] = {}
    x0: tuple[float, ...] = ()
    discard: Annotated[int, Field(ge=0)] | None = None
    keep: Annotated[int, Field(ge=1)] | None = None
    tolerance: Annotated[float, Field(gt=0.0)] | None = None
    # a transition, or an expression that vanishes with the direction of its crossings; None for phase 0
    section: str | tuple[str, Literal[-1, 0, 1]] | None = None
    noun: ClassVar[str] = "sweep"

    def _numerics(self) -> dict[str, Any]:
        given = {"discard": self.discard, "keep": self.keep, "tolerance": self.tolerance}
        return {name: value for name, value in given.items() if value is not None}

    def run(self, system: HybridSystem, results: Mapping[str, Any], progress: Report | bool) -> Result:
        """Call `saltus.run_sweep`."""
        from saltus.sweeps import Section, SweepOptions, run_sweep

        values, x0 = np.linspace(*self.bounds, self.count), list(self.x0) or None
        section = Section(*self.section) if isinstance(self.section, tuple) else self.section
        options = SweepOptions(
            follow=self.direction, observables=self.observables, section=section, workers=1, **self._numerics()
        )
        given = self.parameters
        return run_sweep(system, self.parameter, values, parameters=given, x0=x0, options=options, progress=progress)

    def text(self) -> str:
        """Return the call as Python."""
        low, high = self.bounds
        values = f"np.linspace({low!r}, {high!r}, {self.count})"
        seen = f", observables={self.observables!r}" if self.observables else ""
        more = "".join(f", {name}={value!r}" for name, value in self._numerics().items())
        if self.section is not None:
            named = isinstance(self.section, str)
            more += f", section={self.section!r}" if named else f", section=saltus.Section{self.section!r}"
        options = f"saltus.options.SweepOptions(follow={self.direction!r}{seen}{more}, workers=1)"
        given = f"parameters={self.parameters!r}, x0={list(self.x0) or None!r}, options={options}"
        return f"saltus.run_sweep(system, {self.parameter!r}, {values}, {given})"


class Move(Step):
    """Simulate the motion from a state."""

    kind: Literal["move"] = "move"
    parameters: dict[str, float] = {}
    x0: tuple[float, ...] = ()
    mode: str | None = None
    periods: Annotated[int, Field(ge=1, le=100_000)] | None = None
    t_end: Annotated[float, Field(gt=0.0)] | None = None
    tolerance: Annotated[float, Field(gt=0.0)] | None = None
    noun: ClassVar[str] = "motion"

    def run(self, system: HybridSystem, results: Mapping[str, Any], progress: Report | bool) -> Result:
        """Call `saltus.simulate`."""
        from saltus.flow import simulate

        span = {"t_end": self.t_end, "periods": self.periods, "tolerance": self.tolerance}
        given: dict[str, Any] = {name: value for name, value in span.items() if value is not None}
        return simulate(system, self.parameters, list(self.x0), mode=self.mode, **given)

    def text(self) -> str:
        """Return the call as Python."""
        span = {"t_end": self.t_end, "periods": self.periods, "tolerance": self.tolerance}
        given = {"mode": self.mode, **span}
        options = "".join(f", {name}={value!r}" for name, value in given.items() if value is not None)
        return f"saltus.simulate(system, {self.parameters!r}, {list(self.x0)!r}{options})"


class Attract(Step):
    """Find the attractors that motions from a region reach."""

    kind: Literal["attract"] = "attract"
    parameters: dict[str, float] = {}
    region: dict[str, tuple[float, float]]
    starts: Annotated[int, Field(ge=1, le=10_000, validation_alias=AliasChoices("starts", "seeds"))] = 64
    motions: Annotated[int, Field(ge=1)] = 10_000
    interval: Annotated[float, Field(gt=0.0)] | None = None
    noun: ClassVar[str] = "attractors"

    def run(self, system: HybridSystem, results: Mapping[str, Any], progress: Report | bool) -> Result:
        """Call `saltus.find_attractors`."""
        from saltus.basins import AttractorOptions, find_attractors

        options = AttractorOptions(starts=self.starts, motions=self.motions, interval=self.interval)
        return find_attractors(system, self.parameters, self.region, options=options, progress=progress)

    def text(self) -> str:
        """Return the call as Python."""
        counts = f"starts={self.starts}, motions={self.motions}"
        counts += f", interval={self.interval!r}" if self.interval is not None else ""
        options = f"saltus.options.AttractorOptions({counts})"
        return f"saltus.find_attractors(system, {self.parameters!r}, {self.region!r}, options={options})"


class Basin(Step):
    """Map the basins of known attractors over a plane that is parallel to two axes."""

    kind: Literal["basin"] = "basin"
    parameters: dict[str, float] = {}
    grid: dict[str, tuple[float, float, int] | float]
    attractors: str
    noun: ClassVar[str] = "basins"

    @property
    def needs(self) -> tuple[str, ...]:
        """Names of the results that the call takes."""
        return (self.attractors,)

    def run(self, system: HybridSystem, results: Mapping[str, Any], progress: Report | bool) -> Result:
        """Call `saltus.map_basins`."""
        from saltus.basins import map_basins

        attractors = taken(Place(of=self.attractors), results)
        return map_basins(system, self.parameters, self.grid, attractors, progress=progress)

    def text(self) -> str:
        """Return the call as Python."""
        return f"saltus.map_basins(system, {self.parameters!r}, {self.grid!r}, {self.attractors})"


_STEPS: TypeAdapter[Any] = TypeAdapter(
    Annotated[
        FindOrbit | FindEquilibrium | Continue | Switch | Follow | Cascade | Sweep | Move | Attract | Basin,
        Field(discriminator="kind"),
    ]
)


def step_from(plain: Any) -> Step:
    """Return the step that plain data describe.

    Raises
    ------
    InputError
        The data describe no step.

    Examples
    --------
    >>> step_from({"kind": "find_orbit", "parameters": {"w": 1.0}, "x0": [0.0, 0.0]}).text()
    "saltus.find_orbit(system, {'w': 1.0}, x0=[0.0, 0.0])"
    """
    try:
        found: Step = _STEPS.validate_python(plain)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        raise InputError(f"step's {place}" if place else "step", first.get("input"), first["msg"]) from None
    return found
