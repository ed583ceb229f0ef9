"""Steps that look at many motions: sweeps, attractors and basins."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import AliasChoices, Field

from saltus.explorer.steps.base import Place, Step, taken

if TYPE_CHECKING:
    from saltus.progress import Report
    from saltus.result import Result

__all__ = ["Attract", "Basin", "Sweep"]


class Sweep(Step):
    """Follow the attractor as a parameter goes up or down."""

    kind: Literal["sweep"] = "sweep"
    parameter: str
    bounds: tuple[float, float]
    count: Annotated[int, Field(ge=2, le=10_000)] = 200
    direction: Literal["up", "down"] = "up"
    observables: tuple[str, ...] = ()
    parameters: dict[str, float] = Field(default_factory=dict)
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

    def run(self, system: Any, results: Mapping[str, Any], progress: Report | bool) -> Result:
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


class Attract(Step):
    """Find the attractors that motions from a region reach."""

    kind: Literal["attract"] = "attract"
    parameters: dict[str, float] = Field(default_factory=dict)
    region: dict[str, tuple[float, float]]
    starts: Annotated[int, Field(ge=1, le=10_000, validation_alias=AliasChoices("starts", "seeds"))] = 64
    motions: Annotated[int, Field(ge=1)] = 10_000
    interval: Annotated[float, Field(gt=0.0)] | None = None
    noun: ClassVar[str] = "attractors"

    def run(self, system: Any, results: Mapping[str, Any], progress: Report | bool) -> Result:
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
    parameters: dict[str, float] = Field(default_factory=dict)
    grid: dict[str, tuple[float, float, int] | float]
    attractors: str
    noun: ClassVar[str] = "basins"

    @property
    def needs(self) -> tuple[str, ...]:
        """Names of the results that the call takes."""
        return (self.attractors,)

    def run(self, system: Any, results: Mapping[str, Any], progress: Report | bool) -> Result:
        """Call `saltus.map_basins`."""
        from saltus.basins import map_basins

        attractors = taken(Place(of=self.attractors), results)
        return map_basins(system, self.parameters, self.grid, attractors, progress=progress)

    def text(self) -> str:
        """Return the call as Python."""
        return f"saltus.map_basins(system, {self.parameters!r}, {self.grid!r}, {self.attractors})"
