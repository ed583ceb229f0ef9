"""How equality is judged: errors of one solution, and verdicts that may be *cannot tell*.

This module is the only place with numbers that judge whether two quantities are the same, whether a motion rests,
whether a value is 0. A judgement holds a difference against the *error* of what was compared, in the units of the
comparison. The error follows from the tolerance that was asked for, the size of the states on the solution at hand,
the residual that was reached, and rounding. Whoever gets `Verdict.UNCLEAR` computes more exactly and asks again.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = [
    "EPS",
    "LOCATED",
    "SEPARATED",
    "SOLVED",
    "Scales",
    "Verdict",
    "critical_error",
    "near",
    "same",
    "value_error",
    "zero",
]

# Spacing of doubles at 1: the relative rounding of one operation.
EPS = float(np.finfo(float).eps)

# Eigenvalue, over the largest, below which one decomposition of the whole matrix loses five of its digits, as its
# error is the rounding of the largest: such a value is computed apart, and has a size of its own.
SEPARATED = 1e-5

# Distance, over the range along a curve, up to which two places of it are one: special points are located to some 1e-9.
LOCATED = 1e-7

# Relative error of a solution of algebraic equations: the last Newton step.
SOLVED = 1e-13

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
    distances, errors = np.abs(np.asarray(value, dtype=float)), np.asarray(error, dtype=float)
    if np.all(distances <= errors):
        return Verdict.YES
    return Verdict.NO if np.any(distances > _CLEAR * errors) else Verdict.UNCLEAR


def near(value: float, target: float, error: float, rounding: float = EPS) -> Verdict:
    """Return whether `value` is at `target` within `error` and the rounding of both."""
    return same(value, target, error + rounding * max(abs(value), abs(target)))


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
