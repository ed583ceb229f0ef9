"""Compiled steps by Gauss's collocation in the frame of a linear part of the field (`saltus.flow.lawson`).

With x = exp(A t) z the part A x needs no resolution in time: the rest alone, as the frame sees it, is integrated. Where
the rest's slopes are those of one function of the states, g u w^T with a factor g that varies, the sensitivities of all
columns follow from one small matrix: docs/theory/flow.md.

Arrays of values at the nodes have the node as the last index.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from saltus.flow import lawson
from saltus.flow.kernels.segment import FIELD, FIELD_P, VARIED, VARY
from saltus.system.numba_tools.machine_code import njit
from saltus.system.numba_tools.pointers import INNER, apart, call, outlined, pointer

STAGES = lawson.STAGES
C = lawson.NODES
B = lawson.WEIGHTS
A = lawson.WITHIN.T.ravel()  # of each node, its weights in all integrals
TAILS = lawson.TAILS.ravel()
HEAD, EACH = 3, 5  # numbers of a linear part: at its head, and of each component
SWEEPS = 30  # of the stages' equations, at most
SOLVED = 1e-14  # change of a stage in a sweep, over the state's size, behind which the next one is rounding
STALLED = 1e-12  # the same, up to which changes that no longer shrink are rounding
ONE = 1e-11  # what one function does not explain of the field's slopes, over these
PROBES = 3  # directions in which slopes are taken: a state, one in which all states take part, the phase
ROUNDING = 1e-15  # of a coefficient, over the values
GOLDEN = 0.6180339887498949


class Frame(NamedTuple):
    """A step's nodes in the frame of the linear part, on pointers.

    Attributes
    ----------
    times, rates : pointer, (9,) and (8,)
        Time since the step's start at nodes and end; the step in time that each node stands for.
    own, other : pointer, (n, 8)
        Of each row of exp(A t) the entry on the diagonal and the partner's.
    back, across : pointer, (n, 8)
        The same of exp(-A t).
    end, beyond : pointer, (n,)
        The same of exp(A t) at the step's end.
    partners : pointer to int64, (n,)
        Each component's partner.
    """

    times: object
    rates: object
    own: object
    other: object
    back: object
    across: object
    end: object
    beyond: object
    partners: object


class Stages(NamedTuple):
    """Values of a step at its nodes, and scratch, on pointers.

    Attributes
    ----------
    kicks, sums, rest : pointer, (n, 8)
        The rest as the frame sees it, its integrals, and the rest.
    points : pointer, (8, n)
        States at the nodes.
    states : pointer, (n, 8)
        The same.
    frame, out : pointer, (4 n + 36,)
        Arguments and values of the generated functions, and scratch.
    """

    kicks: object
    sums: object
    rest: object
    points: object
    states: object
    frame: object
    out: object


class Varied(NamedTuple):
    """What a step's sensitivities are made of, on pointers.

    Attributes
    ----------
    pushes, looks : pointer, (n, 8)
        In the frame, which states the rest's function moves, and which it depends on.
    slopes, forced : pointer, (n, 8)
        The field's slope by the phase; that by the phase or a parameter, as the frame sees it.
    coupled, inverse : pointer, (8, 8)
        Matrix of the function's values at the nodes, and its inverse.
    answers : pointer, (8, n)
        What the function makes of the states at the step's start.
    matrix, turned, more : pointer, (n, n), (n, n) and (n,)
        What the step makes of states at its start, before the frame turns back as well; and of phase or parameter.
    """

    pushes: object
    looks: object
    slopes: object
    forced: object
    coupled: object
    inverse: object
    answers: object
    matrix: object
    turned: object
    more: object


@njit(**INNER)
def room_for(n):
    """Return how many numbers the scratch of a step takes."""
    return 2 * STAGES + 1 + 2 * n + 14 * STAGES * n + 2 * (4 * n + 36) + 2 * STAGES * STAGES + 2 * n * n + n


@njit(**INNER)
def laid_out(block, partners, n):
    """Return the scratch in a block of `room_for(n)` numbers and n integers."""
    size = STAGES * n
    own = pointer(block, 2 * STAGES + 1 + 2 * n)
    kicks = pointer(own, 4 * size)
    frame = pointer(kicks, 5 * size)
    pushes = pointer(frame, 2 * (4 * n + 36))
    coupled = pointer(pushes, 5 * size)
    matrix = pointer(coupled, 2 * STAGES * STAGES)
    return (
        Frame(block, pointer(block, STAGES + 1), own, pointer(own, size), pointer(own, 2 * size), pointer(own, 3 * size),
              pointer(block, 2 * STAGES + 1), pointer(block, 2 * STAGES + 1 + n), partners),
        Stages(kicks, pointer(kicks, size), pointer(kicks, 2 * size), pointer(kicks, 3 * size), pointer(kicks, 4 * size),
               frame, pointer(frame, 4 * n + 36)),
        Varied(pushes, pointer(pushes, size), pointer(pushes, 2 * size), pointer(pushes, 3 * size), coupled,
               pointer(coupled, STAGES * STAGES), pointer(pushes, 4 * size), matrix, pointer(matrix, n * n),
               pointer(matrix, 2 * n * n)),
    )  # fmt: skip


@njit(**INNER)
def _series(curl, times, count, c, s):
    """Write cosh and sinh of sqrt(curl) times in `c` and `s`, the latter over sqrt(curl); of a negative curl they turn.

    times: (count,), none longer than the last one.
    """
    apart()
    scale, halvings = 1.0, 0
    while abs(curl) * (scale * times[count - 1]) ** 2 > 1.0 and halvings < 60:
        scale *= 0.5
        halvings += 1
    for i in range(count):
        t = scale * times[i]
        z = curl * t * t
        c[i] = 1.0 + z * (1.0 / 2.0 + z * (1.0 / 24.0 + z * (1.0 / 720.0 + z * (1.0 / 40320.0 + z * (
            1.0 / 3628800.0 + z * (1.0 / 479001600.0 + z * (1.0 / 87178291200.0 + z / 20922789888000.0)))))))  # fmt: skip
        s[i] = t * (1.0 + z * (1.0 / 6.0 + z * (1.0 / 120.0 + z * (1.0 / 5040.0 + z * (1.0 / 362880.0 + z * (
            1.0 / 39916800.0 + z * (1.0 / 6227020800.0 + z * (1.0 / 1307674368000.0 + z / 355687428096000.0))))))))  # fmt: skip
    for _ in range(halvings):
        for i in range(count):
            s[i] = 2.0 * c[i] * s[i]
            c[i] = 2.0 * c[i] * c[i] - 1.0


@njit(**INNER)
def set_frame(segment, linear, s, h, frame, work):
    """Write the times of a step's nodes and the frame there; return the step times the frame's fastest rate.

    work: (4 n + 36,).
    """
    outlined()
    n, duration, fastest, before = segment.n, segment.duration, 0.0, math.inf
    for i in range(STAGES + 1):
        d = h if i == STAGES else C[i] * h
        frame.times[i] = duration * d * (6.0 * s * (1.0 - s) + d * (3.0 - 6.0 * s - 2.0 * d))
        if i < STAGES:
            frame.rates[i] = h * duration * 6.0 * (s + d) * (1.0 - s - d)
    whole, c, z, grown, shrunk = frame.times[STAGES], work, pointer(work, 9), pointer(work, 18), pointer(work, 27)
    for e in range(n):
        law = pointer(linear, HEAD + EACH * e)
        partner, diagonal, to = int(law[0]), law[1], law[2]
        if partner < e:
            continue
        law = pointer(linear, HEAD + EACH * partner)
        mean, half, link = 0.5 * (diagonal + law[1]), 0.5 * (diagonal - law[1]), law[2]
        curl = half * half + to * link
        fastest = max(fastest, (abs(mean) + math.sqrt(abs(curl))) * whole)
        _series(curl, frame.times, STAGES + 1, c, z)
        if mean != before:
            before = mean
            for i in range(STAGES + 1):
                grown[i] = math.exp(mean * frame.times[i])
                shrunk[i] = 1.0 / grown[i]
        at, over = e * STAGES, partner * STAGES
        for i in range(STAGES):
            frame.own[at + i] = grown[i] * (c[i] + half * z[i])
            frame.back[at + i] = shrunk[i] * (c[i] - half * z[i])
            frame.other[at + i] = grown[i] * to * z[i]
            frame.across[at + i] = -shrunk[i] * to * z[i]
        frame.end[e] = grown[STAGES] * (c[STAGES] + half * z[STAGES])
        frame.beyond[e] = grown[STAGES] * to * z[STAGES]
        if partner > e:
            for i in range(STAGES):
                frame.own[over + i] = grown[i] * (c[i] - half * z[i])
                frame.back[over + i] = shrunk[i] * (c[i] + half * z[i])
                frame.other[over + i] = grown[i] * link * z[i]
                frame.across[over + i] = -shrunk[i] * link * z[i]
            frame.end[partner] = grown[STAGES] * (c[STAGES] - half * z[STAGES])
            frame.beyond[partner] = grown[STAGES] * link * z[STAGES]
    return fastest


@njit(**INNER)
def _framed(n, partners, own, other, x, out):
    """Write a frame's matrices times `x` in `out`, both (n, 8)."""
    apart()
    for e in range(n):
        at, over = e * STAGES, partners[e] * STAGES
        for i in range(STAGES):
            out[at + i] = own[at + i] * x[at + i] + other[at + i] * x[over + i]


@njit(**INNER)
def _integrated(n, values, out):
    """Write the integrals of functions up to each node, (n, 8), from their values at all."""
    apart()
    weights = pointer(A, 0)
    for e in range(n):
        at = e * STAGES
        for i in range(STAGES):
            out[at + i] = 0.0
        for j in range(STAGES):
            value = values[at + j]
            for i in range(STAGES):
                out[at + i] += weights[j * STAGES + i] * value


@njit(**INNER)
def _whole(n, frame, values, x, out):
    """Write the state at a step's end, (n,), from that at its start and what moves it at the nodes, (n, 8)."""
    for e in range(n):
        total, across, at, over = x[e], x[frame.partners[e]], e * STAGES, frame.partners[e] * STAGES
        for j in range(STAGES):
            total += B[j] * values[at + j]
            across += B[j] * values[over + j]
        out[e] = frame.end[e] * total + frame.beyond[e] * across


@njit(**INNER)
def _rest_at(segment, linear, x, node, apart_by, frame, values, out):
    """Write the field less its linear part at a node's place in `values`."""
    call(segment.functions[FIELD], segment.mode, 0, x, 0, segment.p, out, 0)
    for e in range(segment.n):
        law, partner = pointer(linear, HEAD + EACH * e), frame.partners[e]
        values[e * apart_by + node] = out[e] - law[1] * x[e] - (law[2] * x[partner] if partner != e else 0.0)


@njit(**INNER)
def taken(segment, linear, x, frame, stages, x_end):
    """Solve the equations of a step from `x`, (n,), whose frame is set; return the sweeps, 0 where it is not solved."""
    outlined()
    n, kicks, sums, rest, points, states = segment.n, stages.kicks, stages.sums, stages.rest, stages.points, stages.states
    _rest_at(segment, linear, x, 0, 1, frame, stages.frame, stages.out)
    for e in range(n):
        for i in range(STAGES):
            rest[e * STAGES + i] = frame.rates[i] * stages.frame[e]
    _framed(n, frame.partners, frame.back, frame.across, rest, kicks)
    before = math.inf
    for sweep in range(1, SWEEPS + 1):
        _integrated(n, kicks, rest)
        for e in range(n):
            for i in range(STAGES):
                rest[e * STAGES + i] += x[e]
        _framed(n, frame.partners, frame.own, frame.other, rest, states)
        for i in range(STAGES):
            point = pointer(points, i * n)
            for e in range(n):
                point[e] = states[e * STAGES + i]
            _rest_at(segment, linear, point, i, STAGES, frame, rest, stages.out)
        for e in range(n):
            for i in range(STAGES):
                rest[e * STAGES + i] *= frame.rates[i]
        _framed(n, frame.partners, frame.back, frame.across, rest, sums)
        change = 0.0
        for e in range(n):
            size, moved = abs(x[e]), 0.0
            for i in range(STAGES):
                at = e * STAGES + i
                size = max(size, abs(states[at]))
                moved = max(moved, abs(sums[at] - kicks[at]))
                kicks[at] = sums[at]
            if not abs(sums[e * STAGES] * size) < 1e300:
                return 0
            if moved > 0.0:
                change = max(change, moved / (size + 1e-300))
        if change <= SOLVED or (change <= STALLED and change > 0.3 * before):
            _whole(n, frame, kicks, x, x_end)
            return sweep
        before = change
    return 0


@njit(**INNER)
def _tail(values):
    """Return the error of Gauss's rule of a function, from its values at the nodes.

    Coefficients of Legendre's polynomials go on to shrink at least as they do from degrees 4 and 5 to 6 and 7.
    """
    c4 = c5 = c6 = c7 = sizes = 0.0
    for j in range(STAGES):
        c4 += TAILS[j] * values[j]
        c5 += TAILS[STAGES + j] * values[j]
        c6 += TAILS[2 * STAGES + j] * values[j]
        c7 += TAILS[3 * STAGES + j] * values[j]
        sizes += abs(values[j])
    last = max(abs(c6) + abs(c7) - ROUNDING * sizes, 0.0)
    shrinks = min(last / (abs(c4) + abs(c5) + 1e-300), 1.0)
    both = shrinks * shrinks
    return last * both * both * shrinks


@njit(**INNER)
def error_of(n, stages, x, x_end, rtol, atol):
    """Return the error of a step's state over its tolerance."""
    outlined()
    worst = 0.0
    for e in range(n):
        worst = max(worst, _tail(pointer(stages.kicks, e * STAGES)) / (atol + rtol * max(abs(x[e]), abs(x_end[e]))))
    return worst


@njit(**INNER)
def linearised(segment, linear, frame, stages, varied):
    """Write how the rest's function moves the states and depends on them at each node; whether there is but one."""
    outlined()
    n, own, row, given, out = segment.n, int(linear[0]), int(linear[1]), stages.frame, stages.out
    seen = 0.0
    for e in range(n):
        probe = 0.5 + (GOLDEN * e) % 1.0 if e < own else 0.0
        given[n + PROBES * e] = 1.0 if e == int(linear[2]) else 0.0
        given[n + PROBES * e + 1] = probe
        given[n + PROBES * e + 2] = 1.0 if e >= own else 0.0
        seen += linear[HEAD + EACH * e + 4] * probe
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
    _framed(n, frame.partners, frame.back, frame.across, stages.rest, varied.pushes)
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
    _integrated(n, forced, stages.sums)
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
    _whole(n, frame, stages.sums, nothing, varied.more)


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
def _largest(values, count):
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
        rough = max(rough, _tail(stages.sums) * _largest(pointer(before, frame.partners[e] * columns), columns))
        rough = max(rough, _tail(stages.rest) * _largest(pointer(before, e * columns), columns))
    for e in range(n):
        nothing[e] = 0.0
    if own < n:
        for e in range(n):
            for i in range(STAGES):
                stages.rest[e * STAGES + i] = frame.rates[i] * varied.slopes[e * STAGES + i]
        _framed(n, frame.partners, frame.back, frame.across, stages.rest, varied.forced)
        _forced(n, frame, stages, varied, nothing)
        size = _largest(pointer(before, own * columns), columns)
        for e in range(own):
            matrix[e * n + own] = varied.more[e]
            rough = max(rough, size * _tail(pointer(varied.forced, e * STAGES)))
    _times(n, columns, matrix, before, out)
    for k in range(sensitive.n_active):
        for i in range(STAGES):
            point = pointer(stages.points, i * n)
            call(segment.functions[FIELD_P], segment.mode, sensitive.active[k], point, 0, segment.p, force, 0)
            turned = frame.times[i] * force[own] if own < n else 0.0
            for e in range(n):
                stages.rest[e * STAGES + i] = frame.rates[i] * (force[e] + turned * varied.slopes[e * STAGES + i])
        _framed(n, frame.partners, frame.back, frame.across, stages.rest, varied.forced)
        _forced(n, frame, stages, varied, nothing)
        for e in range(n):
            out[e * columns + n + k] += varied.more[e]
            rough = max(rough, _tail(pointer(varied.forced, e * STAGES)))
    largest = _largest(out, n * columns)
    return rough / (VARIED * rtol * largest + 1e-300) if rtol > 0.0 else 0.0
