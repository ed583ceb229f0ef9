"""How far exponents and kinks go within a step, whose stages a pulse may lie between."""

from __future__ import annotations

import numpy as np
from numba import int64

from saltus.flow.kernels.stages import dense_value
from saltus.system.compiled import FUNCTIONS
from saltus.system.numba_tools.machine_code import njit
from saltus.system.numba_tools.pointers import INNER, call, keep, outlined, pointer

WAYS = FUNCTIONS.index("ways")
JUMP = 1e-10  # step, over the segment or the time since the last event, up to which an exponent that goes too far jumps
# Ends of parts of a step, in each of which an exponent may go as far as `system.writing.exponents` says; not equal, as a drive
# of a higher harmonic is the same at equal ones.
PLACES = (0.23, 0.47, 0.74, 1.0)


@njit(**INNER)
def longest_way(way, mode, n, p, dense, x):
    """Longest way of an exponent in a part of a step, over what is allowed, or 2 where a kink goes unseen; else 0.

    way: address of the generated function, 0 for none; dense: coefficients from x on, (7 n,).
    """
    outlined()
    if way == 0:
        return 0.0
    scratch = np.empty(3 * n + 1)
    three, found = pointer(scratch, 0), pointer(scratch, 3 * n)
    for e in range(n):
        three[n + e] = x[e]
    dense_value(dense, int64(0), n, x, int64(0), PLACES[0], pointer(three, 2 * n))
    longest = 0.0
    for k in range(1, len(PLACES)):
        for e in range(2 * n):
            three[e] = three[n + e]
        dense_value(dense, int64(0), n, x, int64(0), PLACES[k], pointer(three, 2 * n))
        call(way, mode, 0, three, 0, p, found, 0)
        if found[0] > longest:  # nan tells nothing
            longest = found[0]
    keep(scratch)
    return longest
