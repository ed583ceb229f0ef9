"""The two directions of a curve from its start, with their special points, and how they are joined."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from saltus.continuation.core.zero_problem import Examined, Point
from saltus.continuation.results.special_points import SpecialPoint, SpecialPoints
from saltus.scales import SAME_POINT

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.core.closing import Passed
    from saltus.continuation.core.monitor import Monitor
    from saltus.continuation.problems.ends.connection import Homoclinic

__all__ = ["BothSides", "Found", "OneSide", "join", "traced", "turned"]

Start = TypeVar("Start")


@dataclass(frozen=True, eq=False)
class Found:
    """A special point of one direction."""

    name: str  # type, or the name of a user's event
    solution: Any  # the solution there; an orbit in the signature in which it is shown
    value: float  # test function
    after: int  # number of points of the direction before it
    arc: float  # arclength from the start
    # of, tangent, kind, scale, homoclinic: as in `SpecialPoint`
    of: str = ""
    tangent: NDArray[np.float64] | None = None
    kind: str = ""
    scale: NDArray[np.float64] | None = None
    homoclinic: Homoclinic | None = None


@dataclass
class OneSide:
    """Points and special points of one direction of a curve, and why it ended."""

    start: tuple[Any, Point]  # equations and point at which the curve starts
    first: Point  # the same point, its tangent in this direction
    points: list[Any] = field(default_factory=list)  # equations and point of each further point
    specials: list[Found] = field(default_factory=list)  # special points, in order
    stopped: str = ""  # why the direction ended; empty while it is followed
    # closed, interrupted: whether it came back to its start; whether the user ended it
    closed: bool = False
    interrupted: bool = False

    def closed_at(self, met: Passed, piece: Any) -> bool:
        """End at the start, as it was met in the last step; return True."""
        self.end_at(met.arc)
        self.points.append((piece, replace(self.start[1], u=met.point.u)))
        return True

    def end_at(self, arc: float) -> None:
        """Leave out special points behind the start, to which the direction has come back, and those at it twice."""
        at_start = {found.name for found in self.specials if found.arc < SAME_POINT}
        self.specials = [
            found
            for found in self.specials
            if found.arc < arc - SAME_POINT or (found.arc <= arc + SAME_POINT and found.name not in at_start)
        ]


@dataclass
class BothSides:
    """Both directions of a curve in one order."""

    rows: list[Any]  # equations and point of each point of the curve
    arcs: list[float]  # arclength of each, from the start
    specials: list[tuple[Found, float, float]]  # special points, in order along the curve
    offset: int  # index of the start among the rows
    stopped: tuple[str, str]  # why the curve ended, at its first and at its last point

    def special_points(self, varied: tuple[str, ...], locus: str = "") -> SpecialPoints[Any]:
        """Return the special points, numbered by type."""
        counts: dict[str, int] = {}
        points: list[SpecialPoint[Any]] = []
        for found, position, arc in self.specials:
            counts[found.name] = counts.get(found.name, 0) + 1
            label = f"{found.name}{'_' if locus and found.name[-1].isdigit() else ''}{counts[found.name]}"
            points.append(
                SpecialPoint(
                    found.name, label, found.solution, found.value, position, arc - self.arcs[0], varied, found.of,
                    locus, found.tangent, found.kind, found.scale, found.homoclinic,
                )
            )  # fmt: skip
        return SpecialPoints(points, varied)

    def ends(self) -> dict[str, Any]:
        """Return the fields of a curve of any kind that tell of its length and its ends."""
        return {"arclength": np.array(self.arcs) - self.arcs[0], "stopped": self.stopped}


def traced(
    start: Start, again: Callable[[], Start], trace: Callable[[Start, float], OneSide], directions: str
) -> list[OneSide]:
    """Return the wanted directions of a curve; the second is left out if the first is closed or interrupted.

    The second direction begins anew, from the same data as the first: meshes, sizes and units that equations and
    points have at the end of one direction are none of the other's. A parameter that turns at the very end of a curve,
    as where it is tangent to another one, is no turning point: nothing comes behind it.

    Parameters
    ----------
    start : Start
        Where the first direction starts.
    again : callable
        Makes the start anew.
    trace : callable
        Follows the curve in one direction, given its start and the sign of the start's tangent.
    directions : {"both", "up", "down"}
        The wanted directions.
    """
    halves: list[OneSide] = []
    for sign in {"both": (-1.0, 1.0), "up": (1.0,), "down": (-1.0,)}[directions]:
        if halves and (halves[0].closed or halves[0].interrupted):
            break
        half = trace(again() if halves else start, sign)
        if not half.closed and half.points:
            end = half.points[-1][1].arc
            half.specials = [
                found for found in half.specials if found.name != "TP" or abs(found.arc - end) > SAME_POINT
            ]
        halves.append(half)
    return halves


def turned(point: Point, sign: float, odd: Collection[Monitor]) -> Point:
    """Return a point; where `sign` < 0, its tangent and the monitor functions named in `odd` are reversed.

    So are those of extrema, which are derivatives along the tangent.
    """
    if sign >= 0.0:
        return point
    known = point.examined.monitors.items()
    monitors = {name: -value if name in odd or name.kind == "EX" else value for name, value in known}
    examined = Examined(monitors, point.examined.fault, point.examined.data)
    return replace(point, tangent=-point.tangent, sign=-point.sign, examined=examined)


def join(start: Any, halves: list[OneSide], what: str) -> BothSides:
    """Join the directions from the row `start`: the first reversed, then the second; `what` names the curve.

    A direction that comes back to the start is the whole curve, wherever the other one got stuck on it.
    """
    halves = [half for half in halves if half.closed] or halves
    rows, arcs, offset = [start], [0.0], 0
    specials: list[tuple[Found, float, float]] = []
    if len(halves) == 2:
        back = halves[0]
        offset = len(back.points)
        rows = [*reversed(back.points), start]
        arcs = [-point.arc for _, point in rows]
        specials = [(found, offset - found.after - 0.5, -found.arc) for found in reversed(back.specials)]
    ahead = halves[-1]
    rows += ahead.points
    arcs += [point.arc for _, point in ahead.points]
    if ahead.closed:
        arcs[-1] = arcs[-2]  # the last point is the start again
    specials += [(found, offset + found.after + 0.5, found.arc) for found in ahead.specials]
    reasons = [half.stopped for half in halves]
    stopped = (reasons[0], reasons[1]) if len(reasons) == 2 else ("the start", reasons[0])
    if halves[0].closed:
        stopped = (f"the {what} is closed", f"the {what} is closed")
    return BothSides(rows, arcs, specials, offset, stopped)
