"""Names of monitor functions, which vanish at the special points of a curve of orbits."""

from __future__ import annotations

from typing import NamedTuple

from saltus.continuation.core.point_types import on_branches

__all__ = ["BIFURCATIONS", "Monitor", "at_grazing", "bifurcates"]

BIFURCATIONS = on_branches("orbit")  # types of special points at which smooth branches of orbits bifurcate

# kinds that vanish at grazings and border collisions, where the signature of an orbit changes
_CHANGES = ("margin", "side", "duration", "rate", "condition", "ahead", "behind", "unmet", "rebound")


class Monitor(NamedTuple):
    """A monitor function of a branch or of a locus.

    Examples
    --------
    >>> print(Monitor("margin", 2, 0), Monitor("SN"), Monitor("SN", side="larger"), sep=", ")
    margin 2 0, SN, SN larger
    """

    # the type of special point at its zeros, ``low`` or ``high`` for a bound, ``event`` for a user's event that asks
    # for a value. At a grazing ``margin`` (least distance of a segment from a surface) or ``side`` (distance of a
    # segment that is equally far throughout). Also ``duration`` (of a segment), ``rate`` (velocity at the event that
    # ends a segment) and ``condition`` (of the transition that ends a segment, at its end). Of other events of a mode
    # ``ahead`` (distance of a segment's end from the surface), ``behind`` (of its start) and ``unmet`` (condition where
    # a segment meets the surface). ``rebound`` is the rate at a segment's start on the surface of the event before it.
    kind: str
    # index of the segment; for a bound or TP of the parameter, for TR of the multiplier, for a user's event (EX among
    # them) of the event; -1 for none
    segment: int = -1
    transition: int = -1  # index of the transition whose surface is meant; -1 for none
    side: str = ""  # signature at a grazing in which the orbit bifurcates, ``larger`` or ``smaller``; empty for none

    def __str__(self) -> str:
        numbers = (str(number) for number in (self.segment, self.transition) if number >= 0)
        return " ".join([self.kind, *numbers, *([self.side] if self.side else [])])


def bifurcates(monitor: Monitor) -> bool:
    """Return whether a monitor function vanishes at bifurcations of smooth branches."""
    return monitor.kind in BIFURCATIONS


def at_grazing(monitor: Monitor) -> bool:
    """Return whether a monitor function vanishes at grazings and border collisions, where the signature changes."""
    return monitor.kind in _CHANGES
