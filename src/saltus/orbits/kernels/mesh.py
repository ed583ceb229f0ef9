"""Compiled moving of an orbit's meshes to equal errors: docs/theory/flow.md."""

from __future__ import annotations

import math

import numpy as np

from saltus.flow.kernels.segment import MOST_STEPS, redistribute
from saltus.system.numba_tools.machine_code import kernel, njit
from saltus.system.numba_tools.pointers import INNER, pointer

FINEST = 5.0  # error of a step, in tolerances, up to which a mesh is fine enough
COARSEST = 5e-3  # largest error in a segment, in tolerances, below which its mesh is finer than needed
AIM = 0.2  # error of each step of a new mesh, in tolerances
MOST_NODES = MOST_STEPS  # of a mesh that is moved
UNSTABLE = 1e3  # error of a step, in tolerances, beyond which steps are halved: they may be unstable
BESIDE = 2  # steps at an event whose errors tell nothing before it is met: the field may bend at its surface


@kernel
def moved(places, starts, transitions, errors, limit, worst, met, most, fresh, ends):
    """Return whether the meshes are fine enough, and how many nodes the moved ones have; 0 where they stay.

    They may stay where the largest error is below `limit` and no segment is much finer than need be. Where the largest
    one known, `worst`, may be that of unstable steps, all steps are halved, if they are fewer than `most`. Moved meshes
    are written: fresh, (3 nodes + 8 segments,), and where each segment's begin, ends, (segments + 1,). met: whether
    segments end at their events, transitions, (segments,), -1 for none; without that errors are taken by `inner_error`.
    """
    segments = starts.size - 1
    if not met:
        worst = inner_error(transitions, starts, worst, errors)
        if worst <= limit:
            return True, 0
    if not worst <= UNSTABLE and places.size - segments < most:
        return False, _halved(places, starts, fresh, ends)
    mesh_at, error = pointer(starts, 0), pointer(errors, 0)
    largest = 0.0
    stay = True
    for i in range(segments):
        top = 0.0
        for j in range(mesh_at[i], mesh_at[i + 1] - 1):
            top = max(top, error[j])
        largest = max(largest, top)
        if top > limit or (top < COARSEST and mesh_at[i + 1] - mesh_at[i] > 6):
            stay = False
    if stay:
        return True, 0
    for j in range(errors.size):
        if not math.isfinite(error[j]):
            return False, 0
    at, grid, new = 0, pointer(places, 0), pointer(fresh, 0)
    for i in range(segments):
        first = mesh_at[i]
        count = mesh_at[i + 1] - first - 1
        ends[i] = at
        at += 1 + redistribute(
            pointer(grid, first), count, pointer(error, first), AIM, pointer(new, at), 3 * count + 8
        )  # fmt: skip
    ends[segments] = at
    return largest <= FINEST, at


@njit(**INNER)
def inner_error(transitions, starts, worst, errors):
    """Return the largest error of a step but for those beside events, which are set to those of a new mesh.

    Until Newton's method has converged a segment starts and ends off the surface where its field may bend.
    """
    if not worst < np.inf:
        return worst
    segments, worst = transitions.size, 0.0
    begins = transitions[segments - 1] >= 0
    for i in range(segments):
        first, last, ends = starts[i], starts[i + 1] - 2, transitions[i] >= 0
        for j in range(first, last + 1):
            if (begins and j - first < BESIDE) or (ends and last - j < BESIDE):
                errors[j] = min(errors[j], AIM)
            worst = max(worst, errors[j])
        begins = ends
    return worst


@njit(**INNER)
def _halved(places, starts, fresh, ends):
    """Write meshes with each step cut in half; return how many nodes they have."""
    segments = starts.size - 1
    for i in range(segments):
        ends[i] = 2 * starts[i] - i
        for j in range(starts[i], starts[i + 1]):
            at = 2 * j - i
            fresh[at] = places[j]
            if j + 1 < starts[i + 1]:
                fresh[at + 1] = 0.5 * (places[j + 1] - places[j]) + places[j]
    ends[segments] = 2 * places.size - segments
    return ends[segments]
