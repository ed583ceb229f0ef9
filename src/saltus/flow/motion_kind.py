"""The kind of a motion, from its returns to a section and its leading Lyapunov exponent.

In this order, thresholds being those of `Criteria`:

1. ``diverged``: the motion leaves every bound or the domain of its mode. ``chattering``: its events accumulate, or a
   field that jumps holds it.
2. ``no return``: it stays away from the section, a transition that no longer happens.
3. ``period-N``: it recurs after N returns, the fewest that do. The second half of the returns looked at decides: no
   state there differs from the one N returns later by more than `recurrence` of its size, or than `noise`. These
   differences do not add up from each N returns to the next. Or the motion is on its way there: the leading exponent is
   negative, and the differences shrink at a steady rate. From the first half to the second they do so at half the
   exponent or faster. They have halved, or little is left to go. For N > 1 they are below `settling` of the points'
   extent. Where they shrink after N returns and after 2 N, the rates tell which is the period, or leave both open:
   `saltus.flow.recurring.rivals`. N is at most a quarter of the returns looked at, so that it is seen four times.
4. ``locked-N``: it recurs after N returns, more than `longest`, and winds round a closed curve. A locked motion on a
   torus does. Points in pairs, as after a period doubling, are counted once. The rotation number is a fraction.
5. ``chaotic``: the leading exponent is above 0 by more than twice its error, which chance seldom leaves. Perturbations
   grow by more than the count of returns. Such a motion may recur within `recurrence`, in narrow bands, but not within
   rounding.
6. ``quasi-periodic``: the leading exponent is 0 within its error, and no count of returns recurs. The points are
   smooth, by means that converge fast (`saltus.flow.recurring.smoothness`). Or they lie on closed curves, which have a
   length, and do not drift.
7. ``strange nonchaotic``: the exponent is 0 within its error, and above 0 by half of it at most. The points go round a
   circle over which they are nowhere smooth, and do not drift.
8. ``unresolved``: none of these can be told. More returns may tell.

`saltus.flow.recurring.recurrence` counts returns. `saltus.flow.recurring.closed_curves` finds curves and rotation
numbers.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from saltus.flow.recurring.closed_curves import cut_circle, has_length, locked_turns, rotation_number
from saltus.flow.recurring.criteria import Criteria
from saltus.flow.recurring.recurrence import Recurrence
from saltus.flow.recurring.smoothness import course_of, is_rough
from saltus.scales import BY_CHANCE, EPS, Verdict, zero

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = [
    "CHAOTIC", "CHATTERING", "DIVERGED", "NO_RETURN", "QUASI_PERIODIC", "STRANGE", "UNRESOLVED", "Kind", "classify",
]  # fmt: skip

CHAOTIC = "chaotic"
CHATTERING = "chattering"
DIVERGED = "diverged"
NO_RETURN = "no return"
QUASI_PERIODIC = "quasi-periodic"
STRANGE = "strange nonchaotic"
UNRESOLVED = "unresolved"
_TAILS = (4, 16)  # of the points, the last parts that are looked at by themselves


class Kind(NamedTuple):
    """What a motion is."""

    label: str
    period: int  # returns after which it recurs, 0 where it does not
    # turns round a closed curve in a return, between 0 and 1/2, where it is quasi-periodic or locked and the points
    # show such a curve; else NaN
    rotation: float
    # closed curves that are visited in turn, 0 where there is none; `rotation` is then that of one, in `curves` returns
    curves: int
    sure: bool = True  # False of a period on the way to which the motion has not come far
    unstable: bool = False  # True of a smooth torus from which perturbations grow
    rivals: tuple[int, int] = (0, 0)  # counts of returns either of which may be the period, where that is all


def classify(
    points: ArrayLike,
    exponent: float,
    error: float,
    criteria: Criteria | None = None,
    rounding: ArrayLike = 0.0,
    *,
    autonomous: bool = False,
) -> Kind:
    """Return what a motion is.

    Parameters
    ----------
    points : array_like, shape (return, state)
        States on the section, those that come round (an angle) as their cosine and sine.
    exponent, error : float
        Leading Lyapunov exponent per return, and its error; what the steps do to it is part of the error.
    criteria : Criteria, optional
        The thresholds.
    rounding : array_like, shape () or (state,), optional
        Differences of states that are none.
    autonomous : bool, optional
        Whether an exponent of 0 may be that of the flow's direction, so that differences shrink at any rate.

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
    within = np.broadcast_to(np.asarray(rounding, dtype=np.float64), cloud.shape[1:])
    recurrence = Recurrence(cloud, within, limits.recurrence)
    settled = recurrence.settled(limits.recurrence)
    rates = exponent, -math.inf if autonomous else exponent - error, exponent + max(error, EPS * len(cloud))
    may_come = exponent < 0.0 or (autonomous and exponent <= error)
    coming, at_the_end = _coming(cloud, within, rates, limits) if may_come else (0, recurrence)
    period = min((found for found in (settled, coming) if found), default=0)
    if coming and period != settled:
        period, rival = at_the_end.least(coming)
        if rival:
            return Kind(UNRESOLVED, 0, math.nan, 0, rivals=(period, rival))
    if period and exponent > error and not recurrence.leaves(period, exponent):
        period = Recurrence(cloud, within, EPS).settled(EPS)  # chaos may keep to bands as narrow as this
    if not period:
        return _aperiodic(cloud, exponent, error, limits)
    rotation, curves = locked_turns(cloud, limits, period)
    return Kind(
        f"{'locked' if curves else 'period'}-{period}",
        period,
        rotation,
        curves,
        period == settled or at_the_end.has_shrunk(period),
    )


def _coming(
    cloud: NDArray[np.float64], rounding: NDArray[np.float64], rates: tuple[float, float, float], limits: Criteria
) -> tuple[int, Recurrence]:
    """Return the count of returns after which a motion will recur, 0 for none, and the points that show it.

    Differences that shrink like a power of time do so at no steady rate over them all, but over the last of them.
    """
    parts = [
        Recurrence(cloud[-(len(cloud) // part) :], rounding, limits.recurrence) for part in _parts(len(cloud), limits)
    ]
    for recurrence in parts:
        if coming := recurrence.settling(rates, limits.settling, limits.recurrence):
            return coming, recurrence
    return 0, parts[0]


def _parts(count: int, limits: Criteria) -> list[int]:
    """Return by what the count of points is divided, where enough of them are left."""
    return [1, *(part for part in _TAILS if count // part >= limits.looked_at(1))]


def _aperiodic(cloud: NDArray[np.float64], exponent: float, error: float, limits: Criteria) -> Kind:
    """Return what a motion is that does not recur."""
    # what grows like time, as on the tori of a shear, has no exponent; a sum of logarithms rounds like their count
    chance = BY_CHANCE * error
    error = max(error, math.log(len(cloud)) / len(cloud) if exponent > 0.0 else EPS * len(cloud))
    if exponent > max(error, chance):
        smooth = course_of(cloud).smooth
        return Kind(UNRESOLVED if smooth else CHAOTIC, 0, math.nan, 0, unstable=smooth)
    if zero(exponent, error) is not Verdict.YES:
        return Kind(UNRESOLVED, 0, math.nan, 0)
    course = course_of(cloud)
    rotation, curves = rotation_number(cloud, limits)
    if not curves:
        rotation, curves = cut_circle(cloud)
    # means over a curve with jumps converge like the turns round it
    on_curve = curves > 0 and not course.drifts and course.error**2 * len(cloud) * rotation <= 1.0
    on_curve = on_curve and has_length(cloud, curves)
    if on_curve or (course.smooth and cloud.shape[1] > 1):
        return Kind(QUASI_PERIODIC, 0, rotation, curves)
    # weak chaos may be within the error as well; what drifts, an angle that was not said to be one, is on no set
    strange = BY_CHANCE * exponent <= error and not course.drifts and is_rough(cloud)
    return Kind(STRANGE if strange else UNRESOLVED, 0, math.nan, 0)
