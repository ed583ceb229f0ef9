"""States on a circle: whole turns taken away from angles and from their differences."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["TURN", "on_circles", "wrapped"]

TURN = 2.0 * math.pi


def wrapped(states: ArrayLike, places: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return states, or differences of states, whose angles are moved by whole turns to between -pi and pi.

    Parameters
    ----------
    states : array_like, shape (..., states)
        They may have further components.
    places : ndarray of int
        The angles among the components.
    """
    moved = np.array(states, dtype=np.float64)
    if places.size:
        angle = moved[..., places]
        outside = ~((angle >= -math.pi) & (angle < math.pi))
        moved[..., places] = np.where(outside, angle - TURN * np.floor(angle / TURN + 0.5), angle)
    return moved


def on_circles(
    states: NDArray[np.float64], rounding: NDArray[np.float64], places: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return states, shape (m, states), with cosine and sine in the place of each angle, and their rounding."""
    if not places.size:
        return states, rounding
    others = np.delete(states, places, axis=1)
    table = np.hstack([others, np.cos(states[:, places]), np.sin(states[:, places])])
    return table, np.concatenate([np.delete(rounding, places), rounding[places], rounding[places]])
