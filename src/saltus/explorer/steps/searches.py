"""Steps that begin at a state: an orbit or an equilibrium is looked for, a motion is followed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import Field

from saltus.explorer.steps.base import Step

if TYPE_CHECKING:
    from saltus.progress import Report
    from saltus.result import Result

__all__ = ["FindEquilibrium", "FindOrbit", "Iterate", "Move", "SolveOrbit"]


class _Found(Step):
    parameters: dict[str, float] = Field(default_factory=dict)
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

    def run(self, system: Any, results: Mapping[str, Any], progress: Report | bool) -> Result:
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

    def run(self, system: Any, results: Mapping[str, Any], progress: Report | bool) -> Result:
        """Call `saltus.find_equilibrium`."""
        from saltus.equilibria import find_equilibrium

        return find_equilibrium(system, self.parameters, list(self.x0), mode=self.mode)

    def text(self) -> str:
        """Return the call as Python."""
        return f"saltus.find_equilibrium({self._arguments()})"


class SolveOrbit(Step):
    """Solve for the orbit of a map near a state, stable or not."""

    kind: Literal["solve_orbit"] = "solve_orbit"
    parameters: dict[str, float] = Field(default_factory=dict)
    x0: tuple[float, ...] = ()
    period: Annotated[int, Field(ge=1, le=1000)] = 1
    noun: ClassVar[str] = "orbit"

    def run(self, system: Any, results: Mapping[str, Any], progress: Report | bool) -> Result:
        """Call `saltus.solve_orbit`."""
        from saltus.orbits import solve_orbit

        found: Result = solve_orbit(system, self.parameters, x0=list(self.x0), period=self.period)
        return found

    def text(self) -> str:
        """Return the call as Python."""
        return f"saltus.solve_orbit(system, {self.parameters!r}, x0={list(self.x0)!r}, period={self.period})"


class Move(Step):
    """Simulate the motion from a state."""

    kind: Literal["move"] = "move"
    parameters: dict[str, float] = Field(default_factory=dict)
    x0: tuple[float, ...] = ()
    mode: str | None = None
    periods: Annotated[int, Field(ge=1, le=100_000)] | None = None
    t_end: Annotated[float, Field(gt=0.0)] | None = None
    tolerance: Annotated[float, Field(gt=0.0)] | None = None
    noun: ClassVar[str] = "motion"

    def run(self, system: Any, results: Mapping[str, Any], progress: Report | bool) -> Result:
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


class Iterate(Step):
    """Iterate a map from a state."""

    kind: Literal["iterate"] = "iterate"
    parameters: dict[str, float] = Field(default_factory=dict)
    x0: tuple[float, ...] = ()
    n: Annotated[int, Field(ge=1, le=1_000_000)] = 100
    noun: ClassVar[str] = "motion"

    def run(self, system: Any, results: Mapping[str, Any], progress: Report | bool) -> Result:
        """Call `saltus.iterate`."""
        from saltus.maps import iterate

        return iterate(system, self.parameters, list(self.x0), n=self.n)

    def text(self) -> str:
        """Return the call as Python."""
        return f"saltus.iterate(system, {self.parameters!r}, {list(self.x0)!r}, n={self.n})"
