"""How equality is judged: errors of one solution, and verdicts that may be *cannot tell*.

This module is the only place with numbers that judge whether two quantities are the same, whether a motion rests,
whether a value is 0. A judgement holds a difference against the *error* of what was compared, in the units of the
comparison. The error follows from the tolerance that was asked for, and the size of the states on the solution at hand.
The residual that was reached, and rounding, enlarge it. Whoever gets `Verdict.UNCLEAR` computes more exactly and asks
again.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["CARRIED", "EPS", "Scales", "Verdict", "near", "same", "zero"]

# Spacing of doubles at 1: the relative rounding of one operation.
EPS = float(np.finfo(float).eps)

# Differences up to the error are equal, beyond so many errors they are not: an estimate of an error that is
# an order of magnitude may be wrong by that order.
_CLEAR = 10.0

# A reset carries what is left of a landing's event function on to the state behind it, enlarged by so much at most:
# resets of walls leave the function itself as it is.
CARRIED = 4.0


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
