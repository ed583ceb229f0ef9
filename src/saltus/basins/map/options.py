"""Options of a map of basins: engine, accuracy, and how long motions are followed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from saltus import checks
from saltus.basins.map.labelling import TOLERANCE
from saltus.errors import InputError

__all__ = ["TOLERANCES", "BasinOptions"]

TOLERANCES = (1e-14, 1e-2)  # smallest and largest tolerance of a step

_ENGINES = ("cpu", "cuda", "dask")  # what may compute


@dataclass(frozen=True, kw_only=True)
class BasinOptions:
    """Options with which `map_basins` labels the cells of a grid.

    Parameters
    ----------
    engine : {"cpu", "cuda", "dask"}
        This machine's processors, its graphics cards, or the workers of a Dask cluster.
    client : dask.distributed.Client or str, optional
        The cluster, or the address of its scheduler, for ``engine="dask"``.
    longest : int, optional
        Periods after which a motion that is in no trapping region is undecided. The default is four times the larger of
        two numbers, at least 200, and 100 000 where that is above 4 000 000. The first is the periods of the slowest
        decay from the farthest corner of the grid into a trapping region, by the largest multiplier. The second is the
        periods of the slowest motion of the search.
    tolerance : float
        Tolerance of a step, in the unit nearest to a state's size, a power of 1000: 1 for sizes from 0.032 to 32.
    preview : bool
        Whether the grid is refined from every fourth cell along each coordinate. Each refinement halves the distance,
        and follows only motions next to cells of different labels. All other cells take the label that surrounds them.
        It follows 12 per cent of the motions, and up to 60 on coarse grids in four dimensions. Where basins are
        fractal, 0.5 to 2 per cent of the labels are wrong.
    limit : float, optional
        Size beyond which a state that grows has diverged; by default that of the search for the attractors, see
        `AttractorOptions`.
    interval : float, optional
        Time between two strobes of a system without a phase, for the search for attractors. Given or stored attractors
        have their own interval.

    Raises
    ------
    InputError
        An option that no map can have, or a client for an engine other than ``"dask"``.

    Examples
    --------
    >>> BasinOptions(longest=500, preview=True).engine
    'cpu'
    """

    engine: str = "cpu"
    client: Any = None
    longest: int | None = None
    tolerance: float = TOLERANCE
    preview: bool = False
    limit: float | None = None
    interval: float | None = None

    def __post_init__(self) -> None:
        checks.chosen("BasinOptions.engine", self.engine, _ENGINES)
        if (self.client is not None) != (self.engine == "dask"):
            raise InputError("BasinOptions.client", self.client, "given for engine='dask', and for no other")
        if self.longest is not None:
            object.__setattr__(self, "longest", checks.count("BasinOptions.longest", self.longest))
        tolerance = checks.between("BasinOptions.tolerance", self.tolerance, *TOLERANCES)
        object.__setattr__(self, "tolerance", tolerance)
        object.__setattr__(self, "preview", checks.flag("BasinOptions.preview", self.preview))
        if self.limit is not None:
            object.__setattr__(self, "limit", checks.positive("BasinOptions.limit", self.limit))
        if self.interval is not None:
            object.__setattr__(self, "interval", checks.positive("BasinOptions.interval", self.interval))
