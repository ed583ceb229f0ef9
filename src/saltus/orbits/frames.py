"""Orbits with states that turn fast: the linear frames in which their flow is followed, and explicit steps beside these."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.flow.linear_parts import linear_part

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.orbits.problem import OrbitProblem

__all__ = ["PARTS", "coarse", "lawson_steps", "linear_frames", "split"]

PARTS = 4  # pieces of the dense output in a step in a frame
_TURNS = 60.0  # angle of the fastest pair along a segment, in radians, from which its frame is worth the search
_DEARER = 2.0  # time of a step in a frame, over that of an explicit one
_ANGLE = 2.0  # of the fastest pair in a step, as is to be expected, in radians
_OTHERS = 40  # steps that other terms take
_SAMPLES = 33  # states of an orbit, in each mode, along which its linear part is sought


def linear_frames(problem: OrbitProblem, durations: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Return the linear part of each mode of a problem, one row each, a row of zeros where explicit steps cost less.

    The last survey's states are looked at. None where no segment is better followed in a frame.

    Parameters
    ----------
    problem : OrbitProblem
        The equations, meshes of explicit steps made.
    durations : ndarray, shape (segments,)
        How long the segments last.
    """
    compiled = problem.system.compiled
    _, starts, nodes, _ = problem.dense()
    rows = {}
    for mode in np.unique(problem.modes).tolist():
        segments = np.flatnonzero(problem.modes == mode)
        longest = int(segments[np.argmax(durations[segments])])
        first, end = starts[longest], starts[longest + 1]
        J = compiled.linearised(mode, np.ascontiguousarray(nodes[(first + end) // 2]), problem.extended)[1]
        rate = math.sqrt(float(np.max(np.abs(J * J.T) * (1.0 - np.eye(len(J))))))
        if not rate * durations[longest] > _TURNS or compiled.rooted[mode]:
            continue
        at = np.concatenate([np.arange(starts[i], starts[i + 1]) for i in segments])
        along = nodes[at[np.linspace(0, at.size - 1, min(_SAMPLES, at.size)).astype(np.int64)]]
        part = linear_part(compiled, mode, along, problem.extended, len(problem.system.states))
        expected = part.rate * durations[longest] / _ANGLE + _OTHERS if part is not None else math.inf
        if part is not None and _DEARER * expected < end - first:
            rows[mode] = part.numbers
    if not rows:
        return None
    linear = np.zeros((len(problem.system.modes), len(next(iter(rows.values())))))
    for mode, numbers in rows.items():
        linear[mode] = numbers
    return linear


def lawson_steps() -> NDArray[np.int64]:
    """Return addresses of the flow in frames, its dense output, and none of its variations, shape (3,)."""
    from saltus.flow.kernels import lawson_segment as kernels

    return np.array([kernels.flow.address, kernels.dense.address, 0])


def coarse(problem: OrbitProblem, linear: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Return meshes of explicit steps, with fewer nodes in segments that are followed in a frame.

    Parameters
    ----------
    problem : OrbitProblem
        The equations, meshes of explicit steps made.
    linear : ndarray
        What `linear_frames` returns.
    """
    places, starts = problem.mesh
    meshes = np.split(places, starts[1:-1])
    for i, mode in enumerate(problem.modes.tolist()):
        if linear[mode, 0] > 0.0:
            fewer = max(1, int(_DEARER * _DEARER))
            meshes[i] = np.append(meshes[i][:-1:fewer], 1.0)
    return meshes


def split(
    mesh: tuple[NDArray[np.float64], NDArray[np.int64]], modes: NDArray[np.int64], linear: NDArray[np.float64]
) -> list[NDArray[np.float64]]:
    """Return the segments' meshes with each step in a frame in pieces, for dense output.

    Parameters
    ----------
    mesh : (ndarray, ndarray)
        All segments' clustered times, and where each begins.
    modes : ndarray of int64, shape (segments,)
        Where the segments run.
    linear : ndarray
        What `linear_frames` returns.
    """
    meshes = np.split(mesh[0], mesh[1][1:-1])
    for i, mode in enumerate(modes.tolist()):
        if linear[mode, 0] > 0.0:
            steps = meshes[i].size - 1
            meshes[i] = np.interp(np.arange(PARTS * steps + 1) / PARTS, np.arange(steps + 1), meshes[i])
    return meshes
