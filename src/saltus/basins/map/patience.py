"""Default number of periods for which motions from a grid are followed, from the slowest decay to an attractor.

Near an attractor, distances from it shrink by a factor m a period, the modulus of its largest multiplier. Let the
farthest corner of the grid be R times as far away as the trapping region reaches. A motion from there that decays at
the same rate all the way is in the region after ``log R / -log m`` periods.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from saltus.basins.attractors.pace import SAFETY, WORTH, approach, decay_periods

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

__all__ = ["NEARER", "Patience", "decay_periods", "patience_again", "patience_for"]

_LEAST = 200  # default periods that motions are followed, at least
_MOST = 100_000  # the same, at most, where the decay is too slow for any motion to arrive

# factors by which trapping regions shrink where labels are checked, down to `SAME`: what else a region holds is found
# unless it lies in the region's innermost part
NEARER = 1e4
LEAST_NEARER = 10.0
_LONGER = 2  # factor by which motions are then followed longer, their approach to the attractor aside


class Patience(NamedTuple):
    """How long motions are followed."""

    periods: int  # periods, or intervals between strobes, after which a motion is undecided
    reason: str  # reason for the number, in words


def patience_for(attractors: Any, box: Mapping[str, tuple[float, float]]) -> Patience:
    """Return how long motions from a box are followed by default.

    It is four times the larger of two numbers, at least 200, at most 4 000 000. Where that is not even once as long, it
    is 100 000. The first number is the periods of the slowest decay from the farthest corner of the box into a trapping
    region. The second is the periods of the slowest motion of the search.

    Parameters
    ----------
    attractors : Attractors
        Attractors of the motions.
    box : mapping of str to (float, float)
        Interval in which motions start, for each state in the system's order.
    """
    found = [Patience(_LEAST, "the least")]
    slowest = int(getattr(attractors, "slowest", 0))
    found.append(_times(slowest, f"the {slowest} periods that the slowest motion of the search took"))
    low, high = np.array(list(box.values()), dtype=np.float64).T
    for name, decay in getattr(attractors, "decays", {}).items():
        if not 0.0 < decay < 1.0:
            continue
        count = decay_periods(attractors.traps, attractors.labels[name], decay, low, high)
        what = f"the {count:.4g} periods in which the grid's farthest corner decays into the trap of {name!r}"
        found.append(_times(count, f"{what}, by {decay:.6g} a period"))
    longest = max(found, key=lambda patience: patience.periods)
    if longest.periods > WORTH:
        return Patience(_MOST, f"the most by default, less than {longest.reason}")
    return longest


def _times(periods: float, what: str) -> Patience:
    longest = math.ceil(SAFETY * periods)
    return Patience(min(longest, WORTH) if periods <= WORTH else longest, f"{SAFETY:g} times {what}")


def patience_again(longest: int, decays: Iterable[float]) -> int:
    """Return how long motions are followed where labels are checked, which were followed for `longest` periods.

    It is long enough for each to come as much nearer to its attractor as the regions are smaller there.
    """
    return max(_LONGER * longest, _LEAST) + max((min(approach(decay, NEARER), WORTH) for decay in decays), default=0)
