"""Compiled zeros of event functions in a Runge-Kutta step, along its dense output.

Each function is fitted by a Bernstein polynomial of degree 8 on pieces of the step. A piece is halved until the
polynomial agrees with the function at two more points. Sign variations isolate the zeros, so that two crossings inside
a step are both seen. Where no polynomial agrees on the shortest pieces, changes of sign from node to node are halved: a
function that does not go to zero there jumps or has a pole, which is no event. Where a segment starts on a surface, this zero is divided out. The side to which the motion leaves
follows from the rate there, or from the second derivative where the rate vanishes. See docs/theory/flow.md.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from numba import int64

from saltus.flow.kernels.order import NEVER
from saltus.flow.kernels.polynomial import ROOTS, bernstein_roots, bernstein_value, variations
from saltus.flow.kernels.rounded import (
    BESIDE,
    WIDEST,
    Along,
    clear_zeros,
    known_side,
    rounding_at,
    starts_flat,
    stays_away,
    touched_at,
    value_at,
)
from saltus.flow.kernels.state import AGAIN, DONE, EVENT_NOT_FINITE, FIRED, MODE_BEFORE, PASSES, TWO_PI
from saltus.flow.kernels.step import ROUNDING, size_of_terms
from saltus.system.compiled import FUNCTIONS
from saltus.system.numba_tools.machine_code import njit
from saltus.system.numba_tools.pointers import INNER, PART, call, outlined, pointer

EVENT = FUNCTIONS.index("event")
EVENT_X = FUNCTIONS.index("event_x")
DEGREE = 8  # of the polynomial that is fitted to an event function
PIECE = DEGREE + 3  # numbers of one piece on the stack: the polynomial's coefficients and the piece's ends


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
HALVINGS = 40  # of the place where an event function changes its sign without being smooth
SHRINKS = 1e-3  # part of its size to which a function shrinks that is zero there
CHECKS = np.array([0.2213, 0.7841])  # fractions of a piece, between the nodes, at which its polynomial is compared


class Surface(NamedTuple):
    """An event function in a step.

    Parameters
    ----------
    k : int
        Its transition.
    start, end : float
        Its values at the ends of the step.
    on : bool
        The step starts on its surface, so that this zero is divided out.
    rounding : float
        Rounding of the function on its surface. A step that stays within it shows only the function's rate.
    noise : float
        Rounding of the function's evaluation.
    rate_h, rate_end : float
        Its rates at the ends, times the step.
    rate_counts : bool
        Whether `rate_h` is more than rounding.
    consumed : bool
        Whether the event has just happened.
    side : int
        The side of the motion before, or 0.
    direction : int
        Direction in which a crossing is an event; 0 for both.
    """

    k: int
    start: float
    end: float
    on: bool
    rounding: float
    noise: float
    rate_h: float
    rate_end: float
    rate_counts: bool
    consumed: bool
    side: int
    direction: int


class Rates(NamedTuple):
    """Length of a step, rates of an event function at its ends times that, and whether the first is more than rounding."""

    h: float
    start: float
    end: float
    counts: bool


class Fit(NamedTuple):
    """Room for values at the nodes, coefficients, what is worked on, pieces of the interval: pointers."""

    values: Any
    b: Any
    work: Any
    pieces: Any


class Piece(NamedTuple):
    """A piece of a step: where it begins, its width, and how far values of a function in it are from each other at least."""

    a: float
    width: float
    tolerance: float


class Ends(NamedTuple):
    """For each event function its value at the end of the step, and whether the motion is on the surface throughout."""

    value: Any
    stays: Any


@njit(**INNER)
def _leaving_side(q, degree, rate_counts, rounding):
    """Side to which a motion leaves a surface: the sign of h / s near 0, with the coefficients q of h / s; 0: stays."""
    if rate_counts and q[0] != 0.0:
        return 1 if q[0] > 0.0 else -1
    largest = 0.0
    for i in range(1, degree + 1):
        largest = max(largest, abs(q[i]))
    if largest > 0.0:
        for i in range(1, degree + 1):
            if abs(q[i]) > max(1e-8 * largest, rounding):
                return 1 if q[i] > 0.0 else -1
    return 0


@njit(**PART)
def _sample(system, surface, along, a, width, at_a, values):
    """Values of an event function at the nodes of a piece of the step from a, and the largest size of them."""
    end = a + width
    values[0] = at_a
    values[DEGREE] = surface.end if end >= 1.0 else value_at(system, along, end)
    largest = max(abs(values[0]), abs(values[DEGREE]))
    for i in range(1, DEGREE):
        values[i] = value_at(system, along, a + width * FIT_NODES[i])
        largest = max(largest, abs(values[i]))
    return largest


@njit(**PART)
def _fits(system, along, a, width, origin, tolerance, fit):
    """Fit a piece from its values above the origin; whether the event function agrees between the nodes."""
    for i in range(DEGREE + 1):
        total = 0.0
        for j in range(DEGREE + 1):
            total += FIT[i * (DEGREE + 1) + j] * (fit.values[j] - origin)
        fit.b[i] = total
    for i in range(2):
        fitted, _slope = bernstein_value(fit.b, int64(DEGREE), CHECKS[i], fit.work)
        exact = value_at(system, along, a + width * CHECKS[i])
        if not abs(fitted + origin - exact) <= tolerance:
            return False
    return True


@njit(**INNER)
def _rough(system, surface, along, piece, values, found, count, now, jumps):
    """Changes of sign in a piece of the step where no polynomial fits, from node to node.

    The function goes to zero there, as at a kink, or not, as at a jump or a pole: then its bit is set in `jumps`.
    Returns the count of changes so far (-1: too many), the side behind the piece, and `jumps`.
    """
    outlined()
    for i in range(DEGREE + 1):
        side = 1 if values[i] > surface.noise else (-1 if values[i] < -surface.noise else 0)
        if side == 0 or side == now:
            continue
        if now != 0:
            if count == ROOTS:
                return int64(-1), now, jumps
            found[count], is_zero = piece.a, True
            if i > 0:
                low, high = FIT_NODES[i - 1], FIT_NODES[i]
                found[count], is_zero = _halved(system, along, piece, low, high, values[i - 1], values[i])
            if not is_zero:
                jumps |= int64(1) << count
            count += 1
        now = side
    return count, now, jumps


@njit(**INNER)
def _halved(system, along, piece, low, high, before, behind):
    """Where an event function changes its sign between two fractions of a piece, and whether it is zero there."""
    outlined()
    apart = abs(before) + abs(behind)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        value = value_at(system, along, piece.a + piece.width * middle)
        if value * behind > 0.0:
            high, behind = middle, value
        else:
            low, before = middle, value
    n, rounding, x, y, event = system.n, 0.0, along.x, along.y, along.event
    # next to a pole the slopes say nothing of the rounding
    call(system.addresses[EVENT_X], along.k, 0, x, 0, system.p, event, 0)
    for e in range(n):
        size = TWO_PI if system.phase > 0.0 and e == n - 1 else max(abs(x[e]), abs(y[e]))
        rounding += ROUNDING * abs(event[2 + e]) * size
    shrinks = abs(behind - before) <= max(SHRINKS * apart, max(piece.tolerance, rounding))
    return piece.a + piece.width * high, shrinks or not rounding < math.inf


@njit(**PART)
def _crosses(surface, leaves):
    """Whether a motion that starts on the surface and leaves it to a side has an event there."""
    if surface.side == PASSES:
        return False
    if surface.side != 0:
        return leaves != surface.side
    return surface.direction == leaves and not (surface.consumed and surface.rate_counts)


@njit(**PART)
def _stays_on(surface, values):
    """Whether the function stays within rounding of its value on the surface, in a step from there."""
    farthest = 0.0
    for i in range(1, DEGREE + 1):
        farthest = max(farthest, abs(values[i] - values[0]))
    return farthest <= surface.rounding


@njit(**PART)
def _first_side(surface, values, origin):
    """Side to which a motion leaves a surface, where no polynomial fits; its known one where no node tells."""
    least = max(surface.noise, surface.rounding)
    for i in range(1, DEGREE + 1):
        if abs(values[i] - origin) > least:
            return 1 if values[i] > origin else -1
    return known_side(surface.side)


@njit(**INNER)
def _left_to(surface, values, origin, width, b, degree):
    """Divide h by the time since a start on the surface; return the side to which the motion leaves it, 0 for none.

    The polynomial h / s takes the place of h: its coefficient i is h's coefficient i + 1 times degree / (i + 1).
    """
    for i in range(DEGREE):
        b[i] = b[i + 1] * DEGREE / (i + 1.0)
    b[0] = surface.rate_h * width if surface.rate_counts else 0.0
    leaves = _leaving_side(b, degree, surface.rate_counts, surface.rounding)
    if leaves == 0 and abs(values[DEGREE] - origin) > surface.rounding:
        leaves = 1 if values[DEGREE] > origin else -1
    return leaves


@njit(**INNER)
def _scan(system, surface, along, tolerances, fit, found):
    """All zeros of an event function in the step, in order.

    Returns the count of zeros (-1: too many for one step) and the side before the first of them (0: not known yet).
    Then whether the motion ends on the surface, and the bits of those that are jumps or poles.
    """
    outlined()
    count, jumps = 0, int64(0)
    full = int64(DEGREE)  # one type for whatever degree, so that what follows is compiled once
    before = now = surface.side
    a, width = 0.0, 1.0
    at_a = surface.start
    values, b = fit.values, fit.b
    while a < 1.0:
        end = a + width
        largest = _sample(system, surface, along, a, width, at_a, values)
        on_here = surface.on and a == 0.0
        origin = values[0] if on_here else 0.0
        if on_here and end >= 1.0 and _stays_on(surface, values):
            if not surface.rate_counts:
                return 0, surface.side, True, jumps
            leaves = 1 if surface.rate_h > 0.0 else -1
            if _crosses(surface, leaves):
                found[0] = 0.0
                return 1, -leaves, True, jumps
            if surface.rate_end * leaves < 0.0 and 2.0 * surface.rate_h / (surface.rate_h - surface.rate_end) < 1.0:
                # a hop lower than rounding is a parabola
                found[0] = 2.0 * surface.rate_h / (surface.rate_h - surface.rate_end)
                return 1, leaves, True, jumps
            return 0, leaves, True, jumps
        tolerance = max(0.1 * (tolerances.atol + tolerances.rtol * largest), max(1e-12 * largest, surface.rounding))
        fits = _fits(system, along, a, width, origin, tolerance, fit)
        fits = fits or (surface.noise > tolerance and _fits(system, along, a, width, origin, surface.noise, fit))
        if not fits and width > 1.0 / 512.0:
            width *= 0.5
            continue
        if not fits:
            if on_here:
                before = now = _first_side(surface, values, origin)
                if now != 0 and _crosses(surface, now):
                    before, found[0], count = -now, 0.0, 1
            piece = Piece(a, width, tolerance)
            count, now, jumps = _rough(system, surface, along, piece, values, found, count, now, jumps)
            if count < 0:
                return -1, before, False, jumps
            before = now if before == 0 else before
            at_a = values[DEGREE]
            a = end
            width = min(2.0 * width, 1.0 - a)
            continue
        degree = full
        if on_here:
            degree = full - 1
            leaves = _left_to(surface, values, origin, width, b, degree)
            if leaves == 0:
                return 0, surface.side, True, jumps
            before = now = leaves
            if _crosses(surface, leaves):
                before = -leaves
                found[0] = 0.0
                count = 1
        else:
            _changes, first, _last = variations(b, degree)
            if now == 0:
                before = now = first
            if first != 0 and first != now:
                if count == ROOTS:
                    return -1, before, False, jumps
                found[count] = a
                count += 1
                now = first
        earlier = count
        count = bernstein_roots(b, degree, 1e-13 * largest, a, width, fit.pieces, fit.work, found, count)
        if count < 0:
            return -1, before, False, jumps
        if (count - earlier) % 2 == 1:
            now = -now
        at_a = values[DEGREE]
        a = end
        width = min(2.0 * width, 1.0 - a)
    return count, before, False, jumps


@njit(**INNER)
def _sought(system, tolerances, state, mode, along, rates, slopes, crossings, ends, fit):
    """Find the zeros of one event function in a step, and leave those above rounding; whether all could be found.

    slopes: the rounding on its surface, by its slopes, where the step starts there; negative where these tell nothing.
    """
    outlined()
    k, side = along.k, state.side[along.k]
    found, on = pointer(crossings.found, ROOTS * k), state.on[k] == 1
    # next to a pole the rounding is large: the smaller one is that of the function's zeros
    noise = min(
        rounding_at(system, k, along.x, state.size, along.sized),
        rounding_at(system, k, along.x_end, state.size, along.sized),
    )
    flat = slopes < 0.0
    consumed = k == state.counts[FIRED] and state.counts[MODE_BEFORE] == mode
    surface = Surface(
        k, state.value[k], ends.value[k], on, noise if flat else slopes, noise, rates.start, rates.end, rates.counts,
        consumed, side, system.transitions[3 * k + 2],
    )  # fmt: skip
    count, before, still_on, jumps = _scan(system, surface, along, tolerances, fit, found)
    if count < 0:
        crossings.n_found[k] = count
        return False
    if flat and abs(surface.end) <= noise:
        count, before, still_on, jumps = 0, side, True, int64(0)
    if still_on:
        crossings.touched[k] = 0.0 if flat else NEVER
    elif count > 0:
        first = 1 if on and found[0] == 0.0 and not flat else 0
        is_known = not flat or known_side(side) != 0
        count, before, jumps, crossings.touched[k] = clear_zeros(
            system, state, along, rates.h, first, is_known, found, count, before, jumps
        )
    elif not on and abs(surface.end) <= noise and WIDEST * abs(rates.end) <= BESIDE * noise:
        crossings.touched[k] = 1.0
    elif not on:
        crossings.touched[k] = touched_at(system, state, along, rates.h, surface.start, rates.start, rates.end)
    crossings.n_found[k], crossings.before[k], crossings.jumps[k] = count, before, jumps
    ends.stays[k] = 1 if still_on else 0
    return True


@njit(**INNER)
def seek(system, tolerances, state, mode, h, dense, crossings, ends, fit, room):
    """Find every zero of every event function of a mode in the step from the state to its end.

    Returns AGAIN where there are too many for one step, EVENT_NOT_FINITE where a function is not finite, or else DONE.
    """
    outlined()
    addresses, n, p, x, x_end, event = system.addresses, system.n, system.p, state.x, room.x_end, room.event
    status = DONE
    for k in range(system.n_transitions):
        crossings.n_found[k] = crossings.passed[k] = crossings.jumps[k] = ends.stays[k] = 0
        crossings.touched[k] = NEVER
        if system.transitions[3 * k] != mode:
            continue
        on = state.on[k] == 1
        rate_counts, rounding = False, 0.0
        call(addresses[EVENT_X if on else EVENT], k, 0, x, 0, p, event, 0)
        rate_h = event[1] * h
        if on:
            rate_counts = abs(event[1]) > ROUNDING * size_of_terms(pointer(event, 2 + n), n, state.size)
            rounding = ROUNDING * size_of_terms(pointer(event, 2), n, state.size)
            if starts_flat(system, k, x, state.size, event, room.sized):
                rounding = -1.0
        call(addresses[EVENT], k, 0, x_end, 0, p, event, 0)
        ends.value[k] = event[0]
        if not abs(event[0]) < math.inf:
            return EVENT_NOT_FINITE
        start, side = state.value[k], state.side[k]
        crossings.before[k] = side
        along = Along(k, x, x_end, dense, room.y, event, room.sized)
        end_rate = event[1] * h
        if not on and side * start > 0.0 and stays_away(system, along, start, rate_h, event[0], end_rate):
            continue
        rates = Rates(h, rate_h, end_rate, rate_counts)
        if not _sought(system, tolerances, state, mode, along, rates, rounding, crossings, ends, fit):
            status = AGAIN
    return status
