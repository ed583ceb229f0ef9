"""A search for the best orbit as a problem of mathematical programming: units, constraints, their meaning in words."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from saltus.optimisation.carrying import Carried, carried
from saltus.optimisation.expressions import Expressions, Found
from saltus.optimisation.sequential import Box, Local
from saltus.optimisation.stability import Stability, stability

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

__all__ = ["Limit", "Task"]

_ROUNDED = 1e-12  # distance from a bound, over a parameter's unit or value, up to which it is rounding


@dataclass(frozen=True)
class Limit:
    """A bound of an expression: its place among the expressions, the side (-1 lower, 1 upper) and the bound."""

    index: int
    side: int
    bound: float


@dataclass(frozen=True)
class Task:
    """What is sought: the objective comes first among the expressions."""

    expressions: Expressions  # objective and constraints
    names: tuple[str, ...]  # parameters that vary
    sign: float  # 1 where the objective is to be least, -1 where it is to be greatest
    limits: tuple[Limit, ...]  # bounds of expressions
    bounds: NDArray[np.float64]  # shape (2, names): bounds of the parameters
    radius: float  # modulus up to which multipliers may come
    first: Found  # what the start gives
    told: Callable[[Found], None]  # is called with each orbit that is found

    @cached_property
    def units(self) -> NDArray[np.float64]:
        """Units of the parameters: the range of the bounds, at most ten times the value; without bounds the value.

        That of a parameter 0 without bounds is the change that moves the objective by its own size.
        """
        low, high = self.bounds
        size, slopes = np.abs(self.first.carried.values), np.abs(self.first.slopes[0])
        objective = abs(self.first.values[0]) or 1.0
        by_slope = np.divide(objective, slopes, out=np.ones(len(slopes)), where=slopes > 0.0)
        free = np.where(size > 0.0, size, by_slope)
        width = np.where(size > 0.0, np.minimum(high - low, 10.0 * size), high - low)
        return np.where(np.isfinite(high - low), width, free)

    @cached_property
    def sizes(self) -> NDArray[np.float64]:
        """Units of the expressions: the largest of value, bound and change within a unit of a parameter."""
        bounds = np.zeros(len(self.expressions.names))
        for limit in self.limits:
            bounds[limit.index] = max(bounds[limit.index], abs(limit.bound))
        changes = np.abs(self.first.slopes * self.units).max(axis=1)
        sizes = np.maximum(np.maximum(np.abs(self.first.values), bounds), changes)
        return np.where(sizes > 0.0, sizes, 1.0)

    def box(self, reach: float, most: int) -> Box:
        """Return the bounds in units."""
        return Box(self.bounds[0] / self.units, self.bounds[1] / self.units, reach, most)

    def at(self, place: NDArray[np.float64], near: Local) -> Local | str:
        """Return what is known of the orbit at parameters in units, or why there is none."""
        values = np.clip(place * self.units, *self.bounds)
        rounding = _ROUNDED * np.maximum(self.units, np.abs(values))
        for bound in self.bounds:
            values = np.where(np.abs(values - bound) <= rounding, bound, values)
        return self._beyond(values, near)

    def local_beyond(self, near: Local, index: int, step: float) -> Local | str:
        """Return what is known of the orbit a step along one parameter further, bounds of the user's left aside."""
        values = near.data.carried.values.copy()
        values[index] += step * self.units[index]
        return self._beyond(values, near)

    def _beyond(self, values: NDArray[np.float64], near: Local) -> Local | str:
        there = carried(near.data.carried, values)
        found = there if isinstance(there, str) else self.found(there, near.data)
        if isinstance(found, str):
            return found
        self.told(found)
        local = self.local(found)
        if not np.all(np.isfinite(local.jacobian)):
            return "two multipliers meet: they have no derivatives"
        return local

    def found(self, there: Carried, near: Found | None) -> Found | str:
        """Return what an orbit gives."""
        return self.expressions.at(there, near)

    def stability(self, found: Found) -> Stability:
        """Return the test functions of stability."""
        return stability(found.multipliers, found.multiplier_slopes, self.radius)

    def local(self, found: Found) -> Local:
        """Return what an orbit gives, in units: first the limits, then stability."""
        scaled = found.slopes * self.units / self.sizes[:, None]
        heights = [
            -limit.side * (found.values[limit.index] - limit.bound) / self.sizes[limit.index] for limit in self.limits
        ]
        rows = np.array([-limit.side * scaled[limit.index] for limit in self.limits]).reshape(-1, len(self.names))
        if self.expressions.stable:
            kept = self.stability(found)
            heights, rows = [*heights, *kept.values.tolist()], np.vstack([rows, kept.slopes * self.units])
        return Local(
            found.carried.values / self.units, self.sign * float(found.values[0] / self.sizes[0]),
            self.sign * scaled[0], np.array(heights), rows, found,
        )  # fmt: skip

    def rates(self, multipliers: NDArray[np.float64], found: Found) -> list[tuple[str, str, float, float, float]]:
        """Return name, side, value, limit and multiplier of every constraint, as `Optimum` tells them.

        multipliers: of `optimality`, in units: those of the limits, of stability, of finite bounds.
        """
        size, rows = self.sign * float(self.sizes[0]), []
        for limit, multiplier in zip(self.limits, multipliers, strict=False):
            rate = -limit.side * size * multiplier / self.sizes[limit.index]
            name, value = self.expressions.names[limit.index], float(found.values[limit.index])
            rows.append((name, _SIDES[limit.side], value, limit.bound, float(rate)))
        done = len(self.limits)
        if self.expressions.stable:
            rate = -size * float(multipliers[done : done + 3] @ self.stability(found).by_radius)
            largest = float(np.abs(found.multipliers).max(initial=0.0))
            rows.append(("stable", "upper", largest, self.radius, rate))
            done += 3
        for side, bounds in ((-1, self.bounds[0]), (1, self.bounds[1])):
            for i in np.flatnonzero(np.isfinite(bounds)).tolist():
                rate = -side * size * multipliers[done] / self.units[i]
                rows.append(
                    (self.names[i], _SIDES[side], float(found.carried.values[i]), float(bounds[i]), float(rate))
                )
                done += 1
        return rows


_SIDES = {-1: "lower", 1: "upper"}


def worded(names: tuple[str, ...], values: NDArray[np.float64]) -> str:
    """Return parameters with their values in words."""
    return ", ".join(f"{name} = {value:.9g}" for name, value in zip(names, values, strict=True) if math.isfinite(value))
