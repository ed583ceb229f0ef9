"""Why a motion of a sweep is unresolved, in words: what grows without end, what was lost below all doubles."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus.flow.shares import shares_of
from saltus.flow.starting import passed_event
from saltus.scales import SMALLEST
from saltus.system import HybridSystem

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.flow.poincare import PoincareReturns
    from saltus.flow.recurring.criteria import Criteria
    from saltus.system import Map

__all__ = ["lost", "never_settles"]


def never_settles(
    system: HybridSystem | Map, p: NDArray[np.float64], found: PoincareReturns, criteria: Criteria
) -> str:
    """Return in words what shows that a motion goes on for ever as it does; nothing where nothing shows it."""
    growing = _growing(system, found.states, criteria)
    if growing is None:
        return ""
    name, change, returns = growing
    every = "return" if returns == 1 else f"{returns} returns"
    words = f"{name} changes by {change:.6g} every {every}, always alike: a larger discard or keep tells no more"
    if isinstance(system, HybridSystem):
        mode = found.mode_end
        event = passed_event(system, mode, found.x_end, p)
        if event:
            words += f"; in mode {system.mode_names[mode]!r} it is beyond event {event!r}, which it does not meet again"
    return words


def _growing(
    system: HybridSystem | Map, states: NDArray[np.float64], criteria: Criteria
) -> tuple[str, float, int] | None:
    """Return the state that changes most and always alike, by how much, and in how many returns; None for none."""
    found: list[tuple[float, str, float, int]] = []
    for e, name in enumerate(system.states):
        if e in system.angle_places:
            continue
        for returns in range(1, min(criteria.longest, len(states) // 4) + 1):
            changes = states[returns:, e] - states[:-returns, e]
            mean = float(changes.mean())
            if mean and np.ptp(changes) <= criteria.recurrence * abs(mean):
                found.append((-abs(mean) / returns, name, mean, returns))
                break
    return min(found)[1:] if found else None


def lost(
    system: HybridSystem | Map, p: NDArray[np.float64], start: NDArray[np.float64], end: tuple[NDArray[np.float64], int]
) -> str:
    """Return in words that states fell below all doubles where they would grow again; nothing where none did.

    Parameters
    ----------
    start : ndarray, shape (all states,)
        Where the motion began.
    end : (ndarray, int)
        State and mode at its end.
    """
    x, mode = end
    if not isinstance(system, HybridSystem) or not np.all(np.isfinite(x)):
        return ""
    compiled = system.compiled
    rates = np.diag(compiled.linearised(mode, np.ascontiguousarray(x), compiled.extended(p))[1])
    count = len(system.states)
    gone = (shares_of(compiled, p) == 0.0) & (np.abs(x) < SMALLEST) & (rates > 0.0)
    names = [
        name for name, is_gone in zip(system.states, gone[:count] & (start[:count] != 0.0), strict=True) if is_gone
    ]
    if not names:
        return ""
    which = ", ".join(names)
    fell = f"{which} fell below the least double, {SMALLEST:.2g}, where growth would begin again"
    return f"{fell}: returns become ever rarer, as near a heteroclinic cycle, and no double follows the rest"
