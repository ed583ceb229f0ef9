"""Compiled flow of one segment with second derivatives along a direction, in clustered time.

A direction is a change of the segment's initial state, of its duration and of the active parameters. The variation
along it is taken at fixed clustered time, not at fixed time. On an orbit it is then tangential to the surfaces at which
the segment begins and ends. There half-integer powers of an event function have poles, which cancel in tangential
directions: docs/theory/loci.md.

References
----------
Second-order variational equations: Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, Springer 1993,
sec. I.14, differentiated once more.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from saltus.flow.kernels.segment import EVENT_P, EVENT_X, FIELD_P, VARY
from saltus.flow.kernels.stages import stage
from saltus.flow.tableaux import NODES as C
from saltus.system.compiled import SECOND
from saltus.system.numba_tools.machine_code import njit
from saltus.system.numba_tools.pointers import INNER, call, keep, outlined, pointer

FIELD_2 = SECOND.index("field_2")
EVENT_2 = SECOND.index("event_2")


class Bent(NamedTuple):
    """What the derivatives of a segment's sensitivities along a direction are taken by.

    Attributes
    ----------
    functions : pointer to int64
        Addresses of the generated functions of second derivatives.
    p : pointer to float64
        Parameters with the constants of these behind them.
    direction : pointer to float64, (n + 1 + active,)
        Change of the initial state, of the duration and of the active parameters.
    """

    functions: object
    p: object
    direction: object


@njit(**INNER)
def flow_second(segment, sensitive, bent, x0, mesh, count, y):
    """Run a segment on its mesh and leave state, sensitivities and their derivatives along the direction in `y`.

    y: [x (n), then for each component its n + active sensitivities and their derivatives along the direction, and where
    `mean` what `quadrature` integrates, 2 (n + active + 2)]. `sensitive` counts both columns of each sensitivity.
    """
    outlined()
    functions, mode, duration, p, n = segment
    n_active, mean, params, v = sensitive.n_active, sensitive.mean, sensitive.active, bent.direction
    kept, columns = n + n_active, sensitive.columns
    size = n * (1 + columns)
    tail = 2 * (kept + 2) if mean else 0
    length = size + tail
    block = np.empty(14 * length + 9 * n + 6 + n_active + (n + 2) * kept)
    slopes, trial, fp = pointer(block, 0), pointer(block, 13 * length), pointer(block, 14 * length)
    point = pointer(fp, n + 2)  # state and variation, and what the parameters change by, (2 n + active)
    bend = pointer(point, 2 * n + n_active)  # (n, n + active)
    scratch = pointer(bend, n * kept)
    vary, field_p, field_2 = functions[VARY], functions[FIELD_P], bent.functions[FIELD_2]
    for e in range(length):
        y[e] = 0.0
        slopes[e] = 0.0  # time stands still at the segment's start
    for e in range(n):
        y[e] = x0[e]
        y[n + e * columns + e] = 1.0
    for a in range(n_active):
        point[2 * n + a] = v[n + 1 + a]
    for step in range(count):
        s = mesh[step]
        h = mesh[step + 1] - s
        for i in range(1, 13):
            stage(i, slopes, length, h, y, trial)
            time = s + C[i] * h
            weight, share = 6.0 * time * (1.0 - time), time * time * (3.0 - 2.0 * time)
            rate, longer = duration * weight, v[n] * weight
            out = pointer(slopes, i * length)
            call(vary, mode, columns, trial, 0, p, out, 0)
            for e in range(n):
                point[e] = trial[e]
                point[n + e] = share * out[e] * v[n] + along(pointer(trial, n + e * columns), v, n, n_active)
            call(field_2, mode, 0, point, 0, bent.p, bend, 0)
            if mean:
                quadrature(segment, sensitive, bent, weight, share, trial, out, point, scratch)
            for e in range(n):
                row, line = pointer(out, n + e * columns), pointer(bend, e * kept)
                for c in range(kept):
                    total = line[c] if c >= n else 0.0
                    for b in range(n):
                        total += line[b] * trial[n + b * columns + c]
                    row[kept + c] = rate * (row[kept + c] + total) + longer * row[c]
                    row[c] *= rate
                out[e] *= rate
            for a in range(n_active):
                call(field_p, mode, params[a], trial, 0, p, fp, 0)
                for e in range(n):
                    row = pointer(out, n + e * columns)
                    row[n + a] += rate * fp[e]
                    row[kept + n + a] += longer * fp[e]
        for e in range(length):
            y[e] = trial[e]
            slopes[e] = slopes[12 * length + e]
    keep(block)


@njit(**INNER)
def along(row, v, n, n_active):
    """Sum of sensitivities, (n + active,), times the direction's initial state and parameters."""
    total = 0.0
    for b in range(n):
        total += row[b] * v[b]
    for a in range(n_active):
        total += row[n + a] * v[n + 1 + a]
    return total


@njit(**INNER)
def quadrature(segment, sensitive, bent, weight, share, trial, out, point, scratch):
    """Write the slopes of the mean rate of an event function with its derivatives, and of these along the direction.

    They lie in `out` behind those of the sensitivities, twice (1 + n + active + 1,); the last is that along the
    duration. With the duration the state changes by share times the field, and the variation by share times its slope.
    scratch: (6 n + 4 + 2 (n + active),).
    """
    outlined()
    functions, mode, _, p, n = segment
    transition, _, _, params, n_active, columns = sensitive
    kept, v = n + n_active, bent.direction
    first, twice = pointer(out, n * (1 + columns)), pointer(out, n * (1 + columns) + kept + 2)
    ev, turn, fp, bend = scratch, pointer(scratch, 2 * n + 2), pointer(scratch, 4 * n + 2), pointer(scratch, 6 * n + 4)
    call(functions[EVENT_X], transition, 0, trial, 0, p, ev, 0)
    call(functions[VARY], mode, 1, point, 0, p, turn, 0)
    call(bent.functions[EVENT_2], transition, 0, point, 0, bent.p, bend, 0)
    gradient, line, slope = pointer(ev, 2 + n), pointer(bend, kept), pointer(turn, n)
    for a in range(n_active):
        call(functions[FIELD_P], mode, params[a], trial, 0, p, fp, 0)
        for e in range(n):
            slope[e] += fp[e] * v[n + 1 + a]
    first[0] = weight * ev[1]
    longer = bent = change = 0.0
    for e in range(n):
        longer += gradient[e] * out[e]
        bent += gradient[e] * slope[e] + line[e] * out[e]
        change += gradient[e] * point[n + e]
    first[1 + kept], twice[1 + kept] = weight * share * longer, weight * share * bent
    for c in range(kept):
        one, two = 0.0, line[c] if c >= n else 0.0
        for e in range(n):
            one += gradient[e] * trial[n + e * columns + c]
            two += gradient[e] * trial[n + e * columns + kept + c] + line[e] * trial[n + e * columns + c]
        first[1 + c], twice[1 + c] = weight * one, weight * two
    for a in range(n_active):
        call(functions[EVENT_P], transition, params[a], trial, 0, p, fp, 0)
        first[1 + n + a] += weight * fp[1]
        change += fp[1] * v[n + 1 + a]
    twice[0] = weight * change
