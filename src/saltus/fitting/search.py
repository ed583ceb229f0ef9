"""A search for the best fit that goes on from other starts where the data do not fit.

A trust region ends in the optimum whose valley it starts in. So chi2/n decides whether a search is over: with right
standard errors it is 1 within a few times sqrt(2/n).

References
----------
Roberts, "The unreasonable effectiveness of quasirandom sequences" (2018), extremelearning.com.au (the starts).
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from saltus.errors import ConvergenceError, InputError
from saltus.fitting.optimum import INTERRUPTED, Minimum, Objective, minimised

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["WILD", "fits", "largest_chi2", "searched"]

_FAR = 5.0  # excess of chi2/n over 1, in its standard deviations, from which the data do not fit
WILD = 0.05  # share of residuals, and at least those of one datum, that may be wild where all others fit
_LOOKED_AT = 6  # further starts whose loss is computed, for each parameter
_SEARCHED = 5  # of these the best ones from which a search is made
_ALIKE = 1e-2  # difference of the losses of two searches that ended at one optimum
_LEAST = 5  # evaluations that a further search needs, at least
_AGREEING = 2  # further searches that end at the best optimum, after which no more are made
_FACTOR = 3.0  # half of the further starts: the search's start times or over this, at most
_WIDE = 10.0  # greatest over least value, from which values between are chosen by their logarithm
_ANEW = 3  # times that a search goes on with sheets that appeared at its end, at most


def largest_chi2(count: int) -> float:
    """Return the chi2 per datum up to which data fit: 1 and five of its standard deviations.

    Examples
    --------
    >>> round(largest_chi2(200), 2)
    1.5
    """
    return 1.0 + _FAR * math.sqrt(2.0 / max(count, 1))


def searched(objective: Objective, start: NDArray[np.float64], bounds: NDArray[np.float64], most: int) -> Minimum:
    """Return the best fit, sought from a start; from further ones as long as the data do not fit, but a few wild ones.

    Parameters
    ----------
    start, bounds : ndarray
        As `minimised` takes them.
    most : int
        Evaluations of the first search, and of all further ones together, at most.

    Raises
    ------
    ConvergenceError
        As by `minimised`.
    """
    best = _from(objective, start, bounds, most)
    if best.is_interrupted or fits(best):
        return best
    searches, agreeing, ended = 1, 0, False
    try:
        places = _promising(objective, best.values, start, bounds)
        before = objective.evaluations
        for place in places:
            left = most - (objective.evaluations - before)
            if left < _LEAST:
                ended = True
                break
            try:
                found = _from(objective, place, bounds, left)
            except (ConvergenceError, InputError):
                continue  # what interpolation promised has no derivatives
            searches += 1
            agreeing = agreeing + 1 if abs(found.loss - best.loss) < _ALIKE else agreeing
            if found.loss < best.loss - _ALIKE:
                best, agreeing = found, 0
            if found.is_interrupted:
                return replace(best, stopped=found.stopped)
            if fits(best) or agreeing == _AGREEING:
                break
    except KeyboardInterrupt:
        return replace(best, stopped=INTERRUPTED)
    if fits(best):
        return best
    told = ", and no more evaluations are allowed" if ended else ""
    return replace(best, stopped=f"no better fit is found from {searches} starts{told}")


def fits(found: Minimum) -> bool:
    """Whether all data fit but a few wild ones, which no other start would mend."""
    residuals, rows = found.evaluation.residuals, found.evaluation.measured.rows
    kept = np.sort(np.abs(residuals))[: residuals.size - max(rows, int(WILD * residuals.size))]
    return float(kept @ kept) <= largest_chi2(residuals.size) * kept.size


def _from(objective: Objective, start: NDArray[np.float64], bounds: NDArray[np.float64], most: int) -> Minimum:
    """Return where a search ends; it goes on where the model traced anew has sheets that fit better."""
    if objective.best is None or not np.array_equal(objective.best[1], start):
        objective.best = None
        objective.anew(start)
    found = minimised(objective, start, bounds, most=most)
    for _ in range(_ANEW if objective.trace.whole is not None else 0):
        if found.is_interrupted:
            return found
        objective.anew(found.values)
        if objective.best is None or objective.best[0] > found.loss - _ALIKE:
            return found
        found = minimised(objective, found.values, bounds, most=most)
    return found


def _promising(
    objective: Objective, best: NDArray[np.float64], start: NDArray[np.float64], bounds: NDArray[np.float64]
) -> list[NDArray[np.float64]]:
    """Return further starts, the best first: half about the best fit and the start, half anywhere within the bounds."""
    size = len(start)
    ratio = 2.0
    for _ in range(64):
        ratio = (1.0 + ratio) ** (1.0 / (size + 1))
    steps = ratio ** -np.arange(1.0, size + 1.0)
    places = []
    for k in range(_LOOKED_AT * size):
        shares = (0.5 + (k + 1) * steps) % 1.0
        about = (start, best)[k // 2 % 2]
        low, high = bounds if k % 2 else _about(about, bounds)
        logarithmic = (low > 0.0) & (high > _WIDE * low) if k % 2 else low > 0.0
        with np.errstate(all="ignore"):
            places.append(np.where(logarithmic, low * (high / low) ** shares, low + shares * (high - low)))
    losses = [objective.rough_loss(place) for place in places]
    order = np.argsort(losses, kind="stable")
    return [places[k] for k in order[:_SEARCHED] if np.isfinite(losses[k])]


def _about(values: NDArray[np.float64], bounds: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return narrower bounds: values over and times a factor; those of 0 keep their bounds."""
    ends = np.sort(np.array([values / _FACTOR, values * _FACTOR]), axis=0)
    return np.where(values == 0.0, bounds, np.clip(ends, bounds[0], bounds[1]))
