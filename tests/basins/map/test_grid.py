"""Cells and their centres."""

import math
import pickle

import numpy as np
import pytest

from saltus import InputError
from saltus.basins import Grid, Plane

STATES = ("q1", "q2", "v1", "v2")
BOX = {"q1": (-5, 5, 8), "v1": (-1, 3, 4), "q2": -0.5, "v2": 0.25}


def test_a_label_belongs_to_the_middle_of_its_cell():
    grid = Grid(STATES, BOX)
    assert grid.axes[1].tolist() == [-0.5, 0.5, 1.5, 2.5]
    assert grid.spacing == (1.25, 1.0)
    assert grid.points((slice(7, 8), slice(0, 1))).tolist() == [[4.375, -0.5, -0.5, 0.25]]


def test_free_coordinates_keep_the_order_in_which_they_are_given():
    turned = Grid(STATES, {"v1": BOX["v1"], "q2": 0.0, "q1": BOX["q1"], "v2": 0.0})
    assert turned.names == ("v1", "q1")
    assert turned.shape == (4, 8)
    assert turned.points()[:, 0].tolist()[:8] == Grid(STATES, BOX).axes[0].tolist()


def test_ranges_of_cells_and_slices_give_the_same_points():
    grid = Grid(STATES, {**BOX, "q2": (0, 1, 3)})
    assert np.array_equal(grid.points(slice(0, 96)), grid.points())
    assert np.array_equal(grid.points(slice(17, 40)), grid.points()[17:40])
    boxed = grid.points((slice(1, 3), slice(0, 4), slice(2, 3))).reshape(2, 4, 4)
    assert np.array_equal(boxed, grid.points().reshape(8, 4, 3, 4)[1:3, :, 2])


def test_a_section_takes_the_cells_of_the_nearest_centres():
    grid = Grid(STATES, {"q1": (-5, 5, 400), "q2": (-5, 5, 400), "v1": 0.0, "v2": 0.0})
    cut = grid.section(grid.nearest({"q2": 0.11}))
    assert cut.names == ("q1",)
    assert math.isclose(cut.fixed["q2"], 0.1125)
    assert np.array_equal(cut.points(), grid.points((slice(None), slice(204, 205))))


def test_every_value_of_a_range_has_its_nearest_centre():
    grid = Grid(("x",), {"x": (-0.3, 0.7, 13)})
    for value in np.linspace(-0.3, 0.7, 101):
        index = grid.nearest({"x": value})["x"]
        assert abs(grid.axes[0][index] - value) <= np.abs(grid.axes[0] - value).min() + 1e-15


def test_an_oblique_plane_holds_its_origin_plus_its_vectors():
    plane = Plane(
        {"q1": 1.0, "q2": 2.0, "v1": 3.0, "v2": 4.0}, {"q1": 0.6, "v1": 0.8}, {"q2": 1.0, "q1": 1.0},
        ((-1, 1), (0, 4)), (2, 4), ("a", "b"),
    )  # fmt: skip
    grid = Grid(STATES, plane)
    assert (grid.names, grid.shape, dict(grid.fixed)) == (("a", "b"), (2, 4), {"v2": 4.0})
    assert np.allclose(grid.points((slice(1, 2), slice(3, 4))), [[4.8, 5.5, 3.4, 4.0]], atol=1e-15)
    line = grid.section(grid.nearest({"b": 3.5}))
    assert np.allclose(line.points(), grid.points((slice(None), slice(3, 4))), atol=1e-15)


def test_the_box_of_a_grid_holds_all_its_points():
    plane = Plane(dict.fromkeys(STATES, 0.5), {"q1": -1.0, "v1": 2.0}, {"q1": 1.0}, ((0, 1), (0, 1)), (50, 50))
    grid = Grid(STATES, plane)
    low, high = grid.points().min(axis=0), grid.points().max(axis=0)
    for k, name in enumerate(STATES):
        a, b = grid.box[name]
        assert a <= low[k] <= high[k] <= b
    assert grid.box["q1"] == (-0.5, 1.5)


def test_a_grid_is_the_same_from_its_definition_and_after_pickling():
    grid = Grid(STATES, BOX).section({"q1": 3})
    assert Grid.from_definition(grid.definition()) == grid
    assert pickle.loads(pickle.dumps(grid)) == grid
    assert np.array_equal(pickle.loads(pickle.dumps(grid)).points(), grid.points())
    assert Grid(STATES, BOX) != grid


@pytest.mark.parametrize("shape", [(400,), (400, 400), (37, 1013), (400, 400, 400), (400,) * 4, (101,) * 6, (1, 10**7)])
def test_units_are_whole_chunks_of_a_size_that_suits_one_writer(shape):
    names = tuple("abcdef"[: len(shape)])
    grid = Grid(names, {name: (0, 1, count) for name, count in zip(names, shape, strict=True)})
    chunk, unit = grid.layout
    assert all(u % c == 0 for u, c in zip(unit, chunk, strict=True))
    assert math.prod(chunk) <= 2**16
    assert math.prod(unit) <= 2**19
    assert math.prod(unit) >= min(10_000, grid.size)


def test_units_cover_every_cell_once():
    grid = Grid(("a", "b", "c"), {"a": (0, 1, 101), "b": (0, 1, 130), "c": (0, 1, 77)})
    covered = np.zeros(grid.shape, int)
    for cells in grid.units():
        covered[cells] += 1
    assert covered.min() == covered.max() == 1


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"q1": 0.0, "v1": 0.0}, r"^grid = .*: must be with a free coordinate; give one a range \(low, high, count\)$"),
        (
            {"q1": (5, -5, 8)},
            r"^grid\['q1'\] = \(5, -5, 8\): must be \(low, high, count\) with low < high; turn it round$",
        ),
        ({"q1": (5, 5, 8)}, r"^grid\['q1'\] = \(5, 5, 8\): must be \(low, high, count\) with low < high$"),
        ({"q1": (-5, 5)}, r"^grid\['q1'\] = \(-5, 5\): must be \(low, high, count\)$"),
        ({"q1": (-5, 5, 0)}, r"^grid\['q1'\] = \(-5, 5, 0\): must be .* with count an integer >= 1$"),
        ({"q1": (-5, 5, 4.0)}, r"^grid\['q1'\] = .*: must be .* with count an integer >= 1$"),
        ({"q1": (-5, 5, True)}, r"^grid\['q1'\] = .*: must be .* with count an integer >= 1$"),
        ({"q1": (-5, math.inf, 4)}, r"^grid\['q1'\] = inf: must be a finite number$"),
        ({"q1": "wide"}, r"^grid\['q1'\] = 'wide': must be a number, or a range \(low, high, count\)$"),
        ({"q3": 0.0}, r"^grid = 'q3': must be one of q1, q2, v1, v2; did you mean 'q[12]'\?$"),
    ],
)
def test_a_grid_that_cannot_be_is_told(change, told):
    with pytest.raises(InputError, match=told):
        Grid(STATES, {**BOX, **change})


def test_a_coordinate_that_is_neither_free_nor_frozen_is_named():
    with pytest.raises(InputError, match=r"^grid = \['q1'\]: must be a range or a value .*; add 'q2': 0\.0"):
        Grid(STATES, {"q1": (-5, 5, 8)})


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"u": {"q1": 1.0}, "v": {"q1": 2.0}}, r"^plane's u, v = .*: must be two vectors that span a plane$"),
        ({"u": {"q": 1.0}}, r"^plane's u = 'q': must be one of "),
        ({"u": [1.0, 0.0]}, r"^plane's u = \[1\.0, 0\.0\]: must be a mapping of states to numbers$"),
        ({"origin": {"q1": 0.0}}, r"^plane's origin = .*: must be a value for each of .*; add 'q2'$"),
        ({"names": ("q1", "b")}, r"^plane's names = \('q1', 'b'\): must be two names that no state has$"),
        ({"extents": (0, 1)}, r"^plane's extents = \(0, 1\): must be two pairs \(low, high\)$"),
        ({"counts": (4,)}, r"^plane's counts = \(4,\): must be two counts of cells$"),
        ({"counts": (4, 0)}, r"^plane's 'b' = \(0, 1, 0\): must be .* with count an integer >= 1$"),
    ],
)
def test_a_plane_that_cannot_be_is_told(change, told):
    plane = {
        "origin": dict.fromkeys(STATES, 0.0), "u": {"q1": 1.0}, "v": {"v1": 1.0}, "extents": ((0, 1), (0, 1)),
        "counts": (4, 4), **change,
    }  # fmt: skip
    with pytest.raises(InputError, match=told):
        Grid(STATES, Plane(**plane))


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"q2": 0.0}, r"^coordinate = 'q2': must be a free coordinate: q1, v1; it is frozen at -0\.5$"),
        ({"q": 0.0}, r"^coordinate = 'q': must be a free coordinate: q1, v1; did you mean 'q1'\?$"),
        ({"q1": 5.1}, r"^q1 = 5\.1: must be between -5 and 5$"),
        ({"q1": "mid"}, r"^q1 = 'mid': must be a finite number$"),
    ],
)
def test_a_section_that_cannot_be_is_told(values, told):
    with pytest.raises(InputError, match=told):
        Grid(STATES, BOX).nearest(values)


def test_a_section_through_all_coordinates_is_refused():
    with pytest.raises(InputError, match=r"^section = \['q1', 'v1'\]: must be fewer than all coordinates: q1, v1$"):
        Grid(STATES, BOX).section({"q1": 0, "v1": 0})
