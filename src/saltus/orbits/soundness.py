"""The last look at an orbit before it is handed out: whether it solves its equations.

What Newton's method says of its own steps is not asked. Where there is doubt, the orbit's meshes and sizes are made
anew: a wrong size would hide what is left of the equations.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from saltus.errors import ConvergenceError
from saltus.orbits.landing.landed import before_poles
from saltus.orbits.orbit import PeriodicOrbit, orbit_at
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.signature import EVENT_END, MEAN_END, SPEED, Survey
from saltus.scales import (
    GUESS_ROUNDED,
    INFINITE,
    RESIDUAL_CLEAR,
    RESIDUAL_LEFT,
    RESIDUAL_LOOSE,
    RESTING,
    SPEEDLESS,
    followed,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.orbits.unfolding import Fixed

__all__ = ["check_solved", "sound_orbit"]


def sound_orbit(
    problem: OrbitProblem, u: NDArray[np.float64], J: NDArray[np.float64], fixed: Fixed | None = None
) -> PeriodicOrbit:
    """Return the orbit that solves `problem` at `u`; raise `ConvergenceError` where it does not.

    Where an event is met without speed, so that a multiplier is infinite, the orbit is not admissible.

    Parameters
    ----------
    fixed : Fixed, optional
        The quantity that was fixed.
    """
    survey = problem.survey(u)
    check_solved(problem, u, survey)
    orbit = orbit_at(problem, u, J, survey, fixed=fixed)
    if orbit.admissible and _speedless(problem, u, survey, orbit.multipliers):
        return replace(orbit, faults=orbit.faults | SPEED)
    return orbit


def check_solved(problem: OrbitProblem, u: NDArray[np.float64], survey: Survey) -> None:
    """Raise `ConvergenceError` where an orbit's states are not finite or do not solve its equations.

    Parameters
    ----------
    survey : Survey
        A dense look at it.
    """
    count, what = len(problem.system.states), "periodic orbit"
    sizes = np.maximum(np.abs(survey.lows[:count]), np.abs(survey.highs[:count]))
    if not (np.isfinite(u).all() and np.isfinite(sizes).all()):
        raise ConvergenceError(what, math.inf, 0, "the states are not finite; start from a nearer guess")
    if survey.residual <= RESIDUAL_CLEAR * float(sizes.min()):
        return
    left = _left(problem, u)
    if not left <= max(RESIDUAL_LEFT, RESIDUAL_LOOSE * problem.tol):
        hint = "of the orbit's own size is left of its equations: it is too unstable to be held in so few pieces"
        raise ConvergenceError(what, left, 0, f"{left:.1e} {hint}, or the guess is too far")


def _left(problem: OrbitProblem, u: NDArray[np.float64]) -> float:
    """Return what is left of the equations, each over the size of its terms, on meshes made for the orbit."""
    own = u[: problem.size]
    fresh = OrbitProblem(problem.system, problem.signature, problem.parameters_at(u), tol=problem.tol)
    own, F, _ = before_poles(fresh, fresh.resolve, own, followed(problem.tol), afresh=True)
    n, rows = fresh.n, F.reshape(fresh.segments, fresh.n + 1)
    count = len(fresh.system.states)
    known = np.maximum(fresh.state_scale, GUESS_ROUNDED * problem.state_scale)
    known[:count] = np.maximum(known[:count], RESTING * float(known[:count].max()))
    left = float(np.max(np.abs(rows[:, :n]) / known))
    sizes, period = fresh.event_sizes(own), float(np.abs(own[n :: n + 1]).sum())
    for i, (kind, row, size) in enumerate(zip(fresh.kinds.tolist(), rows[:, n].tolist(), sizes.tolist(), strict=True)):
        if kind == EVENT_END and abs(row) > 0.0:
            size = max(size, abs(fresh.rate(own, i)[0]) * period)  # an error of the time is none of the event
            left = max(left, abs(row) / size if size > 0.0 else math.inf)
    return left if math.isfinite(left) else math.inf


def _speedless(problem: OrbitProblem, u: NDArray[np.float64], survey: Survey, values: NDArray[np.complex128]) -> bool:
    """Return whether an event at a segment's end is met without speed, so that a multiplier is infinite."""
    kinds = problem.signature.kinds
    if problem.signature.is_cut or not np.any(np.abs(values) >= INFINITE):
        return False
    met = np.isin(kinds, (EVENT_END, MEAN_END))
    period = float(u[problem.n : problem.size : problem.n + 1].sum())
    return bool(np.any(met & (np.abs(survey.rates[:, 0]) * period < SPEEDLESS * problem.event_sizes(u))))
