"""Quantities along a curve that are to pass a value or have an extremum: their monitor functions."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from saltus.orbits.observables.quantities import Quantity
    from saltus.orbits.problem import OrbitProblem

__all__ = ["EXTREMUM", "Watched", "beyond", "slope"]

EXTREMUM = "extremum"  # what a user's event asks for in place of a value
_STEP = 1e-3  # arclength of a step by which a quantity of a point is differentiated


@dataclass(frozen=True)
class Watched:
    """A quantity and the value that it is to pass."""

    quantity: Quantity  # what is watched
    value: float

    def distance(self, problem: OrbitProblem, u: NDArray[np.float64]) -> float:
        """Return how far the quantity of an orbit is from the value.

        Of a phase, which jumps by a turn, it is the sine of the angle between both. The sine is continuous, and
        vanishes half a turn away as well.
        """
        value = self.quantity.value(problem, u)
        if self.quantity.turn and math.isfinite(value):
            return math.sin(self._angle(value))
        return value - self.value

    def opposite(self, problem: OrbitProblem, u: NDArray[np.float64]) -> bool:
        """Return whether a phase is half a turn from the value."""
        return bool(self.quantity.turn) and math.cos(self._angle(self.quantity.value(problem, u))) < 0.0

    def _angle(self, value: float) -> float:
        return 2.0 * math.pi / self.quantity.turn * self.quantity.beyond(value, self.value)


def slope(
    quantity: Callable[[NDArray[np.float64]], float], u: NDArray[np.float64], tangent: NDArray[np.float64]
) -> float:
    """Return the derivative of a quantity of the unknowns along a curve, by differences of order 4.

    Parameters
    ----------
    quantity : callable
        Returns the quantity at unknowns.
    u, tangent : ndarray
        Unknowns, and the tangent of length 1.
    """
    far, near = (
        (quantity(u + step * tangent) - quantity(u - step * tangent)) / (2.0 * step) for step in (_STEP, 0.5 * _STEP)
    )
    return near + (near - far) / 3.0


def beyond(distance: float) -> float:
    """Return the distance from a bound, or zero where it is rounding."""
    return distance if abs(distance) > 1e-12 else 0.0
