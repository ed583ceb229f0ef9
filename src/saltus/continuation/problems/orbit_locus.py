"""Critical orbits in two parameters as a zero problem: extended equations, monitor functions, checks of a step.

docs/theory/loci.md derives the equations and lists the monitor functions.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.core.monitor import Monitor, at_grazing
from saltus.continuation.core.point_types import CHANGES
from saltus.continuation.core.zero_problem import Event, Examined, Point
from saltus.continuation.problems.coefficients import known_coefficient, or_infinity, torus_at
from saltus.continuation.problems.grazing import Neighbour, neighbour, sides_met
from saltus.continuation.problems.guards import residual_fault, unconfirmed, undetermined
from saltus.continuation.problems.margins import (
    duration_of,
    grazing_monitors,
    on_border,
    run_out,
    side_of,
    still_ahead,
    timed,
    without_shadows,
)
from saltus.continuation.problems.orbit_data import LocusData
from saltus.continuation.problems.other_values import KIND, SEVERAL, multipliers_beside, without_critical
from saltus.continuation.problems.phase_plane import astray, depart, log_of_crossings, solve_again
from saltus.continuation.problems.retries import Retries
from saltus.orbits.landing.upstrokes import carried
from saltus.orbits.normal_forms import flip_coefficient
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.signature import TOUCH_END, Survey
from saltus.orbits.stability import floquet
from saltus.orbits.stability.critical import Branching, Critical, Grazing
from saltus.orbits.stability.speedless import or_unknown
from saltus.scales import INFINITE, PARAMETER_RESTS, RESONANT, ROUGHEST, SAME_POINT, TOUCHED, TOUCHING

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.algebraic.conditions import Condition

__all__ = ["LocusZeroProblem"]

_TURNS = (Monitor("TP", 0), Monitor("TP", 1))  # turning points of the two parameters
_BOUNDS = (Monitor("low", 0), Monitor("high", 0), Monitor("low", 1), Monitor("high", 1))  # ends of their intervals
_PLAIN = (*_BOUNDS, *_TURNS)  # monitor functions of every locus, at whose zeros nothing bifurcates
_OWN = ("SN", "PD", "TR", "BP", "CH")  # types of loci with special points of their own
_CP = Monitor("CP")  # coefficient of the normal form of a saddle-node
_GPD = Monitor("GPD")  # coefficient of the normal form of a period doubling
_CH = Monitor("CH")  # coefficient of the normal form of a torus bifurcation
_FF = Monitor("FF")  # determinant of the other condition of a fold-flip
_OTHERS = Monitor("others")  # determinant of a multiplier 1 on a TR locus: only a factor of CH's coefficient
_RESONANCES = {Monitor("R1"): 1.0, Monitor("R2"): -1.0, Monitor("R3"): -0.5, Monitor("R4"): 0.0}  # cosines of angles

_Special = tuple[dict[Monitor, float], LocusData | None]


class LocusZeroProblem:
    """Critical orbits of one signature as a `ZeroProblem` whose last two unknowns are the parameters.

    The unknowns of the orbit come first, then those of the condition, then the two parameters in units of `scales`. All
    loci have monitor functions of bounds, of turning points (``TP``) and of grazings. Each type has further ones, of
    its points of codimension two.

    Parameters
    ----------
    problem : OrbitProblem
        The equations with two active parameters, started.
    kind : str
        ``SN``, ``PD``, ``TR``, ``BP``, or a type at which the signature changes.
    condition : Condition
        The critical condition.
    z : ndarray, shape (size + extra + 2,)
        A critical orbit, or one near it.
    bounds : tuple of (float, float)
        Intervals of the parameters, in their units.
    """

    singular: frozenset[Monitor] = frozenset()
    odd = frozenset(_TURNS)  # monitor functions that change sign with the tangent's direction
    noise: Mapping[Monitor, float] = MappingProxyType({_GPD: 1e-8, _CH: 1e-8})
    continuous: tuple[str, ...] = (KIND,)

    def __init__(
        self,
        problem: OrbitProblem,
        kind: str,
        condition: Condition,
        z: NDArray[np.float64],
        bounds: tuple[tuple[float, float], tuple[float, float]],
    ) -> None:
        self.problem, self.kind, self.condition = problem, kind, condition
        self.n, self._bounds, self._retries = problem.n, bounds, Retries(problem)
        self._autonomous = problem.system.phase is None
        self._sizes: dict[Monitor, float] = {}
        self._step: tuple[Point, Point] | None = None
        self._type = "GR" if kind in CHANGES else kind if kind in _OWN else "value"
        self.others = multipliers_beside(self._type)
        self._surveyed = grazing_monitors(problem)
        self._durations = timed(problem.system, problem.signature)
        if isinstance(condition, Grazing):
            # what vanishes at the start vanishes all along: a symmetric orbit changes in both halves at once
            u = self.orbit(z)
            period = float(np.abs(u[self.n : problem.size : self.n + 1]).sum())
            self._touched = Monitor(condition.kind, condition.segment, condition.transition)
            own = {self._touched, *run_out(problem, u, problem.survey(u))}
            if condition.kind == "duration":
                own |= {
                    name for name, i in self._durations.items() if abs(duration_of(problem, u, i)) < TOUCHING * period
                }
                without = [name.segment for name in own if name.kind == "duration"]
                own |= set(self._surveyed).difference(without_shadows(self._surveyed, without, problem.segments))
            elif condition.kind == "side":
                own |= sides_met(problem, self.orbit(z))
            self._surveyed = {name: value for name, value in self._surveyed.items() if name not in own}
            self._durations = {name: i for name, i in self._durations.items() if name not in own}
        self._adjust(self.orbit(z))

    def orbit(self, z: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the unknowns and parameters of the orbit, shape (size + 2,)."""
        return np.concatenate([z[: self.problem.size], z[-2:]])

    def _adjust(self, u: NDArray[np.float64]) -> None:
        problem = self.problem
        period = float(np.abs(u[self.n : problem.size : self.n + 1]).sum())
        self._block = np.append(1.0 / problem.common_scale**2, 0.0)
        tail = np.ones(self.condition.extra + 2)
        self._scale = np.append(np.tile(np.append(problem.state_scale, period), problem.segments), tail)

    def carried(self, z: NDArray[np.float64], J: NDArray[np.float64] | None = None) -> NDArray[np.float64] | None:
        """Return unknowns with durations up to surfaces that are met too steeply for Newton's method; None without."""
        u = carried(self.problem, self.orbit(z), J)
        return None if u is None else np.concatenate([u[: self.problem.size], z[self.problem.size :]])

    def evaluate(self, z: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return residual and Jacobian of orbit and condition."""
        problem, condition = self.problem, self.condition
        size, extra = problem.size, condition.extra
        u = self.orbit(z)
        F, J = problem.evaluate(u)
        self._J = J
        out, matrix = np.empty(size + condition.rows), np.zeros((size + condition.rows, size + extra + 2))
        out[:size], matrix[:size, :size], matrix[:size, -2:] = F, J[:, :size], J[:, size:]
        if not (np.all(np.isfinite(F)) and np.all(np.isfinite(J))):
            return np.full_like(out, np.nan), np.full_like(matrix, np.nan)
        if isinstance(condition, Branching):
            out[:size] += z[size] * condition.forcing
            matrix[:size, size] = condition.forcing
        try:
            values, gradient, further = condition.evaluate(u, z[size : size + extra], J)
        except np.linalg.LinAlgError:  # two loci meet there
            return np.full_like(out, np.nan), np.full_like(matrix, np.nan)
        out[size:], matrix[size:, :size], matrix[size:, -2:] = values, gradient[:, :size], gradient[:, size:]
        matrix[size:, size : size + extra] = further
        return out, matrix

    def accurate(self, *, met: bool = True) -> bool:
        """Return whether the meshes were fine enough at the last evaluation; refine them where they were not."""
        return self.problem.refine(met=met)

    def scale(self) -> NDArray[np.float64]:
        """Return typical sizes of the unknowns."""
        return self._scale

    def metric(self, z: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the orbit's weights, and 1 for each parameter and further unknown."""
        weights = np.empty(z.size)
        self.problem.equations.metric(z, self.problem.segments, self.n, self._block, weights)
        return weights

    def examine(self, point: Point, before: Point | None) -> Examined:
        """Return monitors, data and fault of a point; solve it again where its mesh was too coarse."""
        problem = self.problem
        if isinstance(self.condition, Grazing) and self.condition.kind == "duration":
            point.u[self.condition.place] = 0.0
        u = self.orbit(point.u)
        survey = problem.survey(u)
        if survey.coarse:
            if (fault := solve_again(self, problem, point, u)) is not None:
                return Examined({}, fault)
            u = self.orbit(point.u)
            survey = problem.survey(u)
        if before is not None:
            forced = isinstance(self.condition, Branching)  # its forcing is left as the residual
            if doubt := astray(problem, u) or (None if forced else residual_fault(problem, survey, u)):
                return Examined({}, doubt)
        survey = on_border(problem, self.condition, u, survey) if isinstance(self.condition, Grazing) else survey
        # the multipliers next to a grazing vary so fast that the last Newton step shows in them
        self._J = problem.evaluate(u)[1]
        problem.prepare(u)
        problem.rescale(survey)
        self._adjust(u)
        self.condition.adjust()
        monitors = {name: self._measure(name, point) for name in (*_PLAIN, *self._durations)}
        monitors |= {name: math.nan for name in _TURNS if abs(monitors[name]) < PARAMETER_RESTS}
        monitors |= {name: value(survey) for name, value in self._surveyed.items()}
        still_ahead(problem, monitors, survey, before)
        if self.kind in CHANGES:  # an orbit that repeats a shorter one touches in each repetition, all along the locus
            touched = TOUCHED * float(max(problem.event_sizes(u).max(), problem.state_scale[: len(survey.x0)].min()))
            for name, value in monitors.items():
                if name.kind == "margin" and abs(value) < touched:
                    monitors[name] = math.nan
        special, data = self._special(point, survey)
        assert data is not None
        others = self.others.measured(data.others, before, known=special)
        monitors |= special | others
        if before is not None and before.examined.data is not None:
            data = replace(data, behind=(point.arc - before.arc, before.examined.data.others))
        point.weights = self.metric(point.u)
        point.tangent = point.tangent / math.sqrt(float(point.weights @ point.tangent**2))
        fault = None
        if before is not None:
            self._step = (before, replace(point, examined=Examined(monitors, None, data)))
            known = before.examined.monitors
            grazing = any(
                at_grazing(name) and math.isfinite(known.get(name, math.nan) + value) and known[name] * value <= 0.0
                for name, value in monitors.items()
            )
            fault = None if grazing else self._lost_motion()
            if not (grazing or fault) and self.others.overlooked(before, point, data.others, self._values_beside):
                fault = SEVERAL
            problem.set_parameters(u)
        grazed = self.condition
        if isinstance(grazed, Grazing) and grazed.left(survey):
            fault = "the orbit does not lie on the surface as a whole any more"
        return Examined(monitors, fault, data, once=frozenset(others))

    def _values_beside(self, z: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the multipliers that are not critical at unknowns near the locus."""
        u = self.orbit(z)
        return self._beside(z, floquet.multipliers(self.problem, u, self.problem.evaluate(u)[1]))

    def _beside(self, z: NDArray[np.float64], values: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Return the multipliers that are not critical."""
        inner = floquet.nontrivial(values, autonomous=self._autonomous)
        return without_critical(self._type, inner, float(z[self.problem.size]))

    def depart(self, point: Point) -> None:
        """Take the point's meshes and sizes; renew the phase plane of a cycle that has turned away from it."""
        if self._retries.leave(point):
            self._adjust(self.orbit(point.u))
        if depart(self, self.problem, self.orbit(point.u), point, getattr(self.condition, "turn", None)):
            self.condition.adjust()
            monitors = point.examined.monitors
            turns = (name for name in _TURNS if not math.isnan(monitors.get(name, math.nan)))
            measured = {name: self._measure(name, point) for name in turns}
            point.examined = replace(point.examined, monitors={**monitors, **measured})

    def recover(self, point: Point) -> bool:
        """Shorten the steps of a stiff flow near a point for stability; return whether they were shortened."""
        return self._retries.stabilised(point, self.orbit(point.u))

    def monitor(self, name: Monitor, point: Point) -> float:
        """Return one monitor function at a point that may be corrected roughly only."""
        if name.kind == "side":
            return side_of(self.problem, name, self.orbit(point.u))
        if name in self._surveyed:
            return float(self._surveyed[name](self.problem.survey(self.orbit(point.u))))
        if name in _PLAIN or name in self._durations:
            return self._measure(name, point)
        if self.others.tells(name):
            values = floquet.multipliers(self.problem, self.orbit(point.u), self._J)
            return self.others.named(self._beside(point.u, values)).get(name, math.nan)
        return self._special(point, None, name)[0].get(name, math.nan)

    def _measure(self, name: Monitor, point: Point) -> float:
        kind, at = name.kind, name.segment
        if kind == "duration":
            return duration_of(self.problem, point.u, at)
        if kind == "TP":
            return float(point.tangent[at - 2])
        distance = float(point.u[at - 2]) - self._bounds[at][kind == "high"]
        return distance if abs(distance) > 1e-12 else 0.0

    def _sized(self, name: Monitor, value: float) -> float:
        """Return a value over its size at the first call for that monitor function."""
        return value / self._sizes.setdefault(name, abs(value) or 1.0)

    def _special(self, point: Point, survey: Survey | None, only: Monitor | None = None) -> _Special:
        """Return the monitors of codimension-two points and the data of a point.

        With `only`, monitors that are not asked for may be left out. Without a survey there are no data.
        """
        return getattr(self, f"_at_{self._type}")(point, survey, only)  # type: ignore[no-any-return]

    def _data(
        self, survey: Survey | None, z: NDArray[np.float64], angle: float, coefficient: float,
        values: NDArray[np.complex128] | None = None,
    ) -> LocusData | None:  # fmt: skip
        if survey is None:
            return None
        values = floquet.multipliers(self.problem, self.orbit(z), self._J) if values is None else values
        inner = floquet.nontrivial(values, autonomous=self._autonomous)
        unstable = floquet.unstable_count(inner[np.abs(np.abs(inner) - 1.0) > 1e-6])
        others = self._beside(z, values)
        values = or_unknown(self.problem, self.orbit(z), self._J, survey.rates[:, 0], values)
        return LocusData(survey, values, unstable, others, angle, coefficient)

    def _determinant(
        self, name: Monitor, mu: float, problem: OrbitProblem, u: NDArray[np.float64], J: NDArray[np.float64]
    ) -> float:
        """Return det(A - mu B), mu = 1 or -1, over its first size and the factor of the phase condition."""
        if mu < 0.0:
            sign, log = floquet.doubling_determinant(problem, J)
        else:
            sign, log = (float(part) for part in np.linalg.slogdet(J[:, : problem.size]))
        log -= log_of_crossings(problem, u)
        value = sign * math.exp(min(log - self._sizes.setdefault(name, log), 600.0))
        return value / (problem.facing(u) or math.nan)

    def _at_SN(self, point: Point, survey: Survey | None, only: Monitor | None) -> _Special:
        condition = self.condition
        assert isinstance(condition, Critical)
        u = self.orbit(point.u)
        coefficient = self._sized(_CP, condition.curvature)
        found = {
            _CP: coefficient,
            Monitor("R1"): condition.twist,
            _FF: self._determinant(_FF, -1.0, self.problem, u, self._J),
        }
        return found, self._data(survey, point.u, 0.0, coefficient)

    def _at_PD(self, point: Point, survey: Survey | None, only: Monitor | None) -> _Special:
        condition = self.condition
        assert isinstance(condition, Critical)
        u = self.orbit(point.u)
        found = {Monitor("R2"): condition.twist, _FF: self._determinant(_FF, 1.0, self.problem, u, self._J)}
        coefficient = math.nan
        if only in (None, _GPD):
            # the coefficient has a pole where another multiplier is 1; the determinant has a zero there
            problem, J = self._graded(u, only)
            value = or_infinity(flip_coefficient, problem, u, J, condition.right, condition.left)
            coefficient = self._sized(_GPD, value * found[_FF])
            found[_GPD] = known_coefficient(coefficient, only)
        return found, self._data(survey, point.u, math.pi, coefficient)

    def _at_TR(self, point: Point, survey: Survey | None, only: Monitor | None) -> _Special:
        u = self.orbit(point.u)
        kappa = float(point.u[self.problem.size])
        found = {name: kappa - value for name, value in _RESONANCES.items()} | {_CH: math.nan}
        coefficient = math.nan
        resonant = min(abs(kappa - value) for name, value in _RESONANCES.items() if name.kind != "R4") < RESONANT
        if abs(kappa) < 1.0 and only in (None, _CH) and not resonant:
            # the coefficient has a pole where another multiplier is 1; the factor `others` has a zero there
            others = self._determinant(_OTHERS, 1.0, self.problem, u, self._J) / (2.0 - 2.0 * kappa)
            value = or_infinity(torus_at, *self._graded(u, only), u, kappa)
            coefficient = self._sized(_CH, value * others)
            found[_CH] = known_coefficient(coefficient, only)
        return found, self._data(survey, point.u, math.acos(min(1.0, max(-1.0, kappa))), coefficient)

    def _graded(self, u: NDArray[np.float64], only: Monitor | None) -> tuple[OrbitProblem, NDArray[np.float64]]:
        """Return equations and Jacobian for third derivatives.

        They are rough along the locus, and fine while the zero `only` of a coefficient is located.
        """
        if only is not None:
            return self.problem, self._J
        fine = self.problem
        rough = OrbitProblem(
            fine.system, fine.signature, fine.parameters_at(u), fine.active, fine.scales, max(fine.tol, ROUGHEST)
        )
        rough.start(u)
        return rough, rough.resolve(u)[1]

    def _at_value(self, point: Point, survey: Survey | None, only: Monitor | None) -> _Special:
        u, signs = self.orbit(point.u), {Monitor("SN"): 1.0, Monitor("PD"): -1.0}
        found = {name: self._determinant(name, mu, self.problem, u, self._J) for name, mu in signs.items()}
        return found, self._data(survey, point.u, math.nan, math.nan)

    def _at_BP(self, point: Point, survey: Survey | None, only: Monitor | None) -> _Special:
        return {Monitor("unfolded"): float(point.u[self.problem.size])}, self._data(survey, point.u, math.nan, math.nan)

    def _at_GR(self, point: Point, survey: Survey | None, only: Monitor | None) -> _Special:
        u, condition = self.orbit(point.u), self.condition
        assert isinstance(condition, Grazing)
        found = {}
        known = not undetermined(self.problem, u, self._J) if only is None else only.side == "larger"
        if TOUCH_END not in self.problem.signature.kinds and known:
            found = self._critical_beside("larger", self.problem, u, self._J)[0]
        values = np.full(len(self.problem.system.states), math.inf + 0j)
        beside = neighbour(self.problem, self._touched, u) if only is None or not found else None
        if isinstance(beside, Neighbour):
            p, active, scales = self.problem.parameters_at(u), self.problem.active, self.problem.scales
            problem = OrbitProblem(self.problem.system, beside.signature, p, active, scales, self.problem.tol)
            problem.start(beside.u)
            more, values = self._critical_beside("smaller", problem, beside.u, problem.resolve(beside.u)[1])
            found |= more
        return found, self._data(survey, point.u, math.nan, math.nan, values)

    def _critical_beside(
        self, side: str, problem: OrbitProblem, u: NDArray[np.float64], J: NDArray[np.float64]
    ) -> tuple[dict[Monitor, float], NDArray[np.complex128]]:
        """Return test functions and multipliers of the orbit in the signature on one side of a grazing."""
        values = floquet.multipliers(problem, u, J)
        finite = [v for v in floquet.nontrivial(values, autonomous=self._autonomous).tolist() if abs(v) < INFINITE]
        fold, flip, torus = (Monitor(kind, side=side) for kind in ("SN", "PD", "TR"))
        found = {
            fold: self._determinant(fold, 1.0, problem, u, J),
            flip: self._determinant(flip, -1.0, problem, u, J),
            torus: floquet.distance_from_circle(np.array(finite, dtype=np.complex128)),
        }
        return found, values

    def leading(self, names: list[Monitor]) -> list[Monitor]:
        """Return the names without those that vanish only since a neighbouring segment has no length."""
        names = self.others.leading(names)
        vanishing = [name.segment for name in names if name.kind == "duration"]
        return without_shadows(names, vanishing, self.problem.segments)

    def sort_out(self, events: list[Event]) -> list[Event] | str:
        """Return the events without shadows of grazings, or the reason why the last step is rejected."""
        grazings = [event.point.arc for event in events if at_grazing(event.name)]
        if not grazings and (fault := self._lost_motion()) is not None:
            return fault
        return [
            e
            for e in self.others.typed(events)
            if at_grazing(e.name)
            or e.name in _PLAIN
            or (all(abs(e.point.arc - arc) > SAME_POINT for arc in grazings) and not self._unconfirmed(e))
        ]

    def _unconfirmed(self, event: Event) -> bool:
        """Return whether an event is an FF whose second multiplier is not critical within its error."""
        data = event.point.examined.data
        if event.name != _FF or data is None:
            return False
        other, u = "PD" if self.kind == "SN" else "SN", self.orbit(event.point.u)
        return unconfirmed(self.problem, other, u, self.problem.evaluate(u)[1], data.multipliers)

    def _lost_motion(self) -> str | None:
        """Return the reason if the step examined last leads from a motion of the system to none."""
        if self._step is None:
            return None
        old, new = (point.examined.data.survey for point in self._step)
        return "not admissible: " + "; ".join(new.reasons()) if old.admissible and not new.admissible else None

    def crowded(self, names: list[Monitor]) -> bool:
        """Return whether more than one codimension-two point or grazing lies in a step; False on a GR locus."""
        ours = [name for name in names if name not in _PLAIN and not at_grazing(name)]
        kinds = {name.kind for name in ours}
        return len(kinds) + any(at_grazing(name) for name in names) > 1 and self.kind not in CHANGES
