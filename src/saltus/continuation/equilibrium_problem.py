"""Equilibria of one mode as a zero problem with a parameter: metric, monitor functions, checks of a step.

docs/theory/equilibria.md, "Test functions", derives the monitor functions.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.monitor import Monitor
from saltus.continuation.stretches import PointData, Stretch
from saltus.continuation.zero_problem import Event, Examined, Point
from saltus.equilibria.equilibrium import faults_of
from saltus.equilibria.find import responses, state_sizes
from saltus.equilibria.spectrum import FAINT, eigenvalues, pair_product, unstable_count

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.arclength import StepControl
    from saltus.continuation.orbit_problem import Interest
    from saltus.equilibria.problem import EquilibriumProblem

__all__ = ["CRITICAL", "EquilibriumZeroProblem", "closes", "extents", "has_pair", "row_units"]

_LOW = Monitor("low")  # parameter less its lower bound
_HIGH = Monitor("high")  # parameter less its upper bound
_SN = Monitor("SN")  # parameter's component of the tangent
_BP = Monitor("BP")  # determinant of the bordered Jacobian
_HB = Monitor("HB")  # product of the sums of two eigenvalues
_DOMAIN = Monitor("domain")  # domain function of the mode

_QUIET = (_SN, _BP, _HB, _LOW, _HIGH)  # test functions that must keep their signs where many steps are taken at once

CRITICAL = ("SN", "BP", "HB", "BE")  # kinds of monitor functions at whose zeros something bifurcates

_RESIDUAL = 1e-8  # most residual of a point, over the sizes of the field's terms
_NEAR = 1e-2  # share of a state's modulus below which its size on a branch is not chosen
_SHORT = 1e-5  # arclength of a step up to which several eigenvalues may cross the imaginary axis in it
_LONG = 1e-3  # arclength of a step from which on it must not end where the test function of HB is rounding
_CLOSING = 3.0  # first steps of a curve, in arclength, within which it cannot close
_RESTS = 1e-9  # change of the parameter per unit of arclength, up to which it rests


def extents(problem: EquilibriumProblem, u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the states' sizes at the start of a curve, shape (n,): how far the parameters move them, and their moduli.

    A state may be large and yet hardly move, as a temperature in kelvins: its size is then how far it moves.
    """
    J = problem.evaluate(u)[1]
    n, x = problem.n, np.abs(u[: problem.n])
    sizes = state_sizes(problem, u, J)
    moved = np.abs(responses(J[:, :n], J[:, n:], sizes)).max(axis=1)
    return np.where((x > _NEAR * sizes) & (moved > 0.0), np.clip(moved, _NEAR * x, x), sizes)


def row_units(J: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a unit for each row of a matrix: its largest entry; for a row of zeros that of the matrix."""
    terms = np.abs(J).max(axis=1)
    if not np.all(np.isfinite(terms)):
        return np.ones(terms.size)
    return np.where(terms > 0.0, terms, float(terms.max()) or 1.0)


class EquilibriumZeroProblem:
    """Equilibria of one mode as a `ZeroProblem`.

    Parameters
    ----------
    problem : EquilibriumProblem
        The equations, with one active parameter.
    sizes : ndarray, shape (n,)
        Typical sizes of the states; they grow with the branch.
    interest : Interest
        Bounds and users' events.
    """

    singular = frozenset({_BP})
    odd = frozenset({_SN, _BP})  # monitor functions that change sign with the tangent's direction
    noise: Mapping[Monitor, float] = MappingProxyType({})

    def __init__(self, problem: EquilibriumProblem, sizes: NDArray[np.float64], interest: Interest) -> None:
        self.problem, self.interest, self.n = problem, interest, problem.n
        self.sizes = sizes.copy()
        self._origin: NDArray[np.float64] | None = None
        self._log: float | None = None
        self._units: dict[int, float] = {}
        self.rows: NDArray[np.float64] | None = None
        self._guarded = problem.system.modes[problem.system.mode_names[problem.mode]].domain is not None

    def evaluate(self, u: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the field and its derivatives, rows in one unit by the sizes of their terms at the first call."""
        F, J = self.problem.evaluate(u)
        if self.rows is None:
            self.rows = row_units(J * self.scale()) / float(self.sizes.max())
        return F / self.rows, J / self.rows[:, None]

    def accurate(self) -> bool:
        """Return True: the equations are no discretisation."""
        return True

    def metric(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return weights: states in their sizes, 1 for the parameter."""
        return np.append(1.0 / self.sizes**2, 1.0)

    def scale(self) -> NDArray[np.float64]:
        """Return typical sizes of the unknowns."""
        return np.append(self.sizes, 1.0)

    def examine(self, point: Point, before: Point | None) -> Examined:
        """Return monitors, data and fault of a point."""
        u = point.u
        point.J = self.problem.evaluate(u)[1]
        point.residual = self.problem.rounding(u, point.J, np.maximum(self.sizes, np.abs(u[: self.n])))
        if not point.residual <= _RESIDUAL:
            return Examined({}, "residual: the field does not vanish there")
        values = eigenvalues(point.J[:, : self.n])
        reasons = tuple(faults_of(self.problem, u, self.sizes))
        data = PointData(values, unstable_count(values), reasons)
        monitors = self._monitors(point, values)
        if _HB in monitors and abs(monitors[_HB]) < FAINT and (before is None or not _seen(before)):
            monitors[_HB] = math.nan  # rounding, as along a family of centres
        if self._origin is None:
            self._origin = u[: self.n].copy()
        self.sizes = np.maximum(self.sizes, np.abs(u[: self.n] - self._origin))
        point.weights = self.metric(u)
        point.tangent = point.tangent / math.sqrt(float(point.weights @ point.tangent**2))
        return Examined(monitors, None if before is None else _fault(point, before, monitors, data), data)

    def _monitors(self, point: Point, values: NDArray[np.complex128]) -> dict[Monitor, float]:
        names = [_LOW, _HIGH, _SN, _BP]
        names += [Monitor("BE", transition=k) for k in self.problem.ways_out]
        names += [_DOMAIN] if self._guarded else []
        names += [Monitor("event", i) for i in range(len(self.interest.events))]
        found = {name: self.monitor(name, point) for name in names}
        if self.n > 1:
            found[_HB] = pair_product(values)
        return found

    def monitor(self, name: Monitor, point: Point) -> float:
        """Return one monitor function at a point that may be corrected roughly only."""
        kind = name.kind
        if kind in ("low", "high"):
            distance = point.parameter - (self.interest.low if kind == "low" else self.interest.high)
            return distance if abs(distance) > 1e-12 else 0.0
        if kind == "SN":
            along = float(point.tangent[-1])
            return along if abs(along) > _RESTS else 0.0
        if kind == "BP":
            self._log = point.log if self._log is None else self._log
            return point.sign * math.exp(min(max(point.log - self._log, -600.0), 600.0))
        if kind == "HB":
            A = self.problem.evaluate(point.u)[1][:, : self.n]
            return pair_product(eigenvalues(A)) if np.all(np.isfinite(A)) else math.nan
        if kind == "domain":
            return self.problem.guard(self.problem.mode, point.u)
        if kind == "BE":
            height, gradient = self.problem.event(name.transition, point.u)
            unit = self._units.setdefault(name.transition, float(np.abs(gradient[: self.n]) @ self.sizes) or 1.0)
            return height / unit
        return self._event(name.segment, point)

    def _event(self, index: int, point: Point) -> float:
        name, kind, value = self.interest.events[index]
        system = self.problem.system
        if kind == "parameter":
            return point.parameter * self.interest.scale - value
        if kind == "state":
            return float(point.u[system.states.index(name)]) - value
        return float(self.outputs(point.u)[system.output_names.index(name)]) - value

    def outputs(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the outputs at an equilibrium, shape (outputs,)."""
        compiled = self.problem.compiled
        out = np.empty(compiled.n_outputs)
        p = compiled.extended(self.problem.parameters_at(u))
        compiled.call("outputs", self.problem.mode, 0, np.ascontiguousarray(u[: self.n]), p, out)
        return out

    def ahead(self, control: StepControl, before: Point, point: Point, step: float) -> tuple[list[Point], float]:
        """Return many points at once, as far as nothing happens, and the length of the step behind the last one.

        Only in a mode without surfaces, and without users' events.
        """
        problem = self.problem
        if problem.ways_out or self._guarded or self.interest.events or self._origin is None or self.rows is None:
            return [], step
        found = Stretch(problem, before, point, step, control, (self.interest, self.sizes, self._origin, self.rows))
        self._log = point.log if self._log is None else self._log
        kept = found.quiet(before, point, self._log, _QUIET)
        points = found.points(point, kept)
        if points:
            self.sizes = found.sizes[kept - 1].copy()
            step = float(found.numbers[kept, 4]) if kept < found.taken else found.step
        return points, step

    def depart(self, point: Point) -> None:
        """Do nothing: the equations have no normalisation."""

    def recover(self, point: Point) -> bool:
        """Return False: there is no discretisation to refine."""
        return False

    def leading(self, names: list[Monitor]) -> list[Monitor]:
        """Return all names: none is another's shadow."""
        return names

    def sort_out(self, events: list[Event]) -> list[Event] | str:
        """Return the events without folds at branch points, and without neutral saddles.

        At a neutral saddle two real eigenvalues differ in sign alone. The test function of HB vanishes there too.
        """
        if any(event.point.examined.data is None for event in events):
            return "location: the field does not vanish at an event"
        branchings = [event.point.arc for event in events if event.name == _BP]
        kept = [e for e in events if e.name != _SN or all(abs(e.point.arc - arc) > 1e-5 for arc in branchings)]
        return [event for event in kept if event.name != _HB or has_pair(event.point.examined.data.values)]

    def crowded(self, names: list[Monitor]) -> bool:
        """Return whether more than one bifurcation lies in a step."""
        return sum(name.kind in CRITICAL for name in names) > 1


def _seen(point: Point) -> bool:
    """Return whether the test function of HB is more than rounding at a point."""
    return abs(point.examined.monitors[_HB]) >= FAINT


def has_pair(values: NDArray[np.complex128]) -> bool:
    """Return whether the two eigenvalues whose sum is least, over their moduli, are a complex pair."""
    best, pair = math.inf, False
    for i in range(values.size):
        for j in range(i + 1, values.size):
            share = abs(values[i] + values[j]) / max(abs(values[i]) + abs(values[j]), 1e-300)
            if share < best:
                best, pair = share, abs(values[i].imag) > 0.0 and abs(values[j].imag) > 0.0
    return pair


def _fault(point: Point, before: Point, monitors: Mapping[Monitor, float], data: PointData) -> str | None:
    """Return the reason why a point may not follow the point before, or None if it may."""
    if point.arc - before.arc < _SHORT:
        return None
    known = before.examined.monitors
    if point.arc - before.arc > _LONG and abs(monitors.get(_HB, 1.0)) < FAINT and _seen(before):
        return "events: the step ends at a zero of HB, and may have passed over another"
    changed = {
        name.kind
        for name, value in monitors.items()
        if name in known and (known[name] < 0.0) != (value < 0.0) and math.isfinite(known[name] + value)
    }
    if before.examined.data is None:
        return before.examined.fault
    old: PointData = before.examined.data
    crossed = abs(data.unstable - old.unstable)
    real = ("SN" in changed) + ("BP" in changed)
    centre = any(math.isnan(table.get(_HB, 0.0)) for table in (known, monitors))
    most = real + 2 * ("HB" in changed or centre)
    if crossed > most or (not centre and (crossed - real) % 2):
        return "stability changes without a bifurcation that explains it"
    return None


def closes(origin: Point, last: Point, new: Point, control: StepControl) -> bool:
    """Return whether the step from `last` to `new` passes the start of a curve of equilibria."""
    if new.arc < _CLOSING * control.initial:
        return False
    if abs(origin.parameter - last.parameter) > 2.0 * abs(new.parameter - last.parameter) + control.initial:
        return False
    w, chord, away = last.weights, new.u - last.u, origin.u - last.u
    length = float(w @ chord**2)
    share = float(w @ (away * chord)) / length
    if not 0.0 < share <= 1.0:
        return False
    aside = math.sqrt(float(w @ (away - share * chord) ** 2))
    return aside < 20.0 * control.deviation and aside < 0.5 * math.sqrt(length)
