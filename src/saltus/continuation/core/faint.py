"""Monitor functions that vanish along a whole stretch of a curve, where their sign is rounding.

Test functions of multipliers do so on curves of area-preserving maps, those of eigenvalues on families of centres.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from saltus.continuation.core.monitor import Monitor
    from saltus.continuation.core.zero_problem import Point

__all__ = ["faint_step", "resolved"]

_LONG = 1e-3  # arclength of a step from which on it must not end where a monitor function is rounding


def _is_known(name: Monitor, point: Point, faint: Mapping[Monitor, float]) -> bool:
    """Return whether a monitor function is more than rounding at a point."""
    return abs(point.examined.monitors.get(name, math.nan)) >= faint[name]


def resolved(
    monitors: Mapping[Monitor, float], faint: Mapping[Monitor, float], before: Point | None
) -> dict[Monitor, float]:
    """Return monitor functions, NaN in place of those that are rounding at a point and at the point before.

    Parameters
    ----------
    monitors : mapping of Monitor to float
        Monitor functions at the point.
    faint : mapping of Monitor to float
        Values up to which some of them are rounding.
    before : Point or None
        The point before, examined.
    """
    found = dict(monitors)
    for name, least in faint.items():
        if abs(found.get(name, math.inf)) < least and (before is None or not _is_known(name, before, faint)):
            found[name] = math.nan
    return found


def faint_step(
    monitors: Mapping[Monitor, float], faint: Mapping[Monitor, float], before: Point, point: Point
) -> str | None:
    """Return why a step is too long that ends where a monitor function has become rounding; None if it may be taken."""
    if point.arc - before.arc <= _LONG:
        return None
    for name, least in faint.items():
        if abs(monitors.get(name, math.inf)) < least and _is_known(name, before, faint):
            return f"events: the step ends at a zero of {name.kind}, and may have passed over another"
    return None
