"""Compiled exponentials of a small matrix at many times."""

from __future__ import annotations

import numpy as np

from saltus.system.machine_code import njit

_TERMS = 18


@njit(cache=True, error_model="numpy")
def exponentials(matrix, times):
    """exp(matrix * time) for each time, (times, m, m): the series at a time 2^-k of it, then k squarings."""
    m = matrix.shape[0]
    norm = 0.0
    for i in range(m):
        norm = max(norm, np.abs(matrix[i]).sum())
    out = np.empty((times.size, m, m))
    term, other = np.empty((m, m)), np.empty((m, m))
    for i in range(times.size):
        t, squarings = times[i], 0
        while norm * abs(t) > 1.0:
            t *= 0.5
            squarings += 1
        total = out[i]
        total[:] = 0.0
        term[:] = 0.0
        for e in range(m):
            total[e, e] = term[e, e] = 1.0
        for k in range(1, _TERMS + 1):
            _product(term, matrix, other)
            for e in range(m):
                for f in range(m):
                    term[e, f] = other[e, f] * t / k
                    total[e, f] += term[e, f]
        for _ in range(squarings):
            _product(total, total, other)
            total[:] = other
    return out


@njit(cache=True, error_model="numpy")
def _product(a, b, out):
    m = a.shape[0]
    for i in range(m):
        for j in range(m):
            total = 0.0
            for k in range(m):
                total += a[i, k] * b[k, j]
            out[i, j] = total
