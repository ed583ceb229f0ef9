"""Floquet multipliers and test functions from the linearised segment equations."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus.orbits.problem import CLOSED_END, PHASE_END

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.orbits.problem import OrbitProblem

__all__ = ["doubling_determinant", "has_unit_pair", "multipliers", "unstable_count"]


def multipliers(problem: OrbitProblem, u: NDArray[np.float64], J: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return the Floquet multipliers of an orbit, largest modulus first.

    They are the generalised eigenvalues of P v = mu R v, in which the durations have been eliminated by reflections, not by
    dividing by normal velocities: at a grazing one is infinite and the others stay exact. The direction of the flow is
    taken out by its vector. It is no multiplier of a forced system's stroboscopic map; for an autonomous system its
    multiplier 1 is put back, last.

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
    Dankowicz and Schilder, Recipes for Continuation, SIAM 2013, ch. 9; Leine and Nijmeijer, Dynamics and Bifurcations of
    Non-Smooth Mechanical Systems, Springer 2004, ch. 7.
    """
    problem.set_parameters(u)
    n = problem.n
    P, R = np.empty((n, n)), np.empty((n, n))
    problem._kernels.pencil(J, problem._kinds, n, P, R)
    autonomous = problem.system.phase is None
    if problem._kinds[0] == PHASE_END:
        values = np.linalg.eigvals(P[:-1, :-1]).astype(np.complex128)
    else:
        flow = np.empty(n)
        mode, x = int(problem._modes[0]), np.ascontiguousarray(u[:n])
        problem.system.compiled.call("field", mode, 0, x, problem._extended, flow)
        if problem._kinds[0] == CLOSED_END:
            values = np.linalg.eigvals(_quotient(P, flow)).astype(np.complex128)
        else:
            values = _without(P, R, flow)
    values = values[np.argsort(-np.abs(values), kind="stable")]
    return np.append(values, 1.0) if autonomous else values


def _quotient(P: NDArray[np.float64], vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a matrix on the quotient by an eigenvector."""
    v = vector / np.linalg.norm(vector)
    v[0] += 1.0 if v[0] >= 0.0 else -1.0
    reflector = np.eye(v.size) - 2.0 / (v @ v) * np.outer(v, v)
    return (reflector @ P @ reflector)[1:, 1:]


def _without(
    P: NDArray[np.float64], R: NDArray[np.float64], vector: NDArray[np.float64]
) -> NDArray[np.complex128]:
    """Return the eigenvalues of a pencil but for that whose eigenvector is nearest to `vector`."""
    from scipy.linalg.lapack import dggev

    re, im, beta, _, vectors, _, info = dggev(P, R, compute_vl=0, compute_vr=1)
    n = vector.size
    if info != 0:
        return np.full(n - 1, np.nan + 0j)
    alpha = re + 1j * im
    values = np.full(n, np.inf + 0j)
    finite = np.abs(beta) > 1e-15 * max(float(np.abs(beta).max()), float(np.abs(alpha).max()), 1e-300)
    values[finite] = alpha[finite] / beta[finite]
    size = float(np.linalg.norm(vector))
    near = np.abs(vector @ vectors) / (np.sqrt(np.sum(vectors**2, axis=0)) * size) if size > 0.0 else np.ones(n)
    near[im != 0.0] = -1.0
    return np.delete(values, int(np.argmax(near)))


def doubling_determinant(problem: OrbitProblem, J: NDArray[np.float64]) -> tuple[float, float]:
    """Return sign and log of |det(A + B)|: zero where a multiplier is -1, smooth through a grazing.

    A is the derivative of all segment equations in this period's unknowns, B that of the closing ones in the next period's
    start.
    """
    n, m = problem.n, problem.size
    matrix = J[:, :m].copy()
    last = m - n - 1
    matrix[last : last + n, :n] += 2.0 * np.eye(n)
    from saltus.flow._linear_kernels import solve

    sign, log = solve(matrix, np.zeros((m, 1)))
    return float(sign), float(log)


def nontrivial(values: NDArray[np.complex128], *, autonomous: bool) -> NDArray[np.complex128]:
    """Return the multipliers without the trivial one, which `multipliers` puts last."""
    return values[:-1] if autonomous else values


def unstable_count(values: NDArray[np.complex128]) -> int:
    """Return how many of the given multipliers lie outside the unit circle."""
    return int(np.sum(np.abs(values) > 1.0))


def has_unit_pair(values: NDArray[np.complex128]) -> float:
    """Return |mu|^2 - 1 of the complex pair nearest to the unit circle; NaN where there is none."""
    pairs = values[np.isfinite(values) & (values.imag > 1e-12 * np.abs(values))]
    if not pairs.size:
        return float("nan")
    size = np.abs(pairs) ** 2 - 1.0
    return float(size[np.argmin(np.abs(size))])
