"""What a step may do to a state: its share of the absolute tolerance and the relative one of its size, compiled."""

from __future__ import annotations

import math

from saltus.scales import SMALLEST, TURNED
from saltus.system.compiled import ANGLE
from saltus.system.numba_tools.machine_code import njit
from saltus.system.numba_tools.pointers import INNER

__all__ = ["allowed", "diverged", "size_of"]


@njit(**INNER)
def size_of(share, value):
    """Size of a state: that of an angle is half a turn at most, however often it turned."""
    size = abs(value)
    return min(size, math.pi) if share == ANGLE else size


@njit(**INNER)
def allowed(share, size, rtol, atol):
    """Tolerance of a state of a size, by its share in the absolute one; an angle counts half a turn at most.

    That of an angle is never below the rounding of the sum that it is: steps that ask for more would end nowhere.
    """
    if share == ANGLE:
        return (atol + SMALLEST) + max(rtol * min(size, math.pi), TURNED * size)
    return (atol * share + SMALLEST) + rtol * size


@njit(**INNER)
def diverged(share, value, bound):
    """Whether a state is beyond a bound; an angle may turn as often as it likes."""
    return not abs(value) < (math.inf if share == ANGLE else bound)
