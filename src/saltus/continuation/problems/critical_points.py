"""Critical orbits, equilibria and map orbits with active parameters: equations, and the condition that holds there.

docs/theory/loci.md, docs/theory/equilibria.md and docs/theory/map_orbits.md derive the conditions.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial, singledispatch
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.algebraic.conditions import Singular, Vanishing
from saltus.continuation.core.monitor import Monitor
from saltus.continuation.core.point_types import CHANGES, POINT_TYPES
from saltus.continuation.problems.grazing import Neighbour, neighbour, touching
from saltus.continuation.problems.margins import run_out
from saltus.equilibria import Equilibrium
from saltus.equilibria.critical import Hopf
from saltus.equilibria.pseudo import beside_two_fold
from saltus.errors import InputError
from saltus.maps import MapOrbit
from saltus.maps.critical import Rotation
from saltus.orbits.cuts import whole
from saltus.orbits.observables.keeping import Keeping
from saltus.orbits.observables.quantities import read_quantity
from saltus.orbits.orbit import PeriodicOrbit
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.signature import WHOLE, Signature
from saltus.orbits.stability.critical import Branching, Critical, Grazing, TorusCondition, vanishing_segment
from saltus.scales import AT_CRITICAL, TOUCHING
from saltus.system.evaluate import evaluate

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.algebraic.conditions import Condition
    from saltus.solution import Solution

__all__ = ["CriticalOrbit", "critical_condition"]

_DIFFERENCE = 1e-5  # change of an unknown, over its size, in differences of an output


@dataclass(frozen=True, eq=False)
class CriticalOrbit:
    """A critical orbit with some parameters active."""

    # ``SN``, ``PD``, ``TR``, ``BP``, a type at which the signature changes, or a quantity that keeps its value
    kind: str
    orbit: PeriodicOrbit
    names: tuple[str, ...]  # the active parameters, in the system's order
    # scales, values: shape (active,): their units, and their values in these
    scales: NDArray[np.float64]
    values: NDArray[np.float64]
    # sizes of the states on the orbits nearby, where the orbit itself may be at rest
    sizes: NDArray[np.float64] | None = None
    varied: tuple[str, ...] = ()  # of a branch point the parameter along which branches meet
    on_grazing: bool = False  # whether multipliers may belong to another signature

    def extended(self) -> tuple[OrbitProblem, NDArray[np.float64], Condition, NDArray[np.float64]]:
        """Return equations and unknowns, the condition, and a guess of its further unknowns.

        Raises
        ------
        InputError
            The orbit is not critical.
        """
        if self.kind in CHANGES:
            problem, u, condition = self._grazing()
            return problem, u, condition, np.empty(0)
        problem, u = self.problem(self.orbit.form, self.orbit.unknowns)
        if self.kind not in POINT_TYPES:
            quantity = read_quantity(self.orbit.system, self.kind)
            return problem, u, Keeping(problem, quantity, quantity.value(problem, u)), np.empty(0)
        return problem, u, *self._condition(problem, u)

    def problem(self, signature: Signature, unknowns: NDArray[np.float64]) -> tuple[OrbitProblem, NDArray[np.float64]]:
        """Return the equations of a signature with the two parameters active, meshes made, and all unknowns."""
        system = self.orbit.system
        p = system.parameter_vector(self.orbit.parameters)
        active = [system.parameter_names.index(name) for name in self.names]
        problem = OrbitProblem(system, signature, p, active, self.scales, self.orbit.tolerance)
        u = np.append(unknowns, self.values)
        problem.start(u, self.sizes)
        return problem, u

    def _condition(self, problem: OrbitProblem, u: NDArray[np.float64]) -> tuple[Condition, NDArray[np.float64]]:
        """Return the condition of an SN, PD, TR or BP, and a guess of its further unknowns."""
        J = problem.resolve(u)[1]
        if self.kind == "BP":
            branching = Branching(problem, self._branching_parameter(), u, J)
            if not branching.distance(J) < AT_CRITICAL:
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
        if self.on_grazing or not np.all(np.isfinite(values)):  # multipliers belong to another signature
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
        if not distance < AT_CRITICAL:
            found = ", ".join(f"{v:.6g}" for v in self.orbit.multipliers.tolist())
            raise InputError("start", f"multipliers {found}", f"an orbit with {wanted}, as every {self.kind} has")

    def _branching_parameter(self) -> int:
        known = [name for name in self.varied if name in self.names]
        if not known:
            wanted = f"a pair with {self.varied[0]!r}, along which the branch point was found"
            raise InputError("parameters", self.names, wanted)
        return self.names.index(known[0])

    def _grazing(self) -> tuple[OrbitProblem, NDArray[np.float64], Grazing]:
        """Return the grazing orbit in the larger signature, its unknowns, and the condition that vanishes."""
        problem, u = self.problem(self.orbit.form, self.orbit.unknowns)
        if problem.signature.flies:
            problem, u = whole(problem, u)
        survey = problem.survey(u)
        found = vanishing_segment(problem, u, survey)
        if found is None and (out := run_out(problem, u, survey)):
            larger = neighbour(problem, out[0], u)
            if not isinstance(larger, Neighbour) or len(larger.signature) <= problem.segments:
                return problem, u, Grazing(problem, out[0].kind, out[0].segment, out[0].transition)
            problem, u = self.problem(larger.signature, larger.u[: -len(self.names)])
            found = vanishing_segment(problem, u, problem.survey(u))
        if found is None:
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
            if not isinstance(larger, Neighbour) or self.kind == "AS":
                larger = touching(problem, u, int(i), int(k))
            problem, u = self.problem(larger.signature, larger.u[: -len(self.names)])
            found = vanishing_segment(problem, u, problem.survey(u))
            if found is None:
                raise InputError("start", "a touching motion", "one that can be cut at its surface")
        return problem, u, Grazing(problem, *found)


def _keeping(problem: Any, mode: int, u: NDArray[np.float64], name: str) -> Vanishing:
    """Return the condition that a state or an output keeps its value, which it has at the first point of `u`."""
    system, count = problem.system, len(problem.system.states)

    def value(v: NDArray[np.float64]) -> float:
        parameters = dict(zip(system.parameter_names, problem.parameters_at(v).tolist(), strict=True))
        return float(evaluate(system, name, v[None, :count], mode, parameters)[0])

    goal = value(u)
    unit = abs(goal) or 1.0

    def function(v: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        gradient = np.zeros(v.size)
        if name in system.states:
            gradient[system.states.index(name)] = 1.0
        else:
            for k in (*range(count), *range(problem.n, v.size)):
                step = np.zeros(v.size)
                step[k] = _DIFFERENCE * max(abs(float(v[k])), 1e-3 if k >= problem.n else 0.0) or _DIFFERENCE
                gradient[k] = (value(v + step) - value(v - step)) / (2.0 * step[k])
        return (value(v) - goal) / unit, gradient / unit

    return Vanishing(function, name)


@singledispatch
def critical_condition(
    solution: Solution, kind: str, problem: Any, u: NDArray[np.float64], sizes: NDArray[np.float64]
) -> tuple[Condition, NDArray[np.float64]]:
    """Return the condition at which a solution of algebraic equations is critical, and a guess of its further unknowns.

    Parameters
    ----------
    solution : Solution
        The critical solution; each kind registers the conditions of its types. Of another kind it is a saddle-node.
    kind : str
        The type.
    problem : AlgebraicProblem
        Its equations, some parameters active.
    u : ndarray, shape (n + active,)
        Its unknowns.
    sizes : ndarray, shape (n,)
        Typical sizes of the unknowns.

    Raises
    ------
    InputError
        The solution is not critical.
    """
    return Singular(problem, u, sizes), np.empty(0)


@critical_condition.register(Equilibrium)
def _(
    solution: Equilibrium, kind: str, problem: Any, u: NDArray[np.float64], sizes: NDArray[np.float64]
) -> tuple[Condition, NDArray[np.float64]]:
    if kind not in POINT_TYPES:
        return _keeping(problem, problem.mode, u, kind), np.empty(0)
    values, beside = solution.eigenvalues, beside_two_fold(problem, u, sizes)
    A = problem.evaluate(u if beside is None else beside)[1][:, : problem.n]
    top = max(float(np.linalg.norm(A * sizes / sizes[:, None], 2)), 1e-300)
    if kind == "SN":
        distance = float(np.abs(values).min()) / top if problem.n > 1 else 0.0
        _check_critical(kind, solution, distance, "an eigenvalue 0")
        return Singular(problem, u, sizes), np.empty(0)
    if kind == "HB":
        pairs = values[values.imag > 0.0]
        small = np.sort(np.abs(values))[:2]
        if small.size > 1 and small[1] < AT_CRITICAL * top:  # a double zero, as at a BT
            pair, distance = 0j, float(small[1]) / top
        else:
            distances = np.abs(pairs.real) / top
            distance = float(distances.min(initial=math.inf))
            pair = complex(pairs[np.argmin(distances)]) if pairs.size else 0j
        _check_critical(kind, solution, distance, "an imaginary pair of eigenvalues")
        condition = Hopf(problem, u, sizes, pair)
        return condition, condition.guess
    heights = {}
    for k in problem.ways_out:
        height, gradient = problem.event(k, u)
        heights[k] = abs(height) / (float(np.abs(gradient[: problem.n]) @ sizes) or 1.0)
    nearest = min(heights, key=heights.__getitem__, default=None)
    if nearest is None or not heights[nearest] < AT_CRITICAL:
        least = math.inf if nearest is None else heights[nearest]
        raise InputError("start", f"{least:.3g} from the nearest surface", "an equilibrium on one", "a BE lies there")
    return Vanishing(partial(problem.event, nearest), nearest), np.empty(0)


def _check_critical(kind: str, solution: Equilibrium, distance: float, wanted: str) -> None:
    if not distance < AT_CRITICAL:
        found = ", ".join(f"{v:.6g}" for v in solution.eigenvalues.tolist())
        raise InputError("start", f"eigenvalues {found}", f"an equilibrium with {wanted}, as every {kind} has")


@critical_condition.register(MapOrbit)
def _(
    solution: MapOrbit, kind: str, problem: Any, u: NDArray[np.float64], sizes: NDArray[np.float64]
) -> tuple[Condition, NDArray[np.float64]]:
    if kind not in POINT_TYPES:
        return _keeping(problem, problem.itinerary[0], u, kind), np.empty(0)
    values = solution.multipliers
    if kind == "SN":
        _check_multipliers(kind, solution, float(np.abs(values - 1.0).min()), "a multiplier 1")
        return Singular(problem, u, sizes), np.empty(0)
    if kind == "PD":
        _check_multipliers(kind, solution, float(np.abs(values + 1.0).min()), "a multiplier -1")
        return Singular(problem, u, sizes, 2.0 * problem.closing), np.empty(0)
    if kind == "TR":
        pairs = values[values.imag > 0.0]
        distances = np.abs(np.abs(pairs) - 1.0)
        _check_multipliers(kind, solution, float(distances.min(initial=math.inf)), "a complex pair on the unit circle")
        pair = complex(pairs[np.argmin(distances)])
        condition = Rotation(problem, u, sizes, pair.real / abs(pair))
        return condition, condition.guess
    heights = {
        (i, guard): abs(height) / (float(np.abs(problem.border(i, guard, u)[1][: problem.n]) @ sizes) or 1.0)
        for i, guard, height in problem.heights(u)
    }
    nearest = min(heights, key=heights.__getitem__, default=None)
    if nearest is None:
        raise InputError("type", "BC", "a locus of a map in pieces", "a smooth map has no borders")
    if not heights[nearest] < AT_CRITICAL:
        least = f"{heights[nearest]:.3g} from the nearest border"
        raise InputError("start", least, "an orbit with a point on one", "a BC lies there")
    return Vanishing(partial(problem.border, *nearest), nearest), np.empty(0)


def _check_multipliers(kind: str, solution: MapOrbit, distance: float, wanted: str) -> None:
    if not distance < AT_CRITICAL:
        found = ", ".join(f"{v:.6g}" for v in solution.multipliers.tolist())
        raise InputError("start", f"multipliers {found}", f"an orbit with {wanted}, as every {kind} has")
