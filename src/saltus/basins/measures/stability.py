"""Basin stability: the share of random initial conditions that go to an attractor."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.basins.map.chunked_reading import checked_basins, label_of
from saltus.basins.wilson import checked_confidence, wilson
from saltus.ensemble.traps import UNDECIDED

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.basins.map.grid import Grid

__all__ = ["Stability", "basin_stability"]

_BATCH = 2**16  # points that are classified at once


@dataclass(frozen=True)
class Stability:
    """Basin stability from samples.

    Attributes
    ----------
    value : float
        Share of the samples that go to the attractor.
    low, high : float
        Ends of its confidence interval, see `saltus.basins.wilson.wilson`.
    confidence : float
        Confidence of the interval.
    hits, undecided, samples : int
        Counts of samples that go to the attractor, of undecided samples (no hits), and of all samples.
    """

    value: float
    low: float
    high: float
    confidence: float
    hits: int
    undecided: int
    samples: int


def basin_stability(
    basins: Any,
    name: str,
    samples: int = 1000,
    *,
    region: Mapping[str, tuple[float, float]] | None = None,
    rng: int | np.random.Generator = 0,
    confidence: float = 0.95,
    engine: str | None = None,
) -> Stability:
    """Return basin stability: the probability that a random initial condition goes to an attractor.

    Points are drawn uniformly, and followed one by one; of the grid only the coordinates matter. For another density,
    draw points from it, label them by `Basins.classify`, and pass the counts to `wilson`.

    Parameters
    ----------
    basins : Basins
        Basins, which classify points.
    name : str
        The attractor.
    samples : int, optional
        Count of points.
    region : mapping of str to (float, float), optional
        Ranges of free coordinates from which points are drawn; by default those of the grid.
    rng : int or numpy.random.Generator, optional
        What random numbers are drawn from, or its seed.
    confidence : float, optional
        Of the interval.
    engine : {"cpu", "cuda"}, optional
        As `Basins.classify` takes it.

    Returns
    -------
    Stability

    Raises
    ------
    InputError
        An unknown name or coordinate, a range turned round, no sample.

    References
    ----------
    P. J. Menck, J. Heitzig, N. Marwan, J. Kurths, How basin stability complements the linear-stability paradigm, Nat.
    Phys. 9 (2013) 89-92.

    Examples
    --------
    Whatever classifies points over a grid will do; here a disc of radius 0.6 in a square of edge 2:

    >>> from types import SimpleNamespace
    >>> from saltus.basins.map.outcomes import Outcomes
    >>> from saltus.basins.map.grid import Grid
    >>> disc = SimpleNamespace(
    ...     grid=Grid(("x", "y"), {"x": (-1, 1, 10), "y": (-1, 1, 10)}),
    ...     attractors=Outcomes({"a": 0, "b": 1}),
    ...     classify=lambda points: (np.hypot(*points.T) > 0.6).astype(np.uint8),
    ... )
    >>> found = basin_stability(disc, "a", 10_000)
    >>> found.low < 0.09 * np.pi < found.high
    True
    """
    label, grid = label_of(checked_basins(basins, "classify"), name), basins.grid
    confidence = checked_confidence(confidence)
    samples = checks.count("samples", samples)
    ranges = _ranges(grid, region)
    random = checks.generator("rng", rng)
    options = {} if engine is None else {"engine": checks.chosen("engine", engine, ("cpu", "cuda"))}
    hits = undecided = 0
    for first in range(0, samples, _BATCH):
        count = min(_BATCH, samples - first)
        drawn = random.uniform(ranges[:, 0], ranges[:, 1], (count, len(ranges)))
        found = np.asarray(basins.classify(grid.origin + drawn @ grid.vectors, **options))
        hits += int((found == label).sum())
        undecided += int((found == UNDECIDED).sum())
    low, high = wilson(hits, samples, confidence)
    return Stability(hits / samples, low, high, confidence, hits, undecided, samples)


def _ranges(grid: Grid, region: Mapping[str, tuple[float, float]] | None) -> NDArray[np.float64]:
    """Return the ranges from which points are drawn, shape (free coordinates, 2)."""
    ranges = {name: (low, high) for name, (low, high, _) in zip(grid.names, grid.ranges, strict=True)}
    for name, ends in checks.mapping("region", region, "free coordinates to intervals", known=grid.names).items():
        ranges[name] = checks.interval(f"region[{name!r}]", ends, finite=True)
    return np.array([ranges[name] for name in grid.names])
