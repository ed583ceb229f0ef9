"""Meshes of an orbit's segments: made for its states, by explicit or implicit steps, and made stable."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from saltus.flow.stiffness import may_be_implicit, worth

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from saltus.system.compiled import Compiled

__all__ = [
    "FEW", "Decay", "adapted", "crowding", "decays", "decays_along", "implicit_second", "implicit_steps", "joined",
    "stabilised", "steady",
]  # fmt: skip

FEW = 500  # explicit steps of a segment up to which implicit ones are not tried
_FEW_STEPS = 1 << 12  # of a mesh that is tried before there is room for more
_LONGER = 8  # factor on the room for a mesh that had too little
_STEADY = 3.0  # longest step, times the rate of the fastest decay, in which decayed states stay small
_MOST_PARTS = 100_000  # parts of a step at most; a faster decay is left to the errors of steps
_SLOW = 30.0  # decay over a segment up to which no mesh is too coarse for it
_MANY = _FEW_STEPS  # steps of one segment from which on its decay is looked at all along it


class Decay(NamedTuple):
    """Decays over a segment, as `decays` has them: at some clustered times, the most of both ends between two."""

    places: NDArray[np.float64]  # shape (place,), from 0 to 1
    values: NDArray[np.float64]  # shape (place,)

    def most(self, mesh: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the most in each step of a mesh, shape (step,)."""
        between = np.maximum(self.values[:-1], self.values[1:])
        first = np.searchsorted(self.places, mesh[:-1], side="right") - 1
        last = np.searchsorted(self.places, mesh[1:], side="left")
        first = np.clip(first, 0, between.size - 1)
        ends = np.column_stack([first, np.maximum(last, first + 1)]).ravel()
        return np.asarray(np.maximum.reduceat(np.append(between, 0.0), ends)[::2])


class _Stopped(NamedTuple):
    """The segment that cannot be followed, and whether its flow ends on the way."""

    segment: int
    blocked: bool


def adapted(
    compiled: Compiled,
    functions: NDArray[np.int64],
    modes: NDArray[np.int64],
    blocks: NDArray[np.float64],
    p: NDArray[np.float64],
    tolerances: tuple[float, float],
    states: int,
    implicit: bool,
) -> tuple[list[NDArray[np.float64]], bool] | int:
    """Return each segment's mesh, its steps as long as the tolerances allow; a segment that cannot be followed.

    With the meshes comes whether they are those of implicit steps, which a stiff flow is followed by. They are tried
    where explicit ones are many, and taken where they cost less time. Both have room for steps of the same time, more
    and more of it, until one of them is through: where explicit steps follow fast oscillations, the other is soon over.

    Parameters
    ----------
    functions : ndarray of int64
        `Compiled.addresses` with the states' shares of the absolute tolerance.
    modes : ndarray of int64, shape (segments,)
        Where the segments run.
    blocks : ndarray, shape (segments, n + 1)
        State at each one's start, and its duration.
    p : ndarray
        Extended parameters.
    tolerances : (float, float)
        Relative and absolute.
    states : int
        Components without the phase.
    implicit : bool
        Whether explicit steps are not tried.
    """
    from saltus.flow.kernels import implicit_segment as implicit_kernels, segment as segment_kernels

    def made(adapt: Callable[..., int], most: int) -> list[NDArray[np.float64]] | _Stopped:
        meshes = []
        for index, (mode, block) in enumerate(zip(modes, blocks, strict=True)):
            x, mesh = np.ascontiguousarray(block[:-1]), np.empty(most + 1)
            count = adapt(functions, mode, x, block[-1], p, *tolerances, mesh)
            if count < 0:
                return _Stopped(index, count == segment_kernels.BLOCKED)
            meshes.append(mesh[: count + 1].copy())
        return meshes

    def may() -> bool:
        starts = [np.ascontiguousarray(block[:-1]) for block in blocks]
        return all(may_be_implicit(compiled, int(mode), x, p, states) for mode, x in zip(modes, starts, strict=True))

    most = segment_kernels.MOST_STEPS
    if implicit:
        stiff = made(implicit_kernels.adapt, _FEW_STEPS) if may() else None
        if isinstance(stiff, list):
            return stiff, True
        explicit = made(segment_kernels.adapt, most)
        return (explicit, False) if isinstance(explicit, list) else explicit.segment
    room, dearer = _FEW_STEPS, worth(compiled.n)
    while True:
        explicit = made(segment_kernels.adapt, room)
        if isinstance(explicit, list):
            count = max(map(len, explicit))
            if count <= FEW:
                break
        elif explicit.blocked and max(decays(compiled, modes, blocks, p)) < FEW:
            break  # a singularity: no decay is so fast that steps were short for it
        else:
            count = room
        few = min(int(count / dearer), _FEW_STEPS)
        if not isinstance(explicit, list) and room == most:
            few = _FEW_STEPS
        stiff = made(implicit_kernels.adapt, few) if few and may() else None
        if isinstance(stiff, list):
            return stiff, True
        if isinstance(explicit, list) or room == most:
            break
        room = min(_LONGER * room, most)
    return (explicit, False) if isinstance(explicit, list) else explicit.segment


@cache
def implicit_steps() -> NDArray[np.int64]:
    """Return addresses of the flow by implicit steps, its dense output, its variations and its check, shape (4,)."""
    from saltus.flow.kernels import implicit_segment as kernels

    return np.array([way.address for way in (kernels.flow, kernels.dense, kernels.vary, kernels.check)])


def implicit_second() -> int:
    """Return the address of the flow by implicit steps with second derivatives."""
    from saltus.flow.kernels.implicit_second import flow_second

    return int(flow_second.address)


def decays(
    compiled: Compiled, modes: NDArray[np.int64], blocks: NDArray[np.float64], p: NDArray[np.float64]
) -> list[float]:
    """Return by how many factors e the state decays that does so fastest by itself, for each segment.

    Parameters
    ----------
    modes, blocks, p : ndarray
        As of `adapted`.
    """
    from saltus.flow.kernels import segment as segment_kernels

    found = np.empty(modes.size)
    segment_kernels.decays(compiled.addresses, modes, blocks.ravel(), compiled.n, p, found)
    return [float(most) for most in found]


def decays_along(
    compiled: Compiled, mode: int, states: NDArray[np.float64], places: NDArray[np.float64], given: tuple[Any, float]
) -> Decay:
    """Return the decays all along a segment from its states at clustered times.

    Parameters
    ----------
    states : ndarray, shape (place, n)
        States there.
    given : (ndarray, float)
        Extended parameters, and the segment's duration.
    """
    p, duration = given
    blocks = np.column_stack([states, np.full(len(states), duration)])
    return Decay(places.copy(), np.array(decays(compiled, np.full(len(states), mode), blocks, p)))


def stabilised(
    places: NDArray[np.float64],
    starts: NDArray[np.int64],
    decays: Sequence[float | Decay],
    longer: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return meshes, one after the other, with steps cut where they are too long for stability; where each begins.

    Parameters
    ----------
    places : ndarray
        All segments' clustered times.
    starts : ndarray of int64, shape (segments + 1,)
        Where each segment's begin.
    decays : sequence
        Decay over each segment: what `decays` returns, or `decays_along`.
    longer : ndarray, shape (segments,)
        Each segment's duration over that of which its decay is known; where it is shorter now, meshes stay.
    """
    now = [_over(decay, max(ratio, 1.0)) for decay, ratio in zip(decays, longer.tolist(), strict=True)]
    if not any(isinstance(decay, Decay) or decay > _SLOW for decay in now):
        return places, starts
    parts = np.split(places, starts[1:-1])
    return joined([steady(mesh, decay) for mesh, decay in zip(parts, now, strict=True)])


def _over(decay: float | Decay, longer: float) -> float | Decay:
    """Return the decay over a segment that lasts longer by a factor."""
    return decay._replace(values=longer * decay.values) if isinstance(decay, Decay) else longer * decay


def joined(meshes: list[NDArray[np.float64]]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the segments' meshes one after the other, and where each begins."""
    return np.concatenate(meshes), np.concatenate([[0], np.cumsum([len(mesh) for mesh in meshes])]).astype(np.int64)


def crowding(places: NDArray[np.float64], starts: NDArray[np.int64], decays: Sequence[float | Decay]) -> list[int]:
    """Return the segments that would be cut in very many steps for a decay that is known at their start alone.

    A state that falls from far away decays much faster there than on the rest of its way.
    """
    if not any(not isinstance(decay, Decay) and decay > _SLOW for decay in decays):
        return []
    parts = np.split(places, starts[1:-1])
    return [
        i
        for i, (mesh, decay) in enumerate(zip(parts, decays, strict=True))
        if not isinstance(decay, Decay) and decay > _SLOW and _parts(mesh, decay).sum() > _MANY
    ]


def steady(mesh: NDArray[np.float64], decay: float | Decay) -> NDArray[np.float64]:
    """Return a mesh with steps cut where they are too long for stability, at a decay over the segment.

    A state that has decayed leaves no error in a step, however long, but its sensitivity would grow in it.
    """
    if not isinstance(decay, Decay) and not decay > _SLOW:
        return mesh
    parts = _parts(mesh, decay)
    ends = np.concatenate([[0], np.cumsum(parts)])
    return np.interp(np.arange(ends[-1] + 1), ends, mesh)


def _parts(mesh: NDArray[np.float64], decay: float | Decay) -> NDArray[np.int_]:
    """Return in how many parts each step of a mesh is cut."""
    most = decay.most(mesh) if isinstance(decay, Decay) else decay
    middles = np.clip(0.5, mesh[:-1], mesh[1:])  # where the clustered time of a step runs fastest
    cut = np.ceil(most * 6.0 * middles * (1.0 - middles) * np.diff(mesh) / _STEADY).clip(1, _MOST_PARTS)
    return np.asarray(cut.astype(int))
