"""How many strobes a slow approach to an attractor takes."""

from __future__ import annotations

import math
import sys
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.ensemble.traps import Traps

__all__ = ["SAFETY", "WORTH", "approach", "decay_periods"]

SAFETY = 4.0  # strobes followed over those of the linear decay: saddles and nonlinear decay take longer

WORTH = 4_000_000  # strobes that an approach may take at most: a decay by 0.99999 takes this from afar


def approach(decay: float, times: float) -> int:
    """Return after how many strobes, at most, motions that decay by a factor a strobe are so many times nearer.

    0 where the decay is not known, which NaN says; no end where nothing decays.
    """
    if not 0.0 < decay < 1.0 or times <= 1.0:
        return sys.maxsize if decay >= 1.0 else 0
    return math.ceil(SAFETY * math.log(times) / -math.log(decay))


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
