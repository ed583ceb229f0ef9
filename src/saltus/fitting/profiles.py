"""Profile likelihoods: how far each parameter may go while all others are fitted again.

References
----------
Venzon and Moolgavkar, Appl. Statist. 37 (1988) 87-94 (profile likelihood).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from saltus.errors import ConvergenceError
from saltus.fitting.optimum import FOUND, NOTHING, Minimum, Objective, minimised

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Profiles"]

_MOST = 12  # evaluations of the model for one point of a profile, at most
_ACCURACY = 1e-4  # relative change of the loss that ends the search for one point
_SEARCHES = 2  # for one point, each from where the last one ended, at most
_BETTER = 1e-2  # fall of the loss below that of the optimum that is more than rounding
_SECANTS = 10  # steps of the secant method on one side of a profile, at most
_NEAR = 0.1  # distance of a profile's square root from 1 at which one more secant tells where it is 1


@dataclass
class Profiles:
    """Intervals in which the profile of the loss rises by at most 1."""

    objective: Objective  # the residuals
    found: Minimum  # where the loss is least
    spread: NDArray[np.float64]  # shape (parameters, parameters): covariance by linear theory
    bounds: NDArray[np.float64]  # shape (2, parameters): least and greatest values
    intervals: dict[str, tuple[float, float]] = field(default_factory=dict)  # the intervals found, by parameter
    notes: list[str] = field(default_factory=list)  # in words, which parameters have none
    better: Minimum | None = None  # a better fit, if one was found on the way: the intervals are void then

    def compute(self, names: Sequence[str]) -> None:
        """Find the intervals of parameters."""
        try:
            for name in names:
                i = self.objective.names.index(name)
                if not np.isfinite(self.spread[i, i]):
                    self.notes.append(f"{name} has no profile: the data do not tell it")
                    continue
                try:
                    self.intervals[name] = self._end(i, -1.0), self._end(i, 1.0)
                except ConvergenceError as failed:
                    self.notes.append(f"{name} has no profile: {failed}")
                if self.better is not None:
                    return
        except KeyboardInterrupt:
            self.notes.append("interrupted: not all profiles are known")

    def _end(self, index: int, sign: float) -> float:
        """Return where the square root of the profile's rise is 1, by the secant method, exact for a parabola.

        Where the profile stays below up to a bound, the bound is returned. Where it jumps past 1, as at the end of a
        sheet, the jump is bisected.

        Raises
        ------
        ConvergenceError
            The value is not found, or the others cannot be fitted on the way to it.
        """
        best, limit = float(self.found.values[index]), float(self.bounds[int(sign > 0.0), index])
        if limit == best:
            return limit
        error = float(np.sqrt(self.spread[index, index]))
        direction = self.spread[:, index] / self.spread[index, index]
        near, root_near, trial, below, above = 0.0, 0.0, sign * error, 0.0, np.inf
        for _ in range(_SECANTS):
            there = max(trial, limit - best) if sign < 0.0 else min(trial, limit - best)
            if there == near:  # the bound once more, where the profile is above 1
                break
            fitted = self._fitted(index, best + there, there * direction)
            if fitted.loss < self.found.loss - _BETTER:
                self.better = fitted
                return best
            root = float(np.sqrt(max(fitted.loss - self.found.loss, 0.0)))
            if there == limit - best and root < 1.0:
                return limit
            below, above = (max(below, abs(there)), above) if root < 1.0 else (below, min(above, abs(there)))
            if above - below <= _NEAR * above and abs(root - 1.0) > _NEAR:
                return best + 0.5 * sign * (below + above)
            direction = (fitted.values - self.found.values) / there
            slope = (root - root_near) / (there - near) if root != root_near else sign / error
            near, root_near, trial = there, root, there + (1.0 - root) / slope
            if abs(root - 1.0) <= _NEAR:
                return float(np.clip(best + trial, *self.bounds[:, index]))
            trial = sign * float(np.clip(abs(trial), 0.1 * error, 10.0 * error))
            if below > 0.0 and not below < abs(trial) < above:
                trial = 0.5 * sign * (below + above) if np.isfinite(above) else 2.0 * sign * below
        raise ConvergenceError("end of a profile", abs(root_near - 1.0), _SECANTS)

    def _fitted(self, index: int, value: float, change: NDArray[np.float64]) -> Minimum:
        """Return the best fit with one parameter held at a value, sought from a change of the optimum."""
        start = np.clip(self.found.values + change, *self.bounds)
        start[index] = value
        for _ in range(_SEARCHES):
            there = minimised(self.objective, start, self.bounds, fixed=(index,), most=_MOST, accuracy=_ACCURACY)
            if there.is_interrupted:
                raise KeyboardInterrupt
            if there.stopped in (FOUND, NOTHING):
                break
            start = there.values
        else:
            raise ConvergenceError(
                f"fit at {self.objective.names[index]} = {value:.6g}", there.loss, _MOST, there.stopped
            )
        return there
