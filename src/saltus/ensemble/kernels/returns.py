"""The loop over lanes whose motions return to a section, each with parameters of its own.

Steps, events and changes of pool are those of `saltus.ensemble.kernels.life`. A motion has no fate here: its returns are
counted, and the last ones kept.
"""

from __future__ import annotations

import math

from saltus.ensemble.kernels.lanes import SCALAR, ld, st
from saltus.ensemble.kernels.life import (
    COUNT,
    FLAG,
    ITOL,
    TIME,
    WAIT,
    begin,
    joins,
    next_to_look_at,
    part,
    passed_on,
    read,
    stepped,
    turned,
    under_way,
    worth_while,
)
from saltus.ensemble.labels import AT_STROBE, DONE, HARD, LEFT_OVER, MOST_STEPS, NL, REFUSED
from saltus.system.numba_tools.machine_code import njit

__all__ = ["follow_returns"]

# Places in `clocks`: the time since a motion's start when it was last looked at, and at its last return.
BASE = 0
LAST = 1
N_CLOCKS = 2
PARALLEL = 1e-9  # length of a perturbation across the others, over its own, below which its direction is lost


@part
def begun(i, R, lane, lanes, motions, section, found, clocks):
    """Begin motion i in a lane of R; return its pool, or a negative number where it makes no step here."""
    n = motions.points.shape[1]
    for e in range(n):
        st(R, e * NL, lane, motions.points[i, e])
    for e in range(motions.numbers.shape[1]):
        st(R, (section.first + e) * NL, lane, motions.numbers[i, e])
    st(R, (n + TIME) * NL, lane, motions.times[i])
    st(R, (n + COUNT) * NL, lane, 0.0)
    st(R, (n + FLAG) * NL, lane, 0.0)
    st(R, (n + WAIT) * NL, lane, 0.0)
    st(R, (n + ITOL) * NL, lane, section.itol)
    st(R, section.taken * NL, lane, 0.0)
    clocks[i, BASE], clocks[i, LAST] = -motions.times[i], 0.0
    pool = begin(lanes, motions.modes[i], R, lane)
    if pool < 0:
        found.labels[i] = REFUSED
    return pool


@part
def returned(i, mode, x, phase, section, found, clocks):
    """Count a return of motion i in a state, and keep it; whether it is the last one."""
    place, time = found.seen[i] - section.skip, clocks[i, BASE] + phase
    found.seen[i] += 1
    found.gaps[i] = max(found.gaps[i], time - clocks[i, LAST])
    clocks[i, LAST] = time
    if place >= 0:
        for e in range(x.size):
            found.states[i, place, e] = x[e]
        found.phases[i, place], found.times[i, place], found.modes[i, place] = phase, time, mode
    return place == section.keep - 1


@part
def done(i, mode, phase, found):
    """End motion i, whose last state is kept."""
    found.end_times[i], found.end_modes[i], found.labels[i] = phase, mode, 0
    return DONE


@part
def orthonormal(i, R, lane, n, weights, section, found):
    """Make the perturbations of motion i orthonormal, and keep the logarithms of their lengths; whether they had any.

    Modified Gram-Schmidt, a second time for each. weights: (m, states), inverse units of their components.
    """
    columns, place = found.logs.shape[2], found.seen[i] - section.skip
    states = n // (1 + columns)
    for c in range(columns):
        at = states * (1 + c)
        before = length(i, R, lane, at, weights)
        for b in range(2 * c):
            other = states * (1 + b % c)
            product = 0.0
            for e in range(states):
                one, two = ld(R, (other + e) * NL, lane), ld(R, (at + e) * NL, lane)
                product += (one * weights[i, e]) * (two * weights[i, e])
            for e in range(states):
                st(R, (at + e) * NL, lane, ld(R, (at + e) * NL, lane) - product * ld(R, (other + e) * NL, lane))
        left = length(i, R, lane, at, weights)
        if not (left > PARALLEL * before and left > 0.0 and left < math.inf):
            return False
        for e in range(states):
            st(R, (at + e) * NL, lane, ld(R, (at + e) * NL, lane) / left)
        if place >= 0:
            found.logs[i, place, c] = math.log(left)
    return True


@part
def length(i, R, lane, at, weights):
    """Length of a perturbation of motion i, from its first field."""
    total = 0.0
    for e in range(weights.shape[1]):
        total += (ld(R, (at + e) * NL, lane) * weights[i, e]) ** 2
    return math.sqrt(total)


@part
def looked_at(i, k, R, lane, x, lanes, motions, section, found, clocks, looks):
    """Look at motion i at phase 0, or after an interval; return its pool, or a negative number."""
    n = x.size
    clocks[i, BASE] += motions.numbers[i, section.period]
    st(R, (n + TIME) * NL, lane, 0.0)
    st(R, (n + COUNT) * NL, lane, 0.0)
    if section.at_look:
        if found.logs.shape[2] > 0 and not orthonormal(i, R, lane, n, motions.weights, section, found):
            found.labels[i] = LEFT_OVER
            return HARD
        read(lanes, k, R, lane, x)
        if returned(i, lanes.mode_of[k], x, 0.0, section, found, clocks):
            for e in range(n):
                found.ends[i, e] = x[e]
            return done(i, lanes.mode_of[k], 0.0, found)
        return k
    looks[i] += 1
    if looks[i] > section.patience:
        found.labels[i] = LEFT_OVER
        return HARD
    return k


@part
def happened(i, k, R, lane, x, lanes, section, found, clocks, looks):
    """Let what a step has met happen to motion i; return its pool, or a negative number."""
    n = x.size
    for e in range(n):
        x[e] = ld(R, e * NL, lane)
    st(R, section.taken * NL, lane, 0.0)
    pool = turned(lanes, k, R, lane)
    if pool < 0:
        found.labels[i] = LEFT_OVER
        return pool
    taken = int(ld(R, section.taken * NL, lane))
    if taken > 0 and section.transitions[taken - 1] == 1:
        looks[i] = 0
        phase = ld(R, (n + TIME) * NL, lane)
        if returned(i, lanes.mode_of[k], x, phase, section, found, clocks):
            for e in range(n):
                found.ends[i, e] = ld(R, e * NL, lane)
            return done(i, lanes.mode_of[pool], phase, found)
    return pool


@part
def after_step(i, k, R, lane, x, lanes, motions, section, found, clocks, looks):
    """Return the pool of motion i, which does not simply go on, or a negative number."""
    if ld(R, (x.size + FLAG) * NL, lane) == AT_STROBE:
        return looked_at(i, k, R, lane, x, lanes, motions, section, found, clocks, looks)
    if not ld(R, (x.size + COUNT) * NL, lane) < MOST_STEPS:
        found.labels[i] = LEFT_OVER
        return HARD
    return happened(i, k, R, lane, x, lanes, section, found, clocks, looks)


@njit(cache=True, **SCALAR)
def follow_returns(lanes, motions, section, found, alive, scratch, clocks):
    """Follow motions until each has made all its returns, or is left to others.

    lanes: `Lanes` of a system, each with numbers of its own. alive: how many motions are under way at once. clocks: room,
    (m, N_CLOCKS). The looks since the last return are counted in `scratch.seen`.
    """
    S, who, count, looks, x = scratch
    at, spare = 0, count.size
    while True:
        total = under_way(count)
        while total < alive and at < motions.points.shape[0]:
            to = begun(at, S[spare], 0, lanes, motions, section, found, clocks)
            if to >= 0:
                joins(lanes, S, who, count, to, at)
                total += 1
            at += 1
        if total == 0:
            return
        least = worth_while(count, total >= alive)
        for k in range(count.size):
            if count[k] < least:
                continue
            R = S[k]
            flags, steps = stepped(lanes, k, R, count[k], x.size)
            lane = next_to_look_at(0, count[k], flags, steps)
            while lane < count[k]:
                i = who[k, lane]
                to = after_step(i, k, R, lane, x, lanes, motions, section, found, clocks, looks)
                if to == k:
                    lane += 1
                else:
                    passed_on(lanes, S, who, count, k, lane, to)
                lane = next_to_look_at(lane, count[k], flags, steps)
