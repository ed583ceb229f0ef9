"""Compiled linear algebra for the small dense systems of orbits and branches."""

from __future__ import annotations

import math

import numpy as np
from numba import int64

from saltus.scales import ILL_CONDITIONED
from saltus.system.numba_tools.machine_code import njit
from saltus.system.numba_tools.pointers import INNER, keep, pointer


@njit(cache=True, error_model="numpy")
def solve(matrix, rhs):
    """Solve matrix x = rhs in place (both are overwritten) and return the sign and log of |det|; sign 0 where singular.

    matrix: (m, m); rhs: (m, k).
    """
    return solve_flat(pointer(matrix, 0), pointer(rhs, 0), rhs.shape[0], rhs.shape[1])


@njit(**INNER)
def solve_flat(matrix, rhs, m, k):
    """Solve as `solve` does, on pointers."""
    sign, log = 1.0, 0.0
    for i in range(m):
        pivot, best = i, abs(matrix[i * m + i])
        for r in range(i + 1, m):
            if abs(matrix[r * m + i]) > best:
                pivot, best = r, abs(matrix[r * m + i])
        if not best > 0.0:
            return 0.0, -np.inf
        if pivot != i:
            sign = -sign
            for c in range(i, m):
                matrix[i * m + c], matrix[pivot * m + c] = matrix[pivot * m + c], matrix[i * m + c]
            for c in range(k):
                rhs[i * k + c], rhs[pivot * k + c] = rhs[pivot * k + c], rhs[i * k + c]
        if matrix[i * m + i] < 0.0:
            sign = -sign
        log += math.log(best)
        for r in range(i + 1, m):
            factor = matrix[r * m + i] / matrix[i * m + i]
            if factor != 0.0:
                for c in range(i + 1, m):
                    matrix[r * m + c] -= factor * matrix[i * m + c]
                for c in range(k):
                    rhs[r * k + c] -= factor * rhs[i * k + c]
    for c in range(k):
        for i in range(m - 1, -1, -1):
            total = rhs[i * k + c]
            for j in range(i + 1, m):
                total -= matrix[i * m + j] * rhs[j * k + c]
            rhs[i * k + c] = total / matrix[i * m + i]
    return sign, log


@njit(**INNER)
def _decouple(matrix, F, u, wide):
    """Take unknowns that stay 0 out of all other equations: what they add there is 0, and its rounding may be all.

    Their own equations are solved by 0, and hold no other unknowns: an invariant plane. The determinant stays.
    """
    m, rows, columns = F.size, 0, 0
    within, own = np.zeros(wide, np.int64), np.zeros(wide, np.int64)
    for i in range(m):
        closed = F[i] == 0.0 and matrix[i * wide + i] != 0.0
        for j in range(wide):
            closed = closed and (u[j] == 0.0 or matrix[i * wide + j] == 0.0)
        if closed:
            rows, within[i] = rows + 1, 1
            for j in range(wide):
                if matrix[i * wide + j] != 0.0:
                    own[j] = 1
    for j in range(wide):
        columns += own[j]
    if rows == columns:
        for i in range(wide):
            for j in range(wide):
                if within[i] == 0 and own[j] == 1:
                    matrix[i * wide + j] = 0.0


@njit(**INNER)
def _in_sizes(m, scale, top, matrix, rhs):
    """Solve as `solve_flat` does with two right sides, by elimination in the unknowns' sizes and the equations' own.

    In units far apart the pivots that are largest are not those that keep the digits. matrix: (m + 1, m + 1); top: the largest size.
    """
    wide, gained = m + 1, 0.0
    for i in range(wide):
        largest = 0.0
        for j in range(wide):
            matrix[i * wide + j] *= scale[j] / top
            largest = max(largest, abs(matrix[i * wide + j]))
        unit = largest if largest > 0.0 else 1.0
        for j in range(wide):
            matrix[i * wide + j] /= unit
        rhs[2 * i] /= unit
        rhs[2 * i + 1] /= unit
        gained += math.log(unit) - math.log(scale[i] / top)
    sign, log = solve_flat(matrix, rhs, wide, int64(2))
    for j in range(wide):
        rhs[2 * j] *= scale[j] / top
        rhs[2 * j + 1] *= scale[j] / top
    return sign, log + gained


@njit(cache=True, error_model="numpy")
def bordered(J, F, row, u, guess, scale):
    """Solve (J; row) (du, t) = (-F, 0; -row (u - guess), 1).

    J: (m, m + 1); F: (m,); the others (m + 1,). Returns the two solutions, (m + 1, 2), and what `bordered_flat` does.
    """
    wide = F.size + 1
    block, solutions = np.empty(wide * wide), np.empty((wide, 2))
    sign, log, size, top = bordered_flat(J, F, row, u, guess, scale, pointer(block, 0), pointer(solutions, 0))
    keep(block)
    return solutions, sign, log, size, top


@njit(**INNER)
def bordered_flat(J, F, row, u, guess, scale, matrix, rhs):
    """Solve as `bordered` does; return sign and log of the determinant, the largest |du| and |F|, both over `scale`.

    matrix: room for (m + 1)^2 numbers; rhs: pointer to the solutions, (m + 1, 2), which are written.
    """
    m, wide = F.size, F.size + 1
    ahead = top = size = largest = 0.0
    smallest = np.inf
    for i in range(m):
        for j in range(wide):
            matrix[i * wide + j] = J[i, j]
        rhs[2 * i] = -F[i]
        rhs[2 * i + 1] = 0.0
        top = max(top, abs(F[i]) / scale[i])
    for j in range(wide):
        matrix[m * wide + j] = row[j]
        ahead += row[j] * (u[j] - guess[j])
        smallest, largest = min(smallest, scale[j]), max(largest, scale[j])
    rhs[2 * m] = -ahead
    rhs[2 * m + 1] = 1.0
    for i in range(m):
        if F[i] == 0.0 and u[i] == 0.0 and matrix[i * wide + i] != 0.0:
            _decouple(matrix, F, u, wide)
            break
    if smallest < ILL_CONDITIONED * largest:
        sign, log = _in_sizes(m, scale, largest, matrix, rhs)
    else:
        sign, log = solve_flat(matrix, rhs, wide, int64(2))
    for j in range(wide):
        change = abs(rhs[2 * j]) / scale[j]
        size = change if not change < size else size
    return sign, log, size, top
