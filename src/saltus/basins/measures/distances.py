"""Distances of a point from other labels and from the window's edge, in weighted coordinates."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from saltus import checks
from saltus.basins.map.chunked_reading import blocks, outcome_of, read
from saltus.ensemble.traps import NOT_DONE
from saltus.errors import InputError
from saltus.system.angles import TURN

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from saltus.basins.map.chunked_reading import Labelled
    from saltus.basins.map.grid import Grid

__all__ = [
    "closed_axes",
    "farthest_site",
    "half_diagonal",
    "nearest_outside",
    "own_cell",
    "room_about",
    "start_of",
    "weights_of",
]

_NEAR = 2**20  # cells that are searched together, from the attractor outwards


def weights_of(grid: Grid, weights: Mapping[str, float] | None) -> NDArray[np.float64]:
    """Return the weight of each free coordinate, shape (free coordinates,).

    Raises
    ------
    InputError
        An unknown coordinate, one without a weight, or a weight that is not positive.
    """
    if weights is None:
        return np.ones(len(grid.names))
    given = checks.mapping("weights", weights, "free coordinates to lengths", known=grid.names)
    if missing := [free for free in grid.names if free not in given]:
        raise InputError("weights", given, "given for every free coordinate", f"add {missing[0]!r}")
    return np.array([checks.positive(f"weights[{free!r}]", given[free]) for free in grid.names])


def closed_axes(basins: Labelled) -> NDArray[np.bool_]:
    """Return which free coordinates close on themselves, shape (free coordinates,): angles over a whole turn.

    A turn that is missed by less than half a cell is one: distances have errors as large.
    """
    grid, places = basins.grid, getattr(getattr(basins.attractors, "system", None), "angle_places", ())
    whole = [abs(high - low - TURN) < 0.5 * (high - low) / count for low, high, count in grid.ranges]
    units = [np.flatnonzero(vector) for vector in grid.vectors]
    angle = [
        unit.size == 1 and unit[0] in places and vector[unit[0]] == 1.0
        for unit, vector in zip(units, grid.vectors, strict=True)
    ]
    return np.asarray(np.array(whole) & np.array(angle))


def start_of(basins: Labelled, name: str, centre: ArrayLike | None) -> tuple[NDArray[np.float64], float]:
    """Return the centre in the free coordinates, and the distance of the attractor's point from the grid's plane."""
    grid, off = basins.grid, 0.0
    if centre is not None:
        allowed = f"a number for each of {', '.join(grid.names)}"
        start = checks.array("centre", centre, allowed)
        if start.shape != (len(grid.names),):
            raise InputError("centre", centre, allowed)
    else:
        if not np.size(basins.attractors.points.get(name, ())):
            raise InputError("name", name, "an attractor whose points are known", "or give the centre of the ball")
        point = np.atleast_2d(basins.attractors.points[name])[0]
        start = np.linalg.lstsq(grid.vectors.T, point - grid.origin, rcond=None)[0]
        off = float(np.linalg.norm(point - grid.origin - start @ grid.vectors))
        off = off if off > 1e-12 * float(np.abs(point).max()) else 0.0
    closed = closed_axes(basins)
    for k, (free, (low, high, _)) in enumerate(zip(grid.names, grid.ranges, strict=True)):
        if closed[k]:
            start[k] = low + (start[k] - low) % TURN
        inside = grid.clipped(free, float(start[k]))
        if inside is None:
            where = f"centre's {free}" if centre is not None else f"{free} of {name!r}"
            raise InputError(where, float(start[k]), f"within the window, from {low:g} to {high:g}", "map a larger one")
        start[k] = inside
    return start, off


def nearest_outside(
    basins: Labelled, label: int, start: NDArray[np.float64], scale: NDArray[np.float64], half: float
) -> tuple[float, NDArray[np.float64], int]:
    """Return distance, centre and label of the nearest cell with another label; infinite and NaN without one.

    With `half` = 0 it is the distance of the cell's centre, with `half` = 1/2 that of the cell's nearest point. Blocks
    are read in the order of their distance, until the next is further than the nearest cell so far.
    """
    grid, labels = basins.grid, basins.labels
    ways = [np.abs(axis - x) for axis, x in zip(grid.axes, start, strict=True)]
    ways = [
        np.minimum(way, np.abs(TURN - way)) if closed else way
        for way, closed in zip(ways, closed_axes(basins), strict=True)
    ]
    gaps = [
        (np.maximum(way - half * size, 0.0) / w) ** 2 for way, size, w in zip(ways, grid.spacing, scale, strict=True)
    ]
    bounded = [
        (sum(float(gap[s].min()) for gap, s in zip(gaps, block, strict=True)), block)
        for block in blocks(labels, most=_NEAR)
    ]
    best, target, reached = math.inf, np.full(len(gaps), np.nan), NOT_DONE
    for bound, block in sorted(bounded, key=lambda pair: pair[0]):
        if bound >= best:
            break
        part = tuple(_nearer(gap, s, best - bound) for gap, s in zip(gaps, block, strict=True))
        found = read(labels, part)
        outside = found != label
        if not outside.any():
            continue
        squares = np.zeros(found.shape)
        for k, (gap, s) in enumerate(zip(gaps, part, strict=True)):
            squares += gap[s].reshape([-1 if i == k else 1 for i in range(len(gaps))])
        squares[~outside] = math.inf
        place = np.unravel_index(int(squares.argmin()), squares.shape)
        if squares[place] < best:
            best, reached = float(squares[place]), int(found[place])
            target = np.array([axis[s.start + i] for axis, s, i in zip(grid.axes, part, place, strict=True)])
    return math.sqrt(best), target, reached


def _nearer(gap: NDArray[np.float64], part: slice, room: float) -> slice:
    """Return the cells of a slice whose gap exceeds the least one there by no more than `room`."""
    within = np.flatnonzero(gap[part] <= gap[part].min() + room)
    return slice(part.start + int(within[0]), part.start + int(within[-1]) + 1)


def farthest_site(sites: NDArray[np.int32], sizes: NDArray[np.float64]) -> tuple[float, tuple[int, ...]]:
    """Return the largest distance of a cell from its site, and the cell; layer by layer, to save memory."""
    best, cell = -1.0, (0,) * len(sizes)
    shape = sites.shape[1:]
    for layer in range(shape[0]):
        squares = ((sites[0, layer] - layer) * sizes[0]) ** 2
        for k in range(1, len(sizes)):
            own = np.arange(shape[k]).reshape([-1 if i == k else 1 for i in range(1, len(sizes))])
            squares = squares + ((sites[k, layer] - own) * sizes[k]) ** 2
        if (most := float(squares.max())) > best:
            place = np.unravel_index(int(squares.argmax()), shape[1:])
            best, cell = most, (layer, *map(int, place))
    return math.sqrt(best), cell


def half_diagonal(grid: Grid, scale: NDArray[np.float64]) -> float:
    """Return half the diagonal of a cell, in units of the scale."""
    return 0.5 * float(np.linalg.norm(np.asarray(grid.spacing) / scale))


def room_about(basins: Labelled, start: NDArray[np.float64], scale: NDArray[np.float64]) -> float:
    """Return the distance of a point from the window's edge; infinite where all coordinates close on themselves."""
    ends = np.array([(low, high) for low, high, _ in basins.grid.ranges])
    rooms = np.abs(ends - start[:, None]).min(axis=1) / scale
    return float(rooms[~closed_axes(basins)].min(initial=math.inf))


def own_cell(basins: Labelled, label: int, start: NDArray[np.float64]) -> str:
    """Return a note where the cell around a point has another label, else an empty text."""
    cell = basins.grid.nearest(dict(zip(basins.grid.names, start.tolist(), strict=True)))
    own = int(read(basins.labels, tuple(slice(i, i + 1) for i in cell.values())).item())
    return "" if own == label else f"the centre's own cell is labelled {outcome_of(basins, own)!r}"
