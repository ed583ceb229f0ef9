"""States that stay at zero once they are there, as populations: their zeros are an invariant plane."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.system.compiled import Compiled

__all__ = ["staying"]


def staying(
    compiled: Compiled, mode: int, x: NDArray[np.float64], p: NDArray[np.float64], zeros: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Return which of some states have no rate where all of these are zero.

    Parameters
    ----------
    compiled : Compiled
        The generated functions.
    mode : int
        Index of the mode.
    x : ndarray, shape (n,)
        Full state, of which the others are taken.
    p : ndarray
        Extended parameters.
    zeros : ndarray of bool, shape (n,)
        These states.
    """
    slope, on_plane = np.empty(x.size), np.where(zeros, 0.0, x)
    compiled.call("field", mode, 0, on_plane, p, slope)
    return np.asarray(zeros & (slope == 0.0))
