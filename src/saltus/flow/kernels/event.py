"""The compiled event-driven flow: adaptive steps of order 8, every crossing of a step, landings by stepping anew.

A step is taken whole, then the event functions of the mode are followed along its dense output. The first crossing that
counts is landed on by Runge-Kutta steps from the start of the step: docs/theory/flow.md.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from numba import float64, int64

from saltus.flow.kernels.crossing import DEGREE, PIECE, Ends, Fit, seek
from saltus.flow.kernels.landing import Room, first_event
from saltus.flow.kernels.order import NEVER
from saltus.flow.kernels.polynomial import DEPTH, ROOTS
from saltus.flow.kernels.rooted import behind_root, passes_root, under_root
from saltus.flow.kernels.rounded import UNDERFLOW, starts_flat
from saltus.flow.kernels.shares import diverged
from saltus.flow.kernels.side import EventEnds, SideRoom, side_after
from saltus.flow.kernels.state import (
    AGAIN,
    AT_WRAP,
    CHATTERING,
    DONE,
    DURATION,
    EPSILON,
    ERROR_BEFORE,
    EVENT_NOT_FINITE,
    EVENTS,
    FIELD_NOT_FINITE,
    FIRED,
    FIRST_STEP,
    GUESSED,
    HOP_RUN,
    LEFT_DOMAIN,
    MODE,
    MODE_BEFORE,
    N_EVENTS,
    N_STEPS,
    NEGATIVE_ROOT,
    PASSES,
    RATE_AFTER,
    RESET_NOT_FINITE,
    RESIDUAL,
    STARTING,
    STEP,
    STEP_BEFORE,
    STEP_UNDERFLOW,
    T_LOW,
    TRIES,
    UNBOUNDED,
    WRAPS,
    Crossings,
    T,
    advance,
    chatters,
    event_pointers,
    record_event,
    record_step,
    record_touch,
    state_pointers,
    step_pointers,
    system_pointers,
)
from saltus.flow.kernels.step import FIELD, ROUNDING, first_step, size_of_terms
from saltus.flow.kernels.trial import attempt, interpolant
from saltus.flow.kernels.ways import JUMP, WAYS, longest_way
from saltus.system.compiled import FUNCTIONS, SHARES
from saltus.system.numba_tools.machine_code import njit
from saltus.system.numba_tools.pointers import INNER, PART, call, numbers_at, outlined, pointer, stack

EVENT = FUNCTIONS.index("event")
EVENT_X = FUNCTIONS.index("event_x")
RESET = FUNCTIONS.index("reset")
GUARD = FUNCTIONS.index("guard")
HOP_RUN_MOST = 3  # hops in a row, each lower than rounding, from one event to itself: more are chattering
TWICE = 1e-9  # event function, over its terms, up to which it is 0 where another one is
SHORTEST = 1e-250  # shortest step, in the system's time; no step is below four roundings of the time either
SAFE = 0.9  # of the step at which an exponent goes as far as it may


class Stride(NamedTuple):
    """A step about to be taken: its length, whether it ends at `t_end` or a wrap, whether at a wrap, whether at `t_end`."""

    h: float
    ends: bool
    wraps: bool
    last: bool


@njit(**PART)
def _is_past(system, counts, k, mode):
    """Whether the phase has passed the surface of event k in the event before; one of the same mode waits for its turn."""
    fired = counts[FIRED]
    if fired < 0 or system.clocks[k] < 0 or system.clocks[k] != system.clocks[fired]:
        return False
    return k == fired or counts[MODE_BEFORE] != mode


@njit(**INNER)
def _begin(system, tolerances, state, mode, room):
    """Begin a segment: its first slope and step, and on which side of every event it starts; a status.

    Where a motion begins on the surface of an event, `side` holds what is known of its side; see `EventDrivenMotion`
    and `side_after`.
    """
    outlined()
    addresses, n, p, x, event = system.addresses, system.n, system.p, state.x, room.event
    numbers, counts, side = state.numbers, state.counts, state.side
    call(addresses[FIELD], mode, 0, x, 0, p, state.slopes, 0)
    for e in range(n):
        if not abs(state.slopes[e]) < math.inf:
            return FIELD_NOT_FINITE
    numbers[STEP] = state.first_steps[mode]
    if numbers[STEP] <= 0.0:
        numbers[STEP] = first_step(
            addresses,
            mode,
            n,
            system.n_states,
            p,
            x,
            state.slopes,
            tolerances.rtol,
            tolerances.atol,
            room.y,
            room.x_end,
        )
    numbers[FIRST_STEP] = numbers[STEP_BEFORE] = numbers[GUESSED] = 0.0
    for k in range(system.n_transitions):
        if system.transitions[3 * k] != mode:
            continue
        call(addresses[EVENT_X], k, 0, x, 0, p, event, 0)
        state.value[k] = event[0]
        if not abs(event[0]) < math.inf:
            return EVENT_NOT_FINITE
        if k == counts[FIRED]:
            numbers[RATE_AFTER] = event[1]
        reach = (ROUNDING + 4.0 * numbers[RESIDUAL]) * size_of_terms(pointer(event, 2), n, state.size)
        state.on[k] = 1 if abs(event[0]) <= reach else 0
        flat = starts_flat(system, k, x, state.size, event, room.sized)
        if flat:
            # the function does not tell on which side the motion begins
            state.on[k] = 1
            if side[k] == 0 or (counts[FIRED] >= 0 and counts[MODE_BEFORE] != mode):
                side[k] = PASSES
        elif state.on[k] == 0:
            side[k] = 1 if event[0] > 0.0 else -1
        elif _is_past(system, counts, k, mode):
            side[k] = 1 if event[1] > 0.0 else -1
        elif counts[FIRED] >= 0 and counts[MODE_BEFORE] != mode:
            side[k] = 0
    counts[STARTING] = 0
    return NEGATIVE_ROOT if under_root(system, tolerances, state, mode, x, state.size, room) else DONE


@njit(**PART)
def _stride(system, state, left):
    """The next step: as long as the tolerance allows, but not beyond the time wanted or the phase's wrap."""
    phase = system.phase
    wraps, last = False, True
    if phase > 0.0:
        to_wrap = (system.turn - state.x[system.n - 1]) / phase
        if to_wrap <= left + 1e-13 * system.turn / phase:
            wraps = True
            last = to_wrap >= left - 1e-13 * system.turn / phase
            left = to_wrap
    tried = state.numbers[STEP]
    ends = left <= 1.01 * tried
    h = left if ends else (tried if left >= 2.0 * tried else 0.5 * left)
    return Stride(h, ends, wraps and ends, last)


@njit(**INNER)
def _shorten(system, state, mode, h, factor, event):
    """Set the next step after one that was not accepted.

    The field may have a kink on a surface ahead. A step that ends just past it makes the landing exact.
    """
    outlined()
    numbers = state.numbers
    numbers[STEP] = h * factor
    for k in range(system.n_transitions):
        if system.transitions[3 * k] == mode and state.on[k] == 0:
            call(system.addresses[EVENT], k, 0, state.x, 0, system.p, event, 0)
            ahead = -1.05 * event[0] / event[1]
            if numbers[STEP] < ahead < 0.8 * h:
                numbers[STEP] = ahead


@njit(**PART)
def _underflows(numbers):
    """Whether the next step is lost in the rounding of the time."""
    return numbers[STEP] <= 4.0 * EPSILON * numbers[T] or numbers[STEP] < SHORTEST


@njit(**PART)
def _go_on(system, state, mode, stride, t_end, crossings, ends, room):
    """Take the state to the end of a step without an event; a status."""
    n, x, slopes, numbers = system.n, state.x, state.slopes, state.numbers
    shares, gone = numbers_at(system.addresses[SHARES]), False
    for e in range(n):
        end = room.x_end[e]
        state.size[e] = max(abs(x[e]), abs(end), stride.h * abs(slopes[e]))
        # what decays below the numbers with digits would stay at the least of them: it rests, unless only relative
        # errors count for it
        lost = (
            abs(end) < UNDERFLOW and end != 0.0 and abs(end) <= abs(x[e]) and e < system.n_states and shares[e] == 1.0
        )
        gone = gone or lost
        x[e] = 0.0 if lost else end
        slopes[e] = slopes[12 * n + e]
    if gone:
        call(system.addresses[FIELD], mode, 0, x, 0, system.p, slopes, 0)
    advance(numbers, stride.h)
    if stride.ends and stride.last:
        numbers[T], numbers[T_LOW] = t_end, 0.0
    call(system.addresses[GUARD], mode, 0, x, 0, system.p, room.guard, 0)
    if not room.guard[0] > 0.0:
        return LEFT_DOMAIN
    for k in range(system.n_transitions):
        if system.transitions[3 * k] == mode:
            state.value[k] = ends.value[k]
            state.side[k] = crossings.before[k] if crossings.n_found[k] % 2 == 0 else -crossings.before[k]
            state.on[k] = ends.stays[k]
    return DONE


@njit(**INNER)
def _wrap(system, state, mode, events, room):
    """Set the phase, which is at its wrap, back to 0, and record the wrap."""
    outlined()
    n, x, event = system.n, state.x, room.event
    for e in range(n):
        room.y[e] = x[e]
    x[n - 1] = 0.0
    state.counts[WRAPS] += 1
    record_event(events, state, n, int64(-1), system.phase, room.y, x, mode, mode)
    for k in range(system.n_transitions):
        if system.transitions[3 * k] == mode:
            call(system.addresses[EVENT], k, 0, x, 0, system.p, event, 0)
            state.value[k] = event[0]


@njit(**INNER)
def _sides_after(system, state, mode, fired, fraction, crossings):
    """Set the sides of a mode's events at a landing; one at the same time waits for its turn, unless it was passed."""
    outlined()
    for k in range(system.n_transitions):
        if system.transitions[3 * k] == mode:
            state.side[k] = crossings.before[k]
            for j in range(crossings.n_found[k]):
                if crossings.found[ROOTS * k + j] < fraction - (0.0 if k == fired else 1e-9) or j < crossings.passed[k]:
                    state.side[k] = -state.side[k]


@njit(**INNER)
def _wrap_first(system, state, mode, events, room):
    """Pass the phase's wrap right behind a landing, before its event, which happens at once after it."""
    outlined()
    n, x, y, landing = system.n, state.x, room.y, room.landing
    for e in range(n):
        x[e] = y[e] = landing[e]
        state.size[e] = room.landing_size[e]
    x[n - 1] -= system.turn
    y[n - 1], landing[n - 1] = system.turn, 0.0
    state.counts[WRAPS] += 1
    state.counts[FIRED], state.counts[STARTING] = int64(-1), 1
    record_event(events, state, n, int64(-1), system.phase, y, landing, mode, mode)


@njit(**INNER)
def _at_two_fold(system, fired, room):
    """Whether the other way out of a mode that slides opens at the same landing, to rounding."""
    outlined()
    other = system.opposites[fired]
    if other < 0:
        return False
    event = room.event
    call(system.addresses[EVENT_X], other, 0, room.landing, 0, system.p, event, 0)
    return abs(event[0]) <= TWICE * size_of_terms(pointer(event, 2), system.n, room.landing_size)


@njit(**INNER)
def _happen(system, tolerances, state, mode, fired, events, room):
    """Let the event landed on happen: the reset, the mode after it; a status."""
    outlined()
    n, landing, after, event = system.n, room.landing, room.after, room.event
    numbers, counts = state.numbers, state.counts
    call(system.addresses[EVENT_X], fired, 0, landing, 0, system.p, event, 0)
    rate = event[1]
    hops = (
        fired == counts[FIRED]
        and mode == counts[MODE_BEFORE]
        and 0.25 * max(abs(numbers[RATE_AFTER]), abs(rate)) * numbers[DURATION]
        <= ROUNDING * size_of_terms(pointer(event, 2), n, room.landing_size)
        and not starts_flat(system, fired, landing, room.landing_size, event, room.sized)
    )
    counts[HOP_RUN] = counts[HOP_RUN] + 1 if hops else 0
    if under_root(system, tolerances, state, system.n_modes + fired, landing, room.landing_size, room):
        for e in range(n):
            state.x[e] = landing[e]
        return NEGATIVE_ROOT
    call(system.addresses[RESET], fired, 0, landing, 0, system.p, after, 0)
    target = system.transitions[3 * fired + 1]
    record_event(events, state, n, fired, rate, landing, after, mode, target)
    if numbers[DURATION] > 0.0:
        state.first_steps[mode] = min(numbers[FIRST_STEP], 2.0 * numbers[DURATION])
    for e in range(n):
        state.x[e] = after[e]
        state.size[e] = max(room.landing_size[e], abs(after[e]))
        if not abs(after[e]) < math.inf:
            return RESET_NOT_FINITE
    if target == mode:
        ends, scratch = EventEnds(landing, after, state.size), SideRoom(room.y, room.x_end, event)
        state.side[fired] = side_after(system, fired, state.side[fired], rate, ends, scratch)
    counts[MODE] = target
    counts[MODE_BEFORE] = mode
    counts[FIRED] = fired
    counts[EVENTS] += 1
    counts[STARTING] = 1
    if chatters(counts, numbers, system.phase, system.turn) or counts[HOP_RUN] > HOP_RUN_MOST:
        return CHATTERING
    return DONE


@njit(**PART)
def _one_step(system, tolerances, state, goal, steps, events, work):
    """Begin a segment where one begins, take a step, and let its first event happen; a status."""
    room, dense, crossings, ends, fit = work
    n = system.n
    numbers, counts, mode = state.numbers, state.counts, state.counts[MODE]
    if counts[STARTING] == 1:
        status = _begin(system, tolerances, state, mode, room)
        if status != DONE:
            return status
    stride = _stride(system, state, (goal.t_end - numbers[T]) - numbers[T_LOW])
    h = stride.h
    accepted, error, factor = attempt(system, tolerances, state, mode, stride, room)
    if not accepted:
        _shorten(system, state, mode, h, factor, room.event)
        return STEP_UNDERFLOW if _underflows(numbers) else DONE
    way = system.addresses[WAYS]
    active = way != 0
    for k in range(system.n_transitions):
        active = active or system.transitions[3 * k] == mode
    if active or steps.room > 0:
        interpolant(system, tolerances, state, mode, h, room.x_end, state.slopes, state.guess, room, dense)
    longest = longest_way(way, mode, n, system.p, dense, state.x)
    factor = min(factor, SAFE / max(longest, 1e-3))
    if longest > 1.0 and h > JUMP * numbers[DURATION]:
        numbers[STEP] = h * max(factor, 0.2)
        return STEP_UNDERFLOW if _underflows(numbers) else DONE
    status = seek(system, tolerances, state, mode, h, dense, crossings, ends, fit, room)
    if status != DONE:
        numbers[STEP] = 0.5 * h
        if _underflows(numbers):
            return STEP_UNDERFLOW if status == AGAIN else status
        return DONE
    crossed = False
    for k in range(system.n_transitions):
        crossed = crossed or crossings.n_found[k] > 0
    fired, dt, fraction = int64(-1), h, NEVER
    if crossed:
        fired, dt, fraction = first_event(system, tolerances.within, state, mode, h, crossings, room)
    end = room.landing if fired >= 0 else room.x_end
    if passes_root(system, tolerances, state, mode, dt, end, room):
        numbers[STEP] = 0.5 * h
        return behind_root(state, n, dt, end) if _underflows(numbers) else DONE
    for k in range(system.n_transitions):
        if crossings.touched[k] <= min(fraction, 1.0):
            record_touch(state, k, numbers[T] + numbers[T_LOW] + crossings.touched[k] * h)
    if numbers[FIRST_STEP] == 0.0:
        numbers[FIRST_STEP] = h * min(factor, max(1.0, 0.5 * factor))
    if fired < 0:
        shares = numbers_at(system.addresses[SHARES])
        for e in range(system.n_states):
            if diverged(shares[e], room.x_end[e], max(tolerances.bound, abs(state.x[e]))):
                return UNBOUNDED
        if steps.room > 0:
            record_step(steps, state, n, h, mode, dense)
        status = _go_on(system, state, mode, stride, goal.t_end, crossings, ends, room)
        if status != DONE:
            return status
        numbers[STEP] = max(h * factor, numbers[STEP]) if stride.ends else h * factor
        numbers[STEP_BEFORE], numbers[ERROR_BEFORE] = h, max(error, 1e-4)
        numbers[GUESSED] = h
        if stride.wraps:
            _wrap(system, state, mode, events, room)
        return DONE
    if _at_two_fold(system, fired, room):
        return LEFT_DOMAIN
    if steps.room > 0 and dt > 0.0:
        guess = pointer(state.guess, 7 * n)
        interpolant(system, tolerances, state, mode, dt, room.landing, room.trial, guess, room, dense)
        record_step(steps, state, n, dt, mode, dense)
    advance(numbers, dt)
    _sides_after(system, state, mode, fired, fraction, crossings)
    if system.phase > 0.0 and room.landing[n - 1] > system.turn - AT_WRAP:
        _wrap_first(system, state, mode, events, room)
        return DONE
    return _happen(system, tolerances, state, mode, fired, events, room)


@njit(**PART)
def _laid_out(block, integers, n, n_transitions):
    """Room for a step within two blocks of the stack."""
    event = pointer(block, 28 * n)
    room = Room(
        block, pointer(block, n), pointer(block, 2 * n), pointer(block, 4 * n), pointer(block, 3 * n),
        pointer(block, 5 * n), event, pointer(block, 30 * n + 2), pointer(block, 30 * n + 3),
    )  # fmt: skip
    value = pointer(block, 32 * n + 4)
    found = pointer(value, n_transitions)
    touched = pointer(found, ROOTS * n_transitions)
    values = pointer(touched, n_transitions)
    fit = Fit(values, pointer(values, DEGREE + 1), pointer(values, 2 * (DEGREE + 1)), pointer(values, 3 * (DEGREE + 1)))
    crossings = Crossings(
        found, integers, pointer(integers, 2 * n_transitions), pointer(integers, n_transitions),
        pointer(integers, 4 * n_transitions), touched,
    )  # fmt: skip
    ends = Ends(value, pointer(integers, 3 * n_transitions))
    return room, pointer(block, 21 * n), crossings, ends, fit


@njit(cache=True, error_model="numpy", nogil=True)
def run_kernel(system, tolerances, goal, state, steps, events):
    """Follow a hybrid flow until a time, a number of phase wraps or events, or a full buffer; a status."""
    n, n_transitions, budget = system.n, system.n_transitions, goal.budget
    system, state = system_pointers(system), state_pointers(state)
    steps, events = step_pointers(steps), event_pointers(events)
    block = stack(float64, 32 * n + 4 + n_transitions * (ROOTS + 2) + 3 * (DEGREE + 1) + DEPTH * PIECE)
    integers = stack(int64, 5 * n_transitions)
    work = _laid_out(block, integers, n, n_transitions)
    counts, numbers = state.counts, state.numbers
    counts[N_STEPS] = counts[N_EVENTS] = 0
    while True:
        if counts[WRAPS] >= goal.wraps or counts[EVENTS] >= goal.events:
            return DONE
        if (goal.t_end - numbers[T]) - numbers[T_LOW] <= 0.0:
            return DONE
        if budget <= 0 or counts[N_EVENTS] == events.room or (steps.room > 0 and counts[N_STEPS] == steps.room):
            return AGAIN
        budget -= 1
        counts[TRIES] += 1
        status = _one_step(system, tolerances, state, goal, steps, events, work)
        if status != DONE:
            return status
