"""Critical equilibria, or orbits of maps, in two parameters as a zero problem: what both have in common.

docs/theory/equilibria.md, "Loci", derives the equations and lists the monitor functions.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from saltus.continuation.core.faint import faint_step, resolved
from saltus.continuation.core.monitor import Monitor
from saltus.continuation.core.zero_problem import Event, Examined, Point
from saltus.continuation.problems.extents import in_lockstep
from saltus.continuation.problems.other_values import KIND, SEVERAL, OtherValues, eigenvalues_beside, without_nearest
from saltus.equilibria.spectrum import eigenvalues, unstable_count
from saltus.scales import PARAMETER_RESTS, RESIDUAL_KEPT

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["AlgebraicLocusProblem", "LocusData"]

_TURNS = (Monitor("TP", 0), Monitor("TP", 1))  # turning points of the two parameters
_BOUNDS = (Monitor("low", 0), Monitor("high", 0), Monitor("low", 1), Monitor("high", 1))  # ends of their intervals

_CP = Monitor("CP")  # coefficient of the normal form of a saddle-node
_LONG = 2.0  # length of the null vector from which on its borders are taken anew


@dataclass(frozen=True)
class LocusData:
    """Data of a point of a locus."""

    values: NDArray[np.complex128]  # eigenvalues, or multipliers
    unstable: int  # how many are unstable; critical ones are not counted
    others: NDArray[np.complex128]  # those that are not critical
    reasons: tuple[str, ...] = ()  # why the solution is virtual
    coefficient: float = math.nan  # coefficient of the normal form; NaN where the type of the locus has none
    # imaginary part of the critical pair of eigenvalues, in radians per unit of time; NaN where there is none
    frequency: float = math.nan
    angle: float = math.nan  # angle of the critical pair of multipliers, in radians; NaN where there is none
    behind: tuple[float, NDArray[np.complex128]] | None = None  # arclength from the point before, and its other values

    @property
    def stable(self) -> bool:
        """Whether all values but the critical ones are stable."""
        return self.unstable == 0


class AlgebraicLocusProblem:
    """Critical equilibria, or map orbits, as a `ZeroProblem` whose last two unknowns are the parameters.

    The state comes first, then the unknowns of the condition, then the two parameters in units of their intervals. The
    arclength counts states and parameters alone.

    Parameters
    ----------
    problem : AlgebraicProblem
        The equations, with two active parameters.
    kind : str
        Type of the locus.
    condition : Condition
        The critical condition.
    sizes : ndarray, shape (n,)
        Typical sizes of the states; they grow with the locus.
    bounds : tuple of (float, float)
        Intervals of the parameters, in their units.
    u : ndarray, shape (n + 2,)
        State and parameters at which the locus starts.
    """

    singular: frozenset[Monitor] = frozenset()
    odd = frozenset(_TURNS)  # monitor functions that change sign with the tangent's direction
    noise: Mapping[Monitor, float] = MappingProxyType({})
    continuous: tuple[str, ...] = (KIND, "FF")
    faint: Mapping[Monitor, float] = MappingProxyType({})  # values of monitor functions up to which they are rounding
    vanishing: ClassVar[str] = "the equations do not vanish there"  # the fault of a point that is no solution

    def __init__(
        self,
        problem: Any,
        kind: str,
        condition: Any,
        sizes: NDArray[np.float64],
        bounds: tuple[tuple[float, float], tuple[float, float]],
        u: NDArray[np.float64],
    ) -> None:
        self.problem, self.kind, self.condition, self.n = problem, kind, condition, problem.n
        self.sizes, self._bounds = sizes.copy(), bounds
        self._origin: NDArray[np.float64] | None = None
        self.rows: NDArray[np.float64] | None = None
        self._units: dict[Monitor, float] = {}
        self.others, self.met = self.other_values(), self.met_at(u)

    def met_at(self, u: NDArray[np.float64]) -> frozenset[int]:
        """Return the transitions on whose surfaces a locus lies that starts there."""
        return frozenset()

    def other_values(self) -> OtherValues:
        """Return the test functions of the values that are not critical."""
        return eigenvalues_beside({})

    def spectrum(self, u: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the eigenvalues, or multipliers, of a solution; NaN where the equations have no finite derivatives."""
        u = self.regular(u)
        A = self.linear(u, self.problem.evaluate(u)[1])
        return eigenvalues(A) if np.all(np.isfinite(A)) else np.full(len(A), math.nan + 0j)

    def linear(self, u: NDArray[np.float64], J: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the matrix, of the Jacobian at a solution, whose eigenvalues tell stability."""
        return np.asarray(J[:, : self.n])

    def beside(self, z: NDArray[np.float64], values: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Return the values that are not critical."""
        return without_nearest(values, 0.0)

    def values_beside(self, z: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the values that are not critical at unknowns near the locus."""
        return self.beside(z, self.spectrum(self.unknowns(z)))

    def borders(self, point: Point) -> dict[Monitor, float]:
        """Return the monitor functions of borders at which the locus ends."""
        return {}

    def reasons(self, u: NDArray[np.float64]) -> tuple[str, ...]:
        """Return why a solution is virtual."""
        return ()

    def special(self, point: Point) -> tuple[dict[Monitor, float], LocusData]:
        """Return the monitors of codimension-two points and the data of a point; on a locus of saddle-nodes here."""
        u = self.unknowns(point.u)
        values = self.spectrum(u)
        others = self.beside(point.u, values)
        q, p = self.condition.right, self.condition.left
        bend = float(p @ self.problem.second(u, np.append(q, [0.0, 0.0]))[:, : self.n] @ q)
        twist = float(p @ q)
        unit = q / float(np.linalg.norm(q))
        coefficient = 0.5 * bend / (twist * float(np.linalg.norm(q))) if twist != 0.0 else math.inf
        if unit[np.argmax(np.abs(unit))] < 0.0:
            coefficient = -coefficient
        monitors = {_CP: bend / self.unit(_CP, bend)}
        return monitors, LocusData(values, unstable_count(others), others, self.reasons(u), coefficient)

    def sort_out(self, events: list[Event]) -> list[Event] | str:
        """Return the events without those that are no points of codimension two."""
        for event in events:
            if event.point.examined.data is None:
                return f"location: {event.point.examined.fault}"
        return self.others.typed(events)

    def grown(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how far the unknowns are from those of the start, shape (n,); the same for all points."""
        assert self._origin is not None
        return in_lockstep(np.abs(u[: self.n] - self._origin), self.problem.period)

    def unknowns(self, z: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the unknowns of the solution, shape (n + 2,): states and parameters."""
        return np.concatenate([z[: self.n], z[-2:]])

    def evaluate(self, z: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return residual and Jacobian of solution and condition."""
        n, extra, rows = self.n, self.condition.extra, self.condition.rows
        u = self.unknowns(z)
        F, J = self.equations(u)
        out, matrix = np.full(n + rows, np.nan), np.full((n + rows, n + extra + 2), np.nan)
        if not (np.all(np.isfinite(F)) and np.all(np.isfinite(J))):
            return out, matrix
        matrix[:] = 0.0
        if self.rows is None:
            self.rows = self.units_of_rows(J)
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

    def equations(self, u: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the equations of the solution, shape (n,), and their derivatives, shape (n, n + 2)."""
        found: tuple[NDArray[np.float64], NDArray[np.float64]] = self.problem.evaluate(u)
        return found

    def regular(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return unknowns at which the derivatives are finite: `u`, or next to it."""
        return u

    def units_of_rows(self, J: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return units of the equations, shape (n,), from their derivatives at the start."""
        return np.ones(self.n)

    def accurate(self, *, met: bool = True) -> bool:
        """Return True: the equations are no discretisation."""
        return True

    def scale(self) -> NDArray[np.float64]:
        """Return typical sizes of the unknowns."""
        return np.concatenate([self.sizes, np.ones(self.condition.extra + 2)])

    def metric(self, z: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return weights as those of a branch, none for the condition's unknowns, 1 for each parameter."""
        own = 1.0 / (self.problem.period * self.sizes**2)
        return np.concatenate([own, np.zeros(self.condition.extra), [1.0, 1.0]])

    def examine(self, point: Point, before: Point | None) -> Examined:
        """Return monitors, data and fault of a point."""
        u = self.unknowns(point.u)
        at = self.regular(u)
        J = self.problem.evaluate(at)[1]
        point.residual = self.problem.rounding(at, J, np.maximum(self.sizes, np.abs(u[: self.n])))
        if not point.residual <= RESIDUAL_KEPT:
            return Examined({}, f"residual: {self.vanishing}")
        try:
            self.condition.evaluate(u, point.u[self.n : self.n + self.condition.extra], J)
        except np.linalg.LinAlgError:
            return Examined({}, "singular: two loci meet there")
        self.condition.adjust()
        monitors = {name: self._plain(name, point) for name in (*_BOUNDS, *_TURNS)} | self.borders(point)
        for name in _TURNS:
            if abs(monitors[name]) < PARAMETER_RESTS:
                monitors[name] = math.nan
        special, data = self.special(point)
        if before is not None and before.examined.data is not None:
            data = replace(data, behind=(point.arc - before.arc, before.examined.data.others))
        monitors = resolved(monitors | special, self.faint, before)
        others = self.others.measured(data.others, before, float(np.abs(data.values).max(initial=0.0)), monitors)
        if self._origin is None:
            self._origin = u[: self.n].copy()
        self.sizes = np.maximum(self.sizes, self.grown(u))
        point.weights = self.metric(point.u)
        point.tangent = point.tangent / math.sqrt(float(point.weights @ point.tangent**2))
        if before is None:
            return Examined(monitors | others, None, data)
        doubt = faint_step(monitors, self.faint, before, point)
        if doubt is None and self.others.overlooked(before, point, data.others, self.values_beside):
            doubt = SEVERAL
        return Examined(monitors | others, doubt, data, once=frozenset(others))

    def monitor(self, name: Monitor, point: Point) -> float:
        """Return one monitor function at a point that may be corrected roughly only."""
        if name.kind in ("low", "high", "TP"):
            return self._plain(name, point)
        if name.kind in ("BE", "BC"):
            return self.borders(point).get(name, math.nan)
        if self.others.tells(name):
            return self.others.named(self.values_beside(point.u)).get(name, math.nan)
        u = self.unknowns(point.u)
        self.condition.evaluate(u, point.u[self.n : self.n + self.condition.extra], self.problem.evaluate(u)[1])
        return self.special(point)[0].get(name, math.nan)

    def _plain(self, name: Monitor, point: Point) -> float:
        kind, at = name.kind, name.segment
        if kind == "TP":
            return float(point.tangent[at - 2])
        distance = float(point.u[at - 2]) - self._bounds[at][kind == "high"]
        return distance if abs(distance) > 1e-12 else 0.0

    def unit(self, name: Monitor, value: float) -> float:
        """Return the size of a monitor function: its first value but 0."""
        return self._units.setdefault(name, abs(value) or 1.0)

    def depart(self, point: Point) -> None:
        """Take the borders of a critical pair anew where the null vector has turned away from them."""
        condition = self.condition
        if not hasattr(condition, "turned"):
            return
        at = slice(self.n, self.n + condition.extra)
        if float(np.linalg.norm(point.u[at][: self.n])) < _LONG:
            return
        J = self.problem.evaluate(self.unknowns(point.u))[1]
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
        """See `OtherValues.leading`."""
        return self.others.leading(names)

    def crowded(self, names: list[Monitor]) -> bool:
        """Return whether more than one point of codimension two lies in a step."""
        return sum(name.kind not in ("low", "high", "TP") for name in names) > 1
