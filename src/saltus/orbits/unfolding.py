"""The equations of a periodic orbit with a quantity fixed and one more unknown, which is regular in a family.

The further unknown is a parameter, or the strength of a gap along the equations' left null vector. In a family of
orbits at fixed parameters the gap vanishes. docs/theory/conservative.md derives the equations.

References
----------
Sepulchre and MacKay, Localized oscillations in conservative or dissipative networks of weakly coupled autonomous
oscillators, Nonlinearity 10 (1997) 679-713; Munoz-Almaraz, Freire, Galan, Doedel and Vanderbauwhede, Continuation of
periodic orbits in conservative and Hamiltonian systems, Physica D 181 (2003) 1-38. Departs from both in the unfolding:
a gap between the orbit's end and its start takes the place of a term in the field, so that no system is compiled anew
and resets are allowed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.errors import InputError
from saltus.orbits.observables.gradients import gradient_of
from saltus.orbits.observables.quantities import Quantity, read_quantity, sizes_of_unknowns
from saltus.orbits.stability.critical import scaling
from saltus.scales import DEFICIENT, GAP_TURNED, GRADIENT_KEPT, LEAST_APART

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.contents import Contents
    from saltus.orbits.problem import OrbitProblem
    from saltus.system import HybridSystem

__all__ = ["Fixed", "UnfoldedEquations", "fixed_from", "read_fixed", "unit_of_parameter"]


@dataclass(frozen=True)
class Fixed:
    """What was fixed when an orbit was solved, and what was freed."""

    quantity: str  # name of the quantity
    value: float  # its value
    free: str = ""  # the parameter that was freed; empty where none was
    family: bool = False  # whether the orbit is one of a family at fixed parameters, as in a conservative system

    def as_list(self) -> list[Any]:
        """Return quantity, value, freed parameter and family as a file holds them."""
        return [self.quantity, self.value, self.free, self.family]

    def __str__(self) -> str:
        by = f" by {self.free}" if self.free else ""
        return f"{self.quantity} = {self.value:.9g}{by}{', one of a family' if self.family else ''}"


def read_fixed(held: Contents, system: HybridSystem) -> Fixed | None:
    """Return what a file says of a fixed quantity, checked; None where it says nothing."""
    if "fixed" not in held.dataset.attrs:
        return None
    return fixed_from(held.json("fixed", list), system)


def fixed_from(parts: Any, system: HybridSystem) -> Fixed:
    """Return what `Fixed.as_list` gave, checked."""
    if not isinstance(parts, list) or len(parts) != 4:
        raise InputError("attribute 'fixed'", parts, "a quantity, its value, a parameter or '', and true or false")
    quantity = read_quantity(system, parts[0]).name
    value = checks.number("attribute 'fixed'", parts[1])
    free = checks.chosen("attribute 'fixed'", parts[2], ("", *system.parameter_names))
    return Fixed(quantity, value, free, checks.flag("attribute 'fixed'", parts[3]))


class UnfoldedEquations:
    """Segment equations with one more unknown and, last, the equation of a quantity.

    The unknowns are those of the orbit, then the freed parameter in its unit, or the strength of the gap.

    Parameters
    ----------
    problem : OrbitProblem
        The segment equations, with one active parameter or none. Without one a gap is the further unknown.
    quantity : Quantity
        What is fixed.
    value : float
        Its value.

    Attributes
    ----------
    gap : ndarray, shape (size,)
        Direction of the gap, in the units of the equations; zero where a parameter is freed.
    size : float
        How much the quantity varies with the sizes of the unknowns.
    unit : float
        Factor on the quantity's equation that gives it the size of the others.
    """

    def __init__(self, problem: OrbitProblem, quantity: Quantity, value: float) -> None:
        self.problem, self.quantity, self.value = problem, quantity, value
        self.gap = np.zeros(problem.size)
        self.size, self.unit = 0.0, 1.0
        self._known: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None

    @property
    def by_parameter(self) -> bool:
        """Whether the further unknown is a parameter."""
        return len(self.problem.active) > 0

    def gradient(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the quantity's derivatives in the unknowns, shape (size + 1,)."""
        wide = self.problem.size + 1
        if self._known is not None:
            moved = np.abs(u[:wide] - self._known[0]) / np.append(sizes_of_unknowns(self.problem, u), 1.0)
            if self.quantity.kind == "period" or float(moved.max()) < GRADIENT_KEPT:
                return self._known[1]
        found = np.zeros(wide)
        gradient = gradient_of(self.quantity, self.problem, u)
        found[: gradient.size] = gradient
        self._known = u[:wide].copy(), found
        return found

    def measure(self, u: NDArray[np.float64]) -> None:
        """Take the quantity's size from the orbit `u`."""
        sizes = np.append(sizes_of_unknowns(self.problem, u), 1.0)
        self.size = float(np.abs(self.gradient(u) * sizes)[: self.problem.size].max())
        self.unit = float(self.problem.state_scale.max()) / (self.size or 1.0)

    def turn_gap(self, u: NDArray[np.float64], J: NDArray[np.float64]) -> bool:
        """Lay the gap along the left null vector of the equations at `u`; return whether it was turned.

        The gap keeps its side of the null vector, so that no determinant changes its sign. Where a second singular
        value is small too, as at a branch point, the gap stays.
        """
        if self.by_parameter:
            return False
        columns, rows = scaling(self.problem, J, u)
        left, values, _ = np.linalg.svd(rows[:, None] * J[:, : self.problem.size] * columns)
        if not np.any(self.gap):
            self.gap = left[:, -1] / rows
            return True
        if values.size > 1 and values[-1] > LEAST_APART * values[-2]:
            return False
        own = self.gap * rows
        cosine = float(own @ left[:, -1]) / float(np.linalg.norm(own))
        if abs(cosine) > GAP_TURNED:
            return False
        self.gap = np.copysign(1.0, cosine) * left[:, -1] / rows
        return True

    def evaluate(self, u: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the residual, shape (size + 1,), and the Jacobian, shape (size + 1, size + 1).

        Both are NaN where the freed parameter has a value that the system does not allow.
        """
        problem, m = self.problem, self.problem.size
        F, J = np.empty(m + 1), np.zeros((m + 1, m + 1))
        try:
            gradient = self.gradient(u)
            beyond = self.quantity.beyond(self.quantity.value(problem, u), self.value)
        except InputError:
            return np.full_like(F, np.nan), np.full_like(J, np.nan)
        own, slopes = problem.evaluate(u[: m + len(problem.active)])
        F[:m], J[:m, : slopes.shape[1]] = own, slopes
        if not self.by_parameter:
            F[:m] += u[m] * self.gap
            J[:m, m] = self.gap
        F[m], J[m] = self.unit * beyond, self.unit * gradient
        return F, J

    def scaled(self, u: NDArray[np.float64], J: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a Jacobian of `evaluate` in units of unknowns and equations."""
        columns, rows = scaling(self.problem, J[:-1], u)
        last = np.abs(J[-1, :-1] * columns).max() or 1.0
        return np.asarray(np.append(rows, 1.0 / last)[:, None] * J * np.append(columns, 1.0))

    def deficiency(self, u: NDArray[np.float64], J: NDArray[np.float64]) -> int:
        """Return how many singular values of the segment equations, over the largest, are rounding of 0."""
        m = self.problem.size
        values = np.linalg.svd(self.scaled(u, J)[:m, :m], compute_uv=False)
        return int(np.sum(values < DEFICIENT * values[0]))


def unit_of_parameter(problem: OrbitProblem, u: NDArray[np.float64], J: NDArray[np.float64]) -> float:
    """Return the change of the one active parameter that changes the equations by their units; 0 where none does.

    Parameters
    ----------
    problem : OrbitProblem
        The equations, the parameter in a unit of 1.
    u, J : ndarray
        An orbit and the Jacobian there.
    """
    _, rows = scaling(problem, J, u)
    size = float(np.abs(rows * J[:, problem.size]).max())
    return 1.0 / size if size > 0.0 else 0.0
