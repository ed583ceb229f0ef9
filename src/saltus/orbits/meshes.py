"""Meshes of an orbit's segments: made for its states, halved, and whether stability limits their steps."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from saltus.system.compiled import Compiled

__all__ = ["adapted", "decays", "halved", "limited_by_stability", "steady"]

_FEW_STEPS = 1 << 12  # of a mesh that is tried before there is room for as many as may be
_SAMPLED = 40  # steps of a segment that are looked at to see whether the flow is stiff
_FAST = 2.0  # step, times the rate of the fastest decay, from which on stability limits it: it may reach 6
_STEADY = 3.0  # longest step, times the rate of the fastest decay, in which decayed states stay small
_MOST_PARTS = 100_000  # parts of a step at most; a faster decay is left to the errors of steps
_SLOW = 30.0  # decay over a segment up to which no mesh is too coarse for it
_MANY = 0.3  # share of such steps with which a flow is stiff


def adapted(
    compiled: Compiled,
    modes: NDArray[np.int64],
    blocks: NDArray[np.float64],
    p: NDArray[np.float64],
    tolerances: tuple[float, float],
) -> list[NDArray[np.float64]] | int:
    """Return each segment's mesh, its steps as long as the tolerances allow; a segment that cannot be followed.

    Parameters
    ----------
    modes : ndarray of int64, shape (segments,)
        Where the segments run.
    blocks : ndarray, shape (segments, n + 1)
        State at each one's start, and its duration.
    p : ndarray
        Extended parameters.
    tolerances : (float, float)
        Relative and absolute.
    """
    from saltus.flow.kernels import segment as segment_kernels

    meshes = []
    for index, (mode, block) in enumerate(zip(modes, blocks, strict=True)):
        x, duration = np.ascontiguousarray(block[:-1]), block[-1]
        for most in (_FEW_STEPS, segment_kernels.MOST_STEPS + 1):
            mesh = np.empty(most)
            count = segment_kernels.adapt(compiled.addresses, mode, x, duration, p, *tolerances, mesh)
            if count >= 0:
                break
        if count < 0:
            return index
        meshes.append(mesh[: count + 1].copy())
    return meshes


def decays(
    compiled: Compiled, modes: NDArray[np.int64], blocks: NDArray[np.float64], p: NDArray[np.float64]
) -> list[float]:
    """Return by how many factors e the state decays that does so fastest by itself, for each segment.

    Parameters
    ----------
    modes, blocks, p : ndarray
        As of `adapted`.
    """
    found = []
    for mode, block in zip(modes, blocks, strict=True):
        rates = -block[-1] * np.diag(compiled.linearised(int(mode), np.ascontiguousarray(block[:-1]), p)[1])
        found.append(float(np.max(rates, where=np.isfinite(rates), initial=0.0)))
    return found


def steady(mesh: NDArray[np.float64], decay: float) -> NDArray[np.float64]:
    """Return a mesh with steps cut where they are too long for stability, at a decay over the segment.

    A state that has decayed leaves no error in a step, however long, but its sensitivity would grow in it.
    """
    if not decay > _SLOW:
        return mesh
    middles = np.clip(0.5, mesh[:-1], mesh[1:])  # where the clustered time of a step runs fastest
    parts = np.ceil(decay * 6.0 * middles * (1.0 - middles) * np.diff(mesh) / _STEADY).clip(1, _MOST_PARTS).astype(int)
    ends = np.concatenate([[0], np.cumsum(parts)])
    return np.interp(np.arange(ends[-1] + 1), ends, mesh)


def halved(mesh: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a mesh with each step cut in half."""
    return np.interp(np.arange(2 * mesh.size - 1) / 2.0, np.arange(mesh.size), mesh)


def limited_by_stability(
    compiled: Compiled,
    modes: NDArray[np.int64],
    durations: NDArray[np.float64],
    meshes: Sequence[NDArray[np.float64]],
    nodes: Sequence[NDArray[np.float64]],
    p: NDArray[np.float64],
) -> bool:
    """Whether many steps are as long as the fastest decay along them allows an explicit method.

    Parameters
    ----------
    modes, durations : ndarray, shape (segments,)
        Where the segments run, and how long.
    meshes, nodes : sequence of ndarray
        Each segment's mesh, and the states on it, shape (node, n).
    p : ndarray
        Extended parameters.
    """
    near = []
    for mode, duration, grid, states in zip(modes, durations, meshes, nodes, strict=True):
        for k in np.unique(np.linspace(0, grid.size - 2, _SAMPLED).astype(int)):
            length = duration * 6.0 * grid[k] * (1.0 - grid[k]) * (grid[k + 1] - grid[k])
            J = compiled.linearised(int(mode), states[k], p)[1]
            near.append(np.all(np.isfinite(J)) and length * max(-np.linalg.eigvals(J).real) > _FAST)
    return bool(np.mean(near) > _MANY)
