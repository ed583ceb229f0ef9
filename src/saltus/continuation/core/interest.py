"""What a branch is asked for: bounds, the unit of its parameter, users' events."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Interest"]


@dataclass(frozen=True)
class Interest:
    """Bounds of a branch, the unit of its parameter, and users' events.

    Attributes
    ----------
    low, high : float
        Bounds of the parameter, in units of `scale`.
    scale : float
        Unit of the parameter among the unknowns.
    events : tuple of (name, kind, value)
        Users' events. `kind` is ``parameter``, ``freed`` (the freed parameter), ``observable``, or ``min_`` or ``max_``
        and a state or output. The value is None where an extremum is asked for.
    """

    low: float
    high: float
    scale: float
    events: tuple[tuple[str, str, float | None], ...] = ()
