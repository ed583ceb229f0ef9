"""The orbit just beyond a change of signature, as a motion there shows it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.problems.grazing import Neighbour
from saltus.errors import SaltusError
from saltus.flow.event_logs import events_after
from saltus.orbits.cuts import whole
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.regular_ends import settle_signature
from saltus.orbits.settling import cycle_of
from saltus.orbits.solve import solve_unknowns

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["seen_beside"]


def seen_beside(problem: OrbitProblem, u: NDArray[np.float64], step: float, rounds: int = 1) -> Neighbour | None:
    """Return the orbit at a parameter next to that of the orbit `u`, in the signature that a motion there has.

    The motion starts in the middle of the longest segment off all surfaces. It lasts for some of the orbit's periods,
    of which the last one is read. None where it does not lead to an orbit.

    Parameters
    ----------
    problem : OrbitProblem
        Equations of the orbit, with one active parameter.
    u : ndarray, shape (size + 1,)
        Its unknowns, and the parameter.
    step : float
        How far the parameter is moved, in its unit.
    rounds : int, optional
        How many periods.
    """
    problem, u = whole(problem, u)
    system, n = problem.system, problem.n
    problem.survey(u)
    durations = u[n : problem.size : n + 1]
    slides = np.array([system.modes[system.mode_names[mode]].surface is not None for mode in problem.signature.modes])
    i = int(np.argmax(np.where(slides, 0.0, durations)))
    x, moved = problem.state_on(i, 0.5), u.copy()
    moved[-1] += step
    p, period = problem.parameters_at(moved), float(durations.sum())
    if system.phase is not None:
        x[-1] %= 2.0 * math.pi
        period *= _rate(problem, x, problem.extended) / _rate(problem, x, system.compiled.extended(p))
    fresh = OrbitProblem(system, problem.signature, p, tol=problem.tol)
    try:
        log = events_after(system, p, x, problem.signature.modes[i], t_end=rounds * period)
        last = log.time > (rounds - 1) * period
        events = np.flatnonzero((log.transition >= 0) & last)
        if not events.size or log.mode_end != problem.signature.modes[i]:
            return None
        wound = None
        if system.phase is not None:
            wound = 2.0 * math.pi * np.cumsum((log.transition == -1) & last)[events]
        signature, guess = cycle_of(log, events, period, wound, problem.signature.turns)
        fresh = OrbitProblem(system, signature, p, tol=problem.tol)
        solved, _ = solve_unknowns(fresh, guess)
        signature, turned = settle_signature(fresh, solved)
    except SaltusError:
        return None
    return Neighbour(signature, np.append(turned, moved[problem.size :]))


def _rate(problem: OrbitProblem, x: NDArray[np.float64], p: NDArray[np.float64]) -> float:
    """Return the rate of the phase; `p` is extended."""
    slope = np.empty(problem.n)
    problem.system.compiled.call("field", int(problem.modes[0]), 0, np.ascontiguousarray(x), p, slope)
    return float(slope[-1])
