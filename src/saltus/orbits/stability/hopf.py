"""The Hopf point to which a cycle of an autonomous mode shrinks."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from saltus.scales import NEWTON_AT_ROUNDING, SINGULAR_AT_ROUNDING, UPRIGHT

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.orbits.problem import OrbitProblem

__all__ = ["HopfPoint", "solve_hopf"]

_ITERATIONS = 25  # Newton steps, at most
_DIFFERENCE = 1e-6  # step of the differences for Newton's matrix, over the unknowns' sizes


@dataclass(frozen=True, eq=False)
class HopfPoint:
    """An equilibrium with a pair of eigenvalues on the imaginary axis."""

    state: NDArray[np.float64]  # shape (states,): the equilibrium
    parameter: float  # the active parameter, in its unit
    eigenvalues: NDArray[np.complex128]  # shape (states less conserved,): the pair first

    @property
    def period(self) -> float:
        """Period of the cycles that leave the equilibrium there, as their size tends to 0."""
        return 2.0 * math.pi / abs(float(self.eigenvalues[0].imag))

    @property
    def multipliers(self) -> NDArray[np.complex128]:
        """Floquet multipliers of the equilibrium as a cycle: those of the pair are 1, the trivial one is last."""
        others = np.exp(self.eigenvalues[2:] * self.period)
        inner = np.append(others, 1.0)
        return np.append(inner[np.argsort(-np.abs(inner), kind="stable")], 1.0)


def solve_hopf(
    problem: OrbitProblem, state: NDArray[np.float64], parameter: float, frequency: float, reach: float
) -> HopfPoint | None:
    """Return the Hopf point near a guess, by Newton's method on f = 0 and Re lambda = 0; None where there is none.

    An equilibrium far outside the cycle is not the one to which the cycle shrinks. Fields may overflow there.

    Parameters
    ----------
    problem : OrbitProblem
        The equations of a cycle nearby, with one active parameter; the mode is that of its first segment.
    state : ndarray, shape (states,)
        Guess of the equilibrium.
    parameter : float
        Guess of the active parameter, in its unit.
    frequency : float
        Guess of the pair's imaginary part, in radians per unit of time.
    reach : float
        Distance from `state`, over the states' sizes, beyond which the search ends.
    """
    n = problem.n
    sizes = np.append(problem.state_scale, 1.0)
    y = np.append(state, parameter) / sizes

    def conditions(y: NDArray[np.float64]) -> NDArray[np.float64]:
        field, eigenvalues = _linearised(problem, sizes * y, frequency)
        return np.append(field / problem.state_scale, eigenvalues[0].real) / frequency

    for _ in range(_ITERATIONS):
        F = conditions(y)
        if not np.all(np.isfinite(F)):
            return None
        J = np.empty((n + 1, n + 1))
        for k in range(n + 1):
            h = np.zeros(n + 1)
            h[k] = _DIFFERENCE * max(1.0, abs(float(y[k])))
            J[:, k] = (conditions(y + h) - conditions(y - h)) / (2.0 * h[k])
        try:
            step = np.linalg.solve(J, -F)
        except np.linalg.LinAlgError:
            return None
        y = y + step
        if not np.max(np.abs((sizes * y)[:n] - state) / problem.state_scale) < reach:
            return None
        if np.max(np.abs(step)) < NEWTON_AT_ROUNDING * max(1.0, float(np.abs(y).max())):
            eigenvalues = _linearised(problem, sizes * y, frequency)[1]
            if not abs(eigenvalues[0].imag) > 0.0:
                return None
            return HopfPoint((sizes * y)[:n], float(y[n]), eigenvalues)
    return None


def solve_centre(problem: OrbitProblem, state: NDArray[np.float64], frequency: float) -> HopfPoint | None:
    """Return the centre near a guess at the parameters of `problem`, by Newton's method; None where there is none.

    Parameters
    ----------
    problem : OrbitProblem
        The equations of a cycle nearby; the mode is that of its first segment.
    state : ndarray, shape (states,)
        Guess of the equilibrium.
    frequency : float
        Guess of the pair's imaginary part, in radians per unit of time.
    """
    x, scale, mode = state.copy(), problem.state_scale, int(problem.modes[0])
    for _ in range(_ITERATIONS):
        field, jacobian = problem.system.compiled.linearised(mode, x, problem.extended)
        if not (np.all(np.isfinite(jacobian)) and np.all(np.isfinite(field))):
            return None
        p = problem.extended[: problem.p.size]
        inner = problem.conserving.within(p, scale, jacobian)
        field, jacobian = problem.conserving.returning(x, p, frequency, field, jacobian)
        step = np.linalg.lstsq(jacobian * scale / scale[:, None], -field / scale, rcond=SINGULAR_AT_ROUNDING)[0]
        x = x + scale * step
        if np.max(np.abs(step)) < NEWTON_AT_ROUNDING:
            values = _nearest_first(np.linalg.eigvals(inner).astype(np.complex128), frequency)
            centre = abs(values[0].imag) > 0.0 and abs(values[0].real) < UPRIGHT * abs(values[0].imag)
            return HopfPoint(x, 0.0, values) if centre else None
    return None


def _linearised(
    problem: OrbitProblem, point: NDArray[np.float64], frequency: float
) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
    """Return the field and the eigenvalues of its Jacobian, those nearest to +-i `frequency` first."""
    n = problem.n
    u = np.zeros(problem.size + 1)
    u[:n], u[-1] = point[:n], point[n]
    problem.set_parameters(u)
    field, jacobian = problem.system.compiled.linearised(int(problem.modes[0]), point[:n], problem.extended)
    if not np.all(np.isfinite(jacobian)):
        return np.full(n, np.nan), np.full(n, np.nan + 0j)
    kept, p = problem.conserving, problem.extended[: problem.p.size]
    inner = kept.within(p, problem.state_scale, jacobian)
    field = kept.returning(point[:n], p, frequency, field, jacobian)[0]
    return field, _nearest_first(np.linalg.eigvals(inner).astype(np.complex128), frequency)


def _nearest_first(values: NDArray[np.complex128], frequency: float) -> NDArray[np.complex128]:
    """Return eigenvalues, those nearest to +-i `frequency` first."""
    order = np.argsort(np.abs(values - 1j * frequency), kind="stable")
    above = values[order[0]]
    others = np.delete(values, order[0])
    twin = int(np.argmin(np.abs(others - above.conjugate()))) if others.size else 0
    rest = np.delete(others, twin)
    return np.concatenate([[above], others[twin : twin + 1], rest])
