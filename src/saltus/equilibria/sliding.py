"""Sliding fields that are Filippov's combination of the fields on both sides: the rates of which it is made."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from saltus.scales import WRITTEN
from saltus.system.once import once

if TYPE_CHECKING:
    from saltus.system.hybrid import HybridSystem

__all__ = ["Sides", "sides_of"]

_PLACES = 3  # at which the field is compared with the combination


class Sides(NamedTuple):
    """Modes above and below the surface h = 0 of a sliding mode, and the transitions with its rates as event functions.

    The sliding field is (L- f+ - L+ f-)/(L- - L+), with the rates L+ and L- of h along the fields f+ and f-.
    """

    above: int
    below: int
    rise: int  # the event function is L+
    fall: int  # L-
    surface: int  # h, of a transition into the mode


@once
def sides_of(system: HybridSystem, mode: int) -> Sides | None:
    """Return both sides of a mode that slides along one surface; None of other modes, and where the field is no 0/0.

    The domain of a mode whose field may be 0/0 is the denominator: `filippov` leaves out one of known sign.
    """
    name = system.mode_names[mode]
    own = system.modes[name]
    if own.surface is None or own.domain is None or system.laws:
        return None
    onto = [k for k, t in enumerate(system.transitions) if t.target == name and t.event == own.surface]
    ways = [(k, t) for k, t in enumerate(system.transitions) if t.source == name and t.event != own.surface]
    for rise in (k for k, t in ways if t.direction == 1):
        for fall in (k for k, t in ways if t.direction == -1):
            above, below = (system.mode_index(system.transitions[k].target) for k in (rise, fall))
            found = Sides(above, below, rise, fall, *onto[:1]) if onto else None
            if found is not None and _combines(system, mode, found):
                return found
    return None


def _combines(system: HybridSystem, mode: int, sides: Sides) -> bool:
    """Return whether a mode's field, times its domain function, is Filippov's combination but for what pulls it back.

    A part along the surface's normal pulls a motion back to the surface. Formulas that agree at places drawn without a
    rule are the same.
    """
    p = np.array([*system.parameters.values()], dtype=np.float64)
    extended, n = system.compiled.extended(p), len(system.all_states)
    rng = np.random.default_rng(mode)
    compared = 0
    for _ in range(4 * _PLACES):
        x = rng.uniform(-1.5, 1.5, n)
        heights, domain = [], np.empty(1)
        for k in (sides.rise, sides.fall, sides.surface):
            out = np.empty(2 + 2 * n)
            system.compiled.call("event_x", k, 0, x, extended, out)
            heights.append(out)
        (rise, fall, _), normal = (float(out[0]) for out in heights), heights[2][2 : 2 + n]
        system.compiled.call("guard", mode, 0, x, extended, domain)
        own, up, down = (system.compiled.field(i, x, p) for i in (mode, sides.above, sides.below))
        parts = np.array([domain[0] * own, fall * up, rise * down])
        apart = parts[0] - parts[1] + parts[2]
        if not np.all(np.isfinite(apart)) or domain[0] == 0.0:
            continue
        if abs(domain[0] - fall + rise) > WRITTEN * (abs(fall) + abs(rise)):
            return False
        apart -= normal * float(normal @ apart) / float(normal @ normal)
        if np.any(np.abs(apart) > WRITTEN * np.abs(parts).max()):
            return False
        compared += 1
        if compared == _PLACES:
            return True
    return False
