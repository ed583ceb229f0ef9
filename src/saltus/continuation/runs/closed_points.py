"""The special points of a branch of orbits that has come back to its start, each once."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.problems.ends.closure import alongside
from saltus.scales import SAME_POINT

if TYPE_CHECKING:
    from saltus.continuation.problems.orbit import OrbitZeroProblem
    from saltus.continuation.runs.two_sided import Found, OneSide

__all__ = ["points_when_closed"]


def points_when_closed(half: OneSide, branch: OrbitZeroProblem, arc: float) -> list[Found]:
    """Return the special points of a branch that passes its start in a step, without those of its first step.

    A start that is special is located within its error on either side: in the first step, in the last one, or in both.

    Parameters
    ----------
    half : OneSide
        The branch without the step.
    branch : OrbitZeroProblem
        Equations of the step.
    arc : float
        Arclength at which the step passes the start.
    """
    count = len(half.points)
    kept = [found for found in half.specials if found.after < count or found.arc < arc]
    first = [found for found in kept if found.after == 0]
    return [found for found in kept if found.after < count or not any(_same(branch, found, other) for other in first)]


def _same(branch: OrbitZeroProblem, found: Found, other: Found) -> bool:
    """Return whether two special points of a branch are one, within the error of both."""
    u, known = found.solution.unknowns, other.solution.unknowns
    if found is other or found.name != other.name or u.shape != known.shape or u.size != branch.problem.size:
        return False
    apart = np.abs(alongside(branch.problem, known, u) - u) / branch.scale()[:-1]
    return bool(np.max(apart) < max(SAME_POINT, branch.problem.tol))
