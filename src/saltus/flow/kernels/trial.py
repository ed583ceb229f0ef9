"""Compiled trials of steps of a motion, explicit or implicit, and their dense output."""

from __future__ import annotations

import math

from saltus.flow.kernels.implicit_step import REACH
from saltus.flow.kernels.stages import state_error
from saltus.flow.kernels.state import GUESSED
from saltus.flow.kernels.step import FIELD, dense_output, full_step, step_factor
from saltus.scales import SMALLEST
from saltus.system.compiled import SHARES
from saltus.system.numba_tools.machine_code import njit
from saltus.system.numba_tools.pointers import INNER, PART, call, invoke, numbers_at, outlined


@njit(**INNER)
def _keeps_signs(shares, used, x, x_end):
    """Whether no state that stays on its side of 0 has crossed it in a step; one below all doubles is 0 from there on."""
    outlined()
    for e in range(used):
        if shares[e] == 0.0:
            if abs(x_end[e]) < SMALLEST:
                x_end[e] = 0.0
            elif x_end[e] * math.copysign(1.0, x[e]) < 0.0:
                return False
    return True


@njit(**PART)
def attempt(system, tolerances, state, mode, stride, room):
    """Take a step to `room.x_end`: whether it is accepted, its error and the next step over this one."""
    addresses, n, p, h, slopes, x_end = system.addresses, system.n, system.p, stride.h, state.slopes, room.x_end
    if tolerances.attempt == 0:
        full_step(addresses, mode, n, p, h, state.x, slopes, room.y, x_end)
        errors = tolerances.rtol, tolerances.atol
        error = state_error(slopes, n, system.n_states, h, state.x, x_end, errors, numbers_at(addresses[SHARES]))
        factor = step_factor(error, h, state.numbers)
    else:
        before, state.numbers[GUESSED] = state.numbers[GUESSED], 0.0
        error = invoke(
            tolerances.attempt,
            (addresses, mode, n, p, system.n_states, h, before, state.x, tolerances.rtol, tolerances.atol, x_end,
             state.guess),
        )  # fmt: skip
        factor = min(REACH, step_factor(error, h, state.numbers))
    accepted = error <= 1.0 and _keeps_signs(numbers_at(addresses[SHARES]), system.n_states, state.x, x_end)
    if accepted:
        if stride.wraps:
            x_end[n - 1] = system.turn
        call(addresses[FIELD], mode, 0, x_end, 0, p, slopes, 12 * n)
        for e in range(n):
            accepted = accepted and abs(slopes[12 * n + e]) < math.inf
    if not accepted and (not error >= 0.0 or error <= 1.0 or error == math.inf):
        factor = 0.2
    return accepted, error, factor


@njit(**INNER)
def step_to(system, within, state, mode, h, dt, room):
    """Take a part `dt` of a step of length h to `room.landing`."""
    outlined()
    if within == 0:
        full_step(system.addresses, mode, system.n, system.p, dt, state.x, room.trial, room.y, room.landing)
    else:
        invoke(within, (system.addresses, mode, system.n, system.p, dt, h, state.x, room.landing, state.guess))


@njit(**INNER)
def interpolant(system, tolerances, state, mode, h, x_end, slopes, guess, room, dense):
    """Write the dense output of a step, or a part of one, that has just been taken to `x_end`.

    slopes: those of an explicit step; guess: where an implicit one has left its dense output.
    """
    outlined()
    n, x = system.n, state.x
    if tolerances.attempt == 0:
        dense_output(system.addresses, mode, n, system.p, h, x, x_end, slopes, room.y, dense)
        return
    for e in range(7 * n):
        dense[e] = guess[e]
    for e in range(n):  # the end may have been moved to a surface, or the phase's wrap
        dense[e] = x_end[e] - x[e]
