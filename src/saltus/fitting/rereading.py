"""Whether data that do not fit would fit if columns were read otherwise, as phases in another convention."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from saltus.errors import ConvergenceError, InputError
from saltus.fitting.optimum import Minimum, Objective, minimised, total_loss
from saltus.fitting.search import largest_chi2
from saltus.progress import Reporter

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from numpy.typing import NDArray

    from saltus.fitting.measured import Measured

__all__ = ["Reading", "reread"]

_MOST = 30  # evaluations of a search, at most
_LOWER = 0.1  # chi2 over the one of the data as they are, below which a reading is named
_BETTER = 0.5  # the same of a reading that fits


class Reading(NamedTuple):
    """Another reading of columns: an offset and a factor on the numbers."""

    words: str  # the reading, as "lag_deg as 90 - lag_deg"
    columns: tuple[str, ...]
    offset: float
    factor: float

    def of(self, measured: Measured) -> Measured:
        """Return data that are read so."""
        channels = [
            replace(one, values=self.offset + self.factor * one.values, sigma=abs(self.factor) * one.sigma)
            if one.name in self.columns
            else one
            for one in measured.channels
        ]
        return replace(measured, channels=tuple(channels))


def reread(
    objective: Objective,
    found: Minimum,
    start: NDArray[np.float64],
    bounds: NDArray[np.float64],
    others: Sequence[Reading],
) -> str:
    """Return in words which other reading the data fit; empty where they fit none.

    The most promising one is searched from the best of three places: the start, the best fit of the data as they are,
    and the best fit of the columns that are not in question.

    Parameters
    ----------
    objective : Objective
        The data as they are.
    found : Minimum
        Their best fit.
    start, bounds : ndarray
        As `minimised` takes them.
    others : sequence of Reading
        Other readings.
    """
    if not others:
        return ""
    places = [found]
    for measured, most in ((objective.measured, 1), (_without(objective.measured, others[0].columns), _MOST)):
        if measured.channels and (place := _searched(objective, measured, start, bounds, most)) is not None:
            places.append(place)
    tried = [(_rough(place, one.of(objective.measured)), one, place) for one in others for place in places]
    _, best, place = min(tried, key=lambda one: one[0])
    there = _searched(objective, best.of(objective.measured), place.values, bounds, _MOST)
    if there is None:
        return ""
    before, after = (float(np.mean(one.evaluation.residuals**2)) for one in (found, there))
    fits = after <= largest_chi2(there.evaluation.residuals.size)
    if after < _LOWER * before or (fits and after < _BETTER * before):
        return (
            f"the data fit{'' if fits else ' better'} with {best.words}: chi2/n = {after:.3g} instead of {before:.3g}"
        )
    return ""


def _without(measured: Measured, columns: Collection[str]) -> Measured:
    """Return data without some columns."""
    return replace(measured, channels=tuple(one for one in measured.channels if one.name not in columns))


def _searched(
    objective: Objective, measured: Measured, start: NDArray[np.float64], bounds: NDArray[np.float64], most: int
) -> Minimum | None:
    """Return the best fit of other data from a start; None where the model has none there."""
    own = replace(objective, measured=measured, reporter=Reporter(False), best=None, failures=[])
    try:
        own.anew(start)
        return minimised(own, start, bounds, most=most)
    except (ConvergenceError, InputError):
        return None


def _rough(place: Minimum, measured: Measured) -> float:
    """Return the loss of other data against the model of a place, by interpolated observables."""
    try:
        return total_loss(replace(place.evaluation, measured=measured).rough)
    except ConvergenceError:
        return np.inf
