"""Orbits of one signature as a zero problem with a parameter: metric, monitor functions, what may follow what."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.arclength import Event, Examined, Point, correct
from saltus.orbits.floquet import distance_from_circle, doubling_determinant, multipliers, nontrivial, unstable_count
from saltus.orbits.problem import MEAN_END, OrbitProblem, Survey

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["BIFURCATIONS", "Interest", "OrbitBranch", "OrbitData", "at_grazing"]

BIFURCATIONS = ("SN", "PD", "TR", "BP", "GR")


@dataclass(frozen=True)
class Interest:
    """What is looked for along a branch.

    Attributes
    ----------
    low, high : float
        Bounds of the parameter, in units of `scale`.
    scale : float
        Unit of the parameter among the unknowns.
    events : tuple of (name, kind, value)
        Users' events; `kind` is ``parameter``, or ``min_`` or ``max_`` and a state or output.
    """

    low: float
    high: float
    scale: float
    events: tuple[tuple[str, str, float], ...] = ()


@dataclass(frozen=True)
class OrbitData:
    """What a point of a branch keeps: its survey, its multipliers, how many of them are unstable."""

    survey: Survey
    multipliers: NDArray[np.complex128]
    unstable: int


class OrbitBranch:
    """Orbits of one signature as a `ZeroProblem`.

    Monitor functions are the bounds (``low``, ``high``), the bifurcations (``SN``, ``PD``, ``TR``, ``BP``), what
    vanishes at a grazing (``margin i k``: segment i's distance from the surface of transition k; ``duration i`` of a
    segment that starts on its own event; ``rate i``: the normal velocity at segment i's end), and users' events
    (``event i``).

    Parameters
    ----------
    problem : OrbitProblem
        The equations, started.
    u : ndarray, shape (size + 1,)
        An orbit.
    interest : Interest
        What is looked for.
    """

    singular = frozenset({"BP"})

    def __init__(self, problem: OrbitProblem, u: NDArray[np.float64], interest: Interest) -> None:
        self.problem = problem
        self.interest = interest
        self.n = problem.n
        self._autonomous = problem.system.phase is None
        self._logs: dict[str, float] = {}
        self._adjust(u)
        signature, transitions = problem.signature, problem.system.transitions
        self._durations = {f"duration {i}": i for i, kind in enumerate(signature.kinds) if kind == MEAN_END}
        self._simple: dict[str, Callable[[Point], float]] = {
            "low": lambda point: _beyond(point.parameter - interest.low),
            "high": lambda point: _beyond(point.parameter - interest.high),
            "SN": lambda point: float(point.tangent[-1]),
            "PD": lambda point: self._sized("PD", *doubling_determinant(problem, point.J)),
            "BP": lambda point: self._sized("BP", point.sign, point.log),
        }
        for name, i in self._durations.items():
            self._simple[name] = lambda point, at=i * (self.n + 1) + self.n: float(point.u[at])  # type: ignore[misc]
        self._surveyed: dict[str, Callable[[Survey], float]] = {}
        for i, (mode, end) in enumerate(zip(signature.modes, signature.transitions, strict=True)):
            for k, transition in enumerate(transitions):
                if transition.source == problem.system.mode_names[mode]:
                    self._surveyed[f"margin {i} {k}"] = lambda s, i=i, k=k: float(s.margins[i, k])  # type: ignore[misc]
            if end >= 0:
                way = float(transitions[end].direction or -1)
                self._surveyed[f"rate {i}"] = lambda s, i=i, way=way: way * float(s.rates[i, 0])  # type: ignore[misc]
        names = (*problem.system.all_states, *problem.system.output_names)
        for i, (_, kind, value) in enumerate(interest.events):
            if kind == "parameter":
                self._simple[f"event {i}"] = lambda point, v=value: point.parameter * interest.scale - v  # type: ignore[misc]
            else:
                side, q = kind[:3], names.index(kind[4:])
                self._surveyed[f"event {i}"] = lambda s, side=side, q=q, v=value: (  # type: ignore[misc]
                    float(s.lows[q] if side == "min" else s.highs[q]) - v
                )

    def _adjust(self, u: NDArray[np.float64]) -> None:
        """Take typical sizes from an orbit."""
        problem = self.problem
        period = float(np.abs(u[self.n : problem.size : self.n + 1]).sum())
        self._block = np.append(1.0 / problem.state_scale**2, 0.0)
        self._scale = np.append(np.tile(np.append(problem.state_scale, period), problem.segments), 1.0)

    def _sized(self, name: str, sign: float, log: float) -> float:
        """Return a determinant over the size that it had first."""
        return sign * math.exp(min(log - self._logs.setdefault(name, log), 600.0))

    def evaluate(self, u: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return residual and Jacobian."""
        return self.problem.evaluate(u)

    def accurate(self) -> bool:
        """Return whether the meshes were fine enough at the last evaluation; refine them where they were not."""
        return self.problem.refine()

    def scale(self) -> NDArray[np.float64]:
        """Return typical sizes of the unknowns."""
        return self._scale

    def metric(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return weights by the trapezoidal rule over the period, so that a segment of zero length changes nothing."""
        problem = self.problem
        weights = np.empty(problem.size + 1)
        problem.kernels.metric(u, problem.segments, self.n, self._block, weights)
        return weights

    def examine(self, point: Point, before: Point | None) -> Examined:
        """Return monitors, data and fault of a point; solve it again where its mesh passed over something."""
        problem = self.problem
        survey = problem.survey(point.u)
        if survey.coarse:
            problem.start(point.u)
            better = correct(self, point.u, point.tangent, point.weights, 7)
            if isinstance(better, str):
                return Examined({}, better)
            point.u, point.J, point.tangent = better.u, better.J, better.tangent
            point.sign, point.log, point.residual = better.sign, better.log, better.residual
            survey = problem.survey(point.u)
        problem.prepare()
        problem.rescale(survey)
        self._adjust(point.u)
        values = multipliers(problem, point.u, point.J)
        data = OrbitData(survey, values, unstable_count(nontrivial(values, autonomous=self._autonomous)))
        monitors = {name: value(point) for name, value in self._simple.items()}
        monitors |= {name: value(survey) for name, value in self._surveyed.items()}
        monitors["TR"] = distance_from_circle(values)
        point.weights = self.metric(point.u)
        point.tangent = point.tangent / math.sqrt(float(point.weights @ point.tangent**2))
        return Examined(monitors, None if before is None else _fault(point, before, monitors, data), data)

    def monitor(self, name: str, point: Point) -> float:
        """Return one monitor function at a point that need not be quite corrected."""
        if name in self._simple:
            return self._simple[name](point)
        if name == "TR":
            return distance_from_circle(multipliers(self.problem, point.u, point.J))
        return self._surveyed[name](self.problem.survey(point.u))

    def leading(self, names: list[str]) -> list[str]:
        """Return the names without the velocities that vanish because a segment beside them does."""
        count = self.problem.segments
        vanishing = {self._durations[name] for name in names if name in self._durations}
        shadowed = {f"rate {i}" for j in vanishing for i in (j, (j - 1) % count)}
        return [name for name in names if name not in shadowed]

    def sort_out(self, events: list[Event]) -> list[Event]:
        """Return the events without shadows.

        Where the whole Jacobian loses rank there is a branch point, no fold; at a grazing without a jump of the field
        the parameter turns like the square of the vanishing duration, and with it every determinant has a zero.
        """
        points = [event.point.arc for event in events if event.name == "BP"]
        grazings = [event.point.arc for event in events if at_grazing(event.name)]
        kept = [e for e in events if e.name != "SN" or all(abs(e.point.arc - arc) > 1e-5 for arc in points)]
        return [e for e in kept if e.name not in BIFURCATIONS or all(abs(e.point.arc - arc) > 1e-7 for arc in grazings)]

    def crowded(self, names: list[str]) -> bool:
        """Return whether more than one bifurcation or grazing lies in a step."""
        return sum(name in BIFURCATIONS for name in names) + any(at_grazing(name) for name in names) > 1


def at_grazing(name: str) -> bool:
    """Return whether a monitor function vanishes at grazings; it is positive on the admissible side."""
    return name.startswith(("margin", "duration", "rate"))


def _beyond(distance: float) -> float:
    """Distance from a bound, zero where it is rounding."""
    return distance if abs(distance) > 1e-12 else 0.0


def _fault(point: Point, before: Point, monitors: Mapping[str, float], data: OrbitData) -> str | None:
    """Return why a point may not follow the one before, if it may not."""
    old: OrbitData = before.examined.data
    changed = {
        name
        for name, value in monitors.items()
        if math.isfinite(value)
        and math.isfinite(a := before.examined.monitors.get(name, math.nan))
        and (a < 0.0) != (value < 0.0)
    }
    grazing = any(at_grazing(name) for name in changed)
    if old.survey.admissible and not data.survey.admissible and not grazing:
        return "not admissible: " + "; ".join(data.survey.reasons())
    if point.arc - before.arc > 1e-4 and not grazing and old.survey.admissible:
        explained = sum(1 for name in changed if name in ("SN", "PD", "BP")) + 2 * ("TR" in changed)
        if abs(data.unstable - old.unstable) > explained or (data.unstable - old.unstable - explained) % 2:
            return "stability changes without a bifurcation that explains it"
    return None
