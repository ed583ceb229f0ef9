"""Compiled equations of a periodic orbit and their Jacobian: docs/theory/orbits.md, "Segment equations"."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import int64

from saltus.flow.kernels.segment import EVENT_P, EVENT_X, FIELD, VARY, Segment, Sensitive, flow
from saltus.orbits.records import Mesh, Orbit
from saltus.orbits.signature import CUT_END, EVENT_END, MEAN_END, ONWARD_END, PHASE_END, TOUCH_END
from saltus.system.compiled import FUNCTIONS
from saltus.system.numba_tools.machine_code import kernel, njit
from saltus.system.numba_tools.pointers import INNER, call, invoke, keep, outlined, pointer

DERIVE = FUNCTIONS.index("derive")
RESET = FUNCTIONS.index("reset")
RESET_X = FUNCTIONS.index("reset_x")
RESET_P = FUNCTIONS.index("reset_p")
TURN = 2.0 * math.pi
SHORT = 0.01  # share of the period below which a segment's mean rate is integrated, not taken from its ends


class System(NamedTuple):
    """An orbit's signature and its system, on pointers; see `saltus.orbits.records.Orbit`."""

    functions: object
    p: object
    n: int
    segments: int
    modes: object
    transitions: object
    kinds: object
    rooted: object
    active: object
    n_active: int
    implicit: object


class Piece(NamedTuple):
    """One segment of an orbit.

    Attributes
    ----------
    kind, mode, transition : int
        How it ends, where it runs, and its event; -1 for none.
    duration : float
        How long it lasts.
    mean : bool
        Whether the mean rate of its event function is integrated.
    row, following : int
        Where its unknowns begin, and those of the next one.
    """

    kind: int
    mode: int
    transition: int
    duration: float
    mean: bool
    row: int
    following: int


@kernel
def set_parameters(functions, u, m, active, scales, p):
    """Take the active parameters from the unknowns behind the m of the orbit, and recompute the constants behind them."""
    take_parameters(functions, u, m, active, scales, p)


@njit(**INNER)
def take_parameters(functions, u, m, active, scales, p):
    """Do as `set_parameters`, within a kernel."""
    for k in range(active.size):
        p[active[k]] = u[m + k] * scales[k]
    if active.size > 0:
        call(functions[DERIVE], 0, 0, p, 0, p, p, 0)


@kernel
def largest_terms(functions, modes, u, n, p, terms):
    """Write the largest size of each term J_ij x_j of the states' rates at the segments' starts in `terms`, (n, n)."""
    block = np.empty(2 * n * (n + 1))
    functions, frame, out = pointer(functions, 0), pointer(block, 0), pointer(block, n * (n + 1))
    u, p, terms = pointer(u, 0), pointer(p, 0), pointer(terms, 0)
    for e in range(n * n):
        terms[e] = 0.0
        frame[n + e] = 1.0 if e % (n + 1) == 0 else 0.0
    for i in range(modes.size):
        for e in range(n):
            frame[e] = u[i * (n + 1) + e]
        call(functions[VARY], modes[i], n, frame, 0, p, out, 0)
        for e in range(n * n):
            size = abs(out[n + e] * frame[e % n])
            if terms[e] < size < np.inf:
                terms[e] = size
    keep(block)


@njit(**INNER)
def pointed(orbit):
    """Return an orbit's record on pointers; its arrays must live on."""
    return System(
        pointer(orbit.functions, 0),
        pointer(orbit.p, 0),
        orbit.n,
        orbit.modes.size,
        pointer(orbit.modes, 0),
        pointer(orbit.transitions, 0),
        pointer(orbit.kinds, 0),
        pointer(orbit.rooted, 0),
        pointer(orbit.active, 0),
        orbit.active.size,
        pointer(orbit.implicit, 0),
    )


@njit(**INNER)
def total_duration(u, segments, n):
    """Return the sum of the durations' sizes."""
    total = 0.0
    for i in range(segments):
        total += abs(u[i * (n + 1) + n])
    return total


@njit(**INNER)
def piece_at(system, i, u, total):
    """Return a segment of the orbit `u`, whose durations sum up to `total`."""
    kind, row = system.kinds[i], i * (system.n + 1)
    duration = u[row + system.n]
    mean = kind == MEAN_END and abs(duration) < SHORT * total
    following = row + system.n + 1 if i + 1 < system.segments else 0
    return Piece(kind, system.modes[i], system.transitions[i], duration, mean, row, following)


@njit(**INNER)
def equations(orbit, mesh, phase, tolerances, u, F, J, errors):
    """Write the residual F, (m,), and the Jacobian J, (m, m + active), of all segment equations.

    u: each segment's state (n,) and duration, m = segments * (n + 1) in all; then the active parameters. orbit, mesh, phase:
    those records; tolerances: relative and absolute. Returns the largest error of a step, in tolerances.
    """
    outlined()
    system, n, n_active = pointed(orbit), orbit.n, orbit.active.size
    m = system.segments * (n + 1)
    width = m + n_active
    take_parameters(orbit.functions, u, m, orbit.active, orbit.scales, orbit.p)
    start, F, entries, errors = pointer(u, 0), pointer(F, 0), pointer(J, 0), pointer(errors, 0)
    shares, starts, worst = pointer(phase.shares, 0), pointer(mesh.starts, 0), 0.0
    for i in range(m * width):
        entries[i] = 0.0
    total = total_duration(start, system.segments, n)
    y = np.empty((n + 1) * (n + n_active + 2))
    block = np.empty(n * n + 5 * n + 4)
    end, work = pointer(y, 0), pointer(block, 0)
    for i in range(system.segments):
        piece, first, count = piece_at(system, i, start, total), starts[i], starts[i + 1] - starts[i] - 1
        kind, row = piece.kind, piece.row
        _sweep(system, piece, start, pointer(mesh.places, first), count, tolerances, end, pointer(errors, first))
        for step in range(first, first + count):
            worst = max(worst, errors[step])
        _landing(system, piece, start, end, work, F, entries)
        for k in range(orbit.angles.size):
            at = row + orbit.angles[k]
            F[at] -= TURN * math.floor(F[at] / TURN + 0.5)
        last = row + n
        if piece.following == 0 and orbit.turns > 0:
            F[last - 1] -= orbit.turn * orbit.turns
        line = pointer(entries, last * width)
        if piece.mean:
            F[last] = _integrated(system, piece, end, line)
        elif kind == EVENT_END or kind == MEAN_END or kind == TOUCH_END:
            F[last] = _met(system, piece, start, end, work, line)
        elif kind == PHASE_END:
            F[last] = start[last - 1]
            line[last - 1] += 1.0
        elif kind == CUT_END and phase.anchor.size == 2 * n:
            F[last] = shares[i - 1] * piece.duration - shares[i] * start[row - 1]
            line[last] += shares[i - 1]
            line[row - 1] -= shares[i]
        elif kind == ONWARD_END:
            F[last] = shares[i + 1] * piece.duration - shares[i] * start[piece.following + n]
            line[last] += shares[i + 1]
            line[piece.following + n] -= shares[i]
        else:
            F[last] = _on_plane(pointer(phase.anchor, 2 * n * i), pointer(start, row), n, pointer(line, row))
    if orbit.laws.shape[0] > 0:
        _keep_totals(orbit, u, m, F, entries)
    for k in range(n_active):
        for i in range(m):
            entries[i * width + m + k] *= orbit.scales[k]
    keep(y)
    keep(block)
    return worst


@njit(**INNER)
def _keep_totals(orbit, u, m, F, entries):
    """Add to the closing equations how far the first state is from the totals that are kept."""
    outlined()
    n_active, last = orbit.active.size, m - orbit.n - 1
    width = m + n_active
    for t in range(orbit.laws.shape[0]):
        row, column = last + int64(orbit.laws[t, 0]), int64(orbit.laws[t, 1])
        x = u[column]
        value = _power(orbit, t, int64(-1))
        F[row] -= value * x
        entries[row * width + column] -= value
        for k in range(n_active):
            if orbit.laws[t, 3 + orbit.active[k]] != 0.0:
                entries[row * width + m + k] -= _power(orbit, t, int64(orbit.active[k])) * x
    for k in range(orbit.totals.shape[0]):
        F[last + int64(orbit.totals[k, 0])] += orbit.totals[k, 1]


@njit(**INNER)
def _power(orbit, t, by):
    """Return a term's coefficient, differentiated by a parameter, or not for -1."""
    outlined()
    value = orbit.laws[t, 2]
    for j in range(orbit.laws.shape[1] - 3):
        power = int64(orbit.laws[t, 3 + j])
        if j == by:
            value *= power
            power -= 1
        for _ in range(power):
            value *= orbit.p[j]
    return value


@njit(**INNER)
def _sweep(system, piece, u, mesh, count, tolerances, y, errors):
    """Run a segment of the orbit `u` on its mesh, as `flow` does."""
    n, n_active, mode = system.n, system.n_active, piece.mode
    columns = n + n_active + (1 if piece.mean else 0)
    segment = Segment(system.functions, mode, piece.duration, system.p, n)
    sensitive = Sensitive(piece.transition, piece.mean, system.rooted[mode] != 0, system.active, n_active, columns)
    x0, rtol, atol = pointer(u, piece.row), tolerances[0], tolerances[1]
    if system.implicit[0] == 0:
        flow(segment, sensitive, x0, mesh, count, rtol, atol, y, errors)
    else:
        sizes = np.array((mode, n, piece.transition, int64(piece.mean), n_active, columns, int64(count)))
        laws = system.functions, system.p, pointer(sizes, 0), system.active
        invoke(system.implicit[0], (*laws, x0, piece.duration, mesh, rtol, atol, y, errors))
        keep(sizes)


@njit(**INNER)
def _landing(system, piece, start, end, work, F, entries):
    """Write the equations in which a segment's end, behind its reset, is the next one's start.

    end: what `flow` leaves. work: (5 n + 4 + n n,).
    """
    outlined()
    functions, p, n, n_active = system.functions, system.p, system.n, system.n_active
    transition, row, following, mean = piece.transition, piece.row, piece.following, piece.mean
    m = system.segments * (n + 1)
    columns = n + n_active + (1 if mean else 0)
    ends, f, gp, gx = work, pointer(work, n), pointer(work, 2 * n), pointer(work, 5 * n + 4)
    call(functions[FIELD], piece.mode, 0, end, 0, p, f, 0)
    lands = transition >= 0 and piece.kind != TOUCH_END
    if lands:
        call(functions[RESET], transition, 0, end, 0, p, ends, 0)
        call(functions[RESET_X], transition, 0, end, 0, p, gx, 0)
    else:
        for a in range(n):
            ends[a] = end[a]
            for b in range(n):
                gx[a * n + b] = 1.0 if a == b else 0.0
    at = row * (m + n_active)
    for a in range(n):
        line = pointer(entries, at + a * (m + n_active))
        F[row + a] = ends[a] - start[following + a]
        gradient = pointer(gx, a * n)
        _chain(line, row, m, n, n + n_active, columns, end, gradient, 1.0)
        total = 0.0
        for b in range(n):
            total += gradient[b] * (end[n + b * columns + columns - 1] if mean else f[b])
        line[row + n] += total
        line[following + a] -= 1.0
    if lands:
        for k in range(n_active):
            call(functions[RESET_P], transition, system.active[k], end, 0, p, gp, 0)
            for a in range(n):
                entries[at + a * (m + n_active) + m + k] += gp[a]


@njit(**INNER)
def _integrated(system, piece, end, line):
    """Return the mean rate of a segment's event function, which `flow` has integrated; write its row of the Jacobian."""
    n, n_active, row = system.n, system.n_active, piece.row
    m, columns = system.segments * (n + 1), n + n_active + 1
    rates = pointer(end, n * (1 + columns))
    for c in range(n + n_active):
        line[row + c if c < n else m + c - n] += rates[1 + c]
    line[row + n] += rates[columns]
    return rates[0]


@njit(**INNER)
def _met(system, piece, start, end, work, line):
    """Return a segment's event function at its end, or its mean rate; write its row of the Jacobian.

    The mean rate, where nothing cancels, is (h(end) - h(start)) / duration. work: (5 n + 4,).
    """
    outlined()
    functions, p, n, n_active = system.functions, system.p, system.n, system.n_active
    transition, row, duration = piece.transition, piece.row, piece.duration
    m, gp, ev = system.segments * (n + 1), pointer(work, 2 * n), pointer(work, 3 * n + 2)
    per = duration if piece.kind == MEAN_END else 1.0
    call(functions[EVENT_X], transition, 0, end, 0, p, ev, 0)
    height = ev[0]
    _chain(line, row, m, n, n + n_active, n + n_active, end, pointer(ev, 2), per)
    line[row + n] += ev[1] / per
    for k in range(n_active):
        call(functions[EVENT_P], transition, system.active[k], end, 0, p, gp, 0)
        line[m + k] += gp[0] / per
    if piece.kind == MEAN_END:
        call(functions[EVENT_X], transition, 0, start, row, p, ev, 0)
        height = (height - ev[0]) / duration
        line[row + n] -= height / duration
        for b in range(n):
            line[row + b] -= ev[2 + b] / duration
        for k in range(n_active):
            call(functions[EVENT_P], transition, system.active[k], start, row, p, gp, 0)
            line[m + k] -= gp[0] / duration
    return height


@njit(**INNER)
def _on_plane(anchor, start, n, line):
    """Return how far a state is from the plane of the phase condition; write its derivatives in `line`."""
    height = 0.0
    for a in range(n):
        height += anchor[n + a] * (start[a] - anchor[a])
        line[a] += anchor[n + a]
    return height


@kernel
def starting_flow(functions, modes, u, m, active, scales, p, slope):
    """Take the parameters as `set_parameters` does, and write the vector field where the first segment starts."""
    take_parameters(functions, u, m, active, scales, p)
    call(functions[FIELD], modes[0], 0, u, 0, p, slope, 0)


@kernel
def rate(orbit, mesh, segment, tolerances, u, gradient, errors):
    """Return the Lie derivative of a segment's event function at its end; its gradient, (m + active,), is written."""
    orbit, mesh = Orbit(*orbit), Mesh(*mesh)
    system, n, n_active, first = pointed(orbit), orbit.n, orbit.active.size, mesh.starts[segment]
    functions, p, m, columns = system.functions, system.p, system.segments * (n + 1), n + n_active
    # a total of 0: no mean rate is integrated
    piece = piece_at(system, segment, u, 0.0)
    mode, transition, row = piece.mode, piece.transition, piece.row
    y, block = np.empty(n * (1 + columns)), np.empty(4 * n + 4)
    end, line, count = pointer(y, 0), pointer(gradient, 0), mesh.starts[segment + 1] - first - 1
    places, errors = pointer(mesh.places, first), pointer(errors, first)
    _sweep(system, piece, pointer(u, 0), places, count, tolerances, end, errors)
    ev, f = pointer(block, 0), pointer(block, 2 * n + 2)
    call(functions[EVENT_X], transition, 0, end, 0, p, ev, 0)
    call(functions[FIELD], mode, 0, end, 0, p, f, 0)
    value = ev[1]
    _chain(line, row, m, n, columns, columns, end, pointer(ev, 2 + n), 1.0)
    for b in range(n):
        line[row + n] += ev[2 + n + b] * f[b]
    for k in range(n_active):
        call(functions[EVENT_P], transition, system.active[k], end, 0, p, f, 0)
        line[m + k] = (line[m + k] + f[1]) * orbit.scales[k]
    keep(y)
    keep(block)
    return value


@njit(**INNER)
def _chain(line, row, m, n, kept, columns, y, gradient, per):
    """Add to a row of the Jacobian the derivatives, over `per`, of a function with that gradient at a segment's end."""
    outlined()
    for c in range(kept):
        total = 0.0
        for b in range(n):
            total += gradient[b] * y[n + b * columns + c]
        line[row + c if c < n else m + c - n] += total / per


@kernel
def units(common, sizes, total, segments, block, scale):
    """Write typical sizes of the unknowns, and weights of a segment's start in the metric.

    common, sizes: of the states, (n,), shared and own; total: of all durations; block: (n + 1,); scale: (unknowns,).
    """
    n = sizes.size
    for a in range(n):
        block[a] = 1.0 / (common[a] * common[a])
    block[n] = 0.0
    for j in range(scale.size):
        scale[j] = 1.0
    for i in range(segments):
        for a in range(n):
            scale[i * (n + 1) + a] = sizes[a]
        scale[i * (n + 1) + n] = total


@kernel
def metric(u, segments, n, block, out):
    """Write the weights of the arclength: the trapezoidal rule over the period for each segment's start, 1 for parameters."""
    wide = n + 1
    total = 0.0
    for i in range(segments):
        total += abs(u[i * wide + n])
    for i in range(out.size):
        out[i] = 1.0
    for i in range(segments):
        share = 0.5 * (abs(u[i * wide + n]) + abs(u[(i * wide if i else segments * wide) - 1])) / total
        for a in range(wide):
            out[i * wide + a] = share * block[a]
