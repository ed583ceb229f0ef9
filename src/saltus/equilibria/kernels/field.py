"""A field and its derivatives by the state and by parameters, in one call."""

from __future__ import annotations

import numpy as np

from saltus.system.compiled import FUNCTIONS
from saltus.system.numba_tools.machine_code import njit
from saltus.system.numba_tools.pointers import call, keep, pointer

DERIVE = FUNCTIONS.index("derive")
VARY = FUNCTIONS.index("vary")
FIELD_P = FUNCTIONS.index("field_p")


@njit(cache=True, error_model="numpy")
def field_at(functions, mode, u, p, active, scales, F, J):
    """Write the field F, (n,), and its derivatives J, (n, n + k), at the unknowns u: the state and k parameters.

    p: parameters with the constants behind them; the active ones, (k,), in units of scales, (k,), are written there.
    """
    n = F.size
    block = np.zeros(n * (n + 1) * 2 + n)
    frame, out = pointer(block, 0), pointer(block, n * (n + 1))
    column = pointer(block, 2 * n * (n + 1))
    functions, parameters = pointer(functions, 0), pointer(p, 0)
    for k in range(active.size):
        p[active[k]] = u[n + k] * scales[k]
    call(functions[DERIVE], 0, 0, parameters, 0, parameters, parameters, 0)
    for i in range(n):
        frame[i] = u[i]
        frame[n + i * n + i] = 1.0
    call(functions[VARY], mode, n, frame, 0, parameters, out, 0)
    for i in range(n):
        F[i] = out[i]
        for j in range(n):
            J[i, j] = out[n + i * n + j]
    for k in range(active.size):
        call(functions[FIELD_P], mode, active[k], frame, 0, parameters, column, 0)
        for i in range(n):
            J[i, n + k] = column[i] * scales[k]
    keep(block)


@njit(cache=True, error_model="numpy")
def matrices_at(functions, mode, places, p, active, scales, found):
    """Write the derivatives of the field by the state, (places, n, n), at unknowns, (places, n + k), to found."""
    n = found.shape[1]
    F, J = np.empty(n), np.empty((n, n + active.size))
    for k in range(found.shape[0]):
        field_at(functions, mode, places[k], p, active, scales, F, J)
        found[k] = J[:, :n]
