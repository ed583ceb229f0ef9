"""Sensitivities to states that stay at 0: their own relative error, and powers of a vast number taken out of each.

Zero is an invariant plane of such a state. What it would grow by there is a factor of the flow across the plane: it may
fall to 1e-10 within a period and come back to 1, or grow beyond all numbers.
"""

import math

from saltus.flow.kernels.stages import error_norm
from saltus.scales import SMALLEST
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


@njit(**INNER)
def any_alone(n, x0, shares):
    """Return whether a state that is measured by its own size is 0; shares: see `state_error`."""
    outlined()
    found = False
    for c in range(n):
        found = found or (x0[c] == 0.0 and shares[c] == 0.0)
    return found


@njit(**INNER)
def own_error(n, columns, x0, shares, step, tolerance):
    """Largest error of a step in the factors by which states at 0 would grow, over `tolerance` of these.

    step: (slopes, length, h, y, trial), as in `saltus.flow.kernels.segment.flow`.
    """
    outlined()
    slopes, length, h, y, trial = step
    largest = 0.0
    for c in range(n):
        if x0[c] == 0.0 and trial[c] == 0.0 and shares[c] == 0.0:
            at = n + c * columns + c
            largest = max(largest, error_norm(slopes, length, at, 1, h, y, trial, tolerance, SMALLEST))
    return largest
