"""Compiled iteration of a map: which piece holds, images, paths, and a frame that the derivatives carry along."""

from __future__ import annotations

import math

from numba import float64

from saltus.flow.kernels.shares import raised, weighed
from saltus.scales import EPS, STATE_ROUNDED
from saltus.system.angles import TURN
from saltus.system.numba_tools.machine_code import njit
from saltus.system.numba_tools.pointers import call, pointer, stack
from saltus.system.tiling import NUDGE

# Kernels make no array: counting references to records would take longer than the work itself.
SCALAR = {"nogil": True, "error_model": "numpy", "_nrt": False}
part = njit(inline="always", **SCALAR)
inner = njit(**SCALAR)

OVERLAP = -2  # instead of a piece: several hold at a state
ROOTLESS = -3  # instead of a piece: the argument of a root in the image is negative
GAP = -1  # instead of a piece: none holds at a state
DONE = 0  # all iterations were made
DIVERGED = 1  # a component is beyond the bound, or no number
NOWHERE = 2  # not exactly one piece holds at a state
AGAIN = 3  # some iterations are left

GONE = 1e-30  # square of a direction's length, over that before it was made orthogonal, that is rounding


@part
def least_of(k, x, code, out):
    """Least condition of piece k at a state: infinite where it has none, -infinite where one is no number."""
    least = math.inf
    for guard in range(code.guards[k], code.guards[k + 1]):
        call(code.functions[2], guard, 0, x, 0, code.p, out, 0)
        if not out[0] >= least:
            least = -math.inf if math.isnan(out[0]) else out[0]
    return least


@inner
def chosen(x, code, out):
    """Piece that holds strictly at a state, or the first on a border; OVERLAP of several, GAP without any."""
    inside, held = -1, -1
    for k in range(code.guards.size - 1):
        least = least_of(k, x, code, out)
        if least > 0.0:
            if inside >= 0:
                return OVERLAP
            inside = k
        elif least == 0.0 and held < 0:
            held = k
    if inside >= 0:
        return inside
    return held if held >= 0 else GAP


@inner
def beside(x, code, out):
    """Piece at a state that misses or passes a border by rounding; a negative number where it is farther away."""
    found = chosen(x, code, out)
    for i in range(x.size):
        if found >= 0:
            break
        here = x[i]
        for side in range(-1, 2, 2):
            x[i] = here + side * NUDGE * abs(here)
            near = chosen(x, code, out)
            if near >= 0:
                found = near
                break
        x[i] = here
    return found


@inner
def under_root(piece, x, code):
    """Whether an argument of a root in a piece's image is negative at a state, beyond rounding of the state."""
    n, pieces, place = x.size, code.guards.size - 1, code.guards[code.guards.size - 1] + piece
    sized = stack(float64, 2 * n + 1)
    call(code.functions[2], place, 0, x, 0, code.p, sized, 2 * n)
    if not sized[2 * n] < 0.0:
        return False
    for e in range(n):
        sized[e] = x[e]
        sized[n + e] = STATE_ROUNDED / EPS * abs(x[e])
    call(code.functions[2], place + pieces, 0, sized, 0, code.p, sized, 2 * n)
    return sized[2 * n] < 0.0


@part
def piece_of(x, code, out):
    """Index of the piece that holds at a state; negative where not exactly one does, or its image is not real."""
    found = 0
    if code.guards[code.guards.size - 1] != code.guards[0]:
        found = chosen(x, code, out)
        found = found if found >= 0 else beside(x, code, out)
    if code.functions[3] != 0 and found >= 0 and under_root(found, x, code):
        return ROOTLESS
    return found


@part
def bounded(x, limit):
    """Whether each component is a number below the limit."""
    for i in range(x.size):
        if not abs(x[i]) < limit:
            return False
    return True


@part
def turns_beyond(x):
    """Whole turns by which an angle is outside -pi to pi, by the rule of `saltus.system.angles.wrapped`."""
    return 0.0 if -math.pi <= x < math.pi else math.floor(x / TURN + 0.5)


@part
def onto_circles(x, code):
    """Move the angles of a state by whole turns to between -pi and pi."""
    for j in range(code.circles.size):
        x[code.circles[j]] -= TURN * turns_beyond(x[code.circles[j]])


@part
def advanced(x, y, code):
    """Replace a state by its image on the circles; return the piece that held before, negative where not exactly one did.

    y: (n,) or more, working space.
    """
    piece = piece_of(x, code, y)
    if piece >= 0:
        call(code.functions[0], piece, 0, x, 0, code.p, y, 0)
        for i in range(x.size):
            x[i] = y[i]
        onto_circles(x, code)
    return piece


@njit(cache=True, **SCALAR)
def path(x, y, code, limit, discard, states, pieces, wound, turns):
    """Write the path of a motion from x, after `discard` iterations: a status, and how many iterations were made.

    x: (n,), the start, then the last state. y: (n,), working space. states: (m, n), their angles between -pi and pi;
    pieces: (m,), that of each state. Without any states x is what follows `discard` iterations. wound: (angles,), whole
    turns that were taken away so far; turns: (m, angles), those at each state.
    """
    n = x.size
    for step in range(discard + states.shape[0]):
        if not bounded(x, limit):
            return DIVERGED, step
        for j in range(wound.size):
            gone = turns_beyond(x[code.circles[j]])
            x[code.circles[j]] -= TURN * gone
            wound[j] += gone
        at = step - discard
        if at >= 0:
            for i in range(n):
                states[at, i] = x[i]
            for j in range(wound.size):
                turns[at, j] = wound[j]
        piece = piece_of(x, code, y)
        if piece >= 0 and at < states.shape[0] - 1:
            call(code.functions[0], piece, 0, x, 0, code.p, y, 0)
            for i in range(n):
                x[i] = y[i]
        if piece < 0:
            return NOWHERE, step
        if at >= 0:
            pieces[at] = piece
    return DONE, discard + states.shape[0] - 1


@njit(cache=True, **SCALAR)
def images(points, x, y, code, limit, count):
    """Replace states, (m, n), by their images after `count` iterations, NaN where one diverges; a status and a row.

    x, y: (n,), working space; x is left at the state where the status arose.
    """
    n = x.size
    for row in range(points.shape[0]):
        for i in range(n):
            x[i] = points[row, i]
        for _ in range(count):
            if not bounded(x, limit):
                break
            piece = advanced(x, y, code)
            if piece == ROOTLESS:
                x[0] = math.nan
            elif piece < 0:
                return NOWHERE, row
        lost = not bounded(x, limit)
        for i in range(n):
            points[row, i] = math.nan if lost else x[i]
    return DONE, points.shape[0]


@part
def length_of(frame, n, columns, c):
    """Square of the length of column c of a frame, (n * columns,), row by row."""
    total = 0.0
    for i in range(n):
        total += frame[i * columns + c] * frame[i * columns + c]
    return total


@inner
def project(frame, n, columns, c):
    """Make column c orthogonal to those before, twice, as much of it may go; the square of what is left."""
    for _ in range(2):
        for d in range(c):
            share = 0.0
            for i in range(n):
                share += frame[i * columns + d] * frame[i * columns + c]
            for i in range(n):
                frame[i * columns + c] -= share * frame[i * columns + d]
    return length_of(frame, n, columns, c)


@inner
def orthonormal(frame, n, columns, logs):
    """Make the columns of a frame orthonormal, and add the logarithms of their lengths to `logs`."""
    for c in range(columns):
        before = length_of(frame, n, columns, c)
        square = project(frame, n, columns, c)
        if square > GONE * before:
            logs[c] += 0.5 * math.log(square)
        elif math.isnan(square):
            logs[c] = math.nan
        else:
            logs[c] = -math.inf
            square = fresh(frame, n, columns, c)
        for i in range(n):
            frame[i * columns + c] /= math.sqrt(square)


@inner
def fresh(frame, n, columns, c):
    """Write what the columns before c leave of an axis, of the one least in their span; the square of its length."""
    axis, most = 0, -1.0
    for i in range(n):
        left = 1.0
        for d in range(c):
            left -= frame[i * columns + d] * frame[i * columns + d]
        if left > most:
            axis, most = i, left
    for i in range(n):
        frame[i * columns + c] = 1.0 if i == axis else 0.0
    return project(frame, n, columns, c)


@inner
def measured(frame, n, columns, units, first, work):
    """Measure a frame by the sizes of the states so far, which have grown: a change of units is no growth.

    frame: in units of the states. units: (4, n): caps of sizes, the largest sizes so far, inverse units, units. At first
    columns stay orthonormal as these change. Later they keep their spans. work: (columns,).
    """
    if not first:
        scale(frame, units[3], columns)
    weighed(pointer(units, n), n, pointer(units, 2 * n))
    for i in range(n):
        units[3, i] = 1.0 / units[2, i]
    if not first:
        scale(frame, units[2], columns)
        orthonormal(frame, n, columns, work)


@part
def is_plain(units):
    """Whether all units are 1."""
    for i in range(units.size):
        if units[i] != 1.0:
            return False
    return True


@part
def scale(frame, factors, columns):
    """Multiply the rows of a frame by factors."""
    for i in range(factors.size):
        for c in range(columns):
            frame[i * columns + c] *= factors[i]


@njit(cache=True, **SCALAR)
def growth(x, frame, units, work, code, limit, ends, logs, at, most):
    """Carry a frame along a motion, at most for `most` iterations: a status, AGAIN where some are left.

    x: (n,), the start, then the last state. frame: (n * columns,), row by row, in units of the states. units: as of
    `measured`. work: (2, n * (1 + columns)). ends: (rows,), iteration at which each row of logs ends. logs: (rows,
    columns), logarithms of growth in each row. at: (2,), row and iterations so far.
    """
    n, columns = x.size, logs.shape[1]
    before, after, last = work[0], work[1], at[1] + most
    plain = is_plain(units[3])
    while at[0] < ends.size:
        total = logs[at[0]]
        while at[1] < ends[at[0]]:
            if at[1] == last:
                return AGAIN
            if not bounded(x, limit):
                return DIVERGED
            piece = piece_of(x, code, after)
            if piece < 0:
                return NOWHERE
            if raised(pointer(x, 0), pointer(units, 0), n, pointer(units, n)):
                measured(frame, n, columns, units, at[1] == 0, before)
                plain = is_plain(units[3])
            for i in range(n):
                before[i] = x[i]
            for i in range(frame.size):
                before[n + i] = frame[i]
            if not plain:
                scale(before[n:], units[3], columns)
            call(code.functions[1], piece, columns, before, 0, code.p, after, 0)
            for i in range(n):
                x[i] = after[i]
            onto_circles(x, code)
            for i in range(frame.size):
                frame[i] = after[n + i]
            if not plain:
                scale(frame, units[2], columns)
            orthonormal(frame, n, columns, total)
            at[1] += 1
        at[0] += 1
    return DONE if bounded(x, limit) else DIVERGED
