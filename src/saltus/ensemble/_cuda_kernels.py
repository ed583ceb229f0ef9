"""Many motions on a CUDA device: blocks of threads with lanes of their own, every thread at the same kind of step.

`follow` is a kernel but for the functions of a system: `saltus.ensemble.cuda` makes one for each, with functions of the
module generated for it (see `saltus.ensemble.driver`), which the device's compiler takes as they are.

A block keeps more lanes than it has threads, and a queue of lanes for each kind of step. All its threads take lanes from
the longest queue, so that none waits while others make another kind of step: with ``NL / POOLS`` threads that queue is
long enough for all. A lane whose motion is done gets the next motion at once.
"""

from __future__ import annotations

from typing import Any

from numba import cuda, float64, int32, int64

from saltus.ensemble.labels import DONE

after_step: Any = None
begun: Any = None
goes_on: Any = None
step: Any = None
"""Stand for functions of the generated module."""

STATES = LANES = POOLS = QUEUED = SHARED = 1
"""Stand for its sizes: of a state, a block's lanes, kinds of steps, places in all queues; and for the numbers in shared
memory, all that a block's lanes keep, or 0 where these are too many and lie in the device's memory."""


def next_begun(R, x, p, q, motions, regions, settings, found, next_motion):
    """Give a lane the next motion that has steps to make: its index and its pool; a negative pool where none is left."""
    while True:
        i = cuda.atomic.add(next_motion, 0, 1)
        if i >= motions.points.shape[0]:
            return i, DONE
        pool = begun(i, R, 0, x, p, q, motions, regions, settings, found)
        if pool >= 0:
            return i, pool


def follow(tables, motions, regions, boxes, settings, found, next_motion):
    """Follow motions until they are in a trap, or for as long as asked; see the records of `saltus.ensemble.labels`.

    tables: p, q, arena (blocks, numbers of a block's lanes), which is used where `SHARED` is 0. next_motion: (1,), at
    first 0.
    """
    p, q, arena = tables
    if SHARED > 0:
        S = cuda.shared.array(SHARED, float64)
    else:
        S = arena[cuda.blockIdx.x]
    waiting = cuda.shared.array(QUEUED, int32)
    first = cuda.shared.array(POOLS, int64)
    last = cuda.shared.array(POOLS, int64)
    who = cuda.shared.array(LANES, int64)
    visited = cuda.shared.array(LANES, int64)
    x = cuda.local.array(STATES, float64)
    thread, threads = cuda.threadIdx.x, cuda.blockDim.x
    for k in range(thread, POOLS, threads):
        first[k] = 0
        last[k] = 0
    cuda.syncthreads()
    for lane in range(thread, LANES, threads):
        i, pool = next_begun(S[lane:], x, p, q, motions, regions, settings, found, next_motion)
        if pool >= 0:
            who[lane] = i
            visited[lane] = 0
            waiting[pool * LANES + cuda.atomic.add(last, pool, 1) % LANES] = lane
    cuda.syncthreads()
    while True:
        k, count = 0, last[0] - first[0]
        for other in range(1, POOLS):
            if last[other] - first[other] > count:
                k, count = other, last[other] - first[other]
        if count == 0:
            break
        taken = min(count, threads)
        lane = waiting[k * LANES + (first[k] + thread) % LANES] if thread < taken else -1
        cuda.syncthreads()
        if thread == 0:
            first[k] += taken
        if lane >= 0:
            R, i, pool = S[lane:], who[lane], k
            step(k, R, 1, p, q)
            if not goes_on(R, 0):
                visited[lane], pool = after_step(i, k, R, 0, x, visited[lane], (p, q), regions, boxes, settings, found)
            if pool < 0:
                i, pool = next_begun(R, x, p, q, motions, regions, settings, found, next_motion)
                who[lane] = i
                visited[lane] = 0
            if pool >= 0:
                waiting[pool * LANES + cuda.atomic.add(last, pool, 1) % LANES] = lane
        cuda.syncthreads()
