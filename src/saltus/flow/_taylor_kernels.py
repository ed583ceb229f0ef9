"""The compiled event-driven flow by Taylor series: steps are polynomials, whose zeros are the events.

Each step computes the series of the state and of the mode's event functions, generated for the system; its length
follows from the last two coefficients, and no step is rejected. A crossing is a root of the event function's own
series, isolated by sign variations, so that two crossings inside a step are both seen. In a mode that is regularised
(`saltus.system.regularise`), the series run in sigma, and the event about which it is regularised is a zero of w.

What is not plain (a motion that stays on a surface, several events at once, chattering, a singularity) is left to the
event-driven flow of Runge-Kutta steps, which knows all the rules: the kernel returns HELP at the start of such a step.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import float64, int64

from saltus.flow._bit_kernels import bits_of, float_of
from saltus.flow._kernels import INNER, call, keep, outlined, pointer
from saltus.flow._polynomial_kernels import DEPTH, ROOTS, bernstein_roots, variations
from saltus.flow._state_kernels import BOUND, DURATION, EPSILON, PASSES, T_LOW, TWO_PI, T, advance
from saltus.flow._step_kernels import ROUNDING
from saltus.system.compiled import FUNCTIONS
from saltus.system.machine_code import njit

FIELD, EVENT, EVENT_X, RESET, GUARD = (
    FUNCTIONS.index(name) for name in ("field", "event", "event_x", "reset", "guard")
)

DONE, AGAIN, HELP = range(3)
"""What `follow_kernel` returns; AGAIN when the budget of steps is spent."""

RETURNED, STEP, SIGMA_STEP, N_NUMBERS = range(DURATION + 1, DURATION + 5)
"""Places in `numbers`, after those of the event-driven flow that `advance` fills: time of the last return to the section,
the last step in time, the last step in sigma, in time."""

MODE, STARTING, FIRED, MODE_BEFORE, RETURNS, SMALL_RUN, STEPS, SHORTER, SIGMA_STEPS, APPROACHES, N_COUNTS = range(11)
"""Places in `counts`."""

SMALL_DURATION = 1e-6
SMALL_RUN_MOST = 5
"""HELP is asked for after so many events in a row, each of which follows after less than this part of the period."""

CROWD = 1e-3
"""Help goes on while events follow each other after less than this part of the period."""

LONGEST_STEP = 4.0
"""A step goes no farther than so many sizes of the state, and 1, at the speed of its start."""

ONE_BITS = 1023.0 * 2.0**52
"""The bits of 1.0, read as an integer."""

FROM_SURFACE = 3e-5
"""Part of w that is left at the end of a step without an event, at the least: a step that ended within rounding before
the surface would leave a motion that seems to start on it."""

TIME_WORTH = 0.75
PAUSE = 2
"""Where a mode is regularised, series in time, which cost less, are tried after so many steps in sigma, and are taken
where they reach this part of the last of those, at the least."""

SHORTER_MOST = 40
"""Most halvings in a row of a step in sigma at whose end time runs back."""

LANDING = 1e3
"""HELP is asked for where an event function is farther from zero than so many tolerances at its landing."""

GROWTH, MOST_GROWTH = 1.6, 4.0
"""A step more than so many times longer than the last is checked; and how many times longer it may be."""

DEFECT = 100.0
CUTS = 40
"""A step that is checked solves the equations to so many tolerances, or is cut to a quarter; so many times at the
most."""

APPROACH, MOST_APPROACHES = 0.6, 40
"""A step in time whose series do not solve the equations to the tolerance where it lands goes this part of the way: a
weak part of a field may grow fast next to a surface, which the last terms of a series do not show from afar. HELP is
asked for after so many such steps in a row."""

SAME = 1e-6
"""HELP is asked for where two events are closer than this part of a step, or one is as close to the step's ends."""

SQUARE_ROOT = 1e-8
"""A correction below this is the last of Newton's method, which doubles the digits."""

SUMS: dict[str, Any] = {**INNER, "fastmath": {"contract", "reassoc", "nsz", "arcp"}}
"""Options of functions whose sums may be taken in any order."""


@njit(**INNER)
def _root(value, n):
    """About value^(-1/n), within 4 %: the bits of a float, as an integer, are about its logarithm."""
    return float_of(int64(ONE_BITS * (1.0 + 1.0 / n) - float64(bits_of(value + 1e-300)) / n))


@njit(**INNER)
def _step_length(c, order, stride, m, first_event, last_event, rtol, atol):
    """Length at which neither of the last two terms of a column is above its tolerance; nan: none.

    The first m columns count, each by its own size, and the event columns by the size of the state. A motion whose last
    terms vanish is stopped before it goes far beyond its size.
    """
    outlined()
    last = last_but_one = size = slope = total = 0.0
    a, b, first = pointer(c, order * stride), pointer(c, (order - 1) * stride), pointer(c, stride)
    for e in range(m):
        weight = 1.0 / (atol + rtol * abs(c[e]))
        last = max(last, abs(a[e]) * weight)
        last_but_one = max(last_but_one, abs(b[e]) * weight)
        total += a[e] + b[e]
        size, slope = max(size, abs(c[e])), max(slope, abs(first[e]))
    weight = 1.0 / (atol + rtol * size)
    for e in range(first_event, last_event):
        last = max(last, abs(a[e]) * weight)
        last_but_one = max(last_but_one, abs(b[e]) * weight)
        total += a[e] + b[e]
    if not abs(total) < math.inf:
        return math.nan
    return min(min(_root(last, order), _root(last_but_one, order - 1)), LONGEST_STEP * (1.0 + size) / slope)


@njit(**SUMS)
def _evaluate(c, order, stride, m, h, out):
    """Value of the first m columns at h."""
    last = pointer(c, order * stride)
    for e in range(m):
        out[e] = last[e]
    for i in range(order - 1, -1, -1):
        row = pointer(c, i * stride)
        for e in range(m):
            out[e] = out[e] * h + row[e]


@njit(**SUMS)
def _column(c, order, stride, column, h):
    """Value and derivative of one column at h."""
    value, slope = c[order * stride + column], 0.0
    for i in range(order - 1, -1, -1):
        slope = slope * h + value
        value = value * h + c[i * stride + column]
    return value, slope


@njit(**INNER)
def _reached(c, order, stride, column, target, low, high, guess):
    """Where in [low, high] a column passes a value, once, by Newton's method kept in bounds."""
    outlined()
    rises = _column(c, order, stride, column, high)[0] >= target
    s = guess
    for _ in range(100):
        value, slope = _column(c, order, stride, column, s)
        value -= target
        if value == 0.0:
            return s
        if (value > 0.0) == rises:
            high = s
        else:
            low = s
        new = s - value / slope
        if not low < new < high:
            new = 0.5 * (low + high)
        if abs(new - s) <= 2.0 * EPSILON * new:
            return new
        s = new
    return s


@njit(**INNER)
def _defect(field, mode, n_states, p, c, order, stride, at, h, rtol, atol, y, slopes):
    """By how many tolerances, over a time h, the slopes of the series differ from the field in the state y there."""
    call(field, mode, 0, y, 0, p, slopes, 0)
    worst = 0.0
    for e in range(n_states):
        slope = _column(c, order, stride, e, at)[1]
        worst = max(worst, abs(slopes[e] - slope) * h / (atol + rtol * max(abs(y[e]), abs(c[e]))))
    return worst


@njit(**INNER)
def _checked(
    addresses, mode, n, n_states, transitions, n_transitions, phase, p, c, order, stride, first_event, h, rtol, atol, x,
    y, slopes, event,
):  # fmt: skip
    """Shorten a step until its series solve the equations inside and at its end, and tell the event functions there.

    The last two terms say little of a series whose terms come and go: a pulse lies ahead, or most terms vanish here.
    """
    outlined()
    for _ in range(CUTS):
        worst = 0.0
        for fraction in (0.37, 0.71, 1.0):
            at = fraction * h
            _evaluate(c, order, stride, n_states, at, y)
            if phase > 0.0:
                y[n_states] = x[n_states] + phase * at
            defect = _defect(addresses[FIELD], mode, n_states, p, c, order, stride, at, h, rtol, atol, y, slopes)
            worst = max(worst, defect)
            size = 0.0
            for e in range(n_states):
                size = max(size, abs(y[e]))
            column = first_event - 1
            for k in range(n_transitions):
                if transitions[3 * k] == mode:
                    column += 1
                    call(addresses[EVENT], k, 0, y, 0, p, event, 0)
                    value = _column(c, order, stride, column, at)[0]
                    worst = max(worst, abs(event[0] - value) / (atol + rtol * max(size, abs(value))))
        if worst <= DEFECT:
            return h
        h *= 0.25
    return h


@njit(**SUMS)
def _terms(c, order, stride, column, h, first, b):
    """Write the coefficients of a column over h^first into b, in fractions of h.

    Returns the sums of sizes from 1 on and from 4 on, the sum of sizes times orders from 2 on, and the value at 1
    without the coefficient 0.
    """
    power = h if first == 1 else 1.0
    size = tail = weighted = end = 0.0
    for i in range(order + 1 - first):
        value = c[(i + first) * stride + column] * power
        power *= h
        b[i] = value
        value_size = abs(value)
        if i > 0:
            size += value_size
            end += value
        if i > 1:
            weighted += i * value_size
        if i > 3:
            tail += value_size
    return size, tail, weighted, end


@njit(**SUMS)
def _to_bernstein(b, degree, table, width):
    """Turn the coefficients of powers into Bernstein's, in place: row i of the table holds C(i, j) / C(degree, j)."""
    for i in range(degree, -1, -1):
        total = 0.0
        row = pointer(table, i * width)
        for j in range(i + 1):
            total += row[j] * b[j]
        b[i] = total


@njit(**INNER)
def _roots(c, order, stride, column, h, on, side, direction, binomials, b, pieces, work, found):
    """Roots of an event column in (0, h], as fractions of h, in order: (count, side before the first).

    on: the column is zero at 0, and that root is divided out. side: sign of the function before, 0 where it is not
    known. The count is -1 where the motion cannot be told from one that stays on the surface, or there are too many.
    Where the first root is an event by its direction and easily told, the others are not sought, and the last place in
    `found` is 1.
    """
    outlined()
    found[ROOTS - 1] = 0.0
    first = 1 if on else 0
    degree = order - first
    size, tail, weighted, end = _terms(c, order, stride, column, h, first, b)
    b0, b1 = b[0], b[1]
    end += b0
    count = 0
    if on:
        if not abs(b0) > 1e-9 * size:
            return -1, side
        leaves = 1 if b0 > 0.0 else -1
        if side != 0 and leaves != side:
            return -1, side
        side = leaves
    else:
        now = 1 if b0 > 0.0 else (-1 if b0 < 0.0 else side)
        if side == 0:
            side = now
        if now != side:
            # the start of this step is past a zero that the last one did not reach, to rounding
            found[0] = 0.0
            count = 1
    if abs(b0) > size:
        return count, side
    if abs(b1) > weighted:
        # monotone: one root or none
        if b0 * end <= 0.0 and b0 != 0.0:
            found[count] = _passed(b, degree, end)
            count += 1
        return count, side
    if b0 * end < 0.0 and count == 0 and (direction == 0 or direction == -side):
        root = _passed(b, degree, end)
        bent, power = 0.0, root
        for i in range(2, degree + 1):
            bent += i * abs(b[i]) * power
            power *= root
        if abs(b1) > bent:
            # monotone as far as this root
            found[0], found[ROOTS - 1] = root, 1.0
            return 1, side
    # the cubic part lies within its Bernstein coefficients, all of it within the sizes of the others
    sign = 1.0 if b0 > 0.0 else -1.0
    least = min(min(b0 * sign, (b0 + b1 / 3.0) * sign),
                min((b0 + (2.0 * b1 + b[2]) / 3.0) * sign, (b0 + b1 + b[2] + b[3]) * sign))  # fmt: skip
    if least > tail:
        return count, side
    for i in range(degree + 1):
        work[i] = b[i]
    _to_bernstein(b, degree, pointer(binomials, first * (order + 1) * (order + 1)), order + 1)
    changes, _first, _last = variations(b, degree)
    if changes == 0:
        return count, side
    if changes == 1:
        found[count] = _passed(work, degree, end)
        return count + 1, side
    count = bernstein_roots(b, degree, 1e-15 * (abs(b0) + size), 0.0, 1.0, pieces, work, found, count)
    return count, side


@njit(**INNER)
def _passed(b, degree, end):
    """The one place in (0, 1) where a polynomial changes sign, from its coefficients of powers and its value at 1."""
    outlined()
    b0, b1, b2 = b[0], b[1], b[2]
    inside = b1 * b1 - 4.0 * b0 * b2
    s = -2.0 * b0 / (b1 + math.copysign(math.sqrt(inside), b1)) if inside >= 0.0 else 0.5
    if not 0.0 < s < 1.0:
        s = b0 / (b0 - end) if b0 * end < 0.0 else 0.5
    low, high = 0.0, 1.0
    for _ in range(100):
        value, slope = _column(b, degree, 1, 0, s)
        if value * b0 > 0.0:
            low = s
        else:
            high = s
        new = s - value / slope
        if not low <= new <= high:
            new = 0.5 * (low + high)
        elif abs(new - s) <= SQUARE_ROOT * new:
            # Newton's method doubles the digits
            return new
        s = new
    return s


@njit(**INNER)
def _scale(gradient, n, x, phase):
    total = 0.0
    for e in range(n):
        total += abs(gradient[e] * (TWO_PI if phase > 0.0 and e == n - 1 else x[e]))
    return total


@njit(**INNER)
def _begin(addresses, forms, transitions, n_transitions, mode, n, phase, p, x, residual, dt, counts, side, on, event):
    """Begin a segment: on which side of every event it starts, and w behind the state; whether it is a plain start.

    residual: what the event function was at the landing; dt: the step that led there, 0 without one. Both tell what
    rounding is.
    """
    outlined()
    x[n] = 0.0
    counts[SIGMA_STEPS] = PAUSE
    for k in range(n_transitions):
        if transitions[3 * k] != mode:
            continue
        call(addresses[EVENT_X], k, 0, x, 0, p, event, 0)
        reach = ROUNDING * (_scale(pointer(event, 2), n, x, phase) + abs(event[1]) * dt) + 4.0 * residual
        on[k] = 1 if abs(event[0]) <= reach else 0
        known = side[k]
        side[k] = 1 if event[0] > 0.0 else -1
        if on[k] == 1:
            side[k] = 0
            if counts[FIRED] < 0 or (k != counts[FIRED] and counts[MODE_BEFORE] == mode):
                side[k] = known
            if side[k] == PASSES:
                side[k] = 0
                continue
            leaves = 1 if event[1] > 0.0 else -1
            consumed = k == counts[FIRED] and counts[MODE_BEFORE] == mode
            if side[k] == 0 and transitions[3 * k + 2] == leaves and not consumed:
                return False
        if k == forms[2 * mode] and on[k] == 0:
            x[n] = math.sqrt(max(forms[2 * mode + 1] * event[0], 0.0))
            if side[k] != forms[2 * mode + 1]:
                return False
    counts[STARTING] = 0
    return True


@njit(cache=True, error_model="numpy", nogil=True)
def follow_kernel(
    addresses, series, order, stride, forms, transitions, binomials, phase, p, p_series, longest, at_wrap,
    section, skip, budget, rtol, atol, x, numbers, counts, side, on, kept_states, kept_modes, kept_times,
):  # fmt: skip
    """Follow a motion from return to return to a section; keep those after the first `skip`.

    addresses: `Compiled.addresses`; series: that of ``series``; forms: (2 * modes,); transitions: (3 * n_transitions,) of source, target, direction; binomials:
    see `taylor.bernstein_table`; phase: its rate, 0 without one; p, p_series: parameters with the constants of either
    module; longest: time without a return after which it ends; at_wrap:
    whether the wraps of the phase are returns; section: (n_transitions,), which transitions are; x: full state and w,
    (n + 1,); numbers, counts: see above; side, on: (n_transitions,); kept_states: (m, n), kept_modes and kept_times:
    (m,).
    """
    n, n_transitions = x.size - 1, side.size
    block = np.empty((order + 1) * (stride + 2) + DEPTH * (order + 3) + n_transitions * ROOTS + 6 * n + 12)
    integers = np.empty(3 * n_transitions, np.int64)
    status = _follow(
        pointer(addresses, 0), series, order, stride, pointer(forms, 0), pointer(transitions, 0),
        pointer(binomials, 0), phase, pointer(p, 0), pointer(p_series, 0), longest, at_wrap, section, skip, budget, rtol,
        atol, pointer(x, 0), n, forms.size // 2, n_transitions, numbers, counts, pointer(side, 0), pointer(on, 0), kept_states,
        kept_modes, kept_times, pointer(block, 0), pointer(integers, 0),
    )  # fmt: skip
    keep(block)
    keep(integers)
    return status


@njit(**INNER)
def _follow(
    addresses, series, order, stride, forms, transitions, binomials, phase, p, p_series, longest, at_wrap,
    section, skip, budget, rtol, atol, x, n, n_modes, n_transitions, numbers, counts, side, on, kept_states, kept_modes,
    kept_times, block, integers,
):  # fmt: skip
    """The loop over the steps of `follow_kernel`, on pointers."""
    n_states = n - 1 if phase > 0.0 else n
    first_event = n_states + 2
    c = block
    b, work = pointer(block, (order + 1) * stride), pointer(block, (order + 1) * (stride + 1))
    pieces = pointer(block, (order + 1) * (stride + 2))
    found = pointer(pieces, DEPTH * (order + 3))
    y = pointer(found, n_transitions * ROOTS)
    after, event = pointer(y, n + 4), pointer(y, 2 * n + 5)
    n_found, before, passed = integers, pointer(integers, n_transitions), pointer(integers, 2 * n_transitions)
    room_kept = kept_times.size
    period = TWO_PI / phase if phase > 0.0 else math.inf
    while True:
        if counts[RETURNS] >= skip + room_kept or numbers[T] - numbers[RETURNED] > longest:
            return DONE
        if budget <= 0:
            return AGAIN
        budget -= 1
        mode = counts[MODE]
        if counts[STARTING] == 1 and not _begin(
            addresses, forms, transitions, n_transitions, mode, n, phase, p, x, 0.0, 0.0, counts, side, on, event
        ):
            return HELP
        form = forms[2 * mode]
        last_event = own_column = first_event
        for k in range(n_transitions):
            if transitions[3 * k] == mode:
                if k == form:
                    own_column = last_event
                last_event += 1
        w = dt = h = 0.0
        series_in_sigma = form >= 0
        if form < 0 or counts[SIGMA_STEPS] <= 0:
            call(series, mode, 0, x, 0, p_series, c, 0)
            h = _step_length(c, order, stride, n_states, first_event, last_event, rtol, atol)
            series_in_sigma = form >= 0 and not h > TIME_WORTH * numbers[SIGMA_STEP]
            if series_in_sigma:
                counts[SIGMA_STEPS] = PAUSE
                x[n] = math.sqrt(max(forms[2 * mode + 1] * c[own_column], 0.0))
        if series_in_sigma:
            call(series, n_modes + mode, 0, x, 0, p_series, c, 0)
            h = _step_length(c, order, stride, n_states + 1, first_event, last_event, rtol, atol)
            counts[SIGMA_STEPS] -= 1
        if not h > 0.0:
            return HELP
        if series_in_sigma:
            h *= 0.5 ** counts[SHORTER]
        else:
            h = min(h, period)
            if numbers[STEP] > 0.0:
                h = min(h, MOST_GROWTH * numbers[STEP])
            if h > GROWTH * numbers[STEP]:
                h = _checked(
                    addresses, mode, n, n_states, transitions, n_transitions, phase, p, c, order, stride, first_event, h,
                    rtol, atol, x, y, after, event,
                )  # fmt: skip

        # zeros of the event functions, and the first that counts
        fraction, fired = 2.0, -1
        column = first_event - 1
        for k in range(n_transitions):
            if transitions[3 * k] != mode:
                continue
            column += 1
            n_found[k], before[k] = _roots(
                c, order, stride, column, h, on[k] == 1, side[k], transitions[3 * k + 2], binomials, b, pieces, work,
                pointer(found, ROOTS * k),
            )  # fmt: skip
            if n_found[k] < 0:
                return HELP
            passed[k] = 0
        if series_in_sigma and n_found[form] > 0 and transitions[3 * form + 2] == before[form]:
            return HELP
        while True:
            fraction, fired, second = 2.0, -1, 2.0
            for k in range(n_transitions):
                if transitions[3 * k] != mode:
                    continue
                for j in range(passed[k], n_found[k]):
                    goes = -before[k] if j % 2 == 0 else before[k]
                    if transitions[3 * k + 2] == 0 or transitions[3 * k + 2] == goes:
                        at = found[ROOTS * k + j]
                        if at < fraction:
                            fraction, second, fired = at, fraction, k
                            passed[k] = j
                        else:
                            second = min(second, at)
                        break
            if fired >= 0 and not (SAME < fraction < min(second, 1.0) - SAME):
                return HELP
            end = h if fired < 0 else fraction * h
            _evaluate(c, order, stride, n_states + 2 if series_in_sigma else n_states, end, y)
            if fired < 0 and series_in_sigma and y[n_states] < FROM_SURFACE * x[n]:
                h *= 0.9
                end = h
                _evaluate(c, order, stride, n_states + 2, end, y)
            if not series_in_sigma:
                dt = end
            else:
                w, dt = y[n_states], y[n_states + 1]
                if not (0.0 < dt <= period):
                    break
            if phase > 0.0:
                y[n_states] = x[n_states] + phase * dt
            if fired < 0:
                break
            call(addresses[GUARD], n_modes + fired, 0, y, 0, p, after, 0)
            if after[0] > 0.0:
                break
            if fired == form or found[ROOTS * fired + ROOTS - 1] == 1.0:
                return HELP
            passed[fired] += 1
        is_cut = False
        if fired >= 0 and not series_in_sigma and dt > 0.0:
            defect = _defect(addresses[FIELD], mode, n_states, p, c, order, stride, end, end, rtol, atol, y, after)
            if defect > 1.0:
                if counts[APPROACHES] >= MOST_APPROACHES:
                    return HELP
                counts[APPROACHES] += 1
                is_cut = True
                fired, fraction = -1, APPROACH * fraction
                for k in range(n_transitions):
                    while (
                        transitions[3 * k] == mode and n_found[k] > 0 and found[ROOTS * k + n_found[k] - 1] > fraction
                    ):
                        n_found[k] -= 1
                dt = end = fraction * h
                _evaluate(c, order, stride, n_states, end, y)
                if phase > 0.0:
                    y[n_states] = x[n_states] + phase * dt
        if not (0.0 < dt <= period) and (fired < 0 or dt != 0.0):
            # in sigma: longer than a period, or past a zero of w, where time runs back
            if not counts[SHORTER] < SHORTER_MOST:
                return HELP
            counts[SHORTER] += 1
            continue
        counts[SHORTER] = 0
        residual = 0.0
        if fired >= 0:
            call(addresses[EVENT], fired, 0, y, 0, p, event, 0)
            residual = abs(event[0])
            size = 0.0
            for e in range(n_states):
                size = max(size, abs(y[e]))
            if phase > 0.0 and abs(x[n_states] + phase * dt - TWO_PI) <= SAME:
                return HELP
            if not residual <= LANDING * (atol + rtol * size) or event[1] * transitions[3 * fired + 2] < 0.0:
                return HELP

        # the phase's wrap inside the step
        if phase > 0.0 and x[n - 1] + phase * dt >= TWO_PI:
            to_wrap = (TWO_PI - x[n - 1]) / phase
            if at_wrap:
                counts[RETURNS] += 1
                numbers[RETURNED] = numbers[T]
                if counts[RETURNS] >= min(skip + 1, skip + room_kept):
                    s = min(to_wrap, end)
                    if series_in_sigma:
                        s = _reached(c, order, stride, n_states + 1, to_wrap, 0.0, end, end * to_wrap / dt)
                    _evaluate(c, order, stride, n_states, s, after)
                    i = counts[RETURNS] - skip - 1
                    if i >= 0:
                        for e in range(n_states):
                            kept_states[i, e] = after[e]
                        kept_states[i, n - 1] = 0.0
                        kept_modes[i] = mode
                        kept_times[i] = numbers[T] + to_wrap + numbers[T_LOW]
                    if counts[RETURNS] == skip + room_kept:
                        for e in range(n_states):
                            x[e] = after[e]
                        x[n - 1] = 0.0
                        advance(numbers, to_wrap)
                        counts[STARTING] = 1
                        counts[FIRED] = -1
                        return DONE
            x[n - 1] -= TWO_PI

        counts[STEPS] += 1
        if not is_cut:
            counts[APPROACHES] = 0
        numbers[STEP] = dt
        advance(numbers, dt)
        if phase > 0.0:
            x[n - 1] += phase * dt
        for e in range(n_states):
            x[e] = y[e]
        if series_in_sigma:
            numbers[SIGMA_STEP] = dt
        if fired < 0:
            x[n] = w
            for e in range(n_states):
                if not abs(x[e]) < BOUND:
                    return HELP
            call(addresses[GUARD], mode, 0, x, 0, p, after, 0)
            if not after[0] > 0.0:
                return HELP
            for k in range(n_transitions):
                if transitions[3 * k] == mode:
                    side[k] = before[k] if n_found[k] % 2 == 0 else -before[k]
                    on[k] = 0
            continue

        # a transition: onto its surface to rounding, then the reset
        correction = -event[0] / event[1]
        if abs(correction) <= 1e-4 * dt:
            call(addresses[FIELD], mode, 0, x, 0, p, after, 0)
            for e in range(n):
                x[e] += correction * after[e]
            advance(numbers, correction)
            residual = 0.0
        if section[fired] == 1:
            counts[RETURNS] += 1
            numbers[RETURNED] = numbers[T]
            if counts[RETURNS] > skip:
                i = counts[RETURNS] - skip - 1
                for e in range(n):
                    kept_states[i, e] = x[e]
                kept_modes[i] = mode
                kept_times[i] = numbers[T] + numbers[T_LOW]
        for k in range(n_transitions):
            if transitions[3 * k] == mode:
                side[k] = before[k]
                for j in range(n_found[k]):
                    if k != fired and found[ROOTS * k + j] < fraction:
                        side[k] = -side[k]
        call(addresses[RESET], fired, 0, x, 0, p, after, 0)
        for e in range(n):
            if not abs(after[e]) < math.inf:
                return HELP
            x[e] = after[e]
        counts[MODE] = transitions[3 * fired + 1]
        counts[MODE_BEFORE] = mode
        counts[FIRED] = fired
        counts[STARTING] = 1
        scale = period if phase > 0.0 else numbers[T]
        counts[SMALL_RUN] = counts[SMALL_RUN] + 1 if numbers[DURATION] <= SMALL_DURATION * scale else 0
        numbers[DURATION] = 0.0
        if (
            not _begin(
                addresses,
                forms,
                transitions,
                n_transitions,
                counts[MODE],
                n,
                phase,
                p,
                x,
                residual,
                dt,
                counts,
                side,
                on,
                event,
            )
            or counts[SMALL_RUN] > SMALL_RUN_MOST
        ):
            return HELP
