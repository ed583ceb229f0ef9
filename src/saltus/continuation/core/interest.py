"""What a branch is asked for: bounds, the unit of its parameter, users' events."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Interest"]


@dataclass(frozen=True)
class Interest:
    """Bounds of a branch, the unit of its parameter, and users' events."""

    # low, high: bounds of the parameter, in units of `scale`
    low: float
    high: float
    scale: float  # unit of the parameter among the unknowns
    # users' events. `kind` is ``parameter``, ``freed`` (the freed parameter), ``observable``, or ``min_`` or ``max_``
    # and a state or output. The value is None where an extremum is asked for.
    events: tuple[tuple[str, str, float | None], ...] = ()
