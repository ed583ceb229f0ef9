"""Compiled steps shared by every flow: calls by address, Runge-Kutta stages, error estimate, dense output."""

from __future__ import annotations

import math

from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic

from saltus.flow import tableaux

A = tuple(tuple(row) for row in tableaux.COEFFICIENTS.tolist())
B = tuple(tableaux.WEIGHTS.tolist())
E3 = tuple(tableaux.ERROR_3.tolist())
E5 = tuple(tableaux.ERROR_5.tolist())
D = tuple(tuple(row) for row in tableaux.INTERPOLATION.tolist())


@intrinsic
def call(typingctx, address, k, m, x, x_at, p, out, out_at):
    """Call a generated function by its address, on flat arrays from the given offsets."""
    signature = types.void(types.int64, types.int64, types.int64, x, types.int64, p, out, types.int64)

    def lower(context, builder, signature, arguments):
        address, k, m, x, x_at, p, out, out_at = arguments
        double, integer = ir.DoubleType().as_pointer(), ir.IntType(64)
        kind = ir.FunctionType(ir.VoidType(), [integer, integer, double, double, double])
        pointers = []
        for value, type_, at in (
            (x, signature.args[3], x_at),
            (p, signature.args[5], None),
            (out, signature.args[6], out_at),
        ):
            data = context.make_array(type_)(context, builder, value).data
            pointers.append(data if at is None else builder.gep(data, [at]))
        builder.call(builder.inttoptr(address, kind.as_pointer()), [k, m, *pointers])
        return context.get_dummy_value()

    return signature, lower


@njit(cache=True, error_model="numpy")
def stage(i, slopes, n, h, x, out):
    """Write x + h sum_j a_ij slopes_j into `out`: the argument of stage `i`, the end of the step for 12.

    x, out: (n,); slopes: (16 * n,), one stage after the other.
    """
    if i == 1:
        for e in range(n):
            out[e] = x[e] + h * (A[1][0] * slopes[e])
    elif i == 2:
        for e in range(n):
            out[e] = x[e] + h * (A[2][0] * slopes[e] + A[2][1] * slopes[n + e])
    elif i == 3:
        for e in range(n):
            out[e] = x[e] + h * (A[3][0] * slopes[e] + A[3][2] * slopes[2 * n + e])
    elif i == 4:
        for e in range(n):
            out[e] = x[e] + h * (A[4][0] * slopes[e] + A[4][2] * slopes[2 * n + e] + A[4][3] * slopes[3 * n + e])
    elif i == 5:
        for e in range(n):
            out[e] = x[e] + h * (A[5][0] * slopes[e] + A[5][3] * slopes[3 * n + e] + A[5][4] * slopes[4 * n + e])
    elif i == 6:
        for e in range(n):
            out[e] = x[e] + h * (
                A[6][0] * slopes[e]
                + A[6][3] * slopes[3 * n + e]
                + A[6][4] * slopes[4 * n + e]
                + A[6][5] * slopes[5 * n + e]
            )
    elif i == 7:
        for e in range(n):
            out[e] = x[e] + h * (
                A[7][0] * slopes[e]
                + A[7][3] * slopes[3 * n + e]
                + A[7][4] * slopes[4 * n + e]
                + A[7][5] * slopes[5 * n + e]
                + A[7][6] * slopes[6 * n + e]
            )
    elif i == 8:
        for e in range(n):
            out[e] = x[e] + h * (
                A[8][0] * slopes[e]
                + A[8][3] * slopes[3 * n + e]
                + A[8][4] * slopes[4 * n + e]
                + A[8][5] * slopes[5 * n + e]
                + A[8][6] * slopes[6 * n + e]
                + A[8][7] * slopes[7 * n + e]
            )
    elif i == 9:
        for e in range(n):
            out[e] = x[e] + h * (
                A[9][0] * slopes[e]
                + A[9][3] * slopes[3 * n + e]
                + A[9][4] * slopes[4 * n + e]
                + A[9][5] * slopes[5 * n + e]
                + A[9][6] * slopes[6 * n + e]
                + A[9][7] * slopes[7 * n + e]
                + A[9][8] * slopes[8 * n + e]
            )
    elif i == 10:
        for e in range(n):
            out[e] = x[e] + h * (
                A[10][0] * slopes[e]
                + A[10][3] * slopes[3 * n + e]
                + A[10][4] * slopes[4 * n + e]
                + A[10][5] * slopes[5 * n + e]
                + A[10][6] * slopes[6 * n + e]
                + A[10][7] * slopes[7 * n + e]
                + A[10][8] * slopes[8 * n + e]
                + A[10][9] * slopes[9 * n + e]
            )
    elif i == 11:
        for e in range(n):
            out[e] = x[e] + h * (
                A[11][0] * slopes[e]
                + A[11][3] * slopes[3 * n + e]
                + A[11][4] * slopes[4 * n + e]
                + A[11][5] * slopes[5 * n + e]
                + A[11][6] * slopes[6 * n + e]
                + A[11][7] * slopes[7 * n + e]
                + A[11][8] * slopes[8 * n + e]
                + A[11][9] * slopes[9 * n + e]
                + A[11][10] * slopes[10 * n + e]
            )
    elif i == 12:
        for e in range(n):
            out[e] = x[e] + h * (
                A[12][0] * slopes[e]
                + A[12][5] * slopes[5 * n + e]
                + A[12][6] * slopes[6 * n + e]
                + A[12][7] * slopes[7 * n + e]
                + A[12][8] * slopes[8 * n + e]
                + A[12][9] * slopes[9 * n + e]
                + A[12][10] * slopes[10 * n + e]
                + A[12][11] * slopes[11 * n + e]
            )
    elif i == 13:
        for e in range(n):
            out[e] = x[e] + h * (
                A[13][0] * slopes[e]
                + A[13][6] * slopes[6 * n + e]
                + A[13][7] * slopes[7 * n + e]
                + A[13][8] * slopes[8 * n + e]
                + A[13][9] * slopes[9 * n + e]
                + A[13][10] * slopes[10 * n + e]
                + A[13][11] * slopes[11 * n + e]
                + A[13][12] * slopes[12 * n + e]
            )
    elif i == 14:
        for e in range(n):
            out[e] = x[e] + h * (
                A[14][0] * slopes[e]
                + A[14][5] * slopes[5 * n + e]
                + A[14][6] * slopes[6 * n + e]
                + A[14][7] * slopes[7 * n + e]
                + A[14][10] * slopes[10 * n + e]
                + A[14][11] * slopes[11 * n + e]
                + A[14][12] * slopes[12 * n + e]
                + A[14][13] * slopes[13 * n + e]
            )
    elif i == 15:
        for e in range(n):
            out[e] = x[e] + h * (
                A[15][0] * slopes[e]
                + A[15][5] * slopes[5 * n + e]
                + A[15][6] * slopes[6 * n + e]
                + A[15][7] * slopes[7 * n + e]
                + A[15][8] * slopes[8 * n + e]
                + A[15][12] * slopes[12 * n + e]
                + A[15][13] * slopes[13 * n + e]
                + A[15][14] * slopes[14 * n + e]
            )


@njit(cache=True, error_model="numpy")
def error_norm(slopes, n, first, used, h, x, x_end, rtol, atol):
    """Error of a step over its tolerance, from the estimates of order 5 and 3; `used` components from `first` on count."""
    five = three = 0.0
    for e in range(first, first + used):
        scale = atol + rtol * max(abs(x[e]), abs(x_end[e]))
        a = (
            E5[0] * slopes[e]
            + E5[5] * slopes[5 * n + e]
            + E5[6] * slopes[6 * n + e]
            + E5[7] * slopes[7 * n + e]
            + E5[8] * slopes[8 * n + e]
            + E5[9] * slopes[9 * n + e]
            + E5[10] * slopes[10 * n + e]
            + E5[11] * slopes[11 * n + e]
        ) / scale
        b = (
            E3[0] * slopes[e]
            + E3[5] * slopes[5 * n + e]
            + E3[6] * slopes[6 * n + e]
            + E3[7] * slopes[7 * n + e]
            + E3[8] * slopes[8 * n + e]
            + E3[9] * slopes[9 * n + e]
            + E3[10] * slopes[10 * n + e]
            + E3[11] * slopes[11 * n + e]
        ) / scale
        five += a * a
        three += b * b
    if five == 0.0 and three == 0.0:
        return 0.0
    return abs(h) * five / math.sqrt((five + 0.01 * three) * used)


@njit(cache=True, error_model="numpy")
def dense_coefficients(slopes, n, h, x, x_end, out):
    """Write the coefficients of the dense output of a step, (7 * n,); all sixteen stages are there."""
    for e in range(n):
        delta = x_end[e] - x[e]
        out[e] = delta
        out[n + e] = h * slopes[e] - delta
        out[2 * n + e] = 2.0 * delta - h * (slopes[12 * n + e] + slopes[e])
        out[3 * n + e] = h * (
            D[0][0] * slopes[e]
            + D[0][5] * slopes[5 * n + e]
            + D[0][6] * slopes[6 * n + e]
            + D[0][7] * slopes[7 * n + e]
            + D[0][8] * slopes[8 * n + e]
            + D[0][9] * slopes[9 * n + e]
            + D[0][10] * slopes[10 * n + e]
            + D[0][11] * slopes[11 * n + e]
            + D[0][12] * slopes[12 * n + e]
            + D[0][13] * slopes[13 * n + e]
            + D[0][14] * slopes[14 * n + e]
            + D[0][15] * slopes[15 * n + e]
        )
        out[4 * n + e] = h * (
            D[1][0] * slopes[e]
            + D[1][5] * slopes[5 * n + e]
            + D[1][6] * slopes[6 * n + e]
            + D[1][7] * slopes[7 * n + e]
            + D[1][8] * slopes[8 * n + e]
            + D[1][9] * slopes[9 * n + e]
            + D[1][10] * slopes[10 * n + e]
            + D[1][11] * slopes[11 * n + e]
            + D[1][12] * slopes[12 * n + e]
            + D[1][13] * slopes[13 * n + e]
            + D[1][14] * slopes[14 * n + e]
            + D[1][15] * slopes[15 * n + e]
        )
        out[5 * n + e] = h * (
            D[2][0] * slopes[e]
            + D[2][5] * slopes[5 * n + e]
            + D[2][6] * slopes[6 * n + e]
            + D[2][7] * slopes[7 * n + e]
            + D[2][8] * slopes[8 * n + e]
            + D[2][9] * slopes[9 * n + e]
            + D[2][10] * slopes[10 * n + e]
            + D[2][11] * slopes[11 * n + e]
            + D[2][12] * slopes[12 * n + e]
            + D[2][13] * slopes[13 * n + e]
            + D[2][14] * slopes[14 * n + e]
            + D[2][15] * slopes[15 * n + e]
        )
        out[6 * n + e] = h * (
            D[3][0] * slopes[e]
            + D[3][5] * slopes[5 * n + e]
            + D[3][6] * slopes[6 * n + e]
            + D[3][7] * slopes[7 * n + e]
            + D[3][8] * slopes[8 * n + e]
            + D[3][9] * slopes[9 * n + e]
            + D[3][10] * slopes[10 * n + e]
            + D[3][11] * slopes[11 * n + e]
            + D[3][12] * slopes[12 * n + e]
            + D[3][13] * slopes[13 * n + e]
            + D[3][14] * slopes[14 * n + e]
            + D[3][15] * slopes[15 * n + e]
        )


@njit(cache=True, error_model="numpy")
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


@njit(cache=True, error_model="numpy")
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
