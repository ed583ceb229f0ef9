"""Compiled orthogonal iteration on a product of matrices whose eigenvalues differ by many orders of magnitude."""

from __future__ import annotations

import math

import numpy as np

from saltus.system.numba_tools.machine_code import njit

__all__ = ["triangularise"]


@njit(cache=True, error_model="numpy")
def _orthogonalise(A, Q, v):
    """Turn A, (n, n), into the triangle R of its QR factorisation and write Q, by Householder's reflections."""
    n = A.shape[0]
    for a in range(n):
        for b in range(n):
            Q[a, b] = 1.0 if a == b else 0.0
    for c in range(n - 1):
        norm = 0.0
        for a in range(c, n):
            v[a] = A[a, c]
            norm += v[a] * v[a]
        norm = math.sqrt(norm)
        if norm == 0.0:
            continue
        v[c] += norm if v[c] >= 0.0 else -norm
        square = 0.0
        for a in range(c, n):
            square += v[a] * v[a]
        for b in range(n):
            one = two = 0.0
            for a in range(c, n):
                one += v[a] * A[a, b]
                two += v[a] * Q[b, a]
            one *= 2.0 / square
            two *= 2.0 / square
            for a in range(c, n):
                A[a, b] -= one * v[a]
                Q[b, a] -= two * v[a]
        for a in range(c + 1, n):
            A[a, c] = 0.0


@njit(cache=True, error_model="numpy")
def triangularise(blocks, rounds, converged, triangles, turn):
    """Bring the product of matrices to block triangular form by orthogonal iteration.

    blocks: (count, n, n), the first one applied first. Written are triangles, (count, n, n), the triangular factors of the
    last round, and turn, (n, n): the product is similar to turn times that of the triangles. Entries of `turn` that couple
    what comes first to what comes later fall like the ratio of the eigenvalues' sizes with each round; the rounds end
    where none that is not `converged` fell any more, or after `rounds`.
    """
    count, n = blocks.shape[0], blocks.shape[1]
    Q, before, first, v = np.eye(n), np.empty((n, n)), np.empty((n, n)), np.empty(n)
    for _ in range(rounds):
        first[:, :] = Q
        for k in range(count):
            before[:, :] = Q
            for a in range(n):
                for b in range(n):
                    total = 0.0
                    for c in range(n):
                        total += blocks[k, a, c] * before[c, b]
                    triangles[k, a, b] = total
            _orthogonalise(triangles[k], Q, v)
        worst = 0.0
        for a in range(n):
            for b in range(n):
                total = 0.0
                for c in range(n):
                    total += first[c, a] * Q[c, b]
                turn[a, b] = total
                if b < a:
                    worst = max(worst, abs(total))
        if worst < converged:
            break
