r"""Integrity of basins: distances of attractors from basin boundaries, and sizes of basins.

Distances are measured in the free coordinates of the grid, as :math:`|\Delta| = \sqrt{\sum_i (\Delta x_i / w_i)^2}`
with a weight for each coordinate, 1 by default. A ball of radius r is then an ellipsoid with semi-axes :math:`r w_i`;
cells need not be cubes. Coordinates of different units need weights: a ball that is round in one choice of units is not
in another.

Only the labels of cell centres are known. A basin is taken to be the union of the cells with its label. Where the true
boundary is flat across a cell, the two boundaries are nowhere further apart than half a cell's diagonal. Half a
diagonal is thus the error of a distance; docs/theory/integrity.md, "What a grid knows", has the proof. Parts of a basin
thinner than a cell may be missed. Undecided cells count as outside.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from saltus.basins.map.chunked_reading import blocks, label_of, outcome_of, read
from saltus.basins.measures.distances import (
    closed_axes,
    farthest_site,
    half_diagonal,
    nearest_outside,
    own_cell,
    room_about,
    start_of,
    weights_of,
)
from saltus.errors import InputError
from saltus.system.angles import wrapped

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from saltus.basins.map.chunked_reading import Labelled

__all__ = [
    "Ball",
    "FatalPerturbation",
    "Volume",
    "global_integrity",
    "integrity_factor",
    "local_integrity",
    "minimal_fatal_perturbation",
]

_MEMORY = 2**32  # bytes that a distance transform may take


@dataclass(frozen=True)
class Volume:
    """Size of a basin.

    Attributes
    ----------
    value : float
        Hypervolume in the units of the free coordinates.
    error : float
        Standard error, if cells next to the boundary are on its wrong side independently of each other. It is half a
        cell times the square root of the number of neighbouring cells that the boundary parts. It does not hold for a
        flat boundary along the cells, which are then all on one side.
    bound : float
        Half a cell for each pair of cells that the boundary parts: the largest error for a boundary that is flat across
        a cell.
    share, share_error : float
        Share of the window, and its standard error.
    cells : int
        Count of the basin's cells.
    """

    value: float
    error: float
    bound: float
    share: float
    share_error: float
    cells: int


@dataclass(frozen=True)
class Ball:
    """The largest ball in a basin.

    Attributes
    ----------
    value : float
        Its radius, in the metric of the weights.
    error : float
        Error of the radius, from the size of the cells.
    clipped : bool
        Whether the window limits the ball, not the basin: `value` is then only a lower bound.
    centre : ndarray, shape (free coordinates,)
        Centre of the ball.
    off_section : float
        Distance of the attractor's point from the plane of the grid, along the frozen coordinates and in their units.
    note : str
        A remark in words; mostly empty.
    """

    value: float
    error: float
    clipped: bool
    centre: NDArray[np.float64]
    off_section: float = 0.0
    note: str = ""


@dataclass(frozen=True)
class FatalPerturbation:
    """A smallest perturbation that takes a motion out of a basin.

    Attributes
    ----------
    value : float
        Length of the perturbation in the metric of the weights; infinite where nothing in the window is fatal.
    error : float
        Length by which the true smallest perturbation may be shorter; it is not longer.
    clipped : bool
        Whether a shorter fatal perturbation may lead out of the window.
    centre : ndarray, shape (free coordinates,)
        Start of the perturbation.
    vector : ndarray, shape (free coordinates,)
        The perturbation, to the centre of a cell outside the basin; NaN where nothing is fatal.
    outcome : str
        Outcome of the perturbed motion: the name of the cell's label.
    off_section, note
        As for a `Ball`.
    """

    value: float
    error: float
    clipped: bool
    centre: NDArray[np.float64]
    vector: NDArray[np.float64]
    outcome: str
    off_section: float = 0.0
    note: str = ""


def global_integrity(basins: Labelled, name: str) -> Volume:
    """Return the global integrity measure (GIM): the hypervolume of a basin within the grid's window, and its share.

    Soliman and Thompson divide by the volume at a reference value of a parameter; `erosion_profile` gives the volumes
    from which any such ratio follows.

    Parameters
    ----------
    basins : Basins
        A finished grid of any dimension; it is read block by block.
    name : str
        An attractor, or another outcome.

    Returns
    -------
    Volume

    Raises
    ------
    InputError
        An unknown name, or cells that are not done.

    References
    ----------
    M. S. Soliman, J. M. T. Thompson, Integrity measures quantifying the erosion of smooth and fractal basins of
    attraction, J. Sound Vib. 135 (1989) 453-475; G. Rega, S. Lenci, Identifying, evaluating, and controlling dynamical
    integrity measures in non-linear mechanical oscillators, Nonlinear Anal. 63 (2005) 902-914.

    Examples
    --------
    A disc of radius 0.6:

    >>> from saltus.basins.map.basins import Basins
    >>> x = np.linspace(-0.995, 0.995, 200)
    >>> outside = np.hypot(*np.meshgrid(x, x, indexing="ij")) > 0.6
    >>> disc = Basins.from_array(outside, {"x": x, "y": x}, {"a": 0, "b": 1}, {"a": [[0.0, 0.0]]})
    >>> found = global_integrity(disc, "a")
    >>> print("%.3f, error %.3f, share %.3f" % (found.value, found.error, found.share))
    1.130, error 0.001, share 0.283
    """
    label, labels = label_of(basins, name), basins.labels
    shape = tuple(labels.shape)
    last = [np.empty([n for k, n in enumerate(shape) if k != axis], np.bool_) for axis in range(len(shape))]
    cells = parted = 0
    for block in blocks(labels):
        inside = read(labels, block) == label
        cells += int(inside.sum())
        for axis, edge in enumerate(last):
            layers, place = np.moveaxis(inside, axis, 0), block[:axis] + block[axis + 1 :]
            parted += int((layers[1:] != layers[:-1]).sum())
            if block[axis].start:
                parted += int((layers[0] != edge[place]).sum())
            edge[place] = layers[-1]
    cell, total = math.prod(basins.grid.spacing), math.prod(shape)
    error = 0.5 * math.sqrt(parted)
    return Volume(cell * cells, cell * error, 0.5 * cell * parted, cells / total, error / total, cells)


def local_integrity(
    basins: Labelled,
    name: str,
    *,
    weights: Mapping[str, float] | None = None,
    centre: ArrayLike | None = None,
) -> Ball:
    """Return the local integrity measure (LIM): the radius of the largest ball about an attractor in its basin.

    It is the distance of the attractor from the nearest cell with another label, or from a nearer edge of the window
    (`Ball.clipped`). It is 0 where the attractor's own cell has another label.

    Parameters
    ----------
    basins : Basins
        A finished grid of any dimension; only cells nearer than the nearest so far are read.
    name : str
        The attractor.
    weights : mapping of str to float, optional
        Lengths by which the coordinates are divided, for each free coordinate: the anisometric LIM. All 1 by default.
    centre : array_like, shape (free coordinates,), optional
        Centre of the ball; by default the attractor's first point at the strobes, projected onto the free coordinates.
        `Ball.off_section` is the distance of this point from the grid's plane.

    Returns
    -------
    Ball

    Raises
    ------
    InputError
        An unknown name, a weight that is missing or not positive, a centre outside the window, cells that are not done.

    References
    ----------
    M. S. Soliman, J. M. T. Thompson, Integrity measures quantifying the erosion of smooth and fractal basins of
    attraction, J. Sound Vib. 135 (1989) 453-475; P. Belardinelli, S. Lenci, G. Rega, Seamless variation of isometric
    and anisometric dynamical integrity measures in basins' erosion, Commun. Nonlinear Sci. Numer. Simul. 56 (2018)
    499-507.

    Examples
    --------
    An ellipse with semi-axes 0.8 and 0.4:

    >>> from saltus.basins.map.basins import Basins
    >>> x = np.linspace(-0.995, 0.995, 200)
    >>> outside = np.hypot(*np.meshgrid(x / 0.8, x / 0.4, indexing="ij")) > 1.0
    >>> ellipse = Basins.from_array(outside, {"x": x, "y": x}, {"a": 0, "b": 1}, {"a": [[0.0, 0.0]]})
    >>> found = local_integrity(ellipse, "a")
    >>> print("%.2f, error %.3f" % (found.value, found.error))
    0.40, error 0.007
    >>> found = local_integrity(ellipse, "a", weights={"x": 0.8, "y": 0.4})
    >>> print("%.2f, error %.3f" % (found.value, found.error))
    0.99, error 0.014
    """
    label, scale = label_of(basins, name), weights_of(basins.grid, weights)
    start, off = start_of(basins, name, centre)
    radius, _, _ = nearest_outside(basins, label, start, scale, 0.5)
    room = room_about(basins, start, scale)
    return Ball(
        value=min(radius, room),
        error=half_diagonal(basins.grid, scale),
        clipped=room < radius,
        centre=start,
        off_section=off,
        note=own_cell(basins, label, start),
    )


def integrity_factor(basins: Labelled, name: str, *, weights: Mapping[str, float] | None = None) -> Ball:
    """Return the integrity factor (IF): the radius of the largest ball anywhere in a basin and within the window.

    Every cell is a candidate for the centre, by the exact Euclidean distance transform. Let d be the largest distance
    of a cell's centre from the nearest centre outside, and e half a cell's diagonal. The radius is between ``d - 2 e``
    and ``d + e``, and `Ball.value` is the middle; docs/theory/integrity.md derives the bounds.

    Parameters
    ----------
    basins : Basins
        A finished grid that fits into memory, with ``4 D + 10`` bytes a cell in D dimensions.
    name : str
        An attractor, or another outcome.
    weights : mapping of str to float, optional
        Lengths by which the coordinates are divided, for each free coordinate. All 1 by default.

    Returns
    -------
    Ball
        With `Ball.clipped` where the window's edge touches the ball: a larger ball may fit into a larger window.

    Raises
    ------
    InputError
        An unknown name, a weight that is missing or not positive, cells that are not done, a grid too large.

    References
    ----------
    G. Rega, S. Lenci, Identifying, evaluating, and controlling dynamical integrity measures in non-linear mechanical
    oscillators, Nonlinear Anal. 63 (2005) 902-914; G. Rega, S. Lenci, Dynamical integrity and control of nonlinear
    mechanical oscillators, J. Vib. Control 14 (2008) 159-179.

    Examples
    --------
    An annulus between the radii 0.3 and 0.7:

    >>> from saltus.basins.map.basins import Basins
    >>> x = np.linspace(-0.995, 0.995, 200)
    >>> outside = abs(np.hypot(*np.meshgrid(x, x, indexing="ij")) - 0.5) > 0.2
    >>> annulus = Basins.from_array(outside, {"x": x, "y": x}, {"a": 0, "b": 1})
    >>> found = integrity_factor(annulus, "a")
    >>> print("%.2f, error %.2f" % (found.value, found.error))
    0.20, error 0.01
    """
    from scipy import ndimage

    label, scale, labels = label_of(basins, name), weights_of(basins.grid, weights), basins.labels
    sizes = np.asarray(basins.grid.spacing) / scale
    closed = closed_axes(basins)
    # a cell outside about the window; round a circle, half a turn more
    pads = [n // 2 + 1 if around else 1 for n, around in zip(labels.shape, closed, strict=True)]
    padded = tuple(n + 2 * pad for n, pad in zip(labels.shape, pads, strict=True))
    if (needed := math.prod(padded) * (4 * len(padded) + 10)) > _MEMORY:
        raise InputError(
            "basins", f"a grid of {' x '.join(map(str, labels.shape))} cells",
            f"one whose distance transform takes at most {_MEMORY / 2**30:g} GiB, not {needed / 2**30:.3g}",
            "take a section, or map a coarser grid",
        )  # fmt: skip
    inside = np.zeros(padded, np.bool_)
    for block in blocks(labels):
        inside[tuple(slice(s.start + pad, s.stop + pad) for s, pad in zip(block, pads, strict=True))] = (
            read(labels, block) == label
        )
    for axis in np.flatnonzero(closed).tolist():
        n, pad = labels.shape[axis], pads[axis]
        inside = inside.take(np.arange(-pad, n + pad) % n + pad, axis)
    error = 1.5 * half_diagonal(basins.grid, scale)
    if inside.all():  # round all circles
        return Ball(math.inf, error, False, np.array([axis[0] for axis in basins.grid.axes]))
    if not inside.any():
        return Ball(0.0, error, False, np.full(len(padded), np.nan), note=f"no cell is labelled {name!r}")
    sites = ndimage.distance_transform_edt(inside, sampling=sizes, return_distances=False, return_indices=True)
    pads = [pad if around else 0 for pad, around in zip(pads, closed, strict=True)]
    core = tuple(slice(pad, n - pad) for pad, n in zip(pads, padded, strict=True))
    sites = sites[(slice(None), *core)] - np.reshape(pads, (-1, *[1] * len(pads))).astype(sites.dtype)
    farthest, cell = farthest_site(sites, sizes)
    ends = [
        min(i, n - 1 - i) * s
        for i, n, s, around in zip(cell, padded, sizes, closed, strict=True) if not around
    ]  # fmt: skip
    edge = min(ends, default=math.inf)
    return Ball(
        value=max(farthest - error / 3.0, 0.0),
        error=error,
        clipped=bool(edge <= farthest * (1.0 + 1e-9)),
        centre=np.array(
            [axis[i if around else i - 1] for axis, i, around in zip(basins.grid.axes, cell, closed, strict=True)]
        ),
    )


def minimal_fatal_perturbation(
    basins: Labelled,
    name: str,
    *,
    weights: Mapping[str, float] | None = None,
    centre: ArrayLike | None = None,
) -> FatalPerturbation:
    """Return the smallest known perturbation that takes a motion from an attractor out of its basin.

    It leads from the attractor to the nearest centre of a cell with another label. The cell's label is that of its
    centre, so that the perturbation is fatal. Where the boundary is flat across a cell, the smallest fatal perturbation
    is at most a cell's diagonal shorter.

    Parameters
    ----------
    basins, name, weights, centre
        As for `local_integrity`.

    Returns
    -------
    FatalPerturbation

    Raises
    ------
    InputError
        As `local_integrity`.

    References
    ----------
    V. V. Klinshov, V. I. Nekorkin, J. Kurths, Stability threshold approach for complex dynamical systems, New J. Phys.
    18 (2016) 013004; L. Halekotte, U. Feudel, Minimal fatal shocks in multistable complex networks, Sci. Rep. 10 (2020)
    11783.

    Examples
    --------
    >>> from saltus.basins.map.basins import Basins
    >>> x = np.linspace(-0.995, 0.995, 200)
    >>> right = np.repeat((x > 0.25)[:, None], 200, axis=1)
    >>> halves = Basins.from_array(right, {"x": x, "y": x}, {"a": 0, "b": 1}, {"a": [[-0.005, 0.005]]})
    >>> found = minimal_fatal_perturbation(halves, "a")
    >>> found.vector.round(3).tolist(), found.outcome
    ([0.26, 0.0], 'b')
    """
    label, scale = label_of(basins, name), weights_of(basins.grid, weights)
    start, off = start_of(basins, name, centre)
    length, target, reached = nearest_outside(basins, label, start, scale, 0.0)
    return FatalPerturbation(
        value=length,
        error=min(2.0 * half_diagonal(basins.grid, scale), length),
        clipped=room_about(basins, start, scale) < length,
        centre=start,
        vector=np.where(closed_axes(basins), wrapped(target - start, np.arange(start.size)), target - start),
        outcome=outcome_of(basins, reached) if math.isfinite(length) else "",
        off_section=off,
        note=own_cell(basins, label, start),
    )
