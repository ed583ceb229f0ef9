"""Conditions at which a solution of algebraic equations is critical, and the points where they hold.

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
    from collections.abc import Callable, Hashable

    from numpy.typing import NDArray

    from saltus.algebraic.protocol import AlgebraicProblem

__all__ = ["Condition", "Singular", "Vanishing", "solve_branch_point", "solve_saddle_node"]

_ITERATIONS = 12  # Newton steps to a critical point, at most
_FAINT = 1e-12  # size of an equation's terms, over the largest, up to which it has no size of its own
_CONVERGED = 1e-12  # largest relative Newton step of a converged point


class Condition(Protocol):
    """Scalars that vanish where a solution is critical, in its unknowns, parameters and further unknowns.

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


class Vanishing:
    """A function of the unknowns vanishes, as an event function at a boundary equilibrium.

    Parameters
    ----------
    function : callable
        Takes the unknowns; returns its value, and its gradient in them.
    place : hashable
        By what the function is known, as the number of a transition.
    """

    extra, rows = 0, 1

    def __init__(
        self, function: Callable[[NDArray[np.float64]], tuple[float, NDArray[np.float64]]], place: Hashable
    ) -> None:
        self.function, self.place = function, place

    def evaluate(
        self, u: NDArray[np.float64], extra: NDArray[np.float64], J: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """See `Condition.evaluate`."""
        value, gradient = self.function(u)
        return np.array([value]), gradient[None, :], np.zeros((1, 0))

    def adjust(self) -> None:
        """Do nothing: there are no borders of a matrix."""


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
