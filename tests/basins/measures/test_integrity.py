"""Integrity measures on sets whose measures are known in closed form."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from oracles import known_basins as kb
from saltus import InputError
from saltus.basins.map.basins import Basins
from saltus.basins.map.chunked_reading import blocks
from saltus.basins.map.grid import Grid, Plane
from saltus.basins.map.outcomes import Outcomes
from saltus.basins.measures.entropy import basin_entropy
from saltus.basins.measures.integrity import (
    global_integrity,
    integrity_factor,
    local_integrity,
    minimal_fatal_perturbation,
)
from saltus.basins.measures.stability import basin_stability
from saltus.basins.measures.uncertainty import uncertainty_by_neighbours
from saltus.basins.measures.wada import wada_by_merging
from saltus.basins.wilson import wilson

DISC = kb.sampled(lambda x, y: x**2 + y**2 > 0.36, (300, 300), 1.0, {"a": [[0.25, -0.1]]})
ELLIPSE = kb.sampled(lambda x, y: (x / 0.8) ** 2 + (y / 0.4) ** 2 > 1.0, (300, 300), 1.0, {"a": [[0.0, 0.0]]})
ANNULUS = kb.sampled(lambda x, y: abs(np.hypot(x, y) - 0.5) > 0.2, (300, 300))
RANDOM = np.random.default_rng(8)


class Counted:
    """Labels that count the cells read."""

    def __init__(self, labels, unit=None):
        self.labels, self.shape, self.cells = labels, labels.shape, 0
        self.unit = unit

    def __getitem__(self, key):
        found = self.labels[key]
        self.cells += found.size
        return found


def counted(basins, unit=None):
    return SimpleNamespace(labels=Counted(basins.labels, unit), grid=basins.grid, attractors=basins.attractors)


def half_space(normal, offset, counts, half):
    """Basin a where normal . x < offset."""
    counts, half = np.broadcast_to(counts, len(normal)), np.broadcast_to(half, len(normal))
    x = np.meshgrid(*(kb.centres(-w, w, n) for w, n in zip(half, counts, strict=True)), indexing="ij", sparse=True)
    height = sum(n * axis for n, axis in zip(normal, x, strict=True))
    return kb.basins(np.broadcast_to(height >= offset, tuple(counts)), half)


# volumes


def test_a_disc_has_the_area_of_a_disc():
    found = global_integrity(DISC, "a")
    assert found.value == pytest.approx(0.36 * math.pi, abs=3.0 * found.error)
    assert found.share == pytest.approx(0.09 * math.pi, abs=3.0 * found.share_error)
    assert found.error < 1e-3 * found.value


def test_an_annulus_has_the_area_of_an_annulus():
    found = global_integrity(ANNULUS, "a")
    assert found.value == pytest.approx(math.pi * (0.7**2 - 0.3**2), abs=3.0 * found.error)
    assert found.error < 1e-3 * found.value


def test_the_bound_of_a_disc_is_half_a_cell_times_its_two_widths_and_heights():
    # a line along an axis crosses a disc of radius r twice within a width of 2 r, for each of the two axes
    h = 2.0 / 300
    assert global_integrity(DISC, "a").bound == pytest.approx(0.5 * h * 2 * 2 * 2 * 0.6, rel=0.02)


def test_areas_of_discs_scatter_by_their_error():
    off = []
    for _ in range(200):
        x0, y0, r = RANDOM.uniform(0.3, 0.5, 3)
        disc = kb.sampled(lambda x, y: np.hypot(x - x0, y - y0) > r, (60, 50))  # noqa: B023
        found = global_integrity(disc, "a")
        off.append((found.value - math.pi * r**2) / found.error)
    assert 0.3 < np.std(off) < 1.0
    assert abs(np.mean(off)) < 0.2


def test_a_volume_is_wrong_by_less_than_its_bound_for_any_half_plane():
    for _ in range(40):
        angle, offset = RANDOM.uniform(0, 2 * math.pi), RANDOM.uniform(-0.5, 0.5)
        found = global_integrity(half_space((math.cos(angle), math.sin(angle)), offset, (21, 33), 1.0), "a")
        truth = global_integrity(half_space((math.cos(angle), math.sin(angle)), offset, (1050, 990), 1.0), "a")
        assert abs(found.value - truth.value) <= found.bound + truth.bound
    along = global_integrity(half_space((1.0, 0.0), 0.049, 20, 1.0), "a")
    assert along.value - 2.0 * 1.049 == pytest.approx(-0.098)
    assert along.error < 0.098 < along.bound + 1e-12


def test_volumes_of_all_outcomes_fill_the_window():
    labels = RANDOM.integers(0, 3, (30, 20, 10))
    basins = kb.basins(labels, (1.0, 2.0, 0.5))
    assert sum(global_integrity(basins, name).value for name in "abc") == pytest.approx(2.0 * 4.0 * 1.0)


def test_blocks_cover_an_array_once_and_keep_units_whole():
    for shape, unit, multiple, most in (((37, 20), (5, 4), 1, 60), ((40, 41, 9), None, 5, 500), ((100,), None, 7, 20)):
        seen = np.zeros(shape, int)
        labels = Counted(np.zeros(shape, np.uint8), unit)
        for block in blocks(labels, multiple=multiple, most=most):
            seen[block] += 1
            assert all(s.start % multiple == 0 for s in block)
            assert unit is None or all(s.start % u == 0 for s, u in zip(block, unit, strict=True))
        assert (seen == 1).all()


@pytest.mark.campaign
def test_a_volume_read_in_many_blocks_is_that_read_at_once():
    labels = RANDOM.integers(0, 2, (2900, 2900, 3))  # more cells than a block
    basins = kb.basins(labels)
    assert len(list(blocks(basins.labels))) > 1
    found = global_integrity(basins, "b")
    parted = sum(int((np.diff(labels, axis=axis) != 0).sum()) for axis in range(3))
    assert found.cells == int((labels == 1).sum())
    assert found.bound == pytest.approx(0.5 * parted * math.prod(basins.grid.spacing))
    assert found.error == pytest.approx(found.bound / math.sqrt(parted))


@pytest.mark.campaign
def test_the_bounded_orbits_of_the_henon_map_have_the_known_share():
    found = global_integrity(kb.basins(kb.henon(np.linspace(-2.0, 2.0, 4000)), 2.0), "a")
    assert round(found.share, 5) == 0.43234


def test_the_roots_of_newtons_method_have_the_known_shares():
    basins = kb.basins(kb.newton(1.0, 1000))
    assert [round(global_integrity(basins, name).share, 5) for name in "abc"] == [0.33598, 0.33201, 0.33201]


@pytest.mark.campaign
def test_the_magnets_of_a_pendulum_have_the_known_shares():
    labels = kb.pendulum(np.linspace(-2.0, 2.0, 201))
    basins = kb.basins(labels, 2.0)
    apart, first, second = (global_integrity(basins, name).share for name in "abc")
    assert first == second  # by symmetry
    rows, columns = np.nonzero(labels == kb.UNDECIDED)
    assert rows.size <= 12  # cells on the line of symmetry that end on a saddle
    assert (columns == 100).all()
    assert first == pytest.approx(0.3309, abs=5e-5)
    assert apart == pytest.approx(0.3379, abs=1e-4)


# the largest ball about an attractor


@pytest.mark.parametrize("offset", [0.0, 0.1, 0.35, 0.59])
def test_the_ball_about_a_point_of_a_disc_reaches_its_rim(offset):
    for direction in (0.0, 0.7, 2.0):
        centre = offset * np.array([math.cos(direction), math.sin(direction)])
        found = local_integrity(DISC, "a", centre=centre)
        assert found.value == pytest.approx(0.6 - offset, abs=found.error)
        assert not found.clipped
    assert found.error == pytest.approx(math.sqrt(0.5) * 2.0 / 300)


def test_the_ball_is_centred_on_the_attractor():
    found = local_integrity(DISC, "a")
    assert found.centre == pytest.approx([0.25, -0.1])
    assert found.value == pytest.approx(0.6 - math.hypot(0.25, 0.1), abs=found.error)
    assert found.off_section == 0.0


def test_weights_make_the_ball_an_ellipse():
    round_ball = local_integrity(ELLIPSE, "a")
    assert round_ball.value == pytest.approx(0.4, abs=round_ball.error)
    fitted = local_integrity(ELLIPSE, "a", weights={"x": 0.8, "y": 0.4})
    assert fitted.value == pytest.approx(1.0, abs=fitted.error)
    assert fitted.error == pytest.approx(0.5 * math.hypot(1 / 0.8, 1 / 0.4) * 2.0 / 300)


def test_a_ball_is_round_in_cells_that_are_not_square():
    flat = kb.sampled(lambda x, y: x**2 + y**2 > 0.36, (400, 50), 1.0)
    found = local_integrity(flat, "a", centre=[0.1, 0.2])
    assert found.value == pytest.approx(0.6 - math.hypot(0.1, 0.2), abs=found.error)


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_the_distance_from_a_flat_boundary_is_right_to_half_a_cells_diagonal(dimension):
    largest = 0.0
    for _ in range(200):
        normal = RANDOM.standard_normal(dimension)
        counts = RANDOM.integers(11, 24, dimension)
        offset = RANDOM.uniform(0.0, 0.3) * np.linalg.norm(normal)
        weights = RANDOM.uniform(0.5, 2.0, dimension)
        basins = half_space(normal, offset, counts, np.full(dimension, 3.0))
        start = RANDOM.uniform(-0.05, 0.05, dimension)
        found = local_integrity(basins, "a", centre=start, weights=dict(zip("xyz", weights, strict=False)))
        truth = (offset - normal @ start) / np.linalg.norm(weights * normal)
        if truth > 0.0 and not found.clipped:
            assert abs(found.value - truth) <= found.error * (1.0 + 1e-9)
            largest = max(largest, abs(found.value - truth) / found.error)
    assert largest > 0.6  # the bound is no looser than it has to be


def test_a_search_outwards_finds_the_nearest_cell_of_all(monkeypatch):
    monkeypatch.setattr("saltus.basins.measures.distances._NEAR", 200)  # cells of a block
    for _ in range(100):
        labels = (RANDOM.random((20, 30, 20)) < 0.003).astype(np.uint8)
        basins = kb.basins(labels, (1.0, 1.5, 2.0))
        start = RANDOM.uniform(-0.5, 0.5, 3)
        outside = np.stack([a[i] for a, i in zip(basins.grid.axes, np.nonzero(labels), strict=True)], axis=1)
        gaps = np.maximum(np.abs(outside - start) - 0.5 * np.array(basins.grid.spacing), 0.0)
        expected = np.linalg.norm(gaps, axis=1).min()
        found = local_integrity(counted(basins, (5, 5, 5)), "a", centre=start)
        assert found.value == pytest.approx(min(expected, 1.0 - abs(start[0]), 1.5 - abs(start[1])))


@pytest.mark.campaign
def test_a_ball_is_found_without_reading_the_whole_grid():
    wide = kb.sampled(lambda x, y: x**2 + y**2 > 0.01, (5000, 5000), 1.0)
    seen = counted(wide)
    found = local_integrity(seen, "a", centre=[0.02, 0.01])
    assert found.value == pytest.approx(0.1 - math.hypot(0.02, 0.01), abs=found.error)
    assert seen.labels.cells < 0.2 * wide.labels.size


def test_a_ball_stopped_by_the_window_says_so():
    basins = half_space((1.0, 0.0), 0.4, 100, 1.0)
    free = local_integrity(basins, "a", centre=[0.0, 0.0])
    assert (free.clipped, free.value) == (False, pytest.approx(0.4))
    stopped = local_integrity(basins, "a", centre=[0.0, 0.8])
    assert (stopped.clipped, stopped.value) == (True, pytest.approx(0.2))


@pytest.mark.parametrize("cells", [3, 12, 49, 168])
def test_an_attractor_on_the_windows_edge_is_within_whatever_centres_round_to(cells):
    x = (np.arange(cells) + 0.5) * (2.0 / cells) - 1.0
    halves = Basins.from_array(x < 0.0, {"x": x}, {"a": 0, "b": 1}, {"a": [[1.0]], "b": [[-1.0]]})
    assert max(1.0 - halves.grid.ranges[0][1], halves.grid.ranges[0][0] + 1.0) > 0.0  # the edges are off by rounding
    assert halves.grid.nearest({"x": 1.0}) == {"x": cells - 1}
    for name in ("a", "b"):
        found = local_integrity(halves, name)
        assert (found.value, found.clipped, found.note) == (0.0, True, "")
    assert minimal_fatal_perturbation(halves, "a").outcome == "b"
    beyond = 1.0 + 1e-8 * halves.grid.spacing[0]
    with pytest.raises(InputError, match=r"^x = 1\.0\d*: must be between -1 and 1$"):
        halves.grid.nearest({"x": beyond})
    with pytest.raises(InputError, match=r"^centre's x = 1\.0\d*: must be within the window"):
        local_integrity(halves, "a", centre=[beyond])


def test_an_attractor_in_a_foreign_cell_has_no_ball_and_says_so():
    found = local_integrity(DISC, "a", centre=[0.7, 0.0])
    assert found.value == 0.0
    assert found.note == "the centre's own cell is labelled 'b'"
    assert local_integrity(DISC, "a").note == ""


def test_undecided_cells_count_as_outside():
    labels = np.zeros((21, 21))
    labels[14, 10] = kb.UNDECIDED
    found = local_integrity(kb.basins(labels, 2.1), "a", centre=[0.0, 0.0])
    assert found.value == pytest.approx(0.7)
    assert minimal_fatal_perturbation(kb.basins(labels, 2.1), "a", centre=[0.0, 0.0]).outcome == "undecided"


def test_the_attractors_point_is_projected_and_its_distance_told():
    grid = Grid(("q", "v", "s"), {"v": (-1.0, 1.0, 100), "q": (-1.0, 1.0, 100), "s": 0.5})
    v, q = np.meshgrid(*grid.axes, indexing="ij")
    outcomes = Outcomes({"a": 0, "b": 1}, {"a": np.array([[0.1, -0.2, 0.53], [0.9, 0.9, 0.9]])})
    basins = Basins((v**2 + q**2 > 0.36).astype(np.uint8), grid, outcomes)
    found = local_integrity(basins, "a")
    assert found.centre == pytest.approx([-0.2, 0.1])
    assert found.off_section == pytest.approx(0.03)
    assert found.value == pytest.approx(0.6 - math.hypot(0.1, 0.2), abs=found.error)


def test_the_attractors_point_is_projected_onto_an_oblique_plane():
    plane = Plane(
        {"q": 0.0, "v": 0.0, "s": 1.0}, {"q": 0.6, "v": 0.8}, {"s": 1.0}, ((-1.0, 1.0), (-1.0, 1.0)), (10, 10)
    )
    grid = Grid(("q", "v", "s"), plane)
    point = grid.origin + [0.3, -0.4] @ grid.vectors + 0.07 * np.array([-0.8, 0.6, 0.0])
    basins = Basins(np.zeros((10, 10), np.uint8), grid, Outcomes({"a": 0}, {"a": point[None]}))
    found = local_integrity(basins, "a")
    assert found.centre == pytest.approx([0.3, -0.4])
    assert found.off_section == pytest.approx(0.07)


# the largest ball anywhere


def test_the_largest_ball_of_a_disc_an_ellipse_and_an_annulus_is_the_known_one():
    for basins, radius in ((DISC, 0.6), (ELLIPSE, 0.4), (ANNULUS, 0.2)):
        found = integrity_factor(basins, "a")
        assert found.value == pytest.approx(radius, abs=found.error)
        assert not found.clipped
    assert found.error == pytest.approx(1.5 * math.sqrt(0.5) * 2.0 / 300)
    assert np.hypot(*found.centre) == pytest.approx(0.5, abs=found.error)


def test_the_largest_ball_is_an_ellipse_under_weights():
    found = integrity_factor(ELLIPSE, "a", weights={"x": 0.8, "y": 0.4})
    assert found.value == pytest.approx(1.0, abs=found.error)


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_the_width_of_a_slab_is_right_to_the_error(dimension):
    for _ in range(60 if dimension < 3 else 15):
        normal = RANDOM.standard_normal(dimension)
        normal /= np.linalg.norm(normal)
        middle, radius = RANDOM.uniform(-0.1, 0.1), RANDOM.uniform(0.2, 0.35)
        counts = RANDOM.integers(21, 34, dimension)
        outside = lambda *x: abs(sum(n * a for n, a in zip(normal, x, strict=True)) - middle) > radius  # noqa: B023, E731
        found = integrity_factor(kb.sampled(outside, counts, 2.0), "a")
        assert abs(found.value - radius) <= found.error * (1.0 + 1e-9)


def test_a_ball_that_leaves_the_window_does_not_count():
    found = integrity_factor(half_space((1.0, 0.0), 0.2, 100, 1.0), "a")
    assert found.value == pytest.approx(0.6, abs=found.error)
    assert found.clipped


def test_the_largest_ball_is_that_of_a_search_over_all_cells():
    labels = (RANDOM.random((14, 11, 9)) < 0.05).astype(np.uint8)
    basins = kb.basins(labels, (1.4, 2.2, 0.9))
    padded = np.pad(labels, 1, constant_values=1)
    sizes = np.array(basins.grid.spacing)
    inside, outside = np.argwhere(padded == 0) * sizes, np.argwhere(padded == 1) * sizes
    most = np.linalg.norm(inside[:, None] - outside[None], axis=2).min(axis=1).max()
    found = integrity_factor(basins, "a")
    assert found.value + found.error / 3.0 == pytest.approx(most)


def test_a_basin_without_a_cell_has_no_ball():
    found = integrity_factor(DISC, "c")
    assert found.value == 0.0
    assert found.note == "no cell is labelled 'c'"


def test_a_grid_too_large_for_the_transform_is_refused():
    grid = Grid(("x", "y", "z", "u"), dict.fromkeys("xyzu", (-1.0, 1.0, 400)))
    huge = Basins(np.broadcast_to(np.uint8(0), grid.shape), grid, Outcomes({"a": 0}))
    with pytest.raises(InputError, match="400 x 400 x 400 x 400 cells.*take a section, or map a coarser grid"):
        integrity_factor(huge, "a")


# stores


@pytest.mark.campaign
def test_measures_of_a_store_and_of_its_sections_are_those_of_the_array(tmp_path, small_units, monkeypatch):
    monkeypatch.setattr("saltus.basins.measures.distances._NEAR", 100)
    labels = np.repeat(np.repeat(np.repeat(RANDOM.integers(0, 3, (5, 4, 6)), 4, axis=0), 5, axis=1), 3, axis=2)
    held = kb.basins(labels, (1.0, 1.5, 2.0))
    held.save(tmp_path / "labels.zarr")
    stored = Basins.open(tmp_path / "labels.zarr")
    assert len(list(stored.grid.units())) > 8
    name = "abc"[int(labels[10, 10, 9])]
    for mine, its in ((held, stored), (held.section(z=0.1), stored.section(z=0.1))):
        centre = np.zeros(len(mine.grid.names))
        for measure in (global_integrity, integrity_factor):
            assert repr(measure(its, name)) == repr(measure(mine, name))
        assert repr(local_integrity(its, name, centre=centre)) == repr(local_integrity(mine, name, centre=centre))
        assert basin_entropy(its, 4) == basin_entropy(mine, 4)
        assert (wada_by_merging(its).distances == wada_by_merging(mine).distances).all()
        found, expected = (uncertainty_by_neighbours(each, (1, 2, 3)) for each in (its, mine))
        assert (found.fractions == expected.fractions).all()


# perturbations


def test_the_smallest_fatal_perturbation_of_a_half_plane_is_along_its_normal():
    basins = half_space((0.0, 1.0), 0.3, 100, 1.0)
    found = minimal_fatal_perturbation(basins, "a", centre=[0.01, 0.01])
    assert found.vector == pytest.approx([0.0, 0.3])
    assert found.value - found.error <= 0.29 <= found.value
    assert (found.outcome, found.clipped) == ("b", False)


def test_the_boundary_lies_between_the_ball_and_the_fatal_perturbation():
    for _ in range(30):
        centre = RANDOM.uniform(-0.3, 0.3, 2)
        truth = 0.6 - np.hypot(*centre)
        found = minimal_fatal_perturbation(DISC, "a", centre=centre)
        assert found.value - found.error <= truth <= found.value
        assert np.hypot(*(centre + found.vector)) > 0.6


def test_nothing_fatal_in_the_window_is_told():
    found = minimal_fatal_perturbation(kb.basins(np.zeros((9, 9))), "a", centre=[0.0, 0.0])
    assert (found.value, found.outcome, found.clipped) == (math.inf, "", True)
    assert np.isnan(found.vector).all()


# samples


def classified(labels_of):
    grid = Grid(("q", "v"), {"q": (-1.0, 1.0, 10), "v": (-1.0, 1.0, 10)})
    return SimpleNamespace(
        labels=np.zeros((10, 10), np.uint8), grid=grid, attractors=Outcomes({"a": 0, "b": 1}), classify=labels_of
    )


def test_basin_stability_is_the_share_of_the_window():
    disc = classified(lambda points: (np.hypot(*points.T) > 0.6).astype(np.uint8))
    covered = 0
    for seed in range(100):
        found = basin_stability(disc, "a", 400, rng=seed)
        covered += found.low <= 0.09 * math.pi <= found.high
        assert found.low < found.value < found.high
    assert 90 <= covered <= 99  # of 95 % intervals; a binomial count within 2.3 standard deviations
    assert basin_stability(disc, "a", 400, rng=7) == basin_stability(disc, "a", 400, rng=7)


def test_basin_stability_of_a_region_is_its_share():
    left = classified(lambda points: (points[:, 0] > 0.25).astype(np.uint8))
    found = basin_stability(left, "a", 4000, region={"q": (0.0, 1.0)})
    assert found.low < 0.25 < found.high


def test_samples_are_classified_by_the_engine_that_is_asked_for():
    asked = []

    def classify(points, **options):
        asked.append(options)
        return np.zeros(len(points), np.uint8)

    square = SimpleNamespace(grid=DISC.grid, attractors=DISC.attractors, classify=classify)
    basin_stability(square, "a", 10)
    basin_stability(square, "a", 10, engine="cpu")
    assert asked == [{}, {"engine": "cpu"}]


def test_undecided_samples_are_no_hits():
    found = basin_stability(classified(lambda points: np.full(len(points), kb.UNDECIDED, np.uint8)), "a", 50)
    assert (found.hits, found.undecided, found.value) == (0, 50, 0.0)


@pytest.mark.parametrize(
    ("hits", "samples", "low", "high"), [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (1, 29, 0.0061, 0.1718)]
)
def test_intervals_are_those_in_print(hits, samples, low, high):
    # R. G. Newcombe, Stat. Med. 17 (1998) 857-872, Table I, method 3
    assert wilson(hits, samples) == (pytest.approx(low, abs=5e-5), pytest.approx(high, abs=5e-5))


@pytest.mark.parametrize("samples", [10, 100, 10**6])
def test_no_hit_in_n_samples_is_less_than_three_in_n(samples):
    low, high = wilson(0, samples)
    assert low == 0.0
    assert 2.5 / samples < high < 3.0 / samples
    assert (1.0 - high) ** samples == pytest.approx(0.05)
    assert wilson(samples, samples) == (pytest.approx(1.0 - high), 1.0)


# bad input


def test_bad_input_is_told():
    with pytest.raises(InputError, match="name = 'ab': must be one of a, b"):
        global_integrity(DISC, "ab")
    with pytest.raises(InputError, match="weights = 'z': must be one of x, y"):
        local_integrity(DISC, "a", weights={"x": 1.0, "z": 1.0})
    with pytest.raises(InputError, match="must be given for every free coordinate; add 'y'"):
        local_integrity(DISC, "a", weights={"x": 1.0})
    with pytest.raises(InputError, match="weights.* = .*must be a finite number > 0"):
        integrity_factor(DISC, "a", weights={"x": 1.0, "y": 0.0})
    with pytest.raises(InputError, match="centre's y = 3.0: must be within the window, from -1 to 1"):
        local_integrity(DISC, "a", centre=[0.0, 3.0])
    with pytest.raises(InputError, match="centre = .*must be a number for each of x, y"):
        local_integrity(DISC, "a", centre=[0.0])
    with pytest.raises(InputError, match="name = 'a': must be an attractor whose points are known"):
        local_integrity(ANNULUS, "a")
    with pytest.raises(InputError, match="samples = 0: must be an integer >= 1"):
        basin_stability(DISC, "a", 0)
    with pytest.raises(InputError, match=r"region\['x'\] = \(1, 0\): must be two finite numbers, the lower first"):
        basin_stability(DISC, "a", 10, region={"x": (1, 0)})
    with pytest.raises(InputError, match=r"region\['x'\] = 3: must be two finite numbers, the lower first"):
        basin_stability(DISC, "a", 10, region={"x": 3})
    with pytest.raises(InputError, match=r"rng = -1: must be an integer >= 0"):
        basin_stability(DISC, "a", 10, rng=-1)
    with pytest.raises(InputError, match="confidence = 95: must be a number between 0 and 1"):
        wilson(1, 2, 95)
    with pytest.raises(InputError, match="hits = 3: must be an integer between 0 and 2"):
        wilson(3, 2)


def test_a_grid_that_is_not_finished_is_refused():
    grid = Grid(("x",), {"x": (-1.0, 1.0, 9)})
    labels = np.zeros(9, np.uint8)
    labels[8] = 255
    basins = Basins(labels, grid, Outcomes({"a": 0}))
    for measure in (global_integrity, integrity_factor):
        with pytest.raises(InputError, match="must be a finished grid; resume its computation first"):
            measure(basins, "a")
