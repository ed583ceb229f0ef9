"""How equality is judged: errors of one solution, and verdicts that may be *cannot tell*.

A judgement holds a difference against the *error* of what was compared, in the units of the comparison. It follows from
the tolerance asked for, the sizes of the states on the solution, the residual reached, and rounding. Whoever gets
`Verdict.UNCLEAR` computes more exactly and asks again.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from saltus.scales.doubles import EPS, ILL_CONDITIONED
from saltus.scales.flows import FINEST, SENSITIVITIES_KEPT, STEPS_TOGETHER
from saltus.scales.quantities import WRITTEN

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = [
    "Scales",
    "Verdict",
    "as_written",
    "critical_error",
    "followed",
    "near",
    "near_rank",
    "same",
    "split",
    "value_error",
    "varied",
    "zero",
]

# Differences up to the error are equal, beyond so many errors they are not: an estimate of an error that is
# an order of magnitude may be wrong by that order.
_CLEAR = 10.0


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
    if isinstance(value, float) and isinstance(error, float):
        distance = abs(value)
        return Verdict.YES if distance <= error else Verdict.NO if distance > _CLEAR * error else Verdict.UNCLEAR
    distances, errors = np.abs(np.asarray(value, dtype=float)), np.asarray(error, dtype=float)
    if np.all(distances <= errors):
        return Verdict.YES
    return Verdict.NO if np.any(distances > _CLEAR * errors) else Verdict.UNCLEAR


def near(value: float, target: float, error: float, rounding: float = EPS) -> Verdict:
    """Return whether `value` is at `target` within `error` and the rounding of both."""
    return same(value, target, error + rounding * max(abs(value), abs(target)))


def near_rank(values: ArrayLike) -> int:
    """Return how many singular values, falling, cannot be rounding: what is left is a candidate, to be proved exactly.

    Of formulas that are evaluated at random places half of the digits may be lost to cancellation.
    """
    sizes = np.asarray(values, dtype=float)
    return int(np.sum(sizes > ILL_CONDITIONED * sizes.max(initial=0.0)))


def as_written(value: float) -> float:
    """Return the short decimal or fraction that a number is but for the rounding of how it was computed; else itself.

    Examples
    --------
    >>> as_written(0.30000000000000004), as_written(1e18 * (1 + 1e-15)), as_written(0.1234567890123)
    (0.3, 1e+18, 0.1234567890123)
    """
    candidates = float(f"{value:.9g}"), float(Fraction(value).limit_denominator(1000))
    return next((near for near in candidates if abs(near - value) <= WRITTEN * abs(value)), value)


def split(tolerance: float) -> float:
    """Return up to which distance, over a size, an error of the equations parts two branches that meet in a pitchfork.

    An error ``e`` in ``e = a*(m - a**2)`` moves solutions near the point by its cube root.
    """
    return min(_CLEAR * math.cbrt(tolerance), 1.0)


def followed(tolerance: float) -> float:
    """Return the error that a flow of that tolerance leaves, over the states' sizes and for each unit of growth."""
    return STEPS_TOGETHER * max(tolerance, FINEST)


def varied(tolerance: float) -> float:
    """Return the same of a flow's sensitivities on a mesh that was kept from the orbit before, over their sizes."""
    return STEPS_TOGETHER * SENSITIVITIES_KEPT * max(tolerance, FINEST)


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
