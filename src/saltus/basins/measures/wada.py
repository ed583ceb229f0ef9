"""Wada property, three or more basins with one boundary, by merging: docs/theory/integrity.md, "Wada"."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from saltus import checks
from saltus.basins.map.chunked_reading import BLOCK, blocks, checked_basins, outcome_of, read, surroundings
from saltus.ensemble.traps import UNDECIDED
from saltus.result import frozen

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.basins.map.chunked_reading import Labelled

__all__ = ["WadaTest", "wada_by_merging"]


@dataclass(frozen=True)
class WadaTest:
    """Distances between the boundaries of merged basins.

    Attributes
    ----------
    names : tuple of str
        The outcomes in the grid.
    distances : ndarray of int, shape (outcome, outcome)
        ``distances[i, j]``: cells by which basin j's boundary must be fattened to hold basin i's, each against all
        other basins. ``reach + 1`` where more than `reach` are needed.
    reach : int
        Distance in cells up to which boundaries count as the same.
    """

    names: tuple[str, ...]
    distances: NDArray[np.int64]
    reach: int

    def __post_init__(self) -> None:
        object.__setattr__(self, "distances", frozen(self.distances, np.int64))

    @property
    def wada(self) -> bool:
        """Whether there are three outcomes or more, and all boundaries are the same within `reach` cells."""
        return len(self.names) >= 3 and int(self.distances.max()) <= self.reach


def wada_by_merging(basins: Labelled, reach: int = 5) -> WadaTest:
    """Return whether the basins have the Wada property at the grid's resolution, by the merging method.

    For each outcome the basins of all others are merged into one. The boundary between the two consists of the cells
    with a neighbour (sides, edges and corners) on the other side. The basins have the Wada property if all these
    boundaries are one set. On a grid, each boundary must lie in every other one fattened by `reach` cells. The distance
    of two cells is that along the coordinate in which they are furthest apart.

    Parameters
    ----------
    basins : Basins
        A finished grid of any dimension; it is read block by block. Undecided cells belong to no side, and make no
        boundary.
    reach : int, optional
        Cells of fattening allowed. A finer grid should need no more of them: the width in the coordinates then goes to
        0.

    Returns
    -------
    WadaTest

    Raises
    ------
    InputError
        A reach that is no positive integer, cells that are not done.

    References
    ----------
    A. Daza, A. Wagemakers, M. A. F. Sanjuán, Ascertaining when a basin is Wada: the merging method, Sci. Rep. 8 (2018)
    9954.

    Examples
    --------
    Three sectors meet in one point only:

    >>> from saltus.basins.map.basins import Basins
    >>> x = np.linspace(-0.995, 0.995, 200)
    >>> angle = np.arctan2(*np.meshgrid(x, x, indexing="ij"))
    >>> sectors = (3.0 * (angle / (2.0 * np.pi) + 0.5)).astype(np.uint8)
    >>> basins = Basins.from_array(sectors, {"x": x, "y": x}, {"a": 0, "b": 1, "c": 2})
    >>> wada_by_merging(basins).wada
    False
    """
    shape = tuple(checked_basins(basins, "labels", "attractors").labels.shape)
    reach = min(checks.count("reach", reach), max(shape))
    present = np.zeros(256, np.bool_)
    for block in blocks(basins.labels):
        present[np.unique(read(basins.labels, block))] = True
    outcomes = [int(label) for label in np.flatnonzero(present) if label != UNDECIDED]
    distances = np.zeros((len(outcomes), len(outcomes)), np.int64)
    for block in blocks(basins.labels, most=BLOCK // 4):
        wide = surroundings(block, shape, reach + 1)
        core = tuple(slice(s.start - w.start, s.stop - w.start) for s, w in zip(block, wide, strict=True))
        found = read(basins.labels, wide)
        if len(np.unique(found)) > 1:
            edges = [_boundary(found, label) for label in outcomes]
            for j, edge in enumerate(edges):
                away = _steps_to(edge, reach)[core]
                for i, other in enumerate(edges):
                    distances[i, j] = max(distances[i, j], int(away[other[core]].max(initial=0)))
    return WadaTest(tuple(outcome_of(basins, label) for label in outcomes), distances, reach)


def _boundary(labels: NDArray[np.uint8], label: int) -> NDArray[np.bool_]:
    """Return the cells of a basin with a neighbour in any other, and those of others with a neighbour in it."""
    from scipy import ndimage

    own = labels == label
    others = ~own & (labels != UNDECIDED)
    size = (3,) * labels.ndim
    near_own = ndimage.maximum_filter(own, size, mode="nearest")
    near_others = ndimage.maximum_filter(others, size, mode="nearest")
    return np.asarray((own & near_others) | (others & near_own))


def _steps_to(edge: NDArray[np.bool_], reach: int) -> NDArray[np.int64]:
    """Return the chessboard distance of each cell from a set, in cells; ``reach + 1`` beyond `reach`."""
    from scipy import ndimage

    if not edge.any():
        return np.full(edge.shape, reach + 1)
    return np.asarray(np.minimum(ndimage.distance_transform_cdt(~edge, metric="chessboard"), reach + 1))
