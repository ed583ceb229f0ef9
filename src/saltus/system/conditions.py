"""Conditions of transitions that tell no more than their directions do."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from saltus.system.derivatives import Symbolic
from saltus.system.expansion import proportional

if TYPE_CHECKING:
    from saltus.system.definition import Definition

__all__ = ["velocity_conditions"]


def velocity_conditions(system: Definition) -> frozenset[int]:
    """Return the indices of the transitions whose condition is the speed at which the event's surface is crossed.

    An example is ``when="v"`` of an event ``x - d`` upwards, where ``x' = v``. Such a condition holds at each crossing
    in the event's direction. It matters only where a motion lands beyond the surface.
    """
    found = set()
    conditional = [k for k, transition in enumerate(system.transitions) if transition.when is not None]
    if not any(system.transitions[k].direction for k in conditional):
        return frozenset()
    symbolic = Symbolic(system)
    values = dict(zip(symbolic.p, system.parameters.values(), strict=True))
    for k in conditional:
        speed, when = system.transitions[k].direction * symbolic.rate[k], symbolic.when[k]
        if speed != 0 and proportional(speed, when, set(symbolic.x)):
            places = [{x: math.pi / (3 + i + 5 * j) for i, x in enumerate(symbolic.x)} for j in range(3)]
            ratios = [complex((speed / when).subs({**values, **place})) for place in places]
            if any(ratio.imag == 0.0 and math.isfinite(ratio.real) and ratio.real > 0.0 for ratio in ratios):
                found.add(k)
    return frozenset(found)
