"""Which states of a motion rest at zero, so that they have no size of their own."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["RESTING", "at_rest"]

RESTING = 1e-9  # size of a state, over the largest one's, below which it rests at zero unless another one moves it


def at_rest(sizes: NDArray[np.float64], moves: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which states rest at zero: they are small, and no state that does not rest moves them.

    Parameters
    ----------
    sizes : ndarray, shape (states,)
        Sizes of the states.
    moves : ndarray of bool, shape (n, n)
        Whether the state of a column is in the rate of the state of a row; the phase may be the last of them.

    Examples
    --------
    >>> oscillators = np.array([[0, 1, 0, 0], [1, 1, 0, 0], [0, 0, 0, 1], [0, 0, 1, 1]], dtype=bool)
    >>> at_rest(np.array([1.0, 1.0, 1e-30, 0.0]), oscillators).tolist()
    [False, False, True, True]
    """
    resting = np.zeros(len(moves), dtype=bool)
    resting[: sizes.size] = sizes < RESTING * float(sizes.max())
    while np.any(pushed := resting & np.any(moves[:, ~resting], axis=1)):
        resting &= ~pushed
    return resting[: sizes.size]
