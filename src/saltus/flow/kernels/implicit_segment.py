"""Compiled flow of one segment by implicit steps, in clustered time, as `saltus.flow.kernels.segment` does it by explicit ones.

Its functions are called by their addresses, and compiled where a flow is stiff.
"""

from __future__ import annotations

import numpy as np
from numba import float64, int64

from saltus.flow.kernels.implicit_step import (
    INTEGERS,
    NUMBERS,
    REACH,
    STAGES,
    SYSTEM,
    A,
    C,
    D,
    Forced,
    dense_increments,
    error_between,
    error_of,
    laid_out,
    linearised,
    room_for,
    roughness,
    taken,
    varied_stages,
)
from saltus.flow.kernels.segment import EVENT_P, EVENT_X, Segment, Sensitive, leaps
from saltus.system.compiled import SHARES
from saltus.system.numba_tools.machine_code import cfunc, njit
from saltus.system.numba_tools.pointers import INNER, call, keep, numbers_at, outlined, pointer

LONGEST = 1.0 / 24  # longest step: sensitivities vary where the state rests


@njit(**INNER)
def set_rates(segment, s, h, stages):
    """Write what time does in the stages of a step in clustered time, over what that does."""
    for i in range(STAGES):
        time = s + C[i] * h
        stages.weights[i] = 6.0 * time * (1.0 - time)
        stages.rates[i] = segment.duration * stages.weights[i]


@njit(cache=True, error_model="numpy")
def adapt(functions, mode, x0, duration, p, rtol, atol, mesh):
    """Fill `mesh` with the ends of steps from 0 to 1, as `saltus.flow.kernels.segment.adapt` does; return their count."""
    n, room = x0.size, mesh.size
    block, pivots = np.empty(room_for(n) + (1 + STAGES) * n), np.empty(STAGES * n, np.int64)
    segment = Segment(pointer(functions, 0), mode, duration, pointer(p, 0), n)
    x, curve = pointer(block, 0), pointer(block, n)
    stages = laid_out(pointer(curve, STAGES * n), pointer(pivots, 0), n)
    for e in range(n):
        x[e] = x0[e]
    mesh[0] = 0.0
    count, s, h, before = 0, 0.0, 0.01, 0.0
    while s < 1.0 and count + 1 < room and h >= 1e-14:
        h = min(h, 1.0 - s)
        if 1.0 - s - h < 0.1 * h:
            h = 1.0 - s
        set_rates(segment, s, h, stages)
        if not taken(segment, h, before, x, stages):
            h *= 0.4
            continue
        error = error_of(segment, s, h, n, x, stages, rtol, atol)
        if not error <= 1.0:
            h *= max(0.2, 0.9 * error**-0.125) if error < 1e300 else 0.2
            continue
        dense_increments(n, stages.increments, curve)
        if leaps(segment, h, 1.0, curve, x):
            h *= 0.5
            continue
        count += 1
        s = 1.0 if h == 1.0 - s else s + h
        mesh[count] = s
        for e in range(STAGES * n):
            stages.guess[e] = curve[e]
        for e in range(n):
            x[e] += stages.increments[(STAGES - 1) * n + e]
        before = h
        h = min(LONGEST, h * min(REACH, 0.9 * max(error, 1e-12) ** -0.125))
    keep(block)
    keep(pivots)
    return count if s == 1.0 else int64(-1)


@cfunc(float64(*SYSTEM, float64, NUMBERS, NUMBERS, int64, NUMBERS, NUMBERS), error_model="numpy")
def dense(functions, mode, n, p, duration, x0, mesh, count, nodes, coefficients):
    """Run a segment's state on its mesh and keep dense output, NaN behind a step whose equations are not solved."""
    segment = Segment(functions, mode, duration, p, n)
    block, pivots = np.empty(room_for(n)), np.empty(STAGES * n, np.int64)
    stages, before = laid_out(pointer(block, 0), pointer(pivots, 0), n), 0.0
    for e in range(n):
        nodes[e] = x0[e]
    for step in range(count):
        h, x = mesh[step + 1] - mesh[step], pointer(nodes, step * n)
        set_rates(segment, mesh[step], h, stages)
        if not taken(segment, h, before, x, stages):
            for e in range((count - step) * n):
                nodes[(step + 1) * n + e] = np.nan
            for e in range((count - step) * STAGES * n):
                coefficients[step * STAGES * n + e] = np.nan
            break
        dense_increments(n, stages.increments, stages.guess)
        for e in range(STAGES * n):
            coefficients[step * STAGES * n + e] = stages.guess[e]
        for e in range(n):
            nodes[(step + 1) * n + e] = x[e] + stages.increments[(STAGES - 1) * n + e]
        before = h
    keep(block)
    keep(pivots)
    return 0.0


@cfunc(float64(*SYSTEM, float64, float64, float64, NUMBERS, NUMBERS, float64, float64), error_model="numpy")
def check(functions, mode, n, p, duration, begin, h, x, curve, rtol, atol):
    """Return the error of a step's dense output between its stages, over what is allowed; curve: (7 n,)."""
    segment = Segment(functions, mode, duration, p, n)
    block, pivots = np.empty(room_for(n)), np.empty(STAGES * n, np.int64)
    stages = laid_out(pointer(block, 0), pointer(pivots, 0), n)
    error = error_between(segment, begin, h, n, x, curve, stages, rtol, atol)
    keep(block)
    keep(pivots)
    return error


@cfunc(
    float64(INTEGERS, NUMBERS, INTEGERS, INTEGERS, NUMBERS, float64, NUMBERS, float64, float64, NUMBERS, NUMBERS),
    error_model="numpy",
)
def flow(functions, p, sizes, active, x0, duration, mesh, rtol, atol, y, errors):
    """Run a segment on its mesh and leave state and sensitivities in `y`, as the explicit `flow` does.

    sizes: (7,), mode, components, transition, whether the event's mean rate is integrated, active parameters, columns,
    steps. Where the equations of a step are not solved, `y` is NaN and all errors are infinite.
    """
    mode, n, transition, mean = sizes[0], sizes[1], sizes[2], sizes[3]
    n_active, columns, count = sizes[4], sizes[5], sizes[6]
    segment = Segment(functions, mode, duration, p, n)
    sensitive = Sensitive(transition, mean != 0, False, active, n_active, columns)
    size, varied = n * (1 + columns), STAGES * n * columns
    block, pivots = np.empty(room_for(n) + varied + 2 + 2 * n + columns), np.empty(STAGES * n, np.int64)
    moved, ev, longer = pointer(block, 0), pointer(block, varied), pointer(block, varied + 2 + 2 * n)
    stages, before = laid_out(pointer(longer, columns), pointer(pivots, 0), n), 0.0
    for c in range(columns):
        longer[c] = 1.0 if mean != 0 and c == n_active else 0.0
    forced = Forced(columns, n, active, n_active, longer)
    for e in range(size + ((1 + columns) if mean != 0 else 0)):
        y[e] = 0.0
    for e in range(n):
        y[e] = x0[e]
        y[n + e * columns + e] = 1.0
    for step in range(count):
        s = mesh[step]
        h = mesh[step + 1] - s
        set_rates(segment, s, h, stages)
        if not (taken(segment, h, before, y, stages) and linearised(segment, h, y, stages)):
            for e in range(size):
                y[e] = np.nan
            for other in range(count):
                errors[other] = np.inf
            break
        errors[step] = roughness(n, n, y, stages.increments, (rtol, atol), numbers_at(functions[SHARES]))
        varied_stages(segment, forced, h, y, stages, moved, ev)
        if mean != 0:
            _add_mean(segment, sensitive, h, y, stages, moved, ev)
        last = (STAGES - 1) * n
        for e in range(n):
            y[e] += stages.increments[last + e]
            for c in range(columns):
                y[n + e * columns + c] = moved[c * STAGES * n + last + e]
        dense_increments(n, stages.increments, stages.guess)
        before = h
    keep(block)
    keep(pivots)
    return 0.0


@cfunc(float64(*SYSTEM, float64, INTEGERS, int64, NUMBERS, NUMBERS, int64, NUMBERS, NUMBERS), error_model="numpy")
def vary(functions, mode, n, p, duration, active, columns, longer, mesh, count, nodes, coefficients):
    """Run a segment on its mesh with variations by parameters, and keep dense output; NaN behind a step that fails.

    longer: (columns,), what each parameter adds to the duration. nodes: (count + 1, n (1 + columns)), the first of them
    is given; coefficients: (count, 7 n (1 + columns)).
    """
    segment, length, varied = Segment(functions, mode, duration, p, n), n * (1 + columns), STAGES * n * columns
    block, pivots = np.empty(room_for(n) + varied + n), np.empty(STAGES * n, np.int64)
    stages, before = laid_out(pointer(block, varied + n), pointer(pivots, 0), n), 0.0
    moved, forced, last = pointer(block, 0), Forced(columns, 0, active, columns, longer), (STAGES - 1) * n
    for step in range(count):
        h, y, end = mesh[step + 1] - mesh[step], pointer(nodes, step * length), pointer(nodes, (step + 1) * length)
        bends = pointer(coefficients, step * STAGES * length)
        set_rates(segment, mesh[step], h, stages)
        if not (taken(segment, h, before, y, stages) and linearised(segment, h, y, stages)):
            for e in range((count - step) * length):
                end[e] = np.nan
            break
        varied_stages(segment, forced, h, y, stages, moved, pointer(block, varied))
        dense_increments(n, stages.increments, stages.guess)
        for e in range(n):
            end[e] = y[e] + stages.increments[last + e]
            for k in range(STAGES):
                bends[k * length + e] = stages.guess[k * n + e]
            for c in range(columns):
                at = n + e * columns + c
                end[at] = moved[c * STAGES * n + last + e]
                for k in range(STAGES):
                    total = 0.0
                    for i in range(STAGES):
                        total += D[k * STAGES + i] * (moved[(c * STAGES + i) * n + e] - y[at])
                    bends[k * length + at] = total
        before = h
    keep(block)
    keep(pivots)
    return 0.0


@njit(**INNER)
def _add_mean(segment, sensitive, h, y, stages, moved, ev):
    """Add a step's part of the mean rate of the event function, and of its derivatives."""
    outlined()
    n, columns, n_active, functions = segment.n, sensitive.columns, sensitive.n_active, segment.functions
    rates = pointer(y, n * (1 + columns))
    for j in range(STAGES):
        weight = h * A[(STAGES - 1) * STAGES + j] * stages.weights[j]
        for e in range(n):
            stages.frame[e] = y[e] + stages.increments[j * n + e]
        call(functions[EVENT_X], sensitive.transition, 0, stages.frame, 0, segment.p, ev, 0)
        rates[0] += weight * ev[1]
        for c in range(columns):
            total = 0.0
            for e in range(n):
                total += ev[2 + n + e] * moved[(c * STAGES + j) * n + e]
            rates[1 + c] += weight * total
        for k in range(n_active):
            call(functions[EVENT_P], sensitive.transition, sensitive.active[k], stages.frame, 0, segment.p, ev, 0)
            rates[1 + n + k] += weight * ev[1]
