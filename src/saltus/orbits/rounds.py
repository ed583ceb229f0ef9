"""How often an orbit goes round a shorter one, and which that is; how often it goes round the circles of its angles."""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from saltus.orbits.cuts import clustered, whole
from saltus.orbits.exactness import computed_finer, point_errors
from saltus.orbits.signature import CLOSED_END, PHASE_END, TOUCH_END, Signature
from saltus.scales import FINEST, ROUNDED_ROUNDS, ROUNDS_ALIKE, Verdict, same
from saltus.system.angles import TURN, wrapped
from saltus.system.periodicity import PRIMES

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from saltus.orbits.problem import OrbitProblem
    from saltus.orbits.signature import Survey
    from saltus.system import HybridSystem

__all__ = [
    "divided", "drive_text", "repeats_of", "rotating_of", "rounds_of", "shortest", "turns_of", "unwrapped",
    "winding_of",
]  # fmt: skip


def rounds_of(problem: OrbitProblem, u: NDArray[np.float64]) -> int:
    """Return how many times the orbit `u` goes round the shortest one that it repeats; `problem` is started there."""
    return shortest(problem, u)[0]


def shortest(problem: OrbitProblem, u: NDArray[np.float64]) -> tuple[int, tuple[Signature, NDArray[np.float64]] | None]:
    """Return how many times an orbit goes round the shortest one that it repeats, with signature and unknowns of that.

    Where the error of the points leaves it open whether two rounds are one, the orbit is computed more exactly.
    None stands for the orbit itself.
    """
    survey, states = problem.survey(u), len(problem.system.states)
    rests = np.all(survey.highs[:states] - survey.lows[:states] <= ROUNDED_ROUNDS * problem.state_scale[:states])
    if rests and problem.system.phase is None:
        return 1, None
    count, found, error = 1, None, None if problem.tol <= FINEST else _error(problem, u)
    for prime in PRIMES:
        while True:
            once, verdict = _repeated(problem, u, count * prime, error)
            if verdict is Verdict.UNCLEAR and error is not None:
                if (finer := computed_finer(problem, u)) is None:
                    break
                (problem, u), error = finer, None
                continue
            if not verdict:
                break
            count, found = count * prime, once
    return count, found


def _error(problem: OrbitProblem, u: NDArray[np.float64]) -> float:
    """Return the largest error of an orbit's points, over the states' sizes, such as rounds may differ by."""
    states = len(problem.system.states)
    return float(np.max(point_errors(problem, u)[:, :states] / problem.state_scale[:states]))


def repeats_of(system: HybridSystem, turns: int, rounds: int) -> int:
    """Return how often the states of an orbit of some forcing periods and rounds repeat while the phase turns once."""
    count = system.drive_repeats
    once = max(turns // rounds, 1)
    return 1 if count % once else count // once


def drive_text(system: HybridSystem) -> str:
    """Return words for a drive that repeats several times while the phase turns once; none for others."""
    count = system.drive_repeats
    return f"; the drive repeats {count} times per turn of {system.all_states[-1]}" if count > 1 else ""


class _Rounds(NamedTuple):
    """The rounds of an orbit, each as if it were an orbit of its own."""

    problem: OrbitProblem  # the orbit's equations, smooth segments in one piece
    once: Signature  # of one round
    rows: NDArray[np.float64]  # shape (rounds, segments, n + 1): states and durations, turns taken off
    survey: Survey
    period: float  # of all rounds

    def gaps(self) -> NDArray[np.float64]:
        """Return how far each round is from the first; NaN where it cannot be followed in one piece."""
        return np.asarray(np.abs(self.rows - self.rows[0]))

    def allowed(self, sizes: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what differences of states, shape (n,), make of states and durations, shape (n + 1,)."""
        share = max(float(np.max(sizes / self.problem.state_scale)), ROUNDS_ALIKE)
        allowed = np.append(sizes, share * self.period)
        if self.problem.system.phase is not None:
            allowed[-2] = self.problem.system.turn * share
        return allowed

    def mean(self, active: NDArray[np.float64]) -> tuple[Signature, NDArray[np.float64]]:
        """Return signature and unknowns of the mean round; `active` are the parameters among the unknowns."""
        return self.once, np.append(self.rows.mean(axis=0).ravel(), active)


def divided(
    problem: OrbitProblem, u: NDArray[np.float64], count: int, sizes: NDArray[np.float64], known: Survey | None = None
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
    sizes : ndarray, shape (n,)
        Differences of the states up to which two rounds are the same.
    known : Survey, optional
        What the last dense look showed, if it was at `u`, in one piece between events.
    """
    found = _parted(problem, u, count, known)
    if found is None or not np.all(found.gaps() <= found.allowed(sizes)):
        return None
    return found.mean(u[problem.size :])


def _repeated(
    problem: OrbitProblem, u: NDArray[np.float64], count: int, error: float | None
) -> tuple[tuple[Signature, NDArray[np.float64]] | None, Verdict]:
    """Return what `divided` does, and whether the rounds are the same.

    error: that of the points, over the states' sizes, at a loose tolerance; None at the finest one.
    """
    found = _parted(problem, u, count, None)
    if found is None:
        return None, Verdict.NO
    n, scale = problem.n, found.problem.state_scale
    sizes = ROUNDS_ALIKE * (found.survey.highs[:n] - found.survey.lows[:n]) + ROUNDED_ROUNDS * scale
    gaps = found.gaps()
    if np.all(gaps <= found.allowed(sizes)):
        return found.mean(u[problem.size :]), Verdict.YES
    if error is None or same(gaps, 0.0, found.allowed(np.maximum(sizes, error * scale))) is Verdict.NO:
        return None, Verdict.NO
    return None, Verdict.UNCLEAR


def _parted(problem: OrbitProblem, u: NDArray[np.float64], count: int, known: Survey | None) -> _Rounds | None:
    """Return the rounds of an orbit that may go round another one `count` times; None where its signature does not."""
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
    if problem.system.phase is not None:
        rounds[:, :, n - 1] -= (problem.system.turn * turns / count) * np.arange(count)[:, None]
    places = problem.system.angle_places
    rounds[1:] = rounds[0] + wrapped(rounds[1:] - rounds[0], places) if places.size else rounds[1:]
    once = Signature(modes, transitions, kinds, turns // count)
    return _Rounds(problem, once, rounds, survey, float(np.abs(blocks[:, n]).sum()))


def turns_of(problem: OrbitProblem, u: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the whole turns from each segment's start to its end, behind its reset, shape (segments, angles).

    They are what the end differs by from the next start; their sums are the winding numbers of the orbit `u`.
    """
    problem.survey(u)
    n, places = problem.n, problem.system.angle_places
    starts = u[: problem.size].reshape(problem.segments, n + 1)[:, :n]
    ends, landed = np.empty((problem.segments, n)), np.empty(n)
    for i, transition in enumerate(problem.signature.transitions):
        ends[i] = problem.state_on(i, 1.0)
        if transition >= 0 and problem.signature.kinds[i] != TOUCH_END:
            problem.system.compiled.call(
                "reset", transition, 0, np.ascontiguousarray(ends[i]), problem.extended, landed
            )
            ends[i] = landed
    return np.rint((ends - np.roll(starts, -1, axis=0))[:, places] / TURN).astype(np.int64)


def winding_of(problem: OrbitProblem, u: NDArray[np.float64]) -> Mapping[str, int]:
    """Return the winding number of each angle on the orbit `u`."""
    names = [problem.system.states[place] for place in problem.system.angle_places]
    if not names:
        return MappingProxyType({})
    return MappingProxyType(dict(zip(names, turns_of(problem, u).sum(axis=0).tolist(), strict=True)))


def rotating_of(problem: OrbitProblem, u: NDArray[np.float64]) -> tuple[str, ...]:
    """Return the angles that rotate on the orbit `u`."""
    return tuple(name for name, turns in winding_of(problem, u).items() if turns)


def unwrapped(problem: OrbitProblem, u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the orbit `u` with its angles on one sheet: only its last segment closes by whole turns.

    The first segment starts between -pi and pi. Nothing changes without angles.
    """
    places = problem.system.angle_places
    if not places.size:
        return u
    turns = turns_of(problem, u)
    moved = u.copy()
    blocks = moved[: problem.size].reshape(problem.segments, problem.n + 1)
    blocks[1:, places] += TURN * np.cumsum(turns, axis=0)[:-1]
    blocks[:, places] += (wrapped(blocks[0], places) - blocks[0])[places]
    return moved
