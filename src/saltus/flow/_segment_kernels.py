"""Compiled flow of one segment of given duration, in clustered time, with sensitivities.

Time is mapped by t = T s^2 (3 - 2 s), s from 0 to 1, so that a field which is only C^1 at a segment's two ends is smooth
in s. A mesh in s carries the steps: `adapt` makes one under error control, `flow` runs on it, `redistribute` moves it.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from saltus.flow._kernels import call, dense_coefficients, dense_slope, dense_value, error_norm, stage
from saltus.flow.tableaux import NODES

VARY, FIELD, FIELD_P, EVENT_X, EVENT_P = 2, 1, 3, 5, 6
C = tuple(NODES.tolist())
MOST_STEPS = 4000


@njit(cache=True, error_model="numpy")
def state_slope(functions, mode, duration, s, x, p, slopes, at, n):
    """Write dx/ds of the clustered flow at `at` in `slopes`."""
    call(functions[FIELD], mode, 0, x, 0, p, slopes, at)
    rate = duration * 6.0 * s * (1.0 - s)
    for e in range(n):
        slopes[at + e] *= rate


@njit(cache=True, error_model="numpy")
def state_step(functions, mode, duration, s, h, x, p, slopes, x_end, n):
    """Take one step of the state into `x_end`, (n,); slopes[:n] is set before, slopes[12 n:13 n] after."""
    field = functions[FIELD]
    for i in range(1, 13):
        stage(i, slopes, n, h, x, x_end)
        time = s + C[i] * h
        call(field, mode, 0, x_end, 0, p, slopes, i * n)
        rate = duration * 6.0 * time * (1.0 - time)
        for e in range(n):
            slopes[i * n + e] *= rate


@njit(cache=True, error_model="numpy")
def dense_step(functions, mode, duration, s, h, x, p, slopes, y, x_end, coefficients, n):
    """Write the dense output of a step, (7 n,), after `state_step` has left its end in `x_end`. y: scratch, (n,)."""
    field = functions[FIELD]
    for i in range(13, 16):
        stage(i, slopes, n, h, x, y)
        time = s + C[i] * h
        call(field, mode, 0, y, 0, p, slopes, i * n)
        rate = duration * 6.0 * time * (1.0 - time)
        for e in range(n):
            slopes[i * n + e] *= rate
    dense_coefficients(slopes, n, h, x, x_end, coefficients)


ALIKE = 0.75  # least ratio of neighbouring steps
VARIED = 1e2  # tolerance of the sensitivities, which vary faster, over that of the state
PROBES = (0.46, 0.75)
MISSED = 1e4


@njit(cache=True, error_model="numpy")
def missed(functions, mode, duration, s, h, p, dense, dense_at, nodes, nodes_at, n, x, probe, field, rtol, atol):
    """Whether a step passed over something: its dense output, between the stages, is far from satisfying the equations.

    The error estimate sees the field at the stages only, and a narrow dip towards a surface can lie between them.
    """
    for k in range(len(PROBES)):
        fraction = PROBES[k]
        dense_value(dense, dense_at, n, nodes, nodes_at, fraction, x)
        dense_slope(dense, dense_at, n, fraction, probe)
        state_slope(functions, mode, duration, s + fraction * h, x, p, field, 0, n)
        for e in range(n):
            if not abs(probe[e] - h * field[e]) <= MISSED * (atol + rtol * abs(x[e])):
                return True
    return False


@njit(cache=True, error_model="numpy")
def adapt(functions, mode, x0, duration, p, rtol, atol, mesh):
    """Fill `mesh` with the ends of steps from 0 to 1 whose errors are within tolerance; return their count.

    -1 where the flow cannot be followed: the state is not finite, or more than the mesh holds. mesh: (count + 1,).
    """
    n = x0.size
    slopes = np.zeros(16 * n)
    x, y, x_end = x0.copy(), np.empty(n), np.empty(n)
    coefficients, probe, field = np.empty(7 * n), np.empty(n), np.empty(n)
    mesh[0] = 0.0
    count, s, h = 0, 0.0, 0.05
    state_slope(functions, mode, duration, 0.0, x, p, slopes, 0, n)
    while s < 1.0:
        h = min(h, 1.0 - s)
        if 1.0 - s - h < 0.1 * h:
            h = 1.0 - s
        if h < 1e-12:
            return -1
        state_step(functions, mode, duration, s, h, x, p, slopes, x_end, n)
        error = error_norm(slopes, n, 0, n, h, x, x_end, rtol, atol)
        if not error < 1e300:
            h *= 0.1
            continue
        if error > 1.0:
            h *= max(0.2, 0.9 * error**-0.125)
            continue
        dense_step(functions, mode, duration, s, h, x, p, slopes, y, x_end, coefficients, n)
        if missed(functions, mode, duration, s, h, p, coefficients, 0, x, 0, n, y, probe, field, rtol, atol):
            h *= 0.5
            continue
        count += 1
        if count >= mesh.size:
            return -1
        s = 1.0 if h == 1.0 - s else s + h
        mesh[count] = s
        for e in range(n):
            x[e] = x_end[e]
            slopes[e] = slopes[12 * n + e]
        h *= min(4.0, 0.9 * max(error, 1e-12) ** -0.125)
    return count


@njit(cache=True, error_model="numpy")
def redistribute(mesh, count, errors, target, out):
    """Write a mesh whose steps have equal errors, `target` of the tolerance, from the errors on `mesh`; return its count."""
    density = np.empty(count)
    for i in range(count):
        density[i] = max(errors[i] / target, 1e-5) ** 0.125 / (mesh[i + 1] - mesh[i])
    for i in range(1, count):  # neighbours alike, so that what moves a little meets steps that fit it
        density[i] = max(density[i], ALIKE * density[i - 1])
    total = 0.0
    for i in range(count - 1, -1, -1):
        if i < count - 1:
            density[i] = max(density[i], ALIKE * density[i + 1])
        errors[i] = density[i]
        total += density[i] * (mesh[i + 1] - mesh[i])
    new = min(max(int(math.ceil(total)), 4), out.size - 1)
    out[0] = 0.0
    i, done = 0, 0.0
    for j in range(1, new):
        wanted = total * j / new
        while i < count - 1 and done + errors[i] * (mesh[i + 1] - mesh[i]) < wanted:
            done += errors[i] * (mesh[i + 1] - mesh[i])
            i += 1
        out[j] = mesh[i] + (wanted - done) / errors[i]
    out[new] = 1.0
    return new


@njit(cache=True, error_model="numpy")
def flow(
    functions, mode, transition, mean, x0, x0_at, duration, p, active, rtol, atol, mesh, mesh_at, count, n, y, errors
):
    """Run a segment on its mesh and leave state and sensitivities in `y`; the steps' errors over tolerance in `errors`.

    y: [x (n), dx (n, columns), and where `mean` the mean rate of the event function and its derivatives (columns,)], the
    columns being the n components of the initial state, the active parameters and, where `mean`, the duration.
    """
    columns = n + active.size + (1 if mean else 0)
    size = n * (1 + columns)
    length = size + ((1 + columns) if mean else 0)
    slopes = np.empty(13 * length)
    trial = np.empty(length)
    ev = np.empty(2 + 2 * n)
    vary, field_p, event_x, event_p = functions[VARY], functions[FIELD_P], functions[EVENT_X], functions[EVENT_P]
    for e in range(length):
        y[e] = 0.0
    for e in range(n):
        y[e] = x0[x0_at + e]
        y[n + e * columns + e] = 1.0
    for e in range(length):
        slopes[e] = 0.0  # time stands still at the segment's start
    for step in range(count):
        s = mesh[mesh_at + step]
        h = mesh[mesh_at + step + 1] - s
        for i in range(1, 13):
            stage(i, slopes, length, h, y, trial)
            at = i * length
            time = s + C[i] * h
            call(vary, mode, columns, trial, 0, p, slopes, at)
            weight = 6.0 * time * (1.0 - time)
            rate = duration * weight
            if mean:
                for e in range(n):
                    ev[e] = slopes[at + e]
            for e in range(size):
                slopes[at + e] *= rate
            if mean:
                for e in range(n):
                    slopes[at + n + e * columns + columns - 1] += weight * ev[e]
            for a in range(active.size):
                call(field_p, mode, active[a], trial, 0, p, ev, 0)
                for e in range(n):
                    slopes[at + n + e * columns + n + a] += rate * ev[e]
            if mean:
                call(event_x, transition, 0, trial, 0, p, ev, 0)
                slopes[at + size] = weight * ev[1]
                for c in range(columns):
                    total = 0.0
                    for e in range(n):
                        total += ev[2 + n + e] * trial[n + e * columns + c]
                    slopes[at + size + 1 + c] = weight * total
                for a in range(active.size):
                    call(event_p, transition, active[a], trial, 0, p, ev, 0)
                    slopes[at + size + 1 + n + a] += weight * ev[1]
        largest = 1e-300
        for e in range(n, size):
            largest = max(largest, abs(trial[e]))
        errors[mesh_at + step] = max(
            error_norm(slopes, length, 0, n, h, y, trial, rtol, atol),
            error_norm(slopes, length, n, size - n, h, y, trial, 0.0, VARIED * rtol * largest),
        )
        for e in range(length):
            y[e] = trial[e]
            slopes[e] = slopes[12 * length + e]


@njit(cache=True, error_model="numpy")
def dense(
    functions, mode, x0, x0_at, duration, p, mesh, mesh_at, count, n, nodes, nodes_at, coefficients, coefficients_at
):
    """Run a segment's state on its mesh and keep dense output: nodes (count + 1, n) and coefficients (count, 7 n), flat."""
    slopes = np.empty(16 * n)
    x, y, x_end, one = np.empty(n), np.empty(n), np.empty(n), np.empty(7 * n)
    for e in range(n):
        x[e] = x0[x0_at + e]
        nodes[nodes_at + e] = x[e]
    state_slope(functions, mode, duration, 0.0, x, p, slopes, 0, n)
    for step in range(count):
        s = mesh[mesh_at + step]
        h = mesh[mesh_at + step + 1] - s
        state_step(functions, mode, duration, s, h, x, p, slopes, x_end, n)
        dense_step(functions, mode, duration, s, h, x, p, slopes, y, x_end, one, n)
        for e in range(7 * n):
            coefficients[coefficients_at + step * 7 * n + e] = one[e]
        for e in range(n):
            x[e] = x_end[e]
            slopes[e] = slopes[12 * n + e]
            nodes[nodes_at + (step + 1) * n + e] = x[e]
