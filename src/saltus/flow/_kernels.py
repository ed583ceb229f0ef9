"""Compiled steps shared by every flow: calls by address, Runge-Kutta stages, error estimate, dense output."""

from __future__ import annotations

import math
from typing import Any

from llvmlite import ir
from numba import types
from numba.core.errors import TypingError
from numba.extending import intrinsic

from saltus.flow import tableaux
from saltus.system.machine_code import njit

# Options of functions that only other kernels call; a function is cached with all that it calls.
INNER: dict[str, Any] = {"error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
PART: dict[str, Any] = {**INNER, "inline": "always"}  # of functions pasted into their callers: that compiles faster
E3 = tuple(tableaux.ERROR_3.tolist())  # weights of the stages in the error estimate of order 3
E5 = tuple(tableaux.ERROR_5.tolist())  # weights of the stages in the error estimate of order 5
A = tableaux.COEFFICIENTS.ravel()  # weights of earlier stages in each stage, (16 * 16,)
D = tableaux.INTERPOLATION.ravel()  # weights of all stages in the dense output's last coefficients, (4 * 16,)


@intrinsic
def apart(typingctx):
    """Declare that no two arguments of the function share memory, so that its loops vectorise without checks of it."""

    def lower(context, builder, signature, arguments):
        for argument in builder.function.args:
            if isinstance(argument.type, ir.PointerType):
                argument.add_attribute("noalias")
        return context.get_dummy_value()

    return types.void(), lower


@intrinsic
def outlined(typingctx):
    """Declare that the function is not to be copied into those that call it, which saves compiling it over and over."""

    def lower(context, builder, signature, arguments):
        builder.function.attributes.add("noinline")
        return context.get_dummy_value()

    return types.void(), lower


def entries(context, builder, type_, value):
    """Where the entries of a contiguous array begin; a pointer is one already."""
    return value if isinstance(type_, types.CPointer) else context.make_array(type_)(context, builder, value).data


@intrinsic
def pointer(typingctx, array, at):
    """Return the address of an entry of a contiguous array, flat, or of what a pointer points to.

    Pointers are what kernels hand to each other: indexing one compiles in half the time, and it is one argument, not
    seven. The array must live on: see `keep`.
    """
    if isinstance(array, types.Array) and array.layout != "C":
        raise TypingError("a pointer needs a contiguous array")
    signature = types.CPointer(array.dtype)(array, types.int64)

    def lower(context, builder, signature, arguments):
        return builder.gep(entries(context, builder, signature.args[0], arguments[0]), [arguments[1]])

    return signature, lower


@intrinsic
def stack(typingctx, kind, count):
    """Return a pointer to `count` numbers of a type, on the stack: for a few states, and never inside a loop."""
    signature = types.CPointer(kind.dtype)(kind, types.int64)

    def lower(context, builder, signature, arguments):
        return builder.alloca(context.get_value_type(signature.return_type.dtype), arguments[1])

    return signature, lower


@intrinsic
def keep(typingctx, array):
    """Do nothing with an array, which lives until here though only pointers to it were used."""

    def lower(context, builder, signature, arguments):
        return context.get_dummy_value()

    return types.void(array), lower


@intrinsic
def call(typingctx, address, k, m, x, x_at, p, out, out_at):
    """Call a generated function by its address, on flat arrays, or pointers, from the given offsets."""
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
            data = entries(context, builder, type_, value)
            pointers.append(data if at is None else builder.gep(data, [at]))
        builder.call(builder.inttoptr(address, kind.as_pointer()), [k, m, *pointers])
        return context.get_dummy_value()

    return signature, lower


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
    both = five + 0.01 * three  # 0 too where squares of tiny errors underflow
    return 0.0 if both == 0.0 else abs(h) * five / math.sqrt(both * used)


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
