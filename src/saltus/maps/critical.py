"""The condition that makes an orbit critical by a pair of multipliers on the unit circle.

Others are in `saltus.algebraic.conditions`.
docs/theory/map_orbits.md, "Loci", derives it.

References
----------
Govaerts, Numerical Methods for Bifurcations of Dynamical Equilibria, SIAM 2000, ch. 4 and 9 (bordered matrices, maps).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.maps.problem import MapOrbitProblem

__all__ = ["Rotation"]


class Rotation:
    """The matrix M^2 - 2 c M + I has a null space of dimension two, M the derivative along the orbit.

    The further unknowns are vectors v of all points' null space, their successors w = M v, and c. For abs(c) < 1 it is
    the cosine of the angle of a pair on the unit circle. The equations stay regular at c = 1 and c = -1.

    Parameters
    ----------
    problem : MapOrbitProblem
        The equations, two parameters active.
    u : ndarray, shape (n + 2,)
        An orbit near the condition.
    sizes : ndarray, shape (n,)
        Typical sizes of the points.
    cosine : float
        A guess of c.
    """

    def __init__(
        self, problem: MapOrbitProblem, u: NDArray[np.float64], sizes: NDArray[np.float64], cosine: float
    ) -> None:
        self.problem, self.sizes, self.n = problem, sizes.copy(), problem.n
        self.extra, self.rows = 2 * self.n + 1, 2 * self.n + 2
        self._closing = problem.closing * sizes / sizes[:, None]
        J = problem.evaluate(u)[1]
        V, W = self._null_space(J, cosine)
        self._first, self._second, ways = _borders(V)
        self.guess = np.concatenate([self._first, ways @ W, [cosine]])

    def _matrix(self, J: NDArray[np.float64], c: float) -> NDArray[np.float64]:
        """Return the equations (A + B) v = B w, (A + B) w = B (2 c w - v), scaled, shape (2 n, 2 n)."""
        A = J[:, : self.n] * self.sizes / self.sizes[:, None] + self._closing
        return np.block([[A, -self._closing], [self._closing, A - 2.0 * c * self._closing]])

    def _null_space(self, J: NDArray[np.float64], c: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return two null vectors, v and w apart, both of shape (2, n)."""
        right = np.linalg.svd(self._matrix(J, c))[2][-2:]
        return right[:, : self.n], right[:, self.n :]

    def evaluate(
        self, u: NDArray[np.float64], extra: NDArray[np.float64], J: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """See `saltus.algebraic.conditions.Condition.evaluate`; v lies in a plane, of fixed length along a vector."""
        n, still, sizes = self.n, np.zeros(u.size - self.n), self.sizes
        v, w, c = extra[:n], extra[n : 2 * n], float(extra[2 * n])
        matrix = self._matrix(J, c)
        values = np.concatenate([matrix @ extra[: 2 * n], [self._first @ v - 1.0, self._second @ v]])
        bends = [self.problem.second(u, np.append(part * sizes, still)) / sizes[:, None] for part in (v, w)]
        gradient = np.vstack([*bends, np.zeros((2, u.size))])
        further = np.zeros((self.rows, self.extra))
        further[: 2 * n, : 2 * n] = matrix
        further[n : 2 * n, 2 * n] = -2.0 * self._closing @ w
        further[2 * n, :n], further[2 * n + 1, :n] = self._first, self._second
        return values, gradient, further

    def adjust(self) -> None:
        """Do nothing: `turned` takes the borders anew."""

    def turned(self, J: NDArray[np.float64], extra: NDArray[np.float64]) -> NDArray[np.float64]:
        """Take the borders anew from the null space at a point; return the further unknowns by these."""
        V, W = self._null_space(J, float(extra[-1]))
        v = extra[: self.n] / np.linalg.norm(extra[: self.n])
        self._first, self._second, ways = _borders(V, v)
        return np.concatenate([self._first, ways @ W, extra[-1:]])


def _borders(
    V: NDArray[np.float64], towards: NDArray[np.float64] | None = None
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return two orthonormal vectors in the plane of `V`, and the first one's coordinates in its rows."""
    left, sizes, right = np.linalg.svd(V, full_matrices=False)
    share = np.array([1.0, 0.0]) if towards is None else right @ towards
    share = share / np.linalg.norm(share)
    first, second = share @ right, np.array([-share[1], share[0]]) @ right
    return first, second, left @ (share / sizes)
