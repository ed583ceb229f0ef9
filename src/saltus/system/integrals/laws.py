"""Sums of states with constant coefficients that no motion changes, and the leaf of states with given totals.

docs/theory/conserved.md derives what is computed here.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from saltus.scales import ILL_CONDITIONED

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["NONE", "Laws", "Leaf"]


@dataclass(frozen=True)
class Laws:
    """Linear first integrals of a system.

    Attributes
    ----------
    names : tuple of str
        Each as a formula of the states and parameters.
    rows, columns : ndarray of int64, shape (term,)
        Integral and state of each term.
    coefficients : ndarray, shape (term,)
        Number in each term.
    powers : ndarray of int64, shape (term, parameters)
        Power of each parameter in each term.
    states : int
        Number of states, the phase excepted.
    """

    names: tuple[str, ...]
    rows: NDArray[np.int64]
    columns: NDArray[np.int64]
    coefficients: NDArray[np.float64]
    powers: NDArray[np.int64]
    states: int

    def __len__(self) -> int:
        return len(self.names)

    def factors(self, p: NDArray[np.float64], *by: int) -> NDArray[np.float64]:
        """Return the value of each term's coefficient, differentiated by some parameters, shape (term,)."""
        powers, found = self.powers.astype(np.float64), self.coefficients.copy()
        for index in by:
            found *= powers[:, index]
            powers[:, index] = np.maximum(powers[:, index] - 1.0, 0.0)
        return np.asarray(found * np.prod(p[: powers.shape[1]] ** powers, axis=1))

    def matrix(self, p: NDArray[np.float64], *by: int) -> NDArray[np.float64]:
        """Return the coefficients, shape (law, state), or their derivatives by some parameters."""
        found = np.zeros((len(self), self.states))
        if not self.names:
            return found
        np.add.at(found, (self.rows, self.columns), self.factors(p, *by))
        return found

    def totals(self, x: NDArray[np.float64], p: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the value of each integral at a state, shape (law,)."""
        return np.asarray(self.matrix(p) @ x[: self.states])

    def named(self, x: NDArray[np.float64], p: NDArray[np.float64]) -> dict[str, float]:
        """Return the value of each integral at a state by its name."""
        return dict(zip(self.names, self.totals(x, p).tolist(), strict=True)) if self.names else {}

    def depends_on(self, parameter: int) -> bool:
        """Return whether a coefficient has a parameter."""
        return bool(np.any(self.powers[:, parameter]))


_EMPTY = np.empty(0, dtype=np.int64)
NONE = Laws((), _EMPTY, _EMPTY, np.empty(0), np.empty((0, 0), dtype=np.int64), 0)


class Leaf:
    """The states of given totals: some states follow from the others.

    Parameters
    ----------
    matrix : ndarray, shape (law, state)
        Coefficients of the integrals.
    sizes : ndarray, shape (state,)
        Sizes of the states. What follows are those with the largest shares in the totals: of a small one nothing but
        rounding would be left.

    Attributes
    ----------
    follow, kept : ndarray of int64
        States that follow from the others, one for each integral in their order, and the others.
    turn : ndarray, shape (law, law)
        Turns the integrals so that each has one state that follows, with coefficient 1.
    """

    def __init__(self, matrix: NDArray[np.float64], sizes: NDArray[np.float64]) -> None:
        count, states = matrix.shape
        # a state of size 0 has a share where no other state has one
        floor = float(sizes.max(initial=0.0)) * ILL_CONDITIONED or 1.0
        shares = matrix * np.maximum(sizes[:states], floor)
        shares = shares / np.abs(shares).max(axis=1, keepdims=True)
        follow = np.zeros(count, dtype=np.int64)
        left = list(range(count))
        for _ in range(count):
            row, column = divmod(int(np.argmax(np.abs(shares[left]))), states)
            at = left.pop(row)
            follow[at] = column
            others = np.array(left, dtype=np.int64)
            shares[others] -= np.outer(shares[others, column] / shares[at, column], shares[at])
        self.follow = follow
        self.kept = np.setdiff1d(np.arange(states), follow)
        self.turn = np.linalg.inv(matrix[:, follow])
        self._slopes = -(self.turn @ matrix)[:, self.kept]

    def widened(self, n: int) -> NDArray[np.int64]:
        """Return the components of a full state of n that do not follow from others."""
        return np.setdiff1d(np.arange(n), self.follow)

    def within(self, A: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the linear map of the leaf, of matrices (..., n, n) that leave the totals alone."""
        kept = self.widened(A.shape[-1])
        found = A[..., kept[:, None], kept].copy()
        found[..., :, : self.kept.size] += A[..., kept[:, None], self.follow] @ self._slopes
        return np.asarray(found)

    def moved(self, columns: NDArray[np.float64], n: int) -> NDArray[np.float64]:
        """Return derivatives in the states that do not follow, of derivatives (rows, n) in a full state."""
        found = columns[:, self.widened(n)].copy()
        found[:, : self.kept.size] += columns[:, self.follow] @ self._slopes
        return found
