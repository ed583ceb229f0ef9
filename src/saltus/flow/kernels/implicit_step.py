"""Compiled implicit steps, for stiff flows: Radau's method IIA of seven stages (`saltus.flow.radau`).

The equations of a step are solved by Newton's method, whose last matrix gives the sensitivities: docs/theory/flow.md.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import float64, int64, types

from saltus.flow import radau
from saltus.flow.kernels.segment import FIELD_P, VARY
from saltus.flow.kernels.shares import allowed
from saltus.flow.kernels.stages import dense_slope, dense_value
from saltus.system.compiled import SHARES
from saltus.system.numba_tools.machine_code import njit
from saltus.system.numba_tools.pointers import ARRAYS, INNER, call, numbers_at, outlined, pointer

STAGES = radau.STAGES
C = radau.NODES
A = radau.WEIGHTS.ravel()
D = radau.DENSE.ravel()
LAST = radau.LAST
ITERATIONS = 12  # Newton steps, at most
SOLVED = 1e-11  # size of a Newton step, over the states', behind which the next one is rounding
ROUNDING = 32.0 * 2.220446049250313e-16  # residual, over its terms, that is rounding
STALLED = 1e-7  # the same, up to which steps that no longer shrink are rounding
REACH = 2.0  # step, over the one before, up to which the dense output is a guess for the next one
LONGEST = 1e14  # longest step, times the fastest rate: at rest steps would grow beyond all numbers
GROWN = 3.0  # growth over a step, in factors e, that the method follows
PROBES = 0.24, 0.45, 0.66, 0.85  # fractions of a step, between its stages, at which its dense output is checked
SHARE = 0.2  # part of a step over which what is left of its equations there acts
PASSED = 1e4  # error there, in tolerances, from which on a step passed over something
ROUGH = 100.0  # coefficient of the polynomial of degree 7, in tolerances, up to which a step is accepted
NUMBERS = types.CPointer(float64)
INTEGERS = types.CPointer(int64)
SYSTEM = INTEGERS, int64, int64, NUMBERS  # addresses of generated functions, mode, components, parameters


class Forced(NamedTuple):
    """The columns of a step's sensitivities, of which the last ones depend on parameters.

    Attributes
    ----------
    columns, states : int
        All columns, and those before the first that depends on a parameter.
    active : pointer to int64
        Parameters of the columns behind.
    n_active : int
        How many; further columns depend on the duration alone.
    longer : pointer, (columns - states,)
        What each of these columns adds to the duration.
    """

    columns: int
    states: int
    active: object
    n_active: int
    longer: object


class Stages(NamedTuple):
    """Scratch of an implicit step, on pointers.

    Attributes
    ----------
    rates, weights : pointer, (7,)
        What time does in each stage, over what the step's variable does; the same over the duration.
    increments : pointer, (7 n,)
        States of the stages, less the one at the start.
    slopes : pointer, (7 n,)
        The field in the stages, not multiplied by the rates.
    matrix : pointer, (7 n, 7 n)
        Newton's matrix, or its factors.
    column : pointer, (7 n,)
        A right-hand side, or the solution.
    terms : pointer, (7 n,)
        Sizes of the terms of the right-hand side, whose rounding it has.
    scales : pointer, (7 n,)
        By what the matrix's rows are multiplied.
    frame, out : pointer, (n + n n,)
        Arguments and values of the generated functions.
    guess : pointer, (8 n,)
        Dense output of the step before, and scratch.
    pivots : pointer to int64, (7 n,)
        Rows that change places.
    """

    rates: object
    weights: object
    increments: object
    slopes: object
    matrix: object
    column: object
    terms: object
    scales: object
    frame: object
    out: object
    guess: object
    pivots: object


@njit(**INNER)
def room_for(n):
    """Return how many numbers the scratch of an implicit step takes."""
    size = STAGES * n
    return 2 * STAGES + 5 * size + size * size + 2 * (n + n * n) + (STAGES + 1) * n


@njit(**INNER)
def laid_out(block, pivots, n):
    """Return the scratch in a block of `room_for(n)` numbers and 7 n integers."""
    size = STAGES * n
    increments = pointer(block, 2 * STAGES)
    matrix = pointer(increments, 2 * size)
    column = pointer(matrix, size * size)
    frame = pointer(column, 3 * size)
    return Stages(
        block, pointer(block, STAGES), increments, pointer(increments, size), matrix, column, pointer(column, size),
        pointer(column, 2 * size), frame, pointer(frame, n + n * n), pointer(frame, 2 * (n + n * n)), pivots,
    )  # fmt: skip


@njit(**INNER)
def factorise(matrix, size, scales, pivots):
    """Replace a matrix by its triangular factors, rows scaled and exchanged; return whether it is regular.

    Rows of fast states are as large as their rates. Beside them the pivots of slow ones would be lost in rounding.
    """
    outlined()
    for i in range(size):
        row, largest = pointer(matrix, i * size), 0.0
        for j in range(size):
            largest = max(largest, abs(row[j]))
        if not 0.0 < largest < math.inf:
            return False
        scales[i] = 1.0 / largest
        for j in range(size):
            row[j] *= scales[i]
    for k in range(size):
        best = k
        for i in range(k + 1, size):
            if abs(matrix[i * size + k]) > abs(matrix[best * size + k]):
                best = i
        pivots[k] = best
        top = matrix[best * size + k]
        if not 0.0 < abs(top) < math.inf:
            return False
        if best != k:
            for j in range(size):
                matrix[k * size + j], matrix[best * size + j] = matrix[best * size + j], matrix[k * size + j]
        row = pointer(matrix, k * size)
        for i in range(k + 1, size):
            other = pointer(matrix, i * size)
            if other[k] != 0.0:
                share = other[k] / top
                other[k] = share
                for j in range(k + 1, size):
                    other[j] -= share * row[j]
    return True


@njit(**INNER)
def substitute(stages, size, column):
    """Replace a right-hand side by the solution, from the factors of the matrix."""
    outlined()
    matrix, pivots = stages.matrix, stages.pivots
    for i in range(size):
        column[i] *= stages.scales[i]
    for k in range(size):
        if pivots[k] != k:
            column[k], column[pivots[k]] = column[pivots[k]], column[k]
    for i in range(1, size):
        total = column[i]
        for j in range(i):
            total -= matrix[i * size + j] * column[j]
        column[i] = total
    for i in range(size - 1, -1, -1):
        total = column[i]
        for j in range(i + 1, size):
            total -= matrix[i * size + j] * column[j]
        column[i] = total / matrix[i * size + i]


@njit(**INNER)
def linearised(segment, h, x, stages):
    """Write residual and matrix of a step's equations, and the slopes, where the increments are; return regularity."""
    outlined()
    n = segment.n
    size = STAGES * n
    frame, out, increments, matrix, column = stages.frame, stages.out, stages.increments, stages.matrix, stages.column
    terms = stages.terms
    for e in range(n * n):
        frame[n + e] = 1.0 if e % (n + 1) == 0 else 0.0
    for e in range(size):
        column[e] = increments[e]
        terms[e] = abs(x[e % n]) + abs(increments[e])
    for j in range(STAGES):
        for e in range(n):
            frame[e] = x[e] + increments[j * n + e]
        call(segment.functions[VARY], segment.mode, n, frame, 0, segment.p, out, 0)
        for e in range(n):
            stages.slopes[j * n + e] = out[e]
        for i in range(STAGES):
            weight = h * stages.rates[j] * A[i * STAGES + j]
            for a in range(n):
                column[i * n + a] -= weight * out[a]
                row = pointer(matrix, (i * n + a) * size + j * n)
                for b in range(n):
                    entry = weight * out[n + a * n + b]
                    row[b] = (1.0 if i == j and a == b else 0.0) - entry
                    terms[i * n + a] += abs(entry * frame[b])
    return factorise(matrix, size, stages.scales, stages.pivots)


@njit(**INNER)
def solved(segment, h, x, stages):
    """Solve a step's equations from a guess of the increments by Newton's method; return whether they are solved."""
    outlined()
    n = segment.n
    increments, before = stages.increments, math.inf
    for _ in range(ITERATIONS):
        if not linearised(segment, h, x, stages):
            return False
        rounding = True
        for e in range(STAGES * n):
            rounding = rounding and abs(stages.column[e]) <= ROUNDING * stages.terms[e]
        substitute(stages, STAGES * n, stages.column)
        largest = 0.0
        for e in range(n):
            top, moved = abs(x[e]), 0.0
            for i in range(STAGES):
                increments[i * n + e] -= stages.column[i * n + e]
                top = max(top, abs(x[e] + increments[i * n + e]))
                step = abs(stages.column[i * n + e])
                if not step <= moved:
                    moved = step
            if moved > 0.0 or moved != moved:
                share = moved / top
                if not share <= largest:
                    largest = share
        if not largest < math.inf:
            return False
        if rounding or largest <= SOLVED or (largest <= STALLED and largest > 0.5 * before):
            return True
        before = largest
    return False


@njit(**INNER)
def guessed(n, dense, whole, begun, h, stages):
    """Guess the increments of a step of length h that begins at `begun` of another one, from its dense output.

    whole: length of that step; the guess is an extrapolation where this one ends behind it.
    """
    outlined()
    base = pointer(stages.guess, STAGES * n)
    for e in range(n):
        base[e] = 0.0
    dense_value(dense, 0, n, base, 0, begun / whole, base)
    for e in range(n):
        base[e] = -base[e]
    for i in range(STAGES):
        dense_value(dense, 0, n, base, 0, (begun + C[i] * h) / whole, pointer(stages.increments, i * n))


@njit(**INNER)
def taken(segment, h, before, x, stages):
    """Take a step of the state, of which the increments are left; return whether its equations are solved.

    before: length of the step whose dense output `stages.guess` holds, 0 for none.
    """
    n = segment.n
    if 0.0 < before and h <= REACH * before:
        guessed(n, stages.guess, before, before, h, stages)
        if solved(segment, h, x, stages):
            return True
    for e in range(STAGES * n):
        stages.increments[e] = 0.0
    return solved(segment, h, x, stages)


@njit(**INNER)
def dense_increments(n, increments, coefficients):
    """Write the coefficients of the dense output, (7 n,), of a step's increments."""
    for k in range(STAGES):
        for e in range(n):
            total = 0.0
            for i in range(STAGES):
                total += D[k * STAGES + i] * increments[i * n + e]
            coefficients[k * n + e] = total


@njit(**INNER)
def roughness(n, used, x, increments, tolerances, shares):
    """Return the error of a step over its tolerance: the polynomial of highest degree in it; see `state_error`."""
    worst, (rtol, atol) = 0.0, tolerances
    for e in range(used):
        last, top = 0.0, abs(x[e])
        for i in range(STAGES):
            last += LAST[i] * increments[i * n + e]
            top = max(top, abs(x[e] + increments[i * n + e]))
        error = abs(last) / (ROUGH * allowed(shares[e], top, rtol, atol))
        if not error <= worst:
            worst = error
    return worst


@njit(**INNER)
def rate_at(segment, x, stages):
    """Return a rate that steps at a state must resolve: that of the fastest growth, or a tiny part of the fastest rate."""
    outlined()
    n = segment.n
    for e in range(n):
        stages.frame[e] = x[e]
    for e in range(n * n):
        stages.frame[n + e] = 1.0 if e % (n + 1) == 0 else 0.0
    call(segment.functions[VARY], segment.mode, n, stages.frame, 0, segment.p, stages.out, 0)
    for e in range(n * n):
        if not abs(stages.out[n + e]) < math.inf:
            return math.inf
    return _fastest(pointer(stages.out, n), n)


@njit(**ARRAYS)
def _fastest(entries, n):
    """Return the rate of `rate_at` of a Jacobian, (n, n)."""
    fastest, J = 0.0, np.empty((n, n), np.complex128)
    for a in range(n):
        for b in range(n):
            J[a, b] = entries[a * n + b]
    for value in np.linalg.eigvals(J):
        fastest = max(fastest, value.real, GROWN * abs(value) / LONGEST)
    return fastest


@njit(**INNER)
def error_between(segment, begin, h, used, x, curve, stages, rtol, atol):
    """Return the error of a step's dense output between its stages, over what is allowed: what is left of the equations.

    The stages see nothing of what happens between them. What is left, d, is an error of (1 - r J)^-1 d, with the
    Jacobian J and `SHARE` of the step's length in time, r: a fast state is off by d / (r J) only.
    begin: clustered time at the start of the step, -1 where the step's variable is the time itself. curve: (7 n,).
    """
    outlined()
    n, frame, out, matrix, left, worst = segment.n, stages.frame, stages.out, stages.matrix, stages.column, 0.0
    shares = numbers_at(segment.functions[SHARES])
    for k in range(len(PROBES)):
        fraction, rate = PROBES[k], h * segment.duration
        if begin >= 0.0:
            time = begin + fraction * h
            rate *= 6.0 * time * (1.0 - time)
        dense_value(curve, 0, n, x, 0, fraction, frame)
        dense_slope(curve, 0, n, fraction, left)
        for e in range(n * n):
            frame[n + e] = 1.0 if e % (n + 1) == 0 else 0.0
        call(segment.functions[VARY], segment.mode, n, frame, 0, segment.p, out, 0)
        for a in range(n):
            left[a] -= rate * out[a]
            for b in range(n):
                matrix[a * n + b] = (1.0 if a == b else 0.0) - SHARE * rate * out[n + a * n + b]
        if not factorise(matrix, n, stages.scales, stages.pivots):
            return math.inf
        substitute(stages, n, left)
        for e in range(used):
            top = max(max(abs(x[e]), abs(x[e] + curve[e])), abs(frame[e]))
            error = abs(left[e]) / (PASSED * allowed(shares[e], top, rtol, atol))
            if not error <= worst:
                worst = error
    return worst


@njit(**INNER)
def error_of(segment, begin, h, used, x, stages, rtol, atol):
    """Return the error of a step over its tolerance: its roughness, what it passed over, or growth it does not resolve.

    An implicit step over growth by many factors e would damp it, and stay where every motion nearby leaves.
    begin: as in `error_between`.
    """
    n, longest = segment.n, 0.0
    error = roughness(n, used, x, stages.increments, (rtol, atol), numbers_at(segment.functions[SHARES]))
    if not error <= 1.0:
        return error
    curve = pointer(stages.matrix, n * n)
    dense_increments(n, stages.increments, curve)
    error = max(error, error_between(segment, begin, h, used, x, curve, stages, rtol, atol))
    if not error <= 1.0:
        return error
    for i in range(STAGES):
        longest = max(longest, abs(stages.rates[i]))
    end = stages.column
    for e in range(n):
        end[e] = x[e] + stages.increments[(STAGES - 1) * n + e]
    fastest = max(rate_at(segment, x, stages), rate_at(segment, end, stages))
    return max(error, (abs(h) * longest * fastest / GROWN) ** 8)


@njit(**INNER)
def varied_stages(segment, forced, h, y, stages, moved, slope):
    """Write the sensitivities of a step's stages in `moved`, (columns, 7 n); the matrix is factorised where they are.

    slope: scratch, (n,).
    """
    outlined()
    n, columns, states = segment.n, forced.columns, forced.states
    size = STAGES * n
    for i in range(STAGES):
        for c in range(columns):
            for e in range(n):
                moved[c * size + i * n + e] = y[n + e * columns + c]
    for j in range(STAGES):
        for e in range(n):
            stages.frame[e] = y[e] + stages.increments[j * n + e]
        for c in range(states, columns):
            longer = stages.weights[j] * forced.longer[c - states]
            for e in range(n):
                slope[e] = 0.0
            if c < states + forced.n_active:
                call(
                    segment.functions[FIELD_P],
                    segment.mode,
                    forced.active[c - states],
                    stages.frame,
                    0,
                    segment.p,
                    slope,
                    0,
                )
            for e in range(n):
                slope[e] = stages.rates[j] * slope[e] + longer * stages.slopes[j * n + e]
            for i in range(STAGES):
                weight = h * A[i * STAGES + j]
                for e in range(n):
                    moved[c * size + i * n + e] += weight * slope[e]
    for c in range(columns):
        substitute(stages, size, pointer(moved, c * size))
