"""The loop over motions of a map: each is iterated until it is in a trapping region."""

from __future__ import annotations

import math

from saltus.ensemble.kernels.lanes import SCALAR, after_visit, box_of, ended, fate, floor
from saltus.ensemble.labels import UNDECIDED
from saltus.maps.kernels.steps import ROOTLESS, advanced
from saltus.system.numba_tools.machine_code import njit

FOLLOWED = -1  # all motions have their labels


@njit(inline="always", **SCALAR)
def boxed(x, boxes, table):
    """Label of the box in which a state lies, from a table of all boxes between the outermost ones; or UNDECIDED."""
    if table.labels.size == 0:
        return box_of(x, boxes.origin, boxes.size, boxes.indices, boxes.labels)
    at = 0
    for i in range(x.size):
        index = floor((x[i] - boxes.origin[i]) / boxes.size[i]) - table.low[i]
        if not 0.0 <= index < table.shape[i]:
            return UNDECIDED
        at = at * table.shape[i] + int(index)
    return table.labels[at]


@njit(cache=True, **SCALAR)
def follow(code, motions, regions, boxes, table, settings, found, x, y):
    """Follow motions until each has met its fate; the index of one that meets a gap or an overlap, or FOLLOWED.

    code: `MapCode`. table: `BoxTable`. x, y: (n,), working space; x is left at the state of the gap.
    """
    has_boxes = boxes.indices.shape[0] > 0
    for i in range(motions.points.shape[0]):
        for e in range(x.size):
            x[e] = motions.points[i, e]
        seen, strobes = 0, 0
        label = fate(x, 0, settings.limit, regions.cages, regions.ellipsoids, regions.labels)
        while label == UNDECIDED and strobes < settings.longest:
            piece = advanced(x, y, code)
            if piece == ROOTLESS:
                x[0] = math.nan
            elif piece < 0:
                return i
            strobes += 1
            label = fate(x, 0, settings.limit, regions.cages, regions.ellipsoids, regions.labels)
            if label == UNDECIDED and has_boxes:
                seen, label = after_visit(seen, boxed(x, boxes, table), settings.visits)
        found.strobes[i] = strobes
        ended(i, label, x, 0, found)
    return FOLLOWED
