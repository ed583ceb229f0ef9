"""A limit cycle is found, and its basin, whatever the interval between two looks is to its period."""

from __future__ import annotations

import math

import numpy as np
import pytest

from saltus import HybridSystem, find_attractors, map_basins
from saltus.basins.attractors.found import AttractorOptions
from selection import guarding

# looks a turn: whole numbers, ratios of small integers, next to such, and others
RATIOS = [
    1.0,
    2.0,
    3.0,
    1.5,
    7.0 / 3.0,
    55.0 / 12.0,
    2.0 * math.pi / 1.37,
    2.0 * math.pi,
    3.00007,
    1.0 / 3.0,
    43.0 / 7.0,
]
RATES = [1.0, 0.1]


def turning(rate):
    """Two cycles about the origin, of period 2 pi: r = 1 repels, r = 2 attracts, as the rest inside does."""
    growth = f"{rate!r}*(x**2 + y**2 - 1)*(4 - x**2 - y**2)"
    return HybridSystem.smooth({"x": f"x*{growth} - y", "y": f"y*{growth} + x"})


CASES = guarding(
    [(ratio, rate) for rate in RATES for ratio in RATIOS],
    (2.0 * math.pi / 1.37, 1.0),
    (3.0, 1.0),
    campaign=8,
    spread=True,
)


@pytest.mark.parametrize(("ratio", "rate"), CASES)
def test_a_cycle_beside_a_rest_is_found_at_any_interval(ratio, rate):
    options = AttractorOptions(interval=2.0 * math.pi / ratio, starts=32, samples=200)
    found = find_attractors(turning(rate), {}, {"x": (-3, 3), "y": (-3, 3)}, options=options)
    assert found.names == ("rest", "limit cycle")
    assert found.orbits["limit cycle"].period == pytest.approx(2.0 * math.pi, rel=1e-9)
    assert np.hypot(*found.points["limit cycle"].T) == pytest.approx(2.0, rel=1e-6)
    basins = map_basins(turning(rate), {}, {"x": (-3, 3, 20), "y": (-3, 3, 20)}, found)
    radii = np.hypot.outer(*basins.grid.axes)
    assert (np.asarray(basins.labels) == (radii > 1.0)).all()
