"""Rows of one distance that contradict each other."""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from saltus.fitting.repeated import APART, TOLD, rows_of_one_place

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.afm.reconstruction.observed import Observed

__all__ = ["contradictions"]


def contradictions(observed: Observed, errors: NDArray[np.float64]) -> list[str]:
    """Return in words which rows of one distance differ by more than noise.

    Parameters
    ----------
    observed : Observed
        The data.
    errors : ndarray, shape (datum,)
        Standard errors of the reduced shifts, which count where those of readings are not known.
    """
    size = np.sqrt(np.sum(observed.changed[:, 1] ** 2, axis=0))
    errors = np.sqrt(np.sum(observed.changed[:, 2] ** 2, axis=0)) if len(observed.changed) else errors
    pairs = []
    for rows in rows_of_one_place(observed.centre.tolist()):
        for first, second in combinations(sorted(rows, key=observed.row.__getitem__), 2):
            both = [first, second]
            shift = abs(float(np.diff(observed.shift[both])[0])) / float(np.hypot(*errors[both]))
            spread = float(np.hypot(*size[both]))
            amplitude = abs(float(np.diff(observed.amplitude[both])[0])) / spread if spread else 0.0
            if max(shift, amplitude) > APART:
                pairs.append((observed.centre[first], *observed.row[both].tolist(), max(shift, amplitude)))
    if not pairs:
        return []
    told = [f"{first} and {second} (Zc_nm = {Zc:.9g}, by {apart:.3g})" for Zc, first, second, apart in pairs[:TOLD]]
    more = f", and {len(pairs) - TOLD} more pairs" if len(pairs) > TOLD else ""
    return [f"rows of one distance differ by many standard errors: {', '.join(told)}{more}; two motions, or wrong rows"]
