"""Orbits with states that turn fast: where their flow is followed in linear frames, and on which meshes."""

from __future__ import annotations

import math
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from saltus.flow.linear_parts import linear_part

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.system import HybridSystem

__all__ = ["PARTS", "lawson_steps", "linear_frames", "split"]

PARTS = 4  # pieces of the dense output in a step in a frame
_TURNS = 60.0  # angle of the fastest pair along a segment, in radians, from which its frame is worth the search
_DEARER = 2.0  # time of a step in a frame, over that of an explicit one
_ANGLE = 2.0  # of the fastest pair in a step, as is to be expected, in radians
_OTHERS = 40  # steps that other terms take
_SAMPLES = 33  # states of an orbit, in each mode, along which its linear part is sought


def linear_frames(
    system: HybridSystem,
    modes: NDArray[np.int64],
    durations: NDArray[np.float64],
    dense: tuple[NDArray[np.int64], NDArray[np.float64]],
    p: NDArray[np.float64],
) -> NDArray[np.float64] | None:
    """Return the linear part of each mode in a row, zeros where explicit steps cost less; None if they all do.

    Parameters
    ----------
    system : HybridSystem
        The system.
    modes, durations : ndarray, shape (segments,)
        Where an orbit's segments run, and how long they last.
    dense : (ndarray, ndarray)
        Where each segment's nodes begin, as explicit steps made them, and the states there, (nodes, n).
    p : ndarray
        Extended parameters.
    """
    compiled, states = system.compiled, len(system.states)
    starts, nodes = dense
    rows, lasting = {}, durations.tolist()
    for mode in sorted(set(modes.tolist())):
        segments = np.flatnonzero(modes == mode).tolist()
        longest = max(segments, key=lasting.__getitem__)
        first, end = int(starts[longest]), int(starts[longest + 1])
        J = compiled.linearised(mode, nodes[(first + end) // 2], p)[1]
        turning = np.abs(J * J.T)
        turning.flat[:: len(J) + 1] *= 0.0
        if not math.sqrt(float(turning.max())) * lasting[longest] > _TURNS or compiled.rooted[mode]:
            continue
        at = np.concatenate([np.arange(starts[i], starts[i + 1]) for i in segments])
        along = nodes[at[np.linspace(0, at.size - 1, min(_SAMPLES, at.size)).astype(np.int64)]]
        part = linear_part(compiled, mode, along, p, states)
        expected = part.rate * lasting[longest] / _ANGLE + _OTHERS if part is not None else math.inf
        if part is not None and _DEARER * expected < end - first:
            rows[mode] = part.numbers
    if not rows:
        return None
    linear = np.zeros((len(system.modes), len(next(iter(rows.values())))))
    for mode, numbers in rows.items():
        linear[mode] = numbers
    return linear


@cache
def lawson_steps() -> NDArray[np.int64]:
    """Return addresses of the flow in frames, its dense output, and neither its variations nor a check, shape (4,)."""
    from saltus.flow.kernels import lawson_segment as kernels

    return np.array([kernels.flow.address, kernels.dense.address, 0, 0])


def split(
    mesh: tuple[NDArray[np.float64], NDArray[np.int64]],
    modes: NDArray[np.int64],
    linear: NDArray[np.float64],
    parts: float,
) -> list[NDArray[np.float64]]:
    """Return the segments' meshes with each step in a frame in some pieces, for dense output, or some steps in one.

    Parameters
    ----------
    mesh : (ndarray, ndarray)
        All segments' clustered times, and where each begins.
    modes : ndarray of int64, shape (segments,)
        Where the segments run.
    linear : ndarray
        What `linear_frames` returns.
    parts : float
        Pieces of a step.
    """
    meshes = np.split(mesh[0], mesh[1][1:-1])
    for i, mode in enumerate(modes.tolist()):
        if linear[mode, 0] > 0.0:
            steps = meshes[i].size - 1
            pieces = max(math.ceil(parts * steps), 1)
            meshes[i] = np.interp(np.linspace(0.0, steps, pieces + 1), np.arange(steps + 1), meshes[i])
    return meshes
