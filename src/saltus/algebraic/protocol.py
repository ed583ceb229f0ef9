"""What equilibria and orbits of maps have in common: the zeros of functions, with their derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["AlgebraicProblem"]


class AlgebraicProblem(Protocol):
    """Equations F(x, p) = 0 with as many unknowns as equations; the unknowns are x, then the active parameters.

    Attributes
    ----------
    n : int
        Number of equations.
    period : int
        Number of points whose states are the unknowns x, one after the other; 1 but for orbits of maps.
    p : ndarray, shape (parameters,)
        All parameters.
    active : sequence of int
        Parameters among the unknowns, growing.
    scales : ndarray, shape (active,)
        Units of the active parameters.
    circles : ndarray of int
        Places of the angles among the unknowns.
    """

    n: int
    period: int
    p: NDArray[np.float64]
    active: Sequence[int]
    scales: NDArray[np.float64]
    circles: NDArray[np.int64]

    def parameters_at(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return all parameters, shape (parameters,), where the unknowns are `u`."""

    def evaluate(self, u: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return F, shape (n,), and its derivatives in the unknowns, shape (n, n + active)."""

    def second(self, u: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivative of the Jacobian in the unknowns along `v`, both shape (n, n + active)."""

    def third(self, u: NDArray[np.float64], *directions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the third derivative of F in x along three directions, shape (n,)."""

    def rounding(self, u: NDArray[np.float64], J: NDArray[np.float64], sizes: NDArray[np.float64]) -> float:
        """Return the largest residual over the sizes of its terms; `sizes` are those of the unknowns x, shape (n,)."""
