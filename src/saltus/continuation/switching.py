"""Branches that meet at a special point, and cascades of period doublings."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from saltus import checks
from saltus.continuation.arclength import StepControl
from saltus.continuation.branch import Branch
from saltus.continuation.grazing import Neighbour, neighbour, sides_met
from saltus.continuation.monitor import Monitor
from saltus.continuation.orbit_problem import Interest, OrbitZeroProblem
from saltus.continuation.orbits import continue_orbit
from saltus.continuation.special_points import SpecialPoint
from saltus.continuation.zero_problem import correct
from saltus.errors import ConvergenceError, InputError
from saltus.orbits.critical import Branching, scaling
from saltus.orbits.normal_forms import null_vectors
from saltus.orbits.orbit import PeriodicOrbit, orbit_at
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.signature import CLOSED_END, CUT_END, DIRECTION, DURATION, MEAN_END, PHASE_END, WHOLE, Signature

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import NDArray

__all__ = ["Cascade", "follow_cascade", "switch_branch"]

_AMPLITUDES = tuple(1e-3 * 0.25**k for k in range(8))
"""Steps along the other branch, in sizes of the orbit: the first that converges is taken."""

_TOUCHING, _FEIGENBAUM = 1e-6, 4.669201609
_PERHAPS_ZERO = 1e-6
"""Value of a parameter below which it may be rounding."""
_ALIKE = 1e-9
"""Difference from 1 of the cosine between two branches that have the same direction."""


def switch_branch(point: SpecialPoint) -> PeriodicOrbit | list[PeriodicOrbit]:
    """Return an orbit of each branch that meets another one at a special point.

    Parameters
    ----------
    point : SpecialPoint
        A PD, BP or GR of a branch, or a PD or GR of a locus.

    Returns
    -------
    PeriodicOrbit or list of PeriodicOrbit
        At a PD an orbit of doubled period, at a BP one of the other branch, both a short way from the point and at a
        parameter of their own. At a GR a list: the grazing orbit in every signature that meets there, the point's own
        first. `continue_orbit` follows the branch through each.

    Raises
    ------
    InputError
        A point of another type.
    ConvergenceError
        No orbit of the other branch was found.

    References
    ----------
    Keller, in Applications of Bifurcation Theory, Academic Press 1977, 359-384 (bifurcation equation at a BP).

    Examples
    --------
    >>> from saltus import HybridSystem, Mode, Transition, continue_orbit, solve_orbit
    >>> logistic = HybridSystem(
    ...     ("x", "s"), {"r": 2.8}, {"carry": Mode({"x": "0", "s": "1"})},
    ...     [Transition("carry", "carry", "s - 1", 1, {"x": "r*x*(1 - x)", "s": "0"}, name="map")],
    ... )
    >>> orbit = solve_orbit(logistic, {}, [("carry", "map", [0.64, 0.0], 1.0)])
    >>> doubled = switch_branch(continue_orbit(orbit, "r", (2.5, 3.4))["PD1"])
    >>> len(doubled.signature), doubled.stable, doubled.parameters["r"] > 3.0
    (2, True, True)
    """
    checks.instance("point", point, SpecialPoint)
    if point.type == "GR":
        return _signatures(point.orbit)
    if point.type == "PD":
        return _doubled(point)
    if point.type == "BP":
        return _other(point)
    raise InputError("point", point.type, "of type PD, BP or GR", "no other branch meets there")


def _parameter(point: SpecialPoint) -> tuple[int, float]:
    """Return the index of the parameter along which the point was found, and a unit for it.

    That is its value, or, of one that may be zero but for rounding, what changes the equations' Jacobian by its size.
    """
    name, orbit = point.varied[-1], point.orbit
    index, value = orbit.system.parameter_names.index(name), abs(point.parameters[name])
    if value > _PERHAPS_ZERO:
        return index, value
    problem = orbit.problem(name)
    u = np.append(orbit.unknowns, point.parameters[name])
    columns, rows = scaling(problem, J := problem.resolve(u)[1], u)
    change = problem.second(u, np.append(np.zeros(problem.size), 1.0))
    sizes = [float(np.linalg.norm(rows[:, None] * part[:, : problem.size] * columns)) for part in (J, change)]
    return index, max(value, sizes[0] / sizes[1]) if sizes[1] > 0.0 else value or 1.0


def _doubled(point: SpecialPoint, level: int = 0) -> PeriodicOrbit:
    """Return the orbit of doubled period beside a period doubling; `level` doublings came before in a cascade."""
    orbit = point.orbit
    problem, u = orbit.problem(), orbit.unknowns
    q = null_vectors(problem, u, problem.resolve(u)[1], -1.0)[0].real
    form, n = orbit.form, problem.n
    if len(form) == 1 and form.kinds[0] in (PHASE_END, CLOSED_END):
        signature = Signature(form.modes, form.transitions, form.kinds, 2 * form.turns)
        start, direction = u.copy(), np.append(q[:n], 0.0)
        start[n] *= 2.0
    else:
        kinds = (CUT_END,) * len(form) if CUT_END in form.kinds else form.kinds
        signature = Signature(form.modes * 2, form.transitions * 2, form.kinds + kinds, 2 * form.turns)
        again = u.copy()
        if orbit.system.phase is not None:
            again[n - 1 :: n + 1] += 2.0 * math.pi * form.turns
        start, direction = np.concatenate([u, again]), np.concatenate([q, -q])
    index, scale = _parameter(point)
    return _step_off(orbit, signature, np.append(start, orbit_value(orbit, index) / scale), np.append(direction, 0.0),
                     index, scale, "doubled orbit", 0.5**level)  # fmt: skip


def orbit_value(orbit: PeriodicOrbit, index: int) -> float:
    """Return a parameter of an orbit by its index."""
    return orbit.parameters[orbit.system.parameter_names[index]]


def _other(point: SpecialPoint) -> PeriodicOrbit:
    orbit = point.orbit
    index, scale = _parameter(point)
    p = orbit.system.parameter_vector(orbit.parameters)
    problem = OrbitProblem(orbit.system, orbit.form, p, [index], np.array([scale]), orbit.tol)
    u = np.append(orbit.unknowns, orbit_value(orbit, index) / scale)
    problem.start(u, point.sizes)
    J = problem.resolve(u)[1]
    condition = Branching(problem, 0, u, J)
    condition.evaluate(u, np.zeros(1), J)
    first, second = condition.right
    bend = [condition.left @ problem.second(u, v) for v in (first, second)]
    a, b, c = float(bend[0] @ first), float(bend[0] @ second), float(bend[1] @ second)
    root = math.sqrt(max(b * b - a * c, 0.0))
    # a x^2 + 2 b x y + c y^2 = 0
    far = -(b + math.copysign(root, b))
    ways = [(far, a), (c, far)] if max(abs(far), abs(a), abs(c)) > 0.0 else [(1.0, 0.0), (0.0, 1.0)]
    # of a double root one of the two pairs may be zero
    directions = [x * first + y * second for x, y in ways if (x, y) != (0.0, 0.0)]
    if point.tangent is None:
        raise InputError("point", point.label, "a branch point of a branch", "one of a locus has no branch of its own")
    units = np.append(np.tile(np.append(problem.state_scale, orbit.period), problem.segments), 1.0)
    own = point.tangent / units
    own /= np.linalg.norm(own)
    likeness = [abs(float(own @ (d / units))) / float(np.linalg.norm(d / units)) for d in directions]
    if min(likeness) > 1.0 - _ALIKE:
        hint = "to second order both branches leave in the same direction"
        raise ConvergenceError("other branch", abs(root), 0, hint)
    chosen = directions[int(np.argmin(likeness))]
    return _step_off(orbit, orbit.form, u, chosen, index, scale, "other branch", sizes=point.sizes)


def _step_off(
    orbit: PeriodicOrbit,
    signature: Signature,
    u: NDArray[np.float64],
    direction: NDArray[np.float64],
    index: int,
    scale: float,
    what: str,
    size: float = 1.0,
    sizes: NDArray[np.float64] | None = None,
) -> PeriodicOrbit:
    """Return an orbit near `u`, displaced along a direction and corrected normally to it, the parameter free."""
    p = orbit.system.parameter_vector(orbit.parameters)
    reason = ""
    for amplitude in (size * step for step in _AMPLITUDES):
        problem = OrbitProblem(orbit.system, signature, p, [index], np.array([scale]), orbit.tol)
        problem.start(u, sizes)
        branch = OrbitZeroProblem(problem, u, Interest(-math.inf, math.inf, scale))
        weights = branch.metric(u)
        tangent = direction / math.sqrt(float(weights @ direction**2))
        point = correct(branch, u + amplitude * tangent, tangent, weights, 10)
        if isinstance(point, str):
            reason = point
            continue
        moved = point.u - u - amplitude * tangent
        if math.sqrt(float(weights @ moved**2)) > 0.5 * amplitude:
            reason = "it bends too sharply"
            continue
        found = orbit_at(problem, point.u, problem.evaluate(point.u)[1])
        if found.admissible or not orbit.admissible:
            return found
        reason = "; ".join(found.reasons)
    raise ConvergenceError(what, _AMPLITUDES[-1], len(_AMPLITUDES), reason)


def _signatures(orbit: PeriodicOrbit) -> list[PeriodicOrbit]:
    """Return a grazing orbit in every signature that meets there."""
    problem, u = orbit.problem(), orbit.unknowns
    found, period = [orbit], orbit.period
    survey = problem.survey(u)
    touching = [Monitor("duration", i) for i, kind in enumerate(orbit.form.kinds)
                if kind == MEAN_END and abs(orbit.durations[i]) < _TOUCHING * period]  # fmt: skip
    heights = np.ptp(np.stack([survey.lows, survey.highs]), axis=0)
    size = float(heights[: len(orbit.system.states)].max())
    touching += [
        Monitor("rate", i)
        for i, transition in enumerate(orbit.form.transitions)
        if transition >= 0 and abs(survey.rates[i, 0]) * period < _TOUCHING * size and not touching
    ]
    near = (np.abs(survey.margins) < _TOUCHING * size) & (survey.places != WHOLE)
    touching += [*(Monitor("margin", i, k) for i, k in np.argwhere(near).tolist()), *sorted(sides_met(problem, u))[:1]]
    for monitor in touching:
        beside = neighbour(problem, monitor, u)
        if isinstance(beside, Neighbour):
            p = orbit.system.parameter_vector(orbit.parameters)
            other = OrbitProblem(orbit.system, beside.signature, p, tol=orbit.tol)
            other.start(beside.u)
            again = orbit_at(other, beside.u, other.resolve(beside.u)[1])
            # where a duration or a velocity vanishes, its sign is rounding
            found.append(replace(again, faults=again.faults & ~(DURATION | DIRECTION)))
    return found


@dataclass(frozen=True, repr=False)
class Cascade:
    """Successive period doublings along a parameter.

    Attributes
    ----------
    parameter : str
        What varies.
    points : tuple of SpecialPoint
        The period doublings: of the orbit, of the doubled one, and so on.
    branches : tuple of Branch
        The branch of doubled orbits from each point to the next.
    stopped : str
        Why there are no more.
    """

    parameter: str
    points: tuple[SpecialPoint, ...]
    branches: tuple[Branch, ...]
    stopped: str

    @property
    def values(self) -> NDArray[np.float64]:
        """The parameter at each period doubling, shape (point,)."""
        return np.array([point.parameters[self.parameter] for point in self.points])

    @property
    def ratios(self) -> NDArray[np.float64]:
        """Feigenbaum ratios (v[k] - v[k - 1]) / (v[k + 1] - v[k]), shape (point - 2,); they tend to 4.669."""
        gaps = np.diff(self.values)
        return np.asarray(gaps[:-1] / gaps[1:])

    @property
    def limit(self) -> float:
        """Where the cascade accumulates, by the last gap and Feigenbaum's constant; NaN from a single point."""
        if len(self.points) < 2:
            return math.nan
        return float(self.values[-1] + (self.values[-1] - self.values[-2]) / (_FEIGENBAUM - 1.0))

    def to_dataframe(self) -> pd.DataFrame:
        """Return a table: how often the period has doubled, the parameter, the period there, the ratio."""
        import pandas as pd

        ratios = [math.nan, *self.ratios.tolist(), math.nan][: len(self.points)]
        return pd.DataFrame(
            {
                "doublings": range(len(self.points)),
                self.parameter: self.values,
                "period": [point.orbit.period for point in self.points],
                "ratio": ratios,
            }
        )

    def __repr__(self) -> str:
        lines = [f"Cascade of {len(self.points)} period doublings along {self.parameter}"]
        for k, point in enumerate(self.points):
            ratio = f", ratio {self.ratios[k - 1]:.6g}" if 0 < k < len(self.points) - 1 else ""
            lines.append(f"  period {2**k:<3d} doubles at {self.values[k]:.12g}{ratio}, T = {point.orbit.period:.6g}")
        return "\n".join([*lines, f"  ended: {self.stopped}"])


def follow_cascade(
    start: SpecialPoint,
    bounds: tuple[float, float],
    *,
    doublings: int = 4,
    steps: StepControl | None = None,
    progress: Callable[[int, float], None] | None = None,
) -> Cascade:
    """Return the cascade of period doublings that begins at one.

    Parameters
    ----------
    start : SpecialPoint
        A PD of a branch.
    bounds : (float, float)
        Interval of the parameter along which it was found.
    doublings : int
        How many branches of doubled orbits are followed, at most: 4 leads to the doubling of period 16.
    steps : StepControl, optional
        Sizes of steps along the first of them; they shrink with the cascade.
    progress : callable, optional
        Called with the count of points of a branch and the parameter after each.

    Returns
    -------
    Cascade
        Its `points` and `ratios`, however it ended: `Cascade.stopped` says why. A cascade ends at a grazing, behind
        which doublings belong to other orbits.

    Raises
    ------
    InputError
        The start is no PD of a branch, or an option cannot be used.

    References
    ----------
    Feigenbaum, J. Stat. Phys. 19 (1978) 25-52.

    Examples
    --------
    >>> from saltus import HybridSystem, Mode, Transition, continue_orbit, solve_orbit
    >>> logistic = HybridSystem(
    ...     ("x", "s"), {"r": 2.8}, {"carry": Mode({"x": "0", "s": "1"})},
    ...     [Transition("carry", "carry", "s - 1", 1, {"x": "r*x*(1 - x)", "s": "0"}, name="map")],
    ... )
    >>> orbit = solve_orbit(logistic, {}, [("carry", "map", [0.64, 0.0], 1.0)])
    >>> branch = continue_orbit(orbit, "r", (2.5, 3.4))
    >>> cascade = follow_cascade(branch["PD1"], (2.5, 4.0), doublings=2)
    >>> [f"{value:.9f}" for value in cascade.values]
    ['3.000000000', '3.449489743', '3.544090360']
    """
    checks.instance("start", start, SpecialPoint)
    if start.type != "PD" or len(start.varied) != 1:
        raise InputError("start", start.type, "a PD of a branch", "branch['PD1'] is one")
    doublings = checks.count("doublings", doublings)
    name = start.varied[0]
    control = StepControl() if steps is None else checks.instance("steps", steps, StepControl)
    points, branches = [start], []
    stopped = f"{doublings} doublings followed"
    for level in range(doublings):
        try:
            orbit = _doubled(points[-1], level)
        except ConvergenceError as error:
            stopped = str(error)
            break
        value = orbit.parameters[name]
        way = "up" if value > points[-1].parameters[name] else "down"
        branch = continue_orbit(
            orbit, name, bounds, steps=control, directions=way, stop_at="PD", at_grazing="stop", progress=progress
        )
        branches.append(branch)
        found = branch.special_points.of_type("PD")
        if not found:
            stopped = branch.stopped[-1]
            break
        points.append(found[0])
        shrunk = max(control.largest / 2.0, 10.0 * control.smallest)
        control = replace(control, initial=min(control.initial, shrunk), largest=shrunk)
    return Cascade(name, tuple(points), tuple(branches), stopped)
