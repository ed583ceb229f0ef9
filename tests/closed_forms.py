"""Fits of closed forms: residuals and their derivatives are plain functions where a fit has a traced model."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from saltus.errors import ConvergenceError
from saltus.fitting.optimum import Objective
from saltus.progress import Reporter

X = np.linspace(0.0, 4.0, 25)


class ClosedForm(Objective):
    """Data along `X` against a function of it and of parameters; `places` are all those at which it was asked for.

    `wall` says of parameters why there is no model; `stop_at` is the evaluation at which an interrupt comes.
    """

    def __init__(self, function, slopes, y, sigma, names, *, wall=None, stop_at=None):
        measured = SimpleNamespace(count=len(y), rows=1)
        super().__init__(measured, SimpleNamespace(branches=(), whole=None), names, Reporter(False))
        self.function, self.slopes, self.y, self.sigma = function, slopes, y, sigma
        self.wall, self.stop_at, self.places = wall or (lambda *values: ""), stop_at, []

    def _tried(self, values, *, anew):
        self.evaluations += 1
        self.places.append(values.copy())
        if self.evaluations == self.stop_at:
            raise KeyboardInterrupt
        if why := self.wall(*values):
            raise ConvergenceError(why, np.inf, 0)
        residuals = (self.function(X, *values) - self.y) / self.sigma
        jacobian = (np.array(self.slopes(X, *values)) / self.sigma).T
        return SimpleNamespace(
            residuals=residuals, rough=residuals, jacobian=jacobian, sheets=(), branches=(), measured=self.measured
        )


def decay(x, a, b):
    return a * np.exp(-b * x)


def decay_slopes(x, a, b):
    return [np.exp(-b * x), -x * a * np.exp(-b * x)]


def noise(seed):
    return np.random.default_rng(seed).normal(size=len(X))


def decaying(a=2.0, b=0.7, spread=0.05, seed=1, **how):
    """A decay with noise of its standard error; without noise for a seed of None."""
    y = decay(X, a, b) + (0.0 if seed is None else spread * noise(seed))
    return ClosedForm(decay, decay_slopes, y, spread, ("a", "b"), **how)
