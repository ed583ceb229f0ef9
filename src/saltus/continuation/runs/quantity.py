"""A branch of periodic orbits along a quantity of theirs, as their maximum or period, under way."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.core.interest import Interest
from saltus.continuation.core.zero_problem import Point, start_point
from saltus.continuation.problems.ends.shrinking import at_rest, centre_ahead
from saltus.continuation.problems.ends.unbounded import period_of, told
from saltus.continuation.problems.orbit import OrbitZeroProblem
from saltus.continuation.problems.quantity import QuantityZeroProblem
from saltus.continuation.runs.one_parameter import branch_run
from saltus.continuation.runs.options import read_range, read_varied
from saltus.continuation.runs.orbit import OrbitRun
from saltus.continuation.runs.run import Asked
from saltus.continuation.runs.two_sided import OneSide
from saltus.errors import InputError
from saltus.orbits.fixing import Wish, unfolded_at
from saltus.orbits.observables.quantities import read_quantity
from saltus.orbits.orbit import PeriodicOrbit, orbit_at
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.unfolding import UnfoldedEquations
from saltus.scales import PARAMETER_RESTS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.orbits.signature import Signature

__all__ = ["QuantityRun"]


class QuantityRun(OrbitRun):
    """One call of `continue_branch` along a quantity of periodic orbits; see `OneParameterRun`."""

    types = (*OrbitRun.types, "TP")

    def __init__(self, orbit: PeriodicOrbit, parameter: str, interest: Interest, asked: Asked) -> None:
        super().__init__(orbit, parameter, interest, asked)
        assert orbit.fixed is not None
        self.quantity = read_quantity(orbit.system, parameter)
        free = orbit.fixed.free
        self._active = [orbit.system.parameter_names.index(free)] if free else []
        wish = Wish(self.quantity, interest.scale, free)
        self._known, u = unfolded_at(orbit.problem(), orbit.unknowns, wish)
        self._scales = self._known.problem.scales
        self._home = float(u[-1])
        self._freed = orbit.fixed

    @classmethod
    def interval(
        cls, start: PeriodicOrbit, name: str, bounds: tuple[float, float], directions: str
    ) -> tuple[float, float, float]:
        """See `OneParameterRun.interval`."""
        value = read_quantity(start.system, name).value(start.problem(), start.unknowns)
        return *read_range(name, value, bounds, directions), value

    def first(self) -> tuple[OrbitZeroProblem, NDArray[np.float64]]:
        """Return equations and unknowns of the orbit at which the branch starts."""
        inner = np.append(self.solution.unknowns, self._home)
        value = self.quantity.value(self._known.problem, inner) / self.scale
        self.fixed = replace(self._freed, quantity=self.name, value=value * self.scale)
        u = np.append(inner, self.met(value))
        return self.equations(self.solution.form, u), u

    def equations(
        self, signature: Signature, u: NDArray[np.float64], sizes: NDArray[np.float64] | None = None
    ) -> OrbitZeroProblem:
        """Return the zero problem of a signature near `u`."""
        p = self.solution.system.parameter_vector(self.solution.parameters)
        tolerance = self.solution.tolerance
        kept = self._known.problem.conserving
        problem = OrbitProblem(self.solution.system, signature, p, self._active, self._scales, tolerance, kept)
        problem.start(u, sizes)
        return self.zero_problem(problem, u)

    def zero_problem(self, problem: OrbitProblem, u: NDArray[np.float64]) -> OrbitZeroProblem:
        """Return the zero problem of segment equations near `u`, meshes made."""
        equations = UnfoldedEquations(problem, self.quantity, float(u[-1]) * self.scale)
        equations.turn_gap(u[:-1], problem.resolve(u)[1])
        equations.measure(u[:-1])
        return QuantityZeroProblem(equations, u, self.interest, self._home if self._freed.family else None)

    def start(self, branch: OrbitZeroProblem, u: NDArray[np.float64]) -> Point:
        """Return the first point of the branch; raise `InputError` where the quantity rests there."""
        point = start_point(branch, u)
        if abs(float(point.tangent[-1])) < PARAMETER_RESTS:
            raise InputError("parameter", self.name, "a quantity that varies from orbit to orbit", "it rests here")
        return point

    def orbit_of(self, branch: OrbitZeroProblem, point: Point) -> PeriodicOrbit:
        """Return the orbit of a point, with what was fixed and freed."""
        data, u = point.examined.data, point.u[:-1].copy()
        if self._freed.family:
            u[branch.problem.size] = self._home
        fixed = replace(self._freed, quantity=self.name, value=point.parameter * self.scale)
        found = orbit_at(branch.problem, u, branch.own(point.J), data.survey, data.told, fixed)
        return replace(found, tolerance=data.tolerance)

    def halved(self, half: OneSide, branch: OrbitZeroProblem, point: Point) -> Point | None:
        """Return None: where the period halves along a quantity is not located."""
        return None

    def sharpened(self, branch: OrbitZeroProblem, point: Point) -> Point:
        """Return a branch point as it was located."""
        return point

    def ends_unbounded(self, half: OneSide) -> tuple[str, bool]:
        """Return why a branch along a quantity ends: its homoclinic orbit is not located."""
        return told(period_of(*half.points[-1])), False

    def shrinks(self, branch: OrbitZeroProblem, before: Point, point: Point) -> tuple[OrbitZeroProblem, Point] | None:
        """Return equations and point of the equilibrium a few steps ahead to which orbits shrink, or None."""
        found = centre_ahead(branch.problem, before, point, family=self._freed.family)
        if found is None:
            return None
        problem, u, multipliers = found
        value = self.quantity.value(problem, u) / self.scale
        ahead = point.parameter - before.parameter
        inside = self.interest.low <= value <= self.interest.high
        if not (inside and math.isfinite(value) and (value - point.parameter) * ahead >= 0.0):
            return None
        end = np.append(u, value)
        return at_rest(self.zero_problem(problem, end), branch.problem, point, end, multipliers)

    def freed(self, branch: OrbitZeroProblem, point: Point) -> float:
        """Return the freed parameter at a point; NaN where none is freed."""
        if not self._freed.free:
            return math.nan
        inner = self._home if self._freed.family else float(point.u[branch.problem.size])
        return inner * float(self._scales[0])


@branch_run.register
def _(start: PeriodicOrbit, parameter: str) -> type[OrbitRun]:
    return OrbitRun if read_varied(start, parameter) is None else QuantityRun
