"""Compiled polynomials of a Taylor step: how long it is, values of its columns, their roots: docs/theory/series.md."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from numba import float64, int64

from saltus.flow.kernels.polynomial import ROOTS, bernstein_roots, variations
from saltus.flow.kernels.shares import allowed, size_of
from saltus.flow.kernels.state import EPSILON
from saltus.system.numba_tools.bits import bits_of, float_of
from saltus.system.numba_tools.machine_code import njit
from saltus.system.numba_tools.pointers import INNER, outlined, pointer

LONGEST_STEP = 4.0  # longest way of a step at its start's speed, in units of 1 + the state's size
ONE_BITS = 1023.0 * 2.0**52  # bits of the float 1.0, read as an integer
SQUARE_ROOT = 1e-8  # relative Newton correction after which the root has all digits, as each step doubles them
SUMS: dict[str, Any] = {**INNER, "fastmath": {"contract", "reassoc", "nsz", "arcp"}}  # sums in any order


class Columns(NamedTuple):
    """The series of a step, and room for the work on one of them: pointers.

    Parameters
    ----------
    c : float64 pointer, (order + 1, stride)
        Coefficients: states, w and the time or nothing, then the mode's event functions.
    order, stride : int
        Last coefficient; columns.
    binomials : float64 pointer
        See `taylor.bernstein_table`.
    b, work, pieces : float64 pointer
        A polynomial's coefficients, twice; pieces of the interval.
    """

    c: Any
    order: int
    stride: int
    binomials: Any
    b: Any
    work: Any
    pieces: Any


@njit(**INNER)
def _root(value, n):
    """About value^(-1/n), within 4 %: the bits of a float, as an integer, are about its logarithm."""
    return float_of(int64(ONE_BITS * (1.0 + 1.0 / n) - float64(bits_of(value + 1e-300)) / n))


@njit(**INNER)
def step_length(c, order, stride, m, first_event, last_event, tolerances, shares, states):
    """Length at which neither of the last two terms of a column is above its tolerance; nan: none.

    The first m columns are measured by their own sizes, the event columns by the size of the state. Where the last terms
    vanish, the step is limited by `LONGEST_STEP`. tolerances: relative and absolute. shares: of the first `states` columns
    in the absolute one.
    """
    outlined()
    rtol, atol = tolerances
    last = last_but_one = size = slope = total = 0.0
    a, b, first = pointer(c, order * stride), pointer(c, (order - 1) * stride), pointer(c, stride)
    for e in range(m):
        share = shares[e] if e < states else 1.0
        own = size_of(share, c[e])
        weight = 1.0 / allowed(share, own, rtol, atol)
        last = max(last, abs(a[e]) * weight)
        last_but_one = max(last_but_one, abs(b[e]) * weight)
        total += a[e] + b[e]
        size, slope = max(size, own), max(slope, abs(first[e]))
    weight = 1.0 / (atol + rtol * size)
    for e in range(first_event, last_event):
        last = max(last, abs(a[e]) * weight)
        last_but_one = max(last_but_one, abs(b[e]) * weight)
        total += a[e] + b[e]
    if not abs(total) < math.inf:
        return math.nan
    return min(min(_root(last, order), _root(last_but_one, order - 1)), LONGEST_STEP * (1.0 + size) / slope)


@njit(**INNER)
def shortened(c, order, stride, ways, h):
    """A step in which no exponent goes further than it may: coefficients of exponents are in column `ways`."""
    for k in range(1, order + 1):
        h = min(h, _root(c[k * stride + ways], k))
    return h


@njit(**SUMS)
def evaluate(c, order, stride, m, h, out):
    """Value of the first m columns at h."""
    last = pointer(c, order * stride)
    for e in range(m):
        out[e] = last[e]
    for i in range(order - 1, -1, -1):
        row = pointer(c, i * stride)
        for e in range(m):
            out[e] = out[e] * h + row[e]


@njit(**SUMS)
def column_value(c, order, stride, column, h):
    """Value and derivative of one column at h."""
    value, slope = c[order * stride + column], 0.0
    for i in range(order - 1, -1, -1):
        slope = slope * h + value
        value = value * h + c[i * stride + column]
    return value, slope


@njit(**INNER)
def reached(c, order, stride, column, target, low, high, guess):
    """Where in [low, high] a column passes a value, once, by Newton's method kept in bounds."""
    outlined()
    rises = column_value(c, order, stride, column, high)[0] >= target
    s = guess
    for _ in range(100):
        value, slope = column_value(c, order, stride, column, s)
        value -= target
        if value == 0.0:
            return s
        if (value > 0.0) == rises:
            high = s
        else:
            low = s
        new = s - value / slope
        if not low < new < high:
            new = 0.5 * (low + high)
        if abs(new - s) <= 2.0 * EPSILON * new:
            return new
        s = new
    return s


@njit(**SUMS)
def _terms(c, order, stride, column, h, first, b):
    """Write the coefficients of a column over h^first into b, in fractions of h.

    Returns four sums: of the coefficients' sizes from order 1 on; of sizes from order 4 on; of sizes times orders from
    order 2 on; of all coefficients but that of order 0.
    """
    power = h if first == 1 else 1.0
    size = tail = weighted = end = 0.0
    for i in range(order + 1 - first):
        value = c[(i + first) * stride + column] * power
        power *= h
        b[i] = value
        value_size = abs(value)
        if i > 0:
            size += value_size
            end += value
        if i > 1:
            weighted += i * value_size
        if i > 3:
            tail += value_size
    return size, tail, weighted, end


@njit(**SUMS)
def _to_bernstein(b, degree, table, width):
    """Turn the coefficients of powers into Bernstein's, in place: row i of the table holds C(i, j) / C(degree, j)."""
    for i in range(degree, -1, -1):
        total = 0.0
        row = pointer(table, i * width)
        for j in range(i + 1):
            total += row[j] * b[j]
        b[i] = total


@njit(**INNER)
def roots(columns, column, h, on, side, direction, found):
    """Roots of an event column in (0, h], as fractions of h, in order: (count, side before the first).

    on: the column is zero at 0, and that root is divided out. side: sign of the function before, 0 where it is not
    known. The count is -1 where the motion may stay on the surface, or has too many roots.
    Where the first root is an event by its direction and easily found, no other is sought; the last place in `found` is
    then 1.
    """
    outlined()
    c, order, stride = columns.c, columns.order, columns.stride
    b, work = columns.b, columns.work
    found[ROOTS - 1] = 0.0
    first = 1 if on else 0
    degree = order - first
    size, tail, weighted, end = _terms(c, order, stride, column, h, first, b)
    b0, b1 = b[0], b[1]
    end += b0
    count = 0
    if on:
        if not abs(b0) > 1e-9 * size:
            return -1, side
        leaves = 1 if b0 > 0.0 else -1
        if side != 0 and leaves != side:
            return -1, side
        side = leaves
    else:
        now = 1 if b0 > 0.0 else (-1 if b0 < 0.0 else side)
        if side == 0:
            side = now
        if now != side:
            # the start of this step is past a zero that the last one did not reach, to rounding
            found[0] = 0.0
            count = 1
    if abs(b0) > size:
        return count, side
    if abs(b1) > weighted:
        # monotone: one root or none
        if b0 * end <= 0.0 and b0 != 0.0:
            found[count] = _passed(b, degree, end)
            count += 1
        return count, side
    if b0 * end < 0.0 and count == 0 and (direction == 0 or direction == -side):
        root = _passed(b, degree, end)
        bent, power = 0.0, root
        for i in range(2, degree + 1):
            bent += i * abs(b[i]) * power
            power *= root
        if abs(b1) > bent:
            # monotone as far as this root
            found[0], found[ROOTS - 1] = root, 1.0
            return 1, side
    # the cubic part lies within its Bernstein coefficients, all of it within the sizes of the others
    sign = 1.0 if b0 > 0.0 else -1.0
    least = min(min(b0 * sign, (b0 + b1 / 3.0) * sign),
                min((b0 + (2.0 * b1 + b[2]) / 3.0) * sign, (b0 + b1 + b[2] + b[3]) * sign))  # fmt: skip
    if least > tail:
        return count, side
    for i in range(degree + 1):
        work[i] = b[i]
    _to_bernstein(b, degree, pointer(columns.binomials, first * (order + 1) * (order + 1)), order + 1)
    changes, _first, _last = variations(b, degree)
    if changes == 0:
        return count, side
    if changes == 1:
        found[count] = _passed(work, degree, end)
        return count + 1, side
    count = bernstein_roots(b, degree, 1e-15 * (abs(b0) + size), 0.0, 1.0, columns.pieces, work, found, count)
    return count, side


@njit(**INNER)
def _passed(b, degree, end):
    """The one place in (0, 1) where a polynomial changes sign, from its coefficients of powers and its value at 1."""
    outlined()
    b0, b1, b2 = b[0], b[1], b[2]
    inside = b1 * b1 - 4.0 * b0 * b2
    s = -2.0 * b0 / (b1 + math.copysign(math.sqrt(inside), b1)) if inside >= 0.0 else 0.5
    if not 0.0 < s < 1.0:
        s = b0 / (b0 - end) if b0 * end < 0.0 else 0.5
    low, high = 0.0, 1.0
    for _ in range(100):
        value, slope = column_value(b, degree, 1, 0, s)
        if value * b0 > 0.0:
            low = s
        else:
            high = s
        new = s - value / slope
        if not low <= new <= high:
            new = 0.5 * (low + high)
        elif abs(new - s) <= SQUARE_ROOT * new:
            # Newton's method doubles the digits
            return new
        s = new
    return s
