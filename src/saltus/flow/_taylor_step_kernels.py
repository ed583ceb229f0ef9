"""A step by Taylor series: how far the series reach, their zeros, where the step ends: docs/theory/series.md."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from saltus.flow._column_kernels import column_value, evaluate, roots, step_length
from saltus.flow._kernels import INNER, PART, call, outlined, pointer
from saltus.flow._order_kernels import first_crossing
from saltus.flow._polynomial_kernels import ROOTS
from saltus.flow._state_kernels import DURATION, TWO_PI
from saltus.system.compiled import FUNCTIONS
from saltus.system.machine_code import njit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Integers = NDArray[np.int64]

FIELD, EVENT, GUARD = (FUNCTIONS.index(name) for name in ("field", "event", "guard"))

DONE, AGAIN, HELP, GOES_ON = range(4)
"""What `follow_kernel` returns, AGAIN when the budget of steps is spent; GOES_ON is what a step returns."""

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


class Series(NamedTuple):
    """The series of a system's motions.

    Parameters
    ----------
    address : int
        Where ``series`` begins.
    order, stride : int
        As `CompiledSeries` has them.
    forms : ndarray of int64, shape (mode, 2)
        As `CompiledSeries` has them.
    binomials : ndarray
        See `taylor.bernstein_table`.
    p : ndarray
        Parameters with the constants of the series behind them.
    """

    address: int
    order: int
    stride: int
    forms: Integers
    binomials: Floats
    p: Floats


class Returns(NamedTuple):
    """What a return is, and which are kept.

    Parameters
    ----------
    at_wrap : bool
        Whether the wraps of the phase are returns.
    section : ndarray of int64, shape (transition,)
        Which transitions are.
    skip : int
        How many are dropped.
    longest : float
        Time without a return after which the motion ends.
    room : int
        How many are kept at the most.
    states, modes, times : ndarray, shape (room, n), (room,) and (room,)
        Those that are kept.
    """

    at_wrap: bool
    section: Integers
    skip: int
    longest: float
    room: int
    states: Floats
    modes: Integers
    times: Floats


class Motion(NamedTuple):
    """Where a motion is, changed in place: full state and w, (n + 1,); what stands at the places above; sides of events."""

    x: Floats
    numbers: Floats
    counts: Integers
    side: Integers
    on: Integers


class Room(NamedTuple):
    """Room for the end of a step, for what is behind it, and for an event function: pointers."""

    y: Any
    after: Any
    event: Any


class Landing(NamedTuple):
    """Where a step ends: on an event (-1: none), at a fraction of it, in its own time, in time, with w."""

    fired: int
    fraction: float
    end: float
    dt: float
    w: float


@njit(**INNER)
def defect(system, mode, columns, at, h, tolerances, y, slopes):
    """By how many tolerances, over a time h, the slopes of the series differ from the field in the state y there."""
    call(system.addresses[FIELD], mode, 0, y, 0, system.p, slopes, 0)
    worst = 0.0
    for e in range(system.n_states):
        slope = column_value(columns.c, columns.order, columns.stride, e, at)[1]
        size = max(abs(y[e]), abs(columns.c[e]))
        worst = max(worst, abs(slopes[e] - slope) * h / (tolerances.atol + tolerances.rtol * size))
    return worst


@njit(**INNER)
def _checked(system, mode, columns, h, tolerances, x, room):
    """Shorten a step until its series solve the equations inside and at its end, and tell the event functions there.

    The last two terms say little of a series whose terms come and go: a pulse lies ahead, or most terms vanish here.
    """
    outlined()
    n_states, y, event = system.n_states, room.y, room.event
    c, order, stride, rtol, atol = columns.c, columns.order, columns.stride, tolerances.rtol, tolerances.atol
    for _ in range(CUTS):
        worst = 0.0
        for fraction in (0.37, 0.71, 1.0):
            at = fraction * h
            evaluate(c, order, stride, n_states, at, y)
            if system.phase > 0.0:
                y[n_states] = x[n_states] + system.phase * at
            worst = max(worst, defect(system, mode, columns, at, h, tolerances, y, room.after))
            size = 0.0
            for e in range(n_states):
                size = max(size, abs(y[e]))
            place = n_states + 1
            for k in range(system.n_transitions):
                if system.transitions[3 * k] == mode:
                    place += 1
                    call(system.addresses[EVENT], k, 0, y, 0, system.p, event, 0)
                    value = column_value(c, order, stride, place, at)[0]
                    worst = max(worst, abs(event[0] - value) / (atol + rtol * max(size, abs(value))))
        if worst <= DEFECT:
            return h
        h *= 0.25
    return h


@njit(**PART)
def expanded(system, series, tolerances, motion, mode, columns, room):
    """Write the series at the state, in sigma where those in time do not reach far enough: step (nan: none), whether so."""
    n_states, forms, x, numbers, counts = system.n_states, series.forms, motion.x, motion.numbers, motion.counts
    c, order, stride, rtol, atol = columns.c, columns.order, columns.stride, tolerances.rtol, tolerances.atol
    form, first_event = forms[2 * mode], n_states + 2
    last_event = own_column = first_event
    for k in range(system.n_transitions):
        if system.transitions[3 * k] == mode:
            if k == form:
                own_column = last_event
            last_event += 1
    h = 0.0
    in_sigma = form >= 0
    if form < 0 or counts[SIGMA_STEPS] <= 0:
        call(series.address, mode, 0, x, 0, series.p, c, 0)
        h = step_length(c, order, stride, n_states, first_event, last_event, rtol, atol)
        in_sigma = form >= 0 and not h > TIME_WORTH * numbers[SIGMA_STEP]
        if in_sigma:
            counts[SIGMA_STEPS] = PAUSE
            x[system.n] = math.sqrt(max(forms[2 * mode + 1] * c[own_column], 0.0))
    if in_sigma:
        call(series.address, system.n_modes + mode, 0, x, 0, series.p, c, 0)
        h = step_length(c, order, stride, n_states + 1, first_event, last_event, rtol, atol)
        counts[SIGMA_STEPS] -= 1
    if not h > 0.0:
        return math.nan, in_sigma
    if in_sigma:
        h *= 0.5 ** counts[SHORTER]
    else:
        h = min(h, period(system.phase))
        if numbers[STEP] > 0.0:
            h = min(h, MOST_GROWTH * numbers[STEP])
        if h > GROWTH * numbers[STEP]:
            h = _checked(system, mode, columns, h, tolerances, x, room)
    return h, in_sigma


@njit(**PART)
def period(phase):
    """Period of the phase, infinite without one."""
    return TWO_PI / phase if phase > 0.0 else math.inf


@njit(**PART)
def crossed(system, motion, mode, h, columns, crossings):
    """Find the zeros of the mode's event functions in a step; whether all could be."""
    place = system.n_states + 1
    for k in range(system.n_transitions):
        if system.transitions[3 * k] != mode:
            continue
        place += 1
        crossings.n_found[k], crossings.before[k] = roots(
            columns, place, h, motion.on[k] == 1, motion.side[k], system.transitions[3 * k + 2],
            pointer(crossings.found, ROOTS * k),
        )  # fmt: skip
        if crossings.n_found[k] < 0:
            return False
        crossings.passed[k] = 0
    return True


@njit(**PART)
def landed(system, form, motion, mode, h, in_sigma, columns, crossings, room):
    """Go to the first event that counts, or the end of the step: whether that is plain, and where it is."""
    n, n_states, x, y, w, dt = system.n, system.n_states, motion.x, room.y, 0.0, 0.0
    c, order, stride = columns.c, columns.order, columns.stride
    while True:
        fired, fraction, index, second = first_crossing(system, crossings, mode)
        if fired >= 0:
            crossings.passed[fired] = index
            if not (SAME < fraction < min(second, 1.0) - SAME):
                return False, Landing(fired, fraction, h, dt, w)
        end = h if fired < 0 else fraction * h
        evaluate(c, order, stride, n_states + 2 if in_sigma else n_states, end, y)
        if fired < 0 and in_sigma and y[n_states] < FROM_SURFACE * x[n]:
            end = 0.9 * h
            evaluate(c, order, stride, n_states + 2, end, y)
        if not in_sigma:
            dt = end
        else:
            w, dt = y[n_states], y[n_states + 1]
            if not (0.0 < dt <= period(system.phase)):
                break
        if system.phase > 0.0:
            y[n_states] = x[n_states] + system.phase * dt
        if fired < 0:
            break
        call(system.addresses[GUARD], system.n_modes + fired, 0, y, 0, system.p, room.after, 0)
        if room.after[0] > 0.0:
            break
        if fired == form or crossings.found[ROOTS * fired + ROOTS - 1] == 1.0:
            return False, Landing(fired, fraction, end, dt, w)
        crossings.passed[fired] += 1
    return True, Landing(fired, fraction, end, dt, w)


@njit(**INNER)
def cut_short(system, motion, mode, h, fraction, columns, crossings, y):
    """End a step in time before its event, at a fraction of it."""
    outlined()
    for k in range(system.n_transitions):
        if system.transitions[3 * k] == mode:
            found = pointer(crossings.found, ROOTS * k)
            while crossings.n_found[k] > 0 and found[crossings.n_found[k] - 1] > fraction:
                crossings.n_found[k] -= 1
    end = fraction * h
    evaluate(columns.c, columns.order, columns.stride, system.n_states, end, y)
    if system.phase > 0.0:
        y[system.n_states] = motion.x[system.n_states] + system.phase * end
    return Landing(-1, fraction, end, end, 0.0)


@njit(**PART)
def residual_at(system, tolerances, motion, landing, room):
    """Size of an event function at its landing; nan where that is not plain."""
    y, event = room.y, room.event
    call(system.addresses[EVENT], landing.fired, 0, y, 0, system.p, event, 0)
    residual, size = abs(event[0]), 0.0
    for e in range(system.n_states):
        size = max(size, abs(y[e]))
    if system.phase > 0.0 and abs(motion.x[system.n_states] + system.phase * landing.dt - TWO_PI) <= SAME:
        return math.nan
    if not residual <= LANDING * (tolerances.atol + tolerances.rtol * size):
        return math.nan
    return math.nan if event[1] * system.transitions[3 * landing.fired + 2] < 0.0 else residual
