"""On which side of its surface an event leaves a motion: told by what its reset does, not by rounding."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from numba import int64

from saltus.flow.kernels.state import PASSES
from saltus.flow.kernels.step import ROUNDING, size_of_terms
from saltus.system.compiled import FUNCTIONS
from saltus.system.numba_tools.machine_code import njit
from saltus.system.numba_tools.pointers import INNER, call, outlined, pointer

EVENT_X = FUNCTIONS.index("event_x")
RESET = FUNCTIONS.index("reset")
APART = 1e-3  # how far another motion is from that which lands, in sizes of its states
REVERSED = -1e-9  # rate after a reset over the rate before, from which the reset turns motions back


class EventEnds(NamedTuple):
    """States before and after an event, and the sizes of the states there: pointers."""

    landing: Any
    after: Any
    size: Any


class SideRoom(NamedTuple):
    """Room for two other states and an event function with its gradients: pointers."""

    y: Any
    other: Any
    event: Any


@njit(**INNER)
def side_after(system, k, side, rate_before, ends, room):
    """Side of event k's surface for a motion that event k has just left in its own mode, if it is still there.

    side: the one that the motion came from. As a rule the motion is on it still: leaving to the other one is event k
    once more, and a motion that does so for ever is told. There are two exceptions. Where the motion crossed with a
    clear rate and goes on with one, in the same direction, it has passed a threshold: 0. Where the reset touches no
    rate, as of a section, there is nothing to repeat: PASSES. A reset that turns the rates of motions back is a wall's,
    and no threshold's.
    """
    outlined()
    n, event = system.n, room.event
    call(system.addresses[EVENT_X], k, 0, ends.after, 0, system.p, event, 0)
    rate, rounding = event[1], ROUNDING * size_of_terms(pointer(event, 2 + n), n, ends.size)
    if rate * side > rounding:
        return side
    if -rate * side > rounding and rate_before * side < 0.0:
        if not turns_back(system.addresses, n, system.p, k, (rate_before, rate), ends, room):
            return int64(0)
    elif not _touches_rate(system, k, ends, room):
        return int64(PASSES)
    return side


@njit(**INNER)
def turns_back(addresses, n, p, k, rates, ends, room):
    """Whether the reset makes a larger rate before it a smaller one after it, by the states that it changes.

    rates: those of the event function before and after the reset.
    """
    y, event = room.y, room.event
    for e in range(n):
        y[e] = ends.landing[e]
        if ends.after[e] != y[e]:
            y[e] += _apart(ends.size[e])
    call(addresses[EVENT_X], k, 0, y, 0, p, event, 0)
    change = event[1] - rates[0]
    call(addresses[RESET], k, 0, y, 0, p, room.other, 0)
    call(addresses[EVENT_X], k, 0, room.other, 0, p, event, 0)
    return (event[1] - rates[1]) * change < REVERSED * change * change


@njit(**INNER)
def _touches_rate(system, k, ends, room):
    """Whether the reset changes the event function or its rate, for a motion beside the one that lands."""
    y, event, addresses = room.y, room.event, system.addresses
    for e in range(system.n):
        y[e] = ends.landing[e]
    call(addresses[EVENT_X], k, 0, y, 0, system.p, event, 0)
    for e in range(system.n):
        y[e] += math.copysign(_apart(ends.size[e]), event[2 + system.n + e])
    call(addresses[EVENT_X], k, 0, y, 0, system.p, event, 0)
    value, rate = event[0], event[1]
    call(addresses[RESET], k, 0, y, 0, system.p, room.other, 0)
    call(addresses[EVENT_X], k, 0, room.other, 0, system.p, event, 0)
    return event[0] != value or event[1] != rate


@njit(**INNER)
def _apart(size):
    """How far another motion is in a state."""
    return APART * (size if size > 0.0 else 1.0)
