"""Least squares with exact derivatives: the best parameters, and what the data tell of them.

References
----------
Branch, Coleman and Li, SIAM J. Sci. Comput. 21 (1999) 1-23 (reflective trust region within bounds, by
`scipy.optimize.least_squares`); Triggs et al., LNCS 1883 (2000) 298-372 (robust losses).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from saltus.errors import ConvergenceError, InputError
from saltus.fitting.evaluation import Evaluation
from saltus.fitting.instrument import Instrument
from saltus.fitting.priors import NO_PRIORS, Priors

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.many.retracing import Retraced
    from saltus.fitting.measured import Measured
    from saltus.progress import Reporter

__all__ = [
    "FOUND",
    "INTERRUPTED",
    "Minimum",
    "Objective",
    "covariance",
    "degeneracies",
    "is_held",
    "loss_weights",
    "minimised",
    "total_loss",
]

FOUND = "the optimum is found"  # why a search ends that converged
NOTHING = "nothing is varied"  # why it ends at its start
INTERRUPTED = "interrupted: the best so far"  # why it ends at Ctrl-C

_LOSS = 3.0  # residual in standard errors from which the loss grows more slowly than its square
_SMALL = 1e-8  # relative change of the loss that ends the search
_STEP = 1e-9  # relative change of the parameters that ends the search
_FIRST_STEP = 0.5  # radius of the first trust region, over the sizes of the parameters
_LEAST_SIZE = 0.02  # size of a parameter, over its range, at least
_FALL = 1e-3  # fall of the loss, over 1 and the loss, that a search must not leave undone after refusals
_HOPELESS = 2.0  # loss by interpolated observables, over the least, above which no orbit is solved for its data
_NULL = 1e-6  # singular value over the largest, of relative changes, below which a combination has no effect
_PART = 1e-2  # share of a parameter in a combination, below which it is left out in words


@dataclass
class Objective:
    """Residuals of data as a function of the varied parameters, with the best ones so far."""

    measured: Measured  # the data
    trace: Retraced  # returns branches at changed parameters
    names: tuple[str, ...]  # varied parameters
    reporter: Reporter  # who is told
    priors: Priors = NO_PRIORS  # what is known of the parameters beforehand
    # loss, parameters and evaluation of the best ones
    best: tuple[float, NDArray[np.float64], Evaluation] | None = None
    failures: list[str] = field(default_factory=list)  # why parameters were refused
    evaluations: int = 0  # how often the model was compared with the data
    refused: int = 0  # how many of the last parameters were refused, one after the other
    instrument: Instrument = field(default_factory=Instrument)  # unknowns of the measurement
    allowance: float = np.inf  # of `Evaluation`: how far data may lie beyond the ends of sheets

    def at(self, values: NDArray[np.float64]) -> Evaluation:
        """Return the data against the model at values of the parameters.

        Branches are retraced from those of the best parameters. Where this leads to far worse a fit, or to fewer
        sheets, the model is traced anew.

        Raises
        ------
        ConvergenceError
            The model has no branch or no derivative there.
        """
        if self.best is not None and np.array_equal(self.best[1], values):
            return self.best[2]
        if self.best is not None:
            self.trace.branches = self.best[2].branches
        try:
            found = self._tried(values, anew=False)
            if self._taken(values, found) or self.trace.whole is None or not self._may_lack_sheets(found):
                return found
        except (ConvergenceError, InputError):
            if self.trace.whole is None:
                raise
        return self.anew(values)

    def anew(self, values: NDArray[np.float64]) -> Evaluation:
        """Return the data against the model, traced without the branches known before; raises what `at` does."""
        found = self._tried(values, anew=True)
        self._taken(values, found)
        return found

    def _may_lack_sheets(self, found: Evaluation) -> bool:
        return self.is_worse(found) or self.best is None or len(found.sheets) < len(self.best[2].sheets)

    def rough_loss(self, values: NDArray[np.float64]) -> float:
        """Return the loss by interpolated observables, of the model traced anew; infinite where there is none."""
        try:
            found = self._tried(values, anew=True).rough
        except (ConvergenceError, InputError):
            return np.inf
        self._tell(values, found)
        return total_loss(found)

    def is_worse(self, found: Evaluation) -> bool:
        """Whether the loss is so much above the least that interpolated observables are enough to tell."""
        return self.best is not None and not total_loss(found.rough) <= _HOPELESS * self.best[0] + self.measured.count

    def _tried(self, values: NDArray[np.float64], *, anew: bool) -> Evaluation:
        given = dict(zip(self.names, values.tolist(), strict=True))
        changes = {name: given[name] for name in self.instrument.of_model(self.names)}
        own = replace(self.instrument, values={name: given[name] for name in given if name not in changes})
        known = self.trace.branches
        if anew or any(known[0].parameters[name] != value for name, value in changes.items()):
            known = (self.trace.anew if anew else self.trace)(changes)
        beforehand = self.priors.residuals(values), self.priors.jacobian(len(values))
        found = Evaluation(self.measured, known, self.names, beforehand, own, self.allowance)
        self.evaluations += 1
        return found

    def _tell(self, values: NDArray[np.float64], residuals: NDArray[np.float64]) -> None:
        told = ", ".join(f"{name} = {value:.6g}" for name, value in zip(self.names, values, strict=True))
        self.reporter.step(1, f"chi2/n = {float(residuals @ residuals) / residuals.size:.4g}, {told}")

    def _taken(self, values: NDArray[np.float64], found: Evaluation) -> bool:
        """Keep an evaluation if it is the best so far, and return whether it is."""
        if self.is_worse(found):
            self._tell(values, found.rough)
            return False
        loss = total_loss(found.residuals)
        self._tell(values, found.residuals)
        if not np.all(np.isfinite(found.jacobian)):
            raise ConvergenceError("derivatives of the residuals", np.inf, 0, "an end of a sheet has none")
        if self.best is not None and not loss < self.best[0]:
            return False
        self.best = loss, values.copy(), found
        return True


@dataclass(frozen=True)
class Minimum:
    """Where a search ended."""

    values: NDArray[np.float64]  # shape (parameters,): the best parameters
    evaluation: Evaluation  # the data against the model there
    loss: float  # sum of the losses there
    stopped: str  # why the search ended

    @property
    def is_interrupted(self) -> bool:
        """Whether an interrupt ended the search."""
        return self.stopped == INTERRUPTED


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
    most: int,
    accuracy: float = _SMALL,
) -> Minimum:
    """Return the parameters of least loss within bounds; an interrupt keeps the best so far.

    Parameters
    ----------
    start : ndarray, shape (parameters,)
        Where the search starts.
    bounds : ndarray, shape (2, parameters)
        Least and greatest values.
    fixed : sequence of int, optional
        Parameters that keep their values.
    most : int
        Evaluations at most.
    accuracy : float, optional
        Relative change of the loss that ends the search.

    Raises
    ------
    ConvergenceError
        The model cannot be compared with the data at the start.
    """
    from scipy.optimize import least_squares

    free = [i for i in range(len(start)) if i not in fixed]
    if objective.best is not None and not np.array_equal(objective.best[1], start):
        objective.best = None
    first = objective.at(start)
    known: dict[bytes, Evaluation] = {start[free].tobytes(): first}

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
            objective.refused = 0
            known.clear()
            known[values.tobytes()] = found
        return known[values.tobytes()]

    if not free:
        assert objective.best is not None
        return Minimum(start, objective.best[2], objective.best[0], NOTHING)
    if not np.any((loss_weights(first.residuals) * first.residuals) @ first.jacobian[:, free]):
        # SciPy divides by the length of the step, which is 0 here
        return Minimum(start, first, total_loss(first.residuals), FOUND)
    low, high = bounds[:, free]
    inside = np.clip(start[free], low + 1e-9 * (high - low), high - 1e-9 * (high - low))
    sizes = np.where(start[free] == 0.0, high - low, np.maximum(np.abs(start[free]), _LEAST_SIZE * (high - low)))
    # SciPy's first trust region is as large as the variables: these begin at its wanted radius
    origin = np.full(len(free), _FIRST_STEP / np.sqrt(len(free)))

    def placed(scaled: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.clip(inside + sizes * (scaled - origin), low, high))

    def residuals(scaled: NDArray[np.float64]) -> NDArray[np.float64]:
        found = evaluated(placed(scaled))
        if found is None:
            return np.full(objective.measured.count + len(objective.priors.places), np.nan)
        return found.rough if objective.is_worse(found) else found.residuals

    def slopes(scaled: NDArray[np.float64]) -> NDArray[np.float64]:
        found = evaluated(placed(scaled))
        assert found is not None  # derivatives are asked for only where residuals were found
        return np.asarray(found.jacobian[:, free] * sizes)

    limits = origin + (low - inside) / sizes, origin + (high - inside) / sizes
    objective.refused, refusals = 0, len(objective.failures)
    try:
        found = least_squares(
            residuals, origin, slopes, limits, loss="soft_l1", f_scale=_LOSS,
            ftol=accuracy, xtol=_STEP, gtol=None, max_nfev=most,
        )  # fmt: skip
        stopped = "no more evaluations are allowed" if found.status == 0 else FOUND
        fall = _promised_fall(objective, free, bounds) if len(objective.failures) > refusals else 0.0
        if objective.refused or fall > _FALL:
            stopped = "the search ended where no further step can be followed: perhaps this is no optimum"
    except KeyboardInterrupt:
        stopped = INTERRUPTED
    assert objective.best is not None
    loss, values, evaluation = objective.best
    return Minimum(values, evaluation, loss, stopped)


def _promised_fall(objective: Objective, free: Sequence[int], bounds: NDArray[np.float64]) -> float:
    """Return by how much the loss would fall within bounds by a quadratic model, over 1 and the least loss found."""
    assert objective.best is not None
    loss, values, evaluation = objective.best
    roots = np.sqrt(loss_weights(evaluation.residuals))
    jacobian, residuals = evaluation.jacobian * roots[:, None], evaluation.residuals * roots
    slopes = residuals @ jacobian
    held = is_held(values, bounds, slopes)
    own = [i for i in free if not held[i]]
    step = np.linalg.lstsq(jacobian[:, own], residuals)[0]
    return float(step @ slopes[own]) / (1.0 + loss)


def is_held(values: NDArray[np.float64], bounds: NDArray[np.float64], slopes: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which parameters lie at a bound beyond which the loss, of these slopes, would fall."""
    near = 1e-6 * (bounds[1] - bounds[0])
    low, high = values - bounds[0] <= near, bounds[1] - values <= near
    return np.asarray((low & (slopes > 0.0)) | (high & (slopes < 0.0)))


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
