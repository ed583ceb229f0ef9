"""Compiled variational equations of a hybrid motion: its steps taken again with a frame, saltation, orthonormalisation.

`run_kernel` follows the motion and leaves its steps and events. Each step is taken again with the columns of a frame
beside the state. A whole step has the same stages of the state as the motion; a step too long for the frame, as where
the motion rests, is taken in parts. At an event the frame passes through the saltation matrix. After every part and
event the frame is made orthonormal in units of the states' sizes, and the logarithms of its columns' lengths are summed.
See docs/theory/lyapunov.md.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from saltus.flow.kernels.event import run_kernel
from saltus.flow.kernels.shares import raised, weighed
from saltus.flow.kernels.stages import error_in_units, stage
from saltus.flow.kernels.state import (
    AGAIN,
    DONE,
    EPSILON,
    N_EVENTS,
    N_STEPS,
    T_LOW,
    Goal,
    T,
    event_pointers,
    step_pointers,
    system_pointers,
)
from saltus.system.compiled import FUNCTIONS
from saltus.system.numba_tools.machine_code import njit
from saltus.system.numba_tools.pointers import INNER, call, invoke, keep, outlined, pointer

if TYPE_CHECKING:
    from numpy.typing import NDArray

FIELD = FUNCTIONS.index("field")
VARY = FUNCTIONS.index("vary")
EVENT_X = FUNCTIONS.index("event_x")
RESET_X = FUNCTIONS.index("reset_x")

# Places in `places`.
ROW = 0  # the row under way
LIVE = 1  # columns that have not collapsed
GRAZED = 2  # events that were grazed
N_PLACES = 3
GRAZING = 1e-14  # normal velocity, over its terms, below which it is zero and there is no saltation matrix
COLLAPSED = 64.0 * EPSILON  # length of a column after an event, over its terms, that is rounding: its direction is lost
LOOSER = 1e3  # tolerance of the frame, over that of the motion
LOOSEST = 1e-4  # largest tolerance of the frame, relative
SHORTEST = 1e-12  # part of a step at which the frame still errs where the field's Jacobian is not finite
SHRUNK = 1.0 / 400.0  # length to which a column shrinks in an implicit step below which the step does not resolve it
CLEAR = 1e-4  # normal velocity, over its terms, above which no grazing makes columns small


class Rows(NamedTuple):
    """Stretches of a motion, one after the other.

    Parameters
    ----------
    times : ndarray, shape (row,)
        The time at which each ends; or
    wraps : ndarray of int64, shape (row,)
        the count of wraps.
    growth : ndarray, shape (row, columns)
        Logarithms of the columns' growth in each row, -inf from the row on in which one collapses.
    ends : ndarray, shape (row,)
        Times at which they ended.
    """

    times: NDArray[np.float64]
    wraps: NDArray[np.int64]
    growth: NDArray[np.float64]
    ends: NDArray[np.float64]


class Units(NamedTuple):
    """Sizes of the states along a motion, in which its perturbations are measured.

    Parameters
    ----------
    caps : ndarray, shape (n,)
        Largest sizes that count: half a turn of an angle, nothing of the phase.
    sizes : ndarray, shape (n,)
        The largest so far.
    weights : ndarray, shape (n,)
        Inverse units of the perturbations.
    units : ndarray, shape (n,)
        Their units.
    """

    caps: NDArray[np.float64]
    sizes: NDArray[np.float64]
    weights: NDArray[np.float64]
    units: NDArray[np.float64]


class Frame(NamedTuple):
    """Perturbations of a motion, and room for their sizes and growth: pointers.

    Parameters
    ----------
    columns : int
        How many.
    vectors : float64 pointer, (n, columns)
        The perturbations.
    weights, units : float64 pointer, (n,)
        Inverse units of the components, and their units.
    terms : float64 pointer, (columns,)
        Size of the terms of each perturbation.
    gains, rough : float64 pointer, (columns,)
        Logarithms of growth in a part of a step, and what an implicit one does not resolve.
    """

    columns: int
    vectors: Any
    weights: Any
    units: Any
    terms: Any
    gains: Any
    rough: Any


class Room(NamedTuple):
    """Room for a step of state and frame, of length n (1 + columns): pointers to 13 slopes, its start and behind it its end."""

    slopes: Any
    y: Any
    trial: Any


@njit(**INNER)
def _take(addresses, mode, n, frame, h, p, slopes, y, trial):
    """Take a step of state and frame from y to trial; the error of the frame, whose columns have length 1 in y."""
    outlined()
    columns = frame.columns
    length = n * (1 + columns)
    call(addresses[VARY], mode, columns, y, 0, p, slopes, 0)
    for i in range(1, 13):
        stage(i, slopes, length, h, y, trial)
        if i < 12:
            call(addresses[VARY], mode, columns, trial, 0, p, slopes, i * length)
    return error_in_units(pointer(slopes, n), length, n, columns, h, frame.units)


@njit(**INNER)
def _carry(system, implicit, mode, x, h, dense, frame, live, longest, tolerance, growth, room):
    """Carry a frame over a step of the state from x, orthonormal at its end; how many columns live, and `longest`.

    implicit: address of `carry` of `saltus.flow.kernels.implicit_motion`, for a step with that dense output; 0 for an explicit
    one.

    The step is taken in parts not longer than `longest`. They become shorter until the frame's error is below
    `tolerance` times the shortest length to which an orthonormal column shrinks.
    """
    outlined()
    n, columns, terms, gains, y, trial = system.n, frame.columns, frame.terms, frame.gains, room.y, room.trial
    for c in range(columns):
        terms[c] = 0.0 if implicit == 0 else SHRUNK / COLLAPSED
    for e in range(n):
        y[e] = x[e]
    for e in range(n * columns):
        y[n + e] = frame.vectors[e]
    left = h
    while left > 0.0:
        part = left if left <= longest else left / math.ceil(left / longest)
        if implicit == 0:
            error = _take(system.addresses, mode, n, frame, part, system.p, room.slopes, y, trial) / tolerance
        else:
            begun, rough = h - left, frame.rough
            arguments = (
                system.addresses,
                mode,
                n,
                system.p,
                part,
                h,
                begun,
                dense,
                columns,
                y,
                frame.weights,
                rough,
            )
            error = 0.0 if invoke(implicit, arguments) > 0.0 else math.inf
        remaining = live
        if error <= 1.0:
            for c in range(columns):
                gains[c] = 0.0
            remaining = _orthonormalise(pointer(trial, n), frame, n, live, gains)
            least = 0.0
            for c in range(remaining):
                least = min(least, gains[c])
                if implicit != 0:
                    error = max(error, frame.rough[c] / tolerance)
            error *= math.exp(-least)
        if not error <= 1.0:
            longest = part * (max(0.2, 0.9 * error**-0.125) if error < math.inf else 0.2)
            if longest < SHORTEST * h:
                growth[0] = math.nan
                return live, math.inf
            continue
        live = remaining
        for c in range(columns):
            growth[c] += gains[c]
        for e in range(n * (1 + columns)):
            y[e] = trial[e]
        if part < h and (implicit == 0 or part < left):  # an implicit step is tried whole at first
            longest = part * (min(5.0, 0.9 * error**-0.125) if error > 0.0 else 5.0)
        else:
            longest = math.inf
        left = left - part if part < left else 0.0
    for e in range(n * columns):
        frame.vectors[e] = y[n + e]
    return live, longest


@njit(**INNER)
def _saltate(addresses, k, mode, target, n, before, after, p, carried, work):
    """Carry a frame over an event; whether there is a saltation matrix, the event not being grazed.

    The size of the terms of each column is left with the frame; 0 where the event is not clear of a grazing, as small
    columns are then no rounding. work: (n^2 + 5 n + 2 + 2 columns,).
    """
    outlined()
    columns, frame, terms = carried.columns, carried.vectors, carried.terms
    event, f1, f2, column = work, pointer(work, 2 + 2 * n), pointer(work, 2 + 3 * n), pointer(work, 2 + 4 * n)
    jacobian = pointer(work, 2 + 5 * n)
    row, sizes = pointer(jacobian, n * n), pointer(jacobian, n * n + columns)
    call(addresses[EVENT_X], k, 0, before, 0, p, event, 0)
    rate, gradient = event[1], pointer(event, 2)
    call(addresses[FIELD], mode, 0, before, 0, p, f1, 0)
    scale = 0.0
    for e in range(n):
        scale += abs(gradient[e] * f1[e])
    if not abs(rate) > GRAZING * scale:
        return False
    call(addresses[FIELD], target, 0, after, 0, p, f2, 0)
    call(addresses[RESET_X], k, 0, before, 0, p, jacobian, 0)
    # how much later each perturbed motion meets the surface, and the terms of that
    for c in range(columns):
        row[c] = sizes[c] = terms[c] = 0.0
        for e in range(n):
            row[c] += gradient[e] * frame[e * columns + c] / rate
            sizes[c] += abs(gradient[e] * frame[e * columns + c] / rate)
    # frame := Dg frame + (f2 - Dg f1) row, a column at a time
    for c in range(columns):
        for e in range(n):
            column[e] = frame[e * columns + c]
        for i in range(n):
            total, size = f2[i] * row[c], abs(f2[i]) * sizes[c]
            for j in range(n):
                entry = jacobian[i * n + j]
                total += entry * (column[j] - f1[j] * row[c])
                size += abs(entry) * (abs(column[j]) + abs(f1[j]) * sizes[c])
            frame[i * columns + c] = total
            if abs(rate) > CLEAR * scale:
                terms[c] += size * carried.weights[i]
    return True


@njit(**INNER)
def _length(vectors, n, columns, c):
    total = 0.0
    for e in range(n):
        total += vectors[e * columns + c] ** 2
    return math.sqrt(total)


@njit(**INNER)
def _scale(vectors, factors, n, columns):
    """Multiply components of vectors by factors that are powers of 2."""
    for e in range(n):
        if factors[e] != 1.0:
            for c in range(columns):
                vectors[e * columns + c] *= factors[e]


@njit(**INNER)
def _orthonormalise(vectors, frame, n, live, growth):
    """Make the first `live` columns orthonormal, in order, adding the logarithms of their lengths to `growth`.

    Modified Gram-Schmidt, a second time for a column that lost half its length. A column that vanishes, or is shorter
    than its rounding, `COLLAPSED` of its terms, is taken out and those after it move up. Returns how many are left.
    vectors: (n, columns), those of the frame or what follows them.
    """
    outlined()
    columns, terms = frame.columns, frame.terms
    _scale(vectors, frame.weights, n, columns)
    c = 0
    while c < live:
        length = _length(vectors, n, columns, c)
        for _ in range(2):
            earlier = length
            for b in range(c):
                product = 0.0
                for e in range(n):
                    product += vectors[e * columns + b] * vectors[e * columns + c]
                for e in range(n):
                    vectors[e * columns + c] -= product * vectors[e * columns + b]
            if c > 0:
                length = _length(vectors, n, columns, c)
            if length > 0.5 * earlier:
                break
        if length <= COLLAPSED * terms[c]:
            live -= 1
            for d in range(c, live):
                terms[d] = terms[d + 1]
                for e in range(n):
                    vectors[e * columns + d] = vectors[e * columns + d + 1]
            for e in range(n):
                vectors[e * columns + live] = 0.0
            continue
        growth[c] += math.log(length)
        for e in range(n):
            vectors[e * columns + c] /= length
        c += 1
    _scale(vectors, frame.units, n, columns)
    return live


@njit(**INNER)
def _measured(taken, count, frame, n, live, units):
    """Measure a frame by the sizes that the states have in some steps more; how many columns live.

    The columns stay what they are, in span and order, and a change of units is no growth. Before the first step they are
    orthonormal in units of 1, and become so in the new ones.
    """
    outlined()
    first, beyond = True, False
    for e in range(n):
        first = first and units.sizes[e] == 0.0
    for step in range(count):
        beyond = raised(pointer(taken.starts, step * n), units.caps, n, units.sizes) or beyond
    if not beyond or not weighed(units.sizes, n, frame.weights):
        return live
    for e in range(n):
        frame.units[e] = 1.0 / frame.weights[e]
    if first:
        _scale(frame.vectors, frame.units, n, frame.columns)
        return live
    for c in range(frame.columns):
        frame.terms[c] = 0.0
    return _orthonormalise(frame.vectors, frame, n, live, frame.gains)


@njit(**INNER)
def _pass(system, event, events, frame, live, growth, places, work):
    """Carry a frame over one of the events that are stored; how many columns live."""
    outlined()
    n, which = system.n, pointer(events.which, 3 * event)
    before, after = pointer(events.ends, 2 * event * n), pointer(events.ends, (2 * event + 1) * n)
    if _saltate(
        system.addresses,
        which[0],
        which[1],
        which[2],
        n,
        before,
        after,
        system.p,
        frame,
        work,
    ):
        return _orthonormalise(frame.vectors, frame, n, live, growth)
    places[GRAZED] += 1
    return live


@njit(cache=True, error_model="numpy", nogil=True)
def growth_kernel(system, tolerances, budget, state, steps, events, rows, vectors, units, places):
    """Follow a motion with a frame, row after row, until the last row ends or `budget` steps are spent; a status.

    The records are those of `run_kernel`. Changed in place: vectors, (n, columns), at first orthonormal in units of 1; units;
    places; what rows hold.
    """
    n, columns = vectors.shape
    length, start = n * (1 + columns), (n + 2) * (n + 3) + 3 * columns
    block = np.empty(start + 15 * length + 2 * columns)
    work = pointer(block, columns)
    room = Room(pointer(block, start), pointer(block, start + 13 * length), pointer(block, start + 14 * length))
    gains = pointer(block, start + 15 * length)
    scales = Units(pointer(units.caps, 0), pointer(units.sizes, 0), pointer(units.weights, 0), pointer(units.units, 0))
    frame = Frame(
        columns,
        pointer(vectors, 0),
        scales.weights,
        scales.units,
        pointer(block, 0),
        gains,
        pointer(gains, columns),
    )
    laws, sums = system_pointers(system), pointer(rows.growth, 0)
    taken, passed, counts = step_pointers(steps), event_pointers(events), pointer(state.counts, 0)
    last_event, live = np.iinfo(np.int64).max, places[LIVE]
    tolerance, longest = min(LOOSER * tolerances.rtol, LOOSEST), math.inf
    status = DONE
    while places[ROW] < rows.times.size:
        row = places[ROW]
        if budget <= 0:
            status = AGAIN
            break
        goal = Goal(rows.times[row], rows.wraps[row], last_event, budget)
        status = run_kernel(system, tolerances, goal, state, steps, events)
        budget -= max(counts[N_STEPS], 1)
        growth = pointer(sums, row * columns)
        live = _measured(taken, counts[N_STEPS], frame, n, live, scales)
        event = 0
        for step in range(counts[N_STEPS] + 1):
            # events at the time at which a step begins come before it, those after the last step at the end
            while event < counts[N_EVENTS] and (
                step == counts[N_STEPS] or passed.times[event] <= taken.times[2 * step]
            ):
                if passed.which[3 * event] >= 0:
                    live = _pass(laws, event, passed, frame, live, growth, places, work)
                    longest = math.inf
                event += 1
            if step < counts[N_STEPS]:
                x, h = pointer(taken.starts, step * n), taken.times[2 * step + 1]
                dense = pointer(taken.dense, 7 * step * n)
                live, longest = _carry(
                    laws, tolerances.carry, taken.modes[step], x, h, dense, frame, live, longest, tolerance, growth,
                    room,
                )  # fmt: skip
        if status == DONE:
            rows.ends[row] = state.numbers[T] + state.numbers[T_LOW]
            for c in range(live, columns):
                growth[c] = -math.inf
            places[ROW] += 1
        elif status != AGAIN:
            break
    places[LIVE] = live
    keep(block)
    return status
