"""Sizes of states that rest at 0 at a special point, as in an invariant plane, by which another branch is reached.

docs/theory/loci.md, "Other branches", explains them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from saltus.errors import ConvergenceError
from saltus.scales import ONE_VALUE, SOLUTION_APART

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["other_than", "upwards"]

_GUESSES = tuple(
    10.0**k for k in (0, 3, 6, 9, 12, 15, 18, -3, -6, -9, -12, -15, -18)
)  # size of a state at rest, over the largest, in turn

Result = TypeVar("Result")


def other_than(
    sizes: NDArray[np.float64],
    resting: NDArray[np.bool_],
    step: Callable[[NDArray[np.float64] | None], tuple[Result, float, float]],
    what: str,
) -> Result:
    """Return a solution on another branch; states at rest are given sizes until it is one.

    Parameters
    ----------
    sizes : ndarray, shape (n,)
        Sizes of the states along the known branch.
    resting : ndarray of bool, shape (n,)
        Which states rest at 0 there, so that their sizes are rounding.
    step : callable
        Takes sizes, None for those known, and returns a solution a step along the other branch. Two distances from
        the special point come with it: of the parameter, in its unit, and of the states.
    what : str
        What the solution is.

    Raises
    ------
    ConvergenceError
        The equations cannot tell any solution from the known branch.
    """
    top, kept = float(sizes.max()), []
    guesses = [np.where(resting, guess * top, sizes) for guess in _GUESSES] if np.any(resting) else [None]
    reason = "it cannot be told from the known branch"
    for guess in guesses:
        try:
            found, moved, apart = step(guess)
        except ConvergenceError as error:
            if len(guesses) == 1:
                raise
            reason = str(error)
            continue
        if moved > ONE_VALUE:
            return found
        if apart > SOLUTION_APART * top:
            kept.append(found)
    if kept:
        return kept[0]
    raise ConvergenceError(what, 0.0, len(guesses), reason)


def upwards(direction: NDArray[np.float64], shares: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a direction or its opposite, so that the first of the large shares is positive.

    States that rest at 0 are often amounts that cannot be negative.
    """
    large = np.flatnonzero(np.abs(shares) >= 0.5 * float(np.abs(shares).max()))
    return -direction if shares[large[0]] < 0.0 else direction
