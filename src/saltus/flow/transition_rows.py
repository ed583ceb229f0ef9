"""What kernels are told of a system's transitions besides source, target and direction."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus.system.once import once
from saltus.system.parts import at_phases

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.system.hybrid import HybridSystem

__all__ = ["clocks", "ends_of", "jumps_at_phase_zero", "opposites"]


@once
def ends_of(system: HybridSystem) -> NDArray[np.int64]:
    """Return source, target and direction of each transition, shape (transitions, 3)."""
    index = {name: i for i, name in enumerate(system.mode_names)}
    rows = [[index[t.source], index[t.target], t.direction] for t in system.transitions]
    return np.array(rows, dtype=np.int64).reshape(len(rows), 3)


@once
def clocks(system: HybridSystem) -> NDArray[np.int64]:
    """Return the first transition with the same event function of the phase alone; -1 for other events."""
    texts = [transition.event for transition in system.transitions]
    return np.array(
        [texts.index(t.event) if at_phases(system, t) else -1 for t in system.transitions], dtype=np.int64
    )  # fmt: skip


@once
def opposites(system: HybridSystem) -> NDArray[np.int64]:
    """Return for a way out of a mode that slides the way out to the other side; -1 for other transitions."""
    found = np.full(len(system.transitions), -1)
    surfaces = {mode.surface for mode in system.modes.values() if mode.surface is not None}
    if not surfaces:
        return found
    for name, mode in system.modes.items():
        ways = [k for k, t in enumerate(system.transitions) if t.source == name and t.event not in surfaces]
        if mode.surface is not None and len(ways) == 2:
            found[ways] = ways[::-1]
    return found


def jumps_at_phase_zero(system: HybridSystem, p: NDArray[np.float64]) -> bool:
    """Return whether an event of the phase alone happens at phase 0, as far as the strobe resolves it."""
    from saltus.flow.kernels.state import AT_WRAP

    out, extended = np.empty(2), system.compiled.extended(p)
    for k, transition in enumerate(system.transitions):
        if at_phases(system, transition):
            x = np.zeros(len(system.all_states))
            rate = float(system.compiled.field(system.mode_index(transition.source), x, p)[-1])
            system.compiled.call("event", k, 0, x, extended, out)
            if abs(rate * out[0]) <= AT_WRAP * abs(out[1]) and transition.direction * out[1] >= 0.0:
                return True
    return False
