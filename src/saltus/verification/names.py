"""What special points say of themselves in words and by their test functions: labels, types, sides, copies."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.continuation.core.point_types import CHANGES, POINT_TYPES, accumulates
from saltus.scales import EQUATIONS_SOLVED, Verdict, critical_error, zero
from saltus.verification.table import AGREES, DIFFERS, Row, unchecked

if TYPE_CHECKING:
    from saltus.continuation.results.special_points import SpecialPoint

__all__ = ["named_rows"]

_KINDS = ("", "persistence", "nonsmooth fold", "two-fold")
_BESIDE = dict.fromkeys(CHANGES, "non-smooth fold")  # what cycles have beside a point of a branch
_SIDES = ("smaller", "larger")  # of a grazing, where its locus meets another one
_ZEROS = ("SN", "TP", "BP", "CP", "GPD", "CH", "R1", "R2", "R3", "R4", "FF", "EX")  # types whose tests have a size of 1


def named_rows(curve: Any) -> Iterator[Row]:
    """Yield the checks of labels, types and test functions of a curve's special points, and of copies among them."""
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
            *_test(curve, point),
        ]
        seen.setdefault(own, point.label)
        yield from (row._replace(place=point.label) for row in rows)


def _words(what: str, said: str, holds: bool, wanted: str) -> Row:
    return Row(what, said, said if holds else wanted, math.nan, math.nan, AGREES if holds else DIFFERS)


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


def _test(curve: Any, point: SpecialPoint[Any]) -> Iterator[Row]:
    """Yield the check of the test function: that of a doubling and of a torus by the multipliers, of others as 0."""
    values = getattr(point.solution, "multipliers", None)
    error = critical_error(getattr(curve, "tolerance", EQUATIONS_SOLVED))
    found = 0.0
    if point.type == "PD" and not point.locus and values is not None and hasattr(curve, "tolerance"):
        finite = values[np.isfinite(values)]
        found = float(np.abs(finite + 1.0).min()) if finite.size else math.nan
    elif point.type in ("HB", "PD") and not hasattr(curve, "tolerance"):
        error *= _unit(point)
    elif point.type not in _ZEROS:
        return
    if not (math.isfinite(found) and math.isfinite(point.test)):
        yield unchecked("test function", point.test, "undetermined")
        return
    difference = abs(point.test - found)
    verdict = zero(difference, error)
    if verdict is Verdict.UNCLEAR:
        yield unchecked("test function", point.test, f"{found}, within ten errors of {error:.1g}")
    else:
        yield Row("test function", point.test, found, difference, error, AGREES if verdict else DIFFERS)


def _unit(point: SpecialPoint[Any]) -> float:
    """Return the size of the terms of a product over eigenvalues, or over multipliers, that vanishes at a point."""
    if point.type == "PD":
        return float(np.prod(1.0 + np.abs(point.solution.multipliers)))
    sizes = np.abs(point.solution.eigenvalues)
    return float(math.prod(a + b for i, a in enumerate(sizes.tolist()) for b in sizes[:i].tolist()))
