"""Basin entropy, and its test for fractal boundaries: docs/theory/integrity.md, "Entropy"."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from saltus import checks
from saltus.basins.map.chunked_reading import BLOCK, blocks, checked_basins, read
from saltus.ensemble.traps import UNDECIDED
from saltus.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.basins.map.chunked_reading import Labelled

__all__ = ["BasinEntropy", "basin_entropy"]


@dataclass(frozen=True)
class BasinEntropy:
    """Entropy of basins over boxes of cells; natural logarithms.

    Attributes
    ----------
    value : float
        Basin entropy S_b, the mean over all boxes.
    error : float
        Its standard error, as of independent boxes.
    boundary : float
        Boundary basin entropy S_bb, the mean over the boxes with more than one outcome; NaN where there is none.
    boundary_error : float
        Its standard error, as of independent boxes; NaN for fewer than two.
    box : int
        Cells on a box's edge.
    boxes, boundary_boxes : int
        Count of all boxes, and of those with more than one outcome.
    """

    value: float
    error: float
    boundary: float
    boundary_error: float
    box: int
    boxes: int
    boundary_boxes: int

    @property
    def fractal(self) -> bool:
        """Whether S_bb exceeds ln 2 by more than two standard errors; False proves nothing."""
        return bool(self.boundary - 2.0 * self.boundary_error > math.log(2.0))


def basin_entropy(basins: Labelled, box: int = 5) -> BasinEntropy:
    r"""Return basin entropy and boundary basin entropy.

    The grid is cut into boxes of ``box`` cells on each edge; cells left over at the upper ends are not used. With the
    shares :math:`p_{ij}` of outcome j among the cells of box i,

    .. math:: S_i = -\sum_j p_{ij} \ln p_{ij}, \quad S_b = \frac1N \sum_i S_i, \quad S_{bb} = \frac1{N_b} \sum_i S_i,

    over all N boxes, and over the N_b of them with more than one outcome. Divergence is an outcome; undecided cells
    are left out, and a box of nothing else with them.

    A smooth boundary parts two outcomes in all boxes but a vanishing share of them, so that S_bb is at most ln 2.
    Therefore S_bb > ln 2 proves a fractal boundary, in the limit of small boxes. The converse does not hold.

    Parameters
    ----------
    basins : Basins
        A finished grid of any dimension; it is read block by block.
    box : int, optional
        Cells on a box's edge, at least 2.

    Returns
    -------
    BasinEntropy

    Raises
    ------
    InputError
        A box that does not fit into the grid, or cells that are not done.

    Notes
    -----
    The shares come from ``box**D`` cells. With A outcomes mixed in a box, the entropy is therefore too small by about
    ``(A - 1) / (2 box**D)``.

    References
    ----------
    A. Daza, A. Wagemakers, B. Georgeot, D. Guéry-Odelin, M. A. F. Sanjuán, Basin entropy: a new tool to analyze
    uncertainty in dynamical systems, Sci. Rep. 6 (2016) 31416.

    Examples
    --------
    A half plane whose edge cuts a tenth of the boxes 3 to 7:

    >>> from saltus.basins.map.basins import Basins
    >>> x = np.arange(100.0)
    >>> basins = Basins.from_array(np.repeat((x >= 43.0)[:, None], 100, axis=1), {"x": x, "y": x}, {"a": 0, "b": 1})
    >>> found = basin_entropy(basins, box=10)
    >>> print("%.5f %.5f %s" % (found.value, found.boundary, found.fractal))
    0.06109 0.61086 False
    """
    shape = tuple(checked_basins(basins, "labels").labels.shape)
    if min(shape) < 2:
        raise InputError("basins", shape, "a grid of at least two cells along each coordinate")
    box = checks.count("box", box, 2, min(shape), "the cells on the shortest axis")
    boxes, mixed = 0, []
    for block in blocks(basins.labels, multiple=box, most=BLOCK // 4):
        cells = _boxed(read(basins.labels, block), box)
        least = cells.min(axis=1)
        boxes += int((least < UNDECIDED).sum())
        mixed.append(_entropies(cells[least != cells.max(axis=1)]))
    entropies = np.concatenate(mixed)
    entropies = entropies[entropies > 0.0]
    n, total, squares = entropies.size, float(entropies.sum()), float((entropies**2).sum())
    if boxes == 0:
        raise InputError("basins", "cells that are all undecided", "a grid with decided cells")
    return BasinEntropy(
        value=total / boxes,
        error=_standard_error(total, squares, boxes),
        boundary=total / n if n else math.nan,
        boundary_error=_standard_error(total, squares, n),
        box=box,
        boxes=boxes,
        boundary_boxes=n,
    )


def _boxed(labels: NDArray[np.uint8], box: int) -> NDArray[np.uint8]:
    """Return the labels of each whole box, shape (boxes, box**D)."""
    whole = [n // box for n in labels.shape]
    cut = labels[tuple(slice(n * box) for n in whole)]
    parted = cut.reshape([length for n in whole for length in (n, box)])
    order = [*range(0, parted.ndim, 2), *range(1, parted.ndim, 2)]
    return np.ascontiguousarray(parted.transpose(order)).reshape(-1, box**labels.ndim)


def _entropies(cells: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Return the entropy of each row, undecided cells left out."""
    known = (cells != UNDECIDED).sum(axis=1)
    entropies = np.zeros(len(cells))
    for label in np.unique(cells):
        if label != UNDECIDED:
            share = (cells == label).sum(axis=1) / np.maximum(known, 1)
            entropies -= share * np.log(np.where(share > 0.0, share, 1.0))
    return entropies


def _standard_error(total: float, squares: float, n: int) -> float:
    """Return the standard error of a mean of n numbers, from their sum and sum of squares."""
    if n < 2:
        return math.nan
    return math.sqrt(max(squares - total**2 / n, 0.0) / (n - 1) / n)
