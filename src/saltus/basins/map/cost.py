"""What a grid will cost: measured on cells that are spread over it, before anything is computed for good."""

from __future__ import annotations

import time
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.basins.map.grid import Grid, Plane
from saltus.basins.map.labelling import TOLERANCE, Labelling, checked_engine, checked_interval
from saltus.basins.map.mapping import attractors_for, with_traps
from saltus.ensemble.traps import Traps
from saltus.system import HybridSystem

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Cost", "estimate_cost"]

_RUN = 64
"""Cells in a row, along the last coordinate, that are taken together."""

_FIRST, _FACTOR = 2**12, 4
"""Cells of the first sample, and how many times more each that follows has."""

_SEED = 20230718


@dataclass(frozen=True)
class Cost:
    """What a grid will cost.

    Attributes
    ----------
    cells : int
        Cells of the grid.
    sampled : int
        Cells that were measured.
    orbits_per_second : float
        Motions that were followed a second, by all threads of this machine or its device.
    bytes_per_cell : float
        Of a compressed store, about: in more than one dimension a store takes less.
    search_seconds : float
        How long the search for attractors took, which the run makes again on one machine; 0 where they were given.
    """

    cells: int
    sampled: int
    orbits_per_second: float
    bytes_per_cell: float
    search_seconds: float = 0.0

    def seconds(self, workers: int = 1) -> float:
        """Return how long it takes in all on a number of machines like this one, of which one looks for attractors."""
        return self.search_seconds + self.cells / (self.orbits_per_second * workers)

    @property
    def size(self) -> float:
        """Bytes of the store, about."""
        return self.cells * self.bytes_per_cell


def estimate_cost(
    system: HybridSystem,
    parameters: Mapping[str, float] | None,
    grid: Mapping[str, Any] | Plane | Grid,
    attractors: Any = None,
    *,
    engine: str = "cpu",
    longest: int | None = None,
    tolerance: float = TOLERANCE,
    interval: float | None = None,
    seconds: float = 3.0,
) -> Cost:
    """Return what a grid will cost, from the time that a sample of its cells takes.

    The sample is runs of cells, spread at random over the whole grid. It grows until it takes as long as is asked for:
    the last and largest is what counts, so that neither compiling nor an idle device spoils it.

    Parameters
    ----------
    system, parameters, grid, attractors, longest, tolerance, interval
        As `map_basins` takes them.
    engine : {"cpu", "cuda", "dask"}, optional
        What is measured: a graphics card, or else the processors of this machine, as one worker of a cluster.
    seconds : float, optional
        How long the largest sample takes at least, if the grid has as many cells.

    Raises
    ------
    InputError
        As `map_basins` does.

    Examples
    --------
    >>> Cost(cells=10**9, sampled=10**5, orbits_per_second=1e5, bytes_per_cell=0.1).seconds(workers=10)
    1000.0
    """
    checks.instance("system", system, HybridSystem)
    cells = grid if isinstance(grid, Grid) else Grid(system.states, grid)
    settings = Labelling(
        system, system.resolve(parameters), Traps(len(system.states)), checked_interval(interval),
        checks.between("tolerance", tolerance, 1e-14, 1e-2),
        0 if longest is None else checks.count("longest", longest), checked_engine(engine),
    )  # fmt: skip
    begin = time.perf_counter()
    found, asked = attractors_for(settings, cells, attractors)
    search_seconds = time.perf_counter() - begin if asked else 0.0
    labelling, _ = with_traps(settings, found, cells)
    rng = np.random.default_rng(_SEED)
    labelling.of(cells.points(slice(0, 1)))
    count = _FIRST
    while True:
        places = _sample(cells, count, rng)
        begin = time.perf_counter()
        labels = labelling.of(cells.at(places))
        took = time.perf_counter() - begin
        if took >= seconds or count >= cells.size:
            break
        count *= _FACTOR
    compressed = len(zlib.compress(labels.tobytes(), 6)) / labels.size
    return Cost(cells.size, labels.size, labels.size / took, min(compressed, 1.0), search_seconds)


def _sample(grid: Grid, count: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Return the indices, shape (cells, free), of runs of cells: as many as are asked for, or there are."""
    length = min(_RUN, grid.size)
    starts = np.sort(rng.integers(0, grid.size - length + 1, size=max(min(count, grid.size) // length, 1)))
    numbers = (starts[:, None] + np.arange(length)).ravel()
    return np.stack(np.unravel_index(numbers, grid.shape), axis=-1)
