"""Data of one place, and which of them contradict each other."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Hashable, Iterable
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from saltus.fitting.evaluation import Evaluation

__all__ = ["APART", "TOLD", "contradictions", "rows_of_one_place"]

APART = 5.0  # difference of two data of one place, in standard errors, from which one of them is wrong
_MOST = 0.5  # share of data that lie off the model, above which the model is wrong, and not these
TOLD = 3  # pairs that are told, at most


def rows_of_one_place(places: Iterable[Hashable]) -> Iterable[list[int]]:
    """Return the rows of the data of each place."""
    rows: dict[Hashable, list[int]] = defaultdict(list)
    for row, place in enumerate(places):
        rows[place].append(row)
    return rows.values()


def contradictions(found: Evaluation) -> list[str]:
    """Return in words which data of one place and way differ by more than noise, where one lies off the model."""
    measured, count = found.measured, len(found.measured)
    table = np.abs(found.residuals[: measured.rows * count].reshape(measured.rows, count))
    off = np.max(table, axis=0) > APART
    if off.mean() > _MOST:
        return []
    told = []
    for rows in rows_of_one_place(zip(measured.x.tolist(), measured.direction, strict=True)):
        for first, second in combinations(rows, 2):
            apart = {
                one.name: float(np.abs(one.values[first] - one.values[second]) / np.hypot(*one.sigma[[first, second]]))
                for one in measured.channels
            }
            name = max(apart, key=apart.__getitem__)
            if apart[name] > APART and (off[first] or off[second]):
                way = measured.direction[first]
                at = f"{measured.along} = {measured.x[first]:.9g}{way and f', {way}'}"
                told.append(
                    f"data {first} and {second} are both of {at}, and their {name} differ by {apart[name]:.3g}"
                    " standard errors: which is right?"
                )
    more = len(told) - TOLD
    return told[:TOLD] + ([f"{more} more pairs of data of one place differ so"] if more > 0 else [])
