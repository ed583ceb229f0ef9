"""Liouville's theorem along a curve of orbits: the product of the multipliers is known before any of them.

It is the exponential of the field's integrated divergence, times the determinants of the saltation matrices.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.errors import SaltusError
from saltus.flow.saltation import saltation_matrix
from saltus.orbits.observables.sampling import motion_of, steps_of
from saltus.scales import EPS, Verdict, value_error, zero

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.flow.stretch import Motion
    from saltus.orbits.problem import OrbitProblem

__all__ = ["liouville"]

_POINTS = 3  # most points of a curve that are looked at
_EACH = 200  # points of a curve for one more
_MOST = 20_000  # most places along an orbit at which the divergence is taken
_TELLS = 0.1  # error of a logarithm up to which a product is told
_NODES = (2, 3)  # Gauss points in each step: their difference is an estimate of the error


def liouville(curve: Any) -> tuple[list[tuple[float, str]], int]:
    """Return where the product of the multipliers is not what Liouville's theorem says, and at how many points it is.

    A product is told where the errors of its factors leave it a digit: multipliers far below the largest one have none.
    """
    found: list[tuple[float, str]] = []
    if not hasattr(curve, "means") or len(curve.varied) > 1:
        return found, 0
    count, told = min(_POINTS, 1 + len(curve) // _EACH), 0
    for i in np.linspace(0, len(curve) - 1, count + 2)[1:-1].astype(int).tolist():
        values = curve.multipliers[i]
        error = _error(values, curve.tolerance)
        if not error < _TELLS:
            continue
        try:
            known = _logarithm(*curve._solved(i))
        except SaltusError:  # a grazing, where no saltation matrix exists
            continue
        if known is None:
            continue
        told += 1
        logarithm, own = known
        product = float(np.sum(np.log(np.abs(values))))
        if zero(product - logarithm, error + own) is Verdict.NO:
            text = f"the multipliers' product is {math.exp(product):.6g}, by the divergence {math.exp(logarithm):.6g}"
            found.append((float(i), text))
    return found, told


def _error(values: NDArray[np.complex128], tolerance: float) -> float:
    """Return the error of the logarithm of the multipliers' product; infinite where it cannot be told."""
    moduli = np.abs(values)
    if not np.all(np.isfinite(moduli)) or not moduli.size or not moduli.min() > 0.0:
        return math.inf
    return float(value_error(tolerance) * np.sum(max(1.0, float(moduli.max())) / moduli))


def _logarithm(problem: OrbitProblem, u: NDArray[np.float64]) -> tuple[float, float] | None:
    """Return the logarithm of the product by Liouville's theorem, and its error; None where it cannot be told."""
    motion = motion_of(problem, u)
    steps = len(motion.modes)
    if steps * sum(_NODES) > _MOST:
        return None
    rough, fine = (_divergence(motion, nodes) for nodes in _NODES)
    total = fine
    ends = steps_of(problem).ends
    for index, transition in enumerate(problem.signature.transitions):
        if transition < 0:
            continue
        name = motion.system.transition_names[transition]
        matrix = saltation_matrix(motion.system, motion.parameters, name, ends[index])
        if matrix.shape[0] != matrix.shape[1]:
            return None  # modes with states of their own
        determinant = abs(float(np.linalg.det(matrix)))
        if not determinant > EPS * float(np.abs(matrix).max()) ** len(matrix):
            return None  # a motion is caught, as on a sliding surface
        total += math.log(determinant)
    return total, abs(fine - rough)


@lru_cache
def _gauss(count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    return np.polynomial.legendre.leggauss(count)


def _divergence(motion: Motion, count: int) -> float:
    """Return the divergence integrated along a motion, by Gauss' rule of some points in each step."""
    from saltus.equilibria.kernels.field import matrices_at

    compiled = motion.system.compiled
    p = compiled.extended(motion.system.parameter_vector(motion.parameters))
    nodes, weights = _gauss(count)
    steps = len(motion.modes)
    low, high = motion.spans.T
    at, half = np.repeat(np.arange(steps), count), 0.5 * (high - low)
    fractions = ((0.5 * (high + low))[:, None] + half[:, None] * nodes).ravel()
    clock = motion.clocks[at]
    rates = clock[:, 1] + fractions * (2.0 * clock[:, 2] + 3.0 * fractions * clock[:, 3])
    shares = (half[:, None] * weights).ravel() * rates
    states = np.ascontiguousarray(motion.states(at, fractions))
    traces = np.empty(len(at))
    for mode in np.unique(motion.modes).tolist():
        own = np.flatnonzero(motion.modes[at] == mode)
        found = np.empty((own.size, compiled.n, compiled.n))
        matrices_at(
            compiled.addresses, mode, np.ascontiguousarray(states[own]), p, np.empty(0, np.int64), np.empty(0), found
        )
        traces[own] = np.trace(found, axis1=1, axis2=2)
    return float(shares @ traces)
