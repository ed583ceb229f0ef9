"""Floquet multipliers and test functions from the linearised segment equations."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.orbits.problem import CLOSED_END, PHASE_END

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.orbits.problem import OrbitProblem

__all__ = ["distance_from_circle", "doubling_determinant", "multipliers", "nontrivial", "unstable_count"]


def multipliers(problem: OrbitProblem, u: NDArray[np.float64], J: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return the Floquet multipliers of an orbit, largest modulus first.

    They are the generalised eigenvalues of P v = mu R v, in which the durations have been eliminated by reflections,
    not by dividing by normal velocities, so they can be followed through a grazing. There one is infinite (in floating
    point: beyond 1e10), and the others are not determined. The direction of the flow is taken out by its vector. It is
    no multiplier of a forced system's stroboscopic map; for an autonomous system its multiplier 1 is put back, last.

    Parameters
    ----------
    problem : OrbitProblem
        The equations.
    u : ndarray, shape (size + active,)
        The orbit.
    J : ndarray, shape (size, size) or wider
        Jacobian there.

    Returns
    -------
    ndarray of complex, shape (states,)

    References
    ----------
    Dankowicz and Schilder, Recipes for Continuation, SIAM 2013, ch. 9; Leine and Nijmeijer, Dynamics and Bifurcations
    of Non-Smooth Mechanical Systems, Springer 2004, ch. 7.
    """
    problem.set_parameters(u)
    n = problem.n
    P, R = np.empty((n, n)), np.empty((n, n))
    closing, autonomous = problem.kinds[0], problem.system.phase is None
    flow = np.zeros(n)
    if autonomous or closing != PHASE_END:
        mode, x = int(problem.modes[0]), np.ascontiguousarray(u[:n])
        problem.system.compiled.call("field", mode, 0, x, problem.extended, flow)
    flow /= problem.state_scale
    period = float(np.abs(u[n : problem.size : n + 1]).sum())
    problem.kernels.pencil(J, problem.kinds, n, flow, problem.state_scale, period, P, R)
    if closing == PHASE_END:
        values = np.linalg.eigvals(P[:-1, :-1]).astype(np.complex128)
    elif closing == CLOSED_END:
        values = np.linalg.eigvals(_quotient(P, flow)).astype(np.complex128)
    elif n == 3:
        values = np.empty(2, dtype=np.complex128)
        problem.kernels.pair(P, R, 1, values)
    else:
        values = _eigenvalues(P[1:, 1:], R[1:, 1:])
    if n > 3 or closing in (PHASE_END, CLOSED_END):
        values = values[np.argsort(-np.abs(values), kind="stable")]
    return np.append(values, 1.0) if autonomous else values


def _quotient(P: NDArray[np.float64], vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a matrix on the quotient by an eigenvector."""
    v = vector / np.linalg.norm(vector)
    v[0] += 1.0 if v[0] >= 0.0 else -1.0
    reflector = np.eye(v.size) - 2.0 / (v @ v) * np.outer(v, v)
    return np.asarray((reflector @ P @ reflector)[1:, 1:])


def _eigenvalues(P: NDArray[np.float64], R: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return the generalised eigenvalues of a pencil, infinite ones as inf."""
    from scipy.linalg.lapack import dggev

    re, im, beta, _, _, _, info = dggev(P, R, compute_vl=0, compute_vr=0)
    if info != 0:
        return np.full(len(P), np.nan + 0j)
    alpha = re + 1j * im
    values = np.full(len(P), np.inf + 0j)
    finite = np.abs(beta) > 1e-15 * max(float(np.abs(beta).max(initial=0.0)), float(np.abs(alpha).max(initial=0.0)))
    values[finite] = alpha[finite] / beta[finite]
    return values


def doubling_determinant(problem: OrbitProblem, J: NDArray[np.float64]) -> tuple[float, float]:
    """Return sign and log of |det(A + B)|: zero where a multiplier is -1, smooth through a grazing.

    A is the derivative of all segment equations in this period's unknowns, B that of the closing ones in the next
    period's start.
    """
    sign, log = problem.kernels.doubling(J, problem.n)
    return float(sign), float(log)


def nontrivial(values: NDArray[np.complex128], *, autonomous: bool) -> NDArray[np.complex128]:
    """Return the multipliers without the trivial one, which `multipliers` puts last."""
    return values[:-1] if autonomous else values


def unstable_count(values: NDArray[np.complex128]) -> int:
    """Return how many of the given multipliers lie outside the unit circle."""
    return sum(1 for value in values.tolist() if abs(value) > 1.0)


def distance_from_circle(values: NDArray[np.complex128]) -> float:
    """Return |mu|^2 - 1 of the complex pair nearest to the unit circle; NaN where there is none."""
    nearest = math.nan
    for value in values.tolist():
        if value.imag > 1e-12 * abs(value) and math.isfinite(value.real):
            size = abs(value) ** 2 - 1.0
            if not abs(size) >= abs(nearest):
                nearest = size
    return nearest
