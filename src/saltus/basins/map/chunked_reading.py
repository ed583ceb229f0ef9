"""Block-wise reading of labels, for measures of grids larger than memory."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from saltus import checks
from saltus.basins.map.grid import tiles
from saltus.ensemble.traps import NOT_DONE, UNDECIDED
from saltus.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from saltus.basins.map.grid import Grid

__all__ = ["BLOCK", "Labelled", "blocks", "checked_basins", "label_of", "outcome_of", "read", "surroundings"]

BLOCK = 2**24  # cells that are read at once


class Labelled(Protocol):
    """Interface of basins to the measures: labels, grid and outcomes; `Basins` implements it."""

    @property
    def labels(self) -> Any:
        """Labels, an array with the grid's shape."""

    @property
    def grid(self) -> Grid:
        """The grid."""

    @property
    def attractors(self) -> Any:
        """Outcomes with ``.labels``, by name, and ``.points``, each attractor's points at the strobes."""


def label_of(basins: Labelled, name: str) -> int:
    """Return the label of an outcome.

    Raises
    ------
    InputError
        There is no outcome of that name.
    """
    known = checked_basins(basins, "grid", "attractors").attractors.labels
    return int(known[checks.chosen("name", name, known)])


def checked_basins(basins: Any, *parts: str) -> Any:
    """Return the argument, if it has the parts of basins that a measure needs.

    Raises
    ------
    InputError
        A part is missing.
    """
    try:
        whole = not isinstance(basins, type) and all(hasattr(basins, part) for part in parts)
    except Exception:  # of an object that raises what it likes
        whole = False
    if not whole:
        raise InputError("basins", basins, "a Basins", "map_basins gives one")
    return basins


def outcome_of(basins: Labelled, label: int) -> str:
    """Return the name of a label."""
    names = {int(byte): name for name, byte in basins.attractors.labels.items()} | {UNDECIDED: "undecided"}
    return str(names.get(label, f"label {label}"))


def blocks(labels: Any, *, multiple: int = 1, most: int = BLOCK) -> Iterator[tuple[slice, ...]]:
    """Return slices that cover an array, in C order, each of about `most` cells.

    Parameters
    ----------
    labels : array
        Any array; blocks never cut the units of a store or the chunks of a Zarr array.
    multiple : int, optional
        Blocks begin at multiples of this count of cells on each axis.
    most : int, optional
        Cells of a block; only a cube of edge `multiple` may have more.

    Examples
    --------
    >>> [[(s.start, s.stop) for s in block] for block in blocks(np.zeros((4, 3)), most=6)]
    [[(0, 2), (0, 3)], [(2, 4), (0, 3)]]
    """
    shape = tuple(labels.shape)
    chunks = getattr(labels, "unit", None) or getattr(labels, "chunks", None) or shape
    edges = [_up(min(chunk, length), multiple) for chunk, length in zip(chunks, shape, strict=True)]
    while math.prod(edges) > most and max(edges) > multiple:
        widest = edges.index(max(edges))
        edges[widest] = _up(-(-edges[widest] // 2), multiple)
    for axis in reversed(range(len(shape))):
        while edges[axis] < shape[axis] and 2 * math.prod(edges) <= most:
            edges[axis] *= 2
    return tiles(shape, edges)


def surroundings(block: tuple[slice, ...], shape: tuple[int, ...], halo: int) -> tuple[slice, ...]:
    """Return a block widened by `halo` cells on every side, as far as the array goes."""
    return tuple(slice(max(s.start - halo, 0), min(s.stop + halo, n)) for s, n in zip(block, shape, strict=True))


def read(labels: Any, block: tuple[slice, ...]) -> NDArray[np.uint8]:
    """Return the labels of a block.

    Raises
    ------
    InputError
        Some of them are not known yet.
    """
    found = np.asarray(labels[block])
    if (found == NOT_DONE).any():
        raise InputError("basins", "cells that are not done", "a finished grid", "resume its computation first")
    return found


def _up(count: int, multiple: int) -> int:
    return -(-count // multiple) * multiple
