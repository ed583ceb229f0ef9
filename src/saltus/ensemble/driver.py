"""The text around the steps of lanes: what it imports, and the loop that moves lanes between their pools."""

from __future__ import annotations

from saltus.ensemble.labels import AT_STROBE, DIVERGED, DONE, GOES_ON, GONE, HARD, LEFT_OVER, MOST_STEPS, UNDECIDED

__all__ = ["DRIVER", "HEAD"]

HEAD = f"""
from saltus.ensemble._kernels import FAST, box_of, circular_cos, circular_sin, fate, grown, ld, loosened
from saltus.ensemble._kernels import products, root, short_cos, short_sin, st
from saltus.system.machine_code import njit

NL = 320
AT_STROBE, GOES_ON, MOST_STEPS = {AT_STROBE}, {GOES_ON}, {MOST_STEPS}
HARD, GONE, DONE = {HARD}, {GONE}, {DONE}
LEFT_OVER, DIVERGED, UNDECIDED = {LEFT_OVER}, {DIVERGED}, {UNDECIDED}
lane = njit(nogil=True, error_model="numpy", fastmath=FAST)
scalar = njit(nogil=True, error_model="numpy")
"""

DRIVER = """

@njit(nogil=True, error_model="numpy", cache=True)
def run(points, modes, p, q, itol, growth, least_itol, longest, alive, limit, cages, ellipsoids, trap_labels,
        origin, size, boxes, box_labels, visits, labels, strobes, ends, end_modes, work, S, who, count, seen, x):
    new = S[POOLS]
    at = 0
    while True:
        total = 0
        for k in range(POOLS):
            total += count[k]
        while total < alive and at < points.shape[0]:
            i = at
            at += 1
            for e in range(N):
                new[e*NL] = x[e] = points[i, e]
            new[T_*NL] = new[COUNT*NL] = new[FLAG*NL] = new[WAIT*NL] = 0.0
            new[ITOL*NL] = itol
            to = begin(modes[i], new, 0, p, q)
            label = LEFT_OVER
            if to >= 0:
                label = fate(x, MODE_OF[to], limit, cages, ellipsoids, trap_labels)
            if label != UNDECIDED:
                labels[i] = label
                for e in range(N):
                    ends[i, e] = x[e]
                end_modes[i] = MODE_OF[to] if to >= 0 else modes[i]
                continue
            move(new, 0, S[to], count[to])
            who[to, count[to]] = i
            count[to] += 1
            total += 1
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
                flag = ld(R, FLAG*NL, l)
                is_late = ld(R, COUNT*NL, l) >= MOST_STEPS
                if flag == GOES_ON and not is_late:
                    l += 1
                    continue
                i = who[k, l]
                to = k
                if flag == AT_STROBE:
                    strobes[i] += 1
                    R[T_*NL + l] = R[COUNT*NL + l] = 0.0
                    R[ITOL*NL + l] = loosened(R[ITOL*NL + l], itol, growth, least_itol, strobes[i])
                    read(k, R, l, x, q)
                    label = fate(x, MODE_OF[k], limit, cages, ellipsoids, trap_labels)
                    if label == UNDECIDED and boxes.shape[0] > 0:
                        label = box_of(x, origin, size, boxes, box_labels)
                        if label != UNDECIDED:
                            seen[i] = seen[i] + 256 if seen[i] % 256 == label else 256 + label
                            if seen[i] < 256*visits:
                                label = UNDECIDED
                        else:
                            seen[i] = 0
                    if label != UNDECIDED or strobes[i] >= longest:
                        labels[i] = label
                        for e in range(N):
                            ends[i, e] = x[e]
                        end_modes[i] = MODE_OF[k]
                        to = DONE
                elif is_late:
                    to = HARD
                else:
                    to = turned(k, R, l, p, q)
                if to == k:
                    l += 1
                    continue
                if to == HARD:
                    labels[i] = LEFT_OVER
                elif to == GONE:
                    labels[i] = DIVERGED
                    for e in range(N):
                        ends[i, e] = math.inf
                elif to >= 0:
                    move(R, l, S[to], count[to])
                    who[to, count[to]] = i
                    count[to] += 1
                count[k] -= 1
                move(R, count[k], R, l)
                who[k, l] = who[k, count[k]]
"""
