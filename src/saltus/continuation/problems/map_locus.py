"""Critical orbits of a map in two parameters as a zero problem: monitor functions of codimension two.

docs/theory/map_orbits.md, "Loci", derives the equations and lists the monitor functions.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from saltus.algebraic.conditions import Singular
from saltus.continuation.core.monitor import Monitor
from saltus.continuation.core.zero_problem import Point
from saltus.continuation.problems.algebraic_locus import AlgebraicLocusProblem, LocusData
from saltus.continuation.problems.other_values import OtherValues, multipliers_beside, without_critical
from saltus.maps.critical import Rotation
from saltus.maps.normal_forms import flip_terms, fold_terms, null_vectors, rotation_terms
from saltus.maps.orbit import faults_of
from saltus.maps.spectrum import FAINT, flip_product, fold_product, multipliers_of, unstable_count

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.maps.problem import MapOrbitProblem

__all__ = ["MapLocusProblem"]

_CP = Monitor("CP")  # coefficient of the normal form of a saddle-node
_GPD = Monitor("GPD")  # that of a period doubling
_CH = Monitor("CH")  # that of a Neimark-Sacker point
_FF = Monitor("FF")  # what makes the other of the multipliers 1 and -1
_TWISTS = {"SN": Monitor("R1"), "PD": Monitor("R2")}  # product of both null vectors
_ANGLES = {Monitor("R1"): 1.0, Monitor("R2"): -1.0, Monitor("R3"): -0.5, Monitor("R4"): 0.0}  # their cosines


class MapLocusProblem(AlgebraicLocusProblem):
    """Critical orbits of one itinerary as a `ZeroProblem`; see `AlgebraicLocusProblem`."""

    noise: Mapping[Monitor, float] = MappingProxyType({_CP: 1e-10, _GPD: 1e-11, _CH: 1e-10})
    faint: Mapping[Monitor, float] = MappingProxyType(dict.fromkeys([_FF, *_TWISTS.values(), *_ANGLES], FAINT))
    vanishing = "the orbit does not close there"
    problem: MapOrbitProblem

    def borders(self, point: Point) -> dict[Monitor, float]:
        """See `AlgebraicLocusProblem.borders`."""
        found, u = {}, self.unknowns(point.u)
        for i, guard, height in self.problem.heights(u):
            if (i, guard) == getattr(self.condition, "place", None):
                continue
            name = Monitor("BC", i, guard)
            if name not in self._units:
                self.unit(name, float(np.abs(self.problem.border(i, guard, u)[1][: self.n]) @ self.sizes))
            found[name] = height / self._units[name]
        return found

    def reasons(self, u: NDArray[np.float64]) -> tuple[str, ...]:
        """See `AlgebraicLocusProblem.reasons`."""
        return tuple(faults_of(self.problem, u, self.sizes))

    def special(self, point: Point) -> tuple[dict[Monitor, float], LocusData]:
        """See `AlgebraicLocusProblem.special`."""
        u = self.unknowns(point.u)
        J, values = self.problem.evaluate(u)[1], self.spectrum(u)
        reasons = self.reasons(u)
        if isinstance(self.condition, Singular):
            return self._on_single(point, J, values, reasons)
        if isinstance(self.condition, Rotation):
            return self._on_rotations(point, J, values, reasons)
        return {}, LocusData(values, unstable_count(values), values, reasons)

    def other_values(self) -> OtherValues:
        """See `AlgebraicLocusProblem.other_values`."""
        return multipliers_beside(self._type)

    def spectrum(self, u: NDArray[np.float64]) -> NDArray[np.complex128]:
        """See `AlgebraicLocusProblem.spectrum`."""
        return multipliers_of(self.problem.slopes(u)[1])

    def beside(self, z: NDArray[np.float64], values: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """See `AlgebraicLocusProblem.beside`."""
        return without_critical(self._type, values, float(z[-3]))

    @property
    def _type(self) -> str:
        """Type of the locus; ``BC`` as well where a quantity keeps its value, since no multiplier is critical there."""
        return self.kind if self.kind in _TWISTS or self.kind == "TR" else "BC"

    def _on_single(
        self, point: Point, J: NDArray[np.float64], values: NDArray[np.complex128], reasons: tuple[str, ...]
    ) -> tuple[dict[Monitor, float], LocusData]:
        """Return monitors and data where one multiplier is 1 or -1."""
        u, others = self.unknowns(point.u), self.beside(point.u, values)
        q, p = self.condition.right, self.condition.left
        fold = self.kind == "SN"
        twist = float(p @ self.problem.closing @ q)
        try:
            terms = fold_terms(self.problem, u, q, p) if fold else flip_terms(self.problem, u, J, q, p)
        except np.linalg.LinAlgError:
            terms = math.nan
        monitors: dict[Monitor, float] = {}
        if values.size > 1:
            turn = _TWISTS[self.kind]
            monitors[turn] = twist / float(np.linalg.norm(p * self.sizes) * np.linalg.norm(q / self.sizes))
            monitors[_FF] = (flip_product if fold else fold_product)(others)
        # the coefficient of a period doubling has a pole where another multiplier is 1
        name, weighed = (_CP, terms) if fold else (_GPD, terms * monitors.get(_FF, 1.0))
        monitors[name] = weighed / self.unit(name, weighed) if math.isfinite(weighed) else math.nan
        head = q[: self.problem.states]
        size = float(np.linalg.norm(head))
        coefficient = terms / (twist * size ** (1 if fold else 2)) if twist * size != 0.0 else math.inf
        if fold and head[np.argmax(np.abs(head))] < 0.0:
            coefficient = -coefficient
        return monitors, LocusData(values, unstable_count(others), others, reasons, coefficient=coefficient)

    def _on_rotations(
        self, point: Point, J: NDArray[np.float64], values: NDArray[np.complex128], reasons: tuple[str, ...]
    ) -> tuple[dict[Monitor, float], LocusData]:
        """Return monitors and data where a pair is on the unit circle."""
        u, cosine, others = self.unknowns(point.u), float(point.u[-3]), self.beside(point.u, values)
        monitors = {name: cosine - goal for name, goal in _ANGLES.items()}
        angle, coefficient = math.nan, math.nan
        if abs(cosine) < 1.0:
            angle = math.acos(cosine)
            mu = cmath.exp(1j * angle)
            try:
                coefficient = rotation_terms(self.problem, u, J, mu, null_vectors(self.problem, J, mu)).real
            except (np.linalg.LinAlgError, ZeroDivisionError):
                coefficient = math.nan
        # the coefficient has poles at R1 and R2, and jumps at neither R3 nor R4
        weighed = coefficient * (1.0 - cosine * cosine) ** 2
        monitors[_CH] = weighed / self.unit(_CH, weighed) if math.isfinite(weighed) else math.nan
        return monitors, LocusData(values, unstable_count(others), others, reasons, coefficient, angle=angle)
