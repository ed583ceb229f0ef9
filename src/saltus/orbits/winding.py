"""How often an orbit goes round the circles of its angles, and its starts on one sheet above them."""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from saltus.orbits.signature import TOUCH_END
from saltus.system.angles import TURN, wrapped

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from saltus.orbits.problem import OrbitProblem

__all__ = ["rotating_of", "turns_of", "unwrapped", "winding_of"]


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
