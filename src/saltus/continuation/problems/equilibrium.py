"""Equilibria of one mode as a zero problem with a parameter: eigenvalues, test function of Hopf points, boundaries.

docs/theory/equilibria.md, "Test functions", derives the monitor functions.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.core.monitor import Monitor
from saltus.continuation.core.point_types import on_branches
from saltus.continuation.core.zero_problem import Point
from saltus.continuation.problems.algebraic import AlgebraicZeroProblem
from saltus.continuation.problems.errors import algebraic_error, spectral_error
from saltus.continuation.problems.stretches import Stretch, spectra
from saltus.equilibria.equilibrium import faults_of
from saltus.equilibria.pseudo import beside_two_fold, residual_of, without_pole
from saltus.equilibria.sliding import sides_of
from saltus.equilibria.spectrum import pair_product

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.core.arclength import StepControl
    from saltus.continuation.core.interest import Interest
    from saltus.continuation.core.zero_problem import Event
    from saltus.continuation.problems.point_data import PointData
    from saltus.equilibria.problem import EquilibriumProblem

__all__ = ["EquilibriumZeroProblem", "row_units"]

_DOMAIN = Monitor("domain")  # domain function of the mode
_HB = Monitor("HB")  # product of the sums of two eigenvalues

# test functions that must keep their signs where many steps are taken at once
_QUIET = tuple(Monitor(kind) for kind in ("SN", "BP", "HB", "low", "high"))
_ALL_QUIET = frozenset(_QUIET)


def row_units(J: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a unit for each row of a matrix: its largest entry; for a row of zeros that of the matrix."""
    terms = np.abs(J).max(axis=1)
    if not np.isfinite(terms).all():
        return np.ones(terms.size)
    return np.where(terms > 0.0, terms, float(terms.max()) or 1.0)


class EquilibriumZeroProblem(AlgebraicZeroProblem):
    """Equilibria of one mode as a `ZeroProblem`; see `AlgebraicZeroProblem`."""

    critical = on_branches("equilibrium")
    vanishing = "the field does not vanish there"
    problem: EquilibriumProblem

    def __init__(self, problem: EquilibriumProblem, sizes: NDArray[np.float64], interest: Interest) -> None:
        super().__init__(problem, sizes, interest)
        self.rows: NDArray[np.float64] | None = None
        self._combines = sides_of(problem.system, problem.mode) is not None
        self._guarded = problem.system.modes[problem.system.mode_names[problem.mode]].domain is not None

    def evaluate(self, u: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the field and its derivatives, rows in one unit by the sizes of their terms at the first call."""
        F, J = without_pole(self.problem, u, self.sizes) if self._combines else self.problem.evaluate(u)
        if self.rows is None:
            self.rows = row_units(J * self.scale()) / float(self.sizes.max())
        return F / self.rows, J / self.rows[:, None]

    def residual(self, u: NDArray[np.float64], J: NDArray[np.float64], sizes: NDArray[np.float64]) -> float:
        """See `AlgebraicZeroProblem.residual`: of the equations without pole."""
        return residual_of(self.problem, u, J, sizes)

    def regular(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `AlgebraicZeroProblem.regular`: next to a two-fold."""
        beside = beside_two_fold(self.problem, u, self.sizes) if self._combines else None
        return u if beside is None else beside

    def linear(self, u: NDArray[np.float64], J: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `AlgebraicZeroProblem.linear`: the field's derivative at given totals."""
        return self.problem.within(u, J[:, : self.n])

    def reasons(self, u: NDArray[np.float64]) -> tuple[str, ...]:
        """See `AlgebraicZeroProblem.reasons`."""
        return tuple(faults_of(self.problem, u, self.sizes))

    def own_monitors(self, point: Point, values: NDArray[np.complex128]) -> dict[Monitor, float]:
        """See `AlgebraicZeroProblem.own_monitors`."""
        names = [Monitor("BE", transition=k) for k in self.problem.ways_out]
        names += [_DOMAIN] if self._guarded else []
        found = {name: self.own_monitor(name, point) for name in names} | super().own_monitors(point, values)
        if _HB in found:
            found[_HB] *= self._through_infinity(point.u)
        return found

    def own_monitor(self, name: Monitor, point: Point) -> float:
        """See `AlgebraicZeroProblem.own_monitor`."""
        if name.kind == "HB":
            return super().own_monitor(name, point) * self._through_infinity(point.u)
        if name.kind == "domain":
            return self.problem.guard(self.problem.mode, point.u)
        return self.over_unit(name, *self.problem.event(name.transition, point.u))

    def error(self, name: Monitor, point: Point) -> float:
        """See `ZeroProblem.error`."""
        if name.kind == "HB" and not self.problem.system.laws:
            found = spectral_error(self, point, lambda u, values: pair_product(values) * self._through_infinity(u))
            if found is not None:
                return found
        return algebraic_error(self, name, point)

    def _through_infinity(self, u: NDArray[np.float64]) -> float:
        """Return the factor with which the test function of pairs keeps its sign where an eigenvalue passes infinity.

        At a two-fold an eigenvalue of a sliding mode does, by the denominator of its field, and its sum with each other
        one.
        """
        if not self._combines or self.n % 2:
            return 1.0
        return math.copysign(1.0, self.problem.guard(self.problem.mode, u))

    def _fault(self, point: Point, before: Point, monitors: dict[Monitor, float], data: PointData) -> str | None:
        """See `AlgebraicZeroProblem._fault`: an eigenvalue that passes infinity changes the stability, and no more."""
        if self._combines and before.examined.monitors.get(_DOMAIN, math.nan) * monitors[_DOMAIN] < 0.0:
            return None
        return super()._fault(point, before, monitors, data)

    def spectra(self, places: NDArray[np.float64]) -> NDArray[np.complex128]:
        """See `AlgebraicZeroProblem.spectra`."""
        return spectra(self.problem, places)

    def outputs(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `AlgebraicZeroProblem.outputs`."""
        compiled = self.problem.compiled
        out = np.empty(compiled.n_outputs)
        p = compiled.extended(self.problem.parameters_at(u))
        compiled.call("outputs", self.problem.mode, 0, np.ascontiguousarray(u[: self.n]), p, out)
        return out

    def sort_out(self, events: list[Event]) -> list[Event] | str:
        """See `AlgebraicZeroProblem.sort_out`: at a two-fold both rates vanish, and the domain function with them."""
        kept = super().sort_out(events)
        if isinstance(kept, str) or not self._combines:
            return kept
        met = [
            e
            for e in kept
            if e.name.kind in ("BE", "domain") and beside_two_fold(self.problem, e.point.u, self.sizes) is not None
        ]
        first = next((e for e in met if e.name.kind == "BE"), None)
        return [e for e in kept if e is first or e not in met]

    def ahead(self, control: StepControl, before: Point, point: Point, step: float) -> tuple[list[Point], float]:
        """Return many points at once, as far as nothing happens, and the length of the step behind the last one.

        Only where no other test functions than these are watched: in a mode without surfaces, without users' events.
        """
        if (
            not point.examined.monitors.keys() <= _ALL_QUIET
            or self._origin is None
            or self.rows is None
            or self.problem.system.laws
        ):
            return [], step
        known = self.interest, self.sizes, self._origin, self.rows
        found = Stretch(self.problem, before, point, step, control, known)
        self._log = point.log if self._log is None else self._log
        kept = found.quiet(before, point, self._log, _QUIET)
        points = found.points(point, kept)
        if points:
            self.sizes = found.sizes[kept - 1].copy()
            step = float(found.numbers[kept, 4]) if kept < found.taken else found.step
        return points, step
