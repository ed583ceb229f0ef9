"""Errors of multipliers where events are met slowly: by how well the speed of each is known.

What shorter steps and rounding leave of the equations moves an orbit, and the speed at its events with it.
"""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np

from saltus.orbits.signature import EVENT_END
from saltus.orbits.stability.floquet import multipliers, nontrivial, passage
from saltus.scales import EPS, critical_error

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from saltus.orbits.problem import OrbitProblem

__all__ = ["errors_by_speeds"]


def errors_by_speeds(
    problem: OrbitProblem, u: NDArray[np.float64], values: NDArray[np.complex128], slow: Sequence[int]
) -> NDArray[np.float64]:
    """Return by how much each multiplier may be wrong where events are met slowly, shape (multipliers,).

    The orbit is moved by Newton's step on steps of half the length. Roundings of all equations are added that change
    the speed at an event most, in either direction, for each event in turn. Multipliers of all these orbits are
    compared.

    Parameters
    ----------
    values : ndarray of complex, shape (multipliers,)
        What `multipliers` returns.
    slow : sequence of int
        Segments whose events are met slowly. The orbit has been surveyed last.
    """
    errors, ends = np.zeros(values.size), [problem.state_on(i, 1.0) for i in range(problem.segments)]
    with problem.halved_steps(), np.errstate(invalid="ignore", over="ignore"), suppress(np.linalg.LinAlgError):
        for moved, faster in _moved(problem, u, values, slow, np.array(ends)):
            J = problem.evaluate(moved)[1]
            for i, more in faster.items():
                place = i * (problem.n + 1) + problem.n
                J[place, place] += more
            other = multipliers(problem, moved, J)
            away = np.abs(np.array(passage(values.tolist(), other.tolist()).followed) - values)
            errors = np.maximum(errors, np.where(np.isnan(away), np.inf, away))
        return errors
    return np.full(values.size, np.inf)  # nothing is known where the equations are singular


def _moved(
    problem: OrbitProblem, u: NDArray[np.float64], values: NDArray[np.complex128], slow: Sequence[int],
    ends: NDArray[np.float64],
) -> Iterator[tuple[NDArray[np.float64], dict[int, float]]]:  # fmt: skip
    """Yield orbits that are moved by errors of the equations, and by how much events are faster by rounding."""
    n, size, count = problem.n, problem.size, problem.segments
    F, J = problem.evaluate(u)
    J = J[:, :size]
    period = float(np.abs(u[n : size : n + 1]).sum())
    columns = np.tile(np.append(problem.state_scale, period), count)
    rows = np.fmax(np.abs(J * columns).max(axis=1), EPS * EPS)
    scaled, off = J * columns / rows[:, None], F / rows
    rounded, faster = _roundings(problem, u, J, ends)
    free = _along_fold(scaled, values, autonomous=problem.system.phase is None)
    start = u.copy()
    start[:size] += _bounded(_without(np.linalg.solve(scaled, -off), free)) * columns
    yield start, {}
    for i in slow:
        gradient = problem.rate(u, i)[1][:size] * columns
        weights = np.linalg.solve(scaled.T, _without(gradient, free))
        step = _bounded(_without(np.linalg.solve(scaled, rounded / rows * np.sign(weights)), free)) * columns
        for sign in (1.0, -1.0):
            other = start.copy()
            other[:size] += sign * step
            yield other, {i: sign * float(faster[i])}


def _roundings(
    problem: OrbitProblem, u: NDArray[np.float64], J: NDArray[np.float64], ends: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return roundings of all equations, shape (size,), and of the speeds at events, shape (segments,)."""
    n, count = problem.n, problem.segments
    starts = u[: problem.size].reshape(count, n + 1)[:, :n]
    each = np.arange(count)
    maps = np.abs(J.reshape(count, n + 1, count, n + 1)[each, :n, each, :n])
    own = np.maximum(np.abs(starts), np.abs(ends))
    left = (np.abs(J) @ np.abs(u[: problem.size])).reshape(count, n + 1)
    left[:, :n] = own + np.maximum(np.abs(np.roll(starts, -1, axis=0)), np.einsum("ikl,il->ik", maps, own))
    faster, event = np.zeros(count), np.empty(2 + 2 * n)
    for i in np.flatnonzero(problem.kinds == EVENT_END).tolist():
        problem.system.compiled.call("event_x", int(problem.transitions[i]), 0, ends[i], problem.extended, event)
        left[i, n] += np.abs(event[2 : 2 + n]) @ own[i]
        faster[i] = np.abs(event[2 + n :]) @ own[i]
    return EPS * left.ravel(), EPS * faster


def _along_fold(
    scaled: NDArray[np.float64], values: NDArray[np.complex128], *, autonomous: bool
) -> NDArray[np.float64]:
    """Return the direction in which an orbit at a fold is free, of length 1; 0 where it is at none."""
    inner = nontrivial(values, autonomous=autonomous)
    direction = np.zeros(len(scaled))
    if np.any(np.abs(inner - 1.0) <= critical_error(EPS)):
        direction = np.linalg.svd(scaled)[2][-1]
    return direction


def _bounded(step: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a step that is no longer than the unknowns are large: beyond, nothing is known of the orbit."""
    return step / max(1.0, float(np.abs(step).max()))


def _without(vector: NDArray[np.float64], direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a vector without its part in a direction of length 1, or of length 0."""
    return vector - direction * (direction @ vector)
