"""Curves through a point at which the bifurcation equation degenerates, one direction being critical.

All real roots of the equation on small circles are found; docs/theory/equilibria.md, "Touching eigenvalues".
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from saltus.errors import ConvergenceError
from saltus.scales import CURVES_ALIKE, FORM_DEGENERATE, NEWTON_CONVERGED, TERMS_FAINT

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Equations = Callable[[NDArray[np.float64]], tuple[NDArray[np.float64], NDArray[np.float64]]]
    Bends = Callable[..., NDArray[np.float64]]

__all__ = ["Germ"]


class Germ:
    """The bifurcation equation near a point, in two unknowns: along the known branch, and across.

    Parameters
    ----------
    evaluate : callable
        Returns equations, (n,), and their Jacobian, (n, n + 1).
    u : ndarray, shape (n + 1,)
        The point, located; the parameter is last.
    sizes : ndarray, shape (n + 1,)
        Sizes of the unknowns.
    own : ndarray, shape (n + 1,)
        Tangent of the known branch, a little before the point.
    """

    def __init__(
        self, evaluate: Equations, u: NDArray[np.float64], sizes: NDArray[np.float64], own: NDArray[np.float64]
    ) -> None:
        self._evaluate, self._u, self._sizes = evaluate, u, sizes
        J = evaluate(u)[1] * sizes
        terms = np.abs(J).max(axis=1)
        self._rows = 1.0 / np.where(terms > TERMS_FAINT * terms.max(), terms, float(terms.max()) or 1.0)
        left, _, right = np.linalg.svd(J * self._rows[:, None])
        kernel = right[-2:]
        own = kernel @ (own / sizes)
        own /= np.linalg.norm(own)
        self._kernel = np.array([own @ kernel, np.array([-own[1], own[0]]) @ kernel])
        self._left = left[:, -1]
        self._unit = self._balanced()

    def curves(self, what: str) -> list[NDArray[np.float64]]:
        """Return a solution on each curve through the point but the known one; none where no other curve is real.

        A curve that ends at the point, as each half of a cusp, counts by itself.

        Raises
        ------
        ConvergenceError
            Circles of different radii do not meet the same curves; `what` says what was sought.
        """
        radius, rows = 0.08, [self._roots(0.08)]
        while len(rows) < 12:
            radius *= 0.5
            rows.append(self._roots(radius))
            if len(rows) > 2 and _agree(rows[-3:]):
                return [self._u + self._sizes * z for z in self._others(np.array(rows[-3:]), radius)]
        hint = (
            "to second order branches leave in the same direction, and circles round the point do not tell them apart"
        )
        raise ConvergenceError(what, radius, len(rows), hint)

    def degenerates(self, second: Bends, third: Bends) -> bool:
        """Return whether the bifurcation equation has no two directions to second order, above its error.

        Its discriminant decides: the known branch's direction has an error, and by it another quadratic form.
        second, third: second derivatives twice along two directions, shape (n,), and third ones along three.
        """
        left, (along, across) = self._left * self._rows, self._sizes * self._kernel
        own, mixed, other = (
            float(left @ second(*ways)) for ways in ((along, along), (along, across), (across, across))
        )
        mixed = self._unit * math.sqrt(max(mixed * mixed - own * other, 0.0))
        terms = abs(other), abs(float(left @ third(across, across, across)))
        return mixed <= FORM_DEGENERATE * max(terms)

    def _balanced(self) -> float:
        """Return the way along the known branch that changes the critical slope as the unit way across does."""

        def slopes(z: NDArray[np.float64]) -> NDArray[np.float64]:
            with np.errstate(over="ignore", invalid="ignore"):  # far away fields overflow
                J = self._evaluate(self._u + self._sizes * z)[1] * self._sizes * self._rows[:, None]
                return np.asarray(np.nan_to_num(np.abs(self._left @ J @ self._kernel.T), nan=math.inf))

        mixed, wanted = np.max([slopes(side * 0.1 * self._kernel[1]) for side in (-1.0, 1.0)], axis=0)
        low, high = -30.0, 30.0
        for _ in range(40):
            unit = 10.0 ** (0.5 * (low + high))
            reached = max(slopes(side * 0.1 * unit * self._kernel[0])[1] for side in (-1.0, 1.0))
            less = reached < (1.0 - CURVES_ALIKE) * max(wanted, unit * mixed)
            low, high = (0.5 * (low + high), high) if less else (low, 0.5 * (low + high))
        return float(10.0**low) if -29.0 < low < 29.0 else 1.0

    def _solved(self, inner: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        """Return the bifurcation equation at a place in the kernel, and the unknowns that solve all others there."""
        n = self._left.size
        z, value = inner @ self._kernel, math.nan
        matrix = np.zeros((n + 2, n + 2))
        matrix[:n, -1], matrix[n:, :-1] = -self._left, self._kernel
        size = float(np.abs(inner).max())
        for _ in range(12):
            F, J = self._evaluate(self._u + self._sizes * z)
            if not np.isfinite(J).all():
                return math.nan, z
            matrix[:n, :-1] = J * self._sizes * self._rows[:, None]
            defect = np.concatenate([-F * self._rows, inner - self._kernel @ z])
            try:
                step = np.linalg.solve(matrix, defect)
            except np.linalg.LinAlgError:
                return math.nan, z
            z, value = z + step[:-1], float(step[-1])
            if float(np.abs(step[:-1]).max()) < NEWTON_CONVERGED * size:
                return value, z
        return math.nan, z

    def _at(self, angle: float, radius: float) -> tuple[float, NDArray[np.float64]]:
        return self._solved(radius * np.array([self._unit * math.cos(angle), math.sin(angle)]))

    def _roots(self, radius: float) -> NDArray[np.float64]:
        """Return the directions in which curves cross a circle, in order."""
        from scipy.optimize import brentq

        near = np.concatenate([-np.logspace(-0.4, -7.0, 36), np.logspace(-7.0, -0.4, 36)])
        angles = np.concatenate([k * 0.5 * math.pi + near for k in range(4)])
        angles = np.sort(np.concatenate([angles, np.linspace(-0.31, 2.0 * math.pi - 0.33, 96)]))
        angles = angles[(angles >= angles[0]) & (angles < angles[0] + 2.0 * math.pi)]
        values = np.array([self._at(float(angle), radius)[0] for angle in angles])
        angles = np.append(angles, angles[0] + 2.0 * math.pi)
        values = np.append(values, values[0])
        found = []
        for i in range(angles.size - 1):
            if values[i] * values[i + 1] < 0.0 or values[i] == 0.0:
                low, high = float(angles[i]), float(angles[i + 1])
                try:
                    zero = low if values[i] == 0.0 else brentq(lambda a: self._at(a, radius)[0], low, high, xtol=1e-15)
                except ValueError:  # the equation has no value between them
                    zero = math.nan
                found.append(float(zero))
        kept: list[float] = []
        for angle in found:  # rounding about a root makes it three
            if kept and angle - kept[-1] < 1e-6:
                kept.pop()
            else:
                kept.append(angle)
        return np.array(kept)

    def _others(self, rows: NDArray[np.float64], radius: float) -> list[NDArray[np.float64]]:
        """Return a solution on each curve but the known one, from the directions at three radii, shape (3, halves)."""
        radii = radius * np.array([4.0, 2.0, 1.0])
        places = np.stack([radii[:, None] * np.cos(rows), radii[:, None] * np.sin(rows)], axis=2)
        free, curves = list(range(rows.shape[1])), []
        while free:
            first = free.pop(0)
            opposite = self._opposite(places, first, free)
            curves.append([first] if opposite is None else [first, opposite])
            if opposite is not None:
                free.remove(opposite)
        own = self._own(rows[2], curves)
        kept = [curve[0] for curve in curves if curve is not own]
        return [self._at(float(rows[2, k]), radius)[1] for k in kept]

    @staticmethod
    def _opposite(places: NDArray[np.float64], first: int, free: list[int]) -> int | None:
        """Return the half that goes on beyond the point where a half ends; None where its curve ends there."""
        own = places[:, first]
        main = int(np.argmax(np.abs(own[2])))
        t, y = own[:, main], own[:, 1 - main]
        ahead = 0.0
        for i in range(3):  # the cubic through the point and three places
            share = -t[2] / t[i]
            for j in range(3):
                if j != i:
                    share *= (-t[2] - t[j]) / (t[i] - t[j])
            ahead += share * y[i]
        radius = float(np.linalg.norm(own[2]))
        apart = {}
        for k in free:
            x = places[2, k]
            if x[main] * t[2] < 0.0 and abs(x[1 - main] - ahead) < CURVES_ALIKE * radius:
                apart[k] = abs(float(x[1 - main]) - ahead)
        return min(apart, key=apart.__getitem__, default=None)

    @staticmethod
    def _own(angles: NDArray[np.float64], curves: list[list[int]]) -> list[int] | None:
        """Return the known curve: of those along it that which bends least."""
        turned = {
            i: max(abs(math.remainder(float(angles[k]), math.pi)) for k in curve) for i, curve in enumerate(curves)
        }
        least = min(turned, key=turned.__getitem__, default=None)
        return None if least is None or turned[least] > 2.0 * CURVES_ALIKE else curves[least]


def _agree(rows: list[NDArray[np.float64]]) -> bool:
    """Return whether the same curves are met at three radii: as many, each in nearly the same direction."""
    return len({row.size for row in rows}) == 1 and bool(np.all(np.abs(rows[0] - rows[2]) < CURVES_ALIKE))
