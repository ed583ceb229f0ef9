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
    flow = np.empty(n)
    system = problem.system
    system.compiled.call("field", int(problem._modes[0]), 0, np.ascontiguousarray(u[:n]), problem._extended, flow)
    closed = problem._kinds[0] in (PHASE_END, CLOSED_END)
    inner = _without(P, R, flow) if np.any(flow != 0.0) else (P, R)
    values = _eigenvalues(*inner)
    if flow.any() and not closed and system.phase is None:
        values = np.append(values, 1.0)
        order = np.argsort(-np.abs(values[:-1]), kind="stable")
        return np.append(values[:-1][order], 1.0)
    order = np.argsort(-np.abs(values), kind="stable")
    values = values[order]
    return np.append(values, 1.0) if system.phase is None and closed else values


def _without(
    P: NDArray[np.float64], R: NDArray[np.float64], vector: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the pencil on the quotient by an eigenvector."""
    right = _reflector(vector)
    P, R = P @ right, R @ right
    left = _reflector(R[:, 0] if np.any(R[:, 0] != 0.0) else P[:, 0])
    return (left @ P)[1:, 1:], (left @ R)[1:, 1:]


def _reflector(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    v = vector / np.linalg.norm(vector)
    v[0] += 1.0 if v[0] >= 0.0 else -1.0
    return np.eye(v.size) - 2.0 / (v @ v) * np.outer(v, v)


def _eigenvalues(P: NDArray[np.float64], R: NDArray[np.float64]) -> NDArray[np.complex128]:
    if P.shape == (0, 0):
        return np.empty(0, dtype=np.complex128)
    if P.shape == (1, 1):
        alpha, beta = P[0].astype(np.complex128), R[0]
    else:
        from scipy.linalg.lapack import dggev

        re, im, beta, _, _, _, info = dggev(P, R, compute_vl=0, compute_vr=0)
        if info != 0:
            return np.full(len(P), np.nan + 0j)
        alpha = re + 1j * im
    scale = max(float(np.abs(alpha).max()), float(np.abs(beta).max()), 1e-300)
    out = np.full(len(P), np.inf + 0j)
    finite = np.abs(beta) > 1e-15 * scale
    out[finite] = alpha[finite] / beta[finite]
    return out


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
