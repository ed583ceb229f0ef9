"""Compiled flow of one segment of given duration, in clustered time, with sensitivities.

Time is mapped by t = T s^2 (3 - 2 s), s from 0 to 1. A field that is only C^1 at a segment's two ends is then smooth in
s. A mesh in s holds the ends of the steps: `adapt` makes it under error control, `flow` runs on it, `redistribute`
moves it. The page docs/theory/flow.md derives the mapping.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import float64, int64

from saltus.flow.kernels.shares import allowed
from saltus.flow.kernels.stages import dense_coefficients, dense_slope, dense_value, error_norm, stage, state_error
from saltus.flow.kernels.vast import VAST, any_alone, own_error, rescaled, unscaled
from saltus.flow.kernels.ways import JUMP, WAYS, longest_way
from saltus.flow.tableaux import NODES as C
from saltus.system.compiled import FUNCTIONS, SHARES
from saltus.system.numba_tools.machine_code import kernel, njit
from saltus.system.numba_tools.pointers import INNER, call, keep, numbers_at, outlined, pointer, stack

VARY = FUNCTIONS.index("vary")
FIELD = FUNCTIONS.index("field")
FIELD_P = FUNCTIONS.index("field_p")
EVENT_X = FUNCTIONS.index("event_x")
EVENT_P = FUNCTIONS.index("event_p")
LINEAR = SHARES + 1  # behind them, the address of the modes' linear parts, 0 where steps take no notice of these
BLOCKED = -1  # what `adapt` returns where a flow ends on the way
SHORT = -2  # where its steps are too many, or too short from the start
MOST_STEPS = 400_000  # steps of one segment at most: a stiff one needs as many as its stability allows


class Segment(NamedTuple):
    """The flow in a mode for a given duration.

    Attributes
    ----------
    functions : pointer to int64
        Addresses of the generated functions.
    mode : int
        Index of the mode.
    duration : float
        How long the segment lasts.
    p : pointer to float64
        Extended parameters.
    n : int
        Components of the full state.
    """

    functions: object
    mode: int
    duration: float
    p: object
    n: int


class Sensitive(NamedTuple):
    """The variables of a segment's sensitivities, and its end.

    Attributes
    ----------
    transition : int
        The event at the segment's end; -1 for none.
    mean : bool
        Whether the mean rate of the event function is integrated, and with it the derivative by the duration.
    rooted : bool
        Whether the mode's field has roots that vanish on a surface.
    active : pointer to int64
        Parameters by which derivatives are taken.
    n_active : int
        How many.
    columns : int
        Components of the initial state, active parameters and, where `mean`, the duration.
    """

    transition: int
    mean: bool
    rooted: bool
    active: object
    n_active: int
    columns: int


@kernel
def decays(functions, modes, u, n, p, found):
    """Write by how many factors e the state decays that does so fastest by itself, for each segment, in `found`."""
    block = np.empty(2 * n * (n + 1))
    functions, frame, out = pointer(functions, 0), pointer(block, 0), pointer(block, n * (n + 1))
    u, p = pointer(u, 0), pointer(p, 0)
    for e in range(n * n):
        frame[n + e] = 1.0 if e % (n + 1) == 0 else 0.0
    for i in range(modes.size):
        for e in range(n):
            frame[e] = u[i * (n + 1) + e]
        call(functions[VARY], modes[i], n, frame, 0, p, out, 0)
        found[i] = 0.0
        for e in range(n):
            decay = -u[i * (n + 1) + n] * out[n + e * (n + 1)]
            if found[i] < decay < np.inf:
                found[i] = decay
    keep(block)


@njit(**INNER)
def state_slope(segment, s, x, slopes, at):
    """Write dx/ds of the clustered flow at `at` in `slopes`."""
    call(segment.functions[FIELD], segment.mode, 0, x, 0, segment.p, slopes, at)
    rate = segment.duration * 6.0 * s * (1.0 - s)
    for e in range(segment.n):
        slopes[at + e] *= rate


@njit(**INNER)
def _stages(segment, s, h, x, slopes, y, first, last):
    """Take the stages from `first` to before `last` of a step of the state, the argument of the last one left in `y`."""
    outlined()
    field, mode, duration, p, n = segment.functions[FIELD], segment.mode, segment.duration, segment.p, segment.n
    for i in range(first, last):
        stage(i, slopes, n, h, x, y)
        time = s + C[i] * h
        call(field, mode, 0, y, 0, p, slopes, i * n)
        rate = duration * 6.0 * time * (1.0 - time)
        for e in range(n):
            slopes[i * n + e] *= rate


@njit(**INNER)
def state_step(segment, s, h, x, slopes, x_end):
    """Take one step of the state into `x_end`, (n,); slopes[:n] is set before, slopes[12 n:13 n] after."""
    _stages(segment, s, h, x, slopes, x_end, int64(1), int64(13))


@njit(**INNER)
def dense_step(segment, s, h, x, slopes, y, x_end, coefficients):
    """Write the dense output of a step, (7 n,), after `state_step` has left its end in `x_end`. y: scratch, (n,)."""
    _stages(segment, s, h, x, slopes, y, int64(13), int64(16))
    dense_coefficients(slopes, segment.n, h, x, x_end, coefficients)


EXTRAPOLATION = (5.0, -10.0, 10.0, -5.0, 1.0)  # weights of values at 1, 2, 3, 4, 5 in the value at 0
NEARBY = 1e-4  # distance of the nearest such value from the surface, as a share of the segment's duration
ALIKE = 0.75  # least ratio of neighbouring steps of a mesh
VARIED = 1e2  # tolerance of the sensitivities, which vary faster, over that of the state
PROBES = (0.46, 0.75)  # fractions of a step, between its stages, at which its dense output is checked
MISSED = 1e4  # defect there, in tolerances, beyond which the step passed over something


@njit(**INNER)
def missed(segment, s, h, most, curve, node, x, probe, field, rtol, atol):
    """Whether a step passed over something: its dense output, between the stages, is far from satisfying the equations.

    The error estimate sees the field at the stages only, and a narrow dip towards a surface can lie between them.
    most: as in `leaps`. curve: (7 n,), from the state `node`, (n,). x, probe, field: scratch, (n,) each.
    """
    outlined()
    n, shares = segment.n, numbers_at(segment.functions[SHARES])
    for k in range(len(PROBES)):
        fraction = PROBES[k]
        dense_value(curve, 0, n, node, 0, fraction, x)
        dense_slope(curve, 0, n, fraction, probe)
        state_slope(segment, s + fraction * h, x, field, int64(0))
        for e in range(n):
            if not abs(probe[e] - h * field[e]) <= MISSED * allowed(shares[e], abs(x[e]), rtol, atol):
                return True
    return leaps(segment, h, most, curve, node)


@njit(**INNER)
def leaps(segment, h, most, curve, node):
    """Whether an exponent goes further than `most` ways in a step, which may hide a pulse; the rest as in `missed`."""
    way = segment.functions[WAYS]
    return h > JUMP and longest_way(way, segment.mode, segment.n, segment.p, curve, node) > most


@kernel
def adapt(functions, mode, x0, duration, p, rtol, atol, mesh):
    """Fill `mesh` with the ends of steps from 0 to 1 whose errors are within tolerance; return their count.

    mesh: (count + 1,). `BLOCKED` where a step on the way becomes too short, as next to a singularity; `SHORT` where the
    first step does or the steps are more than the mesh holds, as of a stiff flow.
    """
    n = x0.size
    room, block = mesh.size, stack(float64, 28 * n)
    functions, x0, p, mesh = pointer(functions, 0), pointer(x0, 0), pointer(p, 0), pointer(mesh, 0)
    slopes, x, y, x_end = block, pointer(block, 16 * n), pointer(block, 17 * n), pointer(block, 18 * n)
    coefficients, probe, field = pointer(block, 19 * n), pointer(block, 26 * n), pointer(block, 27 * n)
    segment, start = Segment(functions, mode, duration, p, n), int64(0)
    for e in range(n):
        x[e] = x0[e]
    mesh[0] = 0.0
    count, s, h = 0, 0.0, 0.05
    state_slope(segment, 0.0, x, slopes, start)
    while s < 1.0:
        h = min(h, 1.0 - s)
        if 1.0 - s - h < 0.1 * h:
            h = 1.0 - s
        if h < 1e-12:
            return BLOCKED if count > 0 else SHORT
        state_step(segment, s, h, x, slopes, x_end)
        error = state_error(slopes, n, n, h, x, x_end, (rtol, atol), numbers_at(functions[SHARES]))
        if not error < 1e300:
            h *= 0.1
            continue
        if error > 1.0:
            h *= max(0.2, 0.9 * error**-0.125)
            continue
        dense_step(segment, s, h, x, slopes, y, x_end, coefficients)
        if missed(segment, s, h, 1.0, coefficients, x, y, probe, field, rtol, atol):
            h *= 0.5
            continue
        count += 1
        if count >= room:
            return SHORT
        s = 1.0 if h == 1.0 - s else s + h
        mesh[count] = s
        for e in range(n):
            x[e] = x_end[e]
            slopes[e] = slopes[12 * n + e]
        h *= min(4.0, 0.9 * max(error, 1e-12) ** -0.125)
    return count


@njit(**INNER)
def redistribute(mesh, count, errors, target, out, room):
    """Write a mesh whose steps have equal errors, `target` of the tolerance, from the errors on `mesh`; return its count.

    room: entries of `out`.
    """
    outlined()
    scratch = np.empty(count)
    density = pointer(scratch, 0)
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
    new = min(max(int(math.ceil(total)), 4), room - 1)
    out[0] = 0.0
    i, done = 0, 0.0
    for j in range(1, new):
        wanted = total * j / new
        while i < count - 1 and done + errors[i] * (mesh[i + 1] - mesh[i]) < wanted:
            done += errors[i] * (mesh[i + 1] - mesh[i])
            i += 1
        out[j] = mesh[i] + (wanted - done) / errors[i]
    out[new] = 1.0
    keep(scratch)
    return new


@njit(**INNER)
def _surface_slopes(segment, sensitive, sign, y, work, slopes):
    """Add to the slopes of sensitivities, (n + n columns,), at a segment's start (sign 1) or end (-1) what roots make of them.

    Where an argument of a root vanishes, first derivatives of the field grow like 1 / sqrt(t), with t = 3 T s^2. Their
    product with the rate of clustered time, 6 T s (1 - s), tends to 2 sqrt(3 T) lim sqrt(t) f'. This limit is
    extrapolated along the field from five points in sqrt(t): docs/theory/orbits.md. At its end a segment meets the
    surface of its transition.
    """
    outlined()
    functions, mode, duration, p, n = segment
    transition, columns = sensitive.transition, sensitive.columns
    size = n * (1 + columns)
    moved, out, fp, ev = work, pointer(work, size), pointer(work, 2 * size), pointer(work, 2 * size + n + 2)
    call(functions[FIELD], mode, 0, y, 0, p, fp, 0)
    behind = 0.0
    if sign < 0.0 and transition >= 0:
        call(functions[EVENT_X], transition, 0, y, 0, p, ev, 0)
        if abs(ev[0]) < NEARBY * duration * abs(ev[1]):
            behind = ev[0] / ev[1]
    for e in range(n):
        ev[e] = fp[e]
    for e in range(size):
        moved[e] = y[e]
    for k in range(len(EXTRAPOLATION)):
        root = (k + 1) * math.sqrt(NEARBY * duration)
        weight = EXTRAPOLATION[k] * root * 2.0 * math.sqrt(3.0 * duration)
        for e in range(n):
            moved[e] = y[e] + ev[e] * (sign * root * root - behind)
        call(functions[VARY], mode, columns, moved, 0, p, out, 0)
        for e in range(n, size):
            slopes[e] += weight * out[e]
        for a in range(sensitive.n_active):
            call(functions[FIELD_P], mode, sensitive.active[a], moved, 0, p, fp, 0)
            for e in range(n):
                slopes[n + e * columns + n + a] += weight * fp[e]


def _made_step(at_surface):
    """Return the kernel of a step of state and sensitivities; `at_surface` for the last one of a field with roots there.

    Two kernels: what is done at a surface would make every other step an eighth slower.
    """

    @njit(**INNER)
    def step_kernel(segment, sensitive, s, h, y, slopes, trial, forcing, ev, work):
        """Take a step from y, (length,), into trial; slopes[:length] is set before, slopes[12 length:13 length] after."""
        functions, mode, duration, p, n = segment
        transition, mean, _, params, n_active, columns = sensitive
        size = n * (1 + columns)
        length = size + ((1 + columns) if mean else 0)
        for i in range(1, 13):
            stage(i, slopes, length, h, y, trial)
            at = i * length
            time = s + C[i] * h
            call(functions[VARY], mode, columns, trial, 0, p, slopes, at)
            for a in range(
                n_active
            ):  # next to `vary`, before its results are read: stored one by one, they must settle
                call(functions[FIELD_P], mode, params[a], trial, 0, p, forcing, a * n)
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
            for a in range(n_active):
                for e in range(n):
                    slopes[at + n + e * columns + n + a] += rate * forcing[a * n + e]
            if mean:
                call(functions[EVENT_X], transition, 0, trial, 0, p, ev, 0)
                slopes[at + size] = weight * ev[1]
                for c in range(columns):
                    total = 0.0
                    for e in range(n):
                        total += ev[2 + n + e] * trial[n + e * columns + c]
                    slopes[at + size + 1 + c] = weight * total
                for a in range(n_active):
                    call(functions[EVENT_P], transition, params[a], trial, 0, p, ev, 0)
                    slopes[at + size + 1 + n + a] += weight * ev[1]
            if at_surface and C[i] == 1.0:
                _surface_slopes(segment, sensitive, -1.0, trial, work, pointer(slopes, at))

    return step_kernel


_step = _made_step(at_surface=False)
_step_to_surface = _made_step(at_surface=True)


@njit(**INNER)
def flow(segment, sensitive, x0, mesh, count, rtol, atol, y, errors):
    """Run a segment on its mesh and leave state and sensitivities in `y`; the steps' errors over tolerance in `errors`.

    y: [x (n), dx (n, columns), and where `mean` the mean rate of the event function and its derivatives (columns,)].
    """
    outlined()
    n, columns, mean = segment.n, sensitive.columns, sensitive.mean
    size = n * (1 + columns)
    length = size + ((1 + columns) if mean else 0)
    rooted = sensitive.rooted and segment.duration > 0.0
    block = np.empty(14 * length + 2 + (3 + sensitive.n_active) * n + (2 * size + 3 * n + 4 if rooted else 0))
    slopes, trial, ev = pointer(block, 0), pointer(block, 13 * length), pointer(block, 14 * length)
    forcing = pointer(ev, 2 + 2 * n)  # of the active parameters, n each
    powers = pointer(forcing, sensitive.n_active * n)
    work = pointer(powers, n)
    for e in range(length):
        y[e] = 0.0
    for e in range(n):
        y[e] = x0[e]
        y[n + e * columns + e] = 1.0
        powers[e] = 0.0
    scaled, shares = False, numbers_at(segment.functions[SHARES])
    alone = any_alone(n, x0, shares)
    for e in range(length):
        slopes[e] = 0.0  # time stands still at the segment's start
    if rooted:
        _surface_slopes(segment, sensitive, 1.0, y, work, slopes)
    for step in range(count):
        s = mesh[step]
        h = mesh[step + 1] - s
        if rooted and step == count - 1:
            _step_to_surface(segment, sensitive, s, h, y, slopes, trial, forcing, ev, work)
        else:
            _step(segment, sensitive, s, h, y, slopes, trial, forcing, ev, work)
        largest = 1e-300
        for e in range(n, size):
            largest = max(largest, abs(trial[e]))
        errors[step] = max(
            state_error(slopes, length, n, h, y, trial, (rtol, atol), shares),
            error_norm(slopes, length, n, size - n, h, y, trial, 0.0, VARIED * rtol * largest),
        )
        if alone:
            own = own_error(n, columns, x0, shares, (slopes, length, h, y, trial), VARIED * rtol)
            errors[step] = max(errors[step], own)
        for e in range(length):
            y[e] = trial[e]
            slopes[e] = slopes[12 * length + e]
        if largest > VAST or scaled:
            scaled = rescaled(n, columns, x0, y, slopes, powers)
    if scaled:
        unscaled(n, columns, y, powers)
    keep(block)


@njit(**INNER)
def dense(segment, x0, mesh, count, nodes, coefficients):
    """Run a segment's state on its mesh and keep dense output: nodes (count + 1, n) and coefficients (count, 7 n), flat."""
    outlined()
    n = segment.n
    block = stack(float64, 19 * n)
    slopes, x, y, x_end = block, pointer(block, 16 * n), pointer(block, 17 * n), pointer(block, 18 * n)
    for e in range(n):
        x[e] = x0[e]
        nodes[e] = x[e]
    state_slope(segment, 0.0, x, slopes, int64(0))
    for step in range(count):
        s = mesh[step]
        h = mesh[step + 1] - s
        state_step(segment, s, h, x, slopes, x_end)
        dense_step(segment, s, h, x, slopes, y, x_end, pointer(coefficients, step * 7 * n))
        for e in range(n):
            x[e] = x_end[e]
            slopes[e] = slopes[12 * n + e]
            nodes[(step + 1) * n + e] = x[e]
