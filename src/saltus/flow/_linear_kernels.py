"""Compiled linear algebra for the small dense systems of orbits and branches."""

from __future__ import annotations

import math

import numpy as np
from numba import njit


@njit(cache=True, error_model="numpy")
def solve(matrix, rhs):
    """Solve matrix x = rhs in place (both are overwritten) and return the sign and log of |det|; sign 0 where singular.

    matrix: (m, m); rhs: (m, k).
    """
    m, k = rhs.shape
    sign, log = 1.0, 0.0
    for i in range(m):
        pivot, best = i, abs(matrix[i, i])
        for r in range(i + 1, m):
            if abs(matrix[r, i]) > best:
                pivot, best = r, abs(matrix[r, i])
        if not best > 0.0:
            return 0.0, -np.inf
        if pivot != i:
            sign = -sign
            for c in range(i, m):
                matrix[i, c], matrix[pivot, c] = matrix[pivot, c], matrix[i, c]
            for c in range(k):
                rhs[i, c], rhs[pivot, c] = rhs[pivot, c], rhs[i, c]
        if matrix[i, i] < 0.0:
            sign = -sign
        log += math.log(best)
        for r in range(i + 1, m):
            factor = matrix[r, i] / matrix[i, i]
            if factor != 0.0:
                for c in range(i + 1, m):
                    matrix[r, c] -= factor * matrix[i, c]
                for c in range(k):
                    rhs[r, c] -= factor * rhs[i, c]
    for c in range(k):
        for i in range(m - 1, -1, -1):
            total = rhs[i, c]
            for j in range(i + 1, m):
                total -= matrix[i, j] * rhs[j, c]
            rhs[i, c] = total / matrix[i, i]
    return sign, log


@njit(cache=True, error_model="numpy")
def bordered(J, F, row, u, guess, scale):
    """Solve (J; row) (du, t) = (-F, 0; -row (u - guess), 1).

    J: (m, m + 1); F: (m,); the others (m + 1,). Returns the two solutions, (m + 1, 2), sign and log of the determinant,
    the largest |du| over `scale`, and the largest |F|.
    """
    m = F.size
    matrix, rhs = np.empty((m + 1, m + 1)), np.zeros((m + 1, 2))
    ahead = top = size = 0.0
    for i in range(m):
        for j in range(m + 1):
            matrix[i, j] = J[i, j]
        rhs[i, 0] = -F[i]
        top = max(top, abs(F[i]))
    for j in range(m + 1):
        matrix[m, j] = row[j]
        ahead += row[j] * (u[j] - guess[j])
    rhs[m, 0] = -ahead
    rhs[m, 1] = 1.0
    sign, log = solve(matrix, rhs)
    for j in range(m + 1):
        change = abs(rhs[j, 0]) / scale[j]
        size = change if not change < size else size
    return rhs, sign, log, size, top
