"""Hits that accumulate where a branch ends: hops behind each other, each shorter and slower than the one before."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.problems.margins import without_speed
from saltus.orbits.cuts import whole
from saltus.orbits.signature import EVENT_END, MEAN_END
from saltus.scales import EXCURSION_SHORT

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.core.monitor import Monitor
    from saltus.orbits.problem import OrbitProblem
    from saltus.orbits.signature import Signature
    from saltus.system import HybridSystem

__all__ = ["accumulating"]


def accumulating(problem: OrbitProblem, u: NDArray[np.float64], grazing: Monitor | None = None) -> str | None:
    """Return in words that an orbit's last hops get shorter and slower towards a rest on their surface, or None.

    grazing: the monitor function that vanishes at the point, if any. There the last hop has to end without speed, so
    that it cannot be told which hits graze.
    """
    signature = problem.signature.whole
    if not any(_hits(problem.system, signature, i) for i in range(len(signature))):
        return None
    problem, u = whole(problem, u)
    durations = u[: problem.size].reshape(problem.segments, problem.n + 1)[:, problem.n]
    speeds = np.abs(problem.survey(u).rates[:, 0])
    slow = set(range(problem.segments))
    if grazing is not None:
        slow = {name.segment for name in without_speed(problem, u) if name != grazing}
    for i, k in enumerate(signature.transitions):
        # the hop of segment i lies between two hits
        before = (i - 1) % problem.segments
        shorter = durations[i] < durations[before] and speeds[i] < speeds[before] and i in slow
        short = shorter and durations[i] < EXCURSION_SHORT * float(durations.sum())
        if short and _hits(problem.system, signature, i):
            own = problem.system.transitions[k]
            told = f"hits of {own.name!r} accumulate"
            if not any(other.sums and other.event == own.event for other in problem.system.transitions):
                return f"{told}, and the motion comes to rest: `rests=` names a mode for it"
            if grazing is None:  # where a hit grazes, one more comes before others are summed up
                return told
    return None


def _hits(system: HybridSystem, signature: Signature, i: int) -> bool:
    """Return whether segment i lies between two hits of one transition back into its mode."""
    ends = signature.transitions
    k = ends[i]
    if k < 0 or ends[i - 1] != k or signature.kinds[i] not in (EVENT_END, MEAN_END) or len(ends) < 2:
        return False
    own = system.transitions[k]
    return own.source == own.target and bool(own.reset) and not own.sums
