"""Orbits along a quantity, as their maximum or period, as a zero problem: one more unknown, one more equation.

docs/theory/conservative.md derives the equations.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.core.interest import Interest
from saltus.continuation.core.monitor import Monitor
from saltus.continuation.core.zero_problem import Examined, Point
from saltus.continuation.problems.orbit import OrbitZeroProblem
from saltus.scales import FAMILY_STAYS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.orbits.unfolding import UnfoldedEquations

__all__ = ["QuantityZeroProblem"]

_SN = Monitor("SN")  # the freed parameter's component of the tangent
_BP = Monitor("BP")  # determinant of the bordered Jacobian
_TP = Monitor("TP")  # the quantity's component of the tangent
_LEAP = 1.1  # most that the period grows or shrinks by in a step
_SHORT = 1e-4  # arclength of a step up to which it may


class QuantityZeroProblem(OrbitZeroProblem):
    """Orbits of one signature along a quantity as a `ZeroProblem`.

    The unknowns are those of the orbit, the freed parameter in its unit or the strength of the gap, and the quantity.

    Parameters
    ----------
    equations : UnfoldedEquations
        The equations at a fixed value of the quantity, meshes made.
    u : ndarray, shape (size + 2,)
        Unknowns of an orbit.
    interest : Interest
        Bounds and unit of the quantity, users' events.
    home : float or None
        The freed parameter, in its unit, that a family keeps; 0 of the gap. None where the orbits are no family.
    """

    odd = frozenset({_SN, _BP, _TP})
    further = 1

    def __init__(
        self, equations: UnfoldedEquations, u: NDArray[np.float64], interest: Interest, home: float | None
    ) -> None:
        self.equations, self.home, self.neutral = equations, home, home is not None
        super().__init__(equations.problem, u, interest)
        size = self.problem.size
        self.active_at = slice(size, size + len(self.problem.active))
        self._simple[_TP] = lambda point: float(point.tangent[-1])
        if self.neutral:
            self._simple.pop(_SN)
            self.noise = {}
        elif not self.problem.signature.is_cut:
            self._simple[_SN] = lambda point: float(point.tangent[size])

        for i, (_, kind, value) in enumerate(interest.events):
            if kind == "freed" and value is not None:
                self._simple[Monitor("event", i)] = self._freed_less(value)

    def _freed_less(self, value: float) -> Callable[[Point], float]:
        """Return the freed parameter of a point less a value, as a function of the point."""
        return lambda point: float(point.u[self.problem.size] * self.problem.scales[0]) - value

    def own(self, J: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the Jacobian of the orbit's equations, of that of all equations."""
        return np.ascontiguousarray(J[: self.problem.size, : self.problem.size])

    def evaluate(self, u: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return residual, shape (size + 1,), and Jacobian, shape (size + 1, size + 2)."""
        self.equations.value = float(u[-1]) * self.interest.scale
        F, inner = self.equations.evaluate(u[:-1])
        J = np.zeros((F.size, u.size))
        J[:, :-1] = inner
        J[-1, -1] = -self.equations.unit * self.interest.scale
        return F, J

    def _leaps(self, before: Point, point: Point) -> bool:
        """Return whether the period, which the metric does not contain, changes much in a step that is not short."""
        problem = self.problem
        old, new = (float(p.u[problem.n : problem.size : problem.n + 1].sum()) for p in (before, point))
        return point.arc - before.arc > _SHORT and max(old, new) > _LEAP * min(old, new)

    def depart(self, point: Point) -> None:
        """Renew the phase plane and the gap where the orbit has turned away from them."""
        super().depart(point)
        if not self.equations.turn_gap(point.u[:-1], self.own(point.J)):
            return
        from saltus.system.numba_tools.linear import bordered

        F, point.J = self.evaluate(point.u)
        row = point.weights * point.tangent
        steps, point.sign, point.log, _, _ = bordered(point.J, F, row, point.u, point.u, self.scale())
        point.tangent = steps[:, 1] / math.sqrt(float(point.weights @ steps[:, 1] ** 2))
        monitors = {**point.examined.monitors, **self._measured(point)}
        point.examined = Examined(monitors, point.examined.fault, point.examined.data)

    def examine(self, point: Point, before: Point | None) -> Examined:
        """Return monitors, data and fault of a point; in a family the gap must stay closed."""
        if self.home is None:
            name = self.problem.system.parameter_names[int(self.problem.active[0])]
            low, high = self.problem.system.allowed(name)
            value = float(point.u[self.problem.size] * self.problem.scales[0])
            if not low <= value <= high:
                return Examined({}, f"{name} = {value:.6g} leaves [{low:g}, {high:g}]")
        if before is not None and self._leaps(before, point):
            return Examined({}, "deviation: the period changes by more than a tenth in the step")
        found = super().examine(point, before)
        if self.home is None or found.fault is not None:
            return found
        away = abs(float(point.u[self.problem.size]) - self.home)
        if away <= FAMILY_STAYS:
            return found
        what = "the freed parameter leaves its value" if self.equations.by_parameter else "the orbits do not close"
        return Examined(found.monitors, f"family: {what}, so these are no orbits at fixed parameters", found.data)
