"""Records of arrays that the kernels of a motion take, and the places of numbers in these arrays.

From Python a record holds arrays and numbers; in a kernel it holds pointers instead of the arrays.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from saltus.system.numba_tools.machine_code import njit
from saltus.system.numba_tools.pointers import INNER, PART, outlined, pointer

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Integers = NDArray[np.int64]

# What a motion by Runge-Kutta steps ends with.
DONE = 0  # the goal is reached
AGAIN = 1  # a buffer is full, or the budget of steps is spent
CHATTERING = 2  # events accumulate
UNBOUNDED = 3  # a state grows beyond `Tolerances.bound`
STEP_UNDERFLOW = 4  # the step falls to nothing
LEFT_DOMAIN = 5
FIELD_NOT_FINITE = 6
RESET_NOT_FINITE = 7
EVENT_NOT_FINITE = 8
NEGATIVE_ROOT = 9  # the argument of a root is negative beyond the errors of the states

# Places in `State.numbers`.
T = 0  # time
T_LOW = 1  # rounding of the time, which added to it gives the exact time
STEP = 2  # length of the next step
DURATION = 3  # time since the last event
LONGEST = 4  # longest time between two events
LAST = 5  # duration of the last segment
LAST_BUT_ONE = 6  # duration of the segment before
FIRST_STEP = 7  # first step of the present segment
RESIDUAL = 8  # event function at the last landing, over the size of its terms
STEP_BEFORE = 9  # last accepted step of the present segment; 0 for none
ERROR_BEFORE = 10  # error of that step, over the tolerance
RATE_AFTER = 11  # rate of the last event's function just after the event
GUESSED = 12  # length of the step whose dense output is a guess of the next implicit one; 0 for none
N_NUMBERS = 13

# Places in `State.counts`.
MODE = 0
STARTING = 1  # 1 where a segment is about to begin
FIRED = 2  # transition of the last event; -1 for none
MODE_BEFORE = 3  # mode before the last event
WRAPS = 4  # wraps of the phase so far
EVENTS = 5  # transitions so far
SMALL_RUN = 6  # segments in a row shorter than `CHATTERING_DURATION`
SHRINKING_RUN = 7  # segments in a row, each shorter than the last but one
STILL_RUN = 8  # segments in a row whose duration is rounding of the time
HOP_RUN = 9  # hops in a row that are lower than rounding
N_STEPS = 10  # steps in the buffer
N_EVENTS = 11  # events in the buffer
TRIES = 12  # steps tried so far
UNDER = 13  # 1 where the argument of a root was negative at the last look, within errors
N_COUNTS = 14

PASSES = 2  # a side besides -1, 0 (unknown) and 1: a start on the surface is no event, whichever way the motion leaves
AT_WRAP = 1e-9  # radians before the phase's wrap within which an event comes after it, so that the strobe precedes it
CHATTERING_RUN = 50  # events in a row, each after a short time, that are not yet chattering
CHATTERING_DURATION = 1e-10  # such a short time, as a part of the time scale
NOTHING = 1e-30  # a time, as a part of the time scale, from which hops go on to shrink until their heights underflow
NOTHING_RUN = 3  # such hops that are chattering, if each is shorter than the last but one
BOUND = 1e12  # least size of a state at which it may have diverged, where the problem has no larger sizes

EPSILON = 2.220446049250313e-16  # spacing of floats at 1
TWO_PI = 2.0 * math.pi


class System(NamedTuple):
    """The system that moves.

    Parameters
    ----------
    addresses : ndarray of int64
        `Compiled.motion`, or `Compiled.addresses` where derivatives are needed.
    transitions : ndarray of int64, shape (transition, 3)
        Source, target, direction.
    clocks : ndarray of int64, shape (transition,)
        The first transition with the same event function of the phase alone; -1 for other events.
    opposites : ndarray of int64, shape (transition,)
        For a way out of a mode that slides along a surface the way out to the other side; -1 for other transitions.
    p : ndarray
        Parameters with the constants behind them.
    phase, turn : float
        Rate of the phase, 0 without one, and the angle after which it is back at 0, a period of the drive.
    n, n_states, n_modes, n_transitions : int
        Counts of all states, of those without the phase, of modes and of transitions.
    """

    addresses: Integers
    transitions: Integers
    clocks: Integers
    opposites: Integers
    p: Floats
    phase: float
    turn: float
    n: int
    n_states: int
    n_modes: int
    n_transitions: int


class Tolerances(NamedTuple):
    """Tolerances of a step, and how it is taken.

    Parameters
    ----------
    rtol, atol : float
        Tolerances.
    bound : float
        Size of a state at which it has diverged, if it grows.
    attempt, within, carry : int
        Addresses of these functions of `saltus.flow.kernels.implicit_motion`, 0 where steps are explicit. Implicit ones need
        derivatives among `System.addresses`.
    """

    rtol: float
    atol: float
    bound: float
    attempt: int = 0
    within: int = 0
    carry: int = 0


class Goal(NamedTuple):
    """Where a motion ends, whichever is first: a time, counts of the phase's wraps and of events, steps from now on."""

    t_end: float
    wraps: int
    events: int
    budget: int


class State(NamedTuple):
    """Where a motion is, kept between calls and changed in place.

    Parameters
    ----------
    x : ndarray, shape (n,)
        Full state.
    slopes : ndarray, shape (16 * n,)
        Slopes at the stages of the step; the first is that at x.
    size : ndarray, shape (n,)
        Sizes of the states, from which the rounding of event functions follows.
    numbers, counts : ndarray
        See the places above.
    side, on : ndarray of int64, shape (transition,)
        The side of each event function's zero, and whether the motion is on the surface.
    value : ndarray, shape (transition,)
        Values of the event functions.
    first_steps : ndarray, shape (mode,)
        First step of a segment in each mode, 0 where none is known.
    guess : ndarray, shape (14 * n,)
        Dense output of the last implicit step, and of a part of one.
    n_touched : ndarray of int64, shape (transition,)
        Steps in which an event function is zero within its rounding and does not change its sign.
    touched : ndarray, shape (transition, 2)
        Times of the first and of the last such place.
    reach : ndarray, shape (n,)
        Largest sizes of the states since the argument of a root has been negative, within errors.
    """

    x: Floats
    slopes: Floats
    size: Floats
    numbers: Floats
    counts: Integers
    side: Integers
    on: Integers
    value: Floats
    first_steps: Floats
    guess: Floats
    n_touched: Integers
    touched: Floats
    reach: Floats


class Steps(NamedTuple):
    """Buffers of the steps taken.

    Parameters
    ----------
    room : int
        How many steps they hold; none is stored for 0.
    times : ndarray, shape (step, 2)
        Start and length.
    modes : ndarray of int64, shape (step,)
        Modes.
    starts : ndarray, shape (step, n)
        States at their starts.
    dense : ndarray, shape (step, 7, n)
        Dense output.
    """

    room: int
    times: Floats
    modes: Integers
    starts: Floats
    dense: Floats


class Events(NamedTuple):
    """Buffers of the events passed.

    Parameters
    ----------
    room : int
        How many events they hold.
    times : ndarray, shape (event,)
        Times.
    which : ndarray of int64, shape (event, 3)
        Transition (-1: the phase's wrap), modes before and after.
    ends : ndarray, shape (event, 2, n)
        States before and after.
    rates : ndarray, shape (event,)
        Rates of the event functions before.
    """

    room: int
    times: Floats
    which: Integers
    ends: Floats
    rates: Floats


class Crossings(NamedTuple):
    """Zeros of the event functions of a step.

    Parameters
    ----------
    found : ndarray, shape (transition, ROOTS)
        Their places, as fractions of the step, in order.
    n_found : ndarray of int64, shape (transition,)
        How many.
    before : ndarray of int64, shape (transition,)
        Side of the function before the first.
    passed : ndarray of int64, shape (transition,)
        How many of them do not count, their conditions having failed.
    jumps : ndarray of int64, shape (transition,)
        Bits of those at which the function is not zero: it jumps, or has a pole.
    touched : ndarray, shape (transition,)
        Fraction of the step at which the function is zero within rounding, without a change of its sign.
    """

    found: Floats
    n_found: Integers
    before: Integers
    passed: Integers
    jumps: Integers
    touched: Floats


@njit(**PART)
def system_pointers(system):
    """The record of a system with pointers."""
    return System(
        pointer(system.addresses, 0), pointer(system.transitions, 0), pointer(system.clocks, 0),
        pointer(system.opposites, 0), pointer(system.p, 0), system.phase, system.turn, system.n, system.n_states,
        system.n_modes, system.n_transitions,
    )  # fmt: skip


@njit(**PART)
def state_pointers(state):
    """The record of a state with pointers."""
    return State(
        pointer(state.x, 0), pointer(state.slopes, 0), pointer(state.size, 0), pointer(state.numbers, 0),
        pointer(state.counts, 0), pointer(state.side, 0), pointer(state.on, 0), pointer(state.value, 0),
        pointer(state.first_steps, 0), pointer(state.guess, 0), pointer(state.n_touched, 0), pointer(state.touched, 0),
        pointer(state.reach, 0),
    )  # fmt: skip


@njit(**PART)
def step_pointers(steps):
    """The record of the steps with pointers."""
    return Steps(
        steps.room, pointer(steps.times, 0), pointer(steps.modes, 0), pointer(steps.starts, 0), pointer(steps.dense, 0)
    )


@njit(**PART)
def event_pointers(events):
    """The record of the events with pointers."""
    return Events(
        events.room, pointer(events.times, 0), pointer(events.which, 0), pointer(events.ends, 0),
        pointer(events.rates, 0),
    )  # fmt: skip


@njit(**INNER)
def advance(numbers, dt):
    """Add to the time, with the rounding kept apart."""
    t = numbers[T]
    new = t + dt
    numbers[T_LOW] += (t - new) + dt if t >= dt else (dt - new) + t
    numbers[T] = new
    numbers[DURATION] += dt


@njit(**INNER)
def record_step(steps, state, n, h, mode, dense):
    """Store a step of length h from the state."""
    outlined()
    i, numbers = state.counts[N_STEPS], state.numbers
    steps.times[2 * i] = numbers[T] + numbers[T_LOW]
    steps.times[2 * i + 1] = h
    steps.modes[i] = mode
    for e in range(n):
        steps.starts[i * n + e] = state.x[e]
    for e in range(7 * n):
        steps.dense[7 * i * n + e] = dense[e]
    state.counts[N_STEPS] = i + 1


@njit(**INNER)
def record_event(events, state, n, k, rate, before, after, mode, target):
    """Store event k (-1: the phase's wrap) from a state and mode to others."""
    outlined()
    i, numbers = state.counts[N_EVENTS], state.numbers
    events.times[i] = numbers[T] + numbers[T_LOW]
    events.which[3 * i] = k
    events.which[3 * i + 1] = mode
    events.which[3 * i + 2] = target
    events.rates[i] = rate
    for e in range(n):
        events.ends[2 * i * n + e] = before[e]
        events.ends[(2 * i + 1) * n + e] = after[e]
    state.counts[N_EVENTS] = i + 1


@njit(**INNER)
def record_touch(state, k, time):
    """Store a place where event function k is zero within its rounding and does not change its sign."""
    outlined()
    seen = state.n_touched[k]
    if seen == 0:
        state.touched[2 * k] = time
    elif time <= state.touched[2 * k + 1]:
        return
    state.n_touched[k] = seen + 1
    state.touched[2 * k + 1] = time


@njit(**INNER)
def chatters(counts, numbers, phase, turn):
    """Whether the event that ends a segment is one of infinitely many; the next segment's times are set."""
    outlined()
    duration = numbers[DURATION]
    scale = turn / phase if phase > 0.0 else numbers[LONGEST]
    still = duration <= 4.0 * EPSILON * max(scale, numbers[T])
    small = duration <= CHATTERING_DURATION * scale
    shrinking = still or duration < 0.9999 * numbers[LAST_BUT_ONE]
    counts[SMALL_RUN] = counts[SMALL_RUN] + 1 if small else 0
    counts[SHRINKING_RUN] = counts[SHRINKING_RUN] + 1 if shrinking else 0
    counts[STILL_RUN] = counts[STILL_RUN] + 1 if still else 0
    vanishing = 0.0 < duration <= NOTHING * max(scale, numbers[T]) and counts[SHRINKING_RUN] > NOTHING_RUN
    if (
        min(counts[SMALL_RUN], counts[SHRINKING_RUN]) > CHATTERING_RUN
        or counts[STILL_RUN] > CHATTERING_RUN
        or vanishing
    ):
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
