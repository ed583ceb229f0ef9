"""Which unknown of a measurement, beside those that were varied, would explain data that do not fit."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from saltus.errors import ConvergenceError, InputError
from saltus.fitting.evaluation import Evaluation
from saltus.fitting.optimum import is_held, loss_weights

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.fitting.instrument import Instrument

__all__ = ["falls", "remedy_of"]

_SURE = 10.0  # fall of chi2 from which an unknown is named: noise gives it once in 600 times
_WORTH = 0.3  # fall of chi2, over what exceeds one for each datum, from which an unknown is named
_NULL = 1e-6  # part of an unknown that the varied parameters leave, over the whole, below which it is one of theirs


def falls(
    residuals: NDArray[np.float64], varied: NDArray[np.float64], others: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return by how much chi2 would fall for each further unknown, and the steps that the unknowns take.

    Each is one Gauss-Newton step of the varied parameters and of one unknown. Residuals weigh as in the loss.

    Parameters
    ----------
    residuals : ndarray, shape (residuals,)
        Those of the best fit.
    varied, others : ndarray, shapes (residuals, parameters) and (residuals, unknowns)
        Their derivatives.

    Examples
    --------
    >>> x = np.linspace(0.0, 1.0, 5)
    >>> fall, step = falls(1e-3 * (x - 0.5), np.ones((5, 1)), x[:, None])
    >>> round(float(fall[0]) / 6.25e-7, 6), round(float(step[0]), 9)
    (1.0, -0.001)
    """
    roots = np.sqrt(loss_weights(residuals))
    seen, known, further = residuals * roots, varied * roots[:, None], others * roots[:, None]
    basis, sizes, _ = np.linalg.svd(known, full_matrices=False)
    basis = basis[:, sizes > _NULL * max(sizes.max(initial=0.0), 1e-300)]
    left = further - basis @ (basis.T @ further)
    rest = seen - basis @ (basis.T @ seen)
    lengths = np.linalg.norm(left, axis=0)
    own = lengths > _NULL * np.linalg.norm(further, axis=0)
    steps = np.where(own, -(rest @ left) / np.where(own, lengths, 1.0) ** 2, 0.0)
    return np.asarray((steps * lengths) ** 2), steps


def remedy_of(found: Evaluation, values: NDArray[np.float64], bounds: NDArray[np.float64], whole: Instrument) -> str:
    """Return in words which unknowns of the measurement would lower chi2 most; empty where none would by much.

    Parameters
    ----------
    found : Evaluation
        The data against the model at the best values.
    values, bounds : ndarray, shapes (vary,) and (2, vary)
        The best values of the varied parameters, and their limits.
    whole : Instrument
        All unknowns that the measurement may have.
    """
    candidates = tuple(name for name in whole.names if name not in found.names)
    if not candidates:
        return ""
    names = (*found.names, *candidates)
    known = replace(whole, values={name: found.instrument.value(name) for name in found.names})
    try:
        beforehand = _with_more(found, len(candidates))
        wide = Evaluation(found.measured, found.branches, names, beforehand, known, found.allowance)
        residuals, jacobian = wide.residuals, wide.jacobian
    except (ConvergenceError, InputError) as error:
        return f"whether {' or '.join(candidates)} would help is not known: {error}"
    count = len(found.names)
    free = ~is_held(values, bounds, (loss_weights(residuals) * residuals) @ jacobian[:, :count])
    lower, steps = falls(residuals, jacobian[:, :count][:, free], jacobian[:, count:])
    total = float(loss_weights(residuals) @ residuals**2)
    least = max(_SURE, _WORTH * (total - residuals.size))
    there = [known.value(name) + step for name, step in zip(candidates, steps.tolist(), strict=True)]
    told = [
        f"{candidates[k]} (near {there[k]:.3g}, chi2 lower by {100.0 * lower[k] / total:.0f} %)"
        for k in np.argsort(-lower).tolist()
        if lower[k] >= least and (candidates[k] != whole.gain or there[k] > 0.0)
    ]
    return f"by a linear estimate it helps to vary {' or '.join(told)}" if told else ""


def _with_more(found: Evaluation, more: int) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """Return what is known beforehand, with further parameters on which nothing of it depends."""
    if found.beforehand is None:
        return None
    residuals, slopes = found.beforehand
    return residuals, np.hstack([slopes, np.zeros((len(slopes), more))])
