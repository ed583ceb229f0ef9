"""Roots of a field at which segments of an orbit begin: its slope is infinite there, so that no second one exists."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus.scales import ROOT_ORDER

if TYPE_CHECKING:
    from saltus.orbits.orbit import PeriodicOrbit

__all__ = ["rooted_modes"]

_ROOT_PLACES = (1e-12, 1e-8, 1e-6)  # times behind the begin of a segment, over the period, that tell a root there


def rooted_modes(orbit: PeriodicOrbit) -> list[str]:
    """Return the modes in which a segment of an orbit begins at a root of the field: where its slope is infinite."""
    found = []
    for part in orbit.segments:
        rate = orbit.system.field(part.mode, part.state, parameters=orbit.parameters)
        here, near, far = (
            orbit.system.field(part.mode, part.state + share * orbit.period * rate, parameters=orbit.parameters)
            for share in _ROOT_PLACES
        )
        small, large = (float(np.max(np.abs(there - here))) for there in (near, far))
        if 0.0 < large < small * (_ROOT_PLACES[2] / _ROOT_PLACES[1]) ** ROOT_ORDER:
            found.append(part.mode)
    return list(dict.fromkeys(found))
