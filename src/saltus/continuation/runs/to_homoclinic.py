"""The end of a branch of cycles whose period grows without bound: long cycles, and the point HOM or SNIC.

docs/theory/continuation.md, "Homoclinic orbits", describes it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from saltus.continuation.problems.ends.homoclinic import NONE_NEAR, located
from saltus.continuation.problems.ends.homoclinic_problem import NO_SADDLE
from saltus.continuation.problems.ends.long_cycles import long_cycles
from saltus.continuation.problems.ends.unbounded import LONGEST, period_of, told
from saltus.continuation.runs.two_sided import Found
from saltus.orbits.orbit import orbit_at

if TYPE_CHECKING:
    from saltus.continuation.core.interest import Interest
    from saltus.continuation.runs.two_sided import OneSide

__all__ = ["end_unbounded", "on_canard"]


# why no homoclinic orbit is located where none is to be expected
_CANARD = (NONE_NEAR, NO_SADDLE)


def on_canard(half: OneSide, interest: Interest) -> bool:
    """Return whether the period of the last point grows along a canard, near no equilibrium, so that cycles go on.

    A branch ends all the same at a thousand times the first period.
    """
    longest = LONGEST * period_of(*half.points[0])
    return period_of(*half.points[-1]) < longest and located(half.points, interest.low, interest.high) in _CANARD


def end_unbounded(half: OneSide, interest: Interest) -> str:
    """Append the long cycles at the end of a branch, and its point HOM or SNIC; return why the branch ends.

    Parameters
    ----------
    half : OneSide
        The direction of the branch, at whose last point the period grows without bound.
    interest : Interest
        Bounds of the branch.
    """
    period = period_of(*half.points[-1])
    found = located(half.points, interest.low, interest.high)
    if found in _CANARD:
        return f"the period grows while the parameter rests (T = {period:.6g}); {found}, as on a canard"
    if isinstance(found, str):
        return f"{told(period)}; no homoclinic orbit is located: {found}"
    failed = ""
    if found.arc is not None:
        longest = LONGEST * period_of(*half.points[0])
        for item in long_cycles(found.arc, interest, half.points[-1][1], period, longest):
            if isinstance(item, str):
                failed = item
            else:
                half.points.append(item)
        if failed and period_of(*half.points[-1]) == period:
            return f"{told(period)}; no homoclinic orbit is located: {failed}"
    piece, point = half.points[-1]
    data = point.examined.data
    orbit = orbit_at(piece.problem, point.u, point.J, data.survey, data.multipliers)
    half.specials.append(Found(found.type, orbit, found.error, len(half.points) - 1, point.arc, homoclinic=found.end))
    return told(period_of(piece, point)) + (f"; {failed}" if failed else "")
