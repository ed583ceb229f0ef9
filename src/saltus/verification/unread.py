"""Variables of a result that no check reads, each with the reason: `verify` tells them."""

from __future__ import annotations

from collections.abc import Iterator
from functools import singledispatch
from typing import TYPE_CHECKING, Any

from saltus.continuation.results.curve import SolutionCurve
from saltus.continuation.results.orbit_columns import OrbitColumns
from saltus.continuation.results.special_points import SpecialPoint
from saltus.optimisation.optimum import Optimum
from saltus.verification.table import Row, unchecked

if TYPE_CHECKING:
    from saltus.continuation.results.special_points import SpecialPoint as Point

__all__ = ["unread_rows"]

_OF_STEPS = "its unit, the step along the curve, is not kept: only its order is checked"
_OF_RESTART = "sizes in which another curve would start: no answer follows from them"
_BEFORE = "the direction of the curve a step before the point"


def unread_rows(result: Any) -> Iterator[Row]:
    """Yield a row for each variable of a result's own that no check reads."""
    for name, reason in _unread(result).items():
        yield unchecked(f"variable {name}", name, reason)


@singledispatch
def _unread(result: Any) -> dict[str, str]:
    """Return the reasons by the names of the variables."""
    return {}


@_unread.register(SolutionCurve)
def _(result: SolutionCurve[Any]) -> dict[str, str]:
    found = {"arclength": _OF_STEPS} if len(result) > 1 else {}
    if len(result.varied) > 1:
        found |= _of_coefficient(result)
    points = list(result.special_points)
    found |= {"special_arclength": _OF_STEPS} if points else {}
    return found | _at(points, "special_")


@_unread.register(SpecialPoint)
def _(result: Point[Any]) -> dict[str, str]:
    return _at([result], "") | dict.fromkeys(("position", "arclength"), "the curve of the point is not known")


@_unread.register
def _(result: Optimum) -> dict[str, str]:
    return {"limits": "what was asked for"} if result.constraints else {}


def _of_coefficient(locus: Any) -> dict[str, str]:
    if isinstance(locus, OrbitColumns):
        return {"coefficient": "its unit is that of the start: only its changes of sign are checked"}
    return {"coefficient": "its sign is that of a null vector at the start"} if locus.type == "SN" else {}


def _at(points: list[Any], prefix: str) -> dict[str, str]:
    """Return what is not read of special points."""
    found = {f"{prefix}scale": _OF_RESTART} if any(point.scale is not None for point in points) else {}
    return found | ({f"{prefix}tangent": _BEFORE} if any(point.tangent is not None for point in points) else {})
