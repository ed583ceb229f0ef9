"""Liouville's theorem along a curve of orbits: the product of the multipliers is known before any of them.

It is the exponential of the field's integrated divergence, times the determinants of the saltation matrices.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.errors import SaltusError
from saltus.flow.saltation import saltation_at
from saltus.orbits.observables.sampling import motion_of, steps_of
from saltus.scales import EPS, UNIT_OF_GROWTH, Verdict, value_error, zero
from saltus.system.own_states import absent_states

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.flow.stretch import Motion
    from saltus.orbits.observables.sampling import Steps
    from saltus.orbits.problem import OrbitProblem
    from saltus.system.hybrid import Transition

__all__ = ["liouville"]

_POINTS = 3  # most points of a curve that are looked at
_EACH = 200  # points of a curve for one more
_MOST = 20_000  # most places along an orbit at which the divergence is taken
_NODES = (2, 3)  # Gauss points in each step: their difference is an estimate of the error


def liouville(curve: Any, last: tuple[Any, Any] | None = None) -> tuple[list[tuple[float, str]], int]:
    """Return where the product of the multipliers is not what Liouville's theorem says, and at how many points it is.

    A product is told where the errors of its factors leave it a digit: multipliers far below the largest one have none.
    The equations of the last point are still made for it. On a short curve it is the only one, unless it tells nothing.
    """
    found: list[tuple[float, str]] = []
    if "means" not in vars(curve) or len(curve.varied) > 1:
        return found, 0
    told = _at_last(curve, *last, found) if last is not None else 0
    count = min(_POINTS, 1 + len(curve) // _EACH) - told
    for i in np.linspace(0, len(curve) - 1, count + 2)[1:-1].astype(int).tolist():
        error = _error(curve.multipliers[i], curve.tolerance)
        if not error < UNIT_OF_GROWTH:
            continue
        try:
            problem, u = curve._solved(i)
            told += _compared(curve, i, error, problem, u, found)
        except SaltusError:  # a grazing, where no saltation matrix exists
            continue
    return found, told


def _at_last(curve: Any, branch: Any, point: Any, found: list[tuple[float, str]]) -> int:
    """Return whether the product is told at the last point of a curve, by the equations as they were left; 0 or 1."""
    problem, error = branch.problem, _error(curve.multipliers[-1], curve.tolerance)
    if branch.further or not error < UNIT_OF_GROWTH or point.u.size != problem.size + 1:
        return 0
    if problem.glance(point.u).coarse:
        return 0
    try:
        return _compared(curve, len(curve) - 1, error, problem, point.u, found)
    except SaltusError:  # a grazing, where no saltation matrix exists
        return 0


def _compared(
    curve: Any, i: int, error: float, problem: OrbitProblem, u: NDArray[np.float64], found: list[tuple[float, str]]
) -> int:
    """Return whether the product is told at a point, 0 or 1; add what contradicts to `found`."""
    known = _logarithm(problem, u)
    if known is None:
        return 0
    logarithm, own = known
    values = np.abs(curve.multipliers[i])
    product = float(np.sum(np.log(values)))
    if zero(product - logarithm, error + own) is Verdict.NO:
        text = f"the multipliers' product is {math.exp(product):.6g}, by the divergence {math.exp(logarithm):.6g}"
        found.append((float(i), text))
    return 1


def _error(values: NDArray[np.complex128], tolerance: float) -> float:
    """Return the error of the logarithm of the multipliers' product; infinite where it cannot be told."""
    moduli = np.abs(values)
    if not np.all(np.isfinite(moduli)) or not moduli.size or not moduli.min() > 0.0:
        return math.inf
    return float(value_error(tolerance) * np.sum(max(1.0, float(moduli.max())) / moduli))


def _logarithm(problem: OrbitProblem, u: NDArray[np.float64]) -> tuple[float, float] | None:
    """Return the logarithm of the product by Liouville's theorem, and its error; None where it cannot be told."""
    steps = steps_of(problem)
    if len(steps.places) * sum(_NODES) > _MOST:
        return None
    total, error = _at_nodes(problem, steps, u)
    if not error < UNIT_OF_GROWTH * UNIT_OF_GROWTH:
        rough, total = _divergence(motion_of(problem, u))
        error = abs(total - rough)
    system, transitions = problem.system, problem.system.transitions
    extended = system.compiled.extended(problem.parameters_at(u))
    for index, k in enumerate(problem.signature.transitions):
        if k < 0:
            continue
        matrix = saltation_at(system, extended, k, np.ascontiguousarray(steps.ends[index]))
        if matrix.shape[0] != matrix.shape[1]:
            return None  # modes with states of their own
        determinant = abs(float(np.linalg.det(matrix)))
        if not determinant > EPS * _largest_term(problem, transitions[k], matrix):
            return None  # a motion is caught, as on a sliding surface
        total += math.log(determinant)
    return total, error


def _largest_term(problem: OrbitProblem, transition: Transition, matrix: NDArray[np.float64]) -> float:
    """Return how large a term of the determinant of a saltation matrix may be, whatever units its states have."""
    rows = columns = problem.state_scale
    if len(matrix) < rows.size:
        names, (source, target) = problem.system.mode_names, (transition.source, transition.target)
        rows, columns = (np.delete(rows, absent_states(problem.system, names.index(mode))) for mode in (target, source))
    relative = np.abs(matrix) * (columns / rows[:, None])
    return float(relative.max() ** len(matrix) * np.prod(rows / columns))


def _at_nodes(problem: OrbitProblem, steps: Steps, u: NDArray[np.float64]) -> tuple[float, float]:
    """Return the divergence integrated by trapezia between the nodes of the mesh, and what every second one changes."""
    n = problem.n
    durations = u[: problem.size].reshape(problem.segments, n + 1)[:, n]
    fine = coarse = 0.0
    for index, mode in enumerate(problem.signature.modes):
        own = steps.segments == index
        s = np.append(steps.places[own], 1.0)
        states = np.vstack([steps.starts[own], steps.ends[index][None]])
        traces = _traces(problem.system.compiled, problem.extended, mode, states)
        times = durations[index] * s * s * (3.0 - 2.0 * s)
        some = np.append(np.arange(0, s.size - 1, 2), s.size - 1)
        fine += float(np.trapezoid(traces, times))
        coarse += float(np.trapezoid(traces[some], times[some]))
    return fine, abs(fine - coarse)


def _traces(compiled: Any, p: NDArray[np.float64], mode: int, states: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the divergence of a mode's field at states, shape (place,)."""
    from saltus.equilibria.kernels.field import matrices_at

    found = np.empty((len(states), compiled.n, compiled.n))
    none = np.empty(0, np.int64), np.empty(0)
    matrices_at(compiled.addresses, mode, np.ascontiguousarray(states), p, *none, found)
    return np.asarray(np.trace(found, axis1=1, axis2=2))


@lru_cache
def _gauss(count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    return np.polynomial.legendre.leggauss(count)


def _divergence(motion: Motion) -> tuple[float, ...]:
    """Return the divergence integrated along a motion, by Gauss' rule of each number of points in each step."""
    compiled = motion.system.compiled
    p = compiled.extended(motion.system.parameter_vector(motion.parameters))
    low, high = motion.spans.T
    half, middle = 0.5 * (high - low)[:, None], 0.5 * (high + low)[:, None]
    nodes, weights = (np.concatenate([_gauss(count)[k] for count in _NODES]) for k in (0, 1))
    at = np.repeat(np.arange(len(motion.modes)), nodes.size)
    fractions = (middle + half * nodes).ravel()
    clock = motion.clocks[at]
    rates = clock[:, 1] + fractions * (2.0 * clock[:, 2] + 3.0 * fractions * clock[:, 3])
    states = np.ascontiguousarray(motion.states(at, fractions))
    traces = np.empty(len(at))
    for mode in np.unique(motion.modes).tolist():
        own = np.flatnonzero(motion.modes[at] == mode)
        traces[own] = _traces(compiled, p, mode, states[own])
    terms = (traces * rates).reshape(len(half), nodes.size) * (half * weights)
    parts = np.split(terms, np.cumsum(_NODES)[:-1], axis=1)
    return tuple(float(part.sum()) for part in parts)
