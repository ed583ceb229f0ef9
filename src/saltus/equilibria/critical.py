"""Hopf points as a condition: scalars with exact gradients beside the field's equations.

docs/theory/equilibria.md, "Loci", derives it.

References
----------
Govaerts, Numerical Methods for Bifurcations of Dynamical Equilibria, SIAM 2000, ch. 3 and 4 (bordered matrices).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.equilibria.problem import EquilibriumProblem

__all__ = ["Hopf"]


class Hopf:
    """The matrix A^2 + k I has a null space of dimension two, as with the eigenvalues +-i sqrt(k).

    The further unknowns are a vector v of the null space and k, in units of the matrix' squared size. For k > 0 the
    equilibrium is a Hopf point, for k < 0 a neutral saddle. At k = 0 it is a Bogdanov-Takens point, where the equations
    stay regular.

    Parameters
    ----------
    problem : EquilibriumProblem
        The equations, two parameters active.
    u : ndarray, shape (n + 2,)
        An equilibrium near the condition.
    sizes : ndarray, shape (n,)
        Typical sizes of the states.
    pair : complex
        The critical pair's member of positive imaginary part, or a positive member of a real pair.
    """

    def __init__(
        self, problem: EquilibriumProblem, u: NDArray[np.float64], sizes: NDArray[np.float64], pair: complex
    ) -> None:
        self.problem, self.sizes, self.n = problem, sizes, problem.n
        self.extra, self.rows = self.n + 1, self.n + 2
        A = self._scaled(problem.evaluate(u)[1][:, : self.n])
        self.unit = float(np.linalg.norm(A, 2)) ** 2 or 1.0
        k = (pair.imag**2 - pair.real**2) / self.unit
        basis = np.linalg.svd(A @ A / self.unit + k * np.eye(self.n))[2][-2:]
        # v must not be a null vector of A itself: the equations would be singular at a Bogdanov-Takens point
        shares = np.linalg.svd(A @ basis.T)[2]
        self._first, self._second = shares[0] @ basis, shares[1] @ basis
        self.guess = np.append(self._first, k)

    def _scaled(self, A: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(A * self.sizes / self.sizes[:, None])

    def evaluate(
        self, u: NDArray[np.float64], extra: NDArray[np.float64], J: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """See `Condition.evaluate`: A (A v) + k v = 0, v on a plane and of fixed length along a vector."""
        n, still, sizes = self.n, np.zeros(u.size - self.n), self.sizes
        v, k = extra[:n], float(extra[n])
        A = self._scaled(J[:, :n])
        Av = A @ v
        # derivatives of A along v and along A v, in unknowns that are not scaled
        along = self.problem.second(u, np.append(v * sizes, still)) / sizes[:, None]
        twice = self.problem.second(u, np.append(Av * sizes, still)) / sizes[:, None]
        values = np.concatenate([A @ Av / self.unit + k * v, [self._first @ v - 1.0, self._second @ v]])
        gradient = np.vstack([(twice + A @ along) / self.unit, np.zeros((2, u.size))])
        further = np.zeros((n + 2, n + 1))
        further[:n, :n], further[:n, n] = A @ A / self.unit + k * np.eye(n), v
        further[n, :n], further[n + 1, :n] = self._first, self._second
        self.frequency = k * self.unit
        return values, gradient, further

    def adjust(self) -> None:
        """Do nothing: `turned` takes the borders anew."""

    def turned(self, J: NDArray[np.float64], extra: NDArray[np.float64]) -> NDArray[np.float64]:
        """Take the borders anew from the null space at a point; return the further unknowns by these."""
        A = self._scaled(J[:, : self.n])
        right = np.linalg.svd(A @ A / self.unit + float(extra[self.n]) * np.eye(self.n))[2]
        basis = right[-2:]
        shares = basis @ extra[: self.n]
        shares /= np.linalg.norm(shares)
        self._first = shares @ basis
        self._second = np.array([-shares[1], shares[0]]) @ basis
        return np.append(self._first, extra[self.n])
