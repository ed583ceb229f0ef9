"""Conditions that make an equilibrium critical: scalars with exact gradients beside the field's equations.

docs/theory/equilibria.md, "Loci", derives them.

References
----------
Govaerts, Numerical Methods for Bifurcations of Dynamical Equilibria, SIAM 2000, ch. 3 and 4 (bordered matrices). Moore,
Numer. Funct. Anal. Optim. 2 (1980) 441-472 (branch points).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.equilibria.algebraic import AlgebraicProblem
    from saltus.equilibria.problem import EquilibriumProblem

__all__ = ["Boundary", "Condition", "Hopf", "Singular", "solve_branch_point", "solve_saddle_node"]

_ITERATIONS = 12  # Newton steps to a critical point, at most
_FAINT = 1e-12  # size of an equation's terms, over the largest, up to which it has no size of its own
_CONVERGED = 1e-12  # largest relative Newton step of a converged point


class Condition(Protocol):
    """Scalars that vanish where an equilibrium is critical.

    Attributes
    ----------
    extra : int
        Number of further unknowns.
    rows : int
        Number of scalars.
    """

    extra: int
    rows: int

    def evaluate(
        self, u: NDArray[np.float64], extra: NDArray[np.float64], J: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return the scalars, (rows,), and their gradients in the unknowns `u`, and in the further unknowns."""

    def adjust(self) -> None:
        """Take the borders from the null vectors last computed."""


class Singular:
    """The Jacobian is singular, as at a saddle-node: the last entry of a bordered solution vanishes.

    Parameters
    ----------
    problem : AlgebraicProblem
        The equations, two parameters active, or one for a single point.
    u : ndarray, shape (n + active,)
        A solution near the condition.
    sizes : ndarray, shape (n,)
        Typical sizes of the states.
    shift : ndarray, shape (n, n), optional
        What is added to the Jacobian, as for a multiplier -1 of a map.
    """

    extra, rows = 0, 1

    def __init__(
        self,
        problem: AlgebraicProblem,
        u: NDArray[np.float64],
        sizes: NDArray[np.float64],
        shift: NDArray[np.float64] | None = None,
    ) -> None:
        self.problem, self.sizes = problem, sizes
        self._shift = np.zeros((problem.n, problem.n)) if shift is None else shift
        A = problem.evaluate(u)[1][:, : problem.n] + self._shift
        scaled = A * sizes / sizes[:, None]
        left, _, right = np.linalg.svd(scaled)
        self.right, self.left = right[-1] * sizes, left[:, -1] / sizes
        # a matrix that vanishes as a whole has the size of its change along the null vector
        change = (
            problem.second(u, np.append(self.right, np.zeros(u.size - problem.n)))[:, : problem.n]
            * sizes
            / sizes[:, None]
        )
        self._unit = max(float(np.linalg.norm(scaled)), float(np.linalg.norm(change))) or 1.0
        self.adjust()

    def evaluate(
        self, u: NDArray[np.float64], extra: NDArray[np.float64], J: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """See `Condition.evaluate`."""
        n = self.problem.n
        unit = np.append(np.zeros(n), 1.0)
        # in units of states and time: elimination would lose digits where the borders are larger than the matrix
        A = (J[:, :n] + self._shift) * self.sizes / self.sizes[:, None] / self._unit
        bordered = np.block([[A, self._column[:, None]], [self._row[None, :], np.zeros((1, 1))]])
        v, w = np.linalg.solve(bordered, unit), np.linalg.solve(bordered.T, unit)
        self.right, self.left = v[:n] * self.sizes, w[:n] / (self._unit * self.sizes)
        bend = self.problem.second(u, np.append(self.right, np.zeros(u.size - n)))
        return np.array([v[n]]), -(self.left @ bend)[None, :], np.zeros((1, 0))

    def adjust(self) -> None:
        """See `Condition.adjust`."""
        right, left = self.right / self.sizes, self.left * self.sizes
        self._row, self._column = right / np.linalg.norm(right), left / np.linalg.norm(left)


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


class Boundary:
    """An event function of the mode vanishes at the equilibrium: a boundary equilibrium.

    Parameters
    ----------
    problem : EquilibriumProblem
        The equations, two parameters active.
    transition : int
        The transition whose event function it is.
    """

    extra, rows = 0, 1

    def __init__(self, problem: EquilibriumProblem, transition: int) -> None:
        self.problem, self.transition = problem, transition

    def evaluate(
        self, u: NDArray[np.float64], extra: NDArray[np.float64], J: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """See `Condition.evaluate`."""
        value, gradient = self.problem.event(self.transition, u)
        return np.array([value]), gradient[None, :], np.zeros((1, 0))

    def adjust(self) -> None:
        """Do nothing: there are no borders."""


def solve_saddle_node(
    problem: AlgebraicProblem, u: NDArray[np.float64], sizes: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    """Return the saddle-node near `u`, shape (n + 1,), one parameter active; None where there is none.

    Newton's method solves f = 0 together with `Singular`.
    """
    scale, u = np.append(sizes, 1.0), u.copy()
    try:
        condition = Singular(problem, u, sizes)
        for _ in range(_ITERATIONS):
            F, J = problem.evaluate(u)
            value, gradient, _ = condition.evaluate(u, np.zeros(0), J)
            matrix = np.vstack([J, gradient]) * scale
            rows = 1.0 / np.maximum(np.abs(matrix).max(axis=1), 1e-300)
            step = np.linalg.solve(matrix * rows[:, None], -rows * np.append(F, value))
            if not float(np.abs(step).max()) < 1.0:
                return None
            u = u + scale * step
            if float(np.abs(step).max()) < _CONVERGED:
                return u
    except np.linalg.LinAlgError:
        return None
    return None


def solve_branch_point(
    problem: AlgebraicProblem, u: NDArray[np.float64], sizes: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    """Return the branch point near `u`, shape (n + 1,), one parameter active; None where there is none.

    Newton's method solves f + m w = 0 and w^T (f_x, f_p) = 0 for a vector w of fixed length; m vanishes.
    """
    n = problem.n
    scale = np.append(sizes, 1.0)
    J = problem.evaluate(u)[1]
    terms = np.abs(J * scale).max(axis=1)
    rows = 1.0 / np.where(terms > _FAINT * terms.max(), terms, terms.max() or 1.0)
    left = np.linalg.svd((J * scale * rows[:, None])[:, :n])[0]
    w, m, u = left[:, -1], 0.0, u.copy()
    for _ in range(_ITERATIONS):
        F, J = problem.evaluate(u)
        F, J = F * rows, J * scale * rows[:, None]
        curved = np.array([(problem.second(u, e) * rows[:, None]).T @ w for e in np.diag(scale)]) * scale
        residual = np.concatenate([F + m * w, w @ J, [w @ w - 1.0]])
        zero = np.zeros
        matrix = np.block([
            [J, m * np.eye(n), w[:, None]],
            [curved, J.T, zero((n + 1, 1))],
            [zero((1, n + 1)), 2.0 * w[None, :], zero((1, 1))],
        ])  # fmt: skip
        try:
            step = np.linalg.solve(matrix, -residual)
        except np.linalg.LinAlgError:
            return None
        if not np.all(np.isfinite(step)) or float(np.abs(step).max()) > 1e6:
            return None
        u, w, m = u + scale * step[: n + 1], w + step[n + 1 : 2 * n + 1], m + float(step[-1])
        if float(np.abs(step[: n + 1]).max()) < _CONVERGED:
            return u
    return None
