"""Compiled looks at events that share a surface with that of a segment's end: docs/theory/orbits.md, "Admissibility"."""

from __future__ import annotations

from saltus.flow.kernels.segment import EVENT_X
from saltus.flow.kernels.side import APART, RESET, REVERSED
from saltus.orbits.kernels.curve import EVENT, GUARD
from saltus.orbits.signature import EARLY, SECTION
from saltus.system.numba_tools.machine_code import njit
from saltus.system.numba_tools.pointers import INNER, call, outlined, pointer

ZERO = 1e-9  # value of an event function, over its variation with the states' sizes, up to which it is 0

LEAST = 1e-290  # beyond what a condition that includes 0 adds to be positive there


@njit(**INNER)
def together(view, piece, following, curve, head, room, found):
    """Return EARLY where another event happens at a segment's end before its own event, or behind that one at once.

    following: mode of the next segment. head: the segment.
    """
    outlined()
    mode, transition, end, after = piece.mode, piece.transition, pointer(curve.nodes, curve.count * view.n), room.x
    call(view.functions[RESET], transition, 0, end, 0, view.p, after, 0)
    call(view.functions[EVENT_X], transition, 0, end, 0, view.p, room.slope, 0)
    way, bad = 1.0 if room.slope[1] > 0.0 else -1.0, 0
    if mode == following and not view.idle[transition] and _repeats(view, transition, way, end, after, room):
        bad |= EARLY
    for k in range(view.transitions):
        if k == transition or view.idle[k] or view.alike[k] != view.alike[transition]:
            continue
        direction = view.directions[k]
        if (
            view.sources[k] == mode
            and k < transition
            and direction * way >= 0.0
            and not _opposite(view, k, transition, end, room)
        ):
            bad |= holds(view, k, end, head * view.transitions + k, room, found)
        if view.sources[k] != following or view.surfaces[k] == SECTION or (direction == 0 and mode != following):
            continue
        call(view.functions[EVENT_X], k, 0, after, 0, view.p, room.slope, 0)
        reach, speed = 0.0, 0.0
        for e in range(view.n):
            reach += abs(room.slope[2 + e]) * view.sizes[e]
            speed += abs(room.slope[2 + view.n + e]) * view.sizes[e]
        goes_on = (direction if direction != 0 else way) * room.slope[1] > ZERO * speed
        if goes_on and abs(room.slope[0]) <= ZERO * reach:
            bad |= holds(view, k, after, head * view.transitions + k, room, found)
    return bad


@njit(**INNER)
def _repeats(view, k, way, end, after, room):
    """Return whether a motion goes on through the surface all the same, though the reset turns motions back there.

    It is the rule of `saltus.flow.kernels.side.side_after`.
    """
    call(view.functions[EVENT], k, 0, end, 0, view.p, room.one, 0)
    before = room.one[1]
    call(view.functions[EVENT_X], k, 0, after, 0, view.p, room.slope, 0)
    rate, speed = room.slope[1], 0.0
    for e in range(view.n):
        speed += abs(room.slope[2 + view.n + e]) * view.sizes[e]
    if not way * rate > ZERO * speed:
        return False
    for e in range(view.n):
        room.probe[e] = end[e] + (APART * view.sizes[e] if after[e] != end[e] else 0.0)
    call(view.functions[EVENT], k, 0, room.probe, 0, view.p, room.one, 0)
    change = room.one[1] - before
    call(view.functions[RESET], k, 0, room.probe, 0, view.p, room.field, 0)
    call(view.functions[EVENT], k, 0, room.field, 0, view.p, room.one, 0)
    return (room.one[1] - rate) * change < REVERSED * change * change


@njit(**INNER)
def _opposite(view, k, other, x, room):
    """Return whether the condition of a transition is that of another one with the other sign: one of both holds."""
    call(view.functions[GUARD], view.modes + k, 0, x, 0, view.p, room.one, 0)
    one = room.one[0]
    call(view.functions[GUARD], view.modes + other, 0, x, 0, view.p, room.one, 0)
    return abs(one + room.one[0]) <= ZERO * (abs(one) + abs(room.one[0])) + LEAST


@njit(**INNER)
def holds(view, k, x, at, room, found):
    """Return EARLY where the condition of transition `k` holds in a state on its surface; `at`: its entry in `Found`."""
    call(view.functions[GUARD], view.modes + k, 0, x, 0, view.p, room.one, 0)
    if not found.unmet[at] <= -room.one[0]:
        found.unmet[at] = -room.one[0]
    found.counts[at] += 1
    return EARLY if room.one[0] > 0.0 else 0
