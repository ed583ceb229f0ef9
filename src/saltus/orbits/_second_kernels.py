"""Compiled second derivatives of a periodic orbit's equations along a direction."""

from __future__ import annotations

import numpy as np

from saltus.flow._kernels import INNER, call, keep, pointer
from saltus.flow._second_kernels import FIELD_P, VARY, along, flow_second
from saltus.orbits._kernels import EVENT_P, EVENT_X, RESET_X, SHORT
from saltus.orbits.signature import EVENT_END, MEAN_END, TOUCH_END
from saltus.system.compiled import SECOND
from saltus.system.machine_code import njit

DERIVE, EVENT_2, RESET_2 = (SECOND.index(name) for name in ("derive", "event_2", "reset_2"))


@njit(cache=True, error_model="numpy")
def second(
    functions, functions_2, modes, transitions, kinds, n, u, p, n_parameters, p2, active, scales, mesh, mesh_at, v, S
):  # fmt: skip
    """Write S = d(J v)/d(u, active), (m, m + active), J being the Jacobian that `equations` writes.

    u, v: (m + active,). p: parameters with the constants of `functions` behind them, at `u`; p2: room for them with those
    of `functions_2`. The meshes are those of the orbit.
    """
    for i in range(n_parameters):
        p2[i] = p[i]
    call(functions_2[DERIVE], 0, 0, p2, 0, p2, p2, 0)
    segments, wide, n_active = modes.size, n + 1, active.size
    m, kept = segments * wide, n + n_active
    width, columns = m + n_active, 2 * kept
    total_time = 0.0
    for i in range(segments):
        total_time += abs(u[i * wide + n])
    y = np.empty(n * (1 + columns) + 2 * (kept + 2))
    direction = np.empty(n + 1 + n_active)
    block = np.empty(n * n + 10 * n + 6 + 2 * n_active + (n + 2) * kept + 2 * (kept + 1))
    point, ev, gp = pointer(block, 0), pointer(block, 2 * n + n_active), pointer(block, 4 * n + 2 + n_active)
    gx, turn = pointer(gp, n + 2), pointer(gp, n + 2 + n * n)
    bend = pointer(turn, 2 * n)
    first = pointer(bend, (n + 2) * kept)
    entries, end, start, wanted = pointer(S, 0), pointer(y, 0), pointer(u, 0), pointer(active, 0)
    for i in range(m * width):
        entries[i] = 0.0
    for a in range(n_active):
        direction[n + 1 + a] = v[m + a] * scales[a]
        point[2 * n + a] = direction[n + 1 + a]
    for i in range(segments):
        row = i * wide
        kind, mode, transition, duration = kinds[i], modes[i], transitions[i], start[row + n]
        mean = kind == MEAN_END and abs(duration) < SHORT * total_time
        count = mesh_at[i + 1] - mesh_at[i] - 1
        for e in range(wide):
            direction[e] = v[row + e]
        flow_second(
            functions, functions_2, mode, transition, mean, pointer(u, row), duration, p, p2, active, direction, mesh,
            mesh_at[i], count, n, y,
        )  # fmt: skip
        longer = direction[n]
        call(functions[VARY], mode, 0, end, 0, p, turn, 0)
        for e in range(n):
            point[e] = end[e]
            point[n + e] = turn[e] * longer + along(pointer(end, n + e * columns), pointer(direction, 0), n, n_active)
        call(functions[VARY], mode, 1, point, 0, p, turn, 0)
        for a in range(n_active):
            call(functions[FIELD_P], mode, wanted[a], end, 0, p, gp, 0)
            for e in range(n):
                turn[n + e] += gp[e] * direction[n + 1 + a]
        if transition >= 0 and kind != TOUCH_END:
            call(functions[RESET_X], transition, 0, end, 0, p, gx, 0)
            call(functions_2[RESET_2], transition, 0, point, 0, p2, bend, 0)
        else:
            for e in range(n * kept):
                bend[e] = 0.0
            for a in range(n):
                for b in range(n):
                    gx[a * n + b] = 1.0 if a == b else 0.0
        for a in range(n):
            _ending(pointer(entries, (row + a) * width), row, m, n, kept, end, turn, pointer(gx, a * n),
                    pointer(bend, a * kept), 1.0)  # fmt: skip
        line = pointer(entries, (row + n) * width)
        if mean:
            rates = pointer(end, n * (1 + columns) + kept + 2)
            for c in range(kept):
                line[row + c if c < n else m + c - n] += rates[1 + c]
            line[row + n] += rates[1 + kept]
        elif kind == EVENT_END or kind == MEAN_END or kind == TOUCH_END:
            call(functions[EVENT_X], transition, 0, end, 0, p, ev, 0)
            call(functions_2[EVENT_2], transition, 0, point, 0, p2, bend, 0)
            per = duration if kind == MEAN_END else 1.0
            _ending(line, row, m, n, kept, end, turn, pointer(ev, 2), bend, per)
            if kind == MEAN_END:
                # the quotient (h(end) - h(start)) / duration
                height, change = ev[0], 0.0
                for c in range(kept + 1):
                    first[c] = 0.0
                for e in range(n):
                    change += ev[2 + e] * point[n + e]
                    first[kept] += ev[2 + e] * turn[e]
                    for c in range(kept):
                        first[c] += ev[2 + e] * end[n + e * columns + c]
                for a in range(n_active):
                    call(functions[EVENT_P], transition, wanted[a], end, 0, p, gp, 0)
                    first[n + a] += gp[0]
                    change += gp[0] * direction[n + 1 + a]
                for e in range(n):
                    point[e] = start[row + e]
                    point[n + e] = direction[e]
                call(functions[EVENT_X], transition, 0, point, 0, p, ev, 0)
                call(functions_2[EVENT_2], transition, 0, point, 0, p2, bend, 0)
                height -= ev[0]
                for e in range(n):
                    change -= ev[2 + e] * direction[e]
                    first[e] -= ev[2 + e]
                for a in range(n_active):
                    call(functions[EVENT_P], transition, wanted[a], point, 0, p, gp, 0)
                    first[n + a] -= gp[0]
                    change -= gp[0] * direction[n + 1 + a]
                for c in range(kept):
                    at = row + c if c < n else m + c - n
                    line[at] -= bend[c] / duration + first[c] * longer / duration**2
                line[row + n] -= (first[kept] * longer + change) / duration**2 - 2.0 * height * longer / duration**3
    for a in range(n_active):
        for i in range(m):
            entries[i * width + m + a] *= scales[a]
    keep(y)
    keep(direction)
    keep(block)


@njit(**INNER)
def _ending(line, row, m, n, kept, end, turn, gradient, bend, per):
    """Add to a row of S the second derivative, over `per`, of a function at a segment's end, once along the direction.

    gradient: (n,), that of the function; bend: (kept,), its second derivative along the direction; turn: the field and the
    slope of the variation, (2 n,).
    """
    columns = 2 * kept
    for c in range(kept):
        total = bend[c] if c >= n else 0.0
        for b in range(n):
            total += gradient[b] * end[n + b * columns + kept + c] + bend[b] * end[n + b * columns + c]
        line[row + c if c < n else m + c - n] += total / per
    total = 0.0
    for b in range(n):
        total += gradient[b] * turn[n + b] + bend[b] * turn[b]
    line[row + n] += total / per
