"""Whether a step of a curve passes a point at which the curve has been before.

docs/theory/continuation.md, "Closed curves", explains the tests.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from saltus.continuation.core.zero_problem import Point, ZeroProblem, correct, hermite, hermite_slope
from saltus.scales import SAME_POINT
from saltus.system.angles import wrapped

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.core.arclength import StepControl

__all__ = ["Passed", "between", "closes", "passed", "reach"]

_ITERATIONS = 20  # most steps to the place of a cubic that is straight beside a point
_PARALLEL = 0.9  # least cosine of the angle between a curve and itself, one round later


class Passed(NamedTuple):
    """The point that a step passes, as it was found on the step's curve, and its arclength from the curve's start."""

    point: Point
    arc: float


def reach(control: StepControl, last: Point, new: Point) -> float:
    """Return how far from a step's ends what passes it may be, in arclength: what a predictor missed, and the step."""
    return 20.0 * control.deviation + abs(new.arc - last.arc)


def between(value: float, ends: tuple[float, float], slopes: tuple[float, float], room: float) -> bool:
    """Return whether a cubic, by values and changes at both ends of a step, may come within `room` of a value.

    It lies between the least and the largest of its four Bezier points: a quantity may turn within the step.
    """
    inner = ends[0] + slopes[0] / 3.0, ends[1] - slopes[1] / 3.0
    return min(*ends, *inner) - room <= value <= max(*ends, *inner) + room


def passed(
    problem: ZeroProblem, start: Point, last: Point, new: Point, control: StepControl, *, known: bool = True
) -> Passed | None:
    """Return the point `start` where the curve from `last` to `new` passes it; None where it does not.

    The cubic through the step's ends has a place straight beside it. From there Newton's method, in the plane through
    `start` across its tangent, leads back to it: to its very unknowns, or to those to which it leads from `start`
    itself, on meshes that may be others by now. Where the sense of the curve is the opposite one, or not known, it may
    be on another sheet: the sign of the determinant tells.

    Parameters
    ----------
    problem : ZeroProblem
        The equations of the step.
    start : Point
        The point, its tangent in the sense in which the curve left it.
    last, new : Point
        The step's ends.
    control : StepControl
        Sizes of steps.
    known : bool
        Whether the tangent of `start` is known.
    """
    length, w = new.arc - last.arc, last.weights
    share = _beside(last, new, start.u)
    if share is None:
        return None
    guess, along = hermite(last, new, length, share), hermite_slope(last, new, length, share)
    along = along / math.sqrt(float(w @ along**2))
    if not math.sqrt(float(w @ (guess - start.u) ** 2)) < 0.5 * length + SAME_POINT:
        return None  # no predictor of a step misses by half of it
    tangent, weights = (start.tangent, start.weights) if known else (along, w)
    cosine = float(weights @ (tangent * along)) / math.sqrt(float(weights @ tangent**2) * float(weights @ along**2))
    if not abs(cosine) > _PARALLEL:
        return None
    tangent = math.copysign(1.0, cosine) * tangent
    guess = guess - along * (float((weights * tangent) @ (guess - start.u)) / float((weights * tangent) @ along))
    there = correct(problem, guess, tangent, weights, control.iterations)
    if isinstance(there, str) or not _same(problem, start, there, tangent, control):
        return None
    if (cosine < 0.0 or not known) and last.sign == new.sign != there.sign:
        return None
    return Passed(there, last.arc + share * length)


def _beside(last: Point, new: Point, goal: NDArray[np.float64]) -> float | None:
    """Return the share of a step at which its cubic is straight beside a point; None where it is so before or behind.

    A point that is an end of the step is passed by it.
    """
    length, w = new.arc - last.arc, last.weights
    if not length > 0.0:
        return None
    chord, margin = new.u - last.u, min(SAME_POINT / length, 0.1)
    share = float(w @ ((goal - last.u) * chord)) / float(w @ chord**2)
    for _ in range(_ITERATIONS):
        slope = hermite_slope(last, new, length, share)
        ahead = float(w @ ((goal - hermite(last, new, length, share)) * slope)) / float(w @ slope**2)
        share = min(2.0, max(-1.0, share + ahead))
        if abs(ahead) < 1e-3 * margin:
            return share if -margin < share < 1.0 + margin else None
    return None


def _same(problem: ZeroProblem, start: Point, there: Point, tangent: NDArray[np.float64], control: StepControl) -> bool:
    """Return whether a point of the step's curve is the start, whatever the meshes on which each was found."""
    weights = there.weights
    away = math.sqrt(float(weights @ (there.u - start.u) ** 2))
    if away < SAME_POINT:
        return True
    if not away < 20.0 * control.deviation:
        return False
    own = correct(problem, start.u, tangent, weights, control.iterations)
    return isinstance(own, Point) and math.sqrt(float(weights @ (there.u - own.u) ** 2)) < SAME_POINT


def closes(
    branch: ZeroProblem, origin: Point, last: Point, new: Point, control: StepControl, circles: NDArray[np.int64]
) -> Passed | None:
    """Return the start of a curve of solutions where the step from `last` to `new` passes it, else None.

    circles: angles among the unknowns; the start that is returned lies whole turns from the one given, next to `last`.
    """
    length = new.arc - last.arc
    slopes = length * float(last.tangent[-1]), length * float(new.tangent[-1])
    ends = last.parameter, new.parameter
    if last.arc <= SAME_POINT or not between(origin.parameter, ends, slopes, reach(control, last, new)):
        return None
    near = replace(origin, u=last.u + wrapped(origin.u - last.u, circles)) if circles.size else origin
    met = passed(branch, near, last, new, control)
    return None if met is None else Passed(near, met.arc)
