"""Compiled sensitivities of steps in the frame of a linear part of the field: docs/theory/flow.md, "Fast oscillations"."""

from __future__ import annotations

from saltus.flow.kernels.lawson_step import (
    EACH,
    HEAD,
    ONE,
    PROBES,
    STAGES,
    A,
    B,
    framed,
    integrated,
    probes,
    tail,
    whole,
)
from saltus.flow.kernels.segment import FIELD_P, VARIED, VARY
from saltus.system.numba_tools.machine_code import njit
from saltus.system.numba_tools.pointers import INNER, apart, call, outlined, pointer


@njit(**INNER)
def linearised(segment, linear, frame, stages, varied):
    """Write how the rest's function moves the states and depends on them at each node; whether there is but one."""
    outlined()
    n, own, row, given, out = segment.n, int(linear[0]), int(linear[1]), stages.frame, stages.out
    seen = probes(linear, n, given)
    for i in range(STAGES):
        for e in range(n):
            given[e] = stages.points[i * n + e]
        call(segment.functions[VARY], segment.mode, PROBES, given, 0, segment.p, out, 0)
        gain = out[n + PROBES * row]
        size = left = 0.0
        for e in range(n):
            law, partner = pointer(linear, HEAD + EACH * e), frame.partners[e]
            slope = out[n + PROBES * e + 1]
            line = law[1] * given[n + PROBES * e + 1]
            if partner != e:
                line += law[2] * given[n + PROBES * partner + 1]
            size = max(size, abs(slope) + abs(line))
            left = max(left, abs(slope - line - gain * law[3] * seen))
            stages.rest[e * STAGES + i] = frame.rates[i] * gain * law[3]
            stages.sums[e * STAGES + i] = law[4]
            varied.slopes[e * STAGES + i] = out[n + PROBES * e + 2] if e < own else 0.0
        if not left <= ONE * size:
            return False
    framed(n, frame.partners, frame.back, frame.across, stages.rest, varied.pushes)
    for e in range(n):
        at, over = e * STAGES, frame.partners[e] * STAGES
        for i in range(STAGES):
            look = stages.sums[at + i] * frame.own[at + i]
            if over != at:
                look += stages.sums[over + i] * frame.other[over + i]
            varied.looks[at + i] = look
    return True


@njit(**INNER)
def _inverted(n, pushes, looks, matrix, inverse):
    """Write the inverse of the matrix of the function's values at the nodes, (8, 8), by elimination."""
    outlined()
    apart()
    for i in range(STAGES * STAGES):
        matrix[i] = 0.0
        inverse[i] = 1.0 if i % (STAGES + 1) == 0 else 0.0
    for e in range(n):  # the transpose: its rows are those of the nodes that push
        at = e * STAGES
        for j in range(STAGES):
            push = pushes[at + j]
            for i in range(STAGES):
                matrix[j * STAGES + i] -= push * looks[at + i]
    for j in range(STAGES):
        for i in range(STAGES):
            matrix[j * STAGES + i] *= A[j * STAGES + i]
        matrix[j * STAGES + j] += 1.0
    for i in range(STAGES):
        pivot = 1.0 / matrix[i * STAGES + i]
        for j in range(STAGES):
            matrix[i * STAGES + j] *= pivot
            inverse[i * STAGES + j] *= pivot
        for k in range(STAGES):
            if k != i:
                factor = matrix[k * STAGES + i]
                for j in range(STAGES):
                    matrix[k * STAGES + j] -= factor * matrix[i * STAGES + j]
                    inverse[k * STAGES + j] -= factor * inverse[i * STAGES + j]


@njit(**INNER)
def _forced(n, frame, stages, varied, nothing):
    """Write what a step adds to a column that is forced as `forced` says in `more`. nothing: (n,), zeros."""
    outlined()
    level, forced = stages.out, varied.forced
    integrated(n, forced, stages.sums)
    for i in range(STAGES):
        level[i] = level[STAGES + i] = 0.0
    for e in range(n):
        for i in range(STAGES):
            level[i] += varied.looks[e * STAGES + i] * stages.sums[e * STAGES + i]
    for i in range(STAGES):
        for j in range(STAGES):
            level[STAGES + j] += varied.inverse[i * STAGES + j] * level[i]
    for e in range(n):
        for j in range(STAGES):
            stages.sums[e * STAGES + j] = forced[e * STAGES + j] + level[STAGES + j] * varied.pushes[e * STAGES + j]
    whole(n, frame, stages.sums, nothing, varied.more)


@njit(**INNER)
def _response(n, frame, varied):
    """Write what a step makes of the states at its start, (n, n)."""
    outlined()
    answers, turned, matrix = varied.answers, varied.turned, varied.matrix
    for j in range(STAGES):
        line = pointer(answers, j * n)
        for f in range(n):
            total = 0.0
            for i in range(STAGES):
                total += varied.inverse[i * STAGES + j] * varied.looks[f * STAGES + i]
            line[f] = B[j] * total
    for e in range(n):
        line = pointer(turned, e * n)
        for f in range(n):
            line[f] = 1.0 if e == f else 0.0
        for j in range(STAGES):
            push, answer = varied.pushes[e * STAGES + j], pointer(answers, j * n)
            for f in range(n):
                line[f] += push * answer[f]
    for e in range(n):
        over = frame.partners[e] * n
        for f in range(n):
            matrix[e * n + f] = frame.end[e] * turned[e * n + f] + frame.beyond[e] * turned[over + f]


@njit(**INNER)
def _times(n, columns, matrix, before, out):
    """Write a matrix (n, n) times columns (n, columns)."""
    apart()
    for e in range(n):
        line = pointer(out, e * columns)
        for c in range(columns):
            line[c] = 0.0
        for f in range(n):
            entry, given = matrix[e * n + f], pointer(before, f * columns)
            for c in range(columns):
                line[c] += entry * given[c]


@njit(**INNER)
def largest(values, count):
    """Return the largest size of some values."""
    largest = 0.0
    for i in range(count):
        largest = max(largest, abs(values[i]))
    return largest


@njit(**INNER)
def propagated(segment, linear, sensitive, before, out, rtol, parts):
    """Write sensitivities (n, columns) behind a step, from those before it; return their error over VARIED rtol.

    parts: `Frame`, `Stages` and `Varied` of the step.
    """
    outlined()
    frame, stages, varied = parts
    n, own, columns = segment.n, int(linear[0]), sensitive.columns
    force, nothing, matrix, rough = stages.out, stages.frame, varied.matrix, 0.0
    _inverted(n, varied.pushes, varied.looks, varied.coupled, varied.inverse)
    _response(n, frame, varied)
    for e in range(own):
        at, over = e * STAGES, frame.partners[e] * STAGES
        for i in range(STAGES):
            stages.sums[i] = varied.pushes[at + i] * varied.looks[over + i]
            stages.rest[i] = varied.pushes[at + i] * varied.looks[at + i]
        rough = max(rough, tail(stages.sums) * largest(pointer(before, frame.partners[e] * columns), columns))
        rough = max(rough, tail(stages.rest) * largest(pointer(before, e * columns), columns))
    for e in range(n):
        nothing[e] = 0.0
    if own < n:
        for e in range(n):
            for i in range(STAGES):
                stages.rest[e * STAGES + i] = frame.rates[i] * varied.slopes[e * STAGES + i]
        framed(n, frame.partners, frame.back, frame.across, stages.rest, varied.forced)
        _forced(n, frame, stages, varied, nothing)
        size = largest(pointer(before, own * columns), columns)
        for e in range(own):
            matrix[e * n + own] = varied.more[e]
            rough = max(rough, size * tail(pointer(varied.forced, e * STAGES)))
    _times(n, columns, matrix, before, out)
    for k in range(sensitive.n_active):
        for i in range(STAGES):
            point = pointer(stages.points, i * n)
            call(segment.functions[FIELD_P], segment.mode, sensitive.active[k], point, 0, segment.p, force, 0)
            turned = frame.times[i] * force[own] if own < n else 0.0
            for e in range(n):
                stages.rest[e * STAGES + i] = frame.rates[i] * (force[e] + turned * varied.slopes[e * STAGES + i])
        framed(n, frame.partners, frame.back, frame.across, stages.rest, varied.forced)
        _forced(n, frame, stages, varied, nothing)
        for e in range(n):
            out[e * columns + n + k] += varied.more[e]
            rough = max(rough, tail(pointer(varied.forced, e * STAGES)))
    return rough / (VARIED * rtol * largest(out, n * columns) + 1e-300) if rtol > 0.0 else 0.0
