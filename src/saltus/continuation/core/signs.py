"""Which changes of sign of monitor functions are above the functions' own errors.

Where equations degenerate, a monitor function vanishes along a stretch, and its sign is that of its error. Such a
change is no zero. docs/theory/continuation.md, "Special points", describes the rule.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from saltus.scales import CROWDED, SMALLEST, Verdict, zero

if TYPE_CHECKING:
    from saltus.continuation.core.zero_problem import Point, ZeroProblem

__all__ = ["changed_signs"]


def changed_signs(
    problem: ZeroProblem, a: Point, b: Point, before: Point | None = None
) -> dict[Any, tuple[float, float]] | str:
    """Return the values at both ends of a step of the monitor functions whose sign changes, or why it is too long.

    The sign at an end counts where the function is above its error there. A step that ends within the error of a zero
    is too long. Of a short one the sign at its start is carried on, until the function is above its error again. A step
    may begin on a zero that the step from the point `before` has just not passed: its start has the sign of that point.
    """
    known, changed, carried = a.examined.monitors, {}, set()
    short = b.arc - a.arc <= CROWDED
    for name, value in b.examined.monitors.items():
        old = known.get(name, math.nan)
        differs = ((old < 0.0) != (value < 0.0) or value == 0.0) and old != 0.0 and math.isfinite(old + value)
        if name in a.examined.carried:
            if not _clear(problem, name, value, b):
                carried.add(name)
            elif differs:
                changed[name] = old, value
        elif differs and (_clear(problem, name, old, a) or _came_clear(problem, name, old, before)):
            if _clear(problem, name, value, b):
                changed[name] = old, value
            elif short:
                carried.add(name)
            else:
                return f"events: the step ends where the sign of {name} is that of its error"
    if carried:
        kept = {name: _signed(b.examined.monitors[name], known[name]) for name in carried}
        b.examined = replace(b.examined, monitors={**b.examined.monitors, **kept}, carried=frozenset(carried))
    return changed


def _clear(problem: Any, name: Any, value: float, point: Point) -> bool:
    """Return whether a monitor function is above its error; one without errors always is."""
    error = problem.error(name, point) if hasattr(problem, "error") else 0.0
    return error == 0.0 or zero(value, error) is Verdict.NO


def _came_clear(problem: Any, name: Any, value: float, before: Point | None) -> bool:
    """Return whether a monitor function had the sign of a value at the point before, and was above its error there."""
    old = math.nan if before is None else before.examined.monitors.get(name, math.nan)
    return before is not None and old * value > 0.0 and _clear(problem, name, old, before)


def _signed(value: float, other: float) -> float:
    """Return a value with the sign of another; of 0 the least double has it."""
    return math.copysign(max(abs(value), SMALLEST), other)
