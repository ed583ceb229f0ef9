"""What a grid will cost: the sample is spread over the grid, and the figures follow from it."""

from __future__ import annotations

import numpy as np
import pytest

from saltus.basins import AttractorOptions, Grid
from saltus.basins.map.cost import Cost, _sample, estimate_cost
from saltus.basins.map.labelling import Labelling
from saltus.errors import InputError
from saltus.options import BasinOptions
from wells import BOX


def test_the_sample_reaches_every_part_of_the_grid():
    grid = Grid(("a", "b", "c"), {"a": (0, 1, 30), "b": (0, 1, 20), "c": (0, 1, 70)})
    cells = _sample(grid, 4096, np.random.default_rng(0))
    assert cells.shape == (4096, 3)
    assert (cells >= 0).all()
    assert (cells < grid.shape).all()
    halves = {tuple(part) for part in (cells >= np.array(grid.shape) // 2).tolist()}
    assert len(halves) == 8


def test_the_sample_of_a_small_grid_is_no_larger_than_it():
    assert len(_sample(Grid(("a",), {"a": (0, 1, 5)}), 4096, np.random.default_rng(0))) == 5


def test_cost_follows_from_the_sample(well, both):
    cost = estimate_cost(well, {}, BOX, both, seconds=0.0)
    assert cost.cells == 600
    assert 64 <= cost.sampled <= 600
    assert cost.orbits_per_second > 0.0
    assert 0.0 < cost.bytes_per_cell < 1.0
    assert cost.size == cost.cells * cost.bytes_per_cell


def test_cost_is_told_with_attractors_that_are_looked_for(well):
    cost = estimate_cost(well, {}, BOX, {"options": AttractorOptions(starts=12, samples=200)}, seconds=0.0)
    assert cost.cells == 600
    with pytest.raises(InputError, match="attractors = 'sedes': must be arguments among"):
        estimate_cost(well, {}, BOX, {"sedes": 12})


def test_the_sample_grows_until_it_takes_long_enough(well, both, monkeypatch):
    counts = []
    monkeypatch.setattr(
        Labelling, "of", lambda self, points: counts.append(len(points)) or np.zeros(len(points), np.uint8)
    )
    clock = iter(range(1000))
    monkeypatch.setattr("time.perf_counter", lambda: next(clock) * 1.0 + 5.0 * (len(counts) >= 4))
    cost = estimate_cost(well, {}, {"x": (-2, 2, 1000), "v": (-2, 2, 1000)}, both, seconds=3.0)
    assert counts == [1, 4096, 16384, 65536]
    assert cost.sampled == 65536
    assert cost.orbits_per_second == 65536 / 6.0


def test_workers_share_the_time():
    cost = Cost(cells=10**9, sampled=10**5, orbits_per_second=1e5, bytes_per_cell=0.1)
    assert [cost.seconds(n) for n in (1, 10)] == [1e4, 1e3]


def test_an_engine_that_is_none_is_told(well, both):
    with pytest.raises(InputError, match="engine = 'gpu': must be one of"):
        estimate_cost(well, {}, BOX, both, options=BasinOptions(engine="gpu"))
