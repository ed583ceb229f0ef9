"""Compiled dense look at a periodic orbit: docs/theory/orbits.md, "Admissibility"."""

from __future__ import annotations

import math

import numpy as np
from numba import int64

from saltus.flow.kernels.event import AT_WRAP
from saltus.flow.kernels.segment import EVENT_X, FIELD, Segment, dense, leaps, missed
from saltus.flow.kernels.stages import dense_value
from saltus.flow.kernels.state import EPSILON
from saltus.orbits.kernels.curve import (
    EVENT,
    FINE,
    GUARD,
    OUTPUTS,
    Curve,
    Room,
    View,
    at_phase,
    fine,
    lowest,
    lowest_at_end,
)
from saltus.orbits.kernels.equation import RESET, TURN, piece_at, pointed, take_parameters, total_duration
from saltus.orbits.kernels.margin import margin
from saltus.orbits.kernels.moment import add_moments
from saltus.orbits.kernels.together import at_one_time, is_at_once, together
from saltus.orbits.records import Dense, Events, Found, Mesh, Orbit
from saltus.orbits.signature import (
    CLOSED_END,
    COARSE,
    CUT_END,
    DIRECTION,
    DOMAIN,
    DURATION,
    MEAN_END,
    ONWARD_END,
    PHASE_END,
    ROOT,
    TOUCH_END,
    VALUE,
    WHEN,
)
from saltus.scales import EXTREME_SURVEYED, STEPS_TOGETHER
from saltus.system.numba_tools.machine_code import kernel, njit
from saltus.system.numba_tools.pointers import INNER, call, invoke, keep, outlined, pointer

MOVED = 3.0  # ways that exponents may go in a step of a mesh that was moved since it was made with 1


@kernel
def survey(orbit, events, mesh, curves, tolerances, sizes, u, found):
    """Follow an orbit densely: extremes and means of states and outputs, margins to events, velocities, state at phase 0.

    orbit, events, mesh, curves, found: the fields of `Orbit`, `Events`, `Mesh`, `Dense` and `Found`; the last two are
    written. tolerances: relative and absolute. Returns the bits of what makes the orbit inadmissible, and COARSE where a
    step passed over something.
    """
    orbit, events, mesh, curves, given = Orbit(*orbit), Events(*events), Mesh(*mesh), Dense(*curves), Found(*found)
    take_parameters(orbit.functions, u, orbit.modes.size * (orbit.n + 1), orbit.active, orbit.scales, orbit.p)
    system, n, starts, u = pointed(orbit), orbit.n, pointer(mesh.starts, 0), pointer(u, 0)
    segments, transitions, kinds = system.segments, system.transitions, system.kinds
    period, most, pieces = total_duration(u, segments, n), _most_samples(kinds, starts, segments), 0
    for i in range(segments):
        pieces += 1 if kinds[i] == CUT_END or kinds[i] == ONWARD_END else 0
    # what the pieces of a smooth orbit that is cut are put together in, as one segment
    joined = np.empty((most // FINE + 2) * (8 * n + 1) if pieces > 0 else 0)
    block = np.empty(5 * n + 4 + max(events.outputs, 2) + (n + events.outputs + events.sources.size) * most)
    view = _viewed(system, events, pointer(sizes, 0), period)
    room, found = _laid_out(pointer(block, 0), view, most), _pointed(given)
    for q in range(n + view.outputs):
        found.lows[q] = np.inf
        found.highs[q] = -np.inf
        for k in range(3):
            found.moments[3 * q + k] = 0.0
    begun, turns, start = 0.0, max(orbit.turns, 1), u[n - 1] * (TURN / orbit.turn) if events.phase else 0.0
    bad, found_zero, head, steps, wound = 0, False, 0, int64(0), orbit.turn * orbit.turns
    target = _first_zero(u[n - 1], transitions[segments - 1], orbit.turns, orbit.turn) if events.phase else 0.0
    once, instant = np.zeros(segments, np.int64), np.zeros(2 * view.transitions, np.int64)
    at_once, at_one, at_start = pointer(once, 0), pointer(instant, 0), pointer(instant, view.transitions)
    for i in range(segments):
        piece = piece_at(system, i, u, period)
        # what the event before could not hold up was due with it: a segment of another mode is a border
        same = system.modes[i - 1 if i > 0 else segments - 1] == piece.mode
        at_once[i] = 1 if same and is_at_once(view, piece, pointer(u, piece.row), room) else 0
        if at_once[i] == 0 and ((not piece.duration > 0.0 and piece.kind != MEAN_END) or piece.duration < 0.0):
            bad |= DURATION
    for i in range(segments):
        piece, first, count = piece_at(system, i, u, period), starts[i], starts[i + 1] - starts[i] - 1
        nodes, coefficients = pointer(curves.nodes, first * n), pointer(curves.coefficients, first * 7 * n)
        curve = Curve(piece.mode, piece.duration, pointer(mesh.places, first), count, nodes, coefficients)
        if not _goes_on(kinds, i):
            head, steps = i, int64(0)
        bad |= _followed(view, piece, curve, u, tolerances, room)
        add_moments(view, curve, begun, start, turns, room, found.moments)
        begun += piece.duration
        begin, rates = pointer(u, head * (n + 1)), pointer(found.rates, 4 * i)
        bad |= _ended(view, piece, curve, u, begin, (wound, orbit.angles), tolerances, room, rates)
        _unmet(found, i * view.transitions, view.transitions)
        if piece.transition >= 0 and piece.kind != TOUCH_END:
            following, rate = system.modes[i + 1 if i + 1 < segments else 0], found.rates[4 * i]
            at_one_time(system, at_once, i, view.transitions, at_one)
            bad |= together(view, piece, following, curve, i, rate, at_one, room, found)
        onward = i + 1 < segments and _goes_on(kinds, i + 1)
        if head < i or onward:
            steps = _append(pointer(joined, 0), most // FINE + 2, curve, n, steps, i - head)
            if onward:
                continue
            nodes = pointer(joined, most // FINE + 2)
            coefficients = pointer(nodes, (most // FINE + 2) * n)
            curve = Curve(piece.mode, piece.duration, pointer(joined, 0), steps, nodes, coefficients)
        bad |= _sampled(view, curve, tolerances, room, found)
        if events.phase and not found_zero:
            found_zero = _reached(view, curve, target, room, found.x0)
        _extremes(view, curve, room, found)
        before = transitions[(head if head > 0 else segments) - 1]
        # a flight is told of where its event is
        row = i if piece.transition >= 0 else head
        closed = kinds[head] == PHASE_END or kinds[head] == CLOSED_END
        at_one_time(system, at_once, i, view.transitions, at_one)
        at_one_time(system, at_once, (head if head > 0 else segments) - 1, view.transitions, at_start)
        for k in range(view.transitions):
            if view.sources[k] == piece.mode:
                there = at_one[k] != 0, at_start[k] != 0
                bad |= margin(view, curve, k, row, piece.transition, before, there, closed, room, found)
    _without_values(found, n, n + view.outputs)
    if not events.phase or not found_zero:
        for e in range(n):
            found.x0[e] = u[e]
    keep(block)
    keep(joined)
    keep(once)
    keep(instant)
    return bad


@njit(**INNER)
def _unmet(found, first, count):
    """Note of the events of a segment that nothing is known of them yet."""
    for k in range(first, first + count):
        found.margins[k] = np.inf
        found.places[k] = 0.5
        found.distances[k] = np.nan
        found.behind[k] = np.nan
        found.unmet[k] = np.nan
        found.counts[k] = 0


@njit(**INNER)
def _without_values(found, states, quantities):
    """Complete the extremes of states that no segment's mode has, and of outputs without a value on part of the orbit."""
    for q in range(states):
        if found.lows[q] > found.highs[q]:
            found.lows[q] = found.highs[q] = 0.0
    for q in range(quantities):
        if math.isnan(found.moments[3 * q]):
            found.lows[q] = found.highs[q] = np.nan


@njit(**INNER)
def _goes_on(kinds, i):
    """Whether a piece begins where its segment is cut."""
    return kinds[i] == CUT_END or (i > 0 and kinds[i - 1] == ONWARD_END)


@njit(**INNER)
def _most_samples(kinds, starts, segments):
    """Return the most fine samples that a segment, put together where it is cut, has."""
    most, longest = 0, 0
    for i in range(segments):
        longest = starts[i + 1] - starts[i] - 1 + (longest if _goes_on(kinds, i) else 0)
        most = max(most, FINE * longest + 1)
    return most


@njit(**INNER)
def _viewed(system, events, sizes, period):
    """Return what a survey looks at an orbit with."""
    return View(
        system.functions,
        system.p,
        system.n,
        events.modes,
        events.outputs,
        events.sources.size,
        pointer(events.sources, 0),
        pointer(events.directions, 0),
        pointer(events.surfaces, 0),
        pointer(events.alike, 0),
        pointer(events.idle, 0),
        pointer(events.absent, 0),
        sizes,
        period,
        system.implicit[1],
        system.implicit[3],
    )


@njit(**INNER)
def _laid_out(block, view, most):
    """Return a survey's scratch, laid out in a block of 5 n + 4 + max(outputs, 2) + (n + outputs + transitions) * most."""
    n = view.n
    out = pointer(block, 5 * n + 4)
    values = pointer(out, max(view.outputs, 2))
    heights = pointer(values, (n + view.outputs) * most)
    field, slope, one = pointer(block, 2 * n), pointer(block, 3 * n), pointer(block, 5 * n + 2)
    return Room(block, pointer(block, n), field, slope, one, out, values, heights)


@njit(**INNER)
def _pointed(found):
    """Return what a survey writes, on pointers."""
    return Found(
        pointer(found.lows, 0),
        pointer(found.highs, 0),
        pointer(found.margins, 0),
        pointer(found.places, 0),
        pointer(found.rates, 0),
        pointer(found.distances, 0),
        pointer(found.behind, 0),
        pointer(found.unmet, 0),
        pointer(found.counts, 0),
        pointer(found.x0, 0),
        pointer(found.moments, 0),
    )


@njit(**INNER)
def _first_zero(phase, last, turns, turn):
    """Return the first wrap at or behind the phase at which an orbit starts; last: the transition that ends it."""
    nearest = turn * math.floor(phase / turn + 0.5)
    if last >= 0 and abs(phase - nearest) <= AT_WRAP:
        # the strobe looks before the jump at phase 0 that the orbit starts with, which is where the period ends
        return nearest + turn * turns
    return turn * math.ceil(phase / turn - 1e-13)


@njit(**INNER)
def _followed(view, piece, curve, u, tolerances, room):
    """Run a segment and keep its dense output; return COARSE where it is due."""
    outlined()
    n, bad = view.n, 0
    segment = Segment(view.functions, piece.mode, piece.duration, view.p, n)
    x0 = pointer(u, piece.row)
    if view.implicit == 0:
        dense(segment, x0, curve.mesh, curve.count, curve.nodes, curve.coefficients)
    else:
        invoke(
            view.implicit,
            (view.functions, piece.mode, n, view.p, piece.duration, x0, curve.mesh, int64(curve.count), curve.nodes,
             curve.coefficients),
        )  # fmt: skip
    for step in range(curve.count):
        a = curve.mesh[step]
        bend, node = pointer(curve.coefficients, step * 7 * n), pointer(curve.nodes, step * n)
        h = curve.mesh[step + 1] - a
        if view.check != 0:
            given = (
                view.functions,
                piece.mode,
                n,
                view.p,
                piece.duration,
                a,
                h,
                node,
                bend,
                tolerances[0],
                tolerances[1],
            )
            coarse = leaps(segment, h, MOVED, bend, node) or not invoke(view.check, given) <= 1.0
        else:
            rtol, atol = tolerances
            coarse = missed(segment, a, h, MOVED, bend, node, room.x, room.probe, room.field, rtol, atol)
        if coarse:
            return bad | COARSE
    return bad


@njit(**INNER)
def _ended(view, piece, curve, u, begin, closing, tolerances, room, rates):
    """Write a segment's row of `Found.rates`; return DIRECTION, WHEN and ROOT where they are due.

    begin: state at its start. closing: angle of the phase in the period, and the states on a circle.
    """
    outlined()
    functions, p, n, transition, following = view.functions, view.p, view.n, piece.transition, piece.following
    x, field, slope, one, bad = room.x, room.field, room.slope, room.one, 0
    end = pointer(curve.nodes, curve.count * n)
    for e in range(n):
        x[e] = end[e]
    if transition >= 0 and piece.kind != TOUCH_END:
        call(functions[RESET], transition, 0, end, 0, p, x, 0)
    wound, angles = closing
    for k in range(angles.size):
        e = angles[k]
        x[e] -= TURN * math.floor((x[e] - u[following + e]) / TURN + 0.5)
    gap = 0.0
    for e in range(n):
        turn = wound if following == 0 and e == n - 1 else 0.0
        gap = max(gap, abs(x[e] - u[following + e] - turn))
    rates[2], rates[3] = gap, 1.0
    if transition >= 0:
        call(functions[EVENT], transition, 0, end, 0, p, one, 0)
        rates[0] = one[1]
        rates[2] = max(gap, abs(one[0]))
        call(functions[EVENT_X], transition, 0, end, 0, p, slope, 0)
        call(functions[FIELD], piece.mode, 0, end, 0, p, field, 0)
        # an event that depends on one state alone is met at a grazing with a velocity that is rounding of nothing
        speed = 0.0
        for e in range(n):
            speed += abs(slope[2 + e] * field[e]) + abs(slope[2 + e]) * view.sizes[e] / view.period
        if piece.kind != TOUCH_END and view.directions[transition] * one[1] < -1e-9 * speed:
            bad |= DIRECTION
        call(functions[GUARD], view.modes + transition, 0, end, 0, p, one, 0)
        rates[3] = one[0]
        if not one[0] > 0.0:
            bad |= WHEN
        if piece.kind != TOUCH_END and _under_root(view, view.modes + transition, end, tolerances, room):
            bad |= ROOT
        call(functions[EVENT], transition, 0, begin, 0, p, one, 0)
        rates[1] = one[1]
    return bad


@njit(**INNER)
def _append(whole, room, curve, n, steps, shift):
    """Put a piece of a cut segment behind the steps of those before it; return the count of all.

    whole: places (room,), shifted by the number of the piece, nodes (room, n) and coefficients (room, 7 n).
    """
    count, paths = curve.count, pointer(whole, room)
    bends = pointer(paths, room * n)
    for step in range(count + 1):
        whole[steps + step] = shift + curve.mesh[step]
    for e in range((count + 1) * n):
        paths[steps * n + e] = curve.nodes[e]
    for e in range(count * 7 * n):
        bends[steps * 7 * n + e] = curve.coefficients[e]
    return steps + count


@njit(**INNER)
def _sampled(view, curve, tolerances, room, found):
    """Write what there is at a segment's fine samples, and extremes; return VALUE, DOMAIN and ROOT."""
    outlined()
    functions, p, n, outputs, mode = view.functions, view.p, view.n, view.outputs, curve.mode
    x, one, out, total, bad = room.x, room.one, room.out, curve.count * FINE, 0
    for j in range(total + 1):
        step = min(j // FINE, curve.count - 1)
        if j % FINE == 0:
            for e in range(n):
                x[e] = curve.nodes[(j // FINE) * n + e]
        else:
            part = (j - step * FINE) / FINE
            dense_value(curve.coefficients, step * 7 * n, n, curve.nodes, step * n, part, x)
        for e in range(n):
            if not abs(x[e]) < 1e300:
                bad |= VALUE
        call(functions[GUARD], mode, 0, x, 0, p, one, 0)
        if not one[0] > 0.0:
            bad |= DOMAIN
        if _under_root(view, mode, x, tolerances, room):
            bad |= ROOT
        if outputs > 0:
            call(functions[OUTPUTS], mode, 0, x, 0, p, out, 0)
        for q in range(n + outputs):
            value = x[q] if q < n else out[q - n]
            room.values[q * (total + 1) + j] = value
            if q >= n or view.absent[mode * n + q] == 0:
                found.lows[q] = min(found.lows[q], value)
                found.highs[q] = max(found.highs[q], value)
        for k in range(view.transitions):
            if view.sources[k] == mode:
                call(functions[EVENT], k, 0, x, 0, p, one, 0)
                room.heights[k * (total + 1) + j] = -one[0] if view.directions[k] > 0 else one[0]
    return bad


@njit(**INNER)
def _under_root(view, place, x, tolerances, room):
    """Whether an argument of a root is negative at a state, beyond what the errors of the states make of it.

    place: a mode, or behind the modes a transition, whose roots are looked at.
    """
    n, first = view.n, view.modes + view.transitions + place
    call(view.functions[GUARD], first, 0, x, 0, view.p, room.one, 0)
    if not room.one[0] < 0.0:
        return False
    sized, allowed = room.slope, STEPS_TOGETHER / EPSILON
    for e in range(n):
        sized[e] = x[e]
        sized[n + e] = allowed * (tolerances[1] + tolerances[0] * view.sizes[e])
    call(view.functions[GUARD], first + view.modes + view.transitions, 0, sized, 0, view.p, sized, 2 * n)
    return sized[2 * n] < 0.0


@njit(**INNER)
def _reached(view, curve, target, room, x0):
    """Whether a segment's phase reaches `target`; the state there is written."""
    total = curve.count * FINE
    phases = pointer(room.values, (view.n - 1) * (total + 1))
    for j in range(total + 1):
        if phases[j] >= target - (AT_WRAP if j == total else 1e-13):
            at_phase(view, curve, fine(curve, max(j - 1, 0)), fine(curve, j), target, x0, room.out)
            return True
    return False


@njit(**INNER)
def _extremes(view, curve, room, found):
    """Refine the extremes of states and outputs that a segment's fine samples show."""
    outlined()
    quantities, total, lows, highs = view.n + view.outputs, curve.count * FINE, found.lows, found.highs
    for side in range(2 * quantities):
        sign, q = (1.0, side) if side < quantities else (-1.0, side - quantities)
        if q < view.n and view.absent[curve.mode * view.n + q] != 0:
            continue
        value = pointer(room.values, q * (total + 1))
        for j in range(total + 1):
            # an end that is least beside the sample next to it may have a lower place between them
            inner = 1 if j == 0 else total - 1
            at_end = j == 0 or j == total
            fa, fm = sign * value[inner if at_end else j - 1], sign * value[j]
            fb = fa if at_end else sign * value[j + 1]
            least = lows[q] if sign > 0.0 else -highs[q]
            # the sampled peak that wins may belong to another true one
            if fm <= fa and fm < fb and fm <= least + EXTREME_SURVEYED * (highs[q] - lows[q]):
                if at_end:
                    ends = fine(curve, j), fine(curve, inner)
                    least = lowest_at_end(view, curve, q, sign, ends, (fm, fa), room.x, room.out)
                else:
                    _, least = lowest(view, curve, q, sign, j, fa, fm, fb, room.x, room.out)
                if sign > 0.0:
                    lows[q] = min(lows[q], least)
                else:
                    highs[q] = max(highs[q], -least)
