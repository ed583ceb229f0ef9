"""The compiled event-driven flow by Taylor series: steps are polynomials, whose zeros are the events.

Each step computes the series of the state and of the mode's event functions, generated for the system; its length
follows from the last two coefficients, and no step is rejected. A crossing is a root of the event function's own
series, isolated by sign variations, so that two crossings inside a step are both seen. In a mode that is regularised
(`saltus.system.writing.regularise`), the series run in sigma, and the event about which it is regularised is a zero of w.

What is not plain (a motion that stays on a surface, several events at once, chattering, a singularity) is left to the
event-driven flow of Runge-Kutta steps, which knows all the rules: the kernel returns HELP at the start of such a step.
"""

from __future__ import annotations

import math

import numpy as np

from saltus.flow.kernels.column import Columns, evaluate, reached
from saltus.flow.kernels.polynomial import DEPTH, ROOTS
from saltus.flow.kernels.rounded import starts_flat
from saltus.flow.kernels.shares import diverged
from saltus.flow.kernels.side import EventEnds, SideRoom, side_after
from saltus.flow.kernels.state import BOUND, DURATION, PASSES, T_LOW, TWO_PI, Crossings, T, advance, system_pointers
from saltus.flow.kernels.step import ROUNDING
from saltus.flow.kernels.taylor_step import (
    AGAIN,
    APPROACH,
    APPROACHES,
    DONE,
    FIRED,
    GOES_ON,
    HELP,
    MODE,
    MODE_BEFORE,
    MOST_APPROACHES,
    PAUSE,
    RETURNED,
    RETURNS,
    SHORTER,
    SHORTER_MOST,
    SHORTEST,
    SIGMA_STEP,
    SIGMA_STEPS,
    SMALL_DURATION,
    SMALL_RUN,
    SMALL_RUN_MOST,
    STARTING,
    STEP,
    STEPS,
    Motion,
    Returns,
    Room,
    Series,
    crossed,
    cut_short,
    defect,
    expanded,
    is_clear,
    landed,
    period,
    residual_at,
)
from saltus.system.compiled import FUNCTIONS, SHARES
from saltus.system.numba_tools.machine_code import njit
from saltus.system.numba_tools.pointers import INNER, PART, call, keep, numbers_at, outlined, pointer

EVENT = FUNCTIONS.index("event")
EVENT_X = FUNCTIONS.index("event_x")
RESET = FUNCTIONS.index("reset")
GUARD = FUNCTIONS.index("guard")


@njit(**INNER)
def _scale(gradient, n, x, phase):
    total = 0.0
    for e in range(n):
        total += abs(gradient[e] * (TWO_PI if phase > 0.0 and e == n - 1 else x[e]))
    return total


@njit(**INNER)
def _begin(system, forms, motion, mode, residual, dt, room):
    """Begin a segment: on which side of every event it starts, and w behind the state; whether it is a plain start.

    residual: the event function's value at the landing; dt: the step that led there, 0 without one. Rounding follows
    from both.
    """
    outlined()
    event, sizes, sized = room.event, room.size, room.sized
    n, transitions, x, counts, side, on = system.n, system.transitions, motion.x, motion.counts, motion.side, motion.on
    x[n] = 0.0
    counts[SIGMA_STEPS] = PAUSE
    for k in range(system.n_transitions):
        if transitions[3 * k] != mode:
            continue
        call(system.addresses[EVENT_X], k, 0, x, 0, system.p, event, 0)
        reach = ROUNDING * (_scale(pointer(event, 2), n, x, system.phase) + abs(event[1]) * dt) + 4.0 * residual
        on[k] = 1 if abs(event[0]) <= reach else 0
        for e in range(n):
            sizes[e] = TWO_PI if system.phase > 0.0 and e == n - 1 else abs(x[e])
        if starts_flat(system, k, x, sizes, event, sized):
            return False
        known = side[k]
        side[k] = 1 if event[0] > 0.0 else -1
        if on[k] == 1:
            same = counts[MODE_BEFORE] == mode
            side[k] = known if counts[FIRED] < 0 or same else 0
            if side[k] == PASSES:
                continue
            leaves = 1 if event[1] > 0.0 else -1
            consumed = k == counts[FIRED] and same
            if side[k] == 0 and transitions[3 * k + 2] == leaves and not consumed:
                return False
            if side[k] == -leaves:
                return False
        if k == forms[2 * mode] and on[k] == 0:
            x[n] = math.sqrt(max(forms[2 * mode + 1] * event[0], 0.0))
            if side[k] != forms[2 * mode + 1]:
                return False
    counts[STARTING] = 0
    return True


@njit(**PART)
def _wrap(system, returns, motion, mode, landing, in_sigma, columns, after):
    """Pass the wrap of the phase inside a step, and keep it where it is a return; whether it is the last one wanted."""
    n, n_states, x, numbers, counts = system.n, system.n_states, motion.x, motion.numbers, motion.counts
    c, order, stride, end = columns.c, columns.order, columns.stride, landing.end
    skip, room = returns.skip, returns.room
    to_wrap = (system.turn - x[n - 1]) / system.phase
    if returns.at_wrap:
        counts[RETURNS] += 1
        numbers[RETURNED] = numbers[T]
        if counts[RETURNS] >= min(skip + 1, skip + room):
            s = min(to_wrap, end)
            if in_sigma:
                s = reached(c, order, stride, n_states + 1, to_wrap, 0.0, end, end * to_wrap / landing.dt)
            evaluate(c, order, stride, n_states, s, after)
            i = counts[RETURNS] - skip - 1
            if i >= 0:
                for e in range(n_states):
                    returns.states[i * n + e] = after[e]
                returns.states[i * n + n - 1] = 0.0
                returns.modes[i] = mode
                returns.times[i] = numbers[T] + to_wrap + numbers[T_LOW]
            if counts[RETURNS] == skip + room:
                for e in range(n_states):
                    x[e] = after[e]
                x[n - 1] = 0.0
                advance(numbers, to_wrap)
                counts[STARTING] = 1
                counts[FIRED] = -1
                return True
    x[n - 1] -= system.turn
    return False


@njit(**PART)
def _go_on(system, motion, mode, w, crossings, after):
    """Take sides after a step without an event; whether the motion is where it may be."""
    x, shares = motion.x, numbers_at(system.addresses[SHARES])
    x[system.n] = w
    for e in range(system.n_states):
        if diverged(shares[e], x[e], BOUND):
            return False
    call(system.addresses[GUARD], mode, 0, x, 0, system.p, after, 0)
    if not after[0] > 0.0:
        return False
    for k in range(system.n_transitions):
        if system.transitions[3 * k] == mode:
            motion.side[k] = crossings.before[k] if crossings.n_found[k] % 2 == 0 else -crossings.before[k]
            motion.on[k] = 0
    return True


@njit(**INNER)
def _keeps_sides(system, mode, crossings, room):
    """Whether the end of a step without an event lies on those sides of surfaces that the zeros in the step leave.

    Next to a surface the errors of the series may put it on the other side, where the event would count as passed.
    """
    outlined()
    y, event = room.y, room.event
    for k in range(system.n_transitions):
        if system.transitions[3 * k] == mode:
            call(system.addresses[EVENT], k, 0, y, 0, system.p, event, 0)
            side = crossings.before[k] if crossings.n_found[k] % 2 == 0 else -crossings.before[k]
            if side != PASSES and event[0] * side < 0.0:
                return False
    return True


@njit(**INNER)
def _side(system, motion, fired, rate, room):
    """Side on which an event leaves a motion that goes to the other one, or stays; see `side_after`."""
    outlined()
    x, after, size = motion.x, room.after, room.size
    for e in range(system.n):
        size[e] = max(abs(x[e]), abs(after[e]))
    if system.phase > 0.0:
        size[system.n - 1] = TWO_PI
    ends, scratch = EventEnds(x, after, size), SideRoom(room.y, room.other, room.event)
    return side_after(system, fired, motion.side[fired], rate, ends, scratch)


@njit(**PART)
def _happen(system, forms, returns, motion, mode, landing, residual, crossings, room):
    """Let an event happen: onto its surface to rounding, then the reset; whether what follows is plain.

    `event` holds the function and its rate at the landing, `other` the field there, both from `is_clear`.
    """
    n, x, fired, after, event = system.n, motion.x, landing.fired, room.after, room.event
    numbers, counts = motion.numbers, motion.counts
    rate, correction = event[1], -event[0] / event[1]
    if abs(correction) <= 1e-4 * landing.dt:
        for e in range(n):
            x[e] += correction * room.other[e]
        advance(numbers, correction)
        residual = 0.0
    if returns.section[fired] == 1:
        counts[RETURNS] += 1
        numbers[RETURNED] = numbers[T]
        if counts[RETURNS] > returns.skip:
            i = counts[RETURNS] - returns.skip - 1
            for e in range(n):
                returns.states[i * n + e] = x[e]
            returns.modes[i] = mode
            returns.times[i] = numbers[T] + numbers[T_LOW]
    for k in range(system.n_transitions):
        if system.transitions[3 * k] == mode:
            motion.side[k] = crossings.before[k]
            for j in range(crossings.n_found[k]):
                if k != fired and crossings.found[ROOTS * k + j] < landing.fraction:
                    motion.side[k] = -motion.side[k]
    call(system.addresses[RESET], fired, 0, x, 0, system.p, after, 0)
    for e in range(n):
        if not abs(after[e]) < math.inf:
            return False
    if system.transitions[3 * fired + 1] == mode:
        call(system.addresses[EVENT_X], fired, 0, after, 0, system.p, event, 0)
        if not event[1] * motion.side[fired] > 0.0:
            motion.side[fired] = _side(system, motion, fired, rate, room)
    for e in range(n):
        x[e] = after[e]
    counts[MODE] = system.transitions[3 * fired + 1]
    counts[MODE_BEFORE] = mode
    counts[FIRED] = fired
    counts[STARTING] = 1
    scale = period(system) if system.phase > 0.0 else numbers[T]
    counts[SMALL_RUN] = counts[SMALL_RUN] + 1 if numbers[DURATION] <= SMALL_DURATION * scale else 0
    numbers[DURATION] = 0.0
    return (
        _begin(system, forms, motion, counts[MODE], residual, landing.dt, room) and counts[SMALL_RUN] <= SMALL_RUN_MOST
    )


@njit(**PART)
def _one_step(system, series, tolerances, returns, motion, columns, crossings, room):
    """Take a step and let its event happen; a status."""
    n, phase, x, numbers, counts = system.n, system.phase, motion.x, motion.numbers, motion.counts
    mode, form = counts[MODE], series.forms[2 * counts[MODE]]
    if counts[STARTING] == 1 and not _begin(system, series.forms, motion, mode, 0.0, 0.0, room):
        return HELP
    h, in_sigma = expanded(system, series, tolerances, motion, mode, columns, room)
    scale = period(system) if phase > 0.0 else numbers[T]
    if not h > (0.0 if in_sigma else SHORTEST * scale) or not crossed(system, motion, mode, h, columns, crossings):
        return HELP
    if in_sigma and crossings.n_found[form] > 0 and system.transitions[3 * form + 2] == crossings.before[form]:
        return HELP
    plain, landing = landed(system, form, motion, mode, h, in_sigma, columns, crossings, room)
    if not plain:
        return HELP
    is_cut = False
    if landing.fired >= 0 and not in_sigma and landing.dt > 0.0:
        end = landing.end
        if defect(system, mode, columns, end, end, tolerances, room.y, room.after) > 1.0:
            if counts[APPROACHES] >= MOST_APPROACHES:
                return HELP
            counts[APPROACHES] += 1
            is_cut = True
            landing = cut_short(system, motion, mode, h, APPROACH * landing.fraction, columns, crossings, room.y)
    fired, dt = landing.fired, landing.dt
    if not (0.0 < dt <= period(system)) and (fired < 0 or dt != 0.0):
        # in sigma: longer than a period, or past a zero of w, where time runs back
        if not counts[SHORTER] < SHORTER_MOST:
            return HELP
        counts[SHORTER] += 1
        return GOES_ON
    counts[SHORTER] = 0
    residual = 0.0
    if fired >= 0:
        residual = residual_at(system, tolerances, motion, landing, room)
        if not (residual >= 0.0 and is_clear(system, landing, room)):
            return HELP
    elif not _keeps_sides(system, mode, crossings, room):
        return HELP
    if phase > 0.0 and x[n - 1] + phase * dt >= system.turn:
        if _wrap(system, returns, motion, mode, landing, in_sigma, columns, room.after):
            return DONE
    counts[STEPS] += 1
    if not is_cut:
        counts[APPROACHES] = 0
    numbers[STEP] = dt
    advance(numbers, dt)
    if phase > 0.0:
        x[n - 1] += phase * dt
    for e in range(system.n_states):
        x[e] = room.y[e]
    if in_sigma:
        numbers[SIGMA_STEP] = dt
    if fired < 0:
        return GOES_ON if _go_on(system, motion, mode, landing.w, crossings, room.after) else HELP
    if _happen(system, series.forms, returns, motion, mode, landing, residual, crossings, room):
        return GOES_ON
    return HELP


@njit(cache=True, error_model="numpy", nogil=True)
def follow_kernel(system, series, tolerances, returns, budget, motion):
    """Follow a motion from return to return to a section; keep those after the first ones; a status."""
    n, n_transitions, order, stride = system.n, system.n_transitions, series.order, series.stride
    block = np.empty((order + 1) * (stride + 2) + DEPTH * (order + 3) + n_transitions * ROOTS + 10 * n + 13)
    integers = np.zeros(4 * n_transitions, np.int64)
    system = system_pointers(system)
    series = Series(
        series.address,
        order,
        stride,
        series.ways,
        pointer(series.forms, 0),
        pointer(series.binomials, 0),
        pointer(series.p, 0),
    )
    counts, numbers = pointer(motion.counts, 0), pointer(motion.numbers, 0)
    motion = Motion(pointer(motion.x, 0), numbers, counts, pointer(motion.side, 0), pointer(motion.on, 0))
    returns = Returns(
        returns.at_wrap, pointer(returns.section, 0), returns.skip, returns.longest, returns.room,
        pointer(returns.states, 0), pointer(returns.modes, 0), pointer(returns.times, 0),
    )  # fmt: skip
    columns = Columns(
        pointer(block, 0), order, stride, series.binomials, pointer(block, (order + 1) * stride),
        pointer(block, (order + 1) * (stride + 1)), pointer(block, (order + 1) * (stride + 2)),
    )  # fmt: skip
    found = pointer(columns.pieces, DEPTH * (order + 3))
    crossings = Crossings(
        found, pointer(integers, 0), pointer(integers, n_transitions), pointer(integers, 2 * n_transitions),
        pointer(integers, 3 * n_transitions), found,
    )  # fmt: skip
    y = pointer(found, n_transitions * ROOTS)
    room = Room(
        y, pointer(y, n + 4), pointer(y, 2 * n + 5), pointer(y, 6 * n + 12), pointer(y, 7 * n + 12),
        pointer(y, 8 * n + 12),
    )  # fmt: skip
    last = returns.skip + returns.room
    status = GOES_ON
    while status == GOES_ON:
        if counts[RETURNS] >= last or numbers[T] - numbers[RETURNED] > returns.longest:
            status = DONE
        elif budget <= 0:
            status = AGAIN
        else:
            budget -= 1
            status = _one_step(system, series, tolerances, returns, motion, columns, crossings, room)
    keep(block)
    keep(integers)
    return status
