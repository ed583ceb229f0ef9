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
from saltus.continuation.problems.algebraic import has_pair
from saltus.continuation.problems.algebraic_locus import AlgebraicLocusProblem, LocusData
from saltus.continuation.problems.equilibrium import row_units
from saltus.equilibria.critical import Hopf
from saltus.equilibria.equilibrium import faults_of
from saltus.equilibria.normal_forms import lyapunov_coefficient
from saltus.equilibria.spectrum import eigenvalues, pair_product, unstable_count

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.equilibria.problem import EquilibriumProblem

__all__ = ["EquilibriumLocusProblem"]

_CP = Monitor("CP")  # coefficient of the normal form of a saddle-node
_BT = Monitor("BT")  # product of both null vectors on an SN locus, squared frequency on an HB locus
_GH = Monitor("GH")  # first Lyapunov coefficient, times the cubed frequency
_ZH = Monitor("ZH")  # what makes the other of a zero and an imaginary pair
_HH = Monitor("HH")  # product of the sums of two eigenvalues, without that of the critical pair

_SLOW = 1e-6  # squared frequency, over the squared size of the Jacobian, below which l1 is rounding, as at a BT


class EquilibriumLocusProblem(AlgebraicLocusProblem):
    """Critical equilibria of one mode as a `ZeroProblem`; see `AlgebraicLocusProblem`."""

    noise: Mapping[Monitor, float] = MappingProxyType({_GH: 1e-9, _CP: 1e-10})
    vanishing = "the field does not vanish there"
    problem: EquilibriumProblem

    def borders(self, point: Point) -> dict[Monitor, float]:
        """See `AlgebraicLocusProblem.borders`."""
        found = {}
        for k in self.problem.ways_out:
            if k != getattr(self.condition, "place", -1):
                name = Monitor("BE", transition=k)
                height, gradient = self.problem.event(k, self.unknowns(point.u))
                found[name] = height / self.unit(name, float(np.abs(gradient[: self.n]) @ self.sizes))
        return found

    def reasons(self, u: NDArray[np.float64]) -> tuple[str, ...]:
        """See `AlgebraicLocusProblem.reasons`."""
        return tuple(faults_of(self.problem, u, self.sizes))

    def special(self, point: Point) -> tuple[dict[Monitor, float], LocusData]:
        """See `AlgebraicLocusProblem.special`."""
        if self.kind == "SN":
            return self._on_saddle_nodes(point)
        u = self.unknowns(point.u)
        J = self.problem.evaluate(u)[1]
        values = eigenvalues(J[:, : self.n])
        reasons = self.reasons(u)
        if self.kind == "HB":
            return self._on_hopf_points(point, u, J, values, reasons)
        sign, log = np.linalg.slogdet(J[:, : self.n])
        singular, pairs = Monitor("SN"), Monitor("HB")
        self._units.setdefault(singular, float(log))
        monitors = {singular: float(sign) * math.exp(min(float(log) - self._units[singular], 600.0))}
        if self.n > 1:
            monitors[pairs] = pair_product(values)
        return monitors, LocusData(values, unstable_count(values), reasons)

    def units_of_rows(self, J: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `AlgebraicLocusProblem.units_of_rows`."""
        return row_units(J * np.append(self.sizes, [1.0, 1.0])) / float(self.sizes.max())

    def _on_saddle_nodes(self, point: Point) -> tuple[dict[Monitor, float], LocusData]:
        monitors, data = super().special(point)
        q, p, values = self.condition.right, self.condition.left, data.values
        if self.n > 1:
            monitors[_BT] = float(p @ q) / float(np.linalg.norm(p * self.sizes) * np.linalg.norm(q / self.sizes))
        if self.n > 2:
            monitors[_ZH] = pair_product(values, (int(np.argmin(np.abs(values))),))
        return monitors, data

    def _on_hopf_points(
        self,
        point: Point,
        u: NDArray[np.float64],
        J: NDArray[np.float64],
        values: NDArray[np.complex128],
        reasons: tuple[str, ...],
    ) -> tuple[dict[Monitor, float], LocusData]:
        condition = self.condition
        assert isinstance(condition, Hopf)
        k = float(point.u[self.n + condition.extra - 1]) * condition.unit
        w = math.sqrt(max(k, 0.0))
        goal = 1j * w if k >= 0.0 else complex(math.sqrt(-k))
        first = int(np.argmin(np.abs(values - goal)))
        left = [i for i in range(self.n) if i != first]
        second = min(left, key=lambda i: abs(values[i] + values[first]))
        pair = (min(first, second), max(first, second))
        rest = np.delete(values, pair)
        monitors, l1 = {_BT: k / condition.unit}, math.nan
        if k > _SLOW * condition.unit:
            try:
                l1 = lyapunov_coefficient(self.problem, u, J, w, self.sizes)
            except np.linalg.LinAlgError:
                l1 = math.nan
        monitors[_GH] = l1 * w**3 / self.unit(_GH, l1 * w**3) if math.isfinite(l1) else math.nan
        if rest.size:
            product = complex(np.prod(rest)).real
            monitors[_ZH] = product / self.unit(_ZH, product)
        if rest.size > 1:
            monitors[_HH] = pair_product(values, pair)
        return monitors, LocusData(values, unstable_count(rest), reasons, l1, w)

    def is_special(self, event: Event) -> bool:
        """See `AlgebraicLocusProblem.is_special`: not where two real eigenvalues differ in sign alone."""
        values = event.point.examined.data.values
        if event.name == _ZH and self.kind == "SN":
            values = np.delete(values, np.argmin(np.abs(values)))
        elif event.name == _HH:
            w = event.point.examined.data.frequency
            values = np.delete(values, np.argsort(np.abs(np.abs(values) - w) + np.abs(values.real))[:2])
        elif event.name != Monitor("HB"):
            return True
        return has_pair(values)
