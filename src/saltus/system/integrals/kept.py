"""Totals that a system conserves, kept by the equations of an orbit: docs/theory/conserved.md.

Of the equations that close an orbit, as many follow from the others as the system has linear integrals. To one of them
for each integral the distance of the first state's total from the wanted one is added. The equations then are regular,
with as many unknowns. An orbit solves them only where it closes and has these totals.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus.system.integrals.laws import Leaf

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from saltus.system import HybridSystem

__all__ = ["KeptTotals"]


class KeptTotals:
    """What is added to the closing equations of an orbit.

    Parameters
    ----------
    system : HybridSystem
        The system.
    totals : ndarray, shape (law,), optional
        Wanted values of the integrals; by default those of the first state that is looked at.
    freed : int, optional
        Index of an integral that is not kept, as a quantity of the orbit is fixed in its place; -1 for none.

    Attributes
    ----------
    terms : ndarray, shape (term, 3 + parameters)
        Added terms: the equation, the state, the coefficient, and the power of each parameter.
    wanted : ndarray, shape (law, 2)
        The equation, and the number that is added there.
    """

    def __init__(self, system: HybridSystem, totals: NDArray[np.float64] | None = None, freed: int = -1) -> None:
        self._laws, self.totals, self.freed = system.laws, totals, freed
        self._kept = np.flatnonzero(np.arange(len(self._laws)) != freed)
        self._which = np.flatnonzero(self._laws.rows != freed)
        self.terms = np.zeros((self._kept.size * self._which.size, 3 + len(system.parameters)))
        self.wanted = np.zeros((self._kept.size, 2))
        self._laid = False

    def __bool__(self) -> bool:
        return len(self._laws) > 0

    def keep(self, x: NDArray[np.float64], p: NDArray[np.float64], sizes: NDArray[np.float64]) -> None:
        """Lay the terms out for a first state, unless they are: what is kept stays the same for all orbits solved.

        x, sizes: shape (n,), a full state and sizes of the states; p: shape (parameters,).
        """
        laws = self._laws
        if self._laid or not self._kept.size or not np.all(np.isfinite(x)):
            return
        if self.totals is None:
            self.totals = laws.totals(x, p)
        leaf = Leaf(laws.matrix(p)[self._kept], sizes[: laws.states])
        self._follow, self._turn, self._laid = leaf.follow, leaf.turn, True
        each, at = self._which.size, np.searchsorted(self._kept, laws.rows[self._which])
        for k, row in enumerate(leaf.turn):
            part = self.terms[k * each : (k + 1) * each]
            part[:, 0], part[:, 1] = leaf.follow[k], laws.columns[self._which]
            part[:, 2] = row[at] * laws.coefficients[self._which]
            part[:, 3:] = laws.powers[self._which]
        self.wanted[:, 0], self.wanted[:, 1] = leaf.follow, leaf.turn @ self.totals[self._kept]

    def bend(
        self,
        active: Sequence[int],
        scales: NDArray[np.float64],
        place: tuple[int, int],
        p: NDArray[np.float64],
        u: NDArray[np.float64],
        v: NDArray[np.float64],
        found: NDArray[np.float64],
    ) -> None:
        """Add to the derivative of the Jacobian along `v` that of the terms, where coefficients have parameters.

        place: where the closing equations and the active parameters begin.
        """
        laws, (last, behind) = self._laws, place
        if not self._laid:
            return
        rows, n = last + self._follow, laws.states
        for k, index in enumerate(active):
            slopes = scales[k] * (self._turn @ laws.matrix(p, index)[self._kept])
            found[rows, :n] -= v[behind + k] * slopes
            found[rows, behind + k] -= slopes @ v[:n]
            for m, other in enumerate(active):
                twice = self._turn @ (laws.matrix(p, index, other)[self._kept] @ u[:n])
                found[rows, behind + k] -= scales[k] * scales[m] * v[behind + m] * twice

    def returning(
        self,
        x: NDArray[np.float64],
        p: NDArray[np.float64],
        rate: float,
        f: NDArray[np.float64],
        A: NDArray[np.float64],
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return a field and its derivative with the totals returning to those kept at a rate: zeros are isolated."""
        f, A = f.copy(), A.copy()
        if self._laid:
            matrix = self._turn @ self._laws.matrix(p)[self._kept]
            f[self._follow] -= rate * (matrix @ x[: self._laws.states] - self.wanted[:, 1])
            A[self._follow, : self._laws.states] -= rate * matrix
        return f, A

    def within(self, p: NDArray[np.float64], sizes: NDArray[np.float64], A: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivative of a field at given totals, of that in all states."""
        return self.leaf(p, sizes).within(A) if self._laws else A

    def reduced(
        self, J: NDArray[np.float64], p: NDArray[np.float64], sizes: NDArray[np.float64], n: int
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Return the Jacobian (size, size) of orbits of given totals, and the components that do not follow."""
        leaf, segments = self.leaf(p, sizes), len(J) // (n + 1)
        left = leaf.widened(n + 1)  # of a segment's states and duration
        rows = (np.arange(segments)[:, None] * (n + 1) + left).ravel()
        inner = leaf.moved(J[rows].reshape(-1, n + 1), n + 1)
        return np.ascontiguousarray(inner.reshape(rows.size, -1)), left[:-1]

    def leaf(self, p: NDArray[np.float64], sizes: NDArray[np.float64]) -> Leaf:
        """Return the states of given totals, for parameters and sizes of the states."""
        return Leaf(self._laws.matrix(p), sizes[: self._laws.states])
