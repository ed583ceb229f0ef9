"""Trapping regions as plain arrays: a motion seen there, at a look once a period, has a certain fate."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from saltus.ensemble.labels import DIVERGED, NOT_DONE, UNDECIDED

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

__all__ = ["DIVERGED", "NOT_DONE", "UNDECIDED", "Cages", "Cells", "Ellipsoids", "Traps"]


@dataclass(frozen=True)
class Ellipsoids:
    """Ellipsoids ``|shape (x - centre)| < 1``, cut by planes to where ``normal . (x - centre) < offset`` for each."""

    centres: NDArray[np.float64]  # shape (count, n)
    shapes: NDArray[np.float64]  # shape (count, n, n)
    labels: NDArray[np.uint8]  # shape (count,)
    normals: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 0, 0)))  # shape (count, planes, n)
    # shape (count, planes): all > 0. A plane that an ellipsoid lacks has the normal 0 and the offset 1.
    offsets: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 0)))
    # shape (count,): mode of the motions that it holds; -1 for all modes
    modes: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))

    def __post_init__(self) -> None:
        count, n = self.centres.shape
        if not self.offsets.size:
            object.__setattr__(self, "normals", np.empty((count, 0, n)))
            object.__setattr__(self, "offsets", np.empty((count, 0)))
        if not self.modes.size:
            object.__setattr__(self, "modes", np.full(count, -1))

    @classmethod
    def joined(cls, parts: Sequence[Ellipsoids]) -> Ellipsoids:
        """Return all ellipsoids of several."""
        lacking = [(0, max(part.offsets.shape[1] for part in parts) - part.offsets.shape[1]) for part in parts]
        normals = [np.pad(part.normals, ((0, 0), pad, (0, 0))) for part, pad in zip(parts, lacking, strict=True)]
        offsets = [
            np.pad(part.offsets, ((0, 0), pad), constant_values=1.0) for part, pad in zip(parts, lacking, strict=True)
        ]
        centres, shapes, labels, modes = (
            np.concatenate([getattr(part, name) for part in parts]) for name in ("centres", "shapes", "labels", "modes")
        )
        return cls(centres, shapes, labels, np.concatenate(normals), np.concatenate(offsets), modes)

    def smaller(self, times: NDArray[np.float64]) -> Ellipsoids:
        """Return the ellipsoids and their planes, each `times` times smaller, shape (count,)."""
        return replace(self, shapes=times[:, None, None] * self.shapes, offsets=self.offsets / times[:, None])

    def narrowest(self) -> float:
        """Return the least distance of a centre from where its ellipsoid, or a plane, ends."""
        half_width = 1.0 / float(np.linalg.norm(self.shapes, 2, axis=(1, 2)).max())
        lengths = np.linalg.norm(self.normals, axis=2)
        return min(half_width, float((self.offsets[lengths > 0.0] / lengths[lengths > 0.0]).min(initial=math.inf)))


@dataclass(frozen=True)
class Cages:
    """Sets ``sum_i max(|row_i . (x - centre)|, floor_i) < bound`` of motions in one mode, with complex rows."""

    centres: NDArray[np.float64]  # shape (count, n)
    rows: NDArray[np.complex128]  # shape (count, n_rows, n)
    floors: NDArray[np.float64]  # shape (count, n_rows)
    bounds: NDArray[np.float64]  # shape (count,)
    modes: NDArray[np.int64]  # shape (count,)
    labels: NDArray[np.uint8]  # shape (count,)


@dataclass(frozen=True)
class Cells:
    """Boxes of a grid that attractors visit; a motion is theirs after `visits` strobes in a row within one's boxes."""

    # origin, size: shape (n,): corner and size of the box of index 0
    origin: NDArray[np.float64]
    size: NDArray[np.float64]
    # shape (count, n): indices of the boxes, in lexicographic order: ``floor((x - origin) / size)``
    boxes: NDArray[np.int64]
    labels: NDArray[np.uint8]  # shape (count,)
    visits: int


@dataclass(frozen=True)
class Traps:
    """All trapping regions of a system's attractors, for states at phase 0 without the phase.

    Examples
    --------
    >>> ball = Ellipsoids(np.zeros((1, 2)), np.eye(2)[None], np.zeros(1, np.uint8))
    >>> Traps(2, ball).of(np.array([0.3, 0.4]), 0), Traps(2, ball).of(np.array([3.0, 4.0]), 0)
    (0, 254)
    """

    n: int  # count of the states
    # ellipsoids, cages, cells: the regions; None where there are none of a kind
    ellipsoids: Ellipsoids | None = None
    cages: Cages | None = None
    cells: Cells | None = field(default=None)
    limit: float = math.inf  # a state with a component beyond it has diverged

    def of(self, x: NDArray[np.float64], mode: int) -> int:
        """Return the label of a state's cage or ellipsoid, `DIVERGED`, or `UNDECIDED`; cells take longer."""
        if not (np.abs(x) < self.limit).all():
            return DIVERGED
        if (c := self.cages) is not None:
            for i in np.flatnonzero(c.modes == mode):
                moduli = np.abs(c.rows[i] @ (x - c.centres[i]))
                if np.maximum(moduli, c.floors[i]).sum() < c.bounds[i]:
                    return int(c.labels[i])
        if (e := self.ellipsoids) is not None:
            apart = x - e.centres
            sizes = (np.einsum("kij,kj->ki", e.shapes, apart) ** 2).sum(axis=1)
            sizes[(np.einsum("kpj,kj->kp", e.normals, apart) >= e.offsets).any(axis=1)] = np.inf
            sizes[(e.modes >= 0) & (e.modes != mode)] = np.inf
            best = int(np.argmin(sizes))
            if sizes[best] < 1.0:
                return int(e.labels[best])
        return UNDECIDED

    def box_of(self, x: NDArray[np.float64]) -> int:
        """Return the label of the box that a state lies in, or `UNDECIDED`."""
        if (c := self.cells) is None:
            return UNDECIDED
        index = np.floor((x - c.origin) / c.size)
        found = np.flatnonzero((c.boxes == index).all(axis=1))
        return int(c.labels[found[0]]) if found.size else UNDECIDED
