"""Algebraic equations written in Python, with no system behind them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass
class Equations:
    """F(x, p) = 0 by polynomials of the unknowns u = (x, p), at most cubic where second derivatives are asked for."""

    n: int
    function: Callable[[NDArray], NDArray]
    unknowns: int
    circles: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))

    def evaluate(self, u: Array) -> tuple[Array, Array]:
        u = np.asarray(u, dtype=float)
        step = 1e-30
        columns = [self.function(u + 1j * step * e).imag / step for e in np.eye(u.size)]
        return self.function(u.astype(complex)).real, np.column_stack(columns)

    def second(self, u: Array, v: Array) -> Array:
        return (self.evaluate(u + v)[1] - self.evaluate(u - v)[1]) / 2.0  # exact: the Jacobian is quadratic
