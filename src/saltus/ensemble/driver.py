"""The text around the steps of lanes: imports, the life of a lane, the loop that moves lanes between pools.

The life of a lane is the same on processors and on graphics cards: `begun`, then after each step `after_step` unless
the lane `goes_on`, in which it is `looked_at` at phase 0.
"""

from __future__ import annotations

from saltus.ensemble.labels import AT_STROBE, DIVERGED, DONE, GOES_ON, GONE, HARD, LEFT_OVER, MOST_STEPS, UNDECIDED

__all__ = ["DRIVER", "HEAD", "LIFE"]

HEAD = f"""
from saltus.ensemble._kernels import FAST, SCALAR, circular_cos, circular_sin, ended, fate, grown, ld, loosened
from saltus.ensemble._kernels import products, root, short_cos, short_sin, st, told
from saltus.system.machine_code import njit

NL = 320
AT_STROBE, GOES_ON, MOST_STEPS = {AT_STROBE}, {GOES_ON}, {MOST_STEPS}
HARD, GONE, DONE = {HARD}, {GONE}, {DONE}
LEFT_OVER, DIVERGED, UNDECIDED = {LEFT_OVER}, {DIVERGED}, {UNDECIDED}
lane = njit(nogil=True, error_model="numpy", fastmath=FAST)
scalar = njit(**SCALAR)
part = njit(inline="always", **SCALAR)
"""

LIFE = """

@part
def begun(i, R, l, x, p, q, motions, regions, settings, found):
    for e in range(N):
        R[e*NL + l] = x[e] = motions.points[i, e]
    R[T_*NL + l] = R[COUNT*NL + l] = R[FLAG*NL + l] = R[WAIT*NL + l] = 0.0
    R[ITOL*NL + l] = settings.itol
    pool = begin(motions.modes[i], R, l, p, q)
    if pool < 0:
        return ended(i, LEFT_OVER, x, motions.modes[i], found)
    label = fate(x, MODE_OF[pool], settings.limit, regions.cages, regions.ellipsoids, regions.labels)
    return pool if label == UNDECIDED else ended(i, label, x, MODE_OF[pool], found)


@part
def goes_on(R, l):
    return ld(R, FLAG*NL, l) == GOES_ON and ld(R, COUNT*NL, l) < MOST_STEPS


@part
def looked_at(i, k, R, l, x, seen, q, regions, boxes, settings, found):
    found.strobes[i] += 1
    strobes = found.strobes[i]
    R[T_*NL + l] = R[COUNT*NL + l] = 0.0
    R[ITOL*NL + l] = loosened(R[ITOL*NL + l], settings.itol, settings.growth, settings.least_itol, strobes)
    read(k, R, l, x, q)
    seen, label = told(x, MODE_OF[k], seen, regions, boxes, settings)
    if label == UNDECIDED and strobes < settings.longest:
        return seen, k
    return seen, ended(i, label, x, MODE_OF[k], found)


@part
def after_step(i, k, R, l, x, seen, tables, regions, boxes, settings, found):
    p, q = tables
    if ld(R, FLAG*NL, l) == AT_STROBE:
        return looked_at(i, k, R, l, x, seen, q, regions, boxes, settings, found)
    pool = turned(k, R, l, p, q) if ld(R, COUNT*NL, l) < MOST_STEPS else HARD
    if pool == HARD:
        found.labels[i] = LEFT_OVER
    elif pool == GONE:
        found.labels[i] = DIVERGED
        for e in range(N):
            found.ends[i, e] = math.inf
    return seen, pool
"""
"""A lane l in R that follows motion i: `begun` and `after_step` return the pool in which it goes on, or a negative
number; the second before it the visits to boxes so far, as `seen` gives them."""

DRIVER = """

@njit(cache=True, **SCALAR)
def run(motions, p, q, regions, boxes, settings, found, alive, work, scratch):
    S, who, count, seen, x = scratch
    at = 0
    while True:
        total = 0
        for k in range(POOLS):
            total += count[k]
        while total < alive and at < motions.points.shape[0]:
            to = begun(at, S[POOLS], 0, x, p, q, motions, regions, settings, found)
            if to >= 0:
                move(S[POOLS], 0, S[to], count[to])
                who[to, count[to]] = at
                count[to] += 1
                total += 1
            at += 1
        if total == 0:
            return
        most = 0
        for k in range(POOLS):
            most = max(most, count[k])
        few = 8 if total >= alive else 1
        for k in range(POOLS):
            if count[k] == 0 or (count[k] < few and count[k] < most):
                continue
            R = S[k]
            n = (count[k] + 7)//8*8
            MAKE_STEP
            work[k] += count[k]
            l = 0
            while l < count[k]:
                if goes_on(R, l):
                    l += 1
                    continue
                i = who[k, l]
                seen[i], to = after_step(i, k, R, l, x, seen[i], (p, q), regions, boxes, settings, found)
                if to == k:
                    l += 1
                    continue
                if to >= 0:
                    move(R, l, S[to], count[to])
                    who[to, count[to]] = i
                    count[to] += 1
                count[k] -= 1
                move(R, count[k], R, l)
                who[k, l] = who[k, count[k]]
"""
