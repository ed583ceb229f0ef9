"""Least squares with exact derivatives: the best parameters, and what the data tell of them.

References
----------
Branch, Coleman and Li, SIAM J. Sci. Comput. 21 (1999) 1-23 (reflective trust region within bounds, by
`scipy.optimize.least_squares`); Triggs et al., LNCS 1883 (2000) 298-372 (robust losses); Venzon and Moolgavkar, Appl.
Statist. 37 (1988) 87-94 (profile likelihood).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from saltus.errors import ConvergenceError, InputError
from saltus.fitting.evaluation import Evaluation

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.fitting.measured import Measured
    from saltus.fitting.tracing import Trace
    from saltus.progress import Reporter

__all__ = ["Minimum", "Objective", "covariance", "degeneracies", "loss_weights", "minimised", "profiled", "total_loss"]

_LOSS = 3.0  # residual in standard errors from which the loss grows more slowly than its square
_SMALL = 1e-10  # relative change of the loss that ends the search
_STEP = 1e-9  # relative change of the parameters that ends the search
_NULL = 1e-6  # singular value over the largest, of relative changes, below which a combination has no effect
_SECANTS = 6  # steps of the secant method on one side of a profile, at most
_ONE = 0.02  # distance of a profile's square root from 1 that is taken as 1
_PART = 1e-2  # share of a parameter in a combination, below which it is left out in words


@dataclass
class Objective:
    """Residuals of data as a function of the varied parameters, with the best ones so far.

    Attributes
    ----------
    measured : Measured
        The data.
    trace : callable
        Returns branches at changed parameters.
    names : tuple of str
        Varied parameters.
    reporter : Reporter
        Who is told.
    best : (float, ndarray, Evaluation) or None
        Loss, parameters and evaluation of the best ones.
    failures : list of str
        Why parameters were refused.
    evaluations : int
        How often the model was compared with the data.
    refused : int
        How many of the last parameters were refused, one after the other.
    """

    measured: Measured
    trace: Trace
    names: tuple[str, ...]
    reporter: Reporter
    best: tuple[float, NDArray[np.float64], Evaluation] | None = None
    failures: list[str] = field(default_factory=list)
    evaluations: int = 0
    refused: int = 0

    def at(self, values: NDArray[np.float64]) -> Evaluation:
        """Return the data against the model at values of the parameters.

        Raises
        ------
        ConvergenceError
            The model has no branch or no derivative there.
        """
        if self.best is not None and np.array_equal(self.best[1], values):
            return self.best[2]
        changes = dict(zip(self.names, values.tolist(), strict=True))
        found = Evaluation(self.measured, tuple(self.trace(changes)), self.names)
        if not np.all(np.isfinite(found.jacobian)):
            raise ConvergenceError("derivatives of the residuals", np.inf, 0, "an end of a sheet has none")
        loss = total_loss(found.residuals)
        self.evaluations += 1
        self.refused = 0
        if self.best is None or loss < self.best[0]:
            self.best = loss, values.copy(), found
        told = ", ".join(f"{name} = {value:.6g}" for name, value in changes.items())
        chi2 = float(found.residuals @ found.residuals) / max(self.measured.count, 1)
        self.reporter.step(1, f"chi2/n = {chi2:.4g}, {told}")
        return found


@dataclass(frozen=True)
class Minimum:
    """Where a search ended.

    Attributes
    ----------
    values : ndarray, shape (parameters,)
        The best parameters.
    evaluation : Evaluation
        The data against the model there.
    loss : float
        Sum of the losses there.
    stopped : str
        Why the search ended.
    """

    values: NDArray[np.float64]
    evaluation: Evaluation
    loss: float
    stopped: str


def total_loss(residuals: NDArray[np.float64]) -> float:
    """Return the sum of soft-l1 losses, which are the squares of small residuals."""
    return float(2.0 * _LOSS**2 * np.sum(np.sqrt(1.0 + (residuals / _LOSS) ** 2) - 1.0))


def loss_weights(residuals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the weights that residuals have in the loss: 1 for small ones."""
    return np.asarray(1.0 / np.sqrt(1.0 + (residuals / _LOSS) ** 2))


def minimised(
    objective: Objective,
    start: NDArray[np.float64],
    bounds: NDArray[np.float64],
    *,
    fixed: Sequence[int] = (),
    most: int = 60,
) -> Minimum:
    """Return the parameters of least loss within bounds; an interrupt keeps the best so far.

    Parameters
    ----------
    objective : Objective
        The residuals.
    start : ndarray, shape (parameters,)
        Where the search starts.
    bounds : ndarray, shape (2, parameters)
        Least and greatest values.
    fixed : sequence of int, optional
        Parameters that keep their values.
    most : int, optional
        Evaluations at most.

    Raises
    ------
    ConvergenceError
        The model cannot be compared with the data at the start.
    """
    from scipy.optimize import least_squares

    free = [i for i in range(len(start)) if i not in fixed]
    if objective.best is not None and not np.array_equal(objective.best[1], start):
        objective.best = None
    known: dict[bytes, Evaluation] = {start[free].tobytes(): objective.at(start)}

    def evaluated(values: NDArray[np.float64]) -> Evaluation | None:
        if values.tobytes() not in known:
            whole = start.copy()
            whole[free] = values
            try:
                found = objective.at(whole)
            except (ConvergenceError, InputError) as error:
                objective.failures.append(str(error))
                objective.refused += 1
                return None
            known.clear()
            known[values.tobytes()] = found
        return known[values.tobytes()]

    def residuals(values: NDArray[np.float64]) -> NDArray[np.float64]:
        found = evaluated(values)
        return np.full(objective.measured.count, np.nan) if found is None else found.residuals

    def slopes(values: NDArray[np.float64]) -> NDArray[np.float64]:
        found = evaluated(values)
        assert found is not None  # derivatives are asked for only where residuals were found
        return found.jacobian[:, free]

    if not free:
        assert objective.best is not None
        return Minimum(start, objective.best[2], objective.best[0], "nothing is varied")
    low, high = bounds[:, free]
    inside = np.clip(start[free], low + 1e-9 * (high - low), high - 1e-9 * (high - low))
    sizes = np.maximum(np.abs(start[free]), 0.1 * (high - low))
    try:
        found = least_squares(
            residuals, inside, slopes, (low, high), x_scale=sizes, loss="soft_l1", f_scale=_LOSS,
            ftol=_SMALL, xtol=_STEP, gtol=None, max_nfev=most,
        )  # fmt: skip
        stopped = "no more evaluations are allowed" if found.status == 0 else "the optimum is found"
        if objective.refused:
            stopped = "the search ended where no further step can be followed: perhaps this is no optimum"
    except KeyboardInterrupt:
        stopped = "interrupted: the best so far"
    assert objective.best is not None
    loss, values, evaluation = objective.best
    return Minimum(values, evaluation, loss, stopped)


def covariance(jacobian: NDArray[np.float64], residuals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the covariance of the parameters by linear theory, shape (parameters, parameters).

    It is infinite for parameters that take part in a combination without effect.
    """
    weighted = jacobian * np.sqrt(loss_weights(residuals))[:, None]
    sizes = np.linalg.norm(weighted, axis=0)
    used = np.flatnonzero(sizes > 0.0)
    found = np.zeros((len(sizes), len(sizes)))
    lost = sizes == 0.0
    if used.size:
        _, values, right = np.linalg.svd(weighted[:, used] / sizes[used], full_matrices=False)
        good = values > _NULL * values[0]
        inverse = (right[good].T / values[good] ** 2) @ right[good]
        found[np.ix_(used, used)] = inverse / np.outer(sizes[used], sizes[used])
        lost[used] |= np.any(np.abs(right[~good]) > _PART, axis=0)
    found[lost, :] = found[:, lost] = 0.0
    found[lost, lost] = np.inf
    return found


def degeneracies(jacobian: NDArray[np.float64], values: NDArray[np.float64], names: Sequence[str]) -> tuple[str, ...]:
    """Return in words which changes of parameters leave all data as they are.

    Changes are relative to the values; ``H -2 %, R +2 %`` says that only the product of both is known.
    """
    scaled = jacobian * np.where(values == 0.0, 1.0, np.abs(values))
    sizes = np.linalg.norm(scaled, axis=0)
    told = [f"no datum depends on {names[i]}" for i in np.flatnonzero(sizes == 0.0).tolist()]
    used = np.flatnonzero(sizes > 0.0).tolist()
    if len(used) > 1:
        _, singular, right = np.linalg.svd(scaled[:, used] / sizes[used], full_matrices=False)
        told += [
            _combination(row / sizes[used], [names[i] for i in used]) for row in right[singular <= _NULL * singular[0]]
        ]
    return tuple(told)


def _combination(change: NDArray[np.float64], names: Sequence[str]) -> str:
    change = change / change[np.argmax(np.abs(change))]
    parts = [f"{name} {value:+.3g} %" for name, value in zip(names, change, strict=True) if abs(value) > _PART]
    return f"the data do not change along {', '.join(parts)}: only a combination of these is known"


_Solve = Callable[[int, float], float]  # loss of the best fit with one parameter held at a value


def profiled(
    solve: _Solve, index: int, value: float, error: float, loss: float, bounds: tuple[float, float]
) -> tuple[float, float]:
    """Return where the profile of the loss is 1 above its minimum, below and above the best value.

    Parameters
    ----------
    solve : callable
        Returns the least loss with the parameter of an index held at a value.
    index : int
        The parameter.
    value, error : float
        Its best value, and its standard error by linear theory.
    loss : float
        The least loss.
    bounds : (float, float)
        Its bounds; where the profile stays below 1 up to there, the bound is returned.
    """
    return _crossing(solve, index, value, -error, loss, bounds[0]), _crossing(
        solve, index, value, error, loss, bounds[1]
    )


def _crossing(solve: _Solve, index: int, value: float, step: float, loss: float, limit: float) -> float:
    """Return where the square root of the profile's rise is 1, by the secant method, which is exact for a parabola."""
    near, root_near, trial = value, 0.0, step
    for _ in range(_SECANTS):
        there = max(value + trial, limit) if step < 0.0 else min(value + trial, limit)
        root = float(np.sqrt(max(solve(index, there) - loss, 0.0)))
        if there == limit and root < 1.0:
            return limit
        if abs(root - 1.0) <= _ONE:
            return there
        slope = (root - root_near) / (there - near) if root != root_near else np.sign(step) / abs(step)
        near, root_near, trial = there, root, there + (1.0 - root) / slope - value
        trial = np.sign(step) * np.clip(abs(trial), 0.1 * abs(step), 10.0 * abs(step))
    return near
