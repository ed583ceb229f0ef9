"""Boxes along attractors that are no periodic orbits, which a motion on the attractor stays in."""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from saltus.basins.attractors.cloud import extent_of
from saltus.ensemble.traps import Cells
from saltus.result import frozen

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from saltus.ensemble.ensemble import Ensemble
    from saltus.ensemble.map_ensemble import MapEnsemble

__all__ = ["Boxes", "boxes_along"]

_POINTS = 20_000  # states of each attractor of which boxes are made
_MOTIONS = 256  # motions that visit them

_PUSH = 1e-6  # distance of their starts from the attractor, over its extent
_FORGOTTEN = 64  # strobes before their states count

_PARTS = (96, 64, 48, 32, 24, 16, 12, 8)  # boxes along an attractor's extent, in the order in which they are tried

_COVERED = 0.99  # share of each attractor's fresh states that its boxes must hold
_EXTENT = 1e-6  # least extent of an attractor, over the states' scale


class Boxes(NamedTuple):
    """Boxes along attractors, and the shares of the attractors' strobes that they hold."""

    cells: Cells
    # share of each attractor's strobes that falls into its boxes, by label, from strobes that did not make the boxes
    covered: dict[int, float]


def boxes_along(
    ensemble: Ensemble | MapEnsemble,
    clouds: dict[int, NDArray[np.float64]],
    others: NDArray[np.float64],
    scale: NDArray[np.float64],
    visits: int,
    rng: np.random.Generator,
    curves: Mapping[int, NDArray[np.float64]] = MappingProxyType({}),
) -> Boxes:
    """Return the finest boxes along attractors that hold nearly all of their strobes: docs/theory/basins.md.

    Parameters
    ----------
    ensemble : Ensemble
        Engine that follows motions on the attractors.
    clouds : dict of int to ndarray, shape (k, n)
        States on each attractor, by label.
    others : ndarray, shape (m, n)
        States on other attractors, which must lie outside all boxes.
    scale : ndarray, shape (n,)
        Size of each state.
    visits : int
        Strobes in a row that a motion must be seen in one attractor's boxes.
    rng : numpy.random.Generator
    curves : mapping of int to ndarray, shape (k, n), optional
        States all along cycles, by label: strobes that are locked to a cycle see only some.
    """
    seen, fresh = ({label: _followed(ensemble, cloud, rng) for label, cloud in clouds.items()} for _ in range(2))
    seen = {label: np.concatenate([cloud, curves.get(label, cloud[:0])]) for label, cloud in seen.items()}
    extents = [extent_of(cloud, ensemble.system.angle_places) for cloud in seen.values()]
    widest = np.maximum(np.min(extents, axis=0), 1e-3 * np.max(extents, axis=0))
    widest = np.maximum(widest, _EXTENT * scale)
    origin = np.min([cloud.min(axis=0) for cloud in seen.values()], axis=0)
    best: Boxes | None = None
    for parts in _PARTS:
        size = widest / parts
        start = origin - 0.37 * size
        boxes = {label: _boxes(cloud, start, size) for label, cloud in seen.items()}
        shared = np.concatenate([*boxes.values(), *([_boxes(others, start, size)] if len(others) else [])])
        if len(np.unique(shared, axis=0)) < len(shared) and best is not None:
            break  # coarser boxes would hold parts of two attractors
        covered = {label: _part(fresh[label], boxes[label], start, size) for label in clouds}
        labels = np.concatenate([np.full(len(own), label) for label, own in boxes.items()])
        every = np.concatenate(list(boxes.values()))
        order = np.lexsort(every.T[::-1])
        cells = Cells(
            frozen(start), frozen(size), frozen(every[order], np.int64), frozen(labels[order], np.uint8), visits
        )
        best = Boxes(cells, covered)
        if min(covered.values()) >= _COVERED:
            break
    assert best is not None
    return best


def _followed(
    ensemble: Ensemble | MapEnsemble, cloud: NDArray[np.float64], rng: np.random.Generator
) -> NDArray[np.float64]:
    """Return strobes of motions from beside an attractor, after their return and decorrelation."""
    starts = cloud[:: -(-len(cloud) // _MOTIONS)]
    pushes = _PUSH * np.ptp(cloud, axis=0) * rng.standard_normal(starts.shape) * ~ensemble.lacked(starts)
    x, modes = ensemble.strobe(starts + pushes, count=_FORGOTTEN)
    kept = np.isfinite(x).all(axis=1)
    x, modes = x[kept], modes[kept]
    states = []
    for _ in range(-(-_POINTS // len(x))):
        x, modes = ensemble.strobe(x, modes)
        states.append(x)
    return np.concatenate(states)


def _boxes(points: NDArray[np.float64], origin: NDArray[np.float64], size: NDArray[np.float64]) -> NDArray[np.int64]:
    return np.unique(np.floor((points - origin) / size).astype(np.int64), axis=0)


def _part(
    points: NDArray[np.float64], boxes: NDArray[np.int64], origin: NDArray[np.float64], size: NDArray[np.float64]
) -> float:
    """Return the share of the points that falls into the boxes."""
    known = {tuple(box) for box in boxes.tolist()}
    indices = np.floor((points - origin) / size).astype(np.int64)
    return sum(tuple(index) in known for index in indices.tolist()) / len(points)
