"""The orbit just beyond a change of signature, as a motion there shows it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.problems.grazing import Neighbour
from saltus.errors import SaltusError
from saltus.flow.event_logs import events_after
from saltus.orbits.cuts import whole
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.regular_ends import settle_signature
from saltus.orbits.settling import cycle_of
from saltus.orbits.signature import Signature
from saltus.orbits.solve import solve_unknowns

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["looks_beside", "seen_beside"]


def looks_beside(problem: OrbitProblem, u: NDArray[np.float64], step: float, rounds: int = 1) -> Iterator[Neighbour]:
    """Yield orbits at a parameter next to that of the orbit `u`, until a signature comes again.

    Each is what a motion shows that starts at the one before, solved for with its signature. The first motion starts
    at `u`, whose distance from an orbit of the new parameter is as long as the step: it may show the old signature.
    An orbit of a wrong signature lies next to the right one, whose motion a second look shows.

    Parameters
    ----------
    problem, u, step, rounds
        See `seen_beside`.
    """
    met: set[Signature] = set()
    while (beside := seen_beside(problem, u, step, rounds)) is not None and beside.signature not in met:
        met.add(beside.signature)
        yield beside
        p, active, scales = problem.parameters_at(u), problem.active, problem.scales
        u, step = beside.u, 0.0
        problem = OrbitProblem(problem.system, beside.signature, p, active, scales, problem.tol)
        problem.start(u)


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
        x[-1] %= system.turn
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
            wound = system.turn * np.cumsum((log.transition == -1) & last)[events]
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
