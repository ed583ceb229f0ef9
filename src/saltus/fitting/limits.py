"""What limits parameters beside the data's noise: ends of sheets, reaches of jumps, bounds; and the best fit within.

About an optimum residuals are linear in the parameters. Along an end of a sheet the likelihood has a wall: data lose
the sheet there. At the edge of a reach its slope has a kink. Errors of linear theory know neither. So the least squares
of this linear model are sought within the walls, and intervals are where its loss rises by 1.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from saltus.fitting.jumps import DOWN
from saltus.fitting.optimum import loss_weights, total_loss

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.fitting.evaluation import Evaluation

__all__ = ["Limit", "Linear", "limited", "limits_of"]

_RISE = 1.0  # of the loss at the ends of an interval
_STEPS = 200  # of the quadratic programme, at most


class Limit(NamedTuple):
    """Something at which the likelihood is not smooth, at a distance that is linear in the parameters."""

    words: str  # what it is
    gap: float  # the distance
    slopes: NDArray[np.float64]  # its derivatives by the varied parameters
    is_wall: bool  # whether the loss jumps there; it only bends else


def limits_of(
    found: Evaluation, names: Sequence[str], values: NDArray[np.float64], bounds: NDArray[np.float64]
) -> list[Limit]:
    """Return what the likelihood is not smooth at."""
    return [*_ends(found), *_reaches(found), *_bounds(names, values, bounds)]


def _ends(found: Evaluation) -> list[Limit]:
    """Return the ends of sheets that data would lose: of each end its distance to the nearest datum."""
    compared, (sheets, places, _), reached = found.compared, found.assigned, found.reached
    names = found.instrument.of_model(found.names)
    own = [found.names.index(name) for name in names]
    told = []
    for sheet in found.sheets:
        rows = np.flatnonzero((sheets == sheet.number) & reached)
        for upper in (False, True):
            end = sheet.ends[upper]
            if end is None or not rows.size:
                continue
            sign = 1.0 if upper else -1.0
            gaps = sign * (sheet.bounds[upper] - places[rows])
            row = int(rows[np.argmin(gaps)])
            if _is_as_near(compared.squares, compared.inside, sheet.number, row):
                continue
            slopes = np.zeros(len(found.names))
            slopes[own] = sign * sheet.place_slopes(upper, names)
            if found.instrument.offset in found.names:
                slopes[found.names.index(found.instrument.offset)] = -sign
            at = f"{found.measured.along} = {found.measured.x[row]:.6g}"
            told.append(Limit(f"the {end.type} at which a sheet ends next to the datum {row} at {at}",
                              max(float(gaps.min()), 0.0), slopes, True))  # fmt: skip
    return told


def _is_as_near(squares: NDArray[np.float64], inside: NDArray[np.bool_], sheet: int, row: int) -> bool:
    """Whether a datum that lost its sheet would lie on another one as well, by the rise that ends an interval."""
    others = [k for k in np.flatnonzero(inside[:, row]).tolist() if k != sheet]
    if not others:
        return False
    other, own = (total_loss(np.sqrt(square)) for square in (squares[others, row].min(), squares[sheet, row]))
    return other - own < _RISE


def _reaches(found: Evaluation) -> list[Limit]:
    """Return both edges of the reach of each jump."""
    told = []
    for point, one in zip(found.measured.points, found.special, strict=True):
        if one is None or not point.reach:
            continue
        away, slopes = found.point_moves(point, one)
        low, high = (-point.reach, 0.0) if point.direction == DOWN else (0.0, point.reach)
        words = f"the reach of the jump {point.direction} at {point.value:.6g}"
        told += [Limit(words, away - low, slopes, False), Limit(words, high - away, -slopes, False)]
    return told


def _bounds(names: Sequence[str], values: NDArray[np.float64], bounds: NDArray[np.float64]) -> list[Limit]:
    unit = np.eye(len(names))
    told = [
        Limit(f"the bound of {name}", float(values[i] - bounds[0, i]), unit[i], True) for i, name in enumerate(names)
    ]
    return told + [
        Limit(f"the bound of {name}", float(bounds[1, i] - values[i]), -unit[i], True) for i, name in enumerate(names)
    ]


@dataclass(frozen=True)
class Linear:
    """The linear model of residuals about a set of parameters, with all that limits these."""

    evaluation: Evaluation  # residuals and derivatives
    values: NDArray[np.float64]  # shape (vary,): the parameters
    bounds: NDArray[np.float64]  # shape (2, vary): their least and greatest values
    spread: NDArray[np.float64]  # shape (vary, vary): covariance by linear theory

    @cached_property
    def limits(self) -> list[Limit]:
        """What the likelihood is not smooth at."""
        return limits_of(self.evaluation, self.evaluation.names, self.values, self.bounds)

    def limiting(self, index: int) -> str:
        """Return in words what limits a parameter: what lies within one standard error of linear theory."""
        error = float(np.sqrt(self.spread[index, index]))
        if not np.isfinite(error) or not error > 0.0:
            return ""
        line = self.spread[:, index] / error
        found = [one.words for one in self.limits if abs(one.gap) <= abs(float(one.slopes @ line))]
        return " and ".join(dict.fromkeys(found))

    @cached_property
    def _sizes(self) -> NDArray[np.float64]:
        """Sizes of changes: errors, or the range of the bounds where the data do not tell them."""
        errors, ranges = np.sqrt(np.diag(self.spread)), np.ptp(self.bounds, axis=0)
        return np.asarray(np.where(np.isfinite(errors) & (errors > 0.0), np.minimum(errors, ranges), ranges))

    @cached_property
    def _loss(
        self,
    ) -> tuple[Callable[[NDArray[np.float64]], float], Callable[[NDArray[np.float64]], NDArray[np.float64]]]:
        """The loss of the linear model above that of the parameters, and its gradient, by changes over `_sizes`.

        Residuals of jumps are their distances from the reach, whose kink is kept.
        """
        found, points = self.evaluation, self.evaluation.measured.points
        residuals, jacobian = found.residuals, found.jacobian * self._sizes
        weights = loss_weights(residuals)
        first = found.measured.rows * len(found.measured)
        smooth = np.ones(residuals.size, dtype=bool)
        hinges = []
        for k, (point, one) in enumerate(zip(points, found.special, strict=True)):
            if one is not None and point.reach:
                smooth[first + k] = False
                away, slopes = found.point_moves(point, one)
                low, high = (-point.reach, 0.0) if point.direction == DOWN else (0.0, point.reach)
                hinges.append((away / point.sigma, low / point.sigma, high / point.sigma,
                               slopes * self._sizes / point.sigma, weights[first + k]))  # fmt: skip
        rows, kept, roots = residuals[smooth], jacobian[smooth], weights[smooth]
        begun = float(weights @ residuals**2)

        def off(change: NDArray[np.float64]) -> list[tuple[float, NDArray[np.float64], float]]:
            told = []
            for away, low, high, slopes, weight in hinges:
                there = away + float(slopes @ change)
                told.append((there - min(max(there, low), high), slopes, weight))
            return told

        def loss(change: NDArray[np.float64]) -> float:
            seen = rows + kept @ change
            return float(roots @ seen**2) + sum(weight * one**2 for one, _, weight in off(change)) - begun

        def gradient(change: NDArray[np.float64]) -> NDArray[np.float64]:
            total = 2.0 * ((roots * (rows + kept @ change)) @ kept)
            for one, slopes, weight in off(change):
                total = total + 2.0 * weight * one * slopes
            return np.asarray(total)

        return loss, gradient

    @cached_property
    def least(self) -> tuple[NDArray[np.float64], float]:
        """Change of the parameters to the least loss of the linear model within walls and bounds, and the fall."""
        loss, gradient = self._loss
        change = self._solved(loss, gradient, [])
        fall = -loss(change)
        return (change * self._sizes, fall) if fall > 0.0 else (np.zeros(len(self.values)), 0.0)

    def interval(self, index: int) -> tuple[float, float]:
        """Return how far a parameter may go below and above, until the loss has risen by 1 or a wall is met."""
        return min(self._farthest(index, -1.0), 0.0), max(self._farthest(index, 1.0), 0.0)

    def _farthest(self, index: int, sign: float) -> float:
        """Return the largest change of a parameter on one side at which the loss may have risen by 1."""
        loss, gradient = self._loss
        _, fall = self.least
        unit = np.zeros(len(self.values))
        unit[index] = -sign
        most = {
            "type": "ineq",
            "fun": lambda change: _RISE - fall - loss(change),
            "jac": lambda change: -gradient(change),
        }
        change = self._solved(lambda change: float(unit @ change), lambda _: unit, [most])
        return float(change[index] * self._sizes[index])

    def _solved(
        self,
        goal: Callable[[NDArray[np.float64]], float],
        slope: Callable[[NDArray[np.float64]], NDArray[np.float64]],
        conditions: list[dict[str, object]],
    ) -> NDArray[np.float64]:
        """Return the change of least goal within walls and bounds, under further conditions."""
        from scipy.optimize import minimize

        walls = [one for one in self.limits if one.is_wall][: -2 * len(self.values)]
        if walls:
            gaps = np.array([one.gap for one in walls])
            table = np.array([one.slopes for one in walls]) * self._sizes
            units = np.linalg.norm(table, axis=1)
            kept = units > 0.0
            gaps, table = gaps[kept] / units[kept], table[kept] / units[kept, None]
            conditions = [
                *conditions,
                {"type": "ineq", "fun": lambda change: gaps + table @ change, "jac": lambda _: table},
            ]
        low, high = (self.bounds - self.values) / self._sizes
        found = minimize(
            goal, np.zeros(len(self.values)), jac=slope, method="SLSQP", constraints=conditions,
            bounds=list(zip(np.minimum(low, 0.0), np.maximum(high, 0.0), strict=True)),
            options={"maxiter": _STEPS, "ftol": 1e-10},
        )  # fmt: skip
        return np.asarray(found.x)


def limited(linear: Linear) -> tuple[dict[str, str], dict[str, tuple[float, float]]]:
    """Return in words what limits parameters, and the intervals of these."""
    limits, intervals = {}, {}
    for i, name in enumerate(linear.evaluation.names):
        if words := linear.limiting(i):
            low, high = linear.interval(i)
            limits[name] = words
            intervals[name] = float(linear.values[i] + low), float(linear.values[i] + high)
    return limits, intervals
