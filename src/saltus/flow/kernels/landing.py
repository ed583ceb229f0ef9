"""Compiled landings of Runge-Kutta steps on the first event that counts."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from numba import int64

from saltus.flow.kernels.order import first_crossing, next_crossing
from saltus.flow.kernels.polynomial import ROOTS
from saltus.flow.kernels.state import EPSILON, RESIDUAL
from saltus.flow.kernels.step import FIELD, ROUNDING, size_of_terms
from saltus.flow.kernels.trial import step_to
from saltus.system.compiled import FUNCTIONS
from saltus.system.numba_tools.machine_code import njit
from saltus.system.numba_tools.pointers import INNER, PART, call, outlined, pointer

EVENT_X = FUNCTIONS.index("event_x")
GUARD = FUNCTIONS.index("guard")
TRIALS = 60  # steps that try to land
NEWTON = 12  # of which these are Newton's method's alone
ALIKE = 1e-3  # correction of a landing, over its time, beyond which rounding of the event function has made it
AT_ONCE = 1e-6  # fraction of a step within which two events may be at the same time


class Room(NamedTuple):
    """Room for what a step needs, pointers.

    Parameters
    ----------
    y, x_end : float64 pointer, (n,)
        A stage; the end of the step.
    landing, landing_size : float64 pointer, (n,)
        The state on an event's surface, and the sizes of the states there.
    after : float64 pointer, (n,)
        The state after a reset.
    trial : float64 pointer, (16 * n,)
        The slopes of the step that lands.
    event, guard : float64 pointer, (2 + 2 * n,) and (1,)
        Event function, its rate, their gradients; a condition.
    sized : float64 pointer, (2 * n + 1,)
        A state with the sizes of its components, and a rounding.
    """

    y: Any
    x_end: Any
    landing: Any
    landing_size: Any
    after: Any
    trial: Any
    event: Any
    guard: Any
    sized: Any


class Bracket(NamedTuple):
    """A crossing between two fractions of the step, about where it is, and the sign of the function before it."""

    low: float
    guess: float
    high: float
    sign: int


@njit(**INNER)
def _land(system, within, state, k, mode, h, bracket, room):
    """Step from x that ends on event k: (dt, relative residual).

    Newton's method in the step. A correction below 1e-9 h is applied along the field, which is exact to rounding. Where
    no step lands (a dip lost in the tolerance), the best one is taken. A hop lower than rounding ends where its
    polynomial does, at the first step on the surface that moves through it. Leaves the slopes in `trial`, with that at
    the end, and the event with its gradient in `event`. The state is in `landing`, the sizes of its components in
    `landing_size`.
    """
    outlined()
    addresses, n, p, before, x = system.addresses, system.n, system.p, bracket.sign, state.x
    x_end, size, trial, event = room.landing, room.landing_size, room.trial, room.event
    for e in range(n):
        trial[e] = state.slopes[e]
    low, high, dt = bracket.low * h, bracket.high * h, bracket.guess * h
    best, best_value = dt, math.inf
    landed, last = False, math.inf
    for i in range(TRIALS):
        step_to(system, within, state, mode, h, dt, room)
        call(addresses[EVENT_X], k, 0, x_end, 0, p, event, 0)
        for e in range(n):
            size[e] = max(abs(x[e]), abs(x_end[e]), dt * abs(trial[e]))
        value, rate = event[0], event[1]
        on = abs(value) <= ROUNDING * size_of_terms(pointer(event, 2), n, size)
        if abs(value) < best_value:
            best, best_value = dt, abs(value)
        if value * before > 0.0:
            low = max(low, dt)
        else:
            high = min(high, dt)
        correction = -value / rate if rate * before < 0.0 else math.nan
        if abs(correction) <= 1e-9 * h and dt + correction >= 0.0:
            call(addresses[FIELD], mode, 0, x_end, 0, p, trial, 12 * n)
            for e in range(n):
                x_end[e] += correction * trial[12 * n + e]
            dt += correction
            landed = True
            break
        if on and rate * before < 0.0 and not abs(correction) <= ALIKE * dt:
            best = dt
            break
        slow = i >= NEWTON and not abs(correction) < 0.25 * last  # as at a root of high order
        last = abs(correction)
        if not slow and low < dt + correction < high:
            dt += correction
        elif on or high - low <= 4.0 * EPSILON * high:
            break
        else:
            dt = 0.5 * (low + high)
    if not landed:
        dt = best
        step_to(system, within, state, mode, h, dt, room)
    call(addresses[FIELD], mode, 0, x_end, 0, p, trial, 12 * n)
    call(addresses[EVENT_X], k, 0, x_end, 0, p, event, 0)
    for e in range(n):
        size[e] = max(abs(x[e]), abs(x_end[e]), dt * abs(trial[e]))
    scale = size_of_terms(pointer(event, 2), n, size)
    return dt, abs(event[0]) / scale if scale > 0.0 else 0.0


@njit(**PART)
def _bracket(crossings, k, index):
    """The bracket of one of the crossings of event function k."""
    found, n_found, before = pointer(crossings.found, ROOTS * k), crossings.n_found[k], crossings.before[k]
    low = 0.0 if index == 0 else 0.5 * (found[index - 1] + found[index])
    high = 1.0 if index + 1 == n_found else 0.5 * (found[index] + found[index + 1])
    return Bracket(low, found[index], high, before if index % 2 == 0 else -before)


@njit(**INNER)
def _goes_back(system, state, k, index, crossings, event):
    """Whether a step starts within rounding beyond a surface and goes back to the side that it counts as being on.

    Writes the residual of a landing there.
    """
    outlined()
    before = crossings.before[k] if index % 2 == 0 else -crossings.before[k]
    call(system.addresses[EVENT_X], k, 0, state.x, 0, system.p, event, 0)
    rounding = ROUNDING * size_of_terms(pointer(event, 2 + system.n), system.n, state.size)
    size = size_of_terms(pointer(event, 2), system.n, state.size)
    state.numbers[RESIDUAL] = abs(event[0]) / size if size > 0.0 else 0.0
    return abs(event[0]) <= ROUNDING * size and event[1] * before > rounding


@njit(**PART)
def _at_once(system, crossings, mode, first, index, fraction, room):
    """Of the events at the time of the first, to rounding, the first in the definition, and which of its crossings."""
    for k in range(first):
        if system.transitions[3 * k] != mode:
            continue
        j = next_crossing(system, crossings, k)
        if j < crossings.n_found[k] and crossings.found[ROOTS * k + j] < fraction + AT_ONCE:
            call(system.addresses[EVENT_X], k, 0, room.landing, 0, system.p, room.event, 0)
            if abs(room.event[0]) <= ROUNDING * size_of_terms(pointer(room.event, 2), system.n, room.landing_size):
                return k, j
    return first, index


@njit(**INNER)
def first_event(system, within, state, mode, h, crossings, room):
    """Land on the first crossing that counts: its transition (-1: none), the time to it, and its fraction of the step."""
    outlined()
    none, dt = int64(-1), h
    while True:
        first, fraction, index, _second = first_crossing(system, crossings, mode)
        if first < 0:
            return none, h, fraction
        if fraction == 0.0:
            if _goes_back(system, state, first, index, crossings, room.event):
                crossings.passed[first] = index + (2 if system.transitions[3 * first + 2] == 0 else 1)
                continue
            dt = 0.0
            for e in range(system.n):
                room.landing[e] = state.x[e]
                room.landing_size[e] = state.size[e]
        else:
            bracket = _bracket(crossings, first, index)
            dt, state.numbers[RESIDUAL] = _land(system, within, state, first, mode, h, bracket, room)
        first, index = _at_once(system, crossings, mode, first, index, fraction, room)
        call(system.addresses[GUARD], system.n_modes + first, 0, room.landing, 0, system.p, room.guard, 0)
        if room.guard[0] > 0.0:
            return first, dt, fraction
        crossings.passed[first] = index + 1
