"""What vanishes at the special points of a curve of orbits."""

from __future__ import annotations

from typing import NamedTuple

__all__ = ["BIFURCATIONS", "Monitor", "at_grazing", "bifurcates"]

BIFURCATIONS = ("SN", "PD", "TR", "BP", "GR")

_GRAZINGS = ("margin", "side", "duration", "rate")


class Monitor(NamedTuple):
    """A monitor function of a branch or of a locus.

    Attributes
    ----------
    kind : str
        The type of special point at its zeros, ``low`` and ``high`` for bounds, ``event`` for a user's event, or what
        vanishes at a grazing: ``margin`` (a segment's distance from a surface), ``side`` (that of a segment equally far
        throughout), ``duration`` (of a segment that starts on its own event), ``rate`` (the velocity at its end).
    segment : int
        Which segment; of a bound or a TP which parameter, of a TR which multiplier, of an event which; -1 for none.
    transition : int
        Whose surface is meant; -1 for none.
    side : str
        On which side of a grazing the orbit bifurcates, ``larger`` or ``smaller`` signature; empty for none.

    Examples
    --------
    >>> print(Monitor("margin", 2, 0), Monitor("SN"), Monitor("SN", side="larger"), sep=", ")
    margin 2 0, SN, SN larger
    """

    kind: str
    segment: int = -1
    transition: int = -1
    side: str = ""

    def __str__(self) -> str:
        numbers = (str(number) for number in (self.segment, self.transition) if number >= 0)
        return " ".join([self.kind, *numbers, *([self.side] if self.side else [])])


def bifurcates(monitor: Monitor) -> bool:
    """Return whether a monitor function vanishes at bifurcations of smooth branches."""
    return monitor.kind in BIFURCATIONS


def at_grazing(monitor: Monitor) -> bool:
    """Return whether a monitor function vanishes at grazings."""
    return monitor.kind in _GRAZINGS
