"""The kind of a motion, from its returns to a section and its leading Lyapunov exponent.

In this order, thresholds being those of `Criteria`:

1. ``diverged``: the motion leaves every bound or the domain of its mode. ``chattering``: its events accumulate, or a
   field that jumps holds it.
2. ``no return``: it stays away from the section, a transition that no longer happens.
3. ``period-N``: it recurs after N returns, the fewest that do. The second half of the returns looked at decides: no
   state there differs from the one N returns later by more than `recurrence` of its size, or than `noise`. Or it is on
   its way there: the leading exponent is negative, and from the first half to the second the differences shrink at
   least half as fast as it says. For N > 1 they do so by a tenth, too, and are below `settling` of the points' extent;
   for N = 1 this extent shrinks with them, and they do so by a tenth, or in each return. A third way is for an exponent
   not above `exponent` and points that do not lie on a closed curve. The differences are then below `settling` of the
   extent, whether they shrink or not. N is at most a quarter of the returns looked at, so that it is seen four times.
4. ``chaotic``: the leading exponent is above `exponent` by more than its error; or it may be, and the points do not lie
   on a closed curve.
5. ``quasi-periodic``: none of these. Where a torus attracts, the motion on it locks to a long period in many small
   windows of a parameter, which no experiment resolves. A motion that recurs is therefore named so, too, if its points
   lie round a closed curve and are more than `longest`. Points in pairs, as after a period doubling, are excepted. The
   period is recorded all the same.

A circle on the section may be cut by a reset, as that of a neuron's firing is. It then lies along one state. Its points
are recognised where the map keeps their order along this state, but for whole turns.

Points on a closed curve are recognised from their middle, in the plane in which they spread most. No gap between
neighbours is wider than `gap`. The map keeps their order round the curve, but for a part `disorder` of the way that
their images go.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from saltus import checks

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["CHAOTIC", "CHATTERING", "DIVERGED", "NO_RETURN", "QUASI_PERIODIC", "Criteria", "Kind", "classify",
           "rotation_number"]  # fmt: skip

CHAOTIC = "chaotic"
CHATTERING = "chattering"
DIVERGED = "diverged"
NO_RETURN = "no return"
QUASI_PERIODIC = "quasi-periodic"
_SMALLEST = 1e-3  # size of a state, over the largest one's, below which the state is nearly zero throughout
_ENOUGH = 16  # fewest points whose order round a curve is looked at: fewer lie too far apart, unless they recur
_SHRUNK = 0.9  # ratio of differences in the later half of the returns to the earlier, up to which they shrink
_BACKWARDS = 0.01  # most disorder of points on a circle that is cut: the firing maps of neurons have none
_FRACTION = 1e-4  # distance of a rotation number from a fraction below which points may lie on several curves


@dataclass(frozen=True)
class Criteria:
    """Thresholds by which motions are told apart; they are recorded with a sweep.

    Parameters
    ----------
    recurrence : float
        Part of a state's size within which it recurs.
    noise : float
        Tolerances of a step below which a difference of a state is none: ``atol``, and ``rtol`` of its size along the
        motion. So a motion that rests where all states are 0 is seen to rest.
    settling : float
        Part of the points' extent within which a motion recurs that is still settling.
    exponent : float
        Leading Lyapunov exponent per return above which a motion is chaotic.
    longest : int
        Returns after which a motion recurs at the latest if it is to be called periodic, doublings apart.
    doubling : float
        Part of the points' extent within which they lie in pairs after a period doubling.
    gap : float
        Largest part of a turn between neighbouring points that lie on a closed curve, seen from its middle.
    disorder : float
        Largest part of the way of the points' images, from one point to the next round the curve, that goes backwards.
    fewest : int
        Returns that are looked at, at the least, however few are kept; four times `longest` if those are more.
    patience : int
        A motion that has not settled is followed up to this many times as long. So is one whose exponent differs from
        `exponent` by less than its error.
    absence : float
        Time without a return after which a motion is taken not to return. Its unit is the longer of the mean return and
        the phase's period. Before returns are known, periods alone, or 5000 steps a return.
    push : float
        Part of the size of its state by which a motion that rests on an unstable orbit is pushed.

    Examples
    --------
    >>> from saltus.options import Criteria
    >>> Criteria(longest=16).longest
    16
    """

    recurrence: float = 1e-5
    noise: float = 10.0
    settling: float = 0.01
    exponent: float = 0.02
    longest: int = 8
    doubling: float = 0.25
    gap: float = 0.3
    disorder: float = 0.2
    fewest: int = 100
    patience: int = 4
    absence: float = 3000.0
    push: float = 1e-6

    def __post_init__(self) -> None:
        for name in ("recurrence", "settling", "exponent", "doubling", "gap", "disorder", "push"):
            value = checks.between(f"Criteria.{name}", getattr(self, name), 0.0, 1.0, strict=True)
            object.__setattr__(self, name, value)
        for name in ("noise", "absence"):
            object.__setattr__(self, name, checks.positive(f"Criteria.{name}", getattr(self, name)))
        for name, least in (("longest", 1), ("fewest", _ENOUGH), ("patience", 1)):
            object.__setattr__(self, name, checks.count(f"Criteria.{name}", getattr(self, name), least))

    def looked_at(self, keep: int) -> int:
        """Return the count of returns on which a label is founded.

        Parameters
        ----------
        keep : int
            Returns that are kept.

        Returns
        -------
        int
            `keep`, 4 times `longest` or `fewest`, the largest of the three.

        Raises
        ------
        InputError
            `keep` is no count.
        """
        return max(checks.count("keep", keep), 4 * self.longest, self.fewest)


class Kind(NamedTuple):
    """What a motion is."""

    label: str  # ``period-N``, ``quasi-periodic`` or ``chaotic``
    period: int  # returns after which it recurs, 0 where it does not
    # turns round a closed curve in a return, between 0 and 1/2, where it is quasi-periodic and the points show such a
    # curve; else NaN
    rotation: float
    # closed curves that are visited in turn, 0 where there is none; `rotation` is then that of one, in `curves` returns
    curves: int


def classify(
    points: ArrayLike, exponent: float, error: float, criteria: Criteria | None = None, rounding: ArrayLike = 0.0
) -> Kind:
    """Return what a motion is.

    Parameters
    ----------
    points : array_like, shape (return, state)
        States on the section, those that come round (an angle) as their cosine and sine.
    exponent, error : float
        Leading Lyapunov exponent per return, and its error.
    criteria : Criteria, optional
        The thresholds.
    rounding : array_like, shape () or (state,), optional
        Differences of states that are none.

    Examples
    --------
    >>> turns = 2.0 * np.pi * 0.381966 * np.arange(100)
    >>> circle = np.column_stack([np.cos(turns), np.sin(turns)])
    >>> kind = classify(circle, 0.0, 0.001)
    >>> kind.label, round(kind.rotation, 6)
    ('quasi-periodic', 0.381966)
    >>> classify(np.tile([[0.2], [0.7]], (50, 1)), -0.3, 0.01).label
    'period-2'
    """
    limits = Criteria() if criteria is None else criteria
    cloud = np.asarray(points, dtype=np.float64)
    apart = _Apart(cloud, np.asarray(rounding, dtype=np.float64) / limits.recurrence)
    periods = (apart.settled(limits), apart.settling(exponent, limits))
    period = min((found for found in periods if found), default=0)
    rotation, curves = math.nan, 0
    if not period or _base(cloud, period, limits) > limits.longest:
        rotation, curves = rotation_number(cloud, limits, period)
    sure = abs(exponent - limits.exponent) > error
    if not period and not curves:
        period = apart.near(limits) if exponent <= limits.exponent else 0
        if (not period or period > limits.longest) and not (sure and exponent > limits.exponent):
            rotation, curves = _cut_circle(cloud)
            period = 0 if curves else period
    if period and not curves:
        return Kind(f"period-{period}", period, math.nan, 0)
    if not period and (exponent > limits.exponent if sure else not curves):
        return Kind(CHAOTIC, 0, math.nan, 0)
    return Kind(QUASI_PERIODIC, period, rotation, curves)


class _Apart:
    """How far points are from those some returns later, in parts of each state's size, which is its least or more."""

    def __init__(self, cloud: NDArray[np.float64], least: NDArray[np.float64]) -> None:
        size = np.maximum(np.max(np.abs(cloud), axis=0), np.ptp(cloud, axis=0))
        scaled = cloud / np.maximum(size, np.maximum(least, max(_SMALLEST * float(size.max()), 1e-300)))
        self.extent = _extent(scaled)
        half = len(scaled) // 2
        self.extents = (_extent(scaled[:half]) if half else 0.0, _extent(scaled[half:]))
        steps = np.max(np.abs(np.diff(scaled, axis=0)), axis=1)
        self.falling = bool(np.all(np.diff(steps) < 0.0))
        self.halves: list[tuple[float, float, int]] = []  # largest in the first half and the second, and their length
        for later in range(1, max(len(cloud) // 4, min(len(cloud) - 1, 1)) + 1):  # seen four times
            apart = np.max(np.abs(scaled[later:] - scaled[:-later]), axis=1)
            half = len(apart) // 2
            self.halves.append((float(apart[:half].max(initial=0.0)), float(apart[half:].max()), half))

    def settled(self, limits: Criteria) -> int:
        """Returns after which the motion recurs, 0 where it does not."""
        return next((i for i, (_, late, _) in enumerate(self.halves, 1) if late <= limits.recurrence), 0)

    def settling(self, exponent: float, limits: Criteria) -> int:
        """Returns after which it will recur, by the shrinking of the differences; 0 where they do not shrink."""
        if not exponent < 0.0:
            return 0
        for i, (early, late, half) in enumerate(self.halves, 1):
            shrunk = math.exp(0.5 * exponent * half)
            if not (i == 1 and self.falling):
                shrunk = min(shrunk, _SHRUNK)
            near = late <= limits.settling * self.extent if i > 1 else self.extents[1] <= self.extents[0] * shrunk
            if near and half and late <= early * shrunk:
                return i
        return 0

    def near(self, limits: Criteria) -> int:
        """Returns after which it recurs but for `settling`, 0 where it does not."""
        return next((i for i, (_, late, _) in enumerate(self.halves, 1) if late <= limits.settling * self.extent), 0)


def _extent(cloud: NDArray[np.float64]) -> float:
    return float(np.ptp(cloud, axis=0).max())


def _base(cloud: NDArray[np.float64], period: int, limits: Criteria) -> int:
    """The period before its doublings."""
    points = cloud[-period:]
    extent = max(_extent(points), 1e-300)
    base = period
    while base % 2 == 0 and base > limits.longest:
        turned = np.roll(points, base // 2, axis=0)
        if float(np.max(np.abs(turned - points))) > limits.doubling * extent:
            break
        base //= 2
    return base


def rotation_number(points: ArrayLike, criteria: Criteria | None = None, period: int = 0) -> tuple[float, int]:
    """Return the turns in a return round a closed curve, and how many curves are visited in turn.

    The points are seen from their middle, in the plane in which they spread most; the mean of their angles' increments
    is weighted so that it converges faster than any power of their count where the motion is quasi-periodic.

    Parameters
    ----------
    points : array_like, shape (return, state)
        States on the section.
    criteria : Criteria, optional
        What a closed curve is: `gap` and `disorder`; and how many curves there are at most, `longest`.
    period : int, optional
        Returns after which the points recur, 0 where they do not.

    Returns
    -------
    rotation : float
        Between 0 and 1/2, the side from which the curve is seen being left open; NaN where there is no closed curve.
        With several curves, the turns round one of them in as many returns.
    curves : int
        0 where there is none.

    References
    ----------
    S. Das, Y. Saiki, E. Sander, J. A. Yorke, Quantitative quasiperiodicity, Nonlinearity 30 (2017) 4111-4140.
    """
    limits = Criteria() if criteria is None else criteria
    cloud = np.asarray(points, dtype=np.float64)
    first: tuple[float, int] = (math.nan, 0)
    wanted = list(range(1, limits.longest + 1)) if cloud.shape[1] > 1 else []
    while wanted:
        curves = wanted.pop(0)
        if period and (period % curves or period // curves <= limits.longest):
            continue  # too few points on each curve to tell one
        distinct = period // curves
        if found := _turns_of_each(cloud, curves, limits, distinct):
            rotation = float(np.mean(found))
            parts = rotation * np.arange(1, limits.longest + 1)
            as_good_as = np.flatnonzero(np.abs(parts - np.round(parts)) < _FRACTION)
            if not as_good_as.size:
                return rotation, curves
            if not first[1]:
                first = (rotation, curves)
            # as good as a fraction: every curve, or every second, third ..., seen from the middle of them all
            parts_seen = int(as_good_as[0] + 1)
            counts = {parts_seen * i for i in range(1, curves + 1) if curves % i == 0}
            wanted = sorted(count for count in counts if count != curves and count <= limits.longest)
    return first


def _turns_of_each(cloud: NDArray[np.float64], curves: int, limits: Criteria, distinct: int) -> list[float]:
    """Turns round each of so many curves that are visited in turn; empty where one of them is not closed."""
    found = []
    for i in range(curves):
        turns = _turns(cloud[i::curves], limits, distinct)
        if turns is None:
            return []
        found.append(turns)
    return found


def _turns(points: NDArray[np.float64], limits: Criteria, distinct: int) -> float | None:
    """Turns in a step round one closed curve, None where the points do not show one; `distinct` of them, 0 for all."""
    spread = points.std(axis=0) if len(points) > 2 else np.zeros(1)
    wide = spread > _SMALLEST * spread.max() if spread.max() > 0.0 else spread > 0.0
    if wide.sum() < 2 or (len(points) < _ENOUGH and not distinct):
        return None
    scaled = (points - points.mean(axis=0))[:, wide] / spread[wide]
    plane = np.linalg.svd(scaled, full_matrices=False)[2][:2]
    angles = np.arctan2(scaled @ plane[1], scaled @ plane[0]) / (2.0 * math.pi)
    ordered = np.sort(angles[-distinct:])
    if max(float(np.diff(ordered).max(initial=0.0)), ordered[0] + 1.0 - ordered[-1]) > limits.gap:
        return None
    if _disorder(angles[-distinct:]) > limits.disorder:
        return None
    increments = np.diff(angles)
    # each increment is known up to whole turns: all are taken from the one turn about their mean direction
    mean = np.angle(np.exp(2j * math.pi * increments).sum()) / (2.0 * math.pi)
    increments = mean + (increments - mean + 0.5) % 1.0 - 0.5
    turns = _weighted_mean(increments) % 1.0
    return float(min(turns, 1.0 - turns))


def _cut_circle(cloud: NDArray[np.float64]) -> tuple[float, int]:
    """Rotation number, and 1, where the points lie on a circle that a reset has cut; NaN and 0 where they do not.

    The circle then lies along one of the states, its ends being one place. A map that keeps the order of the points
    round it is invertible there, and not chaotic.
    """
    if len(cloud) < _ENOUGH:
        return math.nan, 0
    for column in cloud.T[np.ptp(cloud, axis=0) > 0.0]:
        angles = np.argsort(np.argsort(column, kind="stable"), kind="stable") / column.size
        if _disorder(angles) <= _BACKWARDS:
            turns = _weighted_mean(np.diff(angles) % 1.0) % 1.0
            return min(turns, 1.0 - turns), 1
    return math.nan, 0


def _disorder(angles: NDArray[np.float64]) -> float:
    """Part of the way backwards when the points are gone through round the curve and their images are watched."""
    images = angles[1:][np.argsort(angles[:-1], kind="stable")]
    steps = (np.diff(np.append(images, images[0])) + 0.5) % 1.0 - 0.5
    backwards = min(float(-steps[steps < 0.0].sum()), float(steps[steps > 0.0].sum()))
    return backwards / max(float(np.abs(steps).sum()), 1e-300)


def _weighted_mean(values: NDArray[np.float64]) -> float:
    """Mean with the weights exp(-1 / (s (1 - s))), s from 0 to 1 along the values (Das et al. 2017)."""
    s = np.arange(1, values.size + 1) / (values.size + 1.0)
    weights = np.exp(-1.0 / (s * (1.0 - s)))
    return float(weights @ values / weights.sum())
