"""Compiled sensitivities of steps by exponential collocation: docs/theory/flow.md, "Fast oscillations"."""

from __future__ import annotations

from typing import NamedTuple

from saltus.flow.kernels.exponential_step import ROUNDING, STAGES, TAILS, C, alone, answered, next_degree, seen
from saltus.flow.kernels.lawson_step import EACH, HEAD
from saltus.flow.kernels.lawson_varied import largest
from saltus.flow.kernels.segment import FIELD_P, VARIED, VARY
from saltus.system.numba_tools.machine_code import njit
from saltus.system.numba_tools.pointers import INNER, apart, call, outlined, pointer


class Slopes(NamedTuple):
    """What a step's sensitivities are made of, on pointers.

    Attributes
    ----------
    gains, answer : pointer, (16,)
        The function's slopes at the nodes, and what w x there makes of a force.
    steepest : pointer, (1,)
        The largest size of the gains.
    phase, forced : pointer, (n, 16)
        The field's slope by the phase, and a parameter's force.
    more : pointer, (n,)
        The states' answers at the end to such a force.
    equations : pointer, (16, 16 + columns)
        Of w x at the nodes, the right sides behind the matrix.
    sums : pointer, (5, columns)
        Of each column, its last four coefficients and its size.
    """

    gains: object
    answer: object
    steepest: object
    phase: object
    forced: object
    more: object
    equations: object
    sums: object


@njit(**INNER)
def room_for_slopes(n, columns):
    """Return how many numbers the scratch of sensitivities takes."""
    return 2 * STAGES + 1 + 2 * STAGES * n + n + STAGES * (STAGES + columns) + 5 * columns


@njit(**INNER)
def slopes_in(block, n, columns):
    """Return the scratch in a block of `room_for_slopes(n, columns)` numbers."""
    phase = pointer(block, 2 * STAGES + 1)
    more = pointer(phase, 2 * STAGES * n)
    equations = pointer(more, n)
    return Slopes(
        block, pointer(block, STAGES), pointer(block, 2 * STAGES), phase, pointer(phase, STAGES * n), more, equations,
        pointer(equations, STAGES * (STAGES + columns)),
    )  # fmt: skip


@njit(**INNER)
def _gains(segment, linear, level, driven, slopes, start):
    """Write the function's slopes at the nodes, and the field's by the phase, which is `start[0]` and turns at `start[1]`."""
    outlined()
    n, own, row, column = segment.n, int(linear[0]), int(linear[1]), int(linear[2])
    given, out = driven.given, driven.out
    slopes.steepest[0] = 0.0
    alone(linear, n, 0.0, start[0], given)
    for e in range(n):
        given[n + 2 * e] = 1.0 if e == column else 0.0
        given[n + 2 * e + 1] = 1.0 if e >= own else 0.0
    for i in range(STAGES):
        given[column] = driven.heights[i]
        if own < n:
            given[n - 1] = start[0] + start[1] * C[i] * level.numbers[0]
        call(segment.functions[VARY], segment.mode, 2, given, 0, segment.p, out, 0)
        slopes.gains[i] = out[n + 2 * row]
        slopes.steepest[0] = max(slopes.steepest[0], abs(slopes.gains[i]))
        for e in range(n):
            slopes.phase[e * STAGES + i] = out[n + 2 * e + 1] if e < own else 0.0


@njit(**INNER)
def _sides(n, own, columns, level, before, equations):
    """Write the right sides that the states at the start make, behind the matrix."""
    apart()
    wide = STAGES + columns
    for i in range(STAGES):
        line = pointer(equations, i * wide + STAGES)
        for c in range(columns):
            line[c] = 0.0
        for e in range(own):
            look, given = level.looks[e * STAGES + i], pointer(before, e * columns)
            for c in range(columns):
                line[c] += look * given[c]


@njit(**INNER)
def _less(first, wide, factor, line, other):
    """Subtract a row times a factor from another, from the column `first` on."""
    apart()
    for c in range(first, wide):
        other[c] -= factor * line[c]


@njit(**INNER)
def _less_four(first, wide, one, two, three, four, other):
    """Subtract four rows, times the factors before the column `first`, from another, from this column on."""
    apart()
    a, b, d, f = other[first - 4], other[first - 3], other[first - 2], other[first - 1]
    for c in range(first, wide):
        other[c] -= (a * one[c] + b * two[c]) + (d * three[c] + f * four[c])


@njit(**INNER)
def _eliminated(columns, coupled, gains, equations):
    """Solve the equations of w x at the nodes, four at a time, whose solutions take the place of the right sides."""
    outlined()
    wide = STAGES + columns
    for i in range(STAGES):
        for k in range(STAGES):
            equations[i * wide + k] = (1.0 if i == k else 0.0) - coupled[k * STAGES + i] * gains[k]
    for q in range(0, STAGES, 4):
        for p in range(q, q + 4):
            line = pointer(equations, p * wide)
            pivot = 1.0 / line[p]
            for c in range(p + 1, wide):
                line[c] *= pivot
            for i in range(q, q + 4):
                if i != p:
                    other = pointer(equations, i * wide)
                    _less(p + 1, wide, other[p], line, other)
        one, two = pointer(equations, q * wide), pointer(equations, (q + 1) * wide)
        three, four = pointer(equations, (q + 2) * wide), pointer(equations, (q + 3) * wide)
        for i in range(STAGES):
            if i < q or i >= q + 4:
                _less_four(q + 4, wide, one, two, three, four, pointer(equations, i * wide))


@njit(**INNER)
def _carried(n, partners, columns, level, before, out):
    """Write the columns behind a step from those before it, as they are without forces."""
    apart()
    for e in range(n):
        line, own, across = pointer(out, e * columns), level.end[e], level.beyond[e]
        here, there = pointer(before, e * columns), pointer(before, partners[e] * columns)
        for c in range(columns):
            line[c] = own * here[c] + across * there[c]


@njit(**INNER)
def _pushed(n, columns, level, equations, out):
    """Add to the columns behind a step the answers to the function's forces, which are in the equations."""
    apart()
    wide = STAGES + columns
    for e in range(n):
        line = pointer(out, e * columns)
        for j in range(STAGES):
            push, force = level.pushed[e * STAGES + j], pointer(equations, j * wide + STAGES)
            for c in range(columns):
                line[c] += push * force[c]


@njit(**INNER)
def _forces(columns, gains, equations, sums):
    """Turn w x at the nodes into forces; return the largest coefficient of the next degree of any column."""
    outlined()
    apart()
    wide = STAGES + columns
    for c in range(5 * columns):
        sums[c] = 0.0
    for j in range(STAGES):
        line, gain = pointer(equations, j * wide + STAGES), gains[j]
        a, b = TAILS[j], TAILS[STAGES + j]
        d, f = TAILS[2 * STAGES + j], TAILS[3 * STAGES + j]
        for c in range(columns):
            value = gain * line[c]
            line[c] = value
            sums[c] += a * value
            sums[columns + c] += b * value
            sums[2 * columns + c] += d * value
            sums[3 * columns + c] += f * value
            sums[4 * columns + c] += abs(value)
    most = 0.0
    for c in range(columns):
        last = max(abs(sums[2 * columns + c]) + abs(sums[3 * columns + c]) - ROUNDING * sums[4 * columns + c], 0.0)
        most = max(most, last * min(last / (abs(sums[c]) + abs(sums[columns + c]) + 1e-300), 1.0))
    return most


@njit(**INNER)
def _roughness(n, forces):
    """Return the largest coefficient of the next degree of some forces, (n, 16)."""
    most = 0.0
    for e in range(n):
        most = max(most, next_degree(pointer(forces, e * STAGES)))
    return most


@njit(**INNER)
def _answers(n, level, partners, forces, slopes):
    """Write what forces, (n, 16), make of w x at the nodes and of the states at the end."""
    for i in range(STAGES):
        slopes.answer[i] = 0.0
    seen(n, level, forces, slopes.answer)
    answered(n, level, partners, forces, slopes.more)


@njit(**INNER)
def varied(segment, linear, sensitive, before, out, rtol, parts):
    """Write sensitivities (n, columns) behind a step, from those before it; return their error over VARIED rtol.

    parts: `Level`, `Driven` and `Slopes` of the step that is solved, the states at its nodes known; partners; phase at its
    start and the phase's rate.
    """
    outlined()
    level, driven, slopes, partners, start = parts
    n, own, columns, h = segment.n, int(linear[0]), sensitive.columns, level.numbers[0]
    wide, equations, forced = STAGES + columns, slopes.equations, slopes.forced
    answer, more = slopes.answer, slopes.more
    _gains(segment, linear, level, driven, slopes, start)
    _sides(n, own, columns, level, before, equations)
    _carried(n, partners, columns, level, before, out)
    rough = 0.0
    if own < n:
        phases = pointer(before, own * columns)
        _answers(n, level, partners, slopes.phase, slopes)
        for c in range(columns):
            for i in range(STAGES):
                equations[i * wide + STAGES + c] += answer[i] * phases[c]
            for e in range(n):
                out[e * columns + c] += more[e] * phases[c]
        rough = h * largest(phases, columns) * _roughness(own, slopes.phase)
    force = driven.out
    for k in range(sensitive.n_active):
        for i in range(STAGES):
            for e in range(n):
                driven.given[e] = driven.states[e * STAGES + i]
            call(segment.functions[FIELD_P], segment.mode, sensitive.active[k], driven.given, 0, segment.p, force, 0)
            turned = C[i] * h * force[own] if own < n else 0.0
            for e in range(n):
                forced[e * STAGES + i] = force[e] + turned * slopes.phase[e * STAGES + i]
        _answers(n, level, partners, forced, slopes)
        for i in range(STAGES):
            equations[i * wide + STAGES + n + k] += answer[i]
        for e in range(n):
            out[e * columns + n + k] += more[e]
        rough = max(rough, h * _roughness(own, forced))
    _eliminated(columns, level.coupled, slopes.gains, equations)
    missed = _forces(columns, slopes.gains, equations, slopes.sums)
    _pushed(n, columns, level, equations, out)
    follows, follow = 0.0, slopes.steepest[0] * level.numbers[1] * h
    for e in range(own):
        follows = max(follows, level.gains[e] + follow * abs(linear[HEAD + EACH * e + 3]))
    rough = max(rough, missed * follows)
    return rough / (VARIED * rtol * largest(out, n * columns) + 1e-300) if rtol > 0.0 else 0.0
