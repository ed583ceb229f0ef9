"""The compiled event-driven flow: adaptive steps of order 8, every crossing of a step, landings by stepping anew.

A step is taken whole, then the event functions of the mode are followed along its dense output: each is fitted by a
Bernstein polynomial of degree 8 on pieces of the step, pieces being halved until two more points agree, and its zeros
are isolated by sign variations, so that two crossings inside a step are both seen. The first crossing that counts is
landed on by Runge-Kutta steps from the start of the step. A function that is zero where a segment starts has that zero
divided out, and the side to which the motion leaves is read from its rate, or from the second derivative where the
rate vanishes.
"""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
from numba import float64, int64

from saltus.flow._kernels import (
    INNER,
    call,
    dense_coefficients,
    dense_value,
    error_norm,
    outlined,
    pointer,
    stack,
    stage,
)
from saltus.flow._polynomial_kernels import DEPTH, ROOTS, bernstein_roots, bernstein_value, variations
from saltus.system.compiled import FUNCTIONS
from saltus.system.machine_code import njit

FIELD, EVENT, EVENT_X, RESET, GUARD = (
    FUNCTIONS.index(name) for name in ("field", "event", "event_x", "reset", "guard")
)

(
    DONE, AGAIN, CHATTERING, UNBOUNDED, STEP_UNDERFLOW, LEFT_DOMAIN, FIELD_NOT_FINITE, RESET_NOT_FINITE,
    EVENT_NOT_FINITE,
) = range(9)  # fmt: skip
"""What `run_kernel` returns; AGAIN when a buffer is full or the budget of steps is spent."""

(
    T, T_LOW, STEP, DURATION, LONGEST, LAST, LAST_BUT_ONE, FIRST_STEP, RESIDUAL, STEP_BEFORE, ERROR_BEFORE, RATE_AFTER,
    N_NUMBERS,
) = range(13)  # fmt: skip
"""Places in `numbers`: time and its rounding, next step, time since the last event, the longest such time, the last
two, the first step of this segment, residual of the last landing relative to its scale, the last step accepted in this
segment and its error (0: none), the rate of the last event's function just after it."""

(
    MODE, STARTING, FIRED, MODE_BEFORE, WRAPS, EVENTS, SMALL_RUN, SHRINKING_RUN, STILL_RUN, HOP_RUN, N_STEPS, N_EVENTS,
    TRIES, UNCHANGED, N_COUNTS,
) = range(15)  # fmt: skip
"""Places in `counts`: TRIES are steps tried so far; UNCHANGED tells that the last event changed nothing."""

PASSES = 2
"""A side, beside -1, 0 (not known) and 1: the start on a surface is no event, to whatever side the motion leaves."""

AT_WRAP = 1e-9
"""An event at most so far before the phase's wrap, as an angle, comes after it: the strobe looks before the jump."""

BOUND = 1e12
"""A state larger than this has diverged."""

CHATTERING_RUN = 50
CHATTERING_DURATION = 1e-10
"""Chattering: more than so many events in a row, each following after less than this part of the time scale."""

HOP_RUN_MOST = 3
"""Chattering too: more hops than these in a row, from an event to the same one, each lower than rounding."""

DEGREE = 8
PIECE = DEGREE + 3  # a polynomial's coefficients and ends on the stack
EPSILON = 2.220446049250313e-16
ROUNDING = 64.0 * EPSILON
TWO_PI = 2.0 * math.pi


def _bernstein_fit():
    """Matrix from values at `FIT_NODES` to Bernstein coefficients, flat, exact but for its last rounding."""
    nodes = [Fraction(round(512 * (1.0 - math.cos(math.pi * j / DEGREE))), 1024) for j in range(DEGREE + 1)]
    rows = [[math.comb(DEGREE, j) * s**j * (1 - s) ** (DEGREE - j) for j in range(DEGREE + 1)] for s in nodes]
    size = DEGREE + 1
    work = [row + [Fraction(int(i == j)) for j in range(size)] for i, row in enumerate(rows)]
    for i in range(size):
        pivot = next(r for r in range(i, size) if work[r][i] != 0)
        work[i], work[pivot] = work[pivot], work[i]
        work[i] = [value / work[i][i] for value in work[i]]
        for r in range(size):
            if r != i and work[r][i] != 0:
                work[r] = [a - work[r][i] * b for a, b in zip(work[r], work[i], strict=True)]
    return np.array([float(s) for s in nodes]), np.array([float(v) for row in work for v in row[size:]])


FIT_NODES, FIT = _bernstein_fit()
CHECKS = np.array([0.2213, 0.7841])
"""Fractions of a piece at which the fitted polynomial is compared with the event function, between the nodes."""


@njit(**INNER)
def _event_at(addresses, k, n, p, x, dense, s, y, event):
    """Event function at a fraction of the step."""
    outlined()
    dense_value(dense, int64(0), n, x, int64(0), s, y)
    call(addresses[EVENT], k, 0, y, 0, p, event, 0)
    return event[0]


@njit(**INNER)
def _leaving_side(q, degree, rate_counts):
    """Side to which a motion leaves a surface: the sign of h / s near 0, with the coefficients q of h / s; 0: stays."""
    if rate_counts and q[0] != 0.0:
        return 1 if q[0] > 0.0 else -1
    largest = 0.0
    for i in range(1, degree + 1):
        largest = max(largest, abs(q[i]))
    if largest > 0.0:
        for i in range(1, degree + 1):
            if abs(q[i]) > 1e-8 * largest:
                return 1 if q[i] > 0.0 else -1
    return 0


@njit(**INNER)
def _scan(
    addresses, k, n, p, x, dense, value_0, value_1, on, rounding, rate_h, rate_counts, consumed, side, direction,
    rtol, atol, y, event, values, b, pieces, work, found,
):  # fmt: skip
    """All zeros of event function k in the step, in order.

    on: the step starts on the surface, so that zero is divided out; `side` is then the side of the motion before, or 0.
    rounding: of the event function; a step from the surface that stays within it shows nothing but its rate.
    Returns the count of zeros (-1: too many for one step), the side before the first of them (0: not known yet), and
    whether the motion is still on the surface at the end.
    """
    outlined()
    count = 0
    full = int64(DEGREE)  # one type for whatever degree, so that what follows is compiled once
    before = side
    now = side
    a, width = 0.0, 1.0
    at_a = value_0
    while a < 1.0:
        end = a + width
        values[0] = at_a
        values[DEGREE] = value_1 if end >= 1.0 else _event_at(addresses, k, n, p, x, dense, end, y, event)
        largest = max(abs(values[0]), abs(values[DEGREE]))
        for i in range(1, DEGREE):
            values[i] = _event_at(addresses, k, n, p, x, dense, a + width * FIT_NODES[i], y, event)
            largest = max(largest, abs(values[i]))
        on_here = on and a == 0.0
        origin = values[0] if on_here else 0.0
        if on_here and end >= 1.0:
            farthest = 0.0
            for i in range(1, DEGREE + 1):
                farthest = max(farthest, abs(values[i] - origin))
            if farthest <= rounding:
                if not rate_counts:
                    return 0, side, True
                leaves = 1 if rate_h > 0.0 else -1
                if side == PASSES:
                    return 0, leaves, True
                if leaves != side if side != 0 else (direction == leaves and not consumed):
                    found[0] = 0.0
                    return 1, -leaves, True
                return 0, leaves, True
        for i in range(DEGREE + 1):
            total = 0.0
            for j in range(DEGREE + 1):
                total += FIT[i * (DEGREE + 1) + j] * (values[j] - origin)
            b[i] = total
        fits = True
        tolerance = max(0.1 * (atol + rtol * largest), 1e-12 * largest)
        for i in range(2):
            fitted, _slope = bernstein_value(b, full, CHECKS[i], work)
            exact = _event_at(addresses, k, n, p, x, dense, a + width * CHECKS[i], y, event)
            if not abs(fitted + origin - exact) <= tolerance:
                fits = False
                break
        if not fits and width > 1.0 / 512.0:
            width *= 0.5
            continue
        noise = 1e-13 * largest
        degree = full
        if on_here:
            # h / s: its coefficient i is h's coefficient i + 1 times degree / (i + 1)
            degree = full - 1
            for i in range(DEGREE):
                b[i] = b[i + 1] * DEGREE / (i + 1.0)
            b[0] = rate_h * width if rate_counts else 0.0
            leaves = _leaving_side(b, degree, rate_counts)
            if leaves == 0:
                return 0, PASSES if side == PASSES else 0, True
            if before == PASSES:
                crosses = False
            elif before != 0:
                crosses = leaves != before
            else:
                crosses = direction == leaves and not (consumed and rate_counts)
            before = -leaves if crosses else leaves
            now = leaves
            if crosses:
                found[0] = 0.0
                count = 1
        else:
            _changes, first, _last = variations(b, degree)
            if now == 0:
                before = now = first
            if first != 0 and first != now:
                if count == ROOTS:
                    return -1, before, False
                found[count] = a
                count += 1
                now = first
        earlier = count
        count = bernstein_roots(b, degree, noise, a, width, pieces, work, found, count)
        if count < 0:
            return -1, before, False
        if (count - earlier) % 2 == 1:
            now = -now
        at_a = values[DEGREE]
        a = end
        width = min(2.0 * width, 1.0 - a)
    return count, before, False


@njit(**INNER)
def _stays_away(addresses, k, n, p, x, dense, value_0, slope_0, value_1, slope_1, y, event):
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
        if not 10.0 * abs(_event_at(addresses, k, n, p, x, dense, s, y, event) - cubic) < least:
            return False
    return True


@njit(**INNER)
def _full_step(addresses, mode, n, p, h, x, slopes, y, x_end):
    """Twelve stages from x, the first of them known; the end of the step in x_end."""
    outlined()
    for i in range(1, 13):
        stage(i, slopes, n, h, x, y if i < 12 else x_end)
        if i < 12:
            call(addresses[FIELD], mode, 0, y, 0, p, slopes, i * n)


@njit(**INNER)
def _dense(addresses, mode, n, p, h, x, x_end, slopes, y, dense):
    """Three more stages and the dense output; the slope at the end is known."""
    outlined()
    for i in range(13, 16):
        stage(i, slopes, n, h, x, y)
        call(addresses[FIELD], mode, 0, y, 0, p, slopes, i * n)
    dense_coefficients(slopes, n, h, x, x_end, dense)


@njit(**INNER)
def _scale(gradient, n, size):
    """Size of the terms that a function sums up: its rounding is a small multiple of epsilon of it."""
    total = 0.0
    for e in range(n):
        total += abs(gradient[e]) * size[e]
    return total


@njit(**INNER)
def _land(addresses, k, mode, n, p, h, low, guess, high, before, x, slopes, trial, y, size, event, x_end):
    """Step from x that ends on event k, bracketed by fractions low and high of h: (dt, relative residual).

    Newton's method in the step; a correction below 1e-9 h is applied along the field, which is exact to rounding. Where
    no step lands (a dip lost in the tolerance), the best one is taken. Leaves the slopes in `trial`, that at the end
    included, the sizes of the state in `size`, and the event with its gradient in `event`.
    """
    outlined()
    for e in range(n):
        trial[e] = slopes[e]
    low, high, dt = low * h, high * h, guess * h
    best, best_value = dt, math.inf
    landed = False
    for _ in range(40):
        _full_step(addresses, mode, n, p, dt, x, trial, y, x_end)
        call(addresses[EVENT_X], k, 0, x_end, 0, p, event, 0)
        for e in range(n):
            size[e] = max(abs(x[e]), abs(x_end[e]), dt * abs(trial[e]))
        value, rate = event[0], event[1]
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
        if low < dt + correction < high:
            dt += correction
        elif abs(value) <= ROUNDING * _scale(pointer(event, 2), n, size) or high - low <= 4.0 * EPSILON * high:
            break
        else:
            dt = 0.5 * (low + high)
    if not landed:
        dt = best
        _full_step(addresses, mode, n, p, dt, x, trial, y, x_end)
    call(addresses[FIELD], mode, 0, x_end, 0, p, trial, 12 * n)
    call(addresses[EVENT_X], k, 0, x_end, 0, p, event, 0)
    for e in range(n):
        size[e] = max(abs(x[e]), abs(x_end[e]), dt * abs(trial[e]))
    scale = _scale(pointer(event, 2), n, size)
    return dt, abs(event[0]) / scale if scale > 0.0 else 0.0


@njit(**INNER)
def _first_step(addresses, mode, n, used, p, x, slopes, rtol, atol, y, x_end):
    """A first step (Hairer, Norsett & Wanner 1993, section II.4): an Euler step tells the second derivative."""
    outlined()
    d0 = d1 = 0.0
    for e in range(used):
        scale = atol + rtol * abs(x[e])
        d0 += (x[e] / scale) ** 2
        d1 += (slopes[e] / scale) ** 2
    d0, d1 = math.sqrt(d0 / used), math.sqrt(d1 / used)
    h = 1e-6 if d0 < 1e-5 or d1 < 1e-5 else 0.01 * d0 / d1
    for e in range(n):
        y[e] = x[e] + h * slopes[e]
    call(addresses[FIELD], mode, 0, y, 0, p, x_end, 0)
    d2 = 0.0
    for e in range(used):
        d2 += ((x_end[e] - slopes[e]) / (atol + rtol * abs(x[e]))) ** 2
    d2 = math.sqrt(d2 / used) / h
    largest = max(d1, d2)
    if not largest < math.inf:
        return 1e-3 * h
    other = max(1e-6, 1e-3 * h) if largest <= 1e-15 else (0.01 / largest) ** 0.125
    return min(100.0 * h, other)


@njit(**INNER)
def _step_factor(error, h, numbers):
    """Next step over this one: predictive where steps shrink towards a steep place (Hairer & Wanner, II, IV.8)."""
    outlined()
    if error < 1e-8:
        return 6.0
    factor = 0.9 * error**-0.125
    if numbers[STEP_BEFORE] > 0.0 and error <= 1.0:
        predicted = 0.9 * h / numbers[STEP_BEFORE] * (numbers[ERROR_BEFORE] / (error * error)) ** 0.125
        factor = min(factor, predicted)
    return min(6.0, max(0.2, factor))


@njit(**INNER)
def advance(numbers, dt):
    """Add to the time, with the rounding kept apart."""
    t = numbers[T]
    new = t + dt
    numbers[T_LOW] += (t - new) + dt if t >= dt else (dt - new) + t
    numbers[T] = new
    numbers[DURATION] += dt


@njit(**INNER)
def _record_event(counts, numbers, k, n, rate, x_before, x_after, mode_before, mode_after, times, which, ends, rates):
    outlined()
    i = counts[N_EVENTS]
    times[i] = numbers[T] + numbers[T_LOW]
    which[3 * i] = k
    which[3 * i + 1] = mode_before
    which[3 * i + 2] = mode_after
    rates[i] = rate
    for e in range(n):
        ends[2 * i * n + e] = x_before[e]
        ends[(2 * i + 1) * n + e] = x_after[e]
    counts[N_EVENTS] = i + 1


@njit(**INNER)
def _record_step(counts, numbers, n, h, mode, x, dense, step_times, step_modes, step_starts, step_dense):
    outlined()
    i = counts[N_STEPS]
    step_times[2 * i] = numbers[T] + numbers[T_LOW]
    step_times[2 * i + 1] = h
    step_modes[i] = mode
    for e in range(n):
        step_starts[i * n + e] = x[e]
    for e in range(7 * n):
        step_dense[7 * i * n + e] = dense[e]
    counts[N_STEPS] = i + 1


@njit(**INNER)
def _chatters(counts, numbers, phase):
    """Whether the event that ends a segment is one of infinitely many; the next segment's times are set."""
    outlined()
    duration = numbers[DURATION]
    scale = TWO_PI / phase if phase > 0.0 else numbers[LONGEST]
    still = duration <= 4.0 * EPSILON * max(scale, numbers[T])
    small = duration <= CHATTERING_DURATION * scale
    shrinking = still or duration < 0.9999 * numbers[LAST_BUT_ONE]
    counts[SMALL_RUN] = counts[SMALL_RUN] + 1 if small else 0
    counts[SHRINKING_RUN] = counts[SHRINKING_RUN] + 1 if shrinking else 0
    counts[STILL_RUN] = counts[STILL_RUN] + 1 if still else 0
    if min(counts[SMALL_RUN], counts[SHRINKING_RUN]) > CHATTERING_RUN or counts[STILL_RUN] > CHATTERING_RUN:
        # the rest of the geometric series, two events at a time so that two modes may take turns
        if 0.0 < duration < numbers[LAST_BUT_ONE]:
            ratio = duration / numbers[LAST_BUT_ONE]
            advance(numbers, (duration + numbers[LAST]) * ratio / (1.0 - ratio))
        return True
    numbers[LONGEST] = max(numbers[LONGEST], duration)
    numbers[LAST_BUT_ONE] = numbers[LAST]
    numbers[LAST] = duration
    numbers[DURATION] = 0.0
    return False


@njit(**INNER)
def _begin(
    addresses, transitions, n_transitions, mode, n, used, p, x, slopes, size, rtol, atol, numbers, counts, side, on,
    value, first_steps, y, x_end, event,
):  # fmt: skip
    """Begin a segment: its first slope and step, and on which side of every event it starts; a status.

    Where a motion begins, `side` tells of those on whose surface it starts what is known of them; see `EventDrivenMotion`.
    """
    outlined()
    call(addresses[FIELD], mode, 0, x, 0, p, slopes, 0)
    for e in range(n):
        if not abs(slopes[e]) < math.inf:
            return FIELD_NOT_FINITE
    numbers[STEP] = first_steps[mode]
    if numbers[STEP] <= 0.0:
        numbers[STEP] = _first_step(addresses, mode, n, used, p, x, slopes, rtol, atol, y, x_end)
    numbers[FIRST_STEP] = numbers[STEP_BEFORE] = 0.0
    for k in range(n_transitions):
        if transitions[3 * k] != mode:
            continue
        call(addresses[EVENT_X], k, 0, x, 0, p, event, 0)
        value[k] = event[0]
        if not abs(event[0]) < math.inf:
            return EVENT_NOT_FINITE
        if k == counts[FIRED]:
            numbers[RATE_AFTER] = event[1]
        reach = (ROUNDING + 4.0 * numbers[RESIDUAL]) * _scale(pointer(event, 2), n, size)
        on[k] = 1 if abs(event[0]) <= reach else 0
        if on[k] == 0:
            side[k] = 1 if event[0] > 0.0 else -1
        elif k == counts[FIRED]:
            side[k] = PASSES if counts[UNCHANGED] == 1 else 0
        elif counts[FIRED] >= 0 and counts[MODE_BEFORE] != mode:
            side[k] = 0
    counts[STARTING] = 0
    return DONE


@njit(**INNER)
def _seek(
    addresses, transitions, n_transitions, mode, n, p, x, x_end, size, h, dense, rtol, atol, counts, side, on, value,
    value_end, before, found, n_found, passed, stays, y, event, values, b, pieces, work,
):  # fmt: skip
    """Find every zero of every event function in the step.

    Returns AGAIN where there are too many for one step, EVENT_NOT_FINITE where a function is not finite, or else DONE.
    """
    outlined()
    status = DONE
    for k in range(n_transitions):
        n_found[k] = passed[k] = stays[k] = 0
        if transitions[3 * k] != mode:
            continue
        rate_counts, rounding = False, 0.0
        call(addresses[EVENT_X if on[k] == 1 else EVENT], k, 0, x, 0, p, event, 0)
        rate_h = event[1] * h
        if on[k] == 1:
            rate_counts = abs(event[1]) > ROUNDING * _scale(pointer(event, 2 + n), n, size)
            rounding = ROUNDING * _scale(pointer(event, 2), n, size)
        call(addresses[EVENT], k, 0, x_end, 0, p, event, 0)
        value_end[k] = event[0]
        if not abs(event[0]) < math.inf:
            return EVENT_NOT_FINITE
        before[k] = side[k]
        if (
            on[k] == 0
            and side[k] * value[k] > 0.0
            and _stays_away(addresses, k, n, p, x, dense, value[k], rate_h, event[0], event[1] * h, y, event)
        ):
            continue
        consumed = k == counts[FIRED] and counts[MODE_BEFORE] == mode
        n_found[k], before[k], still_on = _scan(
            addresses, k, n, p, x, dense, value[k], value_end[k], on[k] == 1, rounding, rate_h, rate_counts, consumed,
            side[k], transitions[3 * k + 2], rtol, atol, y, event, values, b, pieces, work, pointer(found, ROOTS * k),
        )  # fmt: skip
        stays[k] = 1 if still_on else 0
        if n_found[k] < 0:
            status = AGAIN
    return status


@njit(**INNER)
def _first_event(
    addresses, transitions, n_transitions, n_modes, mode, n, p, x, slopes, size, h, numbers, before, found, n_found,
    passed, landing, landing_size, trial, y, event, guard,
):  # fmt: skip
    """Land on the first crossing that counts: its transition (-1: none), the time to it, and its fraction of the step."""
    outlined()
    none, dt, fraction = int64(-1), h, 2.0
    while True:
        first, fraction, index = none, 2.0, 0
        for k in range(n_transitions):
            if transitions[3 * k] != mode:
                continue
            for j in range(passed[k], n_found[k]):
                goes = -before[k] if j % 2 == 0 else before[k]
                if transitions[3 * k + 2] == 0 or transitions[3 * k + 2] == goes:
                    if found[ROOTS * k + j] < fraction:
                        first, fraction, index = k, found[ROOTS * k + j], j
                    break
        if first < 0:
            return none, h, fraction
        if fraction == 0.0:
            dt = 0.0
            numbers[RESIDUAL] = 0.0
            for e in range(n):
                landing[e] = x[e]
                landing_size[e] = size[e]
        else:
            low = 0.0 if index == 0 else 0.5 * (found[ROOTS * first + index - 1] + fraction)
            high = 1.0 if index + 1 == n_found[first] else 0.5 * (fraction + found[ROOTS * first + index + 1])
            sign = before[first] if index % 2 == 0 else -before[first]
            dt, numbers[RESIDUAL] = _land(
                addresses, first, mode, n, p, h, low, fraction, high, sign, x, slopes, trial, y, landing_size,
                event, landing,
            )  # fmt: skip
        # of those at the same time, the first in the definition
        for k in range(first):
            if transitions[3 * k] != mode:
                continue
            for j in range(passed[k], n_found[k]):
                goes = -before[k] if j % 2 == 0 else before[k]
                if transitions[3 * k + 2] == 0 or transitions[3 * k + 2] == goes:
                    if found[ROOTS * k + j] < fraction + 1e-6:
                        call(addresses[EVENT_X], k, 0, landing, 0, p, event, 0)
                        if abs(event[0]) <= ROUNDING * _scale(pointer(event, 2), n, landing_size):
                            first, index = k, j
                    break
            if first == k:
                break
        call(addresses[GUARD], n_modes + first, 0, landing, 0, p, guard, 0)
        if guard[0] > 0.0:
            return first, dt, fraction
        passed[first] = index + 1


@njit(cache=True, error_model="numpy", nogil=True)
def run_kernel(
    addresses, transitions, phase, p, t_end, last_wrap, last_event, rtol, atol, budget,
    x, slopes, size, numbers, counts, side, on, value, first_steps,
    step_times, step_modes, step_starts, step_dense,
    event_times, event_which, event_ends, event_rates,
):  # fmt: skip
    """Follow a hybrid flow until t_end, a number of phase wraps or events, or a full buffer; a status.

    transitions: (transition, 3) source, target, direction; phase: its rate, 0 without one; p: extended parameters;
    budget: steps to try in this call. Kept between calls, changed in place: x (n,); slopes (16 n,); size (n,);
    numbers; counts; side, on, value, each (transition,); first_steps (mode,). Buffers: step_times (step, 2) start and
    length, step_modes (step,), step_starts (step, n), step_dense (step, 7, n), of no length where steps are not
    wanted; event_times (event,), event_which (event, 3) transition (-1: phase) and modes, event_ends (event, 2, n),
    event_rates (event,).
    """
    n, n_transitions = x.size, transitions.shape[0]
    n_modes, most_steps, most_events = first_steps.size, step_modes.size, event_times.size
    addresses, transitions, p = pointer(addresses, 0), pointer(transitions, 0), pointer(p, 0)
    x, slopes, size, first_steps = pointer(x, 0), pointer(slopes, 0), pointer(size, 0), pointer(first_steps, 0)
    numbers, counts = pointer(numbers, 0), pointer(counts, 0)
    side, on, value = pointer(side, 0), pointer(on, 0), pointer(value, 0)
    step_times, step_modes = pointer(step_times, 0), pointer(step_modes, 0)
    step_starts, step_dense = pointer(step_starts, 0), pointer(step_dense, 0)
    event_times, event_which = pointer(event_times, 0), pointer(event_which, 0)
    event_ends, event_rates = pointer(event_ends, 0), pointer(event_rates, 0)
    block = stack(float64, 30 * n + 3 + n_transitions * (ROOTS + 1) + 3 * (DEGREE + 1) + DEPTH * PIECE)
    integers = stack(int64, 4 * n_transitions)
    used = n - 1 if phase > 0.0 else n
    store = most_steps > 0
    y, x_end, landing, after = block, pointer(block, n), pointer(block, 2 * n), pointer(block, 3 * n)
    landing_size, trial, dense = pointer(block, 4 * n), pointer(block, 5 * n), pointer(block, 21 * n)
    event = pointer(block, 28 * n)  # (2 + 2 n,)
    guard, value_end = pointer(block, 30 * n + 2), pointer(block, 30 * n + 3)
    found = pointer(value_end, n_transitions)  # (n_transitions, ROOTS)
    values = pointer(found, ROOTS * n_transitions)
    b, work, pieces = pointer(values, DEGREE + 1), pointer(values, 2 * (DEGREE + 1)), pointer(values, 3 * (DEGREE + 1))
    n_found, passed, before = integers, pointer(integers, n_transitions), pointer(integers, 2 * n_transitions)
    stays = pointer(integers, 3 * n_transitions)
    none = int64(-1)
    counts[N_STEPS] = counts[N_EVENTS] = 0
    while True:
        if counts[WRAPS] >= last_wrap or counts[EVENTS] >= last_event:
            return DONE
        room = (t_end - numbers[T]) - numbers[T_LOW]
        if room <= 0.0:
            return DONE
        if budget <= 0 or counts[N_EVENTS] == most_events or (store and counts[N_STEPS] == most_steps):
            return AGAIN
        budget -= 1
        counts[TRIES] += 1
        mode = counts[MODE]

        if counts[STARTING] == 1:
            status = _begin(
                addresses, transitions, n_transitions, mode, n, used, p, x, slopes, size, rtol, atol, numbers, counts,
                side, on, value, first_steps, y, x_end, event,
            )  # fmt: skip
            if status != DONE:
                return status

        # how far: to the tolerance, the end, or the phase's wrap, whichever is first
        wraps, last = False, True
        if phase > 0.0:
            to_wrap = (TWO_PI - x[n - 1]) / phase
            if to_wrap <= room + 1e-13 * TWO_PI / phase:
                wraps = True
                last = to_wrap >= room - 1e-13 * TWO_PI / phase
                room = to_wrap
        tried = numbers[STEP]
        ends = room <= 1.01 * tried
        h = room if ends else (tried if room >= 2.0 * tried else 0.5 * room)
        wraps = wraps and ends

        _full_step(addresses, mode, n, p, h, x, slopes, y, x_end)
        error = error_norm(slopes, n, int64(0), used, h, x, x_end, rtol, atol)
        factor = _step_factor(error, h, numbers)
        accepted = error <= 1.0
        if accepted:
            if wraps:
                x_end[n - 1] = TWO_PI
            call(addresses[FIELD], mode, 0, x_end, 0, p, slopes, 12 * n)
            for e in range(n):
                accepted = accepted and abs(slopes[12 * n + e]) < math.inf
        if not accepted:
            if not error >= 0.0 or error <= 1.0 or error == math.inf:
                factor = 0.2
            numbers[STEP] = h * factor
            for k in range(n_transitions):
                # the field may have a kink on the surface ahead: end just past it, and the landing is near
                if transitions[3 * k] == mode and on[k] == 0:
                    call(addresses[EVENT], k, 0, x, 0, p, event, 0)
                    ahead = -1.05 * event[0] / event[1]
                    if numbers[STEP] < ahead < 0.8 * h:
                        numbers[STEP] = ahead
            if numbers[STEP] <= 4.0 * EPSILON * numbers[T] or numbers[STEP] < 1e-250:
                return STEP_UNDERFLOW
            continue

        # every zero of every event function in the step
        active = False
        for k in range(n_transitions):
            active = active or transitions[3 * k] == mode
        if active or store:
            _dense(addresses, mode, n, p, h, x, x_end, slopes, y, dense)
        status = _seek(
            addresses, transitions, n_transitions, mode, n, p, x, x_end, size, h, dense, rtol, atol, counts, side, on,
            value, value_end, before, found, n_found, passed, stays, y, event, values, b, pieces, work,
        )  # fmt: skip
        if status != DONE:
            numbers[STEP] = 0.5 * h
            if numbers[STEP] <= 4.0 * EPSILON * numbers[T] or numbers[STEP] < 1e-250:
                return STEP_UNDERFLOW if status == AGAIN else status
            continue

        # the first that counts: in its direction, and allowed
        fired, dt, fraction = none, h, 2.0
        if active:
            fired, dt, fraction = _first_event(
                addresses, transitions, n_transitions, n_modes, mode, n, p, x, slopes, size, h, numbers, before, found,
                n_found, passed, landing, landing_size, trial, y, event, guard,
            )  # fmt: skip

        if numbers[FIRST_STEP] == 0.0:
            numbers[FIRST_STEP] = h * min(factor, max(1.0, 0.5 * factor))
        if fired < 0:
            for e in range(used):
                if not abs(x_end[e]) < BOUND:
                    return UNBOUNDED
            if store:
                _record_step(counts, numbers, n, h, mode, x, dense, step_times, step_modes, step_starts, step_dense)
            for e in range(n):
                size[e] = max(abs(x[e]), abs(x_end[e]), h * abs(slopes[e]))
                x[e] = x_end[e]
                slopes[e] = slopes[12 * n + e]
            advance(numbers, h)
            if ends and last:
                numbers[T], numbers[T_LOW] = t_end, 0.0
            call(addresses[GUARD], mode, 0, x, 0, p, guard, 0)
            if not guard[0] > 0.0:
                return LEFT_DOMAIN
            for k in range(n_transitions):
                if transitions[3 * k] == mode:
                    value[k] = value_end[k]
                    side[k] = before[k] if n_found[k] % 2 == 0 else -before[k]
                    on[k] = stays[k]
            numbers[STEP] = max(h * factor, tried) if ends else h * factor
            numbers[STEP_BEFORE], numbers[ERROR_BEFORE] = h, max(error, 1e-4)
            if wraps:
                for e in range(n):
                    y[e] = x[e]
                x[n - 1] = 0.0
                counts[WRAPS] += 1
                _record_event(counts, numbers, none, n, phase, y, x, mode, mode, event_times, event_which, event_ends,
                              event_rates)  # fmt: skip
                for k in range(n_transitions):
                    if transitions[3 * k] == mode:
                        call(addresses[EVENT], k, 0, x, 0, p, event, 0)
                        value[k] = event[0]
            continue

        # a transition
        if store and dt > 0.0:
            _dense(addresses, mode, n, p, dt, x, landing, trial, y, dense)
            _record_step(counts, numbers, n, dt, mode, x, dense, step_times, step_modes, step_starts, step_dense)
        advance(numbers, dt)
        for k in range(n_transitions):
            if transitions[3 * k] == mode:
                side[k] = before[k]
                for j in range(n_found[k]):
                    # one at the same time waits for its turn, unless its condition failed
                    if found[ROOTS * k + j] < fraction - (0.0 if k == fired else 1e-9) or j < passed[k]:
                        side[k] = -side[k]
        if phase > 0.0 and landing[n - 1] > TWO_PI - AT_WRAP:
            # the strobe comes first, and the event at once after it
            for e in range(n):
                x[e] = y[e] = landing[e]
                size[e] = landing_size[e]
            x[n - 1] -= TWO_PI
            y[n - 1], landing[n - 1] = TWO_PI, 0.0
            counts[WRAPS] += 1
            counts[FIRED], counts[STARTING] = none, 1
            _record_event(counts, numbers, none, n, phase, y, landing, mode, mode, event_times, event_which, event_ends,
                          event_rates)  # fmt: skip
            continue
        call(addresses[EVENT_X], fired, 0, landing, 0, p, event, 0)
        rate = event[1]
        hops = (
            fired == counts[FIRED]
            and mode == counts[MODE_BEFORE]
            and 0.25 * max(abs(numbers[RATE_AFTER]), abs(rate)) * numbers[DURATION]
            <= ROUNDING * _scale(pointer(event, 2), n, landing_size)
        )
        counts[HOP_RUN] = counts[HOP_RUN] + 1 if hops else 0
        call(addresses[RESET], fired, 0, landing, 0, p, after, 0)
        target = transitions[3 * fired + 1]
        _record_event(counts, numbers, fired, n, rate, landing, after, mode, target, event_times, event_which,
                      event_ends, event_rates)  # fmt: skip
        if numbers[DURATION] > 0.0:
            first_steps[mode] = min(numbers[FIRST_STEP], 2.0 * numbers[DURATION])
        counts[UNCHANGED] = 1 if target == mode else 0
        for e in range(n):
            if after[e] != landing[e]:
                counts[UNCHANGED] = 0
            x[e] = after[e]
            size[e] = max(landing_size[e], abs(after[e]))
            if not abs(after[e]) < math.inf:
                return RESET_NOT_FINITE
        counts[MODE] = target
        counts[MODE_BEFORE] = mode
        counts[FIRED] = fired
        counts[EVENTS] += 1
        counts[STARTING] = 1
        if _chatters(counts, numbers, phase) or counts[HOP_RUN] > HOP_RUN_MOST:
            return CHATTERING
