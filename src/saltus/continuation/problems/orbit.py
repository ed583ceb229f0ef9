"""Orbits of one signature as a zero problem with a parameter: metric, monitor functions, checks of a step.

docs/theory/continuation.md derives metric and monitor functions.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from saltus import scales
from saltus.continuation.core.monitor import Monitor, at_grazing, bifurcates
from saltus.continuation.core.value_tests import circle_tests
from saltus.continuation.core.zero_problem import Event, Examined, Point, Unsolved
from saltus.continuation.problems import guards
from saltus.continuation.problems.changes import limits_of_multipliers
from saltus.continuation.problems.doubts import DOUBT, in_order, search_between
from saltus.continuation.problems.errors import orbit_error
from saltus.continuation.problems.grazing import turned
from saltus.continuation.problems.margins import grazing_monitors, side_of, still_ahead, timed, without_shadows
from saltus.continuation.problems.orbit_data import OrbitData
from saltus.continuation.problems.phase_plane import astray, depart, log_of_crossings, sharpen, solve_again
from saltus.continuation.problems.retries import Retries
from saltus.continuation.problems.twins import FLIPS, ZEROS, crossing_at_once, doubled_by, explains, once
from saltus.continuation.problems.watching import Watched, beyond
from saltus.orbits import records
from saltus.orbits.correction import corrected
from saltus.orbits.landing.upstrokes import carried
from saltus.orbits.maps import small_at_starts
from saltus.orbits.observables.gradients import slope_along
from saltus.orbits.observables.outputs import complete
from saltus.orbits.observables.quantities import read_quantity
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.rounds import divided
from saltus.orbits.stability.floquet import (
    Passage,
    doubling_determinant,
    height,
    multipliers,
    nontrivial,
    passage,
    unstable_count,
)  # fmt: skip
from saltus.orbits.stability.speedless import or_unknown

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.core.interest import Interest

__all__ = ["OrbitZeroProblem"]

_LOW = Monitor("low")  # parameter less its lower bound
_HIGH = Monitor("high")  # parameter less its upper bound
_SN = Monitor("SN")  # parameter's component of the tangent
_PD = Monitor("PD")  # determinant of a multiplier -1
_BP = Monitor("BP")  # determinant of the bordered Jacobian

# why there is no point, by what Newton's method tells
_UNSOLVED = {
    records.SINGULAR: Unsolved.SINGULAR,
    records.ENDLESS: Unsolved.ENDLESS,
    records.APART: Unsolved.APART,
    records.LATE: Unsolved.LATE,
}


class OrbitZeroProblem:
    """Orbits of one signature as a `ZeroProblem`.

    Monitor functions belong to the bounds (``low``, ``high``), the bifurcations ``SN``, ``PD``, ``BP`` and ``TR``, the
    grazings, and users' events. There is one of ``TR`` for each complex pair: the height on the Riemann sphere of its
    multiplier above the real axis. `Monitor` explains the names.

    Parameters
    ----------
    problem : OrbitProblem
        The equations, meshes made.
    u : ndarray, shape (size + 1,)
        Unknowns of an orbit, and the parameter.
    interest : Interest
        Bounds and users' events.
    """

    singular = frozenset({_BP})
    odd = frozenset({_SN, _BP})  # monitor functions that change sign with the tangent's direction
    noise: Mapping[Monitor, float] = MappingProxyType({})
    continuous: tuple[str, ...] = ()
    error = orbit_error
    further = 0  # unknowns between those of the orbit and the varied one
    active_at: slice | None = None  # where among the unknowns the active parameters are, if not at their end
    neutral = False  # whether multipliers lie on the unit circle all along, as in a conservative system

    def __init__(self, problem: OrbitProblem, u: NDArray[np.float64], interest: Interest) -> None:
        self.problem, self._retries = problem, Retries(problem)
        self.interest, self.n = interest, problem.n
        self._autonomous = problem.system.phase is None
        self._logs: dict[Monitor, float] = {}
        self._step: tuple[Point, Point] | None = None
        self._resting = False  # whether the parameter rests in the last step
        self._crossed: int | None = None  # equal multipliers that cross the unit circle at once in the last step
        self._adjust(u)
        self._durations = timed(problem.system, problem.signature)
        self._simple: dict[Monitor, Callable[[Point], float]] = {
            _LOW: lambda point: beyond(point.parameter - interest.low),
            _HIGH: lambda point: beyond(point.parameter - interest.high),
            _SN: lambda point: float(point.tangent[-1]),
            _PD: lambda point: self._sized(_PD, *doubling_determinant(problem, self.own(point.J)), point),
            _BP: lambda point: self._sized(_BP, point.sign, point.log, point),
        }
        if problem.signature.is_cut:
            # products of multipliers leave out the trivial one exactly, determinants to the flow's tolerance only
            self._simple[_SN] = lambda point: point.sign * self._product(_SN, point, 1.0)
            self._simple[_PD] = lambda point: self._product(_PD, point, -1.0)
            # both change by many powers of ten in a step
            self.noise = MappingProxyType({_SN: scales.PRODUCT_ROUNDED, _PD: scales.PRODUCT_ROUNDED})
        for vanishing, i in self._durations.items():
            self._simple[vanishing] = lambda point, at=i * (self.n + 1) + self.n: float(point.u[at])  # type: ignore[misc]
        self._surveyed = grazing_monitors(problem)
        names = (*problem.system.all_states, *problem.system.output_names)
        self._observables: dict[Monitor, Watched] = {}
        self._turning: dict[Monitor, str] = {}
        self._outputs = [name[4:] for name, kind, _ in interest.events if kind[:3] in ("min", "max")]
        for i, (name, kind, value) in enumerate(interest.events):
            if value is None:
                self._turning[Monitor("EX", i)] = name if kind == "observable" else kind
            elif kind == "observable":
                self._observables[Monitor("event", i)] = Watched(read_quantity(problem.system, name), value)
            elif kind == "freed":
                continue
            elif kind == "parameter":
                self._simple[Monitor("event", i)] = lambda point, v=value: point.parameter * interest.scale - v  # type: ignore[misc]
            else:
                side, q = kind[:3], names.index(kind[4:])
                self._surveyed[Monitor("event", i)] = lambda s, side=side, q=q, v=value: (  # type: ignore[misc]
                    float(s.lows[q] if side == "min" else s.highs[q]) - v
                )

    def like(self, other: OrbitZeroProblem, u: NDArray[np.float64]) -> None:
        """Take the sizes of determinants from other equations, and typical sizes from an orbit."""
        self._logs = dict(other._logs)
        self._adjust(u)

    def _adjust(self, u: NDArray[np.float64]) -> None:
        """Take typical sizes from an orbit."""
        problem = self.problem
        self._block, self._scale = np.empty(self.n + 1), np.empty(problem.size + self.further + 1)
        sizes = problem.common_scale, problem.state_scale, float(np.abs(u[self.n : problem.size : self.n + 1]).sum())
        problem.equations.units(*sizes, problem.segments, self._block, self._scale)
        # what is its own unit at each piece is solved for in it: rounding of its size would be all of it
        small = small_at_starts(problem, u)
        self._scale[: small.size][small] = np.abs(u[: small.size][small])

    def _sized(self, name: Monitor, sign: float, log: float, point: Point) -> float:
        """Return a determinant over its first size and over the factor of the phase condition."""
        log -= log_of_crossings(self.problem, point.u)
        value = sign * math.exp(min(log - self._logs.setdefault(name, log), 600.0))
        return value / (self.problem.facing(point.u) or math.nan)

    def depart(self, point: Point) -> None:
        """Take the point's meshes and sizes; renew the phase plane of a cycle that has turned away from it."""
        if self._retries.leave(point):
            self._adjust(point.u)
        if self._retries.rough(point) and solve_again(self, self.problem, point, point.u) is None:
            again = self.examine(point, None)
            point.examined = point.examined if again.data is None else again
            self._retries.keep(point)
        if depart(self, self.problem, point.u, point):
            data: OrbitData | None = point.examined.data
            renewed = {**point.examined.monitors, **self._measured(point), **(data.coincident if data else {})}
            point.examined = replace(point.examined, monitors=renewed)

    def _product(self, name: Monitor, point: Point, mu: float) -> float:
        """Return the product of (multiplier - `mu`) over all multipliers but the trivial one, over its first size."""
        values = nontrivial(multipliers(self.problem, point.u, self.own(point.J)), autonomous=self._autonomous)
        distance = complex(np.prod(values - mu)).real
        log = math.log(max(abs(distance), 1e-300))
        return math.copysign(math.exp(min(log - self._logs.setdefault(name, log), 600.0)), distance)

    def own(self, J: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the Jacobian of the orbit's equations, of that of all equations."""
        return J

    def evaluate(self, u: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return residual and Jacobian."""
        return self.problem.evaluate(u)

    def carried(self, u: NDArray[np.float64], J: NDArray[np.float64] | None = None) -> NDArray[np.float64] | None:
        """Return unknowns with durations up to surfaces that are met too steeply for Newton's method; None without."""
        return carried(self.problem, u, J)

    def corrected(
        self,
        guess: NDArray[np.float64],
        tangent: NDArray[np.float64],
        weights: NDArray[np.float64],
        iterations: int,
    ) -> Point | str | None:
        """Return what `correct` does, by one compiled call for each mesh; None for a stiff flow or further unknowns."""
        if self.further:
            return None
        found = corrected(self.problem, guess, weights * tangent, self._scale, iterations)
        if found is None:
            return None
        if found.told != records.CONVERGED:
            infinite = found.told == records.SINGULAR and not np.isfinite(found.J).all()
            return Unsolved.INFINITE if infinite else _UNSOLVED[found.told]
        direction = found.direction / math.sqrt(float(weights @ found.direction**2))
        numbers = found.sign, found.log, found.residual, found.iterations
        return Point(found.u, found.J, direction, weights, *numbers)

    def accurate(self, *, met: bool = True) -> bool:
        """Return whether the meshes were fine enough at the last evaluation; refine them where they were not."""
        return self.problem.refine(met=met)

    def scale(self) -> NDArray[np.float64]:
        """Return typical sizes of the unknowns."""
        return self._scale

    def metric(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return weights by the trapezoidal rule over the period; a segment of zero length contributes nothing."""
        weights = np.empty(self.problem.size + self.further + 1)
        self.problem.equations.metric(u, self.problem.segments, self.n, self._block, weights)
        return weights

    def examine(self, point: Point, before: Point | None) -> Examined:
        """Return monitors, data and fault of a point; solve it again where its mesh was too coarse."""
        problem = self.problem
        if before is not None and (fault := astray(problem, point.u)) is not None:
            return Examined({}, fault)
        sharpen(self, problem, point)
        survey, self._retries.solved = problem.survey(point.u), True
        if survey.coarse or guards.tightened(problem, survey, point.u, self.own(point.J), neutral=self.neutral):
            if (fault := solve_again(self, problem, point, point.u)) is not None:
                return Examined({}, fault)
            survey = problem.survey(point.u)
        survey = complete(problem, point.u, survey, self._outputs)
        twice = guards.goes_twice(problem, point.u, survey)
        if before is not None and (fault := guards.residual_fault(problem, survey, point.u)) is not None:
            return Examined({}, fault)
        watched = {name: watch.distance(problem, point.u) for name, watch in self._observables.items()}
        watched |= {name: slope_along(problem, point.u, point.tangent, of) for name, of in self._turning.items()}
        problem.prepare(point.u)
        problem.rescale(survey)
        self._adjust(point.u)
        values = multipliers(problem, point.u, self.own(point.J))
        told = or_unknown(problem, point.u, self.own(point.J), survey.rates[:, 0], values)
        values = values if (unknown := bool(np.isnan(told).any())) else told
        way = self._follow(point, before, values)
        followed = way.followed
        unstable = unstable_count(values[: len(followed)], neutral=self.neutral)
        data = OrbitData(survey, values, unstable, followed, twice=twice, tolerance=problem.tol)
        data = replace(data, known=told) if unknown else data
        monitors = self._measured(point)
        monitors |= watched | {name: value(survey) for name, value in self._surveyed.items()}
        monitors |= data.coincident
        still_ahead(problem, monitors, survey, before)
        if abs(values[0]) < scales.INFINITE and not self.neutral:
            monitors |= {Monitor("TR", i): height(value) for i, value in enumerate(followed) if value.imag > 0.0}
        point.weights = self.metric(point.u)
        point.tangent = point.tangent / math.sqrt(float(point.weights @ point.tangent**2))
        if before is None:
            return Examined(monitors, None, data)
        self._resting = guards.rests(problem, before, point, data, self.own)
        if self._resting:  # the sign of the fold's function is rounding
            monitors[_SN] = math.nan
        self._step, self._crossed = (before, point), None
        fault = guards.step_fault(point, before, monitors, data, None if self.neutral else way, resting=self._resting)
        if (
            fault == guards.CROSSINGS
            and (name := crossing_at_once(before.examined.data.followed, followed)) is not None
        ):
            ends = [height(at[name.segment]) for at in (before.examined.data.followed, followed)]
            before.examined = replace(before.examined, monitors={**before.examined.monitors, name: ends[0]})
            monitors[name], fault, self._crossed = ends[1], None, way.real
        known, several = before.examined.monitors, None
        if fault is None and twice > before.examined.data.twice and monitors[_BP] * known[_BP] > 0.0:
            fault = guards.HALVES
        if fault is None and not self.neutral:
            turns = (monitors.get(name, math.nan) * known.get(name, math.nan) < 0.0 for name in (_SN, _BP))
            several, data = search_between(self._spectrum, before, point, data, touches=all(turns))
            problem.set_parameters(point.u)
            fault = DOUBT if several else None
        single = [name for name in monitors if name.kind in ("PD", "BP", "TR")] if several is False else []
        if problem.signature.is_cut and not several:
            # products of distances change by powers of ten; what the multipliers do is known
            both = (*before.examined.data.followed, *followed)
            far = len(followed) > 1 or all(circle_tests([value]).far for value in both)
            single = single if not far else [name for name in monitors if name.kind in ("SN", "PD", "BP", "TR")]
        return Examined(monitors, fault, data, doubled_by(followed), frozenset(single))

    def _spectrum(self, u: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the multipliers without the trivial one at unknowns near the branch."""
        values = multipliers(self.problem, u, self.own(self.evaluate(u)[1]))
        return nontrivial(values, autonomous=self._autonomous)

    def _measured(self, point: Point) -> dict[Monitor, float]:
        """Return the monitors that need no survey; the SN monitor is 0 where the parameter rests."""
        monitors = {name: value(point) for name, value in self._simple.items()}
        if not self.problem.signature.is_cut and abs(monitors.get(_SN, 1.0)) < scales.PARAMETER_RESTS:
            monitors[_SN] = 0.0
        return monitors

    def recover(self, point: Point) -> bool:
        """Shorten the steps of a stiff flow near a point for stability; return whether they were shortened."""
        return self._retries.stabilised(point, point.u)

    def _follow(self, point: Point, before: Point | None, values: NDArray[np.complex128]) -> Passage:
        """Return how the multipliers of the point before become those of a point.

        Without a point before, the nearer end of the step examined last is taken.
        """
        own: list[complex] = nontrivial(values, autonomous=self._autonomous).tolist()
        if before is None and self._step is not None:
            first, last = self._step
            if first.arc <= point.arc <= last.arc:
                before = first if point.arc - first.arc < last.arc - point.arc else last
        data: OrbitData | None = None if before is None else before.examined.data
        if data is None or len(data.followed) != len(own):
            return Passage(tuple(own), 0, 0, True)
        return passage(data.followed, own)

    def monitor(self, name: Monitor, point: Point) -> float:
        """Return one monitor function at a point that may be corrected roughly only."""
        if bifurcates(name):
            sharpen(self, self.problem, point)
        if name in self._simple:
            return self._simple[name](point)
        if name in self._observables:
            return self._observables[name].distance(self.problem, point.u)
        if name in self._turning:
            return slope_along(self.problem, point.u, point.tangent, self._turning[name])
        if name.kind in (ZEROS, FLIPS):
            values = multipliers(self.problem, point.u, self.own(point.J))
            return height(self._follow(point, None, values).followed[name.segment])
        if name.kind == "TR":
            way = self._follow(point, None, multipliers(self.problem, point.u, self.own(point.J)))
            value = way.followed[name.segment]
            return height(value) if value.imag != 0.0 else math.nan
        if name.kind == "side":
            return side_of(self.problem, name, point.u)
        survey = self.problem.survey(point.u)
        return self._surveyed[name](complete(self.problem, point.u, survey) if name.kind == "event" else survey)

    def leading(self, names: list[Monitor]) -> list[Monitor]:
        """Return the names without those that vanish only since a neighbouring segment has no length."""
        vanishing = [name.segment for name in names if name in self._durations]
        return without_shadows(names, vanishing, len(self.problem.signature.heads))

    def sort_out(self, events: list[Event]) -> list[Event] | str:
        """Return the events without shadows of others, or the reason why the step is rejected.

        At a branch point the whole Jacobian loses rank, so an SN there is a shadow. At a grazing where the field does
        not jump, the parameter turns like the square of the vanishing duration. Every determinant then has a zero,
        which is a shadow too. docs/theory/continuation.md, "Special points", explains both.
        """
        if any(at_grazing(event.name) for event in events) and self.problem.tighten():
            return guards.ROUGH_GRAZING
        if any(event.name in self.singular for event in events) and self.problem.tighten():
            return guards.ROUGH_MEETING
        points = [event.point for event in events if event.name == _BP]
        grazings = [event.point.arc for event in events if at_grazing(event.name)]
        kept = [e for e in events if e.name != _SN or not any(self._turned_by(point, e.point.arc) for point in points)]
        kept = [e for e in kept if not bifurcates(e.name) or all(abs(e.point.arc - arc) > 1e-7 for arc in grazings)]
        kept = once([e for e in kept if not self._opposite(e)])
        for event in kept:
            self._take_limits(event)
        long = self._step is not None and self._step[1].arc - self._step[0].arc >= scales.CROWDED
        twins = [event for event in kept if event.name.kind in (ZEROS, FLIPS)]
        if self._crossed is not None:
            located = any(explains(e.name, np.array(e.point.examined.data.followed), self._crossed) for e in twins)
            return twins if located else guards.CROSSINGS
        for event in [e for e in kept if e.name.kind in ("SN", "PD", "TR")]:
            u, data = event.point.u, event.point.examined.data
            own = self.own(event.point.J)
            if data is not None and guards.unconfirmed(
                self.problem, event.name.kind, u, own, data.multipliers, self._step
            ):
                if long:
                    return f"location: the orbit at a zero of {event.name} has no multiplier that is critical"
                kept.remove(event)
        kept = kept if self._step is None else in_order(self.problem, kept, *self._step)
        first = next((e for e in kept if bifurcates(e.name) or at_grazing(e.name)), None)
        if first is None or self._step is None or not long:
            return kept
        return self._unexplained(first, *self._step) or kept

    def _turned_by(self, point: Point, arc: float) -> bool:
        """Whether the parameter turns at a branch point, as it does where the period halves.

        There the equations' errors part both zeros, since they differ between the orbit's halves.
        """
        apart, sizes = abs(point.arc - arc), scales.HALVES_AT_TURN * self.problem.state_scale
        return apart <= 1e-5 or (
            apart <= scales.FOLD_AT_HALVING and divided(self.problem, point.u, 2, sizes) is not None
        )

    def _take_limits(self, event: Event) -> None:
        """Give an event at which a segment vanishes the multipliers that the orbit has there, where it has any."""
        data = event.point.examined.data
        values = None if data is None else limits_of_multipliers(self.problem, event.name, event.point.u)
        if values is not None:
            way = self._follow(event.point, None, values)
            unstable = unstable_count(values[: len(way.followed)], neutral=self.neutral)
            data = replace(data, multipliers=values, unstable=unstable, followed=way.followed, known=None)
            event.point.examined = replace(event.point.examined, data=data)

    def _opposite(self, event: Event) -> bool:
        """Whether an event is one of a phase that differs from the wanted one by half a turn."""
        watch = self._observables.get(event.name)
        return watch is not None and watch.opposite(self.problem, event.point.u)

    def _unexplained(self, event: Event, before: Point, after: Point) -> str | None:
        """Return the reason if the first bifurcation or grazing of a step does not explain the stability of its ends.

        At the event some multipliers are critical. The others must be as stable as at the step's ends. They are not if,
        in the same step, a complex pair arises and crosses the unit circle unseen.
        """
        a, here, b = (point.examined.data for point in (before, event.point, after))
        if here is None or not a.survey.admissible:
            return event.point.examined.fault if here is None else None
        if turned(self.problem, event.name, event.point.u):
            return "not admissible: a segment touches its surface inside before it does where it starts"
        if not a.followed or self.neutral or self._resting:
            return None
        kind, followed = event.name.kind, here.followed
        critical = {i for i, value in enumerate(followed) if abs(height(value)) < scales.MULTIPLIER_CRITICAL}
        if bifurcates(event.name):
            at = -1.0 if kind == "PD" else 1.0
            away = [abs(height(value)) if kind == "TR" else abs(value - at) for value in followed]
            critical |= set(sorted(range(len(away)), key=away.__getitem__)[: 2 if kind == "TR" else 1])
        unstable = sum(abs(value) > 1.0 for i, value in enumerate(followed) if i not in critical)
        undetermined = sum(abs(value) >= scales.INFINITE for value in followed)
        ends = (a,) if at_grazing(event.name) else (a, b)
        if all(unstable - undetermined <= end.unstable <= unstable + len(critical) for end in ends):
            return None
        return "stability changes without a bifurcation that explains it"

    def crowded(self, names: list[Monitor]) -> bool:
        """Return whether more than one bifurcation or grazing lies in a step."""
        return sum(bifurcates(name) for name in names) + any(at_grazing(name) for name in names) > 1
