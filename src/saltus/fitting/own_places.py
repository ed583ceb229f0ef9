"""The best fit in which each datum is compared with sheets that exist at its own place.

A search begins more leniently: a datum may be compared with the last orbits of a sheet that ends before it. So the
sheet is drawn to its data. Where it does not reach them in the end, either is tried: the sheet is drawn out to the
datum, or the datum is left to the sheet that exists there.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus.errors import ConvergenceError, InputError
from saltus.fitting.limits import Linear
from saltus.fitting.optimum import Minimum, Objective, covariance, minimised, total_loss

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["at_own_places"]

_PULLS = 8  # times that sheets are drawn nearer to data beyond them, at most
_FINER = 0.5  # distance from a sheet that costs one standard error, over the distance that was left
_ROUNDS = 6  # steps along walls, at most
_SHARES = (1.0, 0.5, 0.1)  # of a step along walls, tried one after the other
_FALL = 1e-2  # fall of the loss that is more than the search's accuracy


def at_own_places(objective: Objective, found: Minimum, bounds: NDArray[np.float64], most: int) -> Minimum:
    """Return the best fit without data beyond the ends of their sheets, where other sheets exist.

    From then on the objective compares data so.

    Parameters
    ----------
    objective : Objective
        The residuals.
    found : Minimum
        Where a lenient search ended.
    bounds : ndarray
        As `minimised` takes them.
    most : int
        Evaluations of each search, at most.

    Raises
    ------
    ConvergenceError
        The model cannot be compared with the data so.
    """
    if found.is_interrupted or (not found.evaluation.overhang and not found.evaluation.beyond.any()):
        objective.allowance = 0.0
        return found
    starts = [found.values]
    if found.evaluation.overhang:
        starts.append(_drawn_out(objective, found, bounds, most))
    objective.allowance = 0.0
    tried: list[Minimum] = []
    failed: Exception | None = None
    for start in starts:
        objective.best = None
        try:
            tried.append(minimised(objective, start, bounds, most=most))
        except (ConvergenceError, InputError) as error:
            failed = error
            continue
        if tried[-1].is_interrupted:
            break
    if not tried:
        assert failed is not None
        raise failed
    best = min(tried, key=lambda one: one.loss)
    return best if best.is_interrupted else _along_walls(objective, best, bounds, most)


def _drawn_out(objective: Objective, found: Minimum, bounds: NDArray[np.float64], most: int) -> NDArray[np.float64]:
    """Return parameters at which sheets reach the data that lie on their continuation, as far as they can be drawn."""
    for _ in range(_PULLS):
        overhang = found.evaluation.overhang
        objective.allowance, objective.best = _FINER * overhang, None
        try:
            nearer = minimised(objective, found.values, bounds, most=most)
        except (ConvergenceError, InputError):
            break  # what lies nearer has no derivatives: the last one is a start as well
        found = nearer
        if found.is_interrupted or not 0.0 < found.evaluation.overhang < overhang:
            break
    return found.values


def _along_walls(objective: Objective, found: Minimum, bounds: NDArray[np.float64], most: int) -> Minimum:
    """Return the best fit reached by steps along the ends of sheets, at which a trust region comes to rest."""
    for _ in range(_ROUNDS):
        spread = covariance(found.evaluation.jacobian, found.evaluation.residuals)
        change, fall = Linear(found.evaluation, found.values, bounds, spread).least
        if fall <= _FALL:
            return found
        for share in _SHARES:
            there = np.clip(found.values + share * change, *bounds)
            try:
                loss = total_loss(objective.at(there).residuals)
            except (ConvergenceError, InputError):
                continue  # a shorter step may be followed
            if loss < found.loss - _FALL:
                break
        else:
            return found
        found = minimised(objective, there, bounds, most=most)
        if found.is_interrupted:
            return found
    return found
