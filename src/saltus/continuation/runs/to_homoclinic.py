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

__all__ = ["end_unbounded"]


# why no homoclinic orbit is located where none is to be expected
_CANARD = (NONE_NEAR, NO_SADDLE)


def end_unbounded(half: OneSide, interest: Interest) -> tuple[str, bool]:
    """Append the long cycles at the end of a branch, and its point HOM or SNIC.

    Return why the branch ends, and whether there is such a point.

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
        return f"the period grows while the parameter rests (T = {period:.6g}); {found}, as on a canard", False
    if isinstance(found, str):
        return f"{told(period)}; no homoclinic orbit is located: {found}", False
    failed = ""
    if found.arc is not None:
        longest = LONGEST * period_of(*half.points[0])
        for item in long_cycles(found.arc, interest, half.points[-1][1], period, longest):
            if isinstance(item, str):
                failed = item
            else:
                half.points.append(item)
        if failed and period_of(*half.points[-1]) == period:
            return f"{told(period)}; no homoclinic orbit is located: {failed}", False
    piece, point = half.points[-1]
    data = point.examined.data
    orbit = orbit_at(piece.problem, point.u, point.J, data.survey, data.told)
    half.specials.append(Found(found.type, orbit, found.error, len(half.points) - 1, point.arc, homoclinic=found.end))
    return told(period_of(piece, point)) + (f"; {failed}" if failed else ""), True
