"""Compiled roots of a polynomial on an interval, isolated by sign variations of its Bernstein coefficients."""

from __future__ import annotations

import math

from saltus.system.numba_tools.machine_code import njit
from saltus.system.numba_tools.pointers import INNER, outlined, pointer

ROOTS = 16  # most roots of one polynomial that are kept
DEPTH = 64  # most pieces of the interval that wait at a time


@njit(**INNER)
def variations(b, degree):
    """Sign variations of Bernstein coefficients, and the first and last sign that is not zero."""
    count = first = last = 0
    for i in range(degree + 1):
        sign = 1 if b[i] > 0.0 else (-1 if b[i] < 0.0 else 0)
        if sign != 0:
            if last != 0 and sign != last:
                count += 1
            if first == 0:
                first = sign
            last = sign
    return count, first, last


@njit(**INNER)
def bernstein_value(b, degree, s, work):
    """Value and derivative of a Bernstein polynomial at s, by de Casteljau's scheme."""
    for i in range(degree + 1):
        work[i] = b[i]
    slope = 0.0
    for level in range(degree, 0, -1):
        if level == 1:
            slope = degree * (work[1] - work[0])
        for i in range(level):
            work[i] += s * (work[i + 1] - work[i])
    return work[0], slope


@njit(**INNER)
def _single_root(b, degree, first, work):
    """The one root in (0, 1) of a polynomial whose coefficients change sign once, from sign `first`."""
    outlined()
    low, high, s = 0.0, 1.0, 0.5
    for _ in range(200):
        value, slope = bernstein_value(b, degree, s, work)
        if value * first > 0.0:
            low = s
        elif value == 0.0:
            return s
        else:
            high = s
        new = s - value / slope
        if not low < new < high:
            # roots next to the start are sought on their own scale
            new = 0.5 * (low + high) if low > 1e-3 * high else max(math.sqrt(low * high), 1e-3 * high)
        if abs(new - s) <= 1e-14 * new or high - low <= 1e-15 * high or high < 1e-30:
            return new
        s = new
    return s


@njit(**INNER)
def bernstein_roots(b, degree, noise, start, width, pieces, work, found, count):
    """Append the roots in (0, 1) of a Bernstein polynomial, in order, as start + width * root; the new count, or -1.

    Roots that `noise` may have made in pairs are left out.
    """
    outlined()
    for i in range(degree + 1):
        pieces[i] = b[i]
    pieces[degree + 1] = 0.0
    pieces[degree + 2] = 1.0
    top = 1
    while top > 0:
        top -= 1
        piece = pointer(pieces, top * (degree + 3))
        low, high = piece[degree + 1], piece[degree + 2]
        changes, first, last = variations(piece, degree)
        if changes == 0:
            continue
        root = -1.0
        if changes == 1:
            root = low + (high - low) * _single_root(piece, degree, first, work)
        else:
            largest = 0.0
            for i in range(degree + 1):
                largest = max(largest, abs(piece[i]))
            if largest <= noise or high - low < 1e-13 or top + 2 >= DEPTH:
                if first == last:
                    continue
                root = 0.5 * (low + high)
        if root >= 0.0:
            if count == ROOTS:
                return -1
            found[count] = start + width * root
            count += 1
            continue
        cut = 0.5
        for _ in range(4):
            value, _slope = bernstein_value(piece, degree, cut, work)
            if value != 0.0:
                break
            cut -= 0.01907
        # left half ends up above the right one on the stack
        left, right = pointer(pieces, (top + 1) * (degree + 3)), piece
        for i in range(degree + 1):
            work[i] = right[i]
        left[0] = work[0]
        for level in range(degree, 0, -1):
            for i in range(level):
                work[i] += cut * (work[i + 1] - work[i])
            right[level] = work[level]
            left[degree - level + 1] = work[0]
        right[0] = work[0]
        middle = low + cut * (high - low)
        left[degree + 1] = low
        left[degree + 2] = middle
        right[degree + 1] = middle
        right[degree + 2] = high
        top += 2
    return count
