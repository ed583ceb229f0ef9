"""The life of a lane, and the loop that makes steps of many lanes and moves them between pools.

The life of a lane is the same on processors and on graphics cards: `begun`, then after each step `after_step` unless
the lane `goes_on`, in which it is `looked_at` at phase 0. On processors, functions of a system are called by address,
so that this module is compiled once for all systems; on graphics cards `saltus.ensemble.kernels.cuda` has others in
the place of `begin`, `turned` and `read`.
"""

from __future__ import annotations

import math

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from saltus.ensemble.kernels.lanes import SCALAR, ended, fate, ld, loosened, st, told
from saltus.ensemble.labels import (
    ADDRESSED,
    AT_STROBE,
    DIVERGED,
    FIELDS,
    GOES_ON,
    GONE,
    HARD,
    LEFT_OVER,
    MOST_STEPS,
    NL,
    UNDECIDED,
)  # fmt: skip
from saltus.maps.kernels.steps import turns_beyond
from saltus.system.angles import TURN
from saltus.system.numba_tools.machine_code import njit
from saltus.system.numba_tools.pointers import pointer

__all__ = ["LIFE", "after_step", "begun", "goes_on", "looked_at", "run"]

LIFE = ("begun", "goes_on", "looked_at", "after_step")  # functions that a graphics card takes as they are

BEGIN = ADDRESSED.index("begin")
MOVE = ADDRESSED.index("move")
READ = ADDRESSED.index("read")
STEP = len(ADDRESSED)  # of the first pool
TURNED = ADDRESSED.index("turned")
TIME = FIELDS["t"]
ITOL = FIELDS["itol"]
COUNT = FIELDS["count"]
FLAG = FIELDS["flag"]
WAIT = FIELDS["wait"]
VECTOR = 8  # lanes that a step takes at once: the count of lanes is rounded up to a multiple of them
FEW = 8  # lanes in a pool for which a step is not worth while as long as others are full

part = njit(inline="always", **SCALAR)


@intrinsic
def called(typingctx, address, k, lanes, lane, numbers, quantities):
    """Call a function of a system by its address; see `saltus.ensemble.labels.ADDRESSED`."""

    def lower(context, builder, signature, arguments):
        function, *rest = arguments
        double, integer = ir.DoubleType().as_pointer(), ir.IntType(64)
        kind = ir.FunctionType(integer, [integer, double, integer, double, double])
        return builder.call(builder.inttoptr(function, kind.as_pointer()), rest)

    numeric = types.CPointer(types.float64)
    return types.int64(types.int64, types.int64, numeric, types.int64, numeric, numeric), lower


@part
def begin(lanes, mode, R, lane):
    """Return the pool of a lane that begins in a mode, or HARD."""
    q = pointer(lanes.q, 0)
    return called(lanes.functions[BEGIN], mode, pointer(R, 0), lane, pointer(lanes.p, 0), q)


@part
def turned(lanes, k, R, lane):
    """Return the pool in which a lane of pool k goes on after a step that was flagged, or HARD, or GONE."""
    q = pointer(lanes.q, 0)
    return called(lanes.functions[TURNED], k, pointer(R, 0), lane, pointer(lanes.p, 0), q)


@part
def read(lanes, k, R, lane, x):
    """Write the state of a lane of pool k, at phase 0, into x."""
    called(lanes.functions[READ], k, pointer(R, 0), lane, pointer(x, 0), pointer(lanes.q, 0))


@part
def move(lanes, R, lane, Q, other):
    """Copy the fields of a lane of R into another lane of Q."""
    called(lanes.functions[MOVE], other, pointer(R, 0), lane, pointer(Q, 0), pointer(lanes.q, 0))


@part
def begun(i, R, lane, x, lanes, motions, regions, settings, found):
    """Begin motion i in lane lane of R; return its pool, or a negative number where it makes no step here."""
    n = x.size
    for e in range(n):
        x[e] = motions.points[i, e]
        st(R, e * NL, lane, x[e])
    st(R, (n + TIME) * NL, lane, 0.0)
    st(R, (n + COUNT) * NL, lane, 0.0)
    st(R, (n + FLAG) * NL, lane, 0.0)
    st(R, (n + WAIT) * NL, lane, 0.0)
    st(R, (n + ITOL) * NL, lane, settings.itol)
    pool = begin(lanes, motions.modes[i], R, lane)
    if pool < 0:
        return ended(i, LEFT_OVER, x, motions.modes[i], found)
    mode = lanes.mode_of[pool]
    label = fate(x, mode, settings.limit, regions.cages, regions.ellipsoids, regions.labels)
    return pool if label == UNDECIDED else ended(i, label, x, mode, found)


@part
def goes_on(flag, count):
    """Whether a lane makes its next step with nothing done before, by its flag and its count of steps."""
    return flag == GOES_ON and count < MOST_STEPS


@part
def next_to_look_at(lane, count, flags, steps):
    """Return the next lane, from `lane` on, that does not simply go on."""
    while lane < count and goes_on(flags[lane], steps[lane]):
        lane += 1
    return lane


@part
def looked_at(i, k, R, lane, x, seen, lanes, regions, boxes, settings, found):
    """Look at a motion at phase 0: its visits to boxes so far, and its pool, or DONE where it has a label."""
    n, strobes = x.size, found.strobes[i] + 1
    found.strobes[i] = strobes
    st(R, (n + TIME) * NL, lane, 0.0)
    st(R, (n + COUNT) * NL, lane, 0.0)
    itol = ld(R, (n + ITOL) * NL, lane)
    st(R, (n + ITOL) * NL, lane, loosened(itol, settings.itol, settings.growth, settings.least_itol, strobes))
    read(lanes, k, R, lane, x)
    for j in range(regions.circles.size):  # such a system has no pools but those whose lanes hold the states themselves
        e = regions.circles[j]
        x[e] -= TURN * turns_beyond(x[e])
        st(R, e * NL, lane, x[e])
    seen, label = told(x, lanes.mode_of[k], seen, regions, boxes, settings)
    if label == UNDECIDED and strobes < settings.longest:
        return seen, k
    return seen, ended(i, label, x, lanes.mode_of[k], found)


@part
def after_step(i, k, R, lane, x, seen, lanes, regions, boxes, settings, found):
    """Return the visits to boxes of a motion that does not go on, and its pool, or a negative number."""
    n = x.size
    if ld(R, (n + FLAG) * NL, lane) == AT_STROBE:
        return looked_at(i, k, R, lane, x, seen, lanes, regions, boxes, settings, found)
    pool = turned(lanes, k, R, lane) if ld(R, (n + COUNT) * NL, lane) < MOST_STEPS else HARD
    if pool == HARD:
        found.labels[i] = LEFT_OVER
    elif pool == GONE:
        found.labels[i] = DIVERGED
        for e in range(n):
            found.ends[i, e] = math.inf
    return seen, pool


@part
def under_way(count):
    """Return how many motions are under way."""
    total = 0
    for k in range(count.size):
        total += count[k]
    return total


@part
def worth_while(count, full):
    """Return how many motions a pool needs for a step: `FEW`, where all lanes are in use, or as many as the fullest has."""
    most = 1
    for k in range(count.size):
        most = max(most, count[k])
    return min(most, FEW) if full else 1


@part
def stepped(lanes, k, R, count, states):
    """Make a step of the lanes of a pool; return where their flags and their counts of steps begin."""
    wide = (count + VECTOR - 1) // VECTOR * VECTOR
    called(lanes.functions[STEP + k], k, pointer(R, 0), wide, pointer(lanes.p, 0), pointer(lanes.q, 0))
    return pointer(R, (states + FLAG) * NL), pointer(R, (states + COUNT) * NL)


@part
def joins(lanes, S, who, count, to, i):
    """Put motion i, which has begun in the spare lane, into a pool."""
    move(lanes, S[count.size], 0, S[to], count[to])
    who[to, count[to]] = i
    count[to] += 1


@part
def filled(at, lanes, motions, regions, settings, found, alive, scratch):
    """Begin motions from `at` on until enough are alive: the next one, and how many are alive."""
    S, who, count, _, x = scratch
    spare, total = count.size, under_way(count)
    while total < alive and at < motions.points.shape[0]:
        to = begun(at, S[spare], 0, x, lanes, motions, regions, settings, found)
        if to >= 0:
            joins(lanes, S, who, count, to, at)
            total += 1
        at += 1
    return at, total


@part
def passed_on(lanes, S, who, count, k, lane, to):
    """Move a motion from a lane of pool k to pool `to`, to none where that is negative, and close the gap."""
    if to >= 0:
        move(lanes, S[k], lane, S[to], count[to])
        who[to, count[to]] = who[k, lane]
        count[to] += 1
    count[k] -= 1
    move(lanes, S[k], count[k], S[k], lane)
    who[k, lane] = who[k, count[k]]


@njit(cache=True, **SCALAR)
def run(lanes, motions, regions, boxes, settings, found, alive, work, scratch):
    """Follow motions until each has met its fate.

    lanes: `Lanes` of a system. alive: how many motions are under way at once. work: (pools,), steps made in each.
    """
    S, who, count, seen, x = scratch
    at = 0
    while True:
        at, total = filled(at, lanes, motions, regions, settings, found, alive, scratch)
        if total == 0:
            return
        least = worth_while(count, total >= alive)
        for k in range(count.size):
            if count[k] < least:
                continue
            R = S[k]
            flags, steps = stepped(lanes, k, R, count[k], x.size)
            work[k] += count[k]
            lane = next_to_look_at(0, count[k], flags, steps)
            while lane < count[k]:
                i = who[k, lane]
                seen[i], to = after_step(i, k, R, lane, x, seen[i], lanes, regions, boxes, settings, found)
                if to == k:
                    lane += 1
                else:
                    passed_on(lanes, S, who, count, k, lane, to)
                lane = next_to_look_at(lane, count[k], flags, steps)
