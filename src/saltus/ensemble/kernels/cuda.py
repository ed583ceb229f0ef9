"""Many motions on a CUDA device: a block of threads has its own lanes, and all its threads take one kind of step.

`follow` is a kernel but for the functions of a system: `saltus.ensemble.cuda` makes one for each. The device's compiler
takes the functions of the generated module as they are, and the life of a lane (`saltus.ensemble.kernels.life`) calls
them directly.

A block keeps more lanes than it has threads, and a queue of lanes for each kind of step. All its threads take lanes from
the longest queue, so that none waits while others make another kind of step: with ``NL / POOLS`` threads that queue is
long enough for all. A lane whose motion is done gets the next motion at once.
"""

from __future__ import annotations

from typing import Any

from numba import cuda, float64, int32, int64

from saltus.ensemble.kernels.life import COUNT, FLAG
from saltus.ensemble.labels import DONE

# Stand for functions of the generated module.
system_begin: Any = None
system_read: Any = None
system_step: Any = None
system_turned: Any = None

# Stand for the life of a lane and for `make_step`, compiled.
after_step: Any = None
begun: Any = None
goes_on: Any = None
step_made: Any = None

# Stand for sizes of that module.
STATES = 1  # components of a state
LANES = 1  # lanes of a block
POOLS = 1  # kinds of steps
QUEUED = 1  # places in all queues of a block
SHARED = 1  # numbers of a block's lanes in shared memory; 0 where they are too many, and lie in the device's memory


def begin(lanes, mode, R, lane):
    """Return the pool of a lane that begins in a mode, or HARD."""
    return system_begin(mode, R, lane, lanes.p, lanes.q)


def turned(lanes, k, R, lane):
    """Return the pool in which a lane of pool k goes on after a step that was flagged, or HARD, or GONE."""
    return system_turned(k, R, lane, lanes.p, lanes.q)


def read(lanes, k, R, lane, x):
    """Write the state of a lane of pool k, at phase 0, into x."""
    system_read(k, R, lane, x, lanes.q)


def make_step(lanes, k, R):
    """Make a step of the first lane of R, of pool k."""
    system_step(k, R, 1, lanes.p, lanes.q)


def next_begun(R, x, lanes, motions, regions, settings, found, next_motion):
    """Give a lane the next motion that has steps to make: its index and its pool; a negative pool where none is left."""
    while True:
        i = cuda.atomic.add(next_motion, 0, 1)
        if i >= motions.points.shape[0]:
            return i, DONE
        pool = begun(i, R, 0, x, lanes, motions, regions, settings, found)
        if pool >= 0:
            return i, pool


def follow(lanes, arenas, motions, regions, boxes, settings, found, next_motion):
    """Follow motions until they are in a trap, or for as long as asked; see the records of `saltus.ensemble.labels`.

    lanes: see `saltus.ensemble.labels.Lanes`. arenas: one array, (blocks, numbers of a block's lanes), used where
    `SHARED` is 0. next_motion: (1,), at first 0.
    """
    if SHARED > 0:
        S = cuda.shared.array(SHARED, float64)
    else:
        S = arenas[0][cuda.blockIdx.x]
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
        i, pool = next_begun(S[lane:], x, lanes, motions, regions, settings, found, next_motion)
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
            step_made(lanes, k, R)
            if not goes_on(R[(STATES + FLAG) * LANES], R[(STATES + COUNT) * LANES]):
                visited[lane], pool = after_step(i, k, R, 0, x, visited[lane], lanes, regions, boxes, settings, found)
            if pool < 0:
                i, pool = next_begun(R, x, lanes, motions, regions, settings, found, next_motion)
                who[lane] = i
                visited[lane] = 0
            if pool >= 0:
                waiting[pool * LANES + cuda.atomic.add(last, pool, 1) % LANES] = lane
        cuda.syncthreads()
