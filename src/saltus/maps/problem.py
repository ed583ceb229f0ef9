"""Orbits of a map as the zeros of the equations of their points, with derivatives up to the third.

docs/theory/map_orbits.md, "Equations", says why all points are unknowns.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from saltus.system.angles import wrapped

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from saltus.system.maps import Map

__all__ = ["MapOrbitProblem"]


@dataclass
class MapOrbitProblem:
    """The equations f(x[i], p) = x[i + 1] of an orbit, each image that of the piece which the itinerary names.

    The unknowns are all points, one after the other, then the active parameters. So long orbits with large multipliers
    are as well conditioned as short ones.

    Parameters
    ----------
    system : Map
        The map.
    itinerary : tuple of int
        Index of the piece at each point.
    p : ndarray, shape (parameters,)
        All parameters; the active ones are overwritten by the unknowns.
    active : sequence of int
        Parameters among the unknowns, growing.
    scales : ndarray, shape (active,)
        Units of the active parameters.

    Attributes
    ----------
    n : int
        Number of equations, ``period * states``.
    states, period : int
        Numbers of states and of points.
    closing : ndarray, shape (n, n)
        Minus the derivative of the last equation in the point behind the last: a multiplier mu makes
        ``A + (1 - mu) closing`` singular, with the derivative A of the equations in the points.
    """

    system: Map
    itinerary: tuple[int, ...]
    p: NDArray[np.float64]
    active: Sequence[int] = ()
    scales: NDArray[np.float64] = field(default_factory=lambda: np.ones(0))

    def __post_init__(self) -> None:
        self.states, self.period = len(self.system.states), len(self.itinerary)
        self.n = self.states * self.period
        self.circles = np.add.outer(self.states * np.arange(self.period), self.system.angle_places).ravel()
        self.p = self.p.copy()
        self._active = np.array(self.active, dtype=np.int64)
        self.scales = np.array(self.scales, dtype=np.float64)
        self.compiled = self.system.compiled
        self._frame = np.concatenate([np.zeros(self.states), np.eye(self.states).ravel()])
        self._out = np.empty(self.states * (self.states + 1))
        self._column = np.empty(self.states)

    @property
    def closing(self) -> NDArray[np.float64]:
        """See the class."""
        B = np.zeros((self.n, self.n))
        B[self.n - self.states :, : self.states] = np.eye(self.states)
        return B

    def along(self, itinerary: tuple[int, ...]) -> MapOrbitProblem:
        """Return the same equations for another itinerary."""
        return MapOrbitProblem(self.system, itinerary, self.p, self.active, self.scales)

    def points(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the points among the unknowns, shape (period, states)."""
        return u[: self.n].reshape(self.period, self.states)

    def parameters_at(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return all parameters, shape (parameters,), where the unknowns are `u`."""
        p = self.p.copy()
        p[self._active] = u[self.n :] * self.scales
        return p

    def slopes(self, u: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return images, (period, states), their derivatives in the states and in the active parameters, by points."""
        s, p = self.states, self.compiled.extended(self.parameters_at(u))
        images = np.empty((self.period, s))
        slopes, forcing = np.empty((self.period, s, s)), np.empty((self.period, s, self._active.size))
        for i, (piece, x) in enumerate(zip(self.itinerary, self.points(u), strict=True)):
            self._frame[:s] = x
            self.compiled.call("vary", piece, s, self._frame, p, self._out)
            images[i], slopes[i] = self._out[:s], self._out[s:].reshape(s, s)
            for k, index in enumerate(self.active):
                self.compiled.call("field_p", piece, int(index), self._frame, p, self._column)
                forcing[i, :, k] = self._column * self.scales[k]
        return images, slopes, forcing

    def evaluate(self, u: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the images less the next points, shape (n,), and their derivatives, shape (n, n + active)."""
        images, slopes, forcing = self.slopes(u)
        F = (images - np.roll(self.points(u), -1, axis=0)).ravel()
        if self.circles.size:
            F = wrapped(F, self.circles)
        J = np.zeros((self.n, u.size))
        self._spread(J, slopes)
        rows, s = np.arange(self.n), self.states
        J[rows, (rows + s) % self.n] -= 1.0
        J[:, self.n :] = forcing.reshape(self.n, -1)
        return F, J

    def _spread(self, J: NDArray[np.float64], blocks: NDArray[np.float64]) -> None:
        """Write a block for each point on the diagonal."""
        s = self.states
        for i, block in enumerate(blocks):
            J[i * s : (i + 1) * s, i * s : (i + 1) * s] = block

    def second(self, u: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivative of the Jacobian in the unknowns along `v`, both shape (n, n + active)."""
        s, p, functions = self.states, self.parameters_at(u), self.system.second(tuple(self.active))
        found = np.zeros((self.n, u.size))
        along = v[self.n :] * self.scales
        for i, (piece, x) in enumerate(zip(self.itinerary, self.points(u), strict=True)):
            at = slice(i * s, (i + 1) * s)
            block = functions.field(piece, x, np.append(v[at], along), p)
            found[at, at] = block[:, :s]
            found[at, self.n :] = block[:, s:] * self.scales
        return found

    def third(self, u: NDArray[np.float64], *directions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the third derivative of the equations in the points along three directions, shape (n,)."""
        s, p, functions = self.states, self.parameters_at(u), self.system.third
        rows = [direction[: self.n].reshape(self.period, s) for direction in directions]
        parts = [
            functions.field(piece, x, *(row[i] for row in rows), p=p)
            for i, (piece, x) in enumerate(zip(self.itinerary, self.points(u), strict=True))
        ]
        return np.concatenate(parts)

    def heights(self, u: NDArray[np.float64]) -> list[tuple[int, int, float]]:
        """Return (point, condition, value) for each condition of each point's piece; positive in the piece."""
        rows, p, out = self.system.guards, self.compiled.extended(self.parameters_at(u)), np.empty(1)
        found = []
        for i, (piece, x) in enumerate(zip(self.itinerary, self.points(u), strict=True)):
            for guard in range(int(rows[piece]), int(rows[piece + 1])):
                self.compiled.call("guard", guard, 0, np.ascontiguousarray(x), p, out)
                found.append((i, guard, float(out[0])))
        return found

    def border(self, point: int, guard: int, u: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        """Return a condition at one of the points, and its gradient in the unknowns, shape (n + active,)."""
        s, functions = self.states, self.system.borders
        at, k = slice(point * s, (point + 1) * s), guard - len(self.system.pieces)
        p = functions.compiled.extended(self.parameters_at(u))
        values, slopes = functions.compiled.linearised(k, np.ascontiguousarray(u[at]), p)
        gradient = np.zeros(u.size)
        gradient[at] = slopes[0]
        for j, index in enumerate(self.active):
            functions.compiled.call("field_p", k, int(index), np.ascontiguousarray(u[at]), p, self._column)
            gradient[self.n + j] = self._column[0] * self.scales[j]
        return float(values[0]), gradient

    def rounding(self, u: NDArray[np.float64], J: NDArray[np.float64], sizes: NDArray[np.float64]) -> float:
        """Return the largest distance of an image from the next point over the sizes of its terms."""
        F = np.abs(self.evaluate(u)[0])
        rows, s = np.arange(self.n), self.states
        own = J[:, : self.n].copy()
        own[rows, (rows + s) % self.n] += 1.0
        terms = np.abs(own) @ sizes + sizes[(rows + s) % self.n]
        top = float(terms.max())
        return float(np.max(F / np.maximum(terms, 1e-12 * top))) if top > 0.0 else float(np.max(F))
