"""Rows of one distance that contradict each other."""

from __future__ import annotations

from collections import defaultdict
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.afm.reconstruction.observed import Observed

__all__ = ["contradictions"]

_APART = 5.0  # difference of two rows, in standard errors, that is no noise
_TOLD = 3  # pairs that are told, at most


def contradictions(observed: Observed, errors: NDArray[np.float64]) -> list[str]:
    """Return in words which rows of one distance differ by more than noise.

    Parameters
    ----------
    observed : Observed
        The data.
    errors : ndarray, shape (datum,)
        Standard errors of the reduced shifts, which count where those of readings are not known.
    """
    places = defaultdict(list)
    for at, Zc in enumerate(observed.centre.tolist()):
        places[Zc].append(at)
    size = np.sqrt(np.sum(observed.changed[:, 1] ** 2, axis=0))
    errors = np.sqrt(np.sum(observed.changed[:, 2] ** 2, axis=0)) if len(observed.changed) else errors
    pairs = []
    for Zc, rows in places.items():
        for first, second in combinations(sorted(rows, key=observed.row.__getitem__), 2):
            both = [first, second]
            shift = abs(float(np.diff(observed.shift[both])[0])) / float(np.hypot(*errors[both]))
            spread = float(np.hypot(*size[both]))
            amplitude = abs(float(np.diff(observed.amplitude[both])[0])) / spread if spread else 0.0
            if max(shift, amplitude) > _APART:
                pairs.append((Zc, *observed.row[both].tolist(), max(shift, amplitude)))
    if not pairs:
        return []
    told = [f"{first} and {second} (Zc_nm = {Zc:.9g}, by {apart:.3g})" for Zc, first, second, apart in pairs[:_TOLD]]
    more = f", and {len(pairs) - _TOLD} more pairs" if len(pairs) > _TOLD else ""
    return [f"rows of one distance differ by many standard errors: {', '.join(told)}{more}; two motions, or wrong rows"]
