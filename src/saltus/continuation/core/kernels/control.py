"""Compiled control of steps along a branch: prediction, checks of a corrected point, length of the next step.

docs/theory/continuation.md, "Pseudo-arclength", derives the rules.
"""

from __future__ import annotations

import math

from saltus.continuation.core.verdicts import ANGLE, DEVIATION, FOLDS, TAKEN
from saltus.scales import PARAMETER_RESTS, PARAMETER_ROUNDED
from saltus.system.numba_tools.machine_code import kernel, njit
from saltus.system.numba_tools.pointers import INNER

_FAR = 3.0  # length of a step, over that of the last one, from which on a parabola predicts, not a cubic


@kernel
def predict(last, before, length, h, guess):
    """Write the point predicted a step of length h ahead, on the cubic through the last two points and their tangents.

    last, before: point and tangent, (2, m + 1) each; guess: (m + 1,); length: arclength between both, 0 for none.
    """
    for j in range(guess.size):
        if length <= 0.0:
            guess[j] = last[0, j] + h * last[1, j]
        elif h > _FAR * length:
            bend = (last[1, j] - before[1, j]) / length
            guess[j] = last[0, j] + h * last[1, j] + 0.5 * h * h * bend
        else:
            s = 1.0 + h / length
            end, off = s * s * (3.0 - 2.0 * s), s * (1.0 - s) * length
            guess[j] = (
                (1.0 - end) * before[0, j] + end * last[0, j] + (1.0 - s) * off * before[1, j] - s * off * last[1, j]
            )


@kernel
def judge(weights, last, new, guess, limits):
    """Return what is wrong with a step, how far its end was corrected, the angle between tangents, its length.

    last, new: point and tangent, (2, m + 1) each; weights: those at the last point; limits: deviation, largest angle.
    """
    moved = length = cosine = size = 0.0
    m = guess.size - 1
    for j in range(m + 1):
        moved += weights[j] * (new[0, j] - guess[j]) ** 2
        length += weights[j] * (new[0, j] - last[0, j]) ** 2
        cosine += weights[j] * last[1, j] * new[1, j]
        size += weights[j] * new[1, j] ** 2
    moved, length = math.sqrt(moved), math.sqrt(length)
    angle = math.acos(min(1.0, max(-1.0, cosine / math.sqrt(size))))
    deviation, most = limits
    if angle > most:
        return ANGLE, moved, angle, length
    if moved > 15.0 * deviation or moved > 0.5 * length:
        return DEVIATION, moved, angle, length
    chord = (new[0, m] - last[0, m]) / max(length, 1e-300)
    moves = max(abs(last[1, m]), abs(new[1, m]), abs(chord)) * length > PARAMETER_ROUNDED
    if moves and _turns_twice(last[1, m], new[1, m], chord):
        return FOLDS, moved, angle, length
    return TAKEN, moved, angle, length


@njit(**INNER)
def _turns_twice(a, b, chord):
    """Return whether the cubic with end slopes a and b and mean slope chord turns twice within a step."""
    if a * b <= 0.0 or min(abs(a), abs(b)) < PARAMETER_RESTS:
        return False
    side = math.copysign(1.0, a)
    a, b, chord = a * side, b * side, chord * side
    bottom = a + b - 2.0 * chord
    if bottom <= 0.0:
        return False
    s = (2.0 * a + b - 3.0 * chord) / (3.0 * bottom)
    return 0.0 < s < 1.0 and a - 3.0 * bottom * s * s < 0.0


@kernel
def growth(moved, angle, iterations, limits):
    """Return the factor on the length of the next step; limits: deviation, largest angle."""
    deviation, most = limits
    factor = min(2.0, max(0.3, (deviation / max(moved, 1e-12)) ** 0.25))
    if iterations > 3:
        factor = min(factor, 1.2 if iterations == 4 else 0.7)
    return min(factor, 0.8) if angle > 0.5 * most else factor
