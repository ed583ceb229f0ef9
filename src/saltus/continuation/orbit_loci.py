"""One call of `continue_locus` from an orbit: critical orbits along two parameters."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.continuation.arclength import follow
from saltus.continuation.closure import alongside, passes
from saltus.continuation.grazing import Neighbour, neighbour, touching
from saltus.continuation.locating import events_between
from saltus.continuation.locus import Locus
from saltus.continuation.locus_problem import LocusZeroProblem
from saltus.continuation.monitor import Monitor, at_grazing
from saltus.continuation.run import TwoParameterRun
from saltus.continuation.special_points import SpecialPoint
from saltus.continuation.two_sided import SAME, Found, OneSide, join, traced, turned
from saltus.continuation.zero_problem import Event, Point, start_point
from saltus.errors import InputError
from saltus.orbits.critical import TOUCHING, Branching, Condition, Critical, Grazing, TorusCondition, vanishing_segment
from saltus.orbits.orbit import PeriodicOrbit, orbit_at
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.signature import DIRECTION, DURATION, WHOLE, Signature

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["OrbitLocusRun"]

# Special points at which a TR locus ends, and why.
_ENDS = {
    "R1": "beyond it the two multipliers are real, of product 1",
    "R2": "beyond it the two multipliers are real, of product 1",
}

_CRITICAL = 1e-3  # distance of a start from its critical condition up to which a locus starts there
_MOVED = 1e-3  # change, over the unknowns' sizes, by which the first point of a locus may differ from the start
_REGULAR = 1e-11  # least singular value of the extended equations, over the largest, of a regular start
_UNFOLDED = 1e-7  # forcing from which on the branch points of a BP locus do not persist


class OrbitLocusRun(TwoParameterRun):
    """One call of `continue_locus` from an orbit: start, options and equations, which both directions share."""

    odd = LocusZeroProblem.odd
    branch: LocusZeroProblem

    def __init__(self, start: SpecialPoint | PeriodicOrbit, orbit: PeriodicOrbit, *options: Any) -> None:
        super().__init__(*options)
        self.start, self.orbit = start, orbit

    def locus(self, order: tuple[str, ...], directions: str) -> Locus:
        """Return the locus, its parameters in the order that the user gave."""
        origin = self.begin(self.names.index(order[1]))
        with self.reporter:
            halves = traced(lambda sign: self.trace(origin, sign), directions)
        joined = self.with_start(join((self.branch, origin), halves, "locus"), self._at_start(origin))
        return Locus(
            system=self.orbit.system,
            parameters=dict(self.orbit.parameters),
            tolerance=self.orbit.tolerance,
            angle=np.array([point.examined.data.angle for _, point in joined.rows]),
            **self.fields(joined, order, self.locus_options(directions)),
            **joined.fields(),
        )

    def _problem(self, signature: Signature, unknowns: NDArray[np.float64]) -> tuple[OrbitProblem, NDArray[np.float64]]:
        """Return the equations of a signature with the two parameters active, meshes made, and all unknowns."""
        system = self.orbit.system
        p = system.parameter_vector(self.orbit.parameters)
        active = [system.parameter_names.index(name) for name in self.names]
        values = self.start_values(p[active])
        problem = OrbitProblem(system, signature, p, active, self.scales, self.orbit.tolerance)
        u = np.append(unknowns, values)
        problem.start(u, self.start.sizes if isinstance(self.start, SpecialPoint) else None)
        return problem, u

    def begin(self, towards: int) -> Point:
        """Return the first point, its tangent towards growing values of the parameter number `towards`."""
        condition: Condition
        if self.kind == "GR":
            problem, u, vanishing = self._grazing()
            condition, extra = vanishing, np.empty(0)
        else:
            problem, u = self._problem(self.orbit.form, self.orbit.unknowns)
            condition, extra = self._condition(problem, u)
        z = np.concatenate([u[: problem.size], extra, u[-2:]])
        self.branch = LocusZeroProblem(problem, self.kind, condition, z, self.bounds)
        values = np.linalg.svd(self.branch.evaluate(z)[1] * self.branch.scale(), compute_uv=False)
        if values[-1] < _REGULAR * values[0]:
            reason = "the extended equations have more than one solution direction there"
            if isinstance(self.start, SpecialPoint) and self.start.type == "CP":
                reason = "these do not unfold the cusp"
            raise self.irregular(reason)
        try:
            point = start_point(self.branch, z)
        except (ValueError, np.linalg.LinAlgError) as error:
            raise self.irregular(str(error)) from None
        sizes = np.maximum(self.branch.scale(), float(problem.state_scale.max()) * _MOVED)
        moved = float(np.max(np.abs(point.u - z) / sizes))
        if moved > _MOVED:
            raise InputError(
                "start", f"{moved:.2g} away", f"a located {self.kind}", "the nearest one lies that far from the orbit"
            )
        point.examined = self.branch.examine(point, None)
        return turned(point, float(point.tangent[towards - 2]), self.odd)

    def _condition(self, problem: OrbitProblem, u: NDArray[np.float64]) -> tuple[Condition, NDArray[np.float64]]:
        """Return the condition of an SN, PD, TR or BP, and a guess of its further unknowns."""
        J = problem.resolve(u)[1]
        if self.kind == "BP":
            branching = Branching(problem, self._branching_parameter(), u, J)
            if not branching.distance(J) < _CRITICAL:
                wanted = "an orbit at which branches meet"
                raise InputError("start", f"{branching.distance(J):.2g} from a loss of rank", wanted)
            return branching, np.zeros(1)
        autonomous = self.orbit.system.phase is None
        values = (self.orbit.multipliers[:-1] if autonomous else self.orbit.multipliers).tolist()
        if self.kind == "TR":
            pairs = [v for v in values if v.imag >= 0.0 and math.isfinite(abs(v))]
            distances = [self._from_resonance(v, values) for v in pairs]
            self._check_critical(min(distances, default=math.inf), "a pair of multipliers on the unit circle")
            mu = pairs[int(np.argmin(distances))]
            kappa = mu.real / abs(mu) if mu.imag > 0.0 else math.copysign(1.0, mu.real)
            return TorusCondition(problem, kappa, u, J), np.array([kappa])
        mu = 1.0 if self.kind == "SN" else -1.0
        condition = Critical(problem, mu, u, J)
        distance = min((abs(v - mu) for v in values), default=math.inf)
        on_grazing = isinstance(self.start, SpecialPoint) and self.start.locus == "GR"
        if on_grazing or not np.all(np.isfinite(values)):  # multipliers belong to another signature
            distance = condition.distance(J)
        self._check_critical(distance, f"a multiplier {mu:g}")
        return condition, np.empty(0)

    @staticmethod
    def _from_resonance(value: complex, values: list[complex]) -> float:
        """Return the distance of a multiplier from the unit circle, of a real one plus that from the nearest other."""
        if value.imag > 0.0:
            return abs(abs(value) - 1.0)
        others = list(values)
        others.remove(value)
        return abs(abs(value) - 1.0) + min((abs(other - value) for other in others), default=math.inf)

    def _check_critical(self, distance: float, wanted: str) -> None:
        if not distance < _CRITICAL:
            found = ", ".join(f"{v:.6g}" for v in self.orbit.multipliers.tolist())
            raise InputError("start", f"multipliers {found}", f"an orbit with {wanted}, as every {self.kind} has")

    def _branching_parameter(self) -> int:
        varied = self.start.varied if isinstance(self.start, SpecialPoint) else (self.names[0],)
        known = [name for name in varied if name in self.names]
        if not known:
            wanted = f"a pair with {varied[0]!r}, along which the branch point was found"
            raise InputError("parameters", self.names, wanted)
        return self.names.index(known[0])

    def _grazing(self) -> tuple[OrbitProblem, NDArray[np.float64], Grazing]:
        """Return the grazing orbit in the larger signature, its unknowns, and the condition that vanishes."""
        problem, u = self._problem(self.orbit.form, self.orbit.unknowns)
        found = vanishing_segment(problem, u, problem.survey(u))
        if found is None:
            survey = problem.survey(u)
            heights = np.abs(survey.margins)
            i, k = np.unravel_index(int(np.argmin(heights)), heights.shape) if heights.size else (0, 0)
            sizes = np.array([problem.event_size(int(j), u[: problem.n]) for j in range(heights.shape[1])])
            if not heights.size or not heights[i, k] < TOUCHING * sizes[k]:
                least = float(heights.min()) if heights.size else math.inf
                raise InputError(
                    "start", f"{least:.3g} from the nearest surface", "an orbit that grazes one", "a GR does"
                )
            if survey.places[i, k] == WHOLE:
                return problem, u, Grazing(problem, "side", int(i), int(k))
            larger = neighbour(problem, Monitor("margin", int(i), int(k)), u)
            if not isinstance(larger, Neighbour):
                larger = touching(problem, u, int(i), int(k))
            problem, u = self._problem(larger.signature, larger.u[:-2])
            found = vanishing_segment(problem, u, problem.survey(u))
            if found is None:
                raise self.irregular("the touching motion cannot be cut at its surface")
        return problem, u, Grazing(problem, *found)

    def restarted(self, origin: Point) -> Point:
        """See `TwoParameterRun.restarted`: meshes and null vectors' signs are those of the other direction's end."""
        branch, start = self.branch, replace(origin, u=origin.u.copy(), tangent=origin.tangent.copy())
        branch.problem.start(branch.orbit(start.u))
        branch.evaluate(start.u)
        start.examined = branch.examine(start, None)
        return start

    def followed(self, half: OneSide, point: Point, origin: Point) -> str:
        """See `TwoParameterRun.followed`."""
        last = point
        for item in follow(self.branch, point, self.control, log=self.log):
            if isinstance(item, str):
                return f"{self.place(last)}: {item}"
            if isinstance(item, Event):
                end = self._event(half, item)
                if end is not None:
                    half.points.append((self.branch, item.point))
                    return f"{self.place(item.point)}: {end}"
                continue
            if self.kind == "BP" and abs(float(item.u[self.branch.problem.size])) > _UNFOLDED:
                return f"{self.place(last)}: the branch point does not persist: the parameters unfold it"
            if last.arc > 0.0 and passes(self.branch, self.branch.problem, origin, last, item, self.control):
                self._close(half, last, point)
                return "the locus is closed"
            if (end := self.keep(half, self.branch, item)) is not None:
                return end
            last = item
        raise AssertionError("follow ends with a reason")

    def _close(self, half: OneSide, last: Point, start: Point) -> None:
        """End a closed locus at its start; special points of the last step beyond the start are dropped."""
        half.specials = [found for found in half.specials if found.after < len(half.points)]
        half.closed = True
        again = replace(start, u=alongside(self.branch.problem, start.u, last.u), tangent=start.tangent.copy())
        again.arc = last.arc + math.sqrt(float(last.weights @ (again.u - last.u) ** 2))
        again.J = self.branch.evaluate(again.u)[1]
        again.examined = self.branch.examine(again, last)
        found = events_between(self.branch, last, again)
        for event in [] if isinstance(found, str) else found:
            self._event(half, event)
        half.points.append((self.branch, again))

    def _event(self, half: OneSide, event: Event) -> str | None:
        """Keep a special point; return the reason why the locus ends there, or None."""
        kind, at = event.name.kind, event.name.segment
        if kind in ("low", "high"):
            return self.bound_met(event.point, at, kind)
        of = ""
        on_grazing = isinstance(self.start, SpecialPoint) and self.start.locus == "GR"
        if on_grazing and event.point.arc < SAME and kind != "TP" and not at_grazing(event.name):
            return None  # at a start on a grazing every determinant vanishes
        if kind == "TP":
            of = self.names[at]
        elif at_grazing(event.name):
            kind = "GR"
        elif kind == "unfolded":
            return None
        elif event.name.side:
            of = f"{event.name.side} signature"
        if kind == "GR":  # where a duration or a velocity vanishes, its sign is rounding
            if event.name.kind == "duration":
                event.point.u[at * (self.branch.n + 1) + self.branch.n] = 0.0
            data = event.point.examined.data
            survey = replace(data.survey, faults=data.survey.faults & ~(DURATION | DIRECTION))
            event.point.examined = replace(event.point.examined, data=replace(data, survey=survey))
        orbit = self._orbit(event.point)
        half.specials.append(Found(kind, orbit, event.value, len(half.points), event.point.arc, of))
        if kind == "GR":
            return "grazing: orbits beyond it are of another signature"
        if self.kind == "TR" and kind in _ENDS:
            return f"{kind}: {_ENDS[kind]}"
        return kind if kind in self.stops else None

    def _orbit(self, point: Point) -> PeriodicOrbit:
        branch, data = self.branch, point.examined.data
        return orbit_at(branch.problem, branch.orbit(point.u), point.J, data.survey, data.multipliers)

    def _at_start(self, origin: Point) -> Found | None:
        """Return the start as a special point of the locus, if it is one."""
        start, monitors = self.start, origin.examined.monitors
        if not isinstance(start, SpecialPoint) or (monitor := Monitor(start.type)) not in monitors:
            return None
        return Found(start.type, self._orbit(origin), monitors[monitor], 0, 0.0, start.of)
