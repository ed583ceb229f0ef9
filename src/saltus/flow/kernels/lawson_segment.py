"""Compiled flow of one segment by Lawson's method, in clustered time, as `saltus.flow.kernels.segment` does it by Runge-Kutta.

Behind the addresses of the generated functions is that of the modes' linear parts (`saltus.flow.linear_parts`). A mode
that has none, or whose rest depends on the state through more than one function, is followed by Runge-Kutta steps.
"""

from __future__ import annotations

import math

import numpy as np
from numba import float64, int64, types

from saltus.flow import lawson
from saltus.flow.kernels import segment as explicit
from saltus.flow.kernels.lawson_step import EACH, HEAD, STAGES, error_of, laid_out, room_for, set_frame, taken
from saltus.flow.kernels.lawson_varied import linearised, propagated
from saltus.flow.kernels.segment import LINEAR, Segment, Sensitive
from saltus.system.numba_tools.machine_code import cfunc, njit
from saltus.system.numba_tools.pointers import INNER, keep, numbers_at, outlined, pointer

NUMBERS = types.CPointer(float64)
DENSE = lawson.DENSE.ravel()
LONGEST = 4.0  # longest step, times the rate at which the frame turns or decays
SLOW = 12  # sweeps from which a step counts as too long
INTEGERS = types.CPointer(int64)
SYSTEM = INTEGERS, int64, int64, NUMBERS  # addresses of generated functions, mode, components, parameters

_explicit_flow = explicit.flow
_explicit_dense = explicit.dense


@njit(**INNER)
def _linear(functions, mode, n):
    """Return the linear part of a mode."""
    return pointer(numbers_at(functions[LINEAR]), mode * (HEAD + EACH * n))


@njit(**INNER)
def _paired(linear, n, partners):
    """Return the components' partners, written in `partners`."""
    for e in range(n):
        partners[e] = int(linear[HEAD + EACH * e])
    return partners


@njit(**INNER)
def _followed(segment, linear, sensitive, mesh, count, tolerances, y, errors):
    """Run a segment on its mesh from `y`; whether its steps could be taken."""
    outlined()
    n, columns = segment.n, sensitive.columns
    rtol, atol = tolerances
    block, partners = np.empty(room_for(n) + n * (1 + columns)), np.empty(n, np.int64)
    end = pointer(block, 0)
    frame, stages, varied = laid_out(pointer(block, n * (1 + columns)), _paired(linear, n, pointer(partners, 0)), n)
    plain = True
    for step in range(count):
        h = mesh[step + 1] - mesh[step]
        turned = set_frame(segment, linear, mesh[step], h, frame, stages.frame)
        sweeps = taken(segment, linear, y, frame, stages, end)
        if sweeps == 0 or not linearised(segment, linear, frame, stages, varied):
            plain = False
            break
        rough = error_of(n, stages, y, end, rtol, atol)
        parts = frame, stages, varied
        rough = max(rough, propagated(segment, linear, sensitive, pointer(y, n), pointer(end, n), rtol, parts))
        # errors of order 16 as if they were of order 8, by which meshes are moved
        errors[step] = max(math.sqrt(rough), (turned / LONGEST) ** 8, 1.0 if sweeps > SLOW else 0.0)
        for e in range(n * (1 + columns)):
            y[e] = end[e]
    keep(block)
    keep(partners)
    return plain


@cfunc(
    float64(INTEGERS, NUMBERS, INTEGERS, INTEGERS, NUMBERS, float64, NUMBERS, float64, float64, NUMBERS, NUMBERS),
    error_model="numpy",
)
def flow(functions, p, sizes, active, x0, duration, mesh, rtol, atol, y, errors):
    """Run a segment on its mesh and leave state and sensitivities in `y`, as the explicit `flow` does.

    sizes: (7,), mode, components, transition, whether the event's mean rate is integrated, active parameters, columns,
    steps.
    """
    mode, n, mean, count = sizes[0], sizes[1], sizes[3], sizes[6]
    segment = Segment(functions, mode, duration, p, n)
    sensitive = Sensitive(sizes[2], mean != 0, False, active, sizes[4], sizes[5])
    linear = _linear(functions, mode, n)
    if linear[0] > 0.0 and mean == 0:
        columns = sizes[5]
        for e in range(n * (1 + columns)):
            y[e] = 0.0
        for e in range(n):
            y[e] = x0[e]
            y[n + e * columns + e] = 1.0
        if _followed(segment, linear, sensitive, mesh, count, (rtol, atol), y, errors):
            return 0.0
    _explicit_flow(segment, sensitive, x0, mesh, count, rtol, atol, y, errors)
    return 0.0


@cfunc(float64(*SYSTEM, float64, NUMBERS, NUMBERS, int64, NUMBERS, NUMBERS), error_model="numpy")
def dense(functions, mode, n, p, duration, x0, mesh, count, nodes, coefficients):
    """Run a segment's state on its mesh and keep dense output, NaN behind a step whose equations are not solved."""
    segment, linear = Segment(functions, mode, duration, p, n), _linear(functions, mode, n)
    if not linear[0] > 0.0:
        _explicit_dense(segment, x0, mesh, count, nodes, coefficients)
        return 0.0
    block, partners = np.empty(room_for(n)), np.empty(n, np.int64)
    frame, stages, _ = laid_out(pointer(block, 0), _paired(linear, n, pointer(partners, 0)), n)
    for e in range(n):
        nodes[e] = x0[e]
    for step in range(count):
        x, end, bends = pointer(nodes, step * n), pointer(nodes, (step + 1) * n), pointer(coefficients, step * 7 * n)
        set_frame(segment, linear, mesh[step], mesh[step + 1] - mesh[step], frame, stages.frame)
        if taken(segment, linear, x, frame, stages, end) == 0:
            for e in range((count - step) * n):
                end[e] = np.nan
            for e in range((count - step) * 7 * n):
                bends[e] = np.nan
            break
        for k in range(7):
            last = DENSE[k * (STAGES + 1) + STAGES]
            for e in range(n):
                total = last * (end[e] - x[e])
                for i in range(STAGES):
                    total += DENSE[k * (STAGES + 1) + i] * (stages.points[i * n + e] - x[e])
                bends[k * n + e] = total
    keep(block)
    keep(partners)
    return 0.0
