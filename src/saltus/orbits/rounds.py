"""Orbits that go round a shorter one several times: how many times, and the shorter orbit."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.orbits.cuts import clustered, whole
from saltus.orbits.signature import CLOSED_END, PHASE_END, Signature
from saltus.system.angles import wrapped

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.orbits.problem import OrbitProblem
    from saltus.orbits.signature import Survey

__all__ = ["divided", "repeats_of", "rounds_of"]

_ALIKE = 1e-6  # difference between two rounds, over the range of a state, up to which they are the same
_ROUNDING = 1e-12  # difference between two rounds, over the size of a state, that is rounding
_LOOKS = 8  # places in each part of a period at which states are compared
_LIKELY = 4  # primes by which a phase may be faster than its drive
_PRIMES = (2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53, 59, 61)  # factors of a count of rounds


def rounds_of(problem: OrbitProblem, u: NDArray[np.float64]) -> int:
    """Return how many times the orbit `u` goes round the shortest one that it repeats; `problem` is started there."""
    survey, states = problem.survey(u), len(problem.system.states)
    rests = np.all(survey.highs[:states] - survey.lows[:states] <= _ROUNDING * problem.state_scale[:states])
    if rests and problem.system.phase is None:
        return 1
    count = 1
    for prime in _PRIMES:
        while divided(problem, u, count * prime) is not None:
            count *= prime
    return count


def repeats_of(problem: OrbitProblem, u: NDArray[np.float64]) -> int:
    """Return how many times the states of a forced orbit repeat themselves while the phase turns once.

    It is more than 1 where the phase runs through several periods of the drive, as in ``cos(2*s)``. Of an orbit that
    takes several turns, or rests, it is 1.
    """
    problem, u = whole(problem, u)
    signature, n = problem.signature, problem.n
    if signature.turns != 1:
        return 1
    survey, states = problem.survey(u), len(problem.system.states)
    ranges = (survey.highs - survey.lows)[:states]
    if np.all(ranges <= _ROUNDING * problem.state_scale[:states]):
        return 1
    known = _ALIKE * ranges + _ROUNDING * problem.state_scale[:states]
    blocks, count = u[: problem.size].reshape(problem.segments, n + 1), 1
    for prime in _PRIMES[:_LIKELY]:
        while _repeats(problem, blocks, count * prime, known):
            count *= prime
    return count


def _repeats(problem: OrbitProblem, blocks: NDArray[np.float64], count: int, known: NDArray[np.float64]) -> bool:
    """Return whether the states after a part of the period are the same, up to `known`, all along an orbit."""
    states, signature = known.size, problem.signature
    if signature.kinds[0] == PHASE_END:
        times = np.arange(_LOOKS * count) / (_LOOKS * count)
        seen = np.array([problem.state_on(0, clustered(share))[:states] for share in times.tolist()])
        return bool(np.all(np.abs(np.roll(seen, -_LOOKS, axis=0) - seen) <= known))
    part, rest = divmod(problem.segments, count)
    shifted = np.roll(blocks, -part, axis=0)
    same = not rest and all(
        np.array_equal(np.roll(one, -part), one) for one in (signature.modes, signature.transitions)
    )
    alike = np.all(np.abs(shifted[:, :states] - blocks[:, :states]) <= known)
    return bool(same and alike and np.all(np.abs(shifted[:, -1] - blocks[:, -1]) <= _ALIKE * blocks[:, -1].sum()))


def divided(
    problem: OrbitProblem,
    u: NDArray[np.float64],
    count: int,
    sizes: NDArray[np.float64] | None = None,
    known: Survey | None = None,
) -> tuple[Signature, NDArray[np.float64]] | None:
    """Return signature and unknowns of the orbit that `u` goes round `count` times; None where its rounds differ.

    Parameters
    ----------
    problem : OrbitProblem
        The equations, started near `u`.
    u : ndarray, shape (size + active,)
        An orbit.
    count : int
        Rounds, 2 or more.
    sizes : ndarray, shape (n,), optional
        Differences of the states up to which two rounds are the same; by default a millionth of the states' ranges.
    known : Survey, optional
        What the last dense look showed, if it was at `u`, in one piece between events.
    """
    problem, u = whole(problem, u)
    signature, n, turns = problem.signature, problem.n, problem.signature.turns
    blocks = u[: problem.size].reshape(problem.segments, n + 1)
    if turns % count:
        return None
    closes, part = signature.kinds[0] in (PHASE_END, CLOSED_END), problem.segments // count
    modes, transitions, kinds = (each[:part] for each in (signature.modes, signature.transitions, signature.kinds))
    if not closes and (modes * count != signature.modes or transitions * count != signature.transitions):
        return None
    survey = problem.survey(u) if known is None else known
    if closes:
        starts = [blocks[0, :n], *(problem.state_on(0, clustered(j / count)) for j in range(1, count))]
        rounds = np.array([[np.append(state, blocks[0, n] / count)] for state in starts])
        modes, transitions, kinds = signature.modes, signature.transitions, signature.kinds
    else:
        rounds = blocks.reshape(count, part, n + 1).copy()
    if sizes is None:
        sizes = _ALIKE * (survey.highs[:n] - survey.lows[:n]) + _ROUNDING * problem.state_scale
    share = float(np.max(sizes / problem.state_scale))
    allowed = np.append(sizes, max(share, _ALIKE) * float(np.abs(blocks[:, n]).sum()))
    if problem.system.phase is not None:
        rounds[:, :, n - 1] -= (2.0 * math.pi * turns / count) * np.arange(count)[:, None]
        allowed[n - 1] = 2.0 * math.pi * max(share, _ALIKE)
    places = problem.system.angle_places
    rounds[1:] = rounds[0] + wrapped(rounds[1:] - rounds[0], places) if places.size else rounds[1:]
    if not np.all(np.abs(rounds - rounds[0]) <= allowed):  # a round that cannot be followed in one piece is NaN
        return None
    once = Signature(modes, transitions, kinds, turns // count)
    return once, np.append(rounds.mean(axis=0).ravel(), u[problem.size :])
