"""Equilibria of one mode as a zero problem with a parameter: eigenvalues, test function of Hopf points, boundaries.

docs/theory/equilibria.md, "Test functions", derives the monitor functions.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.algebraic_problem import AlgebraicZeroProblem
from saltus.continuation.monitor import Monitor
from saltus.continuation.zero_problem import Point
from saltus.equilibria.equilibrium import faults_of
from saltus.equilibria.spectrum import FAINT, eigenvalues, pair_product, unstable_count

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.orbit_problem import Interest
    from saltus.equilibria.problem import EquilibriumProblem

__all__ = ["CRITICAL", "EquilibriumData", "EquilibriumZeroProblem", "has_pair"]

_HB = Monitor("HB")  # product of the sums of two eigenvalues
_DOMAIN = Monitor("domain")  # domain function of the mode

CRITICAL = ("SN", "BP", "HB", "BE")  # kinds of monitor functions at whose zeros something bifurcates


@dataclass(frozen=True)
class EquilibriumData:
    """Data of a point: eigenvalues, the number of unstable ones, why the equilibrium is virtual."""

    values: NDArray[np.complex128]
    unstable: int
    reasons: tuple[str, ...]

    @property
    def stable(self) -> bool:
        """Whether all eigenvalues have negative real parts."""
        return self.unstable == 0 and bool(np.all(self.values.real < 0.0))


class EquilibriumZeroProblem(AlgebraicZeroProblem):
    """Equilibria of one mode as a `ZeroProblem`; see `AlgebraicZeroProblem`."""

    critical = CRITICAL
    single = ("SN", "BP")
    paired = _HB
    vanishing = "the field does not vanish there"
    problem: EquilibriumProblem

    def __init__(self, problem: EquilibriumProblem, sizes: NDArray[np.float64], interest: Interest) -> None:
        super().__init__(problem, sizes, interest)
        self._guarded = problem.system.modes[problem.system.mode_names[problem.mode]].domain is not None

    def data(self, u: NDArray[np.float64], J: NDArray[np.float64]) -> EquilibriumData:
        """See `AlgebraicZeroProblem.data`."""
        values = eigenvalues(J[:, : self.n])
        return EquilibriumData(values, unstable_count(values), tuple(faults_of(self.problem, u, self.sizes)))

    def own_monitors(self, point: Point, values: NDArray[np.complex128]) -> dict[Monitor, float]:
        """See `AlgebraicZeroProblem.own_monitors`."""
        names = [Monitor("BE", transition=k) for k in self.problem.ways_out]
        names += [_DOMAIN] if self._guarded else []
        found = {name: self.own_monitor(name, point) for name in names}
        if self.n > 1:
            found[_HB] = pair_product(values)
        return found

    def own_monitor(self, name: Monitor, point: Point) -> float:
        """See `AlgebraicZeroProblem.own_monitor`."""
        if name.kind == "HB":
            return pair_product(eigenvalues(self.problem.evaluate(point.u)[1][:, : self.n]))
        if name.kind == "domain":
            return self.problem.guard(self.problem.mode, point.u)
        return self.over_unit(name, *self.problem.event(name.transition, point.u))

    def is_rounding(self, pair: float, before: Point | None) -> bool:
        """See `AlgebraicZeroProblem.is_rounding`."""
        return abs(pair) < FAINT and (before is None or not abs(before.examined.monitors[_HB]) >= FAINT)

    def is_pair(self, values: NDArray[np.complex128]) -> bool:
        """See `AlgebraicZeroProblem.is_pair`."""
        return has_pair(values)

    def observed(self, index: int, point: Point) -> float:
        """See `AlgebraicZeroProblem.observed`."""
        name, kind, _ = self.interest.events[index]
        system = self.problem.system
        if kind == "state":
            return float(point.u[system.states.index(name)])
        return float(self.outputs(point.u)[system.output_names.index(name)])

    def outputs(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the outputs at an equilibrium, shape (outputs,)."""
        compiled = self.problem.compiled
        out = np.empty(compiled.n_outputs)
        p = compiled.extended(self.problem.parameters_at(u))
        compiled.call("outputs", self.problem.mode, 0, np.ascontiguousarray(u[: self.n]), p, out)
        return out


def has_pair(values: NDArray[np.complex128]) -> bool:
    """Return whether the two eigenvalues whose sum is least, over their moduli, are a complex pair."""
    best, pair = math.inf, False
    for i in range(values.size):
        for j in range(i + 1, values.size):
            share = abs(values[i] + values[j]) / max(abs(values[i]) + abs(values[j]), 1e-300)
            if share < best:
                best, pair = share, abs(values[i].imag) > 0.0 and abs(values[j].imag) > 0.0
    return pair
