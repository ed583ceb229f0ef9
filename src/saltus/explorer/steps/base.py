"""What a step is, and the place of a solution in a result at which a step begins."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar

from pydantic import BaseModel, ConfigDict

from saltus.errors import InputError

if TYPE_CHECKING:
    from saltus.progress import Report
    from saltus.result import Result

__all__ = ["Place", "Step", "taken"]


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
    def run(self, system: Any, results: Mapping[str, Any], progress: Report | bool) -> Result:
        """Call the package and return the result."""

    @abstractmethod
    def text(self) -> str:
        """Return the call as Python."""
