"""Compiled looks at events that share a surface with that of a segment's end: docs/theory/orbits.md, "Admissibility"."""

from __future__ import annotations

from saltus.flow.kernels.segment import EVENT_X
from saltus.flow.kernels.side import RESET, EventEnds, SideRoom, turns_back
from saltus.flow.kernels.step import ROUNDING
from saltus.orbits.kernels.curve import GUARD
from saltus.orbits.signature import EARLY, EVENT_END, SECTION
from saltus.scales import CARRIED, CONDITION_INCLUDES, MET
from saltus.system.numba_tools.machine_code import njit
from saltus.system.numba_tools.pointers import INNER, call, outlined, pointer

MADE = 1  # of an event that the orbit has at the same time as another one, before that one
DUE = 2  # behind that one


@njit(**INNER)
def together(view, piece, following, curve, row, rate, instant, room, found):
    """Return EARLY where another event happens at a segment's end before its own event, or behind that one at once.

    following: mode of the next segment. row: that of the segment in `Found`. rate: of the event function at the segment's end. instant:
    the events of the orbit at the same time, as `at_one_time` notes them: these do happen.
    """
    outlined()
    mode, transition, end, after = piece.mode, piece.transition, pointer(curve.nodes, curve.count * view.n), room.x
    call(view.functions[RESET], transition, 0, end, 0, view.p, after, 0)
    way, bad = 1.0 if rate > 0.0 else -1.0, 0
    if mode == following and not view.idle[transition] and _repeats(view, transition, rate, end, after, room):
        bad |= EARLY
    for k in range(view.transitions):
        if k == transition or instant[k] == MADE or view.idle[k] or view.alike[k] != view.alike[transition]:
            continue
        direction, at = view.directions[k], row * view.transitions + k
        is_first = view.sources[k] == mode and k < transition and direction * way >= 0.0
        if is_first and not _opposite(view, k, transition, end, room):
            bad |= holds(view, k, end, at, room, found)
        if view.sources[k] != following or view.surfaces[k] == SECTION or (direction == 0 and mode != following):
            continue
        if instant[k] == DUE:
            continue
        height, _, goes_on = _beyond(view, k, direction if direction != 0 else way, after, room)
        if goes_on and abs(height) <= MET:
            bad |= holds(view, k, after, at, room, found)
    return bad


@njit(**INNER)
def is_at_once(view, piece, x, room):
    """Return whether a segment from x has its event at once upon the one before: it has no length, and passes a surface."""
    if piece.transition < 0 or piece.kind != EVENT_END:
        return False
    way = 1.0 if view.directions[piece.transition] >= 0 else -1.0
    height, rate, goes_on = _beyond(view, piece.transition, way, x, room)
    if view.directions[piece.transition] == 0 and not goes_on:
        height, rate, goes_on = _beyond(view, piece.transition, -way, x, room)
    reach = 0.0
    for e in range(view.n):
        reach += abs(room.slope[2 + e]) * view.sizes[e]
    return goes_on and abs(height) <= MET and abs(piece.duration * rate) <= MET * reach


@njit(**INNER)
def at_one_time(system, once, i, transitions, instant):
    """Note in `instant` the events that an orbit has at the same time as that at the end of segment i.

    once: of each segment whether it has no length.
    """
    for k in range(transitions):
        instant[k] = 0
    for way in (-1, 1):
        j = i
        for _ in range(system.segments - 1):
            if once[j if way < 0 else (j + 1) % system.segments] == 0:
                break
            j = (j + way) % system.segments
            if system.transitions[j] >= 0:
                instant[system.transitions[j]] = MADE if way < 0 else DUE


@njit(**INNER)
def _beyond(view, k, way, x, room):
    """Return an event function over its variation, its rate, and whether this is, beyond rounding, in a direction."""
    call(view.functions[EVENT_X], k, 0, x, 0, view.p, room.slope, 0)
    height, rate, reach, speed = room.slope[0], room.slope[1], 0.0, 0.0
    for e in range(view.n):
        reach += abs(room.slope[2 + e]) * view.sizes[e]
        speed += abs(room.slope[2 + view.n + e]) * view.sizes[e]
    return height / reach if reach > 0.0 else 0.0, rate, way * rate > MET * speed


@njit(**INNER)
def _repeats(view, k, rate, end, after, room):
    """Return whether a motion goes on through the surface all the same, though the reset turns motions back there.

    It is asked only where the reset leaves the motion on the surface: from elsewhere it has to come back to it. The
    motion is there if its height is rounding, or what the end's own height, which is not exactly 0, becomes.
    """
    way = 1.0 if rate > 0.0 else -1.0
    left, _, _ = _beyond(view, k, way, end, room)
    height, behind, goes_on = _beyond(view, k, way, after, room)
    if not abs(height) <= ROUNDING + CARRIED * abs(left):
        return False
    ends, scratch = EventEnds(end, after, view.sizes), SideRoom(room.probe, room.field, room.slope)
    return goes_on and turns_back(view.functions, view.n, view.p, k, (rate, behind), ends, scratch)


@njit(**INNER)
def _opposite(view, k, other, x, room):
    """Return whether the condition of a transition is that of another one with the other sign: one of both holds."""
    call(view.functions[GUARD], view.modes + k, 0, x, 0, view.p, room.one, 0)
    one = room.one[0]
    call(view.functions[GUARD], view.modes + other, 0, x, 0, view.p, room.one, 0)
    return abs(one + room.one[0]) <= MET * (abs(one) + abs(room.one[0])) + CONDITION_INCLUDES


@njit(**INNER)
def holds(view, k, x, at, room, found):
    """Return EARLY where the condition of transition `k` holds in a state on its surface; `at`: its entry in `Found`."""
    call(view.functions[GUARD], view.modes + k, 0, x, 0, view.p, room.one, 0)
    if not found.unmet[at] <= -room.one[0]:
        found.unmet[at] = -room.one[0]
    found.counts[at] += 1
    return EARLY if room.one[0] > 0.0 else 0
