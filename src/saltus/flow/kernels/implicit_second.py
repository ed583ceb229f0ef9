"""Compiled flow of one segment by implicit steps with second derivatives along a direction, as `second` does it explicitly.

The equations of a step are differentiated twice. Its last matrix, which gives the sensitivities, gives what these change
by, too.
"""

from __future__ import annotations

import numpy as np
from numba import float64, int64

from saltus.flow.kernels.implicit_segment import set_rates
from saltus.flow.kernels.implicit_step import (
    INTEGERS,
    NUMBERS,
    STAGES,
    A,
    C,
    Forced,
    dense_increments,
    laid_out,
    linearised,
    room_for,
    substitute,
    taken,
    varied_stages,
)
from saltus.flow.kernels.second import FIELD_2, Bent, along, quadrature
from saltus.flow.kernels.segment import FIELD_P, VARY, Segment, Sensitive
from saltus.system.numba_tools.machine_code import cfunc, njit
from saltus.system.numba_tools.pointers import INNER, call, keep, outlined, pointer


@njit(**INNER)
def _turned(segment, sensitive, v, share, trial, out, point):
    """Write the field with the slopes of sensitivities at a stage, and the state with its variation; trial: as in `y`."""
    outlined()
    n, n_active, columns = segment.n, sensitive.n_active, sensitive.columns
    call(segment.functions[VARY], segment.mode, columns, trial, 0, segment.p, out, 0)
    for e in range(n):
        point[e] = trial[e]
        point[n + e] = share * out[e] * v[n] + along(pointer(trial, n + e * columns), v, n, n_active)


@njit(**INNER)
def _pushed(segment, sensitive, bent, rate, longer, trial, out, point, bend, fp, push):
    """Write what a stage adds to the slopes of the second derivatives, beyond the field's own, in `push`, (kept, n)."""
    outlined()
    n, n_active, columns = segment.n, sensitive.n_active, sensitive.columns
    kept = n + n_active
    call(bent.functions[FIELD_2], segment.mode, 0, point, 0, bent.p, bend, 0)
    for e in range(n):
        line = pointer(bend, e * kept)
        for c in range(kept):
            total = line[c] if c >= n else 0.0
            for b in range(n):
                total += line[b] * trial[n + b * columns + c]
            push[c * n + e] = rate * total + longer * out[n + e * columns + c]
    for a in range(n_active):
        call(segment.functions[FIELD_P], segment.mode, sensitive.active[a], trial, 0, segment.p, fp, 0)
        for e in range(n):
            push[(n + a) * n + e] += longer * fp[e]


@njit(**INNER)
def _at_stage(n, kept, j, y, stages, moved, bends, trial):
    """Write state, sensitivities and their derivatives of a stage in `trial`, laid out as `y`."""
    size = STAGES * n
    for e in range(n):
        trial[e] = y[e] + stages.increments[j * n + e]
        row = pointer(trial, n + e * 2 * kept)
        for c in range(kept):
            row[c] = moved[c * size + j * n + e]
            row[kept + c] = bends[c * size + j * n + e]


@cfunc(
    float64(INTEGERS, NUMBERS, INTEGERS, INTEGERS, INTEGERS, NUMBERS, NUMBERS, NUMBERS, float64, NUMBERS, NUMBERS),
    error_model="numpy",
)
def flow_second(functions, p, sizes, active, second, extended, v, x0, duration, mesh, y):
    """Run a segment on its mesh and leave state, sensitivities and their derivatives along `v` in `y`, as the explicit one does.

    sizes: as in `saltus.flow.kernels.implicit_segment.flow`. second: addresses of the second derivatives, extended:
    their parameters. Where the equations of a step are not solved, `y` is NaN.
    """
    mode, n, mean, n_active, columns = sizes[0], sizes[1], sizes[3], sizes[4], sizes[5]
    segment = Segment(functions, mode, duration, p, n)
    sensitive = Sensitive(sizes[2], mean != 0, False, active, n_active, columns)
    bent, kept, size = Bent(second, extended, v), n + n_active, STAGES * n
    length, tail = n * (1 + columns), 2 * (kept + 2) if mean != 0 else 0
    moments = n * (1 + kept) + 2 * size * kept + 2 * length + tail + 9 * n + 6 + n_active + (2 * n + 2) * kept
    block, pivots = np.empty(room_for(n) + moments), np.empty(STAGES * n, np.int64)
    first, moved = pointer(block, 0), pointer(block, n * (1 + kept))
    bends = pointer(moved, size * kept)
    trial = pointer(bends, size * kept)
    out = pointer(trial, length)
    point = pointer(out, length + tail)
    bend = pointer(point, 2 * n + n_active)
    push = pointer(bend, n * kept)
    fp = pointer(push, n * kept)
    scratch = pointer(fp, n + 2)
    stages, before = laid_out(pointer(block, moments), pointer(pivots, 0), n), 0.0
    for e in range(length + tail):
        y[e] = 0.0
    for e in range(n):
        y[e] = x0[e]
        y[n + e * columns + e] = 1.0
    for a in range(n_active):
        point[2 * n + a] = v[n + 1 + a]
        scratch[a] = 0.0  # no parameter adds to the duration
    for step in range(sizes[6]):
        s = mesh[step]
        h = mesh[step + 1] - s
        set_rates(segment, s, h, stages)
        if not (taken(segment, h, before, y, stages) and linearised(segment, h, y, stages)):
            for e in range(length + tail):
                y[e] = np.nan
            break
        for e in range(n):
            first[e] = y[e]
            for c in range(kept):
                first[n + e * kept + c] = y[n + e * columns + c]
                for i in range(STAGES):
                    bends[c * size + i * n + e] = y[n + e * columns + kept + c]
        for a in range(n_active):
            scratch[a] = 0.0
        varied_stages(segment, Forced(kept, n, active, n_active, scratch), h, first, stages, moved, fp)
        for j in range(STAGES):
            time = s + C[j] * h
            _at_stage(n, kept, j, y, stages, moved, bends, trial)
            _turned(segment, sensitive, v, time * time * (3.0 - 2.0 * time), trial, out, point)
            longer = v[n] * stages.weights[j]
            _pushed(segment, sensitive, bent, stages.rates[j], longer, trial, out, point, bend, fp, push)
            for i in range(STAGES):
                weight = h * A[i * STAGES + j]
                for c in range(kept):
                    for e in range(n):
                        bends[c * size + i * n + e] += weight * push[c * n + e]
        for c in range(kept):
            substitute(stages, size, pointer(bends, c * size))
        if mean != 0:
            for j in range(STAGES):
                time, weight = s + C[j] * h, h * A[(STAGES - 1) * STAGES + j]
                share = time * time * (3.0 - 2.0 * time)
                _at_stage(n, kept, j, y, stages, moved, bends, trial)
                _turned(segment, sensitive, v, share, trial, out, point)
                quadrature(segment, sensitive, bent, stages.weights[j], share, trial, out, point, scratch)
                for e in range(tail):
                    y[length + e] += weight * out[length + e]
        _at_stage(n, kept, int64(STAGES - 1), y, stages, moved, bends, trial)
        for e in range(length):
            y[e] = trial[e]
        dense_increments(n, stages.increments, stages.guess)
        before = h
    keep(block)
    keep(pivots)
    return 0.0
