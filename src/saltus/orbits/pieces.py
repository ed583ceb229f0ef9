"""Orbits that are too unstable to be solved as one piece: cut, and solved again in pieces."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus.errors import ConvergenceError
from saltus.orbits.cuts import cut, stretched
from saltus.orbits.orbit import PeriodicOrbit
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.regular_ends import settle_signature
from saltus.orbits.signature import CLOSED_END, PHASE_END
from saltus.orbits.soundness import sound_orbit
from saltus.scales import EPS, SETTLED

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["flown", "in_pieces", "solved_in_pieces"]

_ITERATIONS = 40  # Newton steps, at most
_OUTGROWN = 10.0  # size of a state that Newton's steps are measured by, over the orbit's own, from which it is renewed


def in_pieces(orbit: PeriodicOrbit) -> PeriodicOrbit:
    """Return a smooth orbit cut where its sensitivities grow, solved again; the orbit itself where they do not."""
    if orbit.form.kinds[0] not in (PHASE_END, CLOSED_END):  # flights are cut as they are solved
        return orbit
    problem, u = orbit.problem(), orbit.unknowns
    J = problem.evaluate(u)[1]
    return solved_in_pieces(*cut(problem, u, J)) if stretched(problem, u, J) else orbit


def flown(problem: OrbitProblem, u: NDArray[np.float64]) -> tuple[OrbitProblem, NDArray[np.float64]] | None:
    """Return equations and unknowns of flights cut where a guess is sensitive; None where it is not."""
    if not problem.signature.flies or problem.start(u) is not None:
        return None
    form, u = settle_signature(problem, u)
    if form != problem.signature:
        problem = OrbitProblem(problem.system, form, problem.parameters_at(u), tol=problem.tol)
        if problem.start(u) is not None:
            return None
    J = problem.evaluate(u)[1]
    return cut(problem, u, J) if stretched(problem, u, J) else None


def solved_in_pieces(problem: OrbitProblem, u: NDArray[np.float64]) -> PeriodicOrbit:
    """Return the orbit in pieces near a guess, by Newton's method.

    Where the orbit turns out much smaller than the guess, steps are measured anew by its own size.

    Parameters
    ----------
    problem : OrbitProblem
        The equations of the pieces, meshes made for the guess.
    u : ndarray, shape (size,)
        The guess.

    Raises
    ------
    ConvergenceError
        The steps do not converge; what they converge to does not solve the equations.
    """
    left, spent = np.inf, 0
    while spent < _ITERATIONS:
        spent += 1
        F, J = problem.evaluate(u)
        left = float(np.abs(F).max())
        try:
            step = np.linalg.solve(J, -F)
        except np.linalg.LinAlgError:
            break
        u = u + step
        if not np.all(np.isfinite(u)):
            break
        exact = bool(np.all(np.abs(F) <= EPS * (np.abs(J) @ np.abs(u))))  # the last bits of unknowns leave as much
        if (exact or np.max(np.abs(step) / _scale(problem, u)) < SETTLED) and problem.refine():
            fresh = _renewed(problem, u)
            if fresh is None:
                return sound_orbit(problem, u, problem.evaluate(u)[1])
            problem = fresh
    raise ConvergenceError("periodic orbit in pieces", left, spent, "start from a nearer guess")


def _scale(problem: OrbitProblem, u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the sizes of the unknowns."""
    period = float(u[problem.n :: problem.n + 1].sum())
    return np.tile(np.append(problem.state_scale, period), problem.segments)


def _renewed(problem: OrbitProblem, u: NDArray[np.float64]) -> OrbitProblem | None:
    """Return the equations with meshes and sizes of the orbit `u`; None where they have these already."""
    fresh = OrbitProblem(problem.system, problem.signature, problem.parameters_at(u), tol=problem.tol)
    if fresh.start(u) is not None or np.all(problem.state_scale <= _OUTGROWN * fresh.state_scale):
        return None
    return fresh
