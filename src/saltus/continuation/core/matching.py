"""Values at two places, put in one order: each value, and that one of the others which is nearest to it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

__all__ = ["FEW", "assigned", "least_in_rows", "matched", "order_of"]

FEW = 8  # values up to which distances are computed one by one: arrays take longer


def order_of(values: list[complex], others: list[complex]) -> Sequence[int]:
    """Return the places of the other values in the order of those to which they are nearest."""
    if len(values) < 2:
        return range(len(values))
    if len(values) == 2:
        (a, b), (c, d) = values, others
        return (1, 0) if abs(a - d) + abs(b - c) < abs(a - c) + abs(b - d) else (0, 1)
    if len(values) <= FEW:
        nearest = least_in_rows([[abs(value - other) for other in others] for value in values])
        if nearest is not None:
            return nearest
    return assigned(np.abs(np.array(values)[:, None] - np.array(others)))


def assigned(apart: NDArray[np.float64]) -> list[int]:
    """Return the columns of the entries, one in each row and column, of least sum."""
    from scipy.optimize import linear_sum_assignment

    order: list[int] = linear_sum_assignment(apart)[1].tolist()
    return order


def least_in_rows(apart: list[list[float]]) -> list[int] | None:
    """Return `assigned` where it takes the least entry of each row: these are single and in different columns."""
    found: list[int] = []
    for row in apart:
        least = min(row)
        at = row.index(least)
        if not least < math.inf or at in found or row.count(least) > 1:
            return None
        found.append(at)
    return found


def matched(values: list[complex], others: list[complex]) -> list[complex]:
    """Return the other values, each at the place of that one to which it is nearest."""
    return [others[k] for k in order_of(values, others)]
