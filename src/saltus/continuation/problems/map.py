"""Orbits of a map as a zero problem with a parameter: multipliers, their test functions, borders.

docs/theory/map_orbits.md, "Test functions", derives the monitor functions.
"""

from __future__ import annotations

import math
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.core.monitor import Monitor
from saltus.continuation.core.point_types import on_branches
from saltus.continuation.core.value_tests import Tested, bounded, circle_tests
from saltus.continuation.core.zero_problem import Point
from saltus.continuation.problems.algebraic import AlgebraicZeroProblem
from saltus.continuation.problems.point_data import PointData
from saltus.maps.orbit import faults_of
from saltus.maps.spectrum import FAINT, flip_product, multiplicity, multipliers_of, pair_product, unstable_count
from saltus.scales import GROWN, PARAMETER_RESTS_IN_GROWTH

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.problems.point_data import Sized
    from saltus.maps.problem import MapOrbitProblem

__all__ = ["MapBranchData", "MapZeroProblem", "grows_without_bound"]

_PD = Monitor("PD")  # product of 1 + mu
_TR = Monitor("TR")  # product of the pairs' products less 1


class MapBranchData(PointData):
    """Data of a point: multipliers, the number of unstable ones, why the orbit is virtual."""

    @property
    def stable(self) -> bool:
        """Whether all multipliers lie inside the unit circle."""
        return self.unstable == 0 and bool(np.all(np.abs(self.values) < 1.0))


class MapZeroProblem(AlgebraicZeroProblem):
    """Orbits of one itinerary as a `ZeroProblem`; see `AlgebraicZeroProblem`.

    The squared arclength is the mean of that of the points, so that a doubled orbit goes as far as the single one.
    """

    critical = on_branches("map")
    single = ("SN", "BP", "PD")
    paired = _TR
    faint = MappingProxyType({_PD: FAINT, _TR: FAINT})
    vanishing = "the orbit does not close there"
    problem: MapOrbitProblem

    def data(self, u: NDArray[np.float64], J: NDArray[np.float64]) -> MapBranchData:
        """See `AlgebraicZeroProblem.data`."""
        values = multipliers_of(self.problem.slopes(u)[1])
        reasons = tuple(faults_of(self.problem, u, self.sizes))
        return MapBranchData(values, unstable_count(values), np.ones(values.size), reasons)

    def own_monitors(self, point: Point, values: NDArray[np.complex128]) -> dict[Monitor, float]:
        """See `AlgebraicZeroProblem.own_monitors`."""
        found = {_PD: flip_product(values)}
        for i, guard, height in self.problem.heights(point.u):
            name = Monitor("BC", i, guard)
            found[name] = self._over(name, height, point)
        if values.size > 1:
            found[_TR] = pair_product(values)
        return found

    def _over(self, name: Monitor, height: float, point: Point) -> float:
        if name in self._units:
            return height / self._units[name]
        return self.over_unit(name, height, self.problem.border(name.segment, name.transition, point.u)[1])

    def own_monitor(self, name: Monitor, point: Point) -> float:
        """See `AlgebraicZeroProblem.own_monitor`."""
        if name.kind == "BC":
            return self._over(name, self.problem.border(name.segment, name.transition, point.u)[0], point)
        values = self.spectrum(point.u)
        return flip_product(values) if name.kind == "PD" else pair_product(values)

    def sized(self, u: NDArray[np.float64]) -> Sized:
        """See `AlgebraicZeroProblem.sized`: multipliers have no units."""
        values = multipliers_of(self.problem.slopes(u)[1])
        return values, np.ones(values.size)

    def growth(self, values: NDArray[np.complex128], sizes: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `AlgebraicZeroProblem.growth`: distances from the unit circle, those of large multipliers at most 1."""
        moduli = np.abs(values)
        return np.where(np.isfinite(moduli), (moduli - 1.0) / (moduli + 1.0), 1.0)

    def in_units(self, values: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """See `AlgebraicZeroProblem.in_units`: multipliers have no units."""
        return bounded(values)

    def tests(self, values: list[complex]) -> Tested:
        """See `AlgebraicZeroProblem.tests`."""
        return circle_tests(values)

    def multiplicity(self, data: PointData, kind: str) -> int:
        """See `AlgebraicZeroProblem.multiplicity`."""
        return multiplicity(data.values, kind)

    def is_pair(self, values: NDArray[np.complex128]) -> bool:
        """See `AlgebraicZeroProblem.is_pair`."""
        return _rotates(values)

    def outputs(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `AlgebraicZeroProblem.outputs`."""
        compiled = self.problem.compiled
        out = np.empty(compiled.n_outputs)
        p = compiled.extended(self.problem.parameters_at(u))
        compiled.call("outputs", self.problem.itinerary[0], 0, np.ascontiguousarray(self.problem.points(u)[0]), p, out)
        return out


def grows_without_bound(
    sizes: NDArray[np.float64], first: NDArray[np.float64], rates: NDArray[np.float64]
) -> str | None:
    """Return why a curve of orbits ends whose points run to infinity while the parameters rest; None if they do not.

    Parameters
    ----------
    sizes, first : ndarray, shape (n,)
        Sizes of the points, now and at the curve's start.
    rates : ndarray, shape (parameters,)
        Change of the varied parameters per unit of arclength.
    """
    grown = float(np.max(sizes / first)) > GROWN and bool(np.all(np.abs(rates) < PARAMETER_RESTS_IN_GROWTH))
    return "the orbit grows without bound" if grown else None


def _rotates(values: NDArray[np.complex128]) -> bool:
    """Return whether the two multipliers whose product is nearest to 1 are a complex pair."""
    best, pair = math.inf, False
    for i in range(values.size):
        for j in range(i + 1, values.size):
            product = complex(values[i] * values[j])
            share = abs(product - 1.0) / math.hypot(1.0, abs(product)) if math.isfinite(abs(product)) else 1.0
            if share < best:
                best, pair = share, abs(values[i].imag) > 0.0 and abs(values[j].imag) > 0.0
    return pair
