"""Multipliers of an orbit that meets an event more slowly than its own speed is known.

A single one is known by Liouville's theorem all the same. Of several, those are told whose own error is small.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.orbits.maps import piece_maps
from saltus.orbits.signature import EVENT_END, MEAN_END
from saltus.orbits.stability.speed_errors import errors_by_speeds
from saltus.scales import ILL_CONDITIONED, INFINITE, MULTIPLIER_LOST, ROUGH, SPEEDLESS, followed

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.orbits.problem import OrbitProblem

__all__ = ["or_unknown"]


def or_unknown(
    problem: OrbitProblem,
    u: NDArray[np.float64],
    J: NDArray[np.float64],
    rates: NDArray[np.float64],
    values: NDArray[np.complex128],
) -> NDArray[np.complex128]:
    """Return an orbit's multipliers, NaN those that an event is met too slowly for.

    Their own error is beyond `ROUGH` of them there. Where an event's speed is rounding the pencil is 0/0. Where one of
    them is infinite it is told as such. A single one is the product of all, by Liouville's theorem.

    Parameters
    ----------
    rates : ndarray, shape (segments,)
        Lie derivative of each segment's event at its end, as a survey has it. Parameters are those of `u`.
    """
    met = np.isin(problem.kinds, (EVENT_END, MEAN_END))
    if not met.any():
        return values
    period = float(np.abs(u[problem.n : problem.size : problem.n + 1]).sum())
    least = max(followed(problem.tol) / ROUGH, SPEEDLESS)
    with np.errstate(invalid="ignore"):
        slowly = met & ~(np.abs(rates) * period > least * problem.event_sizes(u))
    if not slowly.any():
        return values
    slow = np.flatnonzero(slowly).tolist()
    with np.errstate(invalid="ignore"):
        known = errors_by_speeds(problem, u, values, slow) <= _allowed(problem, values)
    if known.all():
        return values
    single = math.nan
    if problem.n == 2 and not problem.conserving:
        single = _product(problem, u, J, slow)
    if math.isnan(single) and any(abs(value) >= INFINITE for value in values.tolist()):
        return values
    told = np.where(known, values, complex(math.nan))
    if not math.isnan(single):
        told[0] = single
    if problem.system.phase is None:
        told[-1] = 1.0
    return told


def _allowed(problem: OrbitProblem, values: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return by how much each multiplier may be wrong: a share of itself, and what the flow's error leaves of 0."""
    return np.asarray(ROUGH * np.abs(values) + MULTIPLIER_LOST * problem.tol)


def _product(problem: OrbitProblem, u: NDArray[np.float64], J: NDArray[np.float64], slow: list[int]) -> float:
    """Return the product of the multipliers of an orbit with two states, a phase among them; NaN where it has no limit.

    A flow and a reset enlarge areas by the determinant of their derivative. An event does so by the quotient of its
    rates behind it and before. The orbit has been surveyed last.

    slow: segments whose events are met more slowly than their speed is known.
    """
    problem.set_parameters(u)
    product = float(np.prod(np.linalg.det(piece_maps(problem, J))))
    for i, k in enumerate(problem.signature.transitions):
        if k >= 0:
            x = problem.state_on(i, 1.0)
            product *= _limit(problem, i, k, x) if i in slow else float(np.divide(*_rates(problem, i, k, x)))
    return product


def _limit(problem: OrbitProblem, i: int, k: int, x: NDArray[np.float64]) -> float:
    """Return the quotient of rates that both vanish at a contact; NaN unless it is the same all around."""
    steps = ILL_CONDITIONED * np.vstack([np.diag(problem.state_scale), -np.diag(problem.state_scale)])
    behind, before = np.array([_rates(problem, i, k, x + step) for step in steps]).T
    largest = float(before @ before)
    if not 0.0 < largest < math.inf:
        return math.nan
    quotient = float(behind @ before) / largest
    left = float(np.linalg.norm(behind - quotient * before))
    return quotient if left <= ROUGH * abs(quotient) * math.sqrt(largest) else math.nan


def _rates(problem: OrbitProblem, i: int, k: int, x: NDArray[np.float64]) -> tuple[float, float]:
    """Return the rates of a segment's event behind it, carried back by its reset, and before it."""
    n, compiled, p = problem.n, problem.system.compiled, problem.extended
    event, after, moved, f1, f2 = np.empty(2 + 2 * n), np.empty(n), np.empty(n * n), np.empty(n), np.empty(n)
    compiled.call("event_x", k, 0, x, p, event)
    compiled.call("reset", k, 0, x, p, after)
    compiled.call("reset_x", k, 0, x, p, moved)
    compiled.call("field", problem.signature.modes[i], 0, x, p, f1)
    compiled.call("field", problem.signature.modes[(i + 1) % problem.segments], 0, after, p, f2)
    gradient, reset = event[2 : 2 + n], moved.reshape(n, n)
    if np.linalg.det(reset) == 0.0:  # what is behind the event keeps nothing of one of the directions before
        return math.nan, float(gradient @ f1)
    return float(gradient @ np.linalg.solve(reset, f2)), float(gradient @ f1)
