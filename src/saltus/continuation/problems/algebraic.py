"""Equilibria, or orbits of maps, as a zero problem with a parameter: metric, monitor functions, checks of a step.

docs/theory/equilibria.md, "Test functions", and docs/theory/map_orbits.md derive the monitor functions.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from copy import copy
from dataclasses import replace
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from saltus import scales
from saltus.continuation.core.faint import faint_step, resolved
from saltus.continuation.core.monitor import Monitor
from saltus.continuation.core.value_tests import Tested, border_tests
from saltus.continuation.core.within_step import searched
from saltus.continuation.core.zero_problem import Event, Examined, Point, hermite
from saltus.continuation.problems.errors import algebraic_error
from saltus.continuation.problems.extents import in_lockstep
from saltus.continuation.problems.point_data import PointData, has_pair, searched_by_size
from saltus.continuation.problems.watching import slope
from saltus.equilibria.spectrum import FAINT, multiplicity, pair_product, sized_eigenvalues, terms_at, unstable_count

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.core.arclength import StepControl
    from saltus.continuation.core.interest import Interest
    from saltus.continuation.problems.point_data import Sized

__all__ = ["AlgebraicZeroProblem"]

_LOW = Monitor("low")  # parameter less its lower bound
_HIGH = Monitor("high")  # parameter less its upper bound
_SN = Monitor("SN")  # parameter's component of the tangent
_BP = Monitor("BP")  # determinant of the bordered Jacobian
_HB = Monitor("HB")  # product of the sums of two eigenvalues

# Where several values become critical at once, products of them may keep their sign. Then one of the values itself is
# watched: its distance from being critical, by its place among the values in the order of their growth.
_TOUCH = Monitor("touch")  # the determinant, where it touches 0
_ZEROS = Monitor("zeros")  # values that belong to a BP
_FLIPS = Monitor("flips")  # values that belong to a PD
_PAIRS = Monitor("pairs")  # complex pairs

_SHARE = 1e-3  # of the eigenvalues at the start, which gives a unit where all of them vanish at once
_UNEXPLAINED = "stability changes without a bifurcation that explains it"
_SEVERAL = "events: values become critical at more than one place within the step"


class AlgebraicZeroProblem:
    """Solutions of an `AlgebraicProblem` as a `ZeroProblem`, with the eigenvalues of the Jacobian.

    Parameters
    ----------
    problem : AlgebraicProblem
        The equations, with one active parameter.
    sizes : ndarray, shape (n,)
        Typical sizes of the unknowns; they grow with the branch.
    interest : Interest
        Bounds and users' events.
    """

    singular = frozenset({_BP, _ZEROS})
    touching: ClassVar[Mapping[Monitor, Monitor]] = MappingProxyType({_BP: _TOUCH})  # may touch 0, and what it is then
    odd = frozenset({_SN, _BP})  # monitor functions that change sign with the tangent's direction
    noise: Mapping[Monitor, float] = MappingProxyType({})
    continuous: tuple[str, ...] = ()
    error = algebraic_error
    critical: ClassVar[tuple[str, ...]] = ("SN", "BP", "HB")  # kinds of monitor functions at whose zeros it bifurcates
    single: ClassVar[tuple[str, ...]] = ("SN", "BP")  # those at which one value becomes critical
    paired: ClassVar[Monitor] = _HB  # that at which a pair of them does
    faint: ClassVar[Mapping[Monitor, float]] = MappingProxyType({_HB: FAINT})  # values up to which they are rounding
    vanishing: ClassVar[str] = "the equations do not vanish there"  # the fault of a point that is no solution

    def __init__(self, problem: Any, sizes: NDArray[np.float64], interest: Interest) -> None:
        self.problem, self.interest, self.n, self.sizes = problem, interest, problem.n, sizes.copy()
        self._origin: NDArray[np.float64] | None = None
        self._log: float | None = None
        self._units: dict[Monitor, float] = {}
        self._rank = 0  # place of the value that is watched where several become critical at once
        self._counts = 0, 0  # of unstable values at the ends of the last step
        self._apart: tuple[int, ...] = ()  # the same of real values and of pairs
        self._unit = 0.0  # modulus of eigenvalues
        self._crossed: int | None = None  # change of the number of unstable values in the last step, if it is known

    def copied(self) -> Self:
        """Return these equations with sizes and units of their own, which are those of now."""
        found = copy(self)
        found.problem, found.sizes, found._units = copy(self.problem), self.sizes.copy(), dict(self._units)
        return found

    def reasons(self, u: NDArray[np.float64]) -> tuple[str, ...]:
        """Return why a solution is virtual."""
        return ()

    def data(self, u: NDArray[np.float64], J: NDArray[np.float64]) -> PointData:
        """Return the data of a point."""
        values, sizes = sized_eigenvalues(self.linear(u, J), partial(self.terms, u))
        return PointData(values, unstable_count(values, sizes), sizes, self.reasons(u))

    def own_monitors(self, point: Point, values: NDArray[np.complex128]) -> dict[Monitor, float]:
        """Return the monitor functions that only this kind of solution has."""
        return {_HB: pair_product(values)} if values.size > 1 else {}

    def own_monitor(self, name: Monitor, point: Point) -> float:
        """Return one of them at a point that may be corrected roughly only."""
        return pair_product(self.spectrum(point.u))

    def observed(self, index: int, point: Point) -> float:
        """Return the quantity of a user's event that is no parameter: a state or an output, at the first point."""
        name, kind, _ = self.interest.events[index]
        system = self.problem.system
        if kind == "state":
            return float(point.u[system.states.index(name)])
        return float(self.outputs(point.u)[system.output_names.index(name)])

    def outputs(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the outputs at a solution, at its first point, shape (outputs,)."""
        raise NotImplementedError

    def is_pair(self, values: NDArray[np.complex128]) -> bool:
        """Return whether the pair that is critical where `paired` vanishes is a complex one."""
        return has_pair(values)

    def evaluate(self, u: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the equations and their derivatives."""
        found: tuple[NDArray[np.float64], NDArray[np.float64]] = self.problem.evaluate(u)
        return found

    def accurate(self, *, met: bool = True) -> bool:
        """Return True: the equations are no discretisation."""
        return True

    def metric(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return weights: states in their sizes, of several points the mean, 1 for the parameter."""
        found = np.ones(self.n + 1)
        found[:-1] /= self.problem.period * self.sizes**2
        return found

    def grown(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how far the unknowns are from those of the start, shape (n,); the same for all points."""
        assert self._origin is not None
        return in_lockstep(np.abs(u[: self.n] - self._origin), self.problem.period)

    def scale(self) -> NDArray[np.float64]:
        """Return typical sizes of the unknowns."""
        found = np.ones(self.n + 1)
        found[:-1] = self.sizes
        return found

    def sized(self, u: NDArray[np.float64]) -> Sized:
        """Return eigenvalues or multipliers, with their sizes; NaN where the Jacobian is not finite."""
        A = self.linear(u, self.problem.evaluate(u)[1])
        if not np.isfinite(A).all():
            return np.full(len(A), math.nan + 0j), np.ones(len(A))
        return sized_eigenvalues(A, partial(self.terms, u))

    def terms(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what the entries of `linear` are made of, shape (unknowns, n, n): see `terms_at`."""
        return np.array([self.linear(u, part) for part in terms_at(self.problem, u)])

    def residual(self, u: NDArray[np.float64], J: NDArray[np.float64], sizes: NDArray[np.float64]) -> float:
        """Return the largest residual of a solution over the sizes of its terms."""
        return float(self.problem.rounding(u, J, sizes))

    def regular(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return unknowns at which the derivatives are finite: `u`, or next to it."""
        return u

    def linear(self, u: NDArray[np.float64], J: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the matrix, of the Jacobian at a solution, whose eigenvalues tell stability."""
        return np.asarray(J[:, : self.n])

    def spectrum(self, u: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return eigenvalues or multipliers; NaN where the Jacobian is not finite."""
        return self.sized(u)[0]

    def spectra(self, places: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return eigenvalues or multipliers at many places, in any order, shape (places, n)."""
        return np.array([self.spectrum(u) for u in places])

    def growth(self, values: NDArray[np.complex128], sizes: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return for each value how fast its direction grows, 0 where it is critical.

        It is the real part, over the largest modulus at the start, or over the size of a value that is far slower.
        """
        self._unit = self._unit or float(np.abs(values).max(initial=0.0))
        slow = sizes < sizes.max(initial=0.0)
        return np.asarray(values.real / np.where(slow, sizes, self._unit or 1.0))

    def in_units(self, values: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Return values in units of the largest modulus at the start."""
        return values / (self._unit or 1.0)

    def tests(self, values: list[complex]) -> Tested:
        """Return functions of values that meet, which vanish where these become critical."""
        return border_tests(values)

    def multiplicity(self, data: PointData, kind: str) -> int:
        """Return how many values or pairs are critical at once at a point of a type."""
        return multiplicity(data.values, kind, _SHARE * self._unit, data.sizes)

    def examine(self, point: Point, before: Point | None) -> Examined:
        """Return monitors, data and fault of a point."""
        J = self.problem.evaluate(u := self.regular(point.u))[1]  # that of the point is in units of its rows
        point.residual = self.residual(point.u, J, np.maximum(self.sizes, np.abs(u[: self.n])))
        if not point.residual <= scales.RESIDUAL_KEPT:
            return Examined({}, f"residual: {self.vanishing}")
        data, u = self.data(u, J), point.u
        if before is not None and before.examined.data is not None:
            old: PointData = before.examined.data
            data = replace(data, behind=(point.arc - before.arc, (old.values, old.sizes)))
        monitors = {name: self.monitor(name, point) for name in (_LOW, _HIGH, _SN, _BP)}
        monitors |= self.own_monitors(point, data.values)
        for i, (_, _, value) in enumerate(self.interest.events):
            name = Monitor("EX" if value is None else "event", i)
            monitors[name] = self.monitor(name, point)
        monitors = resolved(monitors, self.faint, before)
        if self._origin is None:
            self._origin = u[: self.n].copy()
        self.sizes = np.maximum(self.sizes, self.grown(u))
        point.weights = self.metric(u)
        point.tangent = point.tangent / math.sqrt(float(point.weights @ point.tangent**2))
        if before is None:  # what the last step crossed is asked where its points are located
            return Examined(monitors, None, data)
        self._crossed = None
        return Examined(monitors, self._fault(point, before, monitors, data), data, self._twins(data))

    def ahead(self, control: StepControl, before: Point, point: Point, step: float) -> tuple[list[Point], float]:
        """Return many points at once, as far as nothing happens, and the length of the step behind the last one."""
        return [], step

    def monitor(self, name: Monitor, point: Point) -> float:
        """Return one monitor function at a point that may be corrected roughly only."""
        kind = name.kind
        if kind in ("low", "high"):
            distance = point.parameter - (self.interest.low if kind == "low" else self.interest.high)
            return distance if abs(distance) > 1e-12 else 0.0
        if kind == "SN":
            along = float(point.tangent[-1])
            return along if abs(along) > scales.PARAMETER_RESTS else 0.0
        if kind == "BP":
            self._log = point.log if self._log is None else self._log
            return point.sign * math.exp(min(max(point.log - self._log, -600.0), 600.0))
        if kind == "EX":
            return slope(lambda u: self.observed(name.segment, replace(point, u=u)), point.u, point.tangent)
        if name in (_ZEROS, _FLIPS, _PAIRS):
            return float(np.sort(self.growth(*self.sized(point.u)))[::-1][self._rank])
        if kind != "event":
            return self.own_monitor(name, point)
        _, what, value = self.interest.events[name.segment]
        assert value is not None  # an extremum has a monitor function of its own
        if what == "parameter":
            return point.parameter * self.interest.scale - value
        return self.observed(name.segment, point) - value

    def over_unit(self, name: Monitor, height: float, gradient: NDArray[np.float64]) -> float:
        """Return the distance from a surface in units of its variation with the states' sizes."""
        unit = self._units.setdefault(name, float(np.abs(gradient[: self.n]) @ self.sizes) or 1.0)
        return height / unit

    def depart(self, point: Point) -> None:
        """Do nothing: the equations have no normalisation."""
        return

    def recover(self, point: Point) -> bool:
        """Return False: there is no discretisation to refine."""
        return False

    def type_of(self, name: Monitor) -> str:
        """Return the type of the special point at a zero of a monitor function."""
        return {_ZEROS: "BP", _TOUCH: "BP", _FLIPS: "PD", _PAIRS: self.paired.kind}.get(name, name.kind)

    def leading(self, names: list[Monitor]) -> list[Monitor]:
        """Return the names without those that change their sign because of others."""
        kinds = {name.kind for name in names}
        if _ZEROS in names or _FLIPS in names:  # two equal real values change the sign of the pairs' function as well
            kinds.discard(self.paired.kind)
            names = [name for name in names if name != self.paired]
        if _ZEROS in names:  # the determinant vanishes with a high power, where its sign is rounding around it
            kinds.discard("BP")
            names = [name for name in names if name != _BP]
        return [name for name in names if name.kind == self.type_of(name) or self.type_of(name) not in kinds]

    def sort_out(self, events: list[Event]) -> list[Event] | str:
        """Return the events without folds at branch points, and without critical pairs that are real.

        A test function of pairs vanishes too where two real values are related as the critical ones are.
        """
        if any(event.point.examined.data is None for event in events):
            return f"location: {self.vanishing}"
        pairs = (self.paired, _PAIRS)
        events = [e for e in events if e.name not in pairs or self.is_pair(e.point.examined.data.values)]
        if self._crossed is not None and not (self._explained(events, self._crossed) and self._in_turn(events)):
            return _UNEXPLAINED
        branchings = [event.point.arc for event in events if self.type_of(event.name) == "BP"]
        return [e for e in events if e.name != _SN or all(abs(e.point.arc - arc) > 1e-5 for arc in branchings)]

    def _explained(self, events: list[Event], crossed: int) -> bool:
        """Return whether the events of a step explain how the number of unstable values changes in it."""
        free = any(self.type_of(event.name) == "BP" for event in events)
        total, alone, paired = {0}, {0}, {0}
        for event in events:
            kind = self.type_of(event.name)
            if kind in self.single or kind == self.paired.kind:
                count = self.multiplicity(event.point.examined.data, kind)
                free |= count > 1
                # on the branch that turns at a BP, or where several cross, the number may change by less
                ways = range(-count, count + 1) if free else (-count, count)
                share = 2 if kind == self.paired.kind else 1
                total = {known + share * way for known in total for way in ways}
                if share == 2:
                    paired = {known + way for known in paired for way in ways}
                else:
                    alone = {known + way for known in alone for way in ways}
        apart = not self._apart or (self._apart[0] in alone and self._apart[1] in paired)
        return crossed in total and apart

    def _in_turn(self, events: list[Event]) -> bool:
        """Return whether the numbers of unstable values at a step's ends are those on both sides of each event.

        At an event, the values that are not critical tell both: a pair that crossed before it is among them.
        """
        known, last = {self._counts[0]}, self._counts[1]
        for event in sorted(events, key=lambda event: event.point.arc):
            kind, data = self.type_of(event.name), event.point.examined.data
            if kind not in self.single and kind != self.paired.kind:
                continue
            count = self.multiplicity(data, kind) * (2 if kind == self.paired.kind else 1)
            growth = self.growth(data.values, data.sizes)
            others = growth[np.argsort(np.abs(growth), kind="stable")[count:]]
            if np.any(np.abs(others) < scales.GROWTH_CLEAR * np.abs(growth).max(initial=0.0)):
                return True
            there = int(np.sum(others > 0.0))
            if not any(there <= number <= there + count for number in known):
                return False
            known = set(range(there, there + count + 1))
        return last in known

    def crowded(self, names: list[Monitor]) -> bool:
        """Return whether more than one bifurcation lies in a step."""
        return sum(name.kind in self.critical for name in names) > 1

    def _fault(self, point: Point, before: Point, monitors: dict[Monitor, float], data: PointData) -> str | None:
        """Return the reason why a point may not follow the point before, or None if it may."""
        known = before.examined.monitors
        short = point.arc - before.arc < scales.CROWDED
        if not short and (doubt := faint_step(monitors, self.faint, before, point)) is not None:
            return doubt
        changed = {
            name.kind
            for name, value in monitors.items()
            if name in known and (known[name] < 0.0) != (value < 0.0) and math.isfinite(known[name] + value)
        }
        if before.examined.data is None:
            return None if short else before.examined.fault
        old: PointData = before.examined.data
        ends = np.sort(self.growth(old.values, old.sizes)), np.sort(self.growth(data.values, data.sizes))
        near = bool(np.any(((ends[0] < 0.0) != (ends[1] < 0.0)) & (np.abs(ends).min(axis=0) > scales.GROWTH_RESOLVED)))
        touches = {"SN", "BP"} <= changed  # a value of a branch that turns at a pitchfork
        if not short and self._several_critical(before, point, data, touches=touches):
            return _SEVERAL
        rounded = ((ends[0] > 0.0) != (ends[1] > 0.0)) & (
            np.maximum(np.abs(ends[0]), np.abs(ends[1])) < scales.GROWTH_ROUNDED
        )
        crossed = max(abs(data.unstable - old.unstable) - int(rounded.sum()), 0)
        apart = self._crossed_apart(old, data) if near or changed else ()
        real = sum(kind in changed for kind in self.single)
        if any(math.isnan(table.get(self.paired, 0.0)) for table in (known, monitors)):  # a centre
            return _UNEXPLAINED if crossed > real + 2 and not short else None
        if crossed == 0 and any(apart) and not short:
            return _UNEXPLAINED
        self._crossed, self._apart = None if short else crossed, apart
        self._counts = old.unstable, data.unstable
        if crossed > real:
            self._watch(before, monitors, data, needed=crossed > real + 2 * (self.paired.kind in changed))
        return None

    def _crossed_apart(self, before: PointData, after: PointData) -> tuple[int, ...]:
        """Return by how many unstable real values and unstable pairs differ; nothing where real ones become pairs."""
        found = []
        for data in (before, after):
            paired = np.abs(data.values.imag) > scales.EQUAL_BY_SYMMETRY * np.abs(data.values)
            grows = self.growth(data.values, data.sizes) > scales.GROWTH_ROUNDED
            found.append((int(paired.sum()), int((grows & ~paired).sum()), int((grows & paired).sum()) // 2))
        (pairs, *first), (others, *second) = found
        return tuple(abs(b - a) for a, b in zip(first, second, strict=True)) if pairs == others else ()

    def _several_critical(self, a: Point, b: Point, data: PointData, *, touches: bool) -> bool:
        """Return whether values may become critical at several places within a step."""
        length, old = b.arc - a.arc, a.examined.data
        along = partial(hermite, a, b, length)
        back, before = old.behind or (length, None)
        known = [*([before] if before else []), (old.values, old.sizes), (data.values, data.sizes)]
        if any(np.ptp(sizes) > 0.0 for _, sizes in known):
            unit, sized = self._unit or 1.0, lambda share: self.sized(along(share))
            told = searched_by_size(sized, known, (back, length), self.tests, unit, touches=touches)
            still = not (np.all(old.values) and np.all(data.values))  # a value has left the numbers: it has no sign
            if told is not None or (still and not touches):
                return told is not False  # else one value comes to others, or parts from them, as where it touches 0

        def spectra(shares: NDArray[np.float64]) -> NDArray[np.complex128]:
            return self.in_units(self.spectra(along(shares[:, None])))

        rows = [self.in_units(row) for row, _ in known]
        return searched(spectra, rows, (back, length), self.tests, touches=touches) is not False

    def _watched(self, value: complex) -> Monitor:
        """Return the monitor function of a value that becomes critical."""
        real = _FLIPS if "PD" in self.single and value.real < 0.0 else _ZEROS
        return _PAIRS if value.imag != 0.0 else real

    def _twins(self, data: PointData) -> frozenset[Monitor]:
        """Return the test functions that have double zeros as the values nearest to being critical are equal."""
        values, growth = data.values, np.abs(self.growth(data.values, data.sizes))
        order = np.argsort(growth)
        name = self._watched(complex(values[order[0]])) if order.size else _ZEROS
        count = 4 if name == _PAIRS else 2
        if (
            order.size < count
            or growth[order[count - 1]] - growth[order[0]] > scales.EQUAL_BY_SYMMETRY * growth[order[count - 1]]
        ):
            return frozenset()
        return frozenset({self.paired, Monitor(self.type_of(name))})

    def _watch(self, before: Point, monitors: dict[Monitor, float], data: PointData, *, needed: bool) -> None:
        """Add the middle one of the values that become critical in a step to the monitor functions at both ends.

        Where it is not needed, since the test function of pairs changes its sign, a real value is added: two equal ones
        change that sign as well.
        """
        old: PointData = before.examined.data
        self._rank = min(old.unstable, data.unstable) + abs(data.unstable - old.unstable) // 2
        ends = []
        for own in (old, data):
            growth = self.growth(own.values, own.sizes)
            at = np.argsort(-growth, kind="stable")[self._rank]
            ends.append((float(growth[at]), complex(own.values[at])))
        name = self._watched(min(ends, key=lambda end: abs(end[0]))[1])
        if name == _PAIRS and not needed:
            return
        before.examined = replace(before.examined, monitors={**before.examined.monitors, name: ends[0][0]})
        monitors[name] = ends[1][0]
