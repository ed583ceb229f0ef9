"""Compiled implicit steps of a motion, called by their addresses, and compiled where a motion is stiff."""

from __future__ import annotations

import math

import numpy as np
from numba import float64, int64

from saltus.flow.kernels.implicit_step import (
    LAST,
    NUMBERS,
    STAGES,
    SYSTEM,
    Forced,
    dense_increments,
    error_of,
    guessed,
    laid_out,
    linearised,
    room_for,
    solved,
    taken,
    varied_stages,
)
from saltus.flow.kernels.segment import Segment
from saltus.system.numba_tools.machine_code import cfunc, njit
from saltus.system.numba_tools.pointers import INNER, keep, pointer


@njit(**INNER)
def _stages_in_time(block, pivots, n):
    """Return the scratch of a step whose variable is the time, laid out as by `laid_out`."""
    stages = laid_out(block, pivots, n)
    for i in range(STAGES):
        stages.rates[i] = 1.0
    return stages


@cfunc(float64(*SYSTEM, int64, float64, float64, NUMBERS, float64, float64, NUMBERS, NUMBERS), error_model="numpy")
def attempt(functions, mode, n, p, n_states, h, before, x, rtol, atol, x_end, guess):
    """Take a step of a motion to `x_end`; return its error, infinite where its equations are not solved.

    guess: (7 n,), the dense output of the step before, of length `before`, 0 for none; that of this step is left.
    """
    segment = Segment(functions, mode, 1.0, p, n)
    block, pivots = np.empty(room_for(n)), np.empty(STAGES * n, np.int64)
    stages, error = _stages_in_time(pointer(block, 0), pointer(pivots, 0), n), math.inf
    for e in range(STAGES * n):
        stages.guess[e] = guess[e]
    if taken(segment, h, before, x, stages):
        error = error_of(segment, -1.0, h, n_states, x, stages, rtol, atol)
        dense_increments(n, stages.increments, guess)
        for e in range(n):
            x_end[e] = x[e] + stages.increments[(STAGES - 1) * n + e]
    keep(block)
    keep(pivots)
    return error


@cfunc(float64(*SYSTEM, float64, float64, float64, NUMBERS, int64, NUMBERS, NUMBERS, NUMBERS), error_model="numpy")
def carry(functions, mode, n, p, h, whole, begun, guess, columns, y, weights, rough):
    """Take a part `h` of a step of a motion with a frame, from y to what follows it; return whether it is solved.

    Both are (n + n columns,).

    The part begins at `begun` of the step's length `whole`; guess: (7 n,), the step's dense output. What the polynomial
    of highest degree adds to each column is left in `rough`, (columns,), in units 1/weights of the components.
    """
    segment, trial = Segment(functions, mode, 1.0, p, n), pointer(y, n * (1 + columns))
    size = STAGES * n
    block, pivots = np.empty(room_for(n) + size * columns + n), np.empty(size, np.int64)
    stages = _stages_in_time(pointer(block, 0), pointer(pivots, 0), n)
    moved, slope = pointer(block, room_for(n)), pointer(block, room_for(n) + size * columns)
    guessed(n, guess, whole, begun, h, stages)
    done = solved(segment, h, y, stages) and linearised(segment, h, y, stages)
    if done:
        varied_stages(segment, Forced(columns, columns, functions, 0, p), h, y, stages, moved, slope)
        for e in range(n):
            trial[e] = y[e] + stages.increments[(STAGES - 1) * n + e]
        for c in range(columns):
            rough[c] = 0.0
            for e in range(n):
                first, last = y[n + e * columns + c], 0.0
                for i in range(STAGES):
                    last += LAST[i] * (moved[(c * STAGES + i) * n + e] - first)
                rough[c] = max(rough[c], abs(last * weights[e]))
                trial[n + e * columns + c] = moved[(c * STAGES + STAGES - 1) * n + e]
    keep(block)
    keep(pivots)
    return 1.0 if done else 0.0


@cfunc(float64(*SYSTEM, float64, float64, NUMBERS, NUMBERS, NUMBERS), error_model="numpy")
def within(functions, mode, n, p, h, whole, x, x_end, guess):
    """Take a part `h` of a step of length `whole`, whose dense output is the first half of `guess`, to `x_end`.

    Its own dense output is left in the second half of `guess`, (14 n,).
    """
    segment = Segment(functions, mode, 1.0, p, n)
    block, pivots = np.empty(room_for(n)), np.empty(STAGES * n, np.int64)
    stages = _stages_in_time(pointer(block, 0), pointer(pivots, 0), n)
    guessed(n, guess, whole, 0.0, h, stages)
    if not solved(segment, h, x, stages):  # the step's own dense output is as exact as its tolerance
        guessed(n, guess, whole, 0.0, h, stages)
    dense_increments(n, stages.increments, pointer(guess, STAGES * n))
    for e in range(n):
        x_end[e] = x[e] + stages.increments[(STAGES - 1) * n + e]
    keep(block)
    keep(pivots)
    return 0.0
