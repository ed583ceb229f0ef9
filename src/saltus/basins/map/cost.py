"""Cost of a grid, measured on a sample of its cells before the run."""

from __future__ import annotations

import time
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.basins.map.grid import Grid, Plane
from saltus.basins.map.mapping import attractors_for, settings_of, with_traps
from saltus.basins.map.options import BasinOptions
from saltus.system import HybridSystem, Map

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Cost", "estimate_cost"]

_RUN = 64  # cells in a row, along the last coordinate, that are sampled together

_FIRST = 2**12  # cells of the first sample
_FACTOR = 4  # ratio of the cells of two samples in a row

_SEED = 20230718  # seed of the random cells


@dataclass(frozen=True)
class Cost:
    """Time and storage of a grid."""

    cells: int  # cells of the grid
    sampled: int  # cells of the sample
    orbits_per_second: float  # motions followed a second, by all threads of this machine or by its device
    bytes_per_cell: float  # bytes of a compressed store, about; in more than one dimension a store takes less
    # time of the search for attractors, which the run repeats on one machine; 0 for given attractors
    search_seconds: float = 0.0

    def seconds(self, workers: int = 1) -> float:
        """Return the whole time on a number of machines like this one; one of them searches for attractors."""
        return self.search_seconds + self.cells / (self.orbits_per_second * workers)

    @property
    def size(self) -> float:
        """Estimated bytes of the store."""
        return self.cells * self.bytes_per_cell


def estimate_cost(
    system: HybridSystem | Map,
    parameters: Mapping[str, float] | None,
    grid: Mapping[str, Any] | Plane | Grid,
    attractors: Any = None,
    *,
    options: BasinOptions | None = None,
    seconds: float = 3.0,
) -> Cost:
    """Return the cost of a grid, from the time that a sample of its cells takes.

    The sample is runs of cells, spread at random over the whole grid. It grows until it takes `seconds`. Only the last
    and largest sample counts, so that compiling and an idle device have no effect.

    Parameters
    ----------
    system, parameters, grid, attractors, options
        As `map_basins` takes them. For a cluster, this machine's processors are measured as one worker.
    seconds : float, optional
        Least time of the largest sample, if the grid has enough cells.

    Raises
    ------
    InputError
        As `map_basins` does.

    Examples
    --------
    >>> Cost(cells=10**9, sampled=10**5, orbits_per_second=1e5, bytes_per_cell=0.1).seconds(workers=10)
    1000.0
    """
    settings = settings_of(system, parameters, options)
    cells = grid if isinstance(grid, Grid) else Grid(system.states, grid)
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
    """Return the indices, shape (cells, free), of runs of cells, at most all cells of the grid."""
    length = min(_RUN, grid.size)
    starts = np.sort(rng.integers(0, grid.size - length + 1, size=max(min(count, grid.size) // length, 1)))
    numbers = (starts[:, None] + np.arange(length)).ravel()
    return np.stack(np.unravel_index(numbers, grid.shape), axis=-1)
