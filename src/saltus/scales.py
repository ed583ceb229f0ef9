"""How equality is judged: errors of one solution, and verdicts that may be *cannot tell*.

This module is the only place with numbers that judge whether two quantities are the same, whether a motion rests,
whether a value is 0. A judgement holds a difference against the *error* of what was compared, in the units of the
comparison. It follows from the tolerance asked for, the sizes of the states on the solution, the residual reached, and
rounding. Whoever gets `Verdict.UNCLEAR` computes more exactly and asks again.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = [
    "BRIEF",
    "CARRIED",
    "DIVERGED",
    "EPS",
    "FINER",
    "FINEST",
    "HALVES_ALIKE",
    "HALVES_AT_TURN",
    "HALVES_PERHAPS",
    "ILL_CONDITIONED",
    "INFINITE",
    "LANDED",
    "LOCATED",
    "ONE_STATE",
    "ON_SURFACE",
    "RESOLVED",
    "RESOLVED_RATIO",
    "ROUGH",
    "ROUNDED_ROUNDS",
    "ROUNDINGS",
    "ROUNDS_ALIKE",
    "SENSITIVITIES",
    "SEPARATED",
    "SETTLED",
    "SMALLEST",
    "SOLVED",
    "STEPS_TOGETHER",
    "UNFIT",
    "Scales",
    "Verdict",
    "critical_error",
    "followed",
    "near",
    "same",
    "split",
    "value_error",
    "zero",
]

# Spacing of doubles at 1: the relative rounding of one operation.
EPS = float(np.finfo(float).eps)

# Eigenvalue, over the largest, below which one decomposition of the whole matrix loses five of its digits, as its
# error is the rounding of the largest: such a value is computed apart, and has a size of its own.
SEPARATED = 1e-5

# The least double of full precision: what is below has no relative error that could be kept.
SMALLEST = float(np.finfo(float).tiny)

# An error in a function's states and its own rounding are apart by more than this only where half of the digits of
# its zero are lost: next to a double zero.
ILL_CONDITIONED = math.sqrt(EPS)

# Distance, over the range along a curve, up to which two places of it are one: special points are located to some 1e-9.
LOCATED = 1e-7

# Relative error of a solution of algebraic equations: the last Newton step.
SOLVED = 1e-13

# Differences up to the error are equal, beyond so many errors they are not: an estimate of an error that is
# an order of magnitude may be wrong by that order.
_CLEAR = 10.0

# A reset carries what is left of a landing's event function on to the state behind it, enlarged by so much at most:
# resets of walls leave the function itself as it is.
CARRIED = 4.0

# Relative tolerance to which an orbit is computed where a looser one cannot tell: the default, at which nothing
# is asked again. Steps of order 8 leave rounding a tenth of it.
FINEST = 1e-12

# Two rounds of an orbit that was computed at the finest tolerance are one up to this share of a state's range: the
# error of its points, a few tolerances at each of some 100 steps, magnified by 1/(1 - multiplier) of up to 10^4.
ROUNDS_ALIKE = 1e-6

# The same over the size of a state, whose range may be nothing: rounding of the return.
ROUNDED_ROUNDS = 1e-12

# Residual of an event, over its variation with the states' sizes, up to which its segment ends on the surface: that of
# orbits that branches keep. Beyond it the error in time is told.
LANDED = 1e-8

# Roundings of a duration, at most, that a sum of steps makes: the surface of an event is reached within so many.
ROUNDINGS = 8.0

# Error of a step, in tolerances, from which on a mesh tells nothing of where Newton's method is to go: it passes over
# what the state's own error does not show, as a small state that grows by many orders.
UNFIT = 1e4

# Newton's method has converged to an orbit where its step, over the unknowns' sizes, is ten times the finest tolerance:
# the next step, its square, is rounding.
SETTLED = 1e-11

# An orbit that is solved to rounding goes round a shorter one twice where its halves differ by that share of states'
# sizes. Next to the halving they differ by the root of the distance, a few 10^-7 at the least of 10^-13.
HALVES_ALIKE = 1e-8

# The same between the halves at a located turn of the branch, where the place is known to half the digits.
HALVES_AT_TURN = 1e-3

# The same where the shorter orbit is sought for, and then decides by its own multiplier -1.
HALVES_PERHAPS = 1e-2

# Modulus of a multiplier from which on an event is met without speed: the inverse of the share of a period at which
# the time of an event is rounding.
INFINITE = 1e10

# Error that an orbit's flow leaves in a unit of growth, in its tolerance: so many steps of one tolerance each add up.
STEPS_TOGETHER = 10.0

# Error of a flow's sensitivities, which vary faster, over that of its states: meshes are made for that ratio.
SENSITIVITIES = 10.0

# Relative error of a multiplier beyond which its place tells nothing of the next one along a branch.
ROUGH = 1e-2


# Change of an argument, in the scale of its function, over a step: 16 places of Gauss and Legendre give the integral of
# the exponential over this width with the rounding of doubles.
RESOLVED = 8.0

# Largest over least distance from a pole within a step: such places give the integral of the reciprocal to 1e-10.
RESOLVED_RATIO = 8.0

# Error of a quadrature over that which the tolerance leaves in what is integrated: it adds nothing to that one.
FINER = 0.1

# Share of an integral that lies in steps as short as rounding allows, above which it has no value: halving them goes
# on to change it. A logarithm's pole leaves 1e-13, that of an inverse root 1e-7.
DIVERGED = 1e-3

# A state lies on a surface up to this value of the event function, over its variation with the states' sizes: the
# error of a grazing that was located, which is quadratic in what is left.
ON_SURFACE = 1e-6

# Two states at one instant are one up to this difference, over the states' sizes: the same error.
ONE_STATE = 1e-6

# Share of a period above which a segment is no candidate for events of one instant: a look before the judgement.
BRIEF = 1e-6


class Verdict(Enum):
    """The answer of a judgement."""

    YES = "yes"
    NO = "no"
    UNCLEAR = "cannot tell"

    def __bool__(self) -> bool:
        """Return whether the answer is *yes*: what cannot be told is no basis for an action."""
        return self is Verdict.YES


@dataclass(frozen=True)
class Scales:
    """What is known of the errors of one solution.

    The tolerance is relative, `absolute` and `sizes` belong to the states, shape (state,): the absolute tolerance of
    each, and its size on this solution. `residual` is the largest residual reached, in units of the states' errors.
    """

    tolerance: float
    absolute: NDArray[np.float64]
    sizes: NDArray[np.float64]
    residual: float = 0.0

    @property
    def errors(self) -> NDArray[np.float64]:
        """Error of each state, shape (state,): that of one step's control, enlarged by the residual."""
        asked = np.maximum(self.tolerance * self.sizes, self.absolute)
        return np.maximum(asked, EPS * self.sizes) * max(1.0, self.residual)


def same(a: ArrayLike, b: ArrayLike, error: ArrayLike) -> Verdict:
    """Return whether `a` and `b` agree within their common `error`; all three broadcast."""
    return zero(np.subtract(a, b), error)


def zero(value: ArrayLike, error: ArrayLike) -> Verdict:
    """Return whether each of `value` is 0 within its `error`; *no* as soon as one of them is clearly not."""
    distances, errors = np.abs(np.asarray(value, dtype=float)), np.asarray(error, dtype=float)
    if np.all(distances <= errors):
        return Verdict.YES
    return Verdict.NO if np.any(distances > _CLEAR * errors) else Verdict.UNCLEAR


def near(value: float, target: float, error: float, rounding: float = EPS) -> Verdict:
    """Return whether `value` is at `target` within `error` and the rounding of both."""
    return same(value, target, error + rounding * max(abs(value), abs(target)))


def split(tolerance: float) -> float:
    """Return up to which distance, over a size, an error of the equations parts two branches that meet in a pitchfork.

    An error ``e`` in ``e = a*(m - a**2)`` moves solutions near the point by its cube root.
    """
    return min(_CLEAR * math.cbrt(tolerance), 1.0)


def followed(tolerance: float) -> float:
    """Return the error that a flow of that tolerance leaves, over the states' sizes and for each unit of growth."""
    return STEPS_TOGETHER * max(tolerance, FINEST)


def value_error(tolerance: float) -> float:
    """Return the error of multipliers, over their size, by the tolerance of the flow.

    Two that are nearly equal move by the root of a perturbation, so half of the digits may be lost.
    """
    return float(max(tolerance, EPS) ** 0.5)


def critical_error(tolerance: float) -> float:
    """Return the error of a critical value at a located point, by the tolerance of the flow.

    At the fold of a cycle the critical multiplier is also that of the flow, and the parameter's error moves both: of
    three values that are nearly equal each moves by the cube root of a perturbation.
    """
    return float(max(tolerance, EPS) ** (1.0 / 3.0))
