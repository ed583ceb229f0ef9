"""Whether an orbit is one of a family at fixed parameters, as in conservative systems."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus.errors import ConvergenceError
from saltus.orbits.signature import CLOSED_END
from saltus.orbits.stability.critical import scaling
from saltus.scales import (
    LEAST_APART,
    NEWTON_CONVERGED,
    RATE_ROUNDED,
    SENSITIVITIES,
    SINGULAR,
    UNFORCED_BESIDE,
    UNMOVED,
    followed,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.orbits.problem import OrbitProblem

__all__ = ["ISOLATED", "check_moves", "dimension_nearby", "of_a_family", "why_a_family"]

ISOLATED = "isolated periodic orbit"  # what is sought where one of a family is found

_AWAY = 1e-2  # distance between the two orbits that are compared, in units of the states
_BESIDE = 0.1  # distance from an invariant plane, in units of the states, at which states act on each other
_DAMPED = 60  # damped steps to an orbit, at most
_ITERATIONS = 10  # Newton steps to an orbit, at most


def of_a_family(problem: OrbitProblem, u: NDArray[np.float64]) -> bool:
    """Return whether the orbit near a guess has neighbours at the same parameters.

    Where the equations are singular, another orbit is sought along their null vector, a hundredth of the states' sizes
    away. The equations are forced by their left null vector. In a family this orbit needs no forcing; at a saddle-node
    the forcing grows with the square of the distance. See docs/theory/orbits.md.

    Parameters
    ----------
    problem : OrbitProblem
        The equations, without active parameters.
    u : ndarray, shape (size,)
        A guess.
    """
    if problem.start(u) is not None:
        return False
    F, J = problem.resolve(u)
    if not (np.all(np.isfinite(F)) and np.all(np.isfinite(J))):
        return False
    columns, rows = scaling(problem, J, u)
    left, values, right = np.linalg.svd(rows[:, None] * J * columns)
    if values.size < 2 or values[-1] > max(LEAST_APART * values[-2], SINGULAR * values[0]):
        return False
    z = u.copy()
    for _ in range(_ITERATIONS):
        left, values, right = np.linalg.svd(rows[:, None] * J * columns)
        closed = values[:-1] > SINGULAR * values[0]
        inverse = np.append(np.divide(1.0, values[:-1], where=closed, out=np.zeros(values.size - 1)), 0.0)
        step = -(right.T @ (inverse * (left.T @ (rows * F))))
        z = z + columns * step
        F, J = problem.resolve(z)
        if not np.all(np.isfinite(F)):
            return False
        if np.abs(step).max() < NEWTON_CONVERGED:
            break
    else:
        return False
    if np.abs(rows * F).max() > UNFORCED_BESIDE:
        return False
    left, values, right = np.linalg.svd(rows[:, None] * J * columns)
    return _forcing_beside(problem, z, columns, rows, right[-1], left[:, -1]) < UNFORCED_BESIDE


def dimension_nearby(problem: OrbitProblem, u: NDArray[np.float64]) -> int:
    """Return the dimension of the family of orbits next to a guess; 0 where an orbit is isolated, or none is found.

    The nearest orbit is found by damped least squares, which need no rank: the damping is the square of what is left.
    Along the family its equations are singular within the error of their derivatives, which is that of the flow's
    sensitivities. It follows from the tolerance and from the largest of them, and from no share of others.

    Parameters
    ----------
    problem : OrbitProblem
        The equations, without active parameters.
    u : ndarray, shape (size,)
        The guess.

    References
    ----------
    Fan and Yuan, On the quadratic convergence of the Levenberg-Marquardt method without nonsingularity assumption,
    Computing 74 (2005) 23-39.
    """
    if problem.start(u) is not None:
        return 0
    z, (F, J), error = u.copy(), problem.resolve(u), followed(problem.tol)
    columns, rows = scaling(problem, J, u)
    damped, left_over = 1.0, float(np.linalg.norm(rows * F))
    for _ in range(_DAMPED):
        if not (np.all(np.isfinite(F)) and np.all(np.isfinite(J))):
            return 0
        left, values, right = np.linalg.svd(rows[:, None] * J * columns)
        if left_over <= error:
            return int(np.sum(values <= SENSITIVITIES * error * values[0]))
        inverse = values / (values**2 + damped * left_over**2)
        trial = z - columns * (right.T @ (inverse * (left.T @ (rows * F))))
        F_new, J_new = problem.resolve(trial)
        now = float(np.linalg.norm(rows * F_new))
        if now < left_over:
            z, F, J, left_over, damped = trial, F_new, J_new, now, 0.1 * damped
        else:
            damped *= 10.0
    return 0


def check_moves(problem: OrbitProblem, u: NDArray[np.float64]) -> None:
    """Raise `ConvergenceError` where the guess of an autonomous smooth orbit is an equilibrium but for rounding."""
    if problem.signature.kinds != (CLOSED_END,):
        return
    count = problem.n
    mode, x = int(problem.modes[0]), np.ascontiguousarray(u[:count])
    rates, J = problem.system.compiled.linearised(mode, x, problem.extended)
    if np.all(np.abs(rates) <= RATE_ROUNDED * (np.abs(J) @ np.abs(x))):
        raise ConvergenceError(ISOLATED, 0.0, 0, _at_rest(problem, u))


def _at_rest(problem: OrbitProblem, u: NDArray[np.float64]) -> str:
    states = problem.system.states
    where = ", ".join(f"{name} = {value:.6g}" for name, value in zip(states, u[: len(states)].tolist(), strict=True))
    return f"{where} is an equilibrium, at rest for any period: find_equilibrium(...) describes it"


def why_a_family(problem: OrbitProblem, u: NDArray[np.float64]) -> str:
    """Return in words why orbits form a family near a guess: a rest, parts of which each has a phase, or a constant.

    Parameters
    ----------
    problem : OrbitProblem
        The equations, without active parameters.
    u : ndarray, shape (size,)
        The guess, near which `of_a_family` holds.
    """
    problem.start(u)
    survey, states = problem.survey(u), problem.system.states
    count = len(states)
    moved = (survey.highs - survey.lows)[:count]
    if problem.system.phase is None and np.all(moved <= UNMOVED * problem.state_scale[:count]):
        return _at_rest(problem, u)
    if len(parts := _parts(problem)) > 1:
        named = " and ".join("(" + ", ".join(states[i] for i in part) + ")" for part in parts)
        return f"the system falls into parts that do not act on each other, {named}: their phases are free, solve each"
    picked = "period" if problem.system.phase is None else f"max_{states[int(np.argmax(moved))]}"
    return (
        "orbits form a family there at fixed parameters, as in a conservative system: "
        f"solve_orbit(..., fix={{{picked!r}: ...}}) picks one"
    )


def _parts(problem: OrbitProblem) -> list[list[int]]:
    """Return the groups of states of an autonomous smooth orbit, last surveyed, none of which moves another."""
    system, count = problem.system, len(problem.system.states)
    if system.phase is not None or system.transitions:
        return [list(range(count))]
    acts, nodes = np.eye(count, dtype=bool), problem.dense()[2].copy()
    rests = ~np.any(nodes, axis=0)
    nodes[:, rests] = _BESIDE * problem.state_scale[rests]  # where a state is 0, others may act on it beside the orbit
    for x in nodes:
        acts |= system.compiled.linearised(int(problem.modes[0]), np.ascontiguousarray(x), problem.extended)[1] != 0.0
    acts |= acts.T
    for _ in range(count):
        acts = acts @ acts
    return [np.flatnonzero(row).tolist() for row in np.unique(acts, axis=0)[::-1]]


def _forcing_beside(
    problem: OrbitProblem,
    orbit: NDArray[np.float64],
    columns: NDArray[np.float64],
    rows: NDArray[np.float64],
    open_direction: NDArray[np.float64],
    forced: NDArray[np.float64],
) -> float:
    """Return the forcing under which there is an orbit `_AWAY` from another one along a direction, or infinity."""
    z, forcing = orbit + _AWAY * columns * open_direction, 0.0
    for _ in range(_ITERATIONS):
        F, J = problem.resolve(z)
        matrix = np.block([[rows[:, None] * J * columns, forced[:, None]], [open_direction[None, :], np.zeros((1, 1))]])
        residual = np.append(rows * F + forcing * forced, open_direction @ ((z - orbit) / columns) - _AWAY)
        if not np.all(np.isfinite(residual)):
            return np.inf
        step = np.linalg.lstsq(matrix, -residual, rcond=SINGULAR)[0]
        z, forcing = z + columns * step[:-1], forcing + float(step[-1])
        if np.abs(step).max() < NEWTON_CONVERGED:
            return max(abs(forcing), float(np.abs(residual).max()))
    return np.inf
