"""Sensitivities to states that stay at 0, kept within numbers: a power of a vast number is taken out of each."""

import math

from saltus.system.numba_tools.machine_code import njit
from saltus.system.numba_tools.pointers import INNER, outlined

VAST = 2.0**500  # sensitivity to a state that stays at 0, from which on its size is kept apart: squares are numbers


@njit(**INNER)
def rescaled(n, columns, x0, y, slopes, powers):
    """Keep sensitivities to states that stay at exactly 0 within numbers: a power of `VAST` is taken out of each.

    Nothing else depends on such a state: zero is an invariant plane, and its own factor may be beyond all numbers.
    powers: (n,), of each; returns whether any is there.
    """
    outlined()
    any_scaled = False
    for c in range(n):
        if x0[c] == 0.0 and y[c] == 0.0:
            size = 0.0
            for e in range(n):
                size = max(size, abs(y[n + e * columns + c]))
            by = 1.0
            if size > VAST:
                by, powers[c] = 1.0 / VAST, powers[c] + 1.0
            elif powers[c] > 0.0 and size < 1.0:
                by, powers[c] = VAST, powers[c] - 1.0
            if by != 1.0:
                for e in range(n):
                    y[n + e * columns + c] *= by
                    slopes[n + e * columns + c] *= by
        any_scaled = any_scaled or powers[c] > 0.0
    return any_scaled


@njit(**INNER)
def unscaled(n, columns, y, powers):
    """Put back the powers that `rescaled` has taken out; a sensitivity beyond `VAST` is that of its state alone, `VAST`."""
    outlined()
    for c in range(n):
        if powers[c] > 0.0:
            own = y[n + c * columns + c]
            size = math.log(abs(own)) + powers[c] * math.log(VAST) if own != 0.0 else 0.0
            for e in range(n):
                at = n + e * columns + c
                if size < math.log(VAST):
                    y[at] *= VAST
                else:
                    y[at] = math.copysign(VAST, own) if e == c else 0.0
