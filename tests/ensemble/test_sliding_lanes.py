"""Motions that slide, in lanes, against one motion at a time."""

import numpy as np
import pytest

import saltus


@pytest.fixture(scope="module")
def wells():
    """Return an oscillator with two wells and dry friction."""
    return saltus.filippov(
        ("x", "v"), {"F": 0.05, "A": 0.15, "w": 1.0, "c": 0.05}, surface="v",
        above={"x": "v", "v": "x - x**3 - c*v - F + A*cos(theta)"},
        below={"x": "v", "v": "x - x**3 - c*v + F + A*cos(theta)"}, phase=("theta", "w"), name="wells",
    )  # fmt: skip


@pytest.mark.campaign
def test_basins_of_motions_that_slide_are_those_of_single_motions(wells):
    attractors = saltus.find_attractors(wells, {}, {"x": (-1.5, 1.5), "v": (-1.0, 1.0)})
    basins = saltus.map_basins(wells, {}, {"x": (-1.5, 1.5, 40), "v": (-1.0, 1.0, 41)}, attractors)
    data = basins.to_xarray()
    rng = np.random.default_rng(1)
    slid, sides = 0, {0: set(), 1: set()}
    for i, j in zip(rng.integers(40, size=25).tolist(), rng.integers(41, size=25).tolist(), strict=True):
        motion = saltus.simulate(wells, {}, [float(data["x"][i]), float(data["v"][j])], periods=60)
        slid += "sliding" in motion.events["mode_after"]
        sides[int(data["labels"][i, j])].add(bool(motion.x_end[0] > 0.0))
    assert slid > 5
    assert sorted(map(tuple, sides.values())) == [(False,), (True,)]
