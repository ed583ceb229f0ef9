"""Compiled steps by collocation of what drives a linear part (`saltus.flow.exponential`).

The field is A x + u F(w x, phase) + d(phase) with constants A, u and w. The function F at the nodes is all that is
sought: docs/theory/flow.md. It is looked at where one state alone makes up w x.

Arrays of values at the nodes have the node as the last index.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from saltus.flow import exponential
from saltus.flow.kernels.lawson_step import EACH, HEAD, ONE, PROBES, STALLED, SWEEPS, probes
from saltus.flow.kernels.segment import FIELD, VARY
from saltus.system.numba_tools.machine_code import njit
from saltus.system.numba_tools.pointers import INNER, apart, call, outlined, pointer

STAGES = exponential.STAGES
SQUARE = STAGES * STAGES
C = exponential.NODES
TAILS = exponential.TAILS.ravel()
ENOUGH = 1e-15  # change of w x in the next sweep, over its size, that is none
ROUNDING = 1e-16  # of a coefficient, over the sum of the values' sizes


class Level(NamedTuple):
    """What steps of one length make of states and forces, on pointers; matrices (n, 16, 16) have the force's node first.

    Attributes
    ----------
    numbers : pointer, (3,)
        The length, and the largest answer of w x to a force that is Legendre's polynomial of degree 16 or 17. The last
        number is 16.
    gains : pointer, (n,)
        The states' answers at the end to such a force.
    own, other : pointer, (n, 16)
        Of each row of exp(A t) at the nodes the entry on the diagonal and the partner's.
    end, beyond : pointer, (n,)
        The same at the end.
    looks : pointer, (n, 16)
        How w x at the nodes depends on the states at the start.
    pushed : pointer, (n, 16)
        The states' answers at the end to F at the nodes.
    closing, crossing : pointer, (n, 16)
        The same to forces on each state, and on its partner.
    coupled : pointer, (16, 16)
        Answers of w x at the nodes to F.
    within, beside : pointer, (n, 16, 16)
        Answers of each state at the nodes to forces on it, and on its partner.
    seen : pointer, (n, 16, 16)
        Answers of w x at the nodes to forces on each state.
    """

    numbers: object
    gains: object
    own: object
    other: object
    end: object
    beyond: object
    looks: object
    pushed: object
    closing: object
    crossing: object
    coupled: object
    within: object
    beside: object
    seen: object


class Driven(NamedTuple):
    """Values of a step at its nodes, and scratch, on pointers.

    Attributes
    ----------
    rest, states : pointer, (n, 16)
        The forces u F + d, and the states.
    heights, force, free, change : pointer, (16,)
        The function's argument w x, the function F, and w x without it.
    given, out : pointer, (4 n + 36,)
        Arguments and values of the generated functions.
    """

    rest: object
    states: object
    heights: object
    force: object
    free: object
    change: object
    given: object
    out: object


@njit(**INNER)
def size_of(n):
    """Return how many numbers there are for each length."""
    return 3 + 3 * n + 6 * STAGES * n + SQUARE + 3 * SQUARE * n


@njit(**INNER)
def level_at(table, n):
    """Return the tables of one length on pointers."""
    rows = STAGES * n
    own = pointer(table, 3 + n)
    end = pointer(own, 2 * rows)
    looks = pointer(end, 2 * n)
    coupled = pointer(looks, 4 * rows)
    within = pointer(coupled, SQUARE)
    return Level(
        table, pointer(table, 3), own, pointer(own, rows), end, pointer(end, n), looks, pointer(looks, rows),
        pointer(looks, 2 * rows), pointer(looks, 3 * rows), coupled, within, pointer(within, SQUARE * n),
        pointer(within, 2 * SQUARE * n),
    )  # fmt: skip


@njit(**INNER)
def room_for_driven(n):
    """Return how many numbers the scratch of a step takes."""
    return 2 * STAGES * n + 4 * STAGES + 2 * (4 * n + 36)


@njit(**INNER)
def driven_in(block, n):
    """Return the scratch in a block of `room_for_driven(n)` numbers."""
    heights = pointer(block, 2 * STAGES * n)
    given = pointer(heights, 4 * STAGES)
    return Driven(
        block, pointer(block, STAGES * n), heights, pointer(heights, STAGES), pointer(heights, 2 * STAGES),
        pointer(heights, 3 * STAGES), given, pointer(given, 4 * n + 36),
    )  # fmt: skip


@njit(**INNER)
def _times(count, matrix, values, out):
    """Add a matrix (16, 16), its transpose given, times values, (16,); count: 16, which the compiler is not to know.

    Loops of a known length would be unrolled, not done in vector instructions.
    """
    outlined()
    apart()
    for j in range(0, STAGES, 8):
        rows = pointer(matrix, j * STAGES)
        a, b, c, d = values[j], values[j + 1], values[j + 2], values[j + 3]
        f, g, k, m = values[j + 4], values[j + 5], values[j + 6], values[j + 7]
        for i in range(count):
            first = rows[i] * a + rows[STAGES + i] * b + rows[2 * STAGES + i] * c + rows[3 * STAGES + i] * d
            other = pointer(rows, 4 * STAGES)
            last = other[i] * f + other[STAGES + i] * g + other[2 * STAGES + i] * k + other[3 * STAGES + i] * m
            out[i] += first + last


@njit(**INNER)
def empty(values):
    """Whether all values at the nodes are 0."""
    for i in range(STAGES):
        if values[i] != 0.0:
            return False
    return True


@njit(**INNER)
def seen(n, level, forces, out):
    """Add the answers of w x at the nodes to forces, (n, 16)."""
    outlined()
    for e in range(n):
        values = pointer(forces, e * STAGES)
        if not empty(values):
            _times(int(level.numbers[2]), pointer(level.seen, e * SQUARE), values, out)


@njit(**INNER)
def _states(n, level, partners, x, forces, states):
    """Write the states at the nodes, (n, 16), from those at the start and the forces, (n, 16)."""
    outlined()
    count = int(level.numbers[2])
    for e in range(n):
        line, own, across = pointer(states, e * STAGES), x[e], x[partners[e]]
        for i in range(STAGES):
            line[i] = level.own[e * STAGES + i] * own + level.other[e * STAGES + i] * across
    for e in range(n):
        values, partner = pointer(forces, e * STAGES), partners[e]
        if not empty(values):
            _times(count, pointer(level.within, e * SQUARE), values, pointer(states, e * STAGES))
            if partner != e:
                line = pointer(states, partner * STAGES)
                _times(count, pointer(level.beside, partner * SQUARE), values, line)


@njit(**INNER)
def answered(n, level, partners, forces, out):
    """Write the states' answers at the end, (n,), to forces, (n, 16)."""
    outlined()
    for e in range(n):
        total, values, across = 0.0, pointer(forces, e * STAGES), pointer(forces, partners[e] * STAGES)
        closing, crossing = pointer(level.closing, e * STAGES), pointer(level.crossing, e * STAGES)
        for j in range(STAGES):
            total += closing[j] * values[j] + crossing[j] * across[j]
        out[e] = total


@njit(**INNER)
def alone(linear, n, height, phase, given):
    """Write the state in which one component alone makes up w x, at a phase, in `given`, (n,)."""
    for e in range(n):
        given[e] = 0.0
    given[int(linear[2])] = height
    if int(linear[0]) < n:
        given[n - 1] = phase


@njit(**INNER)
def solved(segment, linear, level, partners, x, driven, x_end):
    """Solve the equations of a step from `x`, (n,); return the sweeps, 0 where it is not solved."""
    outlined()
    n, own, row, column = segment.n, int(linear[0]), int(linear[1]), int(linear[2])
    rest, heights, force, free, change = driven.rest, driven.heights, driven.force, driven.free, driven.change
    given, out, h = driven.given, driven.out, level.numbers[0]
    function, mode, p = segment.functions[FIELD], segment.mode, segment.p
    call(function, mode, 0, x, 0, p, out, 0)
    phase, rate = x[n - 1], out[n - 1] if own < n else 0.0
    law = pointer(linear, HEAD + EACH * row)
    before = out[row] - law[1] * x[row] - (law[2] * x[partners[row]] if partners[row] != row else 0.0)
    for i in range(STAGES):
        free[i], force[i] = 0.0, before
    for e in range(own):
        value = x[e]
        for i in range(STAGES):
            free[i] += level.looks[e * STAGES + i] * value
    for i in range(STAGES):
        heights[i] = free[i]
    _times(int(level.numbers[2]), level.coupled, force, heights)
    law = pointer(linear, HEAD + EACH * column)
    partner, diagonal = partners[column], law[1]
    to = linear[HEAD + EACH * partner + 2] if partner != column else 0.0
    alone(linear, n, 0.0, phase, given)
    for i in range(STAGES):
        height = heights[i]
        given[column] = height
        if own < n:
            given[n - 1] = phase + rate * C[i] * h
        call(function, mode, 0, given, 0, p, out, 0)
        out[column] -= diagonal * height
        if partner != column:
            out[partner] -= to * height
        force[i] = out[row]
        for e in range(n):
            rest[e * STAGES + i] = out[e] - linear[HEAD + EACH * e + 3] * out[row]
    seen(n, level, rest, free)
    before, size = math.inf, 0.0
    for sweep in range(1, SWEEPS + 1):
        for i in range(STAGES):
            change[i] = free[i]
        _times(int(level.numbers[2]), level.coupled, force, change)
        moved = 0.0
        for i in range(STAGES):
            moved = max(moved, abs(change[i] - heights[i]))
            size = max(size, abs(change[i]))
            if not abs(change[i]) < 1e300:
                return 0
            heights[i] = change[i]
            given[column] = heights[i]
            if own < n:
                given[n - 1] = phase + rate * C[i] * h
            call(function, mode, 0, given, 0, p, out, 0)
            force[i] = out[row]
        shrinks = min(moved / before, 1.0) if sweep > 1 else 1.0
        if moved * shrinks <= ENOUGH * size or (moved <= STALLED * size and moved > 0.3 * before):
            for e in range(n):
                push = linear[HEAD + EACH * e + 3]
                for i in range(STAGES):
                    rest[e * STAGES + i] += push * force[i]
            answered(n, level, partners, rest, x_end)
            for e in range(n):
                x_end[e] += level.end[e] * x[e] + level.beyond[e] * x[partners[e]]
                if not abs(x_end[e]) < 1e300:
                    return 0
            return sweep
        before = moved
    return 0


@njit(**INNER)
def followed_states(n, level, partners, x, driven):
    """Write the states at the nodes of a step that is solved."""
    _states(n, level, partners, x, driven.rest, driven.states)


@njit(**INNER)
def one_function(segment, linear, partners, x, driven):
    """Whether field and slopes at a state are those where one component alone makes up w x, but for the linear part."""
    outlined()
    n, own, row = segment.n, int(linear[0]), int(linear[1])
    given, out, mode, p = driven.given, driven.out, segment.mode, segment.p
    height, probed = 0.0, probes(linear, n, given)
    for e in range(own):
        height += linear[HEAD + EACH * e + 4] * x[e]
    states = driven.states  # behind the step: scratch
    here, there = states, pointer(states, 4 * n)
    for way in range(2):
        if way == 0:
            for e in range(n):
                given[e] = x[e]
        else:
            alone(linear, n, height, x[n - 1], given)
        call(segment.functions[VARY], mode, PROBES, given, 0, p, out, 0)
        values = here if way == 0 else there
        for e in range(4 * n):
            values[e] = out[e]
        for e in range(n):
            law, partner = pointer(linear, HEAD + EACH * e), partners[e]
            values[e] -= law[1] * given[e] + (law[2] * given[partner] if partner != e else 0.0)
    size = steep = left = bent = 0.0
    gain = here[n + PROBES * row]
    for e in range(n):
        law, partner = pointer(linear, HEAD + EACH * e), partners[e]
        line = law[1] * given[n + PROBES * e + 1]
        size = max(size, abs(law[1] * x[e]) + abs(there[e]))
        if partner != e:
            line += law[2] * given[n + PROBES * partner + 1]
            size = max(size, abs(law[2] * x[partner]))
        left = max(left, abs(here[e] - there[e]))
        slope = here[n + PROBES * e + 1]
        steep = max(steep, max(abs(slope) + abs(line), abs(here[n + PROBES * e + 2])))
        bent = max(bent, max(abs(slope - line - gain * law[3] * probed),
                             abs(here[n + PROBES * e + 2] - there[n + PROBES * e + 2])))  # fmt: skip
    bent = max(bent, abs(gain - there[n + PROBES * row]))
    return left <= ONE * size and bent <= ONE * steep


@njit(**INNER)
def next_degree(values):
    """Return the coefficient of Legendre's polynomial of the next degree, if they go on to shrink as the last four do."""
    a = b = c = d = sizes = 0.0
    for j in range(STAGES):
        value = values[j]
        a += TAILS[j] * value
        b += TAILS[STAGES + j] * value
        c += TAILS[2 * STAGES + j] * value
        d += TAILS[3 * STAGES + j] * value
        sizes += abs(value)
    last = max(abs(c) + abs(d) - ROUNDING * sizes, 0.0)
    return last * min(last / (abs(a) + abs(b) + 1e-300), 1.0)


@njit(**INNER)
def off(segment, linear, level, driven, x, x_end, steep, tolerances):
    """Return the error of a step's state over its tolerance; steep: the largest slope of F."""
    outlined()
    rtol, atol = tolerances
    h, worst = level.numbers[0], 0.0
    missed = next_degree(driven.force)
    follows = missed * steep * level.numbers[1] * h
    for e in range(segment.n):
        push, own = linear[HEAD + EACH * e + 3], 0.0
        if not empty(pointer(driven.rest, e * STAGES)):
            for j in range(STAGES):
                driven.change[j] = driven.rest[e * STAGES + j] - push * driven.force[j]
            own = h * next_degree(driven.change)
        error = missed * level.gains[e] + follows * abs(push) + own
        worst = max(worst, error / (atol + rtol * max(abs(x[e]), abs(x_end[e]))))
    return worst
