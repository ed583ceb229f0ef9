"""Compiled linear algebra of a periodic orbit: the pencil of its return map, and determinants.

docs/theory/orbits.md derives the pencil, docs/theory/loci.md the determinants.
"""

from __future__ import annotations

import math

import numpy as np
from numba import int64

from saltus.orbits.signature import CLOSED_END, EVENT_END, MEAN_END, PHASE_END
from saltus.scales import ALIGNED
from saltus.system.numba_tools.linear import solve_flat
from saltus.system.numba_tools.machine_code import kernel, njit
from saltus.system.numba_tools.pointers import INNER, keep, outlined, pointer


@kernel
def pencil(J, kinds, n, vector, sizes, period, P, R):
    """Write the (n, n) pencil P v = mu R v of the linearised return map at the first segment's start.

    Durations are eliminated by reflections and segments joined by orthogonal null spaces. No normal velocity is divided
    by: where it vanishes (grazing), R is singular and a multiplier infinite. Where the orbit has an event, the flow
    `vector` is an eigenvector of multiplier 0. It is improved to the eigenvector of the discrete equations, and the
    quotient by it is left in P[1:, 1:] and R[1:, 1:]. States are taken in units of `sizes`, (n,), and durations of
    `period`, `vector` with them, so that units do not matter.
    """
    segments, wide, width = kinds.size, n + 1, J.shape[1]
    block = np.empty(2 * wide * n + wide + 7 * n * n + 6 * n)
    left, right = pointer(block, 0), pointer(block, wide * n)
    tau, better, v = pointer(right, wide * n), pointer(right, wide * n + wide), pointer(right, wide * n + wide + n)
    work = pointer(v, n)  # (4 n + 6 n^2,)
    matrix = pointer(work, 4 * n + 6 * n * n)
    J, vector, P, R = pointer(J, 0), pointer(vector, 0), pointer(P, 0), pointer(R, 0)
    whole = False
    for i in range(segments):
        at = i * wide
        for a in range(wide):
            line = pointer(J, (at + a) * width + at)
            unit = 0.0
            if a < n:
                unit = sizes[a]
            else:
                unit = abs(line[n]) * period
                for b in range(n):
                    unit = max(unit, abs(line[b]) * sizes[b])
            unit = 1.0 / unit if unit > 0.0 else 1.0
            tau[a] = line[n] * period * unit
            for b in range(n):
                left[a * n + b] = (line[b] + (1.0 if segments == 1 and a == b else 0.0)) * sizes[b] * unit
                right[a * n + b] = 1.0 if a == b else 0.0
        whole = kinds[i] == PHASE_END or kinds[i] == CLOSED_END
        if not whole:
            _reflect(tau, left, right, wide, n, work)
        # behind the reflection's first row, unless the duration stays
        first = 0 if whole else n
        if i == 0 or whole:
            for a in range(n * n):
                P[a] = left[first + a]
                R[a] = right[first + a]
        else:
            _join(P, R, pointer(left, n), pointer(right, n), n, work)
        if whole:
            break
    if not whole:
        left_of, image, longest = 0.0, 0.0, 0.0
        for a in range(n):
            v[a], lost = 0.0, 0.0
            for b in range(n):
                matrix[a * n + b] = P[a * n + b]
                v[a] += R[a * n + b] * vector[b]
                lost += P[a * n + b] * vector[b]
            left_of, image, longest = max(left_of, abs(lost)), max(image, abs(v[a])), max(longest, abs(vector[a]))
        sign, _ = solve_flat(matrix, v, n, int64(1))
        size = 0.0
        for a in range(n):
            size = max(size, abs(v[a]))
        # what P leaves of it is to be less than of the flow: it is not where another multiplier is 0 as well
        improved = sign != 0.0 and 0.0 < size < 1e300 and image * longest < left_of * size
        improved = improved and _aligned(v, vector, size, n)
        for a in range(n):
            better[a] = v[a] / size if improved else vector[a]
        _quotient(P, R, better, n, left, right, tau, work)
    keep(block)


@njit(**INNER)
def _aligned(v, vector, size, n):
    """Whether the vector v, of largest component `size`, has the direction of another one but for a small angle.

    It has not where the multiplier 0 is defective, as of an orbit that slides and starts on the surface.
    """
    along, own, other = 0.0, 0.0, 0.0
    for a in range(n):
        along += v[a] / size * vector[a]
        own += (v[a] / size) * (v[a] / size)
        other += vector[a] * vector[a]
    return along * along >= ALIGNED * own * other


@njit(**INNER)
def _quotient(P, R, vector, n, left, right, image, work):
    """Turn a pencil so that its rows and columns behind the first are the quotient by an eigenvector."""
    outlined()
    for a in range(n):
        for b in range(n):
            left[a * n + b] = P[b * n + a]
            right[a * n + b] = R[b * n + a]
    _reflect(vector, left, right, n, n, work)
    size = 0.0
    for a in range(n):
        for b in range(n):
            P[a * n + b] = left[b * n + a]
            R[a * n + b] = right[b * n + a]
        image[a] = R[a * n]
        size = max(size, abs(image[a]))
    if size == 0.0:
        for a in range(n):
            image[a] = P[a * n]
    _reflect(image, P, R, n, n, work)


@kernel
def landing(J, kinds, n, sizes, period):
    """Return how far a change of a segment's start may grow until its event, in any direction or in time.

    That is the largest norm of a segment's map onto its landing with the event's delay; inf where it is none. States are
    taken in units of `sizes`, (n,), times in those of `period`. A segment without an event has a given duration.
    """
    segments, width, entries, most = kinds.size, J.shape[1], pointer(J, 0), 0.0
    for i in range(segments):
        row = i * (n + 1)
        first, last = pointer(entries, row * width + row), pointer(entries, (row + n) * width + row)
        ends, grown, later = kinds[i] == EVENT_END or kinds[i] == MEAN_END, 0.0, 0.0
        for b in range(n):
            delay = -last[b] / last[n] if ends else 0.0
            time = delay * sizes[b] / period
            later += time * time
            for a in range(n):
                value = first[a * width + b] + (1.0 if segments == 1 and a == b else 0.0)
                value = (value + first[a * width + n] * delay) * sizes[b] / sizes[a]
                grown += value * value
        if not grown + later < np.inf:
            return np.inf
        most = max(most, grown + later)
    return math.sqrt(most)


@njit(cache=True, error_model="numpy")
def pair(P, R, at, values):
    """Write the two generalised eigenvalues of the 2 x 2 pencil that begins at (at, at); infinite ones as inf."""
    width = P.shape[1]
    above, below = pointer(P, at * width + at), pointer(P, (at + 1) * width + at)
    p00, p01, p10, p11 = above[0], above[1], below[0], below[1]
    above, below = pointer(R, at * width + at), pointer(R, (at + 1) * width + at)
    r00, r01, r10, r11 = above[0], above[1], below[0], below[1]
    a, c = r00 * r11 - r01 * r10, p00 * p11 - p01 * p10
    b = -(p00 * r11 + p11 * r00 - p01 * r10 - p10 * r01)
    half = 0.5 * b
    discriminant = half * half - a * c
    if discriminant < 0.0:
        values[0] = complex(-half / a, math.sqrt(-discriminant) / a)
        values[1] = values[0].conjugate()
        return
    q = -(half + math.copysign(math.sqrt(discriminant), half))
    values[0] = complex(q / a, 0.0) if a != 0.0 else complex(np.inf, 0.0)
    values[1] = complex(c / q, 0.0) if q != 0.0 else complex(0.0, 0.0)
    if abs(values[1]) > abs(values[0]):
        values[0], values[1] = values[1], values[0]


@kernel
def doubling(J, n):
    """Return sign and log of |det(A + B)|, A - B = J with B the closing equations' derivative in the next period's start."""
    m = J.shape[0]
    width = J.shape[1]
    matrix, rhs, entries = np.empty(m * m), np.zeros(m), pointer(J, 0)
    for a in range(m):
        for b in range(m):
            matrix[a * m + b] = entries[a * width + b]
    last = m - n - 1
    for a in range(n):
        matrix[(last + a) * m + a] += 2.0
    sign, log = solve_flat(pointer(matrix, 0), pointer(rhs, 0), m, int64(1))
    keep(matrix)
    keep(rhs)
    return sign, log


@njit(**INNER)
def _reflect(tau, left, right, size, columns, v):
    """Apply to both matrices, (size, columns), the reflection that turns `tau` onto its first component. v: scratch."""
    outlined()
    norm = 0.0
    for a in range(size):
        v[a] = tau[a]
        norm += v[a] * v[a]
    norm = math.sqrt(norm)
    if norm == 0.0:
        return
    v[0] += norm if v[0] >= 0.0 else -norm
    square = 0.0
    for a in range(size):
        square += v[a] * v[a]
    for b in range(columns):
        one = two = 0.0
        for a in range(size):
            one += v[a] * left[a * columns + b]
            two += v[a] * right[a * columns + b]
        one *= 2.0 / square
        two *= 2.0 / square
        for a in range(size):
            left[a * columns + b] -= one * v[a]
            right[a * columns + b] -= two * v[a]


@njit(**INNER)
def _join(P, R, left, right, n, work):
    """Eliminate the middle state from P x0 = R x1 and left x1 = right x2, leaving P x0 = R x2 in place.

    The rows (R; left) are turned by reflections until only n of them are non-zero; the other n give the new pencil.
    """
    outlined()
    v, stack, wide = work, pointer(work, 2 * n), 3 * n
    for a in range(6 * n * n):
        stack[a] = 0.0
    for a in range(n):
        above, below = pointer(stack, a * wide), pointer(stack, (n + a) * wide)
        for b in range(n):
            above[b] = -R[a * n + b]
            below[b] = left[a * n + b]
            above[n + b] = P[a * n + b]
            below[2 * n + b] = right[a * n + b]
    for c in range(n):
        norm = 0.0
        for a in range(c, 2 * n):
            v[a] = stack[a * wide + c]
            norm += v[a] * v[a]
        norm = math.sqrt(norm)
        if norm == 0.0:
            continue
        v[c] += norm if v[c] >= 0.0 else -norm
        square = 0.0
        for a in range(c, 2 * n):
            square += v[a] * v[a]
        for b in range(c, wide):
            total = 0.0
            for a in range(c, 2 * n):
                total += v[a] * stack[a * wide + b]
            total *= 2.0 / square
            for a in range(c, 2 * n):
                stack[a * wide + b] -= total * v[a]
    for a in range(n):
        for b in range(n):
            P[a * n + b] = stack[(n + a) * wide + n + b]
            R[a * n + b] = stack[(n + a) * wide + 2 * n + b]
