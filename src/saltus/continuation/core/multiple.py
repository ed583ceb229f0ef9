"""The point where several directions cross at once, as by symmetry, and all branches that meet there.

docs/theory/equilibria.md, "Multiple points", explains the search.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.errors import ConvergenceError
from saltus.scales import CENTRED, NEWTON_CONVERGED, REGULAR_SOLUTION, SINGULAR_AT_POINT, SOLUTIONS_ALIKE, TERMS_FAINT

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.core.zero_problem import Point

    Equations = Callable[[NDArray[np.float64]], tuple[NDArray[np.float64], NDArray[np.float64]]]

__all__ = ["branches_at", "crossing", "crossing_point", "equation_sizes"]

_NUDGE = 1e-6  # change of the unknowns, in their sizes, by which an equation without linear terms gets a size
_AMPLITUDE = 1e-2  # distance from the point, in sizes of the unknowns, at which branches are sought first
_FARTHER = 30.0  # factor by which it changes
_TRIES = 8  # most such changes
_NEAR = 1e-8  # least change of the parameter, in its unit, at a good amplitude
_FAR = 0.1  # largest such change
_CIRCLE = 32  # starts in the plane
_SPHERE = 60  # starts in each dimension of a larger space
_ITERATIONS = 60  # most Newton steps
_TURN = 0.3  # longest Newton step within the kernel, over the amplitude
_FARTHEST = 100.0  # distance from the point, over the amplitude and over the sizes, up to which a solution is sought
_SECANTS = 12  # most interpolations between there


def crossing(values: NDArray[np.floating[Any]]) -> int:
    """Return how many directions cross at once at a point, of the singular values of its Jacobian.

    Its equations are of size 1. None may have linear terms there: all singular values are then rounding.
    """
    return int(np.sum(values <= SINGULAR_AT_POINT * max(float(values[0]), 1.0)))


def equation_sizes(
    evaluate: Equations, u: NDArray[np.float64], J: NDArray[np.float64], sizes: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the size of each equation at a located point: of its linear terms, or of their change where they vanish.

    The point's error is a change of the unknowns: what is left of linear terms by that is 0.

    J: Jacobian at the point, shape (n, n + 1); sizes: those of the unknowns.
    """
    terms = np.abs(J * sizes).max(axis=1)
    with np.errstate(all="ignore"):
        near = np.abs((evaluate(u + _NUDGE * sizes)[1] - J) * sizes).max(axis=1) / _NUDGE
    near = np.where(np.isfinite(near), near, 0.0)
    clear = terms > np.maximum(TERMS_FAINT * terms.max(), SINGULAR_AT_POINT * near)
    terms = np.where(clear, terms, near)
    return np.where(terms > 0.0, terms, float(terms.max()) or 1.0)


def crossing_point(
    evaluate: Equations,
    growth: Callable[[NDArray[np.float64]], float],
    sides: tuple[Point, Point],
    sizes: NDArray[np.float64],
    count: int,
) -> NDArray[np.float64] | None:
    """Return the point of the known branch at which several values are critical, shape (n + 1,); None if there is none.

    A determinant vanishes there with a high power, and its sign is rounding around it: the values themselves do not.

    Parameters
    ----------
    evaluate : callable
        Returns equations, (n,), and their Jacobian, (n, n + 1).
    growth : callable
        Returns the mean growth of the values that are critical.
    sides : (Point, Point)
        Points of the known branch on both sides.
    sizes : ndarray, shape (n + 1,)
        Sizes of the unknowns.
    count : int
        How many values are critical.
    """
    a, b = sides
    row = a.weights * (b.u - a.u)
    row /= np.linalg.norm(row * sizes)

    def at(share: float) -> NDArray[np.float64]:
        u = (1.0 - share) * a.u + share * b.u
        for _ in range(3):  # Newton steps, but for those along the other branches
            F, J = evaluate(u)
            left, values, right = np.linalg.svd(np.vstack([J, row]) * sizes)
            inverse = np.append(1.0 / values[:-count], np.zeros(count))
            u = u + sizes * (right.T @ (inverse * (left.T @ np.append(-F, 0.0))))
        return u

    s, t, fs, ft = 0.0, 1.0, growth(a.u), growth(b.u)
    if fs * ft >= 0.0:
        return None
    for _ in range(_SECANTS):
        new = t - ft * (t - s) / (ft - fs)
        if not -1.0 < new < 2.0:
            return None
        s, t, fs, ft = t, new, ft, growth(at(new))
        if abs(t - s) < CENTRED or ft in (0.0, fs):
            return at(t)
    return at(t)


def branches_at(
    evaluate: Equations, u: NDArray[np.float64], sizes: NDArray[np.float64], own: NDArray[np.float64], what: str
) -> list[NDArray[np.float64]]:
    """Return a solution on each branch through a point but the known one, in an order that rounding does not change.

    Parameters
    ----------
    evaluate : callable
        Returns equations, (n,), and their Jacobian, (n, n + 1).
    u : ndarray, shape (n + 1,)
        The point, located; the parameter is last.
    sizes : ndarray, shape (n + 1,)
        Sizes of the unknowns.
    own : ndarray, shape (n + 1,)
        Tangent of the known branch.
    what : str
        What is sought.

    Raises
    ------
    ConvergenceError
        There is none, or they are not isolated.
    """
    search = _Search(evaluate, u, sizes, own)
    amplitude = _AMPLITUDE
    for _ in range(_TRIES):
        found = search.at(amplitude)
        moved = float(np.median([abs(z[-1]) for z in found])) if found else 1.0
        if _NEAR < moved < _FAR:
            break
        amplitude *= _FARTHER if moved <= _NEAR else 1.0 / _FARTHER
    found = [z for z in found if search.is_regular(z, amplitude)]
    if not found:
        hint = f"{search.dimension} directions cross at once, and no isolated branch leaves, as where the symmetry is "
        raise ConvergenceError(what, 0.0, _TRIES, hint + "continuous")
    return [u + sizes * z for z in found]


class _Search:
    """Solutions at a given distance from a point, in unknowns and equations of size 1."""

    def __init__(
        self, evaluate: Equations, u: NDArray[np.float64], sizes: NDArray[np.float64], own: NDArray[np.float64]
    ) -> None:
        self._evaluate, self._u, self._sizes = evaluate, u, sizes
        J = evaluate(u)[1]
        self._rows = 1.0 / equation_sizes(evaluate, u, J, sizes)
        left, values, right = np.linalg.svd(J * sizes * self._rows[:, None])
        self.dimension = crossing(values)
        kernel = right[-1 - self.dimension :]
        own = kernel @ (own / sizes)
        own /= np.linalg.norm(own)
        across = np.linalg.svd(own[None, :])[2][1:]
        self._own, self._across = own @ kernel, across @ kernel
        rank = values.size - self.dimension
        self._critical = left[:, rank:]
        self._response = (right[:rank].T / values[:rank]) @ left[:, :rank].T

    def _at(self, z: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        F, J = self._evaluate(self._u + self._sizes * z)
        return F * self._rows, J * self._sizes * self._rows[:, None]

    def at(self, amplitude: float) -> list[NDArray[np.float64]]:
        """Return one solution of each branch, at a distance from the known one within the kernel."""
        found: list[NDArray[np.float64]] = []
        for way in _ways(self.dimension):
            z = self._solved(amplitude, way)
            if z is None:
                continue
            z = z if _positive(self._across.T @ (self._across @ z)) else self._opposite(amplitude, z)
            if all(abs(self._cosine(z, other)) < 1.0 - SOLUTIONS_ALIKE for other in found):
                found.append(z)
        return sorted(found, key=self._place)

    def _place(self, z: NDArray[np.float64]) -> tuple[float, ...]:
        """Return by what branches are in order: the direction in the kernel, largest first."""
        inner = self._across.T @ (self._across @ z)
        return tuple((-np.round(inner / np.linalg.norm(inner), 4) + 0.0).tolist())

    def _opposite(self, amplitude: float, z: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the solution on the other half of a branch; the given one where the branch has one half alone."""
        other = self._solved(amplitude, -(self._across @ z) / amplitude)
        return z if other is None or self._cosine(z, other) > SOLUTIONS_ALIKE - 1.0 else other

    def _cosine(self, z: NDArray[np.float64], other: NDArray[np.float64]) -> float:
        a, b = self._across @ z, self._across @ other
        return float(a @ b / (np.linalg.norm(a) * np.linalg.norm(b)))

    def _solved(self, amplitude: float, way: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Return the solution to which Newton's method goes from a direction; None where it goes nowhere."""
        z = amplitude * way @ self._across
        z = z - self._response @ self._at(z)[0]
        F, J = self._at(z)
        if not np.all(np.isfinite(J)):
            return None
        slope = self._critical.T @ (J @ self._own)
        z = z - float(slope @ (self._critical.T @ F)) / (float(slope @ slope) or math.inf) * self._own
        for _ in range(_ITERATIONS):
            F, J = self._at(z)
            if not np.all(np.isfinite(J)):
                return None
            inner, matrix = self._across @ z, self._bordered(J, z, amplitude)
            defect = np.append(F, 0.5 * (float(inner @ inner) / amplitude - amplitude))
            try:
                step = np.linalg.solve(matrix, -defect)
            except np.linalg.LinAlgError:
                return None
            turn = float(np.linalg.norm(self._across @ step))
            z = z + min(1.0, _TURN * amplitude / turn if turn > 0.0 else 1.0) * step
            if not float(np.linalg.norm(z)) < _FARTHEST * max(1.0, amplitude):
                return None
            if float(np.linalg.norm(step)) < NEWTON_CONVERGED * amplitude:
                return np.asarray(z)
        return None

    def _bordered(self, J: NDArray[np.float64], z: NDArray[np.float64], amplitude: float) -> NDArray[np.float64]:
        """Return the Jacobian, bordered by the gradient of the distance from the known branch."""
        return np.vstack([J, (self._across @ z) @ self._across / amplitude])

    def is_regular(self, z: NDArray[np.float64], amplitude: float) -> bool:
        """Return whether a solution is isolated at its distance: no other one goes through it."""
        J = self._at(z)[1]
        slope = float(np.linalg.norm(self._critical.T @ (J @ self._own))) / amplitude
        least = float(np.linalg.svd(self._bordered(J, z, amplitude), compute_uv=False)[-1])
        return least > REGULAR_SOLUTION * slope * abs(float(self._own @ z)) > 0.0


def _ways(dimension: int) -> NDArray[np.float64]:
    """Return directions that are spread over all, shape (directions, dimension)."""
    if dimension == 2:
        angles = 2.0 * math.pi * (np.arange(_CIRCLE) + 0.35) / _CIRCLE
        return np.stack([np.cos(angles), np.sin(angles)], axis=1)
    spread = np.random.default_rng(1).normal(size=(_SPHERE * dimension, dimension))
    return np.asarray(spread / np.linalg.norm(spread, axis=1, keepdims=True))


def _positive(direction: NDArray[np.float64]) -> bool:
    """Return whether the first of a direction's large components is positive."""
    large = np.flatnonzero(np.abs(direction) >= 0.5 * float(np.abs(direction).max()))
    return bool(direction[large[0]] > 0.0)
