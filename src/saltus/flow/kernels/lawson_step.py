"""Compiled steps by Gauss's collocation in the frame of a linear part of the field (`saltus.flow.lawson`).

With x = exp(A t) z the part A x needs no resolution in time: the rest alone, as the frame sees it, is integrated. The
rest's slopes may be those of one function of the states, g u w^T with a factor g that varies. Sensitivities of all
columns then follow from one small matrix: docs/theory/flow.md.

Arrays of values at the nodes have the node as the last index.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from saltus.flow import lawson
from saltus.flow.kernels.segment import FIELD
from saltus.system.numba_tools.machine_code import njit
from saltus.system.numba_tools.pointers import INNER, apart, call, outlined, pointer

STAGES = lawson.STAGES
C = lawson.NODES
B = lawson.WEIGHTS
A = lawson.WITHIN.T.ravel()  # of each node, its weights in all integrals
TAILS = lawson.TAILS.ravel()
HEAD = 4  # numbers at the head of a linear part
EACH = 5  # numbers of a linear part for each component
SWEEPS = 30  # of the stages' equations, at most
SOLVED = 1e-14  # change of a stage in a sweep, over the state's size, behind which the next one is rounding
STALLED = 1e-12  # the same, up to which changes that no longer shrink are rounding
ONE = 1e-11  # what one function does not explain of the field or its slopes, over these
PROBES = 3  # directions in which slopes are taken: a state, one in which all states take part, the phase
GOLDEN = 0.6180339887498949
ROUNDING = 1e-15  # of a coefficient, over the values


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
def clustered(duration, s, h, frame):
    """Write the times of the nodes of a step in clustered time."""
    for i in range(STAGES + 1):
        d = h if i == STAGES else C[i] * h
        frame.times[i] = span(duration, s, d)
        if i < STAGES:
            frame.rates[i] = h * duration * 6.0 * (s + d) * (1.0 - s - d)


@njit(**INNER)
def plain(h, frame):
    """Write the times of the nodes of a step in time."""
    for i in range(STAGES):
        frame.times[i], frame.rates[i] = C[i] * h, h
    frame.times[STAGES] = h


@njit(**INNER)
def span(duration, s, h):
    """Return how long a step in clustered time lasts."""
    return duration * h * (6.0 * s * (1.0 - s) + h * (3.0 - 6.0 * s - 2.0 * h))


@njit(**INNER)
def set_frame(n, linear, frame, work):
    """Write the frame at a step's nodes, whose times are set.

    work: (4 n + 36,).
    """
    outlined()
    before = math.inf
    c, z, grown, shrunk = work, pointer(work, 9), pointer(work, 18), pointer(work, 27)
    for e in range(n):
        law = pointer(linear, HEAD + EACH * e)
        partner, diagonal, to = int(law[0]), law[1], law[2]
        if partner < e:
            continue
        law = pointer(linear, HEAD + EACH * partner)
        mean, half, link = 0.5 * (diagonal + law[1]), 0.5 * (diagonal - law[1]), law[2]
        curl = half * half + to * link
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


@njit(**INNER)
def framed(n, partners, own, other, x, out):
    """Write a frame's matrices times `x` in `out`, both (n, 8)."""
    apart()
    for e in range(n):
        at, over = e * STAGES, partners[e] * STAGES
        for i in range(STAGES):
            out[at + i] = own[at + i] * x[at + i] + other[at + i] * x[over + i]


@njit(**INNER)
def integrated(n, values, out):
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
def whole(n, frame, values, x, out):
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
def taken(segment, linear, x, frame, stages, x_end, enough):
    """Solve the equations of a step from `x`, (n,), whose frame is set; return the sweeps, 0 where it is not solved.

    enough: change of the stages in the next sweep, as it is to be expected, that is none.
    """
    outlined()
    n, kicks, sums, rest, points, states = (
        segment.n,
        stages.kicks,
        stages.sums,
        stages.rest,
        stages.points,
        stages.states,
    )
    _rest_at(segment, linear, x, 0, 1, frame, stages.frame, stages.out)
    for e in range(n):
        for i in range(STAGES):
            rest[e * STAGES + i] = frame.rates[i] * stages.frame[e]
    framed(n, frame.partners, frame.back, frame.across, rest, kicks)
    before = math.inf
    for sweep in range(1, SWEEPS + 1):
        integrated(n, kicks, rest)
        for e in range(n):
            for i in range(STAGES):
                rest[e * STAGES + i] += x[e]
        framed(n, frame.partners, frame.own, frame.other, rest, states)
        for i in range(STAGES):
            point = pointer(points, i * n)
            for e in range(n):
                point[e] = states[e * STAGES + i]
            _rest_at(segment, linear, point, i, STAGES, frame, rest, stages.out)
        for e in range(n):
            for i in range(STAGES):
                rest[e * STAGES + i] *= frame.rates[i]
        framed(n, frame.partners, frame.back, frame.across, rest, sums)
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
        next_one = change * (min(change / before, 1.0) if sweep > 1 else 1.0)
        if change <= SOLVED or next_one <= enough or (change <= STALLED and change > 0.3 * before):
            whole(n, frame, kicks, x, x_end)
            return sweep
        before = change
    return 0


@njit(**INNER)
def tail(values):
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
        worst = max(worst, tail(pointer(stages.kicks, e * STAGES)) / (atol + rtol * max(abs(x[e]), abs(x_end[e]))))
    return worst


@njit(**INNER)
def probes(linear, n, given):
    """Write the directions of slopes behind a state, a state, all, and the phase; return w times the second one."""
    own, seen = int(linear[0]), 0.0
    for e in range(n):
        probe = 0.5 + (GOLDEN * e) % 1.0 if e < own else 0.0
        given[n + PROBES * e] = 1.0 if e == int(linear[2]) else 0.0
        given[n + PROBES * e + 1] = probe
        given[n + PROBES * e + 2] = 1.0 if e >= own else 0.0
        seen += linear[HEAD + EACH * e + 4] * probe
    return seen
