"""Where a branch ends since nothing bounds the period, towards a homoclinic orbit, or the steps of the flow."""

from __future__ import annotations

from typing import TYPE_CHECKING

from saltus.orbits.signature import CUT_END

if TYPE_CHECKING:
    from saltus.continuation.orbit_problem import OrbitZeroProblem
    from saltus.continuation.zero_problem import Point
    from saltus.orbits.problem import OrbitProblem

    Row = tuple[OrbitZeroProblem, Point]

__all__ = ["grows_at_last", "grows_for_ever", "too_stiff"]

_GROWN = 1.2  # growth of the period from its least value below which it does not count as unbounded
_RESTS = 1e-3  # change of the parameter, over its interval and the period's growth, below which the parameter rests
_LONGEST = 1e3  # growth of the period from the first point with which a branch is ended
_LATE = 1.5  # growth of the period of sensitive orbits with which a branch ends if the parameter meanwhile rests
_RESTING = 3e-6  # change of the parameter meanwhile, over its range along the branch, below which it rests


def grows_at_last(points: list[Row]) -> str | None:
    """Return in words that the period grows without bound where no further step succeeds; None where it does not.

    It has grown, and grows on while the parameter hardly moves any more.
    """
    if len(points) < 4:
        return None
    periods = [_period(*row) for row in points]
    before, last = periods[-2:]
    moved = abs(points[-1][1].parameter - points[-2][1].parameter)
    growing = periods[-4] < periods[-3] < before < last and last > _GROWN * min(periods)
    return _told(last) if growing and moved < _RESTS * (last / before - 1.0) else None


def grows_for_ever(points: list[Row]) -> str | None:
    """Return in words that the period grows without bound, as to a homoclinic orbit, though further steps succeed.

    It is a thousand times the first one and grows, or that of sensitive orbits grows while the parameter rests.
    """
    branch, last = points[-1]
    period = _period(branch, last)
    if len(points) > 1 and period > _LONGEST * _period(*points[0]) and period > _period(*points[-2]):
        return _told(period)
    if CUT_END not in branch.problem.signature.kinds:
        return None
    values = [point.parameter for _, point in points]
    late = [point.parameter for piece, point in points if _period(piece, point) * _LATE > period]
    if len(late) == len(points) or max(late) - min(late) > _RESTING * (max(values) - min(values)):
        return None
    return _told(period)


def too_stiff(problem: OrbitProblem) -> str | None:
    """Return in words that a segment's flow needs more steps than it is given; None where it does not."""
    if not problem.stiff:
        return None
    return (
        f"the flow is stiff: explicit steps stay stable only if one segment takes some {problem.steps:d} of them; "
        "go on with the reduced system, in which the fastest state follows the others"
    )


def _period(piece: OrbitZeroProblem, point: Point) -> float:
    return float(point.u[piece.n : piece.problem.size : piece.n + 1].sum())


def _told(period: float) -> str:
    return f"the period grows without bound (T = {period:.6g})"
