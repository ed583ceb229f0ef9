"""What a lane reports after a step, and labels of motions besides those of attractors."""

from __future__ import annotations

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
