"""How exact an orbit is that was computed at a tolerance, and the same orbit at the finest one."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.orbits.problem import OrbitProblem
from saltus.orbits.signature import EVENT_END, MEAN_END
from saltus.scales import EPS, FINEST, SETTLED, Scales, zero

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["computed_finer", "point_errors", "solved"]

_STEPS = 8  # of Newton's method from an orbit to the one of a finer tolerance, at most


def point_errors(problem: OrbitProblem, u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the error of each state at the starts of an orbit's segments, shape (segments, n).

    Each step leaves an error of one tolerance in the equations, which their inverse carries to the unknowns: near a
    multiplier of 1 it magnifies them. The errors are infinite where the equations are singular.
    """
    n, size = problem.n, problem.size
    J = problem.evaluate(u)[1][:, :size]
    left = np.zeros((problem.segments, n + 1))
    left[:, :n] = np.diff(problem.mesh[1])[:, None] * problem.known.errors
    met = np.isin(problem.kinds, (EVENT_END, MEAN_END))
    left[met, n] = problem.tol * problem.event_sizes(u)[met]
    try:
        inverse = np.abs(np.linalg.inv(J))
    except np.linalg.LinAlgError:
        return np.full((problem.segments, n), math.inf)
    errors = (inverse @ left.ravel()).reshape(problem.segments, n + 1)[:, :n]
    return np.asarray(np.where(np.isfinite(errors), errors, math.inf))


def solved(problem: OrbitProblem, u: NDArray[np.float64]) -> bool:
    """Return whether an orbit solves equations to their tolerance; one of a looser tolerance does not."""
    F, n = problem.resolve(u)[0].reshape(problem.segments, problem.n + 1), problem.n
    # its own sizes: those of a whole branch may be larger by far
    own = np.maximum(np.abs(problem.begun.lows[:n]), np.abs(problem.begun.highs[:n]))
    errors = Scales(problem.tol, np.full(n, EPS * float(own.max())), own).errors
    return bool(zero(F[:, :n], np.diff(problem.mesh[1])[:, None] * errors))


def computed_finer(problem: OrbitProblem, u: NDArray[np.float64]) -> tuple[OrbitProblem, NDArray[np.float64]] | None:
    """Return equations and unknowns of an orbit at the finest tolerance; None where they were so, or it is not found.

    Parameters
    ----------
    problem : OrbitProblem
        The equations at a looser one, started near `u`.
    u : ndarray, shape (size + active,)
        The orbit.
    """
    if problem.tol <= FINEST:
        return None
    finer = OrbitProblem(problem.system, problem.signature, problem.parameters_at(u), tol=FINEST)
    own = u[: problem.size].copy()
    if finer.start(own) is not None:
        return None
    period = float(np.abs(own[problem.n :: problem.n + 1]).sum())
    sizes = np.tile(np.append(finer.state_scale, period), finer.segments)
    for _ in range(_STEPS):
        F, J = finer.resolve(own)
        try:
            step = np.linalg.solve(J, -F)
        except np.linalg.LinAlgError:
            return None
        own += step
        if not (length := float(np.max(np.abs(step) / sizes))) < math.inf:
            return None
        if length <= SETTLED:
            return (finer, own) if finer.start(own) is None else None
    return None
