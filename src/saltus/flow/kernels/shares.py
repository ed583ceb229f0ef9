"""What a step may do to a state, and units of perturbations, by the states' sizes; compiled.

The units are those in which a frame is orthonormal. Exponents depend on no unit, but rounding and errors of a frame do:
where states of 1e-9 and 1e9 meet, a frame that is orthonormal in the units of the definition has lost the small state.
Units are powers of 2, so that no rounding comes from them. They are 1 where states are of the size 1/512 to 512.
"""

from __future__ import annotations

import math

from saltus.scales import SMALLEST, TURNED
from saltus.system.compiled import ANGLE
from saltus.system.numba_tools.machine_code import njit
from saltus.system.numba_tools.pointers import INNER, outlined, pointer

__all__ = ["allowed", "diverged", "raised", "size_of", "weigh", "weighed"]

REACH = 512.0  # ratio of a size to its unit, at most
STEP = REACH * REACH  # ratio of one unit to the next
NOTHING = 1e-120  # size up to which a state is nothing: the squares of what lies beyond overflow


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


@njit(**INNER)
def raised(x, caps, n, sizes):
    """Raise the sizes of the states, up to their caps, to those of x; whether one has left the reach of its unit."""
    beyond = False
    for e in range(n):
        size = min(abs(x[e]), caps[e])
        if size > sizes[e]:
            beyond = beyond or sizes[e] <= NOTHING or _unit(size) > _unit(sizes[e])
            sizes[e] = size
    return beyond


@njit(**INNER)
def _unit(size):
    """Return the unit of a size."""
    unit = 1.0
    while size > REACH * unit:
        unit *= STEP
    while size < unit / REACH:
        unit /= STEP
    return unit


@njit(**INNER)
def weighed(sizes, n, weights):
    """Write the inverse unit of each state from its size; whether one has changed. A state at 0 has the largest unit."""
    outlined()
    largest, changed = 0.0, False
    for e in range(n):
        largest = max(largest, sizes[e])
    for e in range(n):
        size = sizes[e] if sizes[e] > NOTHING else largest
        weight = 1.0 / _unit(size) if size > NOTHING else 1.0
        changed = changed or weight != weights[e]
        weights[e] = weight
    return changed


@njit(cache=True)
def weigh(sizes, weights):
    """Write the inverse unit of each state from its size, both of shape (n,)."""
    weighed(pointer(sizes, 0), sizes.size, pointer(weights, 0))
