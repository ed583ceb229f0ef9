"""Compiled distances of a segment from the surfaces of events: docs/theory/orbits.md, "Admissibility"."""

from __future__ import annotations

import math
from typing import NamedTuple

from numba import int64

from saltus.flow.kernels.crossing import SHRINKS
from saltus.flow.kernels.segment import EVENT_X
from saltus.orbits.kernels.curve import FINE, GUARD, fine, held, lowest_between, sample, turning
from saltus.orbits.kernels.hop import leaving, next_low, seen_from
from saltus.orbits.kernels.together import holds
from saltus.orbits.signature import BEYOND, BOUNDARY, EARLY, SECTION, WHOLE
from saltus.scales import CONDITION_VANISHES, EPS, EQUALLY_FAR, EVENT_ROUNDED, FINEST, ROUNDINGS, TOO_BRIEF, followed
from saltus.system.numba_tools.machine_code import njit
from saltus.system.numba_tools.pointers import INNER, call, outlined, pointer

_SAME_INSTANT = followed(FINEST)  # share of the period before a segment's end within which its event is that at the end


class Surface(NamedTuple):
    """The surface of a transition, as a segment's fine samples show it.

    Attributes
    ----------
    transition : int
        Which.
    at : int
        Where in margins and places the segment's entry for it is.
    sign : float
        Sign by which the event function is multiplied, so that it is positive before the event.
    height : pointer to float64
        Event function times `sign` at the samples.
    small : float
        Height below which a height is rounding of 0.
    least : float
        The same where only the rounding of numbers counts.
    born : bool
        Whether the segment starts on the surface and leaves it to where it meets the event as soon as it comes back.
    back : float
        Time after which it does by the parabola at the start; infinite where that bends away.
    """

    transition: int
    at: int
    sign: float
    height: object
    small: float
    least: float
    born: bool
    back: float


@njit(**INNER)
def margin(view, curve, k, row, transition, before, there, closed, room, found):
    """Note how near a segment comes to the surface of transition `k`; return BEYOND and EARLY where they are due.

    row: that of the segment in `found`. transition, before: the events at its end and at its start. there: whether the orbit has event k
    at the same time as these, behind the one at the end or before the one at the start. closed: whether it has none.
    """
    outlined()
    total = curve.count * FINE
    height, sign = pointer(room.heights, k * (total + 1)), -1.0 if view.directions[k] > 0 else 1.0
    # the side from which the segment comes to its end
    side = 1.0 if view.directions[k] != 0 or height[total - FINE] > 0.0 else -1.0
    if side * height[total] < side * height[total - 1]:
        call(
            view.functions[GUARD], view.modes + k, 0, pointer(curve.nodes, curve.count * view.n), 0, view.p, room.one, 0
        )
        if room.one[0] > 0.0:
            found.distances[row * view.transitions + k] = side * height[total]
    ends = there[0] or (transition >= 0 and view.alike[k] == view.alike[transition])
    begins = there[1] or (before >= 0 and view.alike[k] == view.alike[before])
    # the side to which the segment leaves
    side = 1.0 if view.directions[k] != 0 or height[1] < height[0] else -1.0
    if not closed and not begins and side * height[1] < side * height[0]:
        call(view.functions[GUARD], view.modes + k, 0, curve.nodes, 0, view.p, room.one, 0)
        if room.one[0] > 0.0:
            found.behind[row * view.transitions + k] = -side * height[0]
    size, top, bottom = 0.0, height[0], height[0]
    for j in range(total + 1):
        size = max(size, abs(height[j]))
        top, bottom = max(top, height[j]), min(bottom, height[j])
    call(view.functions[EVENT_X], k, 0, curve.nodes, 0, view.p, room.slope, 0)
    reach, at, bad = 0.0, row * view.transitions + k, 0
    for e in range(view.n):
        reach += abs(room.slope[2 + e]) * view.sizes[e]
    small = 1e-9 * (1e-3 * reach + size)
    leaves, back = 0.0, math.inf
    if begins and abs(height[0]) <= small:
        leaves, back = leaving(view, curve, k, sign, room)
    if k == transition:  # a rounded duration is no way beyond the surface, however steeply it is met
        call(view.functions[EVENT_X], k, 0, pointer(curve.nodes, curve.count * view.n), 0, view.p, room.slope, 0)
        small = max(small, ROUNDINGS * EPS * abs(room.slope[1]) * curve.duration)
    turned = leaves if leaves != 0.0 else height[0 if abs(height[0]) > small else 1]
    if view.directions[k] == 0 and turned < 0.0:
        leaves = -leaves
        sign, top, bottom = -1.0, -bottom, -top
        for j in range(total + 1):
            height[j] = -height[j]
    level = curve.duration > TOO_BRIEF * view.period and top - bottom <= EQUALLY_FAR * reach + 1e-14 * size
    passed = top < -small and view.directions[k] != 0 and view.surfaces[k] == BOUNDARY
    if not ends and not begins and (level or passed):
        met = held(view, curve, k, room.x, room.one)
        if passed and met == total + 1:
            bad |= BEYOND
        if level:
            if met > 0 and view.surfaces[k] != SECTION:
                distance = sign * height[0] if view.directions[k] == 0 else height[0]
                found.margins[at] = distance if abs(distance) > EVENT_ROUNDED * reach else 0.0
                found.places[at] = WHOLE
            return bad
    surface = Surface(k, at, sign, height, small, EVENT_ROUNDED * (reach + size), leaves > 0.0, back)
    more, seen = _touches(view, curve, surface, ends, begins, room, found)
    bad |= more
    return bad | _at_seam(view, curve, surface, seen, room, found) if closed else bad


@njit(**INNER)
def _touches(view, curve, surface, ends, begins, room, found):
    """Note the least distances inside a segment; return EARLY where it is due, and whether it was before the surface.

    ends, begins: whether the surface is that of the event at the segment's end, or at its start.
    """
    outlined()
    height, small, least, total, bad = surface.height, surface.small, surface.least, curve.count * FINE, 0
    seen = unmet = beyond = False
    # a motion that starts on the surface, before its own event, meets it again however low it hops
    armed = fresh = surface.born
    tall = not surface.born
    last = _told_up_to(curve, surface) if ends else total
    if surface.born:
        bad |= _hops(view, curve, surface, last, room, found)
    for j in range(total + 1):
        low = 2 <= j <= last and height[j - 1] < height[j - 2] and height[j - 1] <= height[j]
        if low and (seen or (fresh and height[j - 1] < -least)) and not unmet:
            bad |= _touch(view, curve, surface, 1.0, j - 1, small if tall else least, room, found)
        # from beyond the surface the motion may come back through it for a moment, and meet the event then
        if 2 <= j and not armed and height[j - 2] < height[j - 1] >= height[j] and height[j - 1] <= small:
            fa, fm, fb = -height[j - 2], -height[j - 1], -height[j]
            if fm <= max(fa, fb) - fm:
                bad |= _touch(view, curve, surface, -1.0, j - 1, small, room, found)
        # an event that has just happened does not happen again as the motion passes on through its surface
        starts = j == 1 and abs(height[0]) <= small and curve.duration > 0.0 and not begins
        at_end = ends and _left(curve, j) * curve.duration <= _SAME_INSTANT * view.period
        if 0 < j < total and height[j] < -small and (armed or starts) and not at_end:
            # one who has passed while the condition did not hold is beyond, and meets the event no more
            early, jumps = _crossed(view, curve, surface, 1.0, j, armed, room, found)
            bad |= early
            unmet = early == 0 and not jumps
            armed, seen, beyond, fresh = False, seen and not jumps, not jumps, False
        if j < total and beyond and height[j] > small and view.directions[surface.transition] == 0:
            bad |= _crossed(view, curve, surface, -1.0, j, True, room, found)[0]
        if j == total and not ends and armed and height[j] < -small:
            bad |= EARLY
        if height[j] > (least if fresh else small):
            armed = seen = True
            unmet = beyond = False
        tall = tall or height[j] > small
    return bad, seen


@njit(**INNER)
def _hops(view, curve, surface, last, room, found):
    """Note the least height behind a hop that is shorter than the samples; return EARLY where the surface is passed."""
    top, end = seen_from(curve, surface.back, last)
    what = view.n + view.outputs + surface.transition
    places, values = next_low(view, curve, what, surface.sign, top, end, room)
    if not places[1] > 0.0:
        return 0
    return _touch_between(view, curve, surface, 1.0, places, values, surface.least, room, found)


@njit(**INNER)
def _told_up_to(curve, surface):
    """Return the last fine sample that tells how near a segment comes to the surface at which it ends.

    Where it meets the surface with a velocity, heights next to the end are rounding; where it touches it, they count.
    """
    height, total = surface.height, curve.count * FINE
    last = total
    while last > 0 and height[last] <= surface.least:
        last -= 1
    before = max(last - FINE, 0)
    steep = height[last] * _left(curve, before) >= 0.5 * height[before] * _left(curve, last)
    return last if steep else total


@njit(**INNER)
def _left(curve, j):
    """Return the time from a fine sample to the segment's end, over its duration."""
    place = fine(curve, j)
    return (1.0 - place) * (1.0 - place) * (1.0 + 2.0 * place)


@njit(**INNER)
def _touch(view, curve, surface, way, j, allowed, room, found):
    """Note the least height (way 1) or the greatest (-1) near a fine sample; return EARLY where the surface is passed.

    allowed: height beyond the surface that is none.
    """
    height = surface.height
    places = fine(curve, j - 1), fine(curve, j), fine(curve, j + 1)
    values = way * height[j - 1], way * height[j], way * height[j + 1]
    return _touch_between(view, curve, surface, way, places, values, allowed, room, found)


@njit(**INNER)
def _touch_between(view, curve, surface, way, places, values, allowed, room, found):
    """Do what `_touch` does between three places, with the heights there times `way`."""
    outlined()
    what = view.n + view.outputs + surface.transition
    place, least = lowest_between(view, curve, what, way * surface.sign, places, values, room.x, room.out)
    beside = places[0 if way > 0.0 else 2]
    return _noted(view, curve, surface, least, place, beside, allowed, room, found)


@njit(**INNER)
def _noted(view, curve, surface, least, place, beside, allowed, room, found):
    """Keep a least distance where the condition holds and none is less yet; return EARLY where it is beyond the surface.

    beside: a place on the side where the motion would meet the event. A condition on the velocity, as ``when="v"``, is 0
    at an extremum, and what it is there tells nothing.
    """
    if not least < found.margins[surface.at]:
        return 0
    guard = view.modes + surface.transition
    sample(view, curve, int64(0), 1.0, beside, room.x, room.out)
    call(view.functions[GUARD], guard, 0, room.x, 0, view.p, room.one, 0)
    aside = room.one[0]
    sample(view, curve, int64(0), 1.0, place, room.x, room.out)
    call(view.functions[GUARD], guard, 0, room.x, 0, view.p, room.one, 0)
    if not (aside if abs(room.one[0]) < CONDITION_VANISHES * abs(aside) else room.one[0]) > 0.0:
        return 0
    found.margins[surface.at], found.places[surface.at] = least, place
    return EARLY if least < -allowed else 0


@njit(**INNER)
def _crossed(view, curve, surface, way, j, armed, room, found):
    """Return EARLY where the condition holds as the surface is passed, before the fine sample `j`; and whether it is not.

    way: 1 to beyond it, -1 back. A function that jumps, or has a pole, changes its sign without being zero: that is no
    event.
    """
    above, below = way * surface.height[j - 1], way * surface.height[j]
    apart = abs(above) + abs(below)
    low, high, what = fine(curve, j - 1), fine(curve, j), view.n + view.outputs + surface.transition
    for _ in range(50 if armed else 0):
        place = 0.5 * (low + high)
        value = sample(view, curve, what, way * surface.sign, place, room.x, room.out)
        if value < 0.0:
            high, below = place, value
        else:
            low, above = place, value
    if armed and abs(above - below) > max(SHRINKS * apart, surface.small):
        return 0, True
    sample(view, curve, int64(0), 1.0, low, room.x, room.out)
    return holds(view, surface.transition, room.x, surface.at, room, found), False


@njit(**INNER)
def _at_seam(view, curve, surface, seen, room, found):
    """Note an extremum where a segment without events begins, which is no end; return EARLY where it is due."""
    outlined()
    height, total, bad = surface.height, curve.count * FINE, 0
    what = view.n + view.outputs + surface.transition
    for side in range(2):
        up = 1.0 if side == 0 else -1.0
        fa, fm, fb = up * height[total - 1], up * height[0], up * height[1]
        if not (fm <= fa and fm <= fb and fm < max(fa, fb)):
            continue
        if not (seen if side == 0 else not seen and fm <= max(fa, fb) - fm):
            continue
        place, least = turning(view, curve, what, up * surface.sign, room.x, room.out)
        beside = fine(curve, total - 1 if side == 0 else 1)
        bad |= _noted(view, curve, surface, least, place, beside, surface.small, room, found)
    return bad
