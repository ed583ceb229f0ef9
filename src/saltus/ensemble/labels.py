"""What a lane reports after a step, labels of motions besides those of attractors, and records of many motions."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = [
    "AT_STROBE",
    "CHANGES",
    "DIVERGED",
    "DONE",
    "EVENT",
    "FALLING",
    "GOES_ON",
    "GONE",
    "HARD",
    "HUGE",
    "LEFT_OVER",
    "MOST_STEPS",
    "NOT_DONE",
    "STUCK",
    "UNDECIDED",
    "Boxes",
    "Found",
    "Motions",
    "Regions",
    "Scratch",
    "Settings",
]

GOES_ON, AT_STROBE, STUCK, CHANGES, EVENT = 0.0, 1.0, 2.0, 3.0, 4.0
"""Flags of a lane after a step: nothing to do; at phase 0; no step; another kind of step; event j of its mode is
``EVENT + j``."""

HARD, GONE, DONE = -1, -2, -3
"""Instead of a pool: a motion that steps without branches cannot follow, one beyond all bounds, one with a label."""

LEFT_OVER, DIVERGED, UNDECIDED, NOT_DONE = 252, 253, 254, 255
"""Labels besides those of attractors: of a hard motion until another engine has followed it, of one that has grown
beyond all bounds, of one not settled in time, and of one not followed yet."""

MOST_STEPS = 3000.0
"""Steps between two looks after which a motion is hard."""

FALLING = 48
"""Looks up to which a motion's tolerance may grow: one that has not met its fate by then is on a slow way, or on one of
its own, and no longer falls into a trap."""

HUGE = "1e300"
"""Text of a step's largest length where nothing limits it."""


class Motions(NamedTuple):
    """Where motions start: states at phase 0, shape (m, n), and modes, negative for the first that a state allows."""

    points: NDArray[np.float64]
    modes: NDArray[np.int64]


class Regions(NamedTuple):
    """Trapping regions as `saltus.ensemble._kernels.fate` reads them."""

    cages: NDArray[np.float64]
    ellipsoids: NDArray[np.float64]
    labels: NDArray[np.int64]


class Boxes(NamedTuple):
    """Boxes that attractors visit, as `saltus.ensemble._kernels.box_of` reads them."""

    origin: NDArray[np.float64]
    size: NDArray[np.float64]
    indices: NDArray[np.int64]
    labels: NDArray[np.int64]


class Settings(NamedTuple):
    """How motions are followed: tolerances as `loosened` reads them, what has diverged, periods, visits to boxes."""

    itol: float
    growth: float
    least_itol: float
    limit: float
    longest: int
    visits: int


class Found(NamedTuple):
    """What has become of motions: labels, periods until then, and the states and modes where they ended."""

    labels: NDArray[np.uint8]
    strobes: NDArray[np.int32]
    ends: NDArray[np.float64]
    end_modes: NDArray[np.int64]


class Scratch(NamedTuple):
    """What a loop over lanes works in: pools of lanes, their motions and counts, visits of motions, a state."""

    pools: NDArray[np.float64]
    who: NDArray[np.int64]
    counts: NDArray[np.int64]
    seen: NDArray[np.int64]
    x: NDArray[np.float64]
