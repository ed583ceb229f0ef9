"""Period doublings of a drive that repeats several times while its phase turns once.

Seen over a turn of the phase, an orbit that repeats as its drive does has powers of the multipliers of the drive's
period. One that passes -1 there has an even power that passes 1: the turn's map has a branch point. The branch that
meets there has orbits that repeat half as often. docs/theory/loci.md, "Other branches", derives the test.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus.orbits.cuts import clustered, whole
from saltus.orbits.rounds import repeats_of
from saltus.orbits.signature import PHASE_END
from saltus.system.periodicity import drive_repeats

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.orbits.problem import OrbitProblem

__all__ = ["doubles_drive"]

_STEP = 1e-4  # change of the states, over their sizes, in differences of the flow over a part of the period


def doubles_drive(problem: OrbitProblem, u: NDArray[np.float64]) -> int:
    """Return how often an orbit at a branch point repeats in a turn, if it doubles its drive's period there, else 0.

    Both directions of the branches are taken on by a part of the period. That of the orbit's own branch comes back as
    it is, and so does the other if the orbits there repeat as often. If they repeat half as often, it comes back
    reversed.
    """
    if problem.system.phase is None or problem.signature.turns != 1:
        return 0
    whole_problem, v = whole(problem, u)
    count = repeats_of(whole_problem, v)
    if count % 2 or drive_repeats(problem.system) % count:
        return 0
    size, n = whole_problem.size, whole_problem.n
    block = np.append(whole_problem.state_scale, v[n : size : n + 1].sum())
    units = np.append(np.tile(block, whole_problem.segments), 1.0)
    J = whole_problem.resolve(v)[1]
    right = np.linalg.svd(J * units)[2][-2:]
    onwards = np.array([_onwards(whole_problem, v, row * units, count) / units for row in right])
    closes = whole_problem.signature.kinds[0] == PHASE_END  # with one segment, whose phase and duration are given
    own = np.array([*range(n - 1), size] if closes else range(size + 1))
    # the trace of the map of both directions is 1 + 1, or 1 - 1
    map_of_both = np.linalg.lstsq(right[:, own].T, onwards[:, own].T, rcond=None)[0]
    problem.start(u)
    return count if float(np.trace(map_of_both)) < 1.0 else 0


def _onwards(
    problem: OrbitProblem, u: NDArray[np.float64], direction: NDArray[np.float64], count: int
) -> NDArray[np.float64]:
    """Return a direction of the unknowns after a part of the period."""
    n = problem.n
    if problem.signature.kinds[0] != PHASE_END:
        blocks = direction[: problem.size].reshape(problem.segments, n + 1)
        rolled = np.roll(blocks, -(problem.segments // count), axis=0)
        return np.append(rolled.ravel(), direction[problem.size :])
    ends = []
    step = _STEP / float(np.abs(direction[: n - 1] / problem.state_scale[: n - 1]).max())
    for sign in (-1.0, 1.0):
        problem.survey(u + sign * step * direction)
        ends.append(problem.state_on(0, clustered(1.0 / count)))
    found = direction.copy()
    found[:n] = (ends[1] - ends[0]) / (2.0 * step)
    return found
