"""How far exponents go within a Runge-Kutta step, whose stages a pulse may lie between."""

from __future__ import annotations

import numpy as np
from numba import int64

from saltus.flow.kernels.stages import dense_value
from saltus.system.compiled import FUNCTIONS
from saltus.system.numba_tools.machine_code import njit
from saltus.system.numba_tools.pointers import INNER, call, outlined, pointer

WAYS = FUNCTIONS.index("ways")
JUMP = 1e-10  # step, over the segment or the time since the last event, up to which an exponent that goes too far jumps
PLACES = 4  # equal parts of a step, in each of which an exponent may go as far as `system.exponents` says


@njit(**INNER)
def longest_way(way, mode, n, p, dense, x):
    """Longest way of an exponent in a part of a step, over what is allowed; 0 without exponents.

    way: address of the generated function, 0 for none; dense: coefficients from x on, (7 n,).
    """
    outlined()
    if way == 0:
        return 0.0
    scratch = np.empty(2 * n + 1)
    both, found = pointer(scratch, 0), pointer(scratch, 2 * n)
    after = pointer(both, n)
    for e in range(n):
        both[e] = x[e]
    longest = 0.0
    for k in range(1, PLACES + 1):
        dense_value(dense, int64(0), n, x, int64(0), k / PLACES, after)
        call(way, mode, 0, both, 0, p, found, 0)
        if found[0] > longest:  # nan tells nothing
            longest = found[0]
        for e in range(n):
            both[e] = after[e]
    return longest
