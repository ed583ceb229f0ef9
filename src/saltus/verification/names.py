"""What special points say of themselves in words and by their test functions: labels, types, sides, copies."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.continuation.core.point_types import CHANGES, POINT_TYPES, accumulates
from saltus.continuation.results.orbit_columns import OrbitColumns
from saltus.orbits.stability.floquet import distance_from_circle
from saltus.scales import LOCATED, VERIFIED_EXTREME, Verdict, value_error, zero
from saltus.verification.reference import Reference
from saltus.verification.table import AGREES, DIFFERS, Row, unchecked

if TYPE_CHECKING:
    from saltus.continuation.results.special_points import SpecialPoint
    from saltus.orbits import PeriodicOrbit

__all__ = ["named_rows", "test_rows"]

_KINDS = ("", "persistence", "nonsmooth fold", "two-fold")
_BESIDE = dict.fromkeys(CHANGES, "non-smooth fold")  # what cycles have beside a point of a branch
_SIDES = ("smaller", "larger")  # of a grazing, where its locus meets another one
_ZEROS = ("SN", "TP", "BP", "CP", "GPD", "CH", "R1", "R2", "R3", "R4", "FF", "EX")  # types whose tests have a size of 1
_OF_SIZES = ("HB", "PD", "TR", "BE", "BC")  # those of equations without a flow whose tests have a known size


def named_rows(curve: Any) -> Iterator[Row]:
    """Yield the checks of labels and types of a curve's special points, and of copies among them."""
    labels = [point.label for point in curve.special_points]
    seen: dict[Any, str] = {}
    for point in curve.special_points:
        own = (point.type, point.of, point.locus, point.arclength, np.asarray(point.solution.x0).tobytes())
        rows = [
            _words(
                "label", point.label, _head(point) and labels.count(point.label) == 1, "its type and a number, once"
            ),
            _words("type", point.type, _known(curve, point), "a type of special points"),
            _words("of", point.of, _of(curve, point), "what a point of its type belongs to"),
            _words("locus", point.locus, point.locus == getattr(curve, "type", ""), "the type of the locus"),
            _words("kind", point.kind, point.kind in (_KINDS if point.type in ("BE", "BC") else ("",)), "a kind"),
            _words("special point", point.label, own not in seen, f"{seen.get(own)} again"),
            *_implicit(curve, point),
        ]
        seen.setdefault(own, point.label)
        yield from (row._replace(place=point.label) for row in rows)


def _words(what: str, said: str, holds: bool, wanted: str) -> Row:
    return Row(what, said, said if holds else wanted, math.nan, math.nan, AGREES if holds else DIFFERS)


def _implicit(curve: Any, point: SpecialPoint[Any]) -> Iterator[Row]:
    """Yield whether an orbit is followed by such steps as its neighbours are, or as it is by itself."""
    if not isinstance(curve, OrbitColumns):
        return
    own, first = point.solution.implicit, max(math.floor(point.position), 0)
    beside = bool(np.any(curve.implicit[first : first + 2] == own)) or point.solution.problem().stiff == own
    yield _words("implicit steps", str(own), beside, "as at its neighbours")


def _head(point: SpecialPoint[Any]) -> bool:
    return re.fullmatch(re.escape(point.type) + r"_?\d+", point.label) is not None


def _events(curve: Any) -> dict[str, Any]:
    return dict(curve.options.get("events") or {})


def _known(curve: Any, point: SpecialPoint[Any]) -> bool:
    return point.type in POINT_TYPES or not curve.options or point.type in _events(curve)


def _of(curve: Any, point: SpecialPoint[Any]) -> bool:
    """Return whether a point names what one of its type belongs to."""
    if point.type == "TP":
        return point.of in curve.varied
    if point.type == "EX":
        return not curve.options or point.of in _events(curve)
    if len(curve.varied) == 1 and point.of == (point.kind if point.type == "BE" else _BESIDE.get(point.type)):
        return True
    if point.of and (
        point.type == "BC"
        or (point.type == "BE" and point.homoclinic is not None)
        or accumulates(point.type, point.locus)
    ):
        return point.of in getattr(curve.system, "transition_names", (point.of,))
    at_sides = getattr(curve, "type", "") in CHANGES
    return point.of in ("", *(_SIDES if at_sides else ()))


def test_rows(point: SpecialPoint[Any], tolerance: float | None) -> Iterator[Row]:
    """Yield the check of a test function: by the solution at the point, else as 0.

    tolerance: that of the flow along the curve; None of equations without a flow.
    """
    found, error = _of_solution(point, tolerance)
    if math.isnan(error):
        yield unchecked("test function", point.test, "no other way to it is known")
        return
    if not (math.isfinite(found) and math.isfinite(point.test)):
        said = math.isfinite(point.test) or math.isfinite(found)
        row = Row("test function", point.test, found, math.inf, error, DIFFERS)
        yield row if said else unchecked("test function", point.test, "undetermined")
        return
    difference = abs(point.test - found)
    verdict = zero(difference, error)
    if verdict is Verdict.UNCLEAR:
        yield unchecked("test function", point.test, f"{found}, within ten errors of {error:.1g}")
    else:
        yield Row("test function", point.test, found, difference, error, AGREES if verdict else DIFFERS)


def _of_solution(point: SpecialPoint[Any], tolerance: float | None) -> tuple[float, float]:
    """Return the test function of a point, by its solution or as 0, and the error of that; NaN where none is known.

    A point of equations without a flow is located by its place along the curve.
    """
    solution = point.solution
    if tolerance is None:
        guarded = point.type == "BE" and solution.system.modes[solution.mode].domain is not None
        known = point.type in _ZEROS or (point.type in _OF_SIZES and not guarded)
        return 0.0, LOCATED * _unit(point) if known else math.nan
    error, values = value_error(tolerance), solution.multipliers
    if point.type == "PD" and not point.locus:
        finite = values[np.isfinite(values)]
        return float(np.abs(finite + 1.0).min()) if finite.size else math.nan, error
    if point.type == "TR" and not point.locus:
        return distance_from_circle(values), error
    if point.type == "HB":
        lows, highs = solution.extremes
        return 0.5 * float(np.max(highs - lows)), VERIFIED_EXTREME * float(np.abs([lows, highs]).max())
    if point.type == "GR":
        return 0.0, error * _slowest(solution)
    return 0.0, error if point.type in _ZEROS else math.nan


def _slowest(orbit: PeriodicOrbit) -> float:
    """Return the size of what vanishes at a grazing: a distance from a surface, a speed across it, a duration."""
    problem, starts = orbit.problem(), zip(orbit.form.modes, orbit.states, strict=True)
    ways = [(k, x) for mode, x in starts for k in Reference(orbit.system, orbit.parameters).ways_out(mode)]
    sizes = [problem.event_size(k, x) for k, x in ways]
    return max(orbit.period, *(max(size, size / orbit.period) for size in sizes))


def _unit(point: SpecialPoint[Any]) -> float:
    """Return the size of the terms of a product over eigenvalues, or over multipliers, that vanishes at a point."""
    kind, solution = point.type, point.solution
    if kind not in ("HB", "PD", "TR"):
        return 1.0
    sizes = np.abs(solution.eigenvalues if kind == "HB" else solution.multipliers)
    if kind == "PD":
        return float(np.prod(1.0 + sizes))
    pairs = [(a, b) for i, a in enumerate(sizes.tolist()) for b in sizes[:i].tolist()]
    return float(math.prod(a + b if kind == "HB" else 1.0 + a * b for a, b in pairs))
