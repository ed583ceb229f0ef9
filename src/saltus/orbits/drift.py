"""Motions that drift: some states grow by the same amount at each return, and all others recur."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.scales import GROWTHS_EVEN, GROWTHS_SAMPLED, RECURS, STATE_ROUNDED, WHOLE_TURNS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.system import HybridSystem

__all__ = ["drift_of", "drift_of_samples"]

_LONGEST = 16  # returns after which a state has grown by the same amount again, at the most
_FEWEST = 8  # such growths that are compared, at the least


def drift_of(
    system: HybridSystem, returns: NDArray[np.float64], sizes: NDArray[np.float64], even: float = GROWTHS_EVEN
) -> str | None:
    """Return words for a motion that drifts along some states; None for one that does not.

    Parameters
    ----------
    system : HybridSystem
        Its angles do not count: they are expected to grow.
    returns : ndarray, shape (returns, states)
        States at returns in order.
    sizes : ndarray, shape (states,)
        Sizes of the states.
    even : float, optional
        Difference of two growths over their mean, up to which they are one.
    """
    straight = np.setdiff1d(np.arange(len(system.states)), system.angle_places)
    names, returns, sizes = [system.states[i] for i in straight], returns[:, straight], sizes[straight]
    rounding = STATE_ROUNDED * np.abs(returns).max(axis=0, initial=0.0)
    for apart in range(1, min(_LONGEST, len(returns) - _FEWEST) + 1):
        growths = returns[apart:] - returns[:-apart]
        mean, spread = growths.mean(axis=0), np.ptp(growths, axis=0)
        drifts = (np.abs(mean) > _FEWEST * rounding) & (spread <= even * np.abs(mean) + rounding)
        if np.any(drifts) and np.all(drifts | (np.abs(growths).max(axis=0) <= RECURS * sizes)):
            return _told([names[i] for i in np.flatnonzero(drifts)], mean[drifts].tolist(), apart)
    return None


def drift_of_samples(system: HybridSystem, states: NDArray[np.float64], sizes: NDArray[np.float64]) -> str | None:
    """Return what `drift_of` does for a motion without events, from samples in order, shape (samples, states).

    Returns are the maxima of the state that goes up and down most, for its size.
    """
    steps = np.diff(states, axis=0)
    ways = np.abs(steps).sum(axis=0)
    turns = ways > 1.5 * np.abs(states[-1] - states[0])
    if not np.any(turns):
        return None
    clock = int(np.argmax(np.where(turns, ways / sizes, 0.0)))
    tops = 1 + np.flatnonzero((steps[:-1, clock] > 0.0) & (steps[1:, clock] <= 0.0))
    return drift_of(system, states[tops], sizes, GROWTHS_SAMPLED) if tops.size else None


def _told(names: list[str], growths: list[float], apart: int) -> str:
    """Return the words for states that grow in so many returns."""
    each = ", ".join(f"{name} by {growth:.6g}" for name, growth in zip(names, growths, strict=True))
    when = "at each return" if apart == 1 else f"in each {apart} returns"
    turns = [growth / (2.0 * math.pi) for growth in growths]
    if all(abs(turn - round(turn)) <= WHOLE_TURNS and round(turn) for turn in turns):
        hint = f"name what lies on a circle, angles={(*names,)!r}"
    else:
        hint = "an orbit closes in states that do not drift, as in differences of those that drift alike"
    return f"the motion drifts ({each} {when}), and all else recurs: {hint}"
