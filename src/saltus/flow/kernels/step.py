"""Compiled Runge-Kutta steps: twelve stages, the dense output, how long the first and the next step are."""

from __future__ import annotations

import math

from saltus.flow.kernels.shares import allowed, size_of
from saltus.flow.kernels.stages import dense_coefficients, group_size, stage
from saltus.flow.kernels.state import EPSILON, ERROR_BEFORE, STEP_BEFORE
from saltus.system.compiled import FUNCTIONS, SHARES
from saltus.system.numba_tools.machine_code import njit
from saltus.system.numba_tools.pointers import INNER, call, numbers_at, outlined

FIELD = FUNCTIONS.index("field")

ROUNDING = 64.0 * EPSILON  # rounding of a sum, over the size of its terms


@njit(**INNER)
def full_step(addresses, mode, n, p, h, x, slopes, y, x_end):
    """Twelve stages from x, the first of them known; the end of the step in x_end."""
    outlined()
    for i in range(1, 13):
        stage(i, slopes, n, h, x, y if i < 12 else x_end)
        if i < 12:
            call(addresses[FIELD], mode, 0, y, 0, p, slopes, i * n)


@njit(**INNER)
def dense_output(addresses, mode, n, p, h, x, x_end, slopes, y, dense):
    """Three more stages and the dense output; the slope at the end is known."""
    outlined()
    for i in range(13, 16):
        stage(i, slopes, n, h, x, y)
        call(addresses[FIELD], mode, 0, y, 0, p, slopes, i * n)
    dense_coefficients(slopes, n, h, x, x_end, dense)


@njit(**INNER)
def size_of_terms(gradient, n, size):
    """Size of the terms that a function sums up: its rounding is a small multiple of epsilon of it."""
    total = 0.0
    for e in range(n):
        total += abs(gradient[e]) * size[e]
    return total


@njit(**INNER)
def _scale(shares, used, e, x, rtol, atol):
    """Tolerance of a state at a first step."""
    size = abs(x[e]) if shares[e] >= 0.0 else group_size(shares, used, e, x)
    return atol if size == 0.0 else allowed(max(shares[e], 0.0), size, rtol, atol)


@njit(**INNER)
def first_step(addresses, mode, n, used, p, x, slopes, rtol, atol, y, x_end):
    """A first step (Hairer, Norsett & Wanner 1993, section II.4): an Euler step gives the second derivative.

    A state without a share of the absolute tolerance is measured by its own size, or by that of its group, unless it is 0.
    """
    outlined()
    d0 = d1 = 0.0
    shares = numbers_at(addresses[SHARES])
    for e in range(used):
        scale = _scale(shares, used, e, x, rtol, atol)
        d0 += (size_of(shares[e], x[e]) / scale) ** 2
        d1 += (slopes[e] / scale) ** 2
    d0, d1 = math.sqrt(d0 / used), math.sqrt(d1 / used)
    h = 1e-6 if d0 < 1e-5 or d1 < 1e-5 else 0.01 * d0 / d1
    for e in range(n):
        y[e] = x[e] + h * slopes[e]
    call(addresses[FIELD], mode, 0, y, 0, p, x_end, 0)
    d2 = 0.0
    for e in range(used):
        scale = _scale(shares, used, e, x, rtol, atol)
        d2 += ((x_end[e] - slopes[e]) / scale) ** 2
    d2 = math.sqrt(d2 / used) / h
    largest = max(d1, d2)
    if not largest < math.inf:
        return 1e-3 * h
    other = max(1e-6, 1e-3 * h) if largest <= 1e-15 else (0.01 / largest) ** 0.125
    return min(100.0 * h, other)


@njit(**INNER)
def step_factor(error, h, numbers):
    """Next step over this one: predictive where steps shrink towards a steep place (Hairer & Wanner, II, IV.8)."""
    outlined()
    if error < 1e-8:
        return 6.0
    factor = 0.9 * error**-0.125
    if numbers[STEP_BEFORE] > 0.0 and error <= 1.0:
        predicted = 0.9 * h / numbers[STEP_BEFORE] * (numbers[ERROR_BEFORE] / (error * error)) ** 0.125
        factor = min(factor, predicted)
    return min(6.0, max(0.2, factor))
