"""Compiled moving of an orbit's meshes to equal errors: docs/theory/flow.md."""

from __future__ import annotations

import numpy as np

from saltus.flow.kernels.segment import redistribute
from saltus.system.numba_tools.machine_code import njit
from saltus.system.numba_tools.pointers import pointer

FINEST = 5.0  # error of a step, in tolerances, up to which a mesh is fine enough
COARSEST = 5e-3  # largest error in a segment, in tolerances, below which its mesh is finer than needed
AIM = 0.2  # error of each step of a new mesh, in tolerances


@njit(cache=True, error_model="numpy")
def remesh(mesh, mesh_at, errors, limit):
    """Return whether the mesh is fine enough, a new flat mesh and the segments' counts; no counts where it may stay.

    It may where the largest error is below `limit` and no segment is much finer than need be.
    """
    segments = mesh_at.size - 1
    mesh_at, errors = pointer(mesh_at, 0), pointer(errors, 0)
    worst = 0.0
    stay = True
    for i in range(segments):
        top = 0.0
        for j in range(mesh_at[i], mesh_at[i + 1] - 1):
            top = max(top, errors[j])
        worst = max(worst, top)
        if top > limit or (top < COARSEST and mesh_at[i + 1] - mesh_at[i] > 6):
            stay = False
    counts = np.zeros(0 if stay else segments, np.int64)
    fresh = np.empty(0 if stay else 3 * mesh.size + 8 * segments)
    if stay:
        return True, fresh, counts
    at, grid, new, filled = 0, pointer(mesh, 0), pointer(fresh, 0), pointer(counts, 0)
    for i in range(segments):
        first = mesh_at[i]
        count = mesh_at[i + 1] - first - 1
        room = pointer(new, at)
        filled[i] = redistribute(pointer(grid, first), count, pointer(errors, first), AIM, room, 3 * count + 8)
        at += filled[i] + 1
    return worst <= FINEST, fresh, counts
