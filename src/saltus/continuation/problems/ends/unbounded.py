"""Ends of branches that grow without bound, in period or in size, shrink to nothing, or need too many steps.

docs/theory/continuation.md, "How a branch ends", lists the cases.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.scales import (
    BESIDE_TWO_FOLD,
    EXTREMES_ALIKE,
    LEVELS_OFF,
    PARAMETER_STILL,
    PERIOD_GROWN,
    PERIOD_LONGER,
    RANGE_FAINT,
    RANGE_SWOLLEN,
    RESTS_IN_PIECES,
    RESTS_WHILE_LONGER,
    VANISHED_ON_BRANCH,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.core.zero_problem import Point
    from saltus.continuation.problems.orbit import OrbitZeroProblem
    from saltus.orbits.problem import OrbitProblem

    Row = tuple[OrbitZeroProblem, Point]

__all__ = [
    "LONGEST",
    "grows_at_last",
    "grows_for_ever",
    "levels_off",
    "meets_two_fold",
    "perhaps_grows_for_ever",
    "period_of",
    "swells_at_last",
    "swells_for_ever",
    "told",
    "too_stiff",
    "vanishes_at_last",
]

_DECADES = 2.0 * math.log(10.0)  # logarithm of the ratio of slopes over which the growth of the period is judged
_FEWEST = 4  # steps over which it can be
_ENDLESS = 5e6  # ratio of a state's range to that of the first point at which a branch is ended
LONGEST = 1e3  # ratio of the period to that of the first point at which a branch is ended
_LATE = 1.5  # ratio by which the period of an orbit in pieces must grow while the parameter rests


def grows_at_last(points: list[Row]) -> bool:
    """Return whether, after a failed step, the period seems to grow without bound.

    Over the last four points the period grew, and at the last step the parameter hardly moved.
    """
    if len(points) < 4:
        return False
    periods = [period_of(*row) for row in points]
    before, last = periods[-2:]
    values = [point.parameter for _, point in points]
    moved = abs(values[-1] - values[-2])
    growing = periods[-4] < periods[-3] < before < last and last > PERIOD_GROWN * min(periods)
    rests = growing and moved < RESTS_WHILE_LONGER * (last / before - 1.0)
    return rests and not levels_off(np.array(values), np.array(periods))


def levels_off(values: NDArray[np.float64], periods: NDArray[np.float64]) -> bool:
    """Return whether a period that grows ever faster with the parameter goes to an end of its own.

    Next to a homoclinic orbit the period is like the logarithm of the distance, or grows faster. It gains at least as
    much in each decade of its slope as in the one before. Next to a fold or a grazing it is like a constant less the
    root of the distance. There it gains a tenth of that.

    Parameters
    ----------
    values, periods : ndarray, shape (points,)
        Parameter and period along the branch.

    Examples
    --------
    >>> distance = 0.5 ** np.arange(40)
    >>> levels_off(-distance, -np.log(distance)), levels_off(-distance, 7.0 - np.sqrt(distance))
    (False, True)
    """
    gained, moved = np.diff(periods), np.abs(np.diff(values))
    with np.errstate(divide="ignore"):
        steep = np.log(np.abs(gained)) - np.log(moved)
    falls = np.flatnonzero((gained <= 0.0) | ~np.isfinite(steep))
    first = int(falls[-1]) + 1 if falls.size else 0
    heights, steep = 0.5 * (periods[first:-1] + periods[first + 1 :]), np.maximum.accumulate(steep[first:])
    if steep.size < _FEWEST or (span := min(float(steep[-1] - steep[0]), _DECADES)) < 0.5 * _DECADES:
        return False
    early, middle = np.interp([steep[-1] - span, steep[-1] - 0.5 * span], steep, heights)
    return bool((heights[-1] - middle) < math.exp(-LEVELS_OFF * span) * (middle - early))


def swells_at_last(points: list[Row]) -> str | None:
    """Return the reason, after a failed step, that the orbit grows without bound; None if it does not.

    Over the last four points a state's range grew, to many times its least on the branch. Or the state went away from
    the first orbit, to many times its size there. Meanwhile the parameter rested.
    """
    if len(points) < 4:
        return None
    values = [point.parameter for _, point in points[-4:]]
    if max(values) - min(values) > RESTS_WHILE_LONGER * RESTS_WHILE_LONGER:
        return None
    lows, highs = _extents(points)
    ranges, reaches, size = highs - lows, _reaches(lows, highs), _size(lows, highs)
    names = points[-1][0].problem.system.states
    for sizes, least, verb in (
        (ranges, np.maximum(ranges.min(axis=0), RANGE_FAINT * size.max()), "ranges over"),
        (reaches, size, "moves by"),
    ):
        swollen = np.all(np.diff(sizes[-4:], axis=0) > 0.0, axis=0) & (sizes[-1] > RANGE_SWOLLEN * least)
        if np.any(swollen):
            largest = int(np.argmax(np.where(swollen, sizes[-1] / least, 0.0)))
            return f"the orbit grows without bound ({names[largest]} {verb} {sizes[-1][largest]:.3g})"
    return None


def swells_for_ever(points: list[Row]) -> str | None:
    """Return the reason, after a successful step, that the orbit grows without bound; None if it does not.

    A state's range is many times that of the first point, or the state is as far away from there. Beyond, the flow's
    tolerance moves the parameter by more than the branch does.
    """
    from saltus.orbits.kernels import sizes as kernels

    count = len(points[-1][0].problem.system.states)
    before, now = ((s.lows, s.highs) for s in (row[1].examined.data.survey for row in (points[0], points[-1])))
    return swells_at_last(points) if kernels.swollen(before, now, count, _ENDLESS, RANGE_FAINT) else None


def _extents(points: list[Row]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the least and the greatest values of the states at points of a branch, each shape (points, states)."""
    n = len(points[-1][0].problem.system.states)
    surveys = [point.examined.data.survey for _, point in points]
    return np.array([survey.lows[:n] for survey in surveys]), np.array([survey.highs[:n] for survey in surveys])


def _reaches(lows: NDArray[np.float64], highs: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the ranges of states over each orbit and the first one together."""
    return np.asarray(np.maximum(highs, highs[0]) - np.minimum(lows, lows[0]))


def _size(lows: NDArray[np.float64], highs: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the largest moduli of states on the first orbit; a state that is 0 there counts as a small one."""
    sizes = np.maximum(np.abs(lows[0]), np.abs(highs[0]))
    return np.asarray(np.maximum(sizes, RANGE_FAINT * float(sizes.max()) or 1e-300))


def vanishes_at_last(points: list[Row]) -> str | None:
    """Return the reason, after a failed step, that the orbit shrinks to nothing; None if it does not.

    Over the last four points the period and all ranges of states fell, to a small share of the largest on the branch.
    """
    if len(points) < 4 or (system := points[-1][0].problem.system).phase is not None:
        return None
    n = len(system.states)
    surveys = [point.examined.data.survey for _, point in points]
    sizes = np.array([survey.highs[:n] - survey.lows[:n] for survey in surveys])
    sizes = np.column_stack([sizes, [period_of(*row) for row in points]])
    falling = np.all(np.diff(sizes[-4:], axis=0) <= 0.0)
    if not (falling and np.all(sizes[-1] <= VANISHED_ON_BRANCH * sizes.max(axis=0))):
        return None
    return f"the cycle shrinks to nothing (T = {sizes[-1, -1]:.3g})"


def grows_for_ever(points: list[Row]) -> bool:
    """Return whether, after a successful step, the period grows without bound for sure.

    It alone grew, all else stood still. Or it is a thousand times the first one, and grew by half while the parameter
    rested.
    """
    branch, last = points[-1]
    if _only_the_period_grows(points):
        return True
    period = period_of(branch, last)
    long = len(points) > 1 and period > LONGEST * period_of(*points[0]) and period > period_of(*points[-2])
    return long and _rests_while_longer(points, RESTS_WHILE_LONGER)


def perhaps_grows_for_ever(points: list[Row]) -> bool:
    """Return whether, after a successful step, a homoclinic orbit may be near, where it has not been looked for yet.

    The orbit is in pieces, and its period grew by half while the parameter rested. So it does along a canard. A look
    that finds nothing is made again where the period has grown by half again.
    """
    if len(points) < 2 or not points[-1][0].problem.signature.is_cut:
        return False
    if not _rests_while_longer(points, RESTS_IN_PIECES):
        return False
    first, before, last = (math.log(period_of(*row)) for row in (points[0], points[-2], points[-1]))
    halves = [math.floor((value - first) / math.log(_LATE)) for value in (before, last)]
    return halves[0] < halves[1] or not _rests_while_longer(points[:-1], RESTS_IN_PIECES)


def _rests_while_longer(points: list[Row], share: float) -> bool:
    """Return whether the parameter moved by no more than a share of its range while the period grew by half."""
    period, values = period_of(*points[-1]), [point.parameter for _, point in points]
    late = [point.parameter for piece, point in points if period_of(piece, point) * _LATE > period]
    return len(late) < len(points) and max(late) - min(late) <= share * (max(values) - min(values))


def _only_the_period_grows(points: list[Row]) -> bool:
    """Return whether the period has grown while parameter and ranges of states stood still but for rounding.

    Steps along such a branch follow rounding: they may turn round, and trace it back.
    """
    branch, last = points[-1]
    if len(points) < 2 or abs(points[-2][1].parameter - last.parameter) > PARAMETER_STILL:
        return False
    period, ranges = period_of(branch, last), _ranges(branch, last)
    for piece, point in reversed(points[:-1]):
        if abs(point.parameter - last.parameter) > PARAMETER_STILL:
            return False
        if np.any(np.abs(_ranges(piece, point) - ranges) > EXTREMES_ALIKE * ranges):
            return False
        if period_of(piece, point) * PERIOD_LONGER < period:
            return True
    return False


def _ranges(piece: OrbitZeroProblem, point: Point) -> NDArray[np.float64]:
    n, survey = len(piece.problem.system.states), point.examined.data.survey
    return np.asarray(survey.highs[:n] - survey.lows[:n])


def meets_two_fold(points: list[tuple[OrbitZeroProblem, Point]]) -> str:
    """Return why sliding orbits end behind the last of some points, in words; empty where no two-fold is near.

    Where a motion leaves a sliding mode, one of the two rates of the surface vanishes. At a two-fold both do.
    """
    if not points:
        return ""
    branch, last = points[-1]
    problem, system = branch.problem, branch.problem.system
    own = [point.examined.data.survey.rates[:, 3] for piece, point in points if piece is branch]
    for i, mode in enumerate(problem.signature.modes):
        name = system.mode_names[mode]
        slides = system.modes[name].surface is not None and system.transitions[problem.signature.transitions[i]].when
        if slides and last.examined.data.survey.rates[i, 3] < BESIDE_TWO_FOLD * max(float(rates[i]) for rates in own):
            return f"segment {i} in mode {name!r} ends next to a two-fold, from which motions go on in several ways"
    return ""


def too_stiff(problem: OrbitProblem) -> str | None:
    """Return the reason that a segment's flow needs more steps than allowed; None if it does not."""
    from saltus.flow.kernels import segment as segment_kernels

    if 2 * problem.steps <= segment_kernels.MOST_STEPS:
        return None
    return (
        f"the flow is stiff, and implicit steps do not follow it: one segment takes {problem.steps:d} explicit ones; "
        "go on with the reduced system, in which the fastest state follows the others"
    )


def period_of(piece: OrbitZeroProblem, point: Point) -> float:
    """Return the period of an orbit of a branch."""
    return float(point.u[piece.n : piece.problem.size : piece.n + 1].sum())


def told(period: float) -> str:
    """Return the sentence with which a branch ends whose period grows without bound."""
    return f"the period grows without bound (T = {period:.6g})"
