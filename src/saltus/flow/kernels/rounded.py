"""Compiled judgement of zeros of event functions: a zero is a change of sign above the function's own rounding.

The rounding comes from a running error bound of the function's evaluation. It is looked at only where a step has zeros,
or an extreme next to 0. A zero that is clear on both sides of it stays as it was found. Others are put together until
the function is clear of its rounding behind them: if it has changed its sign, one of them is left, else none.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from numba import int64

from saltus.flow.kernels.order import NEVER
from saltus.flow.kernels.stages import dense_value
from saltus.flow.kernels.state import PASSES
from saltus.flow.kernels.step import ROUNDING
from saltus.scales import ILL_CONDITIONED
from saltus.system.compiled import FUNCTIONS
from saltus.system.numba_tools.machine_code import njit
from saltus.system.numba_tools.pointers import INNER, call, outlined, pointer

EVENT = FUNCTIONS.index("event")
ERROR = FUNCTIONS.index("rounding")
BESIDE = 4.0  # roundings, in time, from a zero to where the function is looked at on both sides
WIDEST = 0.05  # part of a step up to which such a place is next to the zero
NARROWEST = 1e-14  # part of a step from which on it is apart from it
UNDERFLOW = 2.2250738585072014e-308  # smallest number with all its digits
LEAST_SIZE = 1e-290  # size of a state that is 0: what its event functions know of it is no underflow
EXTREME = 30  # most places at which the extreme of a function in a step is sought


class Along(NamedTuple):
    """An event function along a step.

    Parameters
    ----------
    k : int
        Its transition.
    x, x_end : float64 pointer, (n,)
        The states at the ends.
    dense : float64 pointer, (7 n,)
        Dense output.
    y, event, sized : float64 pointer, (n,), (2 + 2 n,) and (2 n + 1,)
        Room for a state, for the function with its gradients, and for states with their sizes.
    """

    k: int
    x: Any
    x_end: Any
    dense: Any
    y: Any
    event: Any
    sized: Any


@njit(**INNER)
def rounding_at(system, k, x, sizes, sized):
    """How far event function k may be from its value at x by rounding; sizes: those of the states."""
    outlined()
    n = system.n
    for e in range(n):
        sized[e] = x[e]
        sized[n + e] = max(abs(x[e]), sizes[e])
    call(system.addresses[ERROR], k, 0, sized, 0, system.p, sized, 2 * n)
    rounding = max(ROUNDING * sized[2 * n], UNDERFLOW)
    return rounding if rounding < math.inf else UNDERFLOW


@njit(**INNER)
def is_flat(rounding, gradient, n, sizes):
    """Whether an event function does not tell where its surface is, to half of the digits that its states have."""
    slopes = 0.0
    for e in range(n):
        slopes += abs(gradient[e]) * max(sizes[e], LEAST_SIZE)
    return ROUNDING * slopes < ILL_CONDITIONED * rounding


@njit(**INNER)
def value_at(system, along, s):
    """Event function at a fraction of a step; its rate is left in `event`."""
    outlined()
    dense_value(along.dense, int64(0), system.n, along.x, int64(0), s, along.y)
    call(system.addresses[EVENT], along.k, 0, along.y, 0, system.p, along.event, 0)
    return along.event[0]


@njit(**INNER)
def clear_side(system, state, along, s):
    """Side of an event function at a fraction of a step; 0 where it is within its rounding."""
    outlined()
    value = value_at(system, along, s)
    rounding = rounding_at(system, along.k, along.y, state.size, along.sized)
    return 0 if abs(value) <= rounding else (1 if value > 0.0 else -1)


@njit(**INNER)
def _side_behind(system, state, along, s, h):
    """Side of an event function just behind a zero that is clear on both sides; 0 for one that is not."""
    outlined()
    value_at(system, along, s)
    rate = h * along.event[1]
    rounding = rounding_at(system, along.k, along.y, state.size, along.sized)
    apart = max(BESIDE * rounding / abs(rate), NARROWEST)
    if not apart < WIDEST:
        return 0
    before, behind = value_at(system, along, s - apart), value_at(system, along, s + apart)
    if before < -rounding and behind > rounding:
        return 1
    return -1 if before > rounding and behind < -rounding else 0


@njit(**INNER)
def clear_zeros(system, state, along, h, first, is_known, found, count, before, jumps):
    """Leave the zeros of a step at which the function changes its sign above its rounding.

    Returns their count, the side before the first of them, and the bits of jumps among them. The last number is the
    fraction of the first zero that is left out (`NEVER`: none). first: the zeros before this one stay. is_known: whether the function is on its
    side before them for sure.
    """
    outlined()
    kept, kept_jumps, left_out = first, int64(0), NEVER
    now = -before if first == 1 else before
    if not is_known and clear_side(system, state, along, 0.5 * found[0]) != before:
        now = 0
    for j in range(first, count):
        s = found[j]
        is_jump = (jumps >> j) & 1
        side = _side_behind(system, state, along, s, h) if is_jump == 0 else -now
        if side == 0:
            behind = found[j + 1] if j + 1 < count else 1.0
            side = clear_side(system, state, along, 0.5 * (s + behind))
            if side == 0 and j + 1 == count:
                side = clear_side(system, state, along, 1.0)
        if side == 0 or side == now or now == 0:
            left_out = min(left_out, s)
            if now == 0:
                before = now = side
            continue
        found[kept] = s
        kept_jumps |= is_jump << kept
        kept += 1
        now = side
    return kept, before, kept_jumps, left_out


@njit(**INNER)
def touched_at(system, state, along, h, start, rate_start, rate_end):
    """Where a function that comes near 0 and goes back has its extreme, if that is 0 to rounding; else `NEVER`.

    start: its value; rate_start, rate_end: its rates at the ends of the step, times the step.
    """
    outlined()
    side = 1.0 if start > 0.0 else -1.0
    low, high, a, b = 0.0, 1.0, side * rate_start, side * rate_end
    at_low = side * start
    if not (a < 0.0 < b):
        return NEVER
    for _ in range(EXTREME):
        # a convex function lies above its tangents
        s = low + (high - low) * min(max(a / (a - b), 0.1), 0.9)
        value = side * value_at(system, along, s)
        rounding = rounding_at(system, along.k, along.y, state.size, along.sized)
        if abs(value) <= rounding:
            return s
        rate = side * along.event[1] * h
        if rate == 0.0 or value < 0.0 or min(value, at_low) - abs(rate) * (high - low) > rounding:
            return NEVER
        if rate < 0.0:
            low, a, at_low = s, rate, value
        else:
            high, b = s, rate
    return NEVER


@njit(**INNER)
def starts_flat(system, k, x, sizes, event, sized):
    """Whether a motion begins within the rounding of an event function that does not tell where its surface is.

    event: the function with its rate and its gradient.
    """
    outlined()
    rounding = rounding_at(system, k, x, sizes, sized)
    return abs(event[0]) <= rounding and is_flat(rounding, pointer(event, 2), system.n, sizes)


@njit(**INNER)
def known_side(side):
    """The side on which a motion is known to be; 0 for one that passes."""
    return 0 if side == PASSES else side


@njit(**INNER)
def stays_away(system, along, value_0, slope_0, value_1, slope_1):
    """Whether an event function is far from zero in the whole step.

    The cubic with the values and slopes at both ends lies within its Bernstein coefficients; all of them must be ten
    times farther from zero than the function is from the cubic, at two points.
    """
    outlined()
    b1, b2 = value_0 + slope_0 / 3.0, value_1 - slope_1 / 3.0
    if value_0 > 0.0:
        least = min(min(value_0, b1), min(b2, value_1))
    else:
        least = -max(max(value_0, b1), max(b2, value_1))
    if not least > 0.0:
        return False
    for s in (0.2831, 0.6137):
        other = 1.0 - s
        cubic = other**3 * value_0 + 3.0 * s * other * (other * b1 + s * b2) + s**3 * value_1
        if not 10.0 * abs(value_at(system, along, s) - cubic) < least:
            return False
    return True
