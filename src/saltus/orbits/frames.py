"""Orbits with states that turn fast: where their flow is followed in linear frames, and on which meshes."""

from __future__ import annotations

import math
from functools import cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from saltus.flow.exponential import tables
from saltus.flow.linear_parts import linear_part

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.system import HybridSystem

__all__ = ["PARTS", "PIECE", "Frames", "lawson_steps", "linear_frames", "merged", "pieces"]

PARTS = 4  # pieces of the dense output in a step in a frame, at the least
PIECE = 0.65  # angle of the fastest states in a piece, in radians, at most
_MOST_PIECES = 100_000  # of a segment
_LOOKS = 8  # places in a step at which the angle is looked at
_MERGED = 4  # explicit steps in one of a frame, to begin with
_TURNS = 60.0  # angle of the fastest pair along a segment, in radians, from which its frame is worth the search
_DEARER = 2.0  # time of a step in a frame, over that of an explicit one
_ANGLE = 2.0  # of the fastest pair in a step, as is to be expected, in radians
_OTHERS = 40  # steps that other terms take
_SAMPLES = 33  # states of an orbit, in each mode, along which its linear part is sought


class Frames(NamedTuple):
    """The linear parts of a system's modes."""

    # shape (modes, 4 + 5 n): `LinearPart.numbers`, zeros of modes that have none
    parts: NDArray[np.float64]
    # shape (modes, LEVELS, numbers): `saltus.flow.exponential.tables`
    tables: NDArray[np.float64]

    @property
    def addresses(self) -> list[int]:
        """Where the two arrays begin."""
        return [self.parts.ctypes.data, self.tables.ctypes.data]


def linear_frames(
    system: HybridSystem,
    modes: NDArray[np.int64],
    durations: NDArray[np.float64],
    dense: tuple[NDArray[np.int64], NDArray[np.float64]],
    p: NDArray[np.float64],
) -> Frames | None:
    """Return the linear parts of the modes, none where explicit steps cost less; None if they all do.

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
    made = {mode: tables(numbers[4:].reshape(-1, 5)) for mode, numbers in rows.items()}
    shapes = next(iter(rows.values())).shape, next(iter(made.values())).shape
    parts, laid = (np.zeros((len(system.modes), *shape)) for shape in shapes)
    for mode, numbers in rows.items():
        parts[mode], laid[mode] = numbers, made[mode]
    return Frames(parts, laid)


@cache
def lawson_steps() -> NDArray[np.int64]:
    """Return addresses of the flow in frames, its dense output, none of its variations, and its check, shape (4,)."""
    from saltus.flow.kernels import lawson_segment as kernels

    return np.array([kernels.flow.address, kernels.dense.address, 0, kernels.check.address])


def merged(
    mesh: tuple[NDArray[np.float64], NDArray[np.int64]], modes: NDArray[np.int64], frames: Frames
) -> list[NDArray[np.float64]]:
    """Return the segments' meshes with some explicit steps in one where steps will be those of a frame.

    Parameters
    ----------
    mesh : (ndarray, ndarray)
        All segments' clustered times, and where each begins.
    modes : ndarray of int64, shape (segments,)
        Where the segments run.
    frames : Frames
        The linear parts.
    """
    meshes = np.split(mesh[0], mesh[1][1:-1])
    for i, mode in enumerate(modes.tolist()):
        if frames.parts[mode, 0] > 0.0:
            steps = meshes[i].size - 1
            fewer = max(math.ceil(steps / _MERGED), 1)
            meshes[i] = np.interp(np.linspace(0.0, steps, fewer + 1), np.arange(steps + 1), meshes[i])
    return meshes


def pieces(
    mesh: tuple[NDArray[np.float64], NDArray[np.int64]],
    modes: NDArray[np.int64],
    durations: NDArray[np.float64],
    frames: Frames,
) -> list[NDArray[np.float64]]:
    """Return the meshes of the dense output, whose pieces resolve what turns in a frame; arguments as of `merged`."""
    meshes = np.split(mesh[0], mesh[1][1:-1])
    for i, (mode, lasting) in enumerate(zip(modes.tolist(), np.abs(durations).tolist(), strict=True)):
        if frames.parts[mode, 0] > 0.0:
            ends, share = meshes[i], (np.arange(_LOOKS) + 0.5) / _LOOKS
            length = np.diff(ends)[:, None]
            places = ends[:-1, None] + share * length
            turns = frames.parts[mode, 3] * lasting * 6.0 * places * (1.0 - places) * length / PIECE
            counts = np.append(0.0, np.cumsum(np.maximum(turns, PARTS) / _LOOKS))
            edges = np.append((places - 0.5 * length / _LOOKS).ravel(), 1.0)
            count = min(math.ceil(counts[-1]), _MOST_PIECES)
            meshes[i] = np.interp(np.linspace(0.0, counts[-1], count + 1), counts, edges)
            meshes[i][[0, -1]] = 0.0, 1.0
    return meshes
