"""Ends of branches whose period grows without bound, or whose flow needs too many steps.

docs/theory/continuation.md, "How a branch ends", lists the cases.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus.orbits.signature import CUT_END

if TYPE_CHECKING:
    from saltus.continuation.orbit_problem import OrbitZeroProblem
    from saltus.continuation.zero_problem import Point
    from saltus.orbits.problem import OrbitProblem

    Row = tuple[OrbitZeroProblem, Point]

__all__ = ["LONGEST", "grows_at_last", "grows_for_ever", "period_of", "swells_at_last", "told", "too_stiff"]

_GROWN = 1.2  # least ratio of an unbounded period to its least value on the branch
_RESTS = 1e-3  # change of the parameter, over its interval and the period's relative growth, up to which it rests
_SWOLLEN = 1e4  # least ratio of a state's unbounded range to its least on the branch
LONGEST = 1e3  # ratio of the period to that of the first point at which a branch is ended
_LATE = 1.5  # ratio by which the period of an orbit in pieces must grow while the parameter rests
_RESTING = 3e-6  # change of the parameter, over its range on the branch, up to which it rests during that growth


def grows_at_last(points: list[Row]) -> str | None:
    """Return the reason, after a failed step, that the period grows without bound; None if it does not.

    Over the last four points the period grew, and at the last step the parameter hardly moved.
    """
    if len(points) < 4:
        return None
    periods = [period_of(*row) for row in points]
    before, last = periods[-2:]
    moved = abs(points[-1][1].parameter - points[-2][1].parameter)
    growing = periods[-4] < periods[-3] < before < last and last > _GROWN * min(periods)
    return told(last) if growing and moved < _RESTS * (last / before - 1.0) else None


def swells_at_last(points: list[Row]) -> str | None:
    """Return the reason, after a failed step, that the orbit grows without bound; None if it does not.

    Over the last four points a state's range grew, to many times its least on the branch, while the parameter rested.
    """
    if len(points) < 4:
        return None
    n = len(points[-1][0].problem.system.states)
    surveys = [point.examined.data.survey for _, point in points]
    ranges = np.array([survey.highs[:n] - survey.lows[:n] for survey in surveys])
    swollen = np.all(np.diff(ranges[-4:], axis=0) > 0.0, axis=0) & (ranges[-1] > _SWOLLEN * ranges.min(axis=0))
    values = [point.parameter for _, point in points[-4:]]
    if not np.any(swollen) or max(values) - min(values) > _RESTS * _RESTS:
        return None
    largest = int(np.argmax(ranges[-1] / ranges.min(axis=0)))
    name = points[-1][0].problem.system.states[largest]
    return f"the orbit grows without bound ({name} ranges over {ranges[-1][largest]:.3g})"


def grows_for_ever(points: list[Row]) -> str | None:
    """Return the reason, after a successful step, that the period grows without bound; None if it does not.

    The period is a thousand times the first one and grows, or an orbit in pieces grew by half while the parameter
    rested. Both happen next to a homoclinic orbit.
    """
    branch, last = points[-1]
    period = period_of(branch, last)
    if len(points) > 1 and period > LONGEST * period_of(*points[0]) and period > period_of(*points[-2]):
        return told(period)
    if CUT_END not in branch.problem.signature.kinds:
        return None
    values = [point.parameter for _, point in points]
    late = [point.parameter for piece, point in points if period_of(piece, point) * _LATE > period]
    if len(late) == len(points) or max(late) - min(late) > _RESTING * (max(values) - min(values)):
        return None
    return told(period)


def too_stiff(problem: OrbitProblem) -> str | None:
    """Return the reason that a segment's flow needs more steps than allowed; None if it does not."""
    if not problem.stiff:
        return None
    return (
        f"the flow is stiff: explicit steps stay stable only if one segment takes some {problem.steps:d} of them; "
        "go on with the reduced system, in which the fastest state follows the others"
    )


def period_of(piece: OrbitZeroProblem, point: Point) -> float:
    """Return the period of an orbit of a branch."""
    return float(point.u[piece.n : piece.problem.size : piece.n + 1].sum())


def told(period: float) -> str:
    """Return the sentence with which a branch ends whose period grows without bound."""
    return f"the period grows without bound (T = {period:.6g})"
