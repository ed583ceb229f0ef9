"""A step by Taylor series: how far the series reach, their zeros, where the step ends: docs/theory/series.md."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from saltus.flow.kernels.column import column_value, evaluate, roots, shortened, step_length
from saltus.flow.kernels.order import first_crossing
from saltus.flow.kernels.polynomial import ROOTS
from saltus.flow.kernels.rounded import BESIDE, rounding_at
from saltus.flow.kernels.shares import allowed, size_of
from saltus.flow.kernels.state import DURATION, PASSES, TWO_PI
from saltus.system.compiled import FUNCTIONS, SHARES
from saltus.system.numba_tools.machine_code import njit
from saltus.system.numba_tools.pointers import INNER, PART, call, numbers_at, outlined, pointer

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Integers = NDArray[np.int64]

FIELD = FUNCTIONS.index("field")
EVENT = FUNCTIONS.index("event")
GUARD = FUNCTIONS.index("guard")

# What `follow_kernel` returns.
DONE = 0  # all returns are there, or none came in the longest time
AGAIN = 1  # the budget of steps is spent
HELP = 2  # the next step is one for the Runge-Kutta flow
GOES_ON = 3  # what a step returns after which the motion goes on

# Places in `numbers`, behind those up to `DURATION`, which `advance` fills.
RETURNED = DURATION + 1  # time of the last return to the section
STEP = DURATION + 2  # length of the last step in time
SIGMA_STEP = DURATION + 3  # length, in time, of the last step in sigma
N_NUMBERS = DURATION + 4

# Places in `counts`.
MODE = 0
STARTING = 1  # 1 where a segment is about to begin
FIRED = 2  # transition of the last event; -1 for none
MODE_BEFORE = 3  # mode before the last event
RETURNS = 4  # returns to the section so far
SMALL_RUN = 5  # events in a row, each after less than `SMALL_DURATION`
STEPS = 6  # steps so far
SHORTER = 7  # halvings in a row of a step in sigma
SIGMA_STEPS = 8  # steps in sigma until series in time are tried again
APPROACHES = 9  # steps in a row that went a part of the way only
N_COUNTS = 10

SMALL_DURATION = 1e-6  # time between two events, in periods, that is short
SMALL_RUN_MOST = 5  # most events in a row after short times, before HELP is asked for
CROWD = 1e-3  # time without an event, in periods, after which help ends
FROM_SURFACE = 3e-5  # least part of w left by a step without an event: a start within rounding would lie on the surface
TIME_WORTH = 0.75  # length of a step in time, over the last one in sigma, from which the cheaper one in time is taken
SHORTEST = (
    1e-12  # length of a step, in periods or over the time, below which a pole of an event function stops the series
)
PAUSE = 2  # steps in sigma between two trials of series in time
SHORTER_MOST = 40  # most halvings in a row of a step in sigma at whose end time runs back
LANDING = 1e3  # event function at its landing, in tolerances, beyond which HELP is asked for
CHECKED = (0.37, 0.71, 1.0)  # fractions of a step at which its series are held against the field: the last one always
GROWTH = 1.6  # length of a step, over the last one, beyond which it is checked at the others as well
MOST_GROWTH = 4.0  # length of a step, over the last one, at most
DEFECT = 100.0  # defect of the equations, in tolerances, up to which a checked step holds
CUTS = 40  # most times that a checked step is cut to a quarter
# A weak part of a field may grow fast next to a surface, which the last terms of a series do not show from afar.
APPROACH = 0.6  # part of the way that a step goes whose series do not solve the equations where it lands
MOST_APPROACHES = 40  # such steps in a row before HELP is asked for
SIMPLE = (
    0.1  # of a function's value that a Newton step leaves at a simple zero, at most; it is a quarter at a double one
)
SAME = 1e-6  # distance of an event from the next one or from a step's ends, in steps, below which HELP is asked for


class Series(NamedTuple):
    """The series of a system's motions.

    Parameters
    ----------
    address : int
        Where ``series`` begins.
    order, stride, ways : int
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
    ways: int
    forms: Integers
    binomials: Floats
    p: Floats


class Returns(NamedTuple):
    """The returns to a section, and room for those that are kept.

    Parameters
    ----------
    at_wrap : bool
        Whether the wraps of the phase are returns.
    section : ndarray of int64, shape (transition,)
        1 for a transition that is a return, else 0.
    skip : int
        Returns that are dropped first.
    longest : float
        Time without a return after which the motion ends.
    room : int
        Most returns that are kept.
    states, modes, times : ndarray, shape (room, n), (room,) and (room,)
        The returns kept.
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
    """Where a motion is, changed in place: full state and w, (n + 1,); numbers and counts as above; sides of events."""

    x: Floats
    numbers: Floats
    counts: Integers
    side: Integers
    on: Integers


class Room(NamedTuple):
    """Room for the end of a step, for what is behind it, for an event function, sizes, another state: pointers.

    `sized` is for a state with its sizes, and a rounding.
    """

    y: Any
    after: Any
    event: Any
    size: Any
    other: Any
    sized: Any


class Landing(NamedTuple):
    """Where a step ends: on an event (-1: none), at a fraction of it, in its own time, in time, with w."""

    fired: int
    fraction: float
    end: float
    dt: float
    w: float


@njit(**INNER)
def defect(system, mode, columns, at, h, tolerances, y, slopes):
    """Difference of the series' slopes from the field in the state y there, times h, in tolerances."""
    call(system.addresses[FIELD], mode, 0, y, 0, system.p, slopes, 0)
    worst, shares = 0.0, numbers_at(system.addresses[SHARES])
    for e in range(system.n_states):
        slope = column_value(columns.c, columns.order, columns.stride, e, at)[1]
        size = max(abs(y[e]), abs(columns.c[e]))
        worst = max(worst, abs(slopes[e] - slope) * h / allowed(shares[e], size, tolerances.rtol, tolerances.atol))
    return worst


@njit(**INNER)
def _checked(system, mode, columns, h, first, tolerances, x, room):
    """Shorten a step until its series solve the equations, and are right for event functions, inside and at its end.

    The last two terms do not bound the error where a pulse lies ahead, or where most terms vanish. first: index of the
    first place in `CHECKED` that is looked at.
    """
    outlined()
    n_states, y, event = system.n_states, room.y, room.event
    c, order, stride, rtol, atol = columns.c, columns.order, columns.stride, tolerances.rtol, tolerances.atol
    shares = numbers_at(system.addresses[SHARES])
    for _ in range(CUTS):
        worst = 0.0
        for k in range(first, len(CHECKED)):
            at = CHECKED[k] * h
            evaluate(c, order, stride, n_states, at, y)
            if system.phase > 0.0:
                y[n_states] = x[n_states] + system.phase * at
            worst = max(worst, defect(system, mode, columns, at, h, tolerances, y, room.after))
            size = 0.0
            for e in range(n_states):
                size = max(size, size_of(shares[e], y[e]))
            place = n_states + 1
            for j in range(system.n_transitions):
                if system.transitions[3 * j] == mode:
                    place += 1
                    call(system.addresses[EVENT], j, 0, y, 0, system.p, event, 0)
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
    form, first_event, shares = forms[2 * mode], n_states + 2, numbers_at(system.addresses[SHARES])
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
        h = step_length(c, order, stride, n_states, first_event, last_event, (rtol, atol), shares, n_states)
        in_sigma = form >= 0 and not h > TIME_WORTH * numbers[SIGMA_STEP]
        if in_sigma:
            counts[SIGMA_STEPS] = PAUSE
            x[system.n] = math.sqrt(max(forms[2 * mode + 1] * c[own_column], 0.0))
    if in_sigma:
        call(series.address, system.n_modes + mode, 0, x, 0, series.p, c, 0)
        h = step_length(c, order, stride, n_states + 1, first_event, last_event, (rtol, atol), shares, n_states)
        counts[SIGMA_STEPS] -= 1
    if not h > 0.0:
        return math.nan, in_sigma
    if series.ways >= 0:
        h = shortened(c, order, stride, series.ways, h)
    if in_sigma:
        for _ in range(counts[SHORTER]):
            h *= 0.5
    else:
        h = min(h, period(system))
        if numbers[STEP] > 0.0:
            h = min(h, MOST_GROWTH * numbers[STEP])
        first = 0 if h > GROWTH * numbers[STEP] else len(CHECKED) - 1
        h = _checked(system, mode, columns, h, first, tolerances, x, room)
    return h, in_sigma


@njit(**PART)
def period(system):
    """Period of the drive, infinite without one."""
    return system.turn / system.phase if system.phase > 0.0 else math.inf


@njit(**PART)
def crossed(system, motion, mode, h, columns, crossings):
    """Find the zeros of the mode's event functions in a step; whether all could be."""
    place = system.n_states + 1
    for k in range(system.n_transitions):
        if system.transitions[3 * k] != mode:
            continue
        place += 1
        crossings.n_found[k], crossings.before[k] = roots(
            columns, place, h, motion.on[k] == 1, motion.side[k] if motion.side[k] != PASSES else 0, system.transitions[3 * k + 2],
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
            if not (0.0 < dt <= period(system)):
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
    residual, size, shares = abs(event[0]), 0.0, numbers_at(system.addresses[SHARES])
    for e in range(system.n_states):
        size = max(size, size_of(shares[e], y[e]))
    if system.phase > 0.0 and abs(motion.x[system.n_states] + system.phase * landing.dt - system.turn) <= SAME:
        return math.nan
    if not residual <= LANDING * (tolerances.atol + tolerances.rtol * size):
        return math.nan
    return math.nan if event[1] * system.transitions[3 * landing.fired + 2] < 0.0 else residual


@njit(**INNER)
def is_clear(system, landing, room):
    """Whether a step lands on a zero beside which the function is soon above its rounding, on both sides.

    Other zeros are no nearer than that, and the zero is simple: a Newton step leaves next to nothing of the function.
    `event` holds the function and its rate, from `residual_at`; the field is left in `other`.
    """
    outlined()
    y, size, event, field, after, n = room.y, room.size, room.event, room.other, room.after, system.n
    value, rate = event[0], event[1]
    for e in range(n):
        size[e] = TWO_PI if system.phase > 0.0 and e == n - 1 else abs(y[e])
    rounding = rounding_at(system, landing.fired, y, size, room.sized)
    if not BESIDE * rounding < SAME * landing.dt * abs(rate):
        return False
    call(system.addresses[FIELD], system.transitions[3 * landing.fired], 0, y, 0, system.p, field, 0)
    if abs(value) <= rounding:
        return True
    for e in range(n):
        after[e] = y[e] - value / rate * field[e]
    call(system.addresses[EVENT], landing.fired, 0, after, 0, system.p, event, 0)
    left = abs(event[0])
    event[0], event[1] = value, rate
    return left <= max(SIMPLE * abs(value), rounding)
