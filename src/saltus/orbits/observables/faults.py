"""Why an orbit is not admissible, in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus.flow.starting import told_root
from saltus.orbits.signature import FAULTS, ROOT

if TYPE_CHECKING:
    from collections.abc import Callable

    from saltus.flow.stretch import Motion

__all__ = ["MOST_FAULTS", "told_faults"]

MOST_FAULTS = sum(bit for bit, _ in FAULTS)  # all bits of `PeriodicOrbit.faults`


def told_faults(faults: int, motion: Callable[[], Motion]) -> tuple[str, ...]:
    """Return in words what the bits of a survey say; `motion` returns the orbit's, which shows where a root is."""
    told = {bit: text for bit, text in FAULTS if faults & bit}
    if ROOT in told:
        told[ROOT] = _told_root(motion())
    return tuple(told.values())


def _told_root(motion: Motion) -> str:
    """Return in words which argument of a root is negative along a motion, at the worst of some places."""
    system, out = motion.system, np.empty(1)
    compiled = system.compiled
    p = compiled.extended(system.parameter_vector(motion.parameters))
    first = len(system.modes) + len(system.transitions)
    least, worst = 0.0, None
    for part in np.linspace(0.0, 1.0, 5).tolist():
        at = np.arange(motion.modes.size)
        for mode, x in zip(motion.modes.tolist(), motion.states(at, np.full(at.size, part)), strict=True):
            compiled.call("guard", first + mode, 0, np.ascontiguousarray(x), p, out)
            if out[0] < least:
                least, worst = float(out[0]), (mode, x)
    return dict(FAULTS)[ROOT] if worst is None else told_root(system, *worst, p)
