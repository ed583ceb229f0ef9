"""Multipliers that are equal by a symmetry and cross the unit circle at once: what is watched in place of products.

Test functions that are products of all multipliers' distances keep their sign where two of them cross together.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from saltus.continuation.core.monitor import Monitor
from saltus.maps.spectrum import multiplicity
from saltus.orbits.stability.floquet import height
from saltus.scales import EQUAL_TWINS, PERHAPS_CRITICAL_NEXT, ZEROS_OF_TWINS

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import NDArray

    from saltus.continuation.core.zero_problem import Event

__all__ = ["FLIPS", "ZEROS", "crossing_at_once", "doubled_by", "explains", "once", "type_of"]

ZEROS = "zeros"  # kind of the monitor function of one of several multipliers that pass 1 at once
FLIPS = "flips"  # the same at -1


def type_of(name: Monitor) -> str:
    """Return the type of the special point at a zero of a monitor function."""
    return {ZEROS: "BP", FLIPS: "PD"}.get(name.kind, name.kind)


def crossing_at_once(before: Sequence[complex], after: Sequence[complex]) -> Monitor | None:
    """Return the monitor function of equal real multipliers that cross the unit circle in a step; None if none do.

    Parameters
    ----------
    before, after : sequences of complex
        Multipliers at both ends, each at the index of its predecessor.
    """
    crossing = [i for i, (a, b) in enumerate(zip(before, after, strict=True)) if height(a) * height(b) < 0.0]
    if len(crossing) < 2:
        return None
    ends = [[end[i] for i in crossing] for end in (before, after)]
    if any(value.imag != 0.0 for end in ends for value in end) or not all(map(_equal, ends)):
        return None
    return Monitor(FLIPS if ends[0][0].real < 0.0 else ZEROS, crossing[0])


def doubled_by(values: Sequence[complex]) -> frozenset[Monitor]:
    """Return the test functions that touch 0 without changing their sign, since the nearest multipliers are equal."""
    nearest = sorted(values, key=lambda value: abs(height(value)))[:2]
    if (
        len(nearest) < 2
        or nearest[0].imag != 0.0
        or abs(height(nearest[0])) > PERHAPS_CRITICAL_NEXT
        or not _equal(nearest)
    ):
        return frozenset()
    return frozenset({Monitor("PD")} if nearest[0].real < 0.0 else {Monitor("BP"), Monitor("SN")})


def explains(name: Monitor, values: NDArray[np.complex128], crossed: int) -> bool:
    """Return whether as many multipliers are critical at a located zero as cross in the step."""
    return multiplicity(values, type_of(name)) == crossed


def once(events: list[Event]) -> list[Event]:
    """Return events without the torus points at the place of another one: equal pairs have one point."""
    tori: list[float] = []
    kept = []
    for event in events:
        if event.name.kind == "TR":
            if any(abs(event.point.arc - arc) < ZEROS_OF_TWINS for arc in tori):
                continue
            tori.append(event.point.arc)
        kept.append(event)
    return kept


def _equal(values: Sequence[complex]) -> bool:
    return max(abs(value - values[0]) for value in values) <= EQUAL_TWINS * max(abs(values[0]), 1.0)
