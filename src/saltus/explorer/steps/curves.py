"""Steps that go on from a solution or a special point: branches, loci and cascades."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from pydantic import Field

from saltus.explorer.steps.base import Place, Step, taken

if TYPE_CHECKING:
    from saltus.progress import Report
    from saltus.result import Result

__all__ = ["Cascade", "Continue", "Follow", "Switch"]


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
    # values of a `saltus.StepControl` that differ from its own
    steps: dict[Literal["largest", "deviation", "max_points"], float | int] = Field(default_factory=dict)

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
    of: Literal["orbit", "equilibrium", "cycle", "map_orbit"] = "orbit"  # what is followed
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

    def run(self, system: Any, results: Mapping[str, Any], progress: Report | bool) -> Result:
        """Call `saltus.continue_orbit` or `saltus.continue_equilibrium`."""
        return self._follow(taken(self.place, results), progress)

    def text(self) -> str:
        """Return the call as Python."""
        return self._call(self.place.text(self.of))


class Switch(_Followed):
    """Follow the other branch that meets a special point."""

    kind: Literal["switch"] = "switch"

    def run(self, system: Any, results: Mapping[str, Any], progress: Report | bool) -> Result:
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

    def run(self, system: Any, results: Mapping[str, Any], progress: Report | bool) -> Result:
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

    def run(self, system: Any, results: Mapping[str, Any], progress: Report | bool) -> Result:
        """Call `saltus.follow_cascade`."""
        from saltus.continuation import follow_cascade

        options = {"doublings": self.doublings, "steps": self._control, "progress": progress}
        found: Result = follow_cascade(self._point(results), self.bounds, **options)
        return found

    def text(self) -> str:
        """Return the call as Python."""
        given = f"{self.bounds!r}, doublings={self.doublings}{self._control_text()}"
        return f"saltus.follow_cascade({self._point_text()}, {given})"
