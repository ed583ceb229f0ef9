"""Compiled second derivatives of a periodic orbit's equations along a direction: docs/theory/loci.md."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import int64

from saltus.flow.kernels.second import Bent, along, flow_second
from saltus.flow.kernels.segment import EVENT_P, EVENT_X, FIELD_P, VARY, Segment, Sensitive
from saltus.orbits.kernels.equation import RESET_X, piece_at, pointed, total_duration
from saltus.orbits.records import Mesh, Orbit
from saltus.orbits.signature import EVENT_END, MEAN_END, TOUCH_END
from saltus.system.compiled import SECOND
from saltus.system.numba_tools.machine_code import njit
from saltus.system.numba_tools.pointers import INNER, call, invoke, keep, outlined, pointer

DERIVE = SECOND.index("derive")
EVENT_2 = SECOND.index("event_2")
RESET_2 = SECOND.index("reset_2")


class Room(NamedTuple):
    """Scratch for one segment, on pointers.

    Attributes
    ----------
    end : pointer to float64
        What `flow_second` leaves.
    point : pointer to float64, (2 n + active,)
        A state, its variation, and what the parameters change by.
    event : pointer to float64, (2 n + 2,)
        An event function's value, rate and gradients.
    derivative : pointer to float64, (n + 2,)
        A derivative by a parameter.
    reset : pointer to float64, (n n,)
        The reset's derivative.
    turn : pointer to float64, (2 n,)
        The field at the segment's end, and the slope of the variation.
    bend : pointer to float64, ((n + 2) (n + active),)
        Second derivatives along the direction.
    first : pointer to float64, (n + active + 1,)
        First derivatives of the change of an event function.
    """

    end: object
    point: object
    event: object
    derivative: object
    reset: object
    turn: object
    bend: object
    first: object


@njit(cache=True, error_model="numpy")
def second(orbit, mesh, functions, implicit, n_parameters, p, u, v, S):
    """Write S = d(J v)/d(u, active), (m, m + active), J being the Jacobian that `equations` writes.

    u, v: (m + active,). orbit, mesh: the fields of those records, the parameters those at `u`. functions: addresses of the
    generated functions of second derivatives; implicit: address of `saltus.flow.kernels.implicit_second.flow_second` where
    steps are implicit, else 0; p: room for the parameters with their constants.
    """
    orbit, mesh = Orbit(*orbit), Mesh(*mesh)
    for i in range(n_parameters):
        p[i] = orbit.p[i]
    call(functions[DERIVE], 0, 0, p, 0, p, p, 0)
    system, n, n_active = pointed(orbit), orbit.n, orbit.active.size
    m, kept, segments = system.segments * (n + 1), n + n_active, system.segments
    width = m + n_active
    y = np.empty(n * (1 + 2 * kept) + 2 * (kept + 2))
    direction = np.empty(n + 1 + n_active)
    block = np.empty(n * n + 10 * n + 6 + 2 * n_active + (n + 2) * kept + 2 * (kept + 1))
    room = _laid_out(pointer(y, 0), pointer(block, 0), n, n_active)
    bent = Bent(pointer(functions, 0), pointer(p, 0), pointer(direction, 0))
    entries, start, starts = pointer(S, 0), pointer(u, 0), pointer(mesh.starts, 0)
    total = total_duration(start, segments, n)
    for i in range(m * width):
        entries[i] = 0.0
    for a in range(n_active):
        direction[n + 1 + a] = v[m + a] * orbit.scales[a]
        room.point[2 * n + a] = direction[n + 1 + a]
    for i in range(segments):
        piece, first, count = piece_at(system, i, start, total), starts[i], starts[i + 1] - starts[i] - 1
        row, kind = piece.row, piece.kind
        for e in range(n + 1):
            direction[e] = v[row + e]
        segment = Segment(system.functions, piece.mode, piece.duration, system.p, n)
        sensitive = Sensitive(piece.transition, piece.mean, False, system.active, n_active, 2 * kept)
        x0, places = pointer(start, row), pointer(mesh.places, first)
        if implicit == 0:
            flow_second(segment, sensitive, bent, x0, places, count, room.end)
        else:
            sizes = np.array((piece.mode, n, piece.transition, int64(piece.mean), n_active, 2 * kept, int64(count)))
            laws = system.functions, system.p, pointer(sizes, 0), system.active
            invoke(implicit, (*laws, bent.functions, bent.p, bent.direction, x0, piece.duration, places, room.end))
            keep(sizes)
        _turned(segment, sensitive, bent, room)
        _landing(system, piece, bent, room, entries)
        line = pointer(entries, (row + n) * width)
        if piece.mean:
            rates = pointer(room.end, n * (1 + 2 * kept) + kept + 2)
            for c in range(kept):
                line[row + c if c < n else m + c - n] += rates[1 + c]
            line[row + n] += rates[1 + kept]
        elif kind == EVENT_END or kind == MEAN_END or kind == TOUCH_END:
            call(system.functions[EVENT_X], piece.transition, 0, room.end, 0, system.p, room.event, 0)
            call(bent.functions[EVENT_2], piece.transition, 0, room.point, 0, bent.p, room.bend, 0)
            per = piece.duration if kind == MEAN_END else 1.0
            _ending(system, row, room, line, pointer(room.event, 2), room.bend, per)
            if kind == MEAN_END:
                _quotient(system, piece, bent, room, start, line)
    for a in range(n_active):
        for i in range(m):
            entries[i * width + m + a] *= orbit.scales[a]
    keep(y)
    keep(direction)
    keep(block)


@njit(**INNER)
def _laid_out(y, block, n, n_active):
    """Return the scratch of one segment, laid out in a block."""
    kept, event, derivative = n + n_active, pointer(block, 2 * n + n_active), pointer(block, 4 * n + 2 + n_active)
    reset, turn = pointer(derivative, n + 2), pointer(derivative, n + 2 + n * n)
    bend = pointer(turn, 2 * n)
    return Room(y, block, event, derivative, reset, turn, bend, pointer(bend, (n + 2) * kept))


@njit(**INNER)
def _turned(segment, sensitive, bent, room):
    """Write the state at a segment's end with its variation, the field there, and the slope of the variation."""
    functions, mode, _, p, n = segment
    end, point, turn, v, n_active = room.end, room.point, room.turn, bent.direction, sensitive.n_active
    call(functions[VARY], mode, 0, end, 0, p, turn, 0)
    for e in range(n):
        point[e] = end[e]
        point[n + e] = turn[e] * v[n] + along(pointer(end, n + e * sensitive.columns), v, n, n_active)
    call(functions[VARY], mode, 1, point, 0, p, turn, 0)
    for a in range(n_active):
        call(functions[FIELD_P], mode, sensitive.active[a], end, 0, p, room.derivative, 0)
        for e in range(n):
            turn[n + e] += room.derivative[e] * v[n + 1 + a]


@njit(**INNER)
def _landing(system, piece, bent, room, entries):
    """Write the rows of S that belong to the equations in which a segment's end is the next one's start."""
    outlined()
    n, transition, gx, bend = system.n, piece.transition, room.reset, room.bend
    kept, width = n + system.n_active, system.segments * (n + 1) + system.n_active
    if transition >= 0 and piece.kind != TOUCH_END:
        call(system.functions[RESET_X], transition, 0, room.end, 0, system.p, gx, 0)
        call(bent.functions[RESET_2], transition, 0, room.point, 0, bent.p, bend, 0)
    else:
        for e in range(n * kept):
            bend[e] = 0.0
        for a in range(n):
            for b in range(n):
                gx[a * n + b] = 1.0 if a == b else 0.0
    for a in range(n):
        line = pointer(entries, (piece.row + a) * width)
        _ending(system, piece.row, room, line, pointer(gx, a * n), pointer(bend, a * kept), 1.0)


@njit(**INNER)
def _quotient(system, piece, bent, room, start, line):
    """Add what a mean rate, (h(end) - h(start)) / duration, has beyond the derivatives at its end."""
    outlined()
    functions, p, n, n_active = system.functions, system.p, system.n, system.n_active
    transition, row, duration, v = piece.transition, piece.row, piece.duration, bent.direction
    m, kept, longer, columns = system.segments * (n + 1), n + n_active, bent.direction[n], 2 * (n + n_active)
    end, point, ev, gp = room.end, room.point, room.event, room.derivative
    bend, first, wanted = room.bend, room.first, system.active
    height, change = ev[0], 0.0
    for c in range(kept + 1):
        first[c] = 0.0
    for e in range(n):
        change += ev[2 + e] * point[n + e]
        first[kept] += ev[2 + e] * room.turn[e]
        for c in range(kept):
            first[c] += ev[2 + e] * end[n + e * columns + c]
    for a in range(n_active):
        call(functions[EVENT_P], transition, wanted[a], end, 0, p, gp, 0)
        first[n + a] += gp[0]
        change += gp[0] * v[n + 1 + a]
    for e in range(n):
        point[e] = start[row + e]
        point[n + e] = v[e]
    call(functions[EVENT_X], transition, 0, point, 0, p, ev, 0)
    call(bent.functions[EVENT_2], transition, 0, point, 0, bent.p, bend, 0)
    height -= ev[0]
    for e in range(n):
        change -= ev[2 + e] * v[e]
        first[e] -= ev[2 + e]
    for a in range(n_active):
        call(functions[EVENT_P], transition, wanted[a], point, 0, p, gp, 0)
        first[n + a] -= gp[0]
        change -= gp[0] * v[n + 1 + a]
    for c in range(kept):
        at = row + c if c < n else m + c - n
        line[at] -= bend[c] / duration + first[c] * longer / duration**2
    line[row + n] -= (first[kept] * longer + change) / duration**2 - 2.0 * height * longer / duration**3


@njit(**INNER)
def _ending(system, row, room, line, gradient, bend, per):
    """Add to a row of S the second derivative, over `per`, of a function at a segment's end, once along the direction.

    gradient: (n,), that of the function; bend: (n + active,), its second derivative along the direction.
    """
    n, kept, end, turn = system.n, system.n + system.n_active, room.end, room.turn
    columns, m = 2 * kept, system.segments * (n + 1)
    for c in range(kept):
        total = bend[c] if c >= n else 0.0
        for b in range(n):
            total += gradient[b] * end[n + b * columns + kept + c] + bend[b] * end[n + b * columns + c]
        line[row + c if c < n else m + c - n] += total / per
    total = 0.0
    for b in range(n):
        total += gradient[b] * turn[n + b] + bend[b] * turn[b]
    line[row + n] += total / per
