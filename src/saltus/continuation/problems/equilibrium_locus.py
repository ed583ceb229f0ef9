"""Critical equilibria in two parameters as a zero problem: extended equations, monitor functions, checks of a step.

docs/theory/equilibria.md, "Loci", derives the equations and lists the monitor functions.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.core.monitor import Monitor
from saltus.continuation.core.zero_problem import Event, Point
from saltus.continuation.problems.algebraic_locus import AlgebraicLocusProblem, LocusData
from saltus.continuation.problems.equilibrium import row_units
from saltus.continuation.problems.other_values import OtherValues, critical_pair, eigenvalues_beside
from saltus.equilibria.critical import Hopf
from saltus.equilibria.equilibrium import faults_of
from saltus.equilibria.normal_forms import lyapunov_coefficient
from saltus.equilibria.pseudo import beside_two_fold, without_pole
from saltus.equilibria.sliding import sides_of
from saltus.equilibria.spectrum import eigenvalues, unstable_count
from saltus.scales import FREQUENCY_ROUNDED, ILL_CONDITIONED

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.equilibria.problem import EquilibriumProblem

__all__ = ["EquilibriumLocusProblem"]

_CP = Monitor("CP")  # coefficient of the normal form of a saddle-node
_BT = Monitor("BT")  # product of both null vectors on an SN locus, squared frequency on an HB locus
_GH = Monitor("GH")  # first Lyapunov coefficient, times the cubed frequency


class EquilibriumLocusProblem(AlgebraicLocusProblem):
    """Critical equilibria of one mode as a `ZeroProblem`; see `AlgebraicLocusProblem`."""

    noise: Mapping[Monitor, float] = MappingProxyType({_GH: 1e-9, _CP: 1e-10})
    vanishing = "the field does not vanish there"
    problem: EquilibriumProblem

    def equations(self, u: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """See `AlgebraicLocusProblem.equations`."""
        return without_pole(self.problem, u, self.sizes) if self.kind == "BE" else self.problem.evaluate(u)

    def met_at(self, u: NDArray[np.float64]) -> frozenset[int]:
        """See `AlgebraicLocusProblem.met_at`: on BE loci, at two-folds those of both fields."""
        if self.kind != "BE":
            return frozenset()
        sides = sides_of(self.problem.system, self.problem.mode)
        if sides is None or beside_two_fold(self.problem, u, self.sizes) is None:
            return frozenset({self.condition.place})
        return frozenset({self.condition.place, sides.rise, sides.fall})

    def regular(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `AlgebraicLocusProblem.regular`: next to a two-fold."""
        beside = beside_two_fold(self.problem, u, self.sizes) if self.kind == "BE" else None
        return u if beside is None else beside

    def sort_out(self, events: list[Event]) -> list[Event] | str:
        """See `AlgebraicLocusProblem.sort_out`: where an eigenvalue passes infinity at a two-fold, none is critical."""
        kept = super().sort_out(events)
        if isinstance(kept, str) or self.kind != "BE" or sides_of(self.problem.system, self.problem.mode) is None:
            return kept
        return [e for e in kept if e.name.kind not in self.others.types.values() or self._critical(e.point)]

    def _critical(self, point: Point) -> bool:
        values = point.examined.data.values
        return bool(np.abs(values.real).min() <= ILL_CONDITIONED * (self.others.unit or 1.0))

    def borders(self, point: Point) -> dict[Monitor, float]:
        """See `AlgebraicLocusProblem.borders`."""
        found, u = {}, self.unknowns(point.u)
        for k in self.problem.ways_out:
            if k not in self.met:
                name = Monitor("BE", transition=k)
                height, gradient = self.problem.event(k, u)
                found[name] = height / self.unit(name, float(np.abs(gradient[: self.n]) @ self.sizes))
        return found

    def linear(self, u: NDArray[np.float64], J: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `AlgebraicLocusProblem.linear`: the field's derivative at given totals."""
        return self.problem.within(u, J[:, : self.n])

    def reasons(self, u: NDArray[np.float64]) -> tuple[str, ...]:
        """See `AlgebraicLocusProblem.reasons`."""
        return tuple(faults_of(self.problem, u, self.sizes))

    def special(self, point: Point) -> tuple[dict[Monitor, float], LocusData]:
        """See `AlgebraicLocusProblem.special`."""
        if self.kind == "SN":
            return self._on_saddle_nodes(point)
        u = self.unknowns(point.u)
        reasons = self.reasons(u)
        u = self.regular(u)
        J = self.problem.evaluate(u)[1]
        values = eigenvalues(self.linear(u, J))
        if self.kind == "HB":
            return self._on_hopf_points(point, u, J, values, reasons)
        return {}, LocusData(values, unstable_count(values), values, reasons)

    def other_values(self) -> OtherValues:
        """See `AlgebraicLocusProblem.other_values`."""
        types = {"SN": {"fold": "SNSN", "pair": "ZH"}, "HB": {"fold": "ZH", "pair": "HH"}}
        return eigenvalues_beside(types.get(self.kind, {"fold": "SN", "pair": "HB"}))

    def beside(self, z: NDArray[np.float64], values: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """See `AlgebraicLocusProblem.beside`."""
        if self.kind != "HB":
            return super().beside(z, values) if self.kind == "SN" else values
        k = self._square(z)
        goal = 1j * math.sqrt(k) if k >= 0.0 else complex(math.sqrt(-k))
        return np.delete(values, critical_pair(values, np.abs(values - goal), lambda one, other: abs(one + other)))

    def units_of_rows(self, J: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `AlgebraicLocusProblem.units_of_rows`."""
        return row_units(J * np.append(self.sizes, [1.0, 1.0])) / float(self.sizes.max())

    def _on_saddle_nodes(self, point: Point) -> tuple[dict[Monitor, float], LocusData]:
        monitors, data = super().special(point)
        q, p = self.condition.right, self.condition.left
        if self.n > 1:
            monitors[_BT] = float(p @ q) / float(np.linalg.norm(p * self.sizes) * np.linalg.norm(q / self.sizes))
        return monitors, data

    def _on_hopf_points(
        self,
        point: Point,
        u: NDArray[np.float64],
        J: NDArray[np.float64],
        values: NDArray[np.complex128],
        reasons: tuple[str, ...],
    ) -> tuple[dict[Monitor, float], LocusData]:
        condition, k = self.condition, self._square(point.u)
        w, others = math.sqrt(max(k, 0.0)), self.beside(point.u, values)
        monitors, l1 = {_BT: k / condition.unit}, math.nan
        if k > FREQUENCY_ROUNDED * condition.unit:
            try:
                l1 = lyapunov_coefficient(self.problem, u, J, w, self.sizes)
            except np.linalg.LinAlgError:
                l1 = math.nan
        monitors[_GH] = l1 * w**3 / self.unit(_GH, l1 * w**3) if math.isfinite(l1) else math.nan
        return monitors, LocusData(values, unstable_count(others), others, reasons, l1, w)

    def _square(self, z: NDArray[np.float64]) -> float:
        """Return the squared frequency on an HB locus; negative where two real values differ in sign alone."""
        condition = self.condition
        assert isinstance(condition, Hopf)
        return float(z[self.n + condition.extra - 1] * condition.unit)
