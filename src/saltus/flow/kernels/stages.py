"""Compiled steps shared by every flow: Runge-Kutta stages, error estimate, dense output."""

from __future__ import annotations

import math

from numba import float64

from saltus.flow import tableaux
from saltus.flow.kernels.shares import allowed
from saltus.scales import SMALLEST
from saltus.system.numba_tools.machine_code import njit
from saltus.system.numba_tools.pointers import INNER, apart, outlined, pointer, stack

E3 = tuple(tableaux.ERROR_3.tolist())  # weights of the stages in the error estimate of order 3
E5 = tuple(tableaux.ERROR_5.tolist())  # weights of the stages in the error estimate of order 5
A = tableaux.COEFFICIENTS.ravel()  # weights of earlier stages in each stage, (16 * 16,)
D = tableaux.INTERPOLATION.ravel()  # weights of all stages in the dense output's last coefficients, (4 * 16,)


@njit(**INNER)
def stage(i, slopes, n, h, x, out):
    """Write x + h sum_j a_ij slopes_j into `out`: the argument of stage `i`, the end of the step for 12.

    x, out: (n,); slopes: (16 * n,), one stage after the other.
    """
    apart()
    # the weights that are not zero, but for the first, are among the last 2, 5, 8 or 10; one loop for each of these
    w0, s, x, out = A[16 * i], pointer(slopes, 0), pointer(x, 0), pointer(out, 0)
    if i == 1:
        for e in range(n):
            out[e] = x[e] + h * (w0 * s[e])
    elif i < 6:
        w, t = pointer(A, 17 * i - 2), pointer(slopes, (i - 2) * n)
        w1, w2 = 0.0 if i == 2 else w[0], w[1]
        for e in range(n):
            out[e] = x[e] + h * (w0 * s[e] + w1 * t[e] + w2 * t[n + e])
    elif i < 9:
        w, t = pointer(A, 17 * i - 5), pointer(slopes, (i - 5) * n)
        w1, w2, w3, w4, w5 = w[0], w[1], w[2], w[3], w[4]
        for e in range(n):
            out[e] = x[e] + h * (
                w0 * s[e] + w1 * t[e] + w2 * t[n + e] + w3 * t[2 * n + e] + w4 * t[3 * n + e] + w5 * t[4 * n + e]
            )
    elif i < 14:
        w, t = pointer(A, 17 * i - 8), pointer(slopes, (i - 8) * n)
        w1, w2, w3, w4, w5, w6, w7, w8 = w[0], w[1], w[2], w[3], w[4], w[5], w[6], w[7]
        for e in range(n):
            out[e] = x[e] + h * (
                w0 * s[e] + w1 * t[e] + w2 * t[n + e] + w3 * t[2 * n + e] + w4 * t[3 * n + e] + w5 * t[4 * n + e]
                + w6 * t[5 * n + e] + w7 * t[6 * n + e] + w8 * t[7 * n + e]
            )  # fmt: skip
    else:
        w, t = pointer(A, 17 * i - 10), pointer(slopes, (i - 10) * n)
        for e in range(n):
            total = w0 * s[e]
            for j in range(10):
                total += w[j] * t[j * n + e]
            out[e] = x[e] + h * total


@njit(**INNER)
def state_error(slopes, n, used, h, x, x_end, tolerances, shares):
    """Error of a step over its tolerance, from the estimates of order 5 and 3; the first `used` of n components count.

    tolerances: relative and absolute. shares: of each component in the absolute one, (used,); a component without a share
    is measured by its own size, one with a negative share by that of all with the same share. An
    angle counts half a turn at most.
    """
    outlined()
    rtol, atol = tolerances
    fives = stack(float64, 3 * used)
    threes, scales = pointer(fives, used), pointer(fives, 2 * used)
    for e in range(used):
        scales[e] = allowed(shares[e], max(abs(x[e]), abs(x_end[e])), rtol, atol)
        if shares[e] < 0.0:
            size = max(group_size(shares, used, e, x), group_size(shares, used, e, x_end))
            scales[e] = SMALLEST + rtol * size
    _estimates(slopes, n, used, scales, fives, threes)
    return _norm(used, h, fives, threes)


@njit(**INNER)
def group_size(shares, used, e, x):
    """Size of the largest component with the share of `e`."""
    outlined()
    size = 0.0
    for other in range(used):
        if shares[other] == shares[e]:
            size = max(size, abs(x[other]))
    return size


@njit(**INNER)
def error_norm(slopes, n, first, used, h, x, x_end, rtol, atol):
    """Error of a step over its tolerance as in `state_error`; `used` components from `first` on count, all alike."""
    outlined()
    fives = stack(float64, 3 * used)
    threes, scales, x, x_end = pointer(fives, used), pointer(fives, 2 * used), pointer(x, first), pointer(x_end, first)
    for e in range(used):
        scales[e] = atol + rtol * max(abs(x[e]), abs(x_end[e]))
    _estimates(pointer(slopes, first), n, used, scales, fives, threes)
    return _norm(used, h, fives, threes)


@njit(**INNER)
def error_in_units(slopes, length, n, columns, h, units):
    """Error of a step as in `error_norm`, of vectors in the columns of (n, columns), in units of the components.

    slopes: where those of the vectors begin; length: from one stage to the next.
    """
    outlined()
    used = n * columns
    fives = stack(float64, 3 * used)
    threes, scales = pointer(fives, used), pointer(fives, 2 * used)
    for e in range(n):
        for c in range(columns):
            scales[e * columns + c] = units[e]
    _estimates(slopes, length, used, scales, fives, threes)
    return _norm(used, h, fives, threes)


@njit(**INNER)
def _norm(used, h, fives, threes):
    """Error of a step from its estimates."""
    five = three = 0.0
    for e in range(used):
        five += fives[e] * fives[e]
        three += threes[e] * threes[e]
    both = five + 0.01 * three  # 0 too where squares of tiny errors underflow
    return 0.0 if both == 0.0 else abs(h) * five / math.sqrt(both * used)


@njit(**INNER)
def _estimates(slopes, n, used, scales, fives, threes):
    """Write the estimates of order 5 and 3 of `used` components, over their tolerances: a loop that vectorises."""
    apart()
    for e in range(used):
        fives[e] = (
            E5[0] * slopes[e]
            + E5[5] * slopes[5 * n + e]
            + E5[6] * slopes[6 * n + e]
            + E5[7] * slopes[7 * n + e]
            + E5[8] * slopes[8 * n + e]
            + E5[9] * slopes[9 * n + e]
            + E5[10] * slopes[10 * n + e]
            + E5[11] * slopes[11 * n + e]
        ) / scales[e]
        threes[e] = (
            E3[0] * slopes[e]
            + E3[5] * slopes[5 * n + e]
            + E3[6] * slopes[6 * n + e]
            + E3[7] * slopes[7 * n + e]
            + E3[8] * slopes[8 * n + e]
            + E3[9] * slopes[9 * n + e]
            + E3[10] * slopes[10 * n + e]
            + E3[11] * slopes[11 * n + e]
        ) / scales[e]


@njit(**INNER)
def dense_coefficients(slopes, n, h, x, x_end, out):
    """Write the coefficients of the dense output of a step, (7 * n,); all sixteen stages are there."""
    apart()
    s, x, x_end, out = pointer(slopes, 0), pointer(x, 0), pointer(x_end, 0), pointer(out, 0)
    for e in range(n):
        delta = x_end[e] - x[e]
        out[e] = delta
        out[n + e] = h * s[e] - delta
        out[2 * n + e] = 2.0 * delta - h * (s[12 * n + e] + s[e])
    for row in range(4):
        w = pointer(D, 16 * row)
        for e in range(n):
            total = w[0] * s[e]
            for j in range(5, 16):
                total += w[j] * s[j * n + e]
            out[(3 + row) * n + e] = h * total


@njit(**INNER)
def dense_value(dense, at, n, x, x_at, fraction, out):
    """Write the state at a fraction of a step into `out`, (n,); coefficients and start of the step at their offsets."""
    other = 1.0 - fraction
    for e in range(n):
        c = at + e
        y = dense[c + 6 * n] * fraction
        y = (y + dense[c + 5 * n]) * other
        y = (y + dense[c + 4 * n]) * fraction
        y = (y + dense[c + 3 * n]) * other
        y = (y + dense[c + 2 * n]) * fraction
        y = (y + dense[c + n]) * other
        y = (y + dense[c]) * fraction
        out[e] = x[x_at + e] + y


@njit(**INNER)
def dense_slope(dense, at, n, fraction, out):
    """Write the derivative of the dense output with respect to the fraction of the step into `out`, (n,)."""
    other = 1.0 - fraction
    for e in range(n):
        c = at + e
        y = slope = 0.0
        for k in range(6, -1, -1):
            y += dense[c + k * n]
            if k % 2 == 0:
                slope = slope * fraction + y
                y *= fraction
            else:
                slope = slope * other - y
                y *= other
        out[e] = slope
