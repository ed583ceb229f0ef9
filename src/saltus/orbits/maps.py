"""Derivatives of an orbit's pieces: how far each magnifies a change of its start, along the flow and across it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.errors import ConvergenceError
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.resting import kept_at_zero
from saltus.orbits.signature import CLOSED_END, CUT_END, EVENT_END, MEAN_END, Signature
from saltus.scales import ILL_CONDITIONED
from saltus.system.faces import EXPONENTIAL, FACE

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = [
    "across_flow",
    "check_measured",
    "flight_growth",
    "landing_maps",
    "most_grown",
    "own_units",
    "piece_maps",
    "reflector",
    "resting",
    "small_at_starts",
]


def piece_maps(problem: OrbitProblem, J: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the derivative of each piece's end in its start, in units of the states, shape (pieces, n, n).

    Parameters
    ----------
    problem : OrbitProblem
        The equations of an orbit, in one piece or several.
    J : ndarray, shape (size, size) or wider
        Their Jacobian.
    """
    n, wide, scale = problem.n, problem.n + 1, problem.common_scale
    maps = np.stack([J[i * wide : i * wide + n, i * wide : i * wide + n] for i in range(problem.segments)])
    if problem.segments == 1:
        maps = maps + np.eye(n)  # the start of the next period is that of this one
    with np.errstate(over="ignore"):
        return np.asarray(maps * scale / scale[:, None])


def own_units(problem: OrbitProblem, u: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """Return units of the states at each piece's start and end, shape (pieces, n); None where sizes of states serve.

    A state whose rate has it as a factor is its own unit: changes of it count relative to what it is there. It may fall
    to 1e-30 of its size and grow again. Other states have their sizes as units.

    The end of a piece has its own unit. The next start differs from it by the residual. Where such a state is small
    that is many times itself, or its sign. A unit has the sign of its state.
    """
    compiled, n = problem.system.compiled, problem.n
    if compiled.plain or problem.conserving or problem.signature.flies:
        return None
    blocks = u[: problem.size].reshape(problem.segments, n + 1)
    starts = blocks[:, :n]
    ends = problem.evaluate(u)[0].reshape(problem.segments, n + 1)[:, :n] + np.roll(starts, -1, axis=0)
    own = np.isin(compiled.kinds, (FACE, EXPONENTIAL)) & np.all(starts * ends != 0.0, axis=0)
    if not own.any():
        return None
    sizes = problem.common_scale
    return np.where(own, starts, sizes), np.where(own, ends, sizes)


def small_at_starts(problem: OrbitProblem, u: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which unknowns are states that are small and have themselves as a factor of their rate, shape (size,).

    Rounding of their size is half of their digits, or all of them. A state that is small all along the orbit rests, and
    has no size of its own.
    """
    unknowns = np.abs(u[: problem.size]).reshape(problem.segments, problem.n + 1)
    own = np.append(np.isin(problem.system.compiled.kinds, (FACE, EXPONENTIAL)), False)
    sizes = np.append(problem.state_scale, 1.0)
    small = own & (unknowns > 0.0) & (unknowns < ILL_CONDITIONED * sizes)
    if np.any(small):
        survey, n = problem.survey(u), problem.n
        small[:, :n] &= np.maximum(np.abs(survey.lows[:n]), np.abs(survey.highs[:n])) >= ILL_CONDITIONED * sizes[:n]
    return np.asarray(small).ravel()


def check_measured(maps: NDArray[np.float64]) -> None:
    """Raise `ConvergenceError` where the derivatives of pieces are beyond all numbers."""
    if not np.all(np.isfinite(maps)):
        hint = "a change of its start grows beyond all numbers; start from a nearer guess"
        raise ConvergenceError("periodic orbit", math.inf, 0, hint)


def landing_maps(problem: OrbitProblem, u: NDArray[np.float64], J: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return what `piece_maps` does, of flights up to their events, which a change of the start meets sooner or later.

    A piece behind which its flight goes on has a given duration. Where an event is met without speed its map is
    infinite.
    """
    n, count, scale = problem.n, problem.segments, problem.common_scale
    rows = J[:, : problem.size].reshape(count, n + 1, count, n + 1)[np.arange(count), :, np.arange(count)]
    for i in np.flatnonzero(problem.kinds == MEAN_END).tolist():  # the event function at the end, over the duration
        gradient, at = np.empty(2 + 2 * n), i * (n + 1)
        event = int(problem.transitions[i]), 0, np.ascontiguousarray(u[at : at + n])
        problem.system.compiled.call("event_x", *event, problem.extended, gradient)
        rows[i, n, :n] += gradient[2 : 2 + n] / u[at + n]
    ends = np.isin(problem.kinds, (EVENT_END, MEAN_END))[:, None]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        later = np.where(ends, -rows[:, n, :n] * scale / rows[:, n, n:], 0.0)
        rest = (rows[:, :n, n] - np.roll(problem.flows_at_starts(u), -1, axis=0)) / scale
        return np.asarray(piece_maps(problem, J) + rest[:, :, None] * later[:, None, :])


def most_grown(problem: OrbitProblem, u: NDArray[np.float64], J: NDArray[np.float64]) -> float:
    """Return how far a change grows over a piece at most, from its start to the next one's.

    Of flights the landing counts, in space and in time: as a share of the period. Of smooth orbits what is across the
    flow counts.
    """
    if not problem.signature.flies:
        with np.errstate(invalid="ignore", over="ignore"):
            return float(np.abs(across_flow(problem, u, piece_maps(problem, J))).max(initial=0.0))
    period = float(np.abs(u[problem.n : problem.size : problem.n + 1]).sum())
    if (still := resting(problem, u)).any():
        J = np.where(np.resize(np.append(still, False), J.shape[1]), 0.0, J)
    return float(problem.pencils.landing(J, problem.kinds, problem.n, problem.common_scale, period))


def resting(problem: OrbitProblem, u: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which states are 0 all along an orbit, shape (n,): on an invariant plane, without any rounding.

    What grows across the plane magnifies nothing. A state that is 0 only where pieces start, as on a wall, is none of
    these: the field moves it.
    """
    if 0.0 not in u[: problem.n].tolist():
        return np.zeros(problem.n, dtype=bool)
    starts = u[: problem.size].reshape(problem.segments, problem.n + 1)[:, : problem.n]
    zeros = np.all(starts == 0.0, axis=0)
    zeros[len(problem.system.states) :] = False
    return kept_at_zero(problem, problem.state_scale, zeros) if zeros.any() else zeros


def across_flow(problem: OrbitProblem, u: NDArray[np.float64], maps: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the derivatives of pieces across the flow, (pieces, n - 1, n - 1); of smooth forced orbits at phases.

    Along the flow sensitivities grow as it becomes faster, which is no instability.
    """
    if problem.system.phase is not None and not problem.signature.flies:
        return maps[:, :-1, :-1]
    turns = [reflector(flow / problem.common_scale) for flow in problem.flows_at_starts(u)]
    turned = [turns[(i + 1) % len(maps)] @ matrix @ turns[i] for i, matrix in enumerate(maps)]
    return np.array(turned)[:, 1:, 1:]


def flight_growth(problem: OrbitProblem, u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how far a change grows from each piece's start to its end, before any reset, shape (pieces,).

    What an event makes of it, as where it is met without speed, is left out: a cut changes nothing of that.
    """
    form, count = problem.signature, problem.segments
    kinds = (CLOSED_END,) + (CUT_END,) * (count - 1)
    smooth = Signature(form.modes, (-1,) * count, kinds, 0)
    arcs = OrbitProblem(problem.system, smooth, problem.parameters_at(u), tol=problem.tol)
    arcs.take(problem.kept())
    maps = np.abs(piece_maps(arcs, arcs.evaluate(u[: problem.size])[1]))
    return np.asarray(maps[:, :, ~resting(problem, u)].max(axis=(1, 2), initial=0.0))


def reflector(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the reflection that turns a vector onto the first axis; the zero vector is left as it is."""
    length = float(np.linalg.norm(vector))
    if not 0.0 < length < math.inf:
        return np.eye(vector.size)
    v = vector / length
    v[0] += 1.0 if v[0] >= 0.0 else -1.0
    return np.asarray(np.eye(v.size) - 2.0 / (v @ v) * np.outer(v, v))
