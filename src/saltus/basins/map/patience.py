"""Default number of periods for which motions from a grid are followed, from the slowest decay to an attractor.

Near an attractor, distances from it shrink by a factor m a period, the modulus of its largest multiplier. Let the
farthest corner of the grid be R times as far away as the trapping region reaches. A motion from there that decays at
the same rate all the way is in the region after ``log R / -log m`` periods.
"""

from __future__ import annotations

import math
import sys
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from numpy.typing import NDArray

    from saltus.ensemble.traps import Traps

__all__ = ["NEARER", "Patience", "approach", "decay_periods", "patience_again", "patience_for"]

_LEAST = 200  # default periods that motions are followed, at least
_MOST = 100_000  # the same, at most

_SAFETY = 4.0  # periods followed over those of the slowest linear decay: saddles and nonlinear decay take longer

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

    It is four times the larger of two numbers, and between 200 and 100 000. The first is the periods of the slowest
    decay from the farthest corner of the box into a trapping region. The second is the periods of the slowest motion of
    the search.

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
    if longest.periods > _MOST:
        return Patience(_MOST, f"the most by default, less than {longest.reason}")
    return longest


def _times(periods: float, what: str) -> Patience:
    return Patience(math.ceil(_SAFETY * periods), f"{_SAFETY:g} times {what}")


def patience_again(longest: int, decays: Iterable[float]) -> int:
    """Return how long motions are followed where labels are checked, which were followed for `longest` periods.

    It is long enough for each to come as much nearer to its attractor as the regions are smaller there.
    """
    return max(_LONGER * longest, _LEAST) + max((min(approach(decay), _MOST) for decay in decays), default=0)


def approach(decay: float) -> int:
    """Return after how many periods, at most, motions that decay by a factor a period are nearer by `NEARER`."""
    if not 0.0 < decay < 1.0:
        return 0 if decay < 1.0 else sys.maxsize
    return math.ceil(_SAFETY * math.log(NEARER) / -math.log(decay))


def decay_periods(traps: Traps, label: int, decay: float, low: NDArray[np.float64], high: NDArray[np.float64]) -> float:
    """Return the periods of the linear decay from a box's farthest corner into an attractor's trapping region.

    Parameters
    ----------
    traps : Traps
        Trapping regions; the attractor's ellipsoid, cage or boxes count.
    decay : float
        Factor by which distances from the attractor shrink in a period.
    low, high : ndarray, shape (n,)
        The box.
    """
    ratios = []
    if (e := traps.ellipsoids) is not None:
        for k in np.flatnonzero(e.labels == label):
            reach = np.maximum(np.abs(low - e.centres[k]), np.abs(high - e.centres[k]))
            farthest = float((np.linalg.norm(e.shapes[k], axis=0) * reach).sum())
            lengths = np.linalg.norm(np.linalg.solve(e.shapes[k].T, e.normals[k].T), axis=0)
            cut = lengths > 0.0
            ratios.append(farthest / min(1.0, float((e.offsets[k][cut] / lengths[cut]).min(initial=1.0))))
    if not ratios and (c := traps.cages) is not None:
        for k in np.flatnonzero(c.labels == label):
            reach = np.maximum(np.abs(low - c.centres[k]), np.abs(high - c.centres[k]))
            ratios.append(float((np.abs(c.rows[k]) @ reach).sum() / c.bounds[k]))
    if not ratios and (boxes := traps.cells) is not None and (boxes.labels == label).any():
        ratios.append(float(((high - low) / boxes.size).max()))
    return math.log(max(ratios, default=1.0)) / -math.log(decay) if max(ratios, default=1.0) > 1.0 else 0.0
