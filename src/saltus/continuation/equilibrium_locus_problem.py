"""Critical equilibria in two parameters as a zero problem: extended equations, monitor functions, checks of a step.

docs/theory/equilibria.md, "Loci", derives the equations and lists the monitor functions.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.equilibrium_problem import has_pair, row_units
from saltus.continuation.monitor import Monitor
from saltus.continuation.zero_problem import Event, Examined, Point
from saltus.equilibria.critical import Hopf, Singular
from saltus.equilibria.equilibrium import faults_of
from saltus.equilibria.normal_forms import lyapunov_coefficient
from saltus.equilibria.spectrum import eigenvalues, pair_product, unstable_count

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.equilibria.critical import Condition
    from saltus.equilibria.problem import EquilibriumProblem

__all__ = ["EquilibriumLocusData", "EquilibriumLocusProblem"]

_TURNS = (Monitor("TP", 0), Monitor("TP", 1))  # turning points of the two parameters
_BOUNDS = (Monitor("low", 0), Monitor("high", 0), Monitor("low", 1), Monitor("high", 1))  # ends of their intervals
_CP = Monitor("CP")  # coefficient of the normal form of a saddle-node
_BT = Monitor("BT")  # product of both null vectors on an SN locus, squared frequency on an HB locus
_GH = Monitor("GH")  # first Lyapunov coefficient, times the cubed frequency
_ZH = Monitor("ZH")  # what makes the other of a zero and an imaginary pair
_HH = Monitor("HH")  # product of the sums of two eigenvalues, without that of the critical pair
_OTHERS = {Monitor("SN"), Monitor("HB")}  # loci that meet one of boundary equilibria

_CONSTANT = 1e-9  # component of the tangent below which a parameter is constant along a locus
_RESIDUAL = 1e-8  # most residual of a point, over the sizes of the field's terms
_SLOW = 1e-6  # squared frequency, over the squared size of the Jacobian, below which l1 is rounding, as at a BT
_LONG = 2.0  # length of the null vector from which on its borders are taken anew


@dataclass(frozen=True)
class EquilibriumLocusData:
    """Data of a point of a locus.

    Attributes
    ----------
    values, unstable, reasons
        As in `PointData`; critical eigenvalues are not counted as unstable.
    frequency : float
        Imaginary part of the critical pair on an HB locus, in radians per unit of time; NaN on other loci.
    coefficient : float
        Coefficient of the normal form on an SN or HB locus; NaN on a BE locus.
    """

    values: NDArray[np.complex128]
    unstable: int
    reasons: tuple[str, ...]
    frequency: float = math.nan
    coefficient: float = math.nan

    @property
    def stable(self) -> bool:
        """Whether all eigenvalues but the critical ones have negative real parts."""
        return self.unstable == 0


class EquilibriumLocusProblem:
    """Critical equilibria of one mode as a `ZeroProblem` whose last two unknowns are the parameters.

    The state comes first, then the unknowns of the condition, then the two parameters in units of their intervals. The
    arclength counts states and parameters alone.

    Parameters
    ----------
    problem : EquilibriumProblem
        The equations, with two active parameters.
    kind : str
        ``SN``, ``HB`` or ``BE``.
    condition : Condition
        The critical condition.
    sizes : ndarray, shape (n,)
        Typical sizes of the states; they grow with the locus.
    bounds : tuple of (float, float)
        Intervals of the parameters, in their units.
    """

    singular: frozenset[Monitor] = frozenset()
    odd = frozenset(_TURNS)  # monitor functions that change sign with the tangent's direction
    noise: Mapping[Monitor, float] = MappingProxyType({_GH: 1e-9, _CP: 1e-10})

    def __init__(
        self,
        problem: EquilibriumProblem,
        kind: str,
        condition: Condition,
        sizes: NDArray[np.float64],
        bounds: tuple[tuple[float, float], tuple[float, float]],
    ) -> None:
        self.problem, self.kind, self.condition, self.n = problem, kind, condition, problem.n
        self.sizes, self._bounds = sizes.copy(), bounds
        self.rows: NDArray[np.float64] | None = None
        self._origin: NDArray[np.float64] | None = None
        self._units: dict[Monitor, float] = {}
        own = getattr(condition, "transition", -1)
        self._boundaries = [Monitor("BE", transition=k) for k in problem.ways_out if k != own]

    def equilibrium(self, z: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the unknowns of the equilibrium, shape (n + 2,): state and parameters."""
        return np.concatenate([z[: self.n], z[-2:]])

    def evaluate(self, z: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return residual and Jacobian of equilibrium and condition."""
        n, extra, rows = self.n, self.condition.extra, self.condition.rows
        u = self.equilibrium(z)
        F, J = self.problem.evaluate(u)
        out, matrix = np.full(n + rows, np.nan), np.full((n + rows, n + extra + 2), np.nan)
        if not (np.all(np.isfinite(F)) and np.all(np.isfinite(J))):
            return out, matrix
        matrix[:] = 0.0
        if self.rows is None:
            self.rows = row_units(J * np.append(self.sizes, [1.0, 1.0])) / float(self.sizes.max())
        out[:n], matrix[:n, :n], matrix[:n, -2:] = F, J[:, :n], J[:, n:]
        out[:n] /= self.rows
        matrix[:n] /= self.rows[:, None]
        try:
            values, gradient, further = self.condition.evaluate(u, z[n : n + extra], J)
        except np.linalg.LinAlgError:
            return out, np.full_like(matrix, np.nan)
        out[n:], matrix[n:, :n], matrix[n:, -2:] = values, gradient[:, :n], gradient[:, n:]
        matrix[n:, n : n + extra] = further
        return out, matrix

    def accurate(self) -> bool:
        """Return True: the equations are no discretisation."""
        return True

    def scale(self) -> NDArray[np.float64]:
        """Return typical sizes of the unknowns."""
        return np.concatenate([self.sizes, np.ones(self.condition.extra + 2)])

    def metric(self, z: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return weights: states in their sizes, none for the condition's unknowns, 1 for each parameter."""
        return np.concatenate([1.0 / self.sizes**2, np.zeros(self.condition.extra), [1.0, 1.0]])

    def examine(self, point: Point, before: Point | None) -> Examined:
        """Return monitors, data and fault of a point."""
        u = self.equilibrium(point.u)
        J = self.problem.evaluate(u)[1]
        point.residual = self.problem.rounding(u, J, np.maximum(self.sizes, np.abs(u[: self.n])))
        if point.residual > _RESIDUAL:
            return Examined({}, "residual: the field does not vanish there")
        self.condition.evaluate(u, point.u[self.n : self.n + self.condition.extra], J)
        self.condition.adjust()
        monitors = {name: self._plain(name, point) for name in (*_BOUNDS, *_TURNS, *self._boundaries)}
        for name in _TURNS:
            if abs(monitors[name]) < _CONSTANT:
                monitors[name] = math.nan
        special, data = self._special(point)
        monitors |= special
        if self._origin is None:
            self._origin = u[: self.n].copy()
        self.sizes = np.maximum(self.sizes, np.abs(u[: self.n] - self._origin))
        point.weights = self.metric(point.u)
        point.tangent = point.tangent / math.sqrt(float(point.weights @ point.tangent**2))
        return Examined(monitors, None, data)

    def monitor(self, name: Monitor, point: Point) -> float:
        """Return one monitor function at a point that may be corrected roughly only."""
        if name.kind in ("low", "high", "TP", "BE"):
            return self._plain(name, point)
        u = self.equilibrium(point.u)
        self.condition.evaluate(u, point.u[self.n : self.n + self.condition.extra], self.problem.evaluate(u)[1])
        return self._special(point)[0].get(name, math.nan)

    def _plain(self, name: Monitor, point: Point) -> float:
        kind, at = name.kind, name.segment
        if kind == "TP":
            return float(point.tangent[at - 2])
        if kind == "BE":
            height, gradient = self.problem.event(name.transition, self.equilibrium(point.u))
            return height / self._unit(name, float(np.abs(gradient[: self.n]) @ self.sizes))
        distance = float(point.u[at - 2]) - self._bounds[at][kind == "high"]
        return distance if abs(distance) > 1e-12 else 0.0

    def _unit(self, name: Monitor, value: float) -> float:
        return self._units.setdefault(name, abs(value) or 1.0)

    def _special(self, point: Point) -> tuple[dict[Monitor, float], EquilibriumLocusData]:
        """Return the monitors of codimension-two points and the data of a point."""
        u = self.equilibrium(point.u)
        J = self.problem.evaluate(u)[1]
        values = eigenvalues(J[:, : self.n])
        reasons = tuple(faults_of(self.problem, u, self.sizes))
        if self.kind == "SN":
            return self._on_saddle_nodes(u, values, reasons)
        if self.kind == "HB":
            return self._on_hopf_points(point, u, J, values, reasons)
        sign, log = np.linalg.slogdet(J[:, : self.n])
        singular, pairs = Monitor("SN"), Monitor("HB")
        self._units.setdefault(singular, float(log))
        monitors = {singular: float(sign) * math.exp(min(float(log) - self._units[singular], 600.0))}
        if self.n > 1:
            monitors[pairs] = pair_product(values)
        return monitors, EquilibriumLocusData(values, unstable_count(values), reasons)

    def _on_saddle_nodes(
        self, u: NDArray[np.float64], values: NDArray[np.complex128], reasons: tuple[str, ...]
    ) -> tuple[dict[Monitor, float], EquilibriumLocusData]:
        condition = self.condition
        assert isinstance(condition, Singular)
        q, p = condition.right, condition.left
        bend = float(p @ self.problem.second(u, np.append(q, [0.0, 0.0]))[:, : self.n] @ q)
        null = int(np.argmin(np.abs(values)))
        twist = float(p @ q)
        monitors = {_CP: bend / self._unit(_CP, bend)}
        if self.n > 1:
            monitors[_BT] = twist / float(np.linalg.norm(p * self.sizes) * np.linalg.norm(q / self.sizes))
        if self.n > 2:
            monitors[_ZH] = pair_product(values, (null,))
        unit = q / float(np.linalg.norm(q))
        coefficient = 0.5 * bend / (twist * float(np.linalg.norm(q))) if twist != 0.0 else math.inf
        if unit[np.argmax(np.abs(unit))] < 0.0:
            coefficient = -coefficient
        rest = np.delete(values, null)
        return monitors, EquilibriumLocusData(values, unstable_count(rest), reasons, coefficient=coefficient)

    def _on_hopf_points(
        self,
        point: Point,
        u: NDArray[np.float64],
        J: NDArray[np.float64],
        values: NDArray[np.complex128],
        reasons: tuple[str, ...],
    ) -> tuple[dict[Monitor, float], EquilibriumLocusData]:
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
        monitors[_GH] = l1 * w**3 / self._unit(_GH, l1 * w**3) if math.isfinite(l1) else math.nan
        if rest.size:
            product = complex(np.prod(rest)).real
            monitors[_ZH] = product / self._unit(_ZH, product)
        if rest.size > 1:
            monitors[_HH] = pair_product(values, pair)
        return monitors, EquilibriumLocusData(values, unstable_count(rest), reasons, w, l1)

    def depart(self, point: Point) -> None:
        """Take the borders of an HB locus anew where the null vector has turned away from them."""
        condition = self.condition
        if not isinstance(condition, Hopf):
            return
        at = slice(self.n, self.n + condition.extra)
        if float(np.linalg.norm(point.u[at][: self.n])) < _LONG:
            return
        J = self.problem.evaluate(self.equilibrium(point.u))[1]
        point.u = point.u.copy()
        point.u[at] = condition.turned(J, point.u[at])
        point.J = self.evaluate(point.u)[1]
        scale = self.scale()
        null = np.linalg.svd(point.J * scale)[2][-1] * scale
        along = float(point.weights @ (null * point.tangent))
        point.tangent = math.copysign(1.0, along) * null / math.sqrt(float(point.weights @ null**2))
        point.frame = object()  # the point before has other borders: no cubic through both

    def recover(self, point: Point) -> bool:
        """Return False: there is no discretisation to refine."""
        return False

    def leading(self, names: list[Monitor]) -> list[Monitor]:
        """Return all names: none is another's shadow."""
        return names

    def sort_out(self, events: list[Event]) -> list[Event] | str:
        """Return the events without those at which two real eigenvalues differ in sign alone."""
        kept = []
        for event in events:
            if event.point.examined.data is None:
                return f"location: {event.point.examined.fault}"
            values = event.point.examined.data.values
            if event.name == _ZH and self.kind == "SN":
                values = np.delete(values, np.argmin(np.abs(values)))
            elif event.name == _HH:
                w = event.point.examined.data.frequency
                values = np.delete(values, np.argsort(np.abs(np.abs(values) - w) + np.abs(values.real))[:2])
            elif event.name != Monitor("HB"):
                kept.append(event)
                continue
            if has_pair(values):
                kept.append(event)
        return kept

    def crowded(self, names: list[Monitor]) -> bool:
        """Return whether more than one point of codimension two lies in a step."""
        return sum(name.kind not in ("low", "high", "TP") for name in names) > 1

    def special(self, point: Point) -> Point:
        """Return a copy of a point, to be kept."""
        return replace(point, u=point.u.copy())
