"""Which of the events of a step comes first: one rule for the flow of Runge-Kutta steps and that of Taylor series."""

from __future__ import annotations

from numba import int64

from saltus.flow.kernels.polynomial import ROOTS
from saltus.system.numba_tools.machine_code import njit
from saltus.system.numba_tools.pointers import PART

NEVER = 2.0  # fraction of a step that stands for an event outside it


@njit(**PART)
def next_crossing(system, crossings, k):
    """The first crossing of event function k, of those not passed, that goes in its direction; their count: none."""
    direction, before, n_found = system.transitions[3 * k + 2], crossings.before[k], crossings.n_found[k]
    for j in range(crossings.passed[k], n_found):
        goes = -before if j % 2 == 0 else before
        if (direction == 0 or direction == goes) and (crossings.jumps[k] >> j) & 1 == 0:
            return j
    return n_found


@njit(**PART)
def first_crossing(system, crossings, mode):
    """The first crossing of a mode's events: the transition (-1: none), its fraction of the step, which of its zeros.

    Of those at the same place it is the first in the definition. The last number is the fraction of the second.
    """
    first, fraction, index, second = int64(-1), NEVER, int64(0), NEVER
    for k in range(system.n_transitions):
        if system.transitions[3 * k] != mode:
            continue
        j = next_crossing(system, crossings, k)
        if j < crossings.n_found[k]:
            at = crossings.found[ROOTS * k + j]
            if at < fraction:
                first, fraction, index, second = k, at, j, fraction
            else:
                second = min(second, at)
    return first, fraction, index, second
