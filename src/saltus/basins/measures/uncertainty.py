"""Uncertainty exponent: docs/theory/integrity.md derives both estimators."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.basins.map.chunked_reading import BLOCK, blocks, checked_basins, read, surroundings
from saltus.basins.measures.distances import weights_of
from saltus.ensemble.traps import UNDECIDED
from saltus.errors import InputError
from saltus.result import frozen

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import ArrayLike, NDArray

    from saltus.basins.map.chunked_reading import Labelled

__all__ = ["UncertaintyExponent", "uncertainty_by_neighbours", "uncertainty_by_shifts"]

_FEWEST = 5  # changed labels of a scale that enters the fit, at least


@dataclass(frozen=True)
class UncertaintyExponent:
    """Uncertainty exponent, the slope of ``ln f`` against ``ln epsilon``, with its fit.

    Attributes
    ----------
    value : float
        The exponent, between 0 (no scale of errors helps) and 1 (a smooth boundary).
    error : float
        Standard error of the slope, from the scatter about the line. The two estimators may differ by more, about 0.1.
    estimator : str
        "neighbours" or "shifts".
    dimension : float
        Dimension of the boundary: the number of free coordinates less the exponent.
    scales : ndarray, shape (scale,)
        The errors epsilon: in cells for "neighbours", in the metric of the weights for "shifts".
    fractions : ndarray, shape (scale,)
        Share f of uncertain initial conditions at each scale.
    counts : ndarray of int, shape (scale,)
        Count of initial conditions at each scale.
    used : ndarray of bool, shape (scale,)
        Whether a scale entered the fit.
    """

    value: float
    error: float
    estimator: str
    dimension: float
    scales: NDArray[np.float64]
    fractions: NDArray[np.float64]
    counts: NDArray[np.int64]
    used: NDArray[np.bool_]

    def __post_init__(self) -> None:
        for name, kind in (("scales", float), ("fractions", float), ("counts", np.int64), ("used", np.bool_)):
            object.__setattr__(self, name, frozen(getattr(self, name), kind))


def uncertainty_by_neighbours(basins: Labelled, scales: Sequence[int] = (1, 2, 4, 8, 16)) -> UncertaintyExponent:
    """Return the uncertainty exponent by the neighbours on a grid.

    A cell is uncertain at k cells if one of the 2 D cells that lie k cells away along a coordinate has another label.
    Only cells with all these neighbours at the largest k count. The line through ``ln f`` against ``ln k`` is that of
    least squares, with equal weights of all scales.

    Parameters
    ----------
    basins : Basins
        A finished grid of any dimension; it is read block by block. Undecided cells differ from no label.
    scales : sequence of int, optional
        Distances in cells, at least three.

    Returns
    -------
    UncertaintyExponent

    Raises
    ------
    InputError
        Scales that are not distinct positive integers or do not fit into the grid. Cells that are not done. Fewer than
        three scales with uncertain cells.

    References
    ----------
    S. W. McDonald, C. Grebogi, E. Ott, J. A. Yorke, Fractal basin boundaries, Physica D 17 (1985) 125-153, who move
    points by +-epsilon along one coordinate.

    Examples
    --------
    A straight boundary has the exponent 1:

    >>> from saltus.basins.map.basins import Basins
    >>> x = np.linspace(-0.995, 0.995, 200)
    >>> right = np.repeat((x > 0.25)[:, None], 200, axis=1)
    >>> halves = Basins.from_array(right, {"x": x, "y": x}, {"a": 0, "b": 1})
    >>> print("%.2f" % uncertainty_by_neighbours(halves).value)
    1.00
    """
    labels = checked_basins(basins, "labels").labels
    shape = tuple(labels.shape)
    steps = _checked_steps(scales, min(shape))
    reach, uncertain, count = steps[-1], np.zeros(len(steps), np.int64), 0
    for block in blocks(labels, most=BLOCK // 4):
        wide = surroundings(block, shape, reach)
        core = tuple(
            slice(max(s.start, reach) - w.start, min(s.stop, n - reach) - w.start)
            for s, w, n in zip(block, wide, shape, strict=True)
        )
        if any(s.stop <= s.start for s in core):
            continue
        found = read(labels, wide)
        own = found[core]
        decided = own != UNDECIDED
        count += int(decided.sum())
        for i, step in enumerate(steps):
            uncertain[i] += int((_differs(found, core, step) & decided).sum())
    used = uncertain > 0
    _check_enough(used)
    fractions, counts = uncertain / max(count, 1), np.full(len(steps), count)
    slope, error = _line(np.log(np.array(steps)[used]), np.log(fractions[used]), np.ones(int(used.sum())))
    return UncertaintyExponent(
        slope, error, "neighbours", len(shape) - slope, np.array(steps, float), fractions, counts, used
    )


def uncertainty_by_shifts(
    basins: Any,
    scales: ArrayLike,
    samples: int = 2000,
    *,
    weights: Mapping[str, float] | None = None,
    rng: int | np.random.Generator = 0,
) -> UncertaintyExponent:
    """Return the uncertainty exponent by random shifts of random points, independent of the grid's resolution.

    At each scale epsilon, points are drawn uniformly in the window. Each is moved by a vector of length epsilon in a
    random direction along the free coordinates. f is the share of points whose label changes. The line through ``ln f``
    against ``ln epsilon`` has the weights of binomial fractions. Its standard error includes the scatter about the line
    where this exceeds the binomial one. Scales with fewer than 5 changes do not enter.

    Parameters
    ----------
    basins : Basins
        Basins, which classify points.
    scales : array_like, shape (scale,)
        The lengths epsilon, at least three.
    samples : int, optional
        Points at each scale; twice as many are followed.
    weights : mapping of str to float, optional
        Lengths by which the coordinates are divided, for each free coordinate, see `saltus.basins.measures.integrity`.
    rng : int or numpy.random.Generator, optional
        What random numbers are drawn from, or its seed.

    Returns
    -------
    UncertaintyExponent

    Raises
    ------
    InputError
        Scales that are not distinct and positive, a weight that cannot be used, or no sample. Fewer than three scales
        at which 5 labels changed.

    References
    ----------
    S. W. McDonald, C. Grebogi, E. Ott, J. A. Yorke, Fractal basin boundaries, Physica D 17 (1985) 125-153.

    Examples
    --------
    Whatever classifies points over a grid will do; here a half plane:

    >>> from types import SimpleNamespace
    >>> from saltus.basins.map.grid import Grid
    >>> half = SimpleNamespace(
    ...     grid=Grid(("x", "y"), {"x": (-1, 1, 10), "y": (-1, 1, 10)}),
    ...     classify=lambda points: (points[:, 0] > 0.2).astype(np.uint8),
    ... )
    >>> found = uncertainty_by_shifts(half, [0.01, 0.03, 0.1], samples=4000)
    >>> abs(found.value - 1.0) < 3.0 * found.error
    True
    """
    grid = checked_basins(basins, "grid", "classify").grid
    lengths, scale = _checked_lengths(scales), weights_of(grid, weights)
    samples = checks.size("samples", samples)
    random = checks.generator("rng", rng)
    ends = np.array([(low, high) for low, high, _ in grid.ranges])
    changed, counts = np.zeros(lengths.size, np.int64), np.zeros(lengths.size, np.int64)
    for i, length in enumerate(lengths):
        here = random.uniform(ends[:, 0], ends[:, 1], (samples, len(ends)))
        direction = random.standard_normal(here.shape)
        there = here + length * scale * direction / np.linalg.norm(direction, axis=1, keepdims=True)
        both = np.asarray(basins.classify(grid.origin + np.concatenate([here, there]) @ grid.vectors))
        own, other = both[:samples], both[samples:]
        decided = (own != UNDECIDED) & (other != UNDECIDED)
        counts[i], changed[i] = int(decided.sum()), int((decided & (own != other)).sum())
    used = (changed >= _FEWEST) & (changed < counts)
    _check_enough(used)
    fractions = changed / np.maximum(counts, 1)
    precision = changed[used] / (1.0 - fractions[used])
    slope, error = _line(np.log(lengths[used]), np.log(fractions[used]), precision)
    least = 1.0 / math.sqrt(float((precision * (np.log(lengths[used]) - _mean(lengths[used], precision)) ** 2).sum()))
    return UncertaintyExponent(slope, max(error, least), "shifts", len(ends) - slope, lengths, fractions, counts, used)


def _differs(labels: NDArray[np.uint8], core: tuple[slice, ...], step: int) -> NDArray[np.bool_]:
    """Return which cells of `core` have another label `step` cells away along a coordinate."""
    own = labels[core]
    differs = np.zeros(own.shape, np.bool_)
    for axis, s in enumerate(core):
        for shift in (-step, step):
            other = labels[(*core[:axis], slice(s.start + shift, s.stop + shift), *core[axis + 1 :])]
            differs |= (other != own) & (other != UNDECIDED)
    return differs


def _mean(lengths: NDArray[np.float64], precision: NDArray[np.float64]) -> float:
    return float(np.average(np.log(lengths), weights=precision))


def _line(x: NDArray[np.float64], y: NDArray[np.float64], weights: NDArray[np.float64]) -> tuple[float, float]:
    """Return the slope of the line of weighted least squares, and its standard error from the scatter."""
    dx, dy = x - np.average(x, weights=weights), y - np.average(y, weights=weights)
    spread = float((weights * dx**2).sum())
    slope = float((weights * dx * dy).sum()) / spread
    scatter = float((weights * (dy - slope * dx) ** 2).sum()) / (x.size - 2)
    return slope, math.sqrt(scatter / spread)


def _check_enough(used: NDArray[np.bool_]) -> None:
    if used.sum() < 3:
        raise InputError(
            "scales", f"{int(used.sum())} with uncertain initial conditions", "three or more", "the basins have "
            "hardly a boundary there: take larger scales or more samples",
        )  # fmt: skip


def _checked_steps(scales: Sequence[int], shortest: int) -> list[int]:
    allowed = "at least three distinct positive integers"
    given = [checks.count(f"scales[{i}]", step) for i, step in enumerate(checks.listed("scales", scales, allowed))]
    steps = sorted(set(given))
    if len(steps) < 3 or len(steps) != len(given):
        raise InputError("scales", scales, allowed)
    if 2 * steps[-1] >= shortest:
        raise InputError("scales", scales, f"less than half of {shortest}, the cells on the shortest axis")
    return steps


def _checked_lengths(scales: ArrayLike) -> NDArray[np.float64]:
    lengths = np.sort(checks.array("scales", scales).ravel())
    if lengths.size < 3 or lengths[0] <= 0.0 or (np.diff(lengths) == 0.0).any():
        raise InputError("scales", scales, "at least three distinct positive lengths")
    return lengths
