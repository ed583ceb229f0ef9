"""Orbits of which a quantity keeps its value, as a condition in two parameters."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus.orbits.observables.gradients import gradient_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.orbits.observables.quantities import Quantity
    from saltus.orbits.problem import OrbitProblem

__all__ = ["Keeping"]


class Keeping:
    """A quantity of an orbit has a value; a `Condition` of `saltus.algebraic.conditions`.

    Parameters
    ----------
    problem : OrbitProblem
        The equations, meshes made.
    quantity : Quantity
        The quantity, as `read_quantity` returns it.
    value : float
        Its value.
    """

    extra, rows = 0, 1

    def __init__(self, problem: OrbitProblem, quantity: Quantity, value: float) -> None:
        self.problem, self.quantity, self.value = problem, quantity, value
        self.unit = abs(value) or 1.0

    def evaluate(
        self, u: NDArray[np.float64], extra: NDArray[np.float64], J: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return the scalar and its gradient."""
        beyond = self.quantity.beyond(self.quantity.value(self.problem, u), self.value)
        gradient = gradient_of(self.quantity, self.problem, u)
        return np.array([beyond / self.unit]), gradient[None, :] / self.unit, np.empty((1, 0))

    def adjust(self) -> None:
        """Do nothing: there are no borders of a matrix."""
