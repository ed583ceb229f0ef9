"""Many motions on a CUDA device: blocks of threads with lanes of their own, every thread at the same kind of step.

`follow` is a kernel but for the functions of a system: `saltus.ensemble.cuda` makes one for each, in which `lanes` is the
module generated for it (see `saltus.ensemble.writer`), whose functions the device's compiler takes as they are.

A block keeps more lanes than it has threads, and a queue of lanes for each kind of step. All its threads take lanes from
the longest queue, so that none waits while others make another kind of step: with ``NL / POOLS`` threads that queue is
long enough for all. A lane whose motion is done gets the next motion at once.
"""

from __future__ import annotations

import math
from typing import Any

from numba import cuda, float64, int32, int64

from saltus.ensemble._kernels import box_of, fate, loosened
from saltus.ensemble.labels import AT_STROBE, DIVERGED, DONE, GOES_ON, GONE, HARD, LEFT_OVER, MOST_STEPS, UNDECIDED

lanes: Any = None
"""Stands for the generated module."""

STATES = LANES = POOLS = QUEUED = SHARED = 1
"""Stand for its sizes: of a state, a block's lanes, kinds of steps, places in all queues; and for the numbers in shared
memory, all that a block's lanes keep, or 0 where these are too many and lie in the device's memory."""


def begun(R, x, tables, traps, settings, points, modes, next_motion, labels, ends, end_modes):
    """Give a lane the next motion that has steps to make: its index and its pool; a negative pool where none is left."""
    p, q, _ = tables
    while True:
        i = cuda.atomic.add(next_motion, 0, 1)
        if i >= points.shape[0]:
            return i, DONE
        for e in range(STATES):
            x[e] = points[i, e]
            R[e * LANES] = points[i, e]
        R[lanes.T_ * LANES] = 0.0
        R[lanes.COUNT * LANES] = 0.0
        R[lanes.FLAG * LANES] = 0.0
        R[lanes.WAIT * LANES] = 0.0
        R[lanes.ITOL * LANES] = settings[0]
        pool = lanes.begin(modes[i], R, 0, p, q)
        mode = lanes.MODE_OF[pool] if pool >= 0 else -1
        label = fate(x, mode, settings[3], *traps) if pool >= 0 else LEFT_OVER
        if label == UNDECIDED:
            return i, pool
        labels[i] = label
        end_modes[i] = mode if pool >= 0 else modes[i]
        for e in range(STATES):
            ends[i, e] = x[e]


def looked_at(k, R, x, i, seen, tables, traps, boxes, settings, labels, strobes, ends, end_modes):
    """Look at a motion at phase 0: its visits to boxes so far, and the pool in which it goes on, or DONE."""
    itol, growth, least_itol, limit, longest, visits = settings
    strobes[i] += 1
    R[lanes.T_ * LANES] = 0.0
    R[lanes.COUNT * LANES] = 0.0
    R[lanes.ITOL * LANES] = loosened(R[lanes.ITOL * LANES], itol, growth, least_itol, strobes[i])
    lanes.read(k, R, 0, x, tables[1])
    label = fate(x, lanes.MODE_OF[k], limit, *traps)
    if label == UNDECIDED and boxes[2].shape[0] > 0:
        box = box_of(x, *boxes)
        if box == UNDECIDED:
            seen = 0
        else:
            seen = seen + 256 if seen % 256 == box else 256 + box
            label = box if seen >= 256 * visits else UNDECIDED
    if label == UNDECIDED and strobes[i] < longest:
        return seen, k
    labels[i] = label
    end_modes[i] = lanes.MODE_OF[k]
    for e in range(STATES):
        ends[i, e] = x[e]
    return seen, DONE


def follow(tables, traps, boxes, settings, points, modes, next_motion, labels, strobes, ends, end_modes):
    """Follow motions until they are in a trap, or for as long as asked.

    tables: p, q, arena (blocks, numbers of a block's lanes), which is used where `SHARED` is 0. traps: cages,
    ellipsoids, labels. boxes: origin, size, indices, labels. settings: itol, its growth and least value, limit,
    longest, visits. points: (m, STATES). next_motion: (1,), at first 0.
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
        i, pool = begun(S[lane:], x, tables, traps, settings, points, modes, next_motion, labels, ends, end_modes)
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
            lanes.step(k, R, 1, p, q)
            flag = R[lanes.FLAG * LANES]
            if flag == AT_STROBE:
                visited[lane], pool = looked_at(
                    k, R, x, i, visited[lane], tables, traps, boxes, settings, labels, strobes, ends, end_modes
                )
            elif R[lanes.COUNT * LANES] >= MOST_STEPS:
                pool = HARD
            elif flag != GOES_ON:
                pool = lanes.turned(k, R, 0, p, q)
            if pool == HARD:
                labels[i] = LEFT_OVER
            elif pool == GONE:
                labels[i] = DIVERGED
                for e in range(STATES):
                    ends[i, e] = math.inf
            if pool < 0:
                i, pool = begun(R, x, tables, traps, settings, points, modes, next_motion, labels, ends, end_modes)
                who[lane] = i
                visited[lane] = 0
            if pool >= 0:
                waiting[pool * LANES + cuda.atomic.add(last, pool, 1) % LANES] = lane
        cuda.syncthreads()
