"""Whether residuals with known standard errors may be noise: the probability of chi2, and neighbours that agree."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from saltus.fitting.search import largest_chi2

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["misfit_of"]

_CHANCE = 1e-3  # probability of chi2 below which data do not fit
_ALIKE = 3.1  # agreement of neighbouring residuals, in its standard deviations, above which data do not fit
_WILDEST = 3.0  # residual in standard errors up to which it counts in the agreement of neighbours


def misfit_of(residuals: Sequence[NDArray[np.float64]], free: int) -> str:
    """Return in words why residuals with known standard errors are no noise; empty where they may be.

    Parameters
    ----------
    residuals : sequence of ndarray
        Residuals in the order along each way; the last array has no order.
    free : int
        Parameters that were fitted.

    Examples
    --------
    >>> misfit_of([np.tile([1.0, -1.0], 50), np.zeros(0)], 2)
    ''
    >>> misfit_of([np.repeat([1.0, -1.0], 50), np.zeros(0)], 2)
    'neighbouring residuals agree by 9.75 standard deviations more than chance, at chi2/n = 1: ...

    References
    ----------
    Box and Pierce, J. Amer. Statist. Assoc. 65 (1970) 1509-1526 (autocorrelation of residuals): of independent
    residuals of unit variance, the sum of the products of n pairs of neighbours has mean 0 and variance n.
    """
    from scipy.special import chdtrc  # the import of scipy.stats takes .6 s

    every = np.concatenate(residuals)
    total, size = float(every @ every), max(every.size, 1)
    limit = largest_chi2(size)
    if total > limit * size:
        return f"chi2/n = {total / size:.3g} is above {limit:.3g}"
    chance = float(chdtrc(max(size - free, 1), total))
    if chance < _CHANCE:
        return f"chi2/n = {total / size:.3g} has a probability of {chance:.1g} by these standard errors"
    bounded = [np.clip(one, -_WILDEST, _WILDEST) for one in residuals[:-1]]
    pairs = sum(max(one.size - 1, 0) for one in bounded)
    alike = sum(float(one[1:] @ one[:-1]) for one in bounded) / math.sqrt(max(pairs, 1))
    if alike > _ALIKE:
        return (
            f"neighbouring residuals agree by {alike:.3g} standard deviations more than chance, at chi2/n ="
            f" {total / size:.3g}: the model is off by more than noise"
        )
    return ""
