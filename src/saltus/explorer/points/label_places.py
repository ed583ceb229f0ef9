"""Places of labels beside marks: within the frame, and none upon another."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

__all__ = ["Beside", "places_beside"]

_LETTER = 6.4  # pixels of a letter of a label, about
_LINE = 14.0  # pixels of its height
_AWAY = 8.0  # pixels between a mark and its label
_UP = (-4.0, 17.0, -18.0, 31.0, -32.0, 45.0)  # pixels from a mark down to a label's lower edge, the first ones first


class Beside(NamedTuple):
    """Where a label stands."""

    align: str  # ``"left"``: it begins at the place
    aside: float  # pixels from the mark to the place, to the right
    below: float  # pixels from the mark to the label's lower edge, downwards
    free: bool = True  # whether no other label stands there


def places_beside(
    marks: Sequence[tuple[float, float]], labels: Sequence[str], size: tuple[float, float]
) -> list[Beside]:
    """Return where the labels of marks stand; one that has no free place stands on others, and says so.

    Parameters
    ----------
    marks : sequence of (float, float)
        Places of the marks, in pixels from the upper left corner of the frame.
    labels : sequence of str
        Their labels; empty ones need no room.
    size : (float, float)
        Width and height of the frame in pixels.

    Examples
    --------
    >>> places_beside([(10.0, 50.0), (40.0, 50.0)], ["SN1", "SN2"], (600.0, 400.0))[1].below
    -4.0
    >>> places_beside([(10.0, 50.0), (20.0, 50.0)], ["SN1", "SN2"], (600.0, 400.0))[1].below
    17.0
    """
    taken: list[tuple[float, float, float, float]] = []
    found = []
    for (x, y), label in zip(marks, labels, strict=True):
        tried = [
            (Beside(align, way * _AWAY, below), _box(x, y, way, below, len(label) * _LETTER))
            for below in _UP
            for align, way in (("left", 1.0), ("right", -1.0))
        ]
        within = [(place, box) for place, box in tried if _is_within(box, size)] or tried
        free = (pair for pair in within if not any(_overlap(pair[1], other) for other in taken))
        place, box = next(free, (within[0][0]._replace(free=False), within[0][1]))
        if label:
            taken.append(box)
        found.append(place)
    return found


def _box(x: float, y: float, way: float, below: float, wide: float) -> tuple[float, float, float, float]:
    """Return left, right, top and bottom of a label."""
    left = x + _AWAY if way > 0.0 else x - _AWAY - wide
    return left, left + wide, y + below - _LINE, y + below


def _is_within(box: tuple[float, float, float, float], size: tuple[float, float]) -> bool:
    return box[0] >= 0.0 and box[1] <= size[0] and box[2] >= 0.0 and box[3] <= size[1]


def _overlap(one: tuple[float, float, float, float], other: tuple[float, float, float, float]) -> bool:
    return one[0] < other[1] and other[0] < one[1] and one[2] < other[3] and other[2] < one[3]
