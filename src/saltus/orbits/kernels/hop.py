"""Compiled looks at the beginning of a segment on a surface: to which side it leaves, and a hop shorter than samples."""

from __future__ import annotations

import math

from saltus.flow.kernels.segment import FIELD
from saltus.orbits.kernels.curve import FINE, fine, sample
from saltus.orbits.signature import SECTION
from saltus.scales import EPS, MET
from saltus.system.numba_tools.machine_code import njit
from saltus.system.numba_tools.pointers import INNER, call, outlined

PER_OCTAVE = 3  # places, up to twice the time, at which a hop's rise, its return and the next minimum are seen


@njit(**INNER)
def leaving(view, curve, k, sign, room):
    """Return the side of a surface that a motion takes from a segment's start on it, and when a hop would return.

    The side is that of the rate, or where this is 0, within the error of the states, of the second derivative: 1 before
    the event, -1 beyond it, 0 where neither tells. The time of the return is that of the parabola, infinite where it
    bends away. A motion that leaves a stop without speed and bends to beyond it meets the event at once: its side is 1.

    room.slope: the event with its gradients at the segment's start. sign: by which the event function is multiplied.
    """
    outlined()
    n, rate, speed, bend, bends = view.n, sign * room.slope[1], 0.0, 0.0, 0.0
    call(view.functions[FIELD], curve.mode, 0, curve.nodes, 0, view.p, room.field, 0)
    for e in range(n):
        slope = room.slope[2 + n + e]
        speed += abs(slope) * view.sizes[e]
        bend += sign * slope * room.field[e]
        bends += abs(slope * room.field[e])
    clear = abs(rate) > MET * speed
    if not clear and not abs(bend) > MET * bends:
        return 0.0, math.inf
    back = max(-2.0 * rate / bend, 0.0) if rate * bend < 0.0 else math.inf
    if clear:
        return 1.0 if rate > 0.0 else -1.0, back
    if bend > 0.0:
        return 1.0, math.inf
    return 1.0 if view.directions[k] != 0 and view.surfaces[k] != SECTION else -1.0, back


@njit(**INNER)
def seen_from(curve, back, last):
    """Return the place at which a short hop is highest, and the one where samples see what follows; equal ones if none.

    back: time of the hop's return. last: the last fine sample that tells a height. In clustered time a hop goes like the
    square of the place, up to the order that its own return has.
    """
    end = fine(curve, min(FINE + 1, last))
    if not back < curve.duration:
        return end, end
    place = max(math.sqrt(back / (3.0 * curve.duration)), EPS)
    return min(place * math.sqrt(0.5), end) if place < fine(curve, min(FINE, last)) else end, end


@njit(**INNER)
def next_low(view, curve, what, sign, top, end, room):
    """Return three places, and an event function there, round its first local minimum behind a hop's top; 0 for none."""
    outlined()
    a, m, b = 0.0, 0.0, top
    fa, fm, fb = 0.0, 0.0, sample(view, curve, what, sign, top, room.x, room.out)
    while b < end:
        a, m, b = m, b, min(b * 2.0 ** (1.0 / PER_OCTAVE), end)
        fa, fm, fb = fm, fb, sample(view, curve, what, sign, b, room.x, room.out)
        if a > 0.0 and fm < fa and fm <= fb:
            return (a, m, b), (fa, fm, fb)
    return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
