"""Basin entropy, the uncertainty exponent and the Wada test on sets whose answers are known."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from oracles import known_basins as kb
from saltus import InputError
from saltus.basins.map.grid import Grid
from saltus.basins.measures.entropy import basin_entropy
from saltus.basins.measures.uncertainty import uncertainty_by_neighbours, uncertainty_by_shifts
from saltus.basins.measures.wada import wada_by_merging

CANTOR = 1.0 - math.log(2.0) / math.log(3.0)
"""Uncertainty exponent of a boundary that is the middle-thirds Cantor set."""


@pytest.fixture(scope="module")
def newton():
    return {half: kb.basins(kb.newton(half, 1000), half) for half in (1.0, 2.0)}


def in_gaps(x, depth=34):
    """For each number of [0, 1] whether the gap of the Cantor set that it lies in is of even or odd order."""
    x, order = np.array(x, dtype=np.float64), np.zeros(np.shape(x), np.int64)
    inside = np.zeros(x.shape, np.bool_)
    for level in range(depth):
        x *= 3.0
        digit = np.minimum(np.floor(x), 2.0)
        order[~inside & (digit == 1.0)] = level
        inside |= digit == 1.0
        x -= digit
    return (order % 2).astype(np.uint8)


# basin entropy


def test_a_half_plane_has_the_entropy_of_its_cut():
    labels = np.repeat((np.arange(100) >= 43)[:, None], 100, axis=1)  # cuts a tenth of the boxes 3 to 7
    found = basin_entropy(kb.basins(labels), 10)
    assert found.boundary == pytest.approx(0.61086, abs=5e-6)
    assert found.value == pytest.approx(0.061086, abs=5e-7)
    assert (found.boxes, found.boundary_boxes, found.fractal) == (100, 10, False)


@pytest.mark.campaign
def test_square_boxes_cut_by_random_lines_have_the_known_entropy():
    # isotropic lines that hit the box: direction with a density as its width, then the offset uniform in that width
    random, count, e = np.random.default_rng(3), 4000, 60
    angle = random.uniform(0.0, 2.0 * math.pi, 8 * count)
    width = np.abs(np.cos(angle)) + np.abs(np.sin(angle))
    kept = random.uniform(0.0, math.sqrt(2.0), angle.size) < width
    angle, width = angle[kept][:count], width[kept][:count]
    offset = random.uniform(-0.5, 0.5, count) * width
    x = (np.arange(e) + 0.5) / e - 0.5
    height = np.cos(angle)[:, None, None] * x[:, None] + np.sin(angle)[:, None, None] * x
    found = basin_entropy(kb.basins((height > offset[:, None, None]).reshape(count * e, e)), e)
    # lines that cut off less than a cell are not seen: a share of about 1/e, of boxes with hardly an entropy
    assert found.boundary == pytest.approx(0.4032, abs=3.0 * found.boundary_error + 0.4032 / e)
    assert not found.fractal


def test_intervals_cut_at_random_have_the_entropy_of_one_half():
    random, count, e = np.random.default_rng(4), 5000, 200
    x, cut = (np.arange(e) + 0.5) / e, random.uniform(0.0, 1.0, count)
    found = basin_entropy(kb.basins((x > cut[:, None]).ravel()), e)
    assert found.boundary == pytest.approx(0.5, abs=3.0 * found.boundary_error + 0.5 / e)


def test_random_labels_have_the_entropy_of_three_less_the_bias_of_a_finite_box():
    labels = np.random.default_rng(5).integers(0, 3, (1000, 1000))
    found = basin_entropy(kb.basins(labels), 20)
    # ln 3 - 1/20^2 + O(1/20^4) in the mean; a sample of these boxes is known to have 1.09595
    assert found.boundary == pytest.approx(math.log(3.0) - 1.0 / 400.0, abs=3.0 * found.boundary_error)
    assert found.boundary == pytest.approx(1.09595, abs=3e-4)
    assert found.boundary == found.value
    assert found.fractal


@pytest.mark.campaign
def test_newtons_basins_have_the_entropies_in_print_and_a_fractal_boundary(newton):
    found = basin_entropy(newton[1.0], 5)
    assert round(found.value, 5) == 0.05673
    assert round(found.boundary, 5) == 0.72690
    assert found.fractal


@pytest.mark.campaign
def test_duffings_basins_have_the_known_shares_and_entropies():
    labels = kb.duffing(np.linspace(-2.2, 2.2, 200))
    basins, found = kb.basins(labels, 2.2), basin_entropy(kb.basins(labels, 2.2), 5)
    assert not (labels == kb.UNDECIDED).any()
    # of two integrations some cells in a thousand differ, as the boundary is fractal
    assert sorted(basins.fractions().values())[-2:] == pytest.approx([0.4990, 0.5010], abs=1e-3)
    assert found.value == pytest.approx(0.5728, abs=1e-3)
    assert found.boundary == pytest.approx(0.6188, abs=1e-3)
    assert not found.fractal  # a fractal boundary all the same: the test is sufficient only


def test_the_standard_error_is_that_of_independent_boxes():
    random = np.random.default_rng(6)
    values = [basin_entropy(kb.basins(random.random((60, 60)) < 0.03), 5) for _ in range(300)]
    assert np.std([v.value for v in values]) == pytest.approx(np.mean([v.error for v in values]), rel=0.15)
    assert np.std([v.boundary for v in values]) == pytest.approx(np.mean([v.boundary_error for v in values]), rel=0.15)


def test_one_corner_of_three_smooth_basins_is_no_proof():
    labels = np.zeros((10, 10))
    labels[:2, 3:5] = 1
    labels[2:5, 2:5] = 2  # one box of five has three labels
    found = basin_entropy(kb.basins(labels), 5)
    assert found.boundary > math.log(2.0)
    assert found.boundary_boxes == 1
    assert not found.fractal


def test_one_basin_has_no_boundary_entropy():
    found = basin_entropy(kb.basins(np.zeros((10, 10))), 5)
    assert found.value == 0.0
    assert math.isnan(found.boundary)
    assert not found.fractal


def test_undecided_cells_are_left_out():
    labels = np.zeros((4, 2))
    labels[:2] = [[0, 1], [kb.UNDECIDED, kb.UNDECIDED]]
    found = basin_entropy(kb.basins(labels), 2)
    assert found.boundary == pytest.approx(math.log(2.0))
    assert found.value == pytest.approx(0.5 * math.log(2.0))
    labels[:2], labels[2:] = kb.UNDECIDED, [[0, 1], [1, 1]]
    assert basin_entropy(kb.basins(labels), 2).boxes == 1


def test_entropy_read_in_many_blocks_is_that_read_at_once():
    labels = np.random.default_rng(7).integers(0, 2, (2301, 2302))  # more cells than a block, no multiple of a box
    found = basin_entropy(kb.basins(labels), 7)
    boxes = labels[: 2301 // 7 * 7, : 2302 // 7 * 7].reshape(2301 // 7, 7, 2302 // 7, 7).mean(axis=(1, 3))
    assert found.boxes == boxes.size
    assert found.value == pytest.approx(np.mean(-boxes * np.log(boxes) - (1 - boxes) * np.log(1 - boxes)))


@pytest.mark.parametrize("box", [1, 11, 2.5])
def test_a_box_that_does_not_fit_is_told(box):
    with pytest.raises(InputError, match="box = .*must be an integer between 2 and 10, the cells on the shortest axis"):
        basin_entropy(kb.basins(np.zeros((10, 20))), box)


# uncertainty exponent


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_a_flat_boundary_has_the_exponent_one(dimension):
    labels = np.zeros((81,) * dimension)
    labels[40:] = 1
    found = uncertainty_by_neighbours(kb.basins(labels))
    assert found.value == pytest.approx(1.0)
    assert found.dimension == pytest.approx(dimension - 1.0)
    assert found.estimator == "neighbours"


def test_newtons_basins_have_the_exponent_known_for_neighbours(newton):
    # variants of the estimator (pairs, one coordinate only, fewer scales) lie between 0.554 and 0.566
    found = uncertainty_by_neighbours(newton[2.0])
    assert found.value == pytest.approx(0.564, abs=2.0 * found.error)
    assert found.error < 0.005
    assert found.value == pytest.approx(2.0 - 1.42, abs=0.1)


def test_a_cantor_boundary_has_the_exponent_of_its_dimension_by_neighbours():
    x = kb.centres(0.0, 1.0, 3**9)
    labels = np.repeat(in_gaps(x)[:, None], 9, axis=1)[:, 0]
    found = uncertainty_by_neighbours(kb.basins(labels), (3, 9, 27, 81, 243))
    assert found.value == pytest.approx(CANTOR, abs=0.02)


def test_a_cantor_boundary_has_the_exponent_of_its_dimension_by_shifts():
    grid = Grid(("q", "v"), {"v": (0.0, 1.0, 3), "q": (0.0, 1.0, 3)})
    cantor = SimpleNamespace(grid=grid, classify=lambda points: in_gaps(points[:, 0] % 1.0))
    off = []
    for seed in range(20):
        found = uncertainty_by_shifts(cantor, 0.1 / 3.0 ** np.arange(3, 11), 4000, rng=seed)
        off.append((found.value - CANTOR) / found.error)
    assert abs(np.mean(off)) < 3.0 / math.sqrt(20)
    assert 0.5 < np.std(off) < 1.5
    assert found.estimator == "shifts"
    assert found.dimension == pytest.approx(2.0 - found.value)


def test_a_flat_boundary_has_the_exponent_one_by_shifts():
    grid = Grid(("q", "v", "s"), {"v": (-1.0, 1.0, 3), "q": (-1.0, 1.0, 3), "s": 0.4})
    seen = []

    def classify(points):
        seen.append(points)
        return (points[:, 0] + 0.3 * points[:, 1] > 0.1).astype(np.uint8)

    halves = SimpleNamespace(grid=grid, classify=classify)
    found = uncertainty_by_shifts(halves, [0.01, 0.02, 0.05, 0.1, 0.2], 4000, weights={"v": 0.5, "q": 2.0})
    assert found.value == pytest.approx(1.0, abs=3.0 * found.error)
    first = seen[0]
    moved = first[4000:] - first[:4000]
    assert np.hypot(moved[:, 0] / 2.0, moved[:, 1] / 0.5) == pytest.approx(0.01)
    assert (first[:, 2] == 0.4).all()


def test_neighbours_read_in_many_blocks_are_those_read_at_once():
    random = np.random.default_rng(9)
    labels = np.repeat(random.integers(0, 3, (2500, 500)), 5, axis=1)  # more cells than a block
    labels[random.random(labels.shape) < 0.05] = kb.UNDECIDED
    found = uncertainty_by_neighbours(kb.basins(labels), (1, 2, 4))
    core = labels[4:-4, 4:-4]
    for fraction, k in zip(found.fractions, (1, 2, 4), strict=True):
        others = [
            labels[4 + k : 2496 + k, 4:-4], labels[4 - k : 2496 - k, 4:-4],
            labels[4:-4, 4 + k : 2496 + k], labels[4:-4, 4 - k : 2496 - k],
        ]  # fmt: skip
        differs = np.any([(other != core) & (other != kb.UNDECIDED) for other in others], axis=0)
        assert fraction == pytest.approx(differs[core != kb.UNDECIDED].mean())


def test_scales_that_cannot_be_used_are_told():
    basins = kb.basins(np.zeros((40, 40)))
    with pytest.raises(InputError, match="scales.* = .*(at least three distinct positive integers|an integer >= 1)"):
        uncertainty_by_neighbours(basins, (1, 2))
    with pytest.raises(InputError, match="less than half of 40, the cells on the shortest axis"):
        uncertainty_by_neighbours(basins, (1, 2, 20))
    with pytest.raises(InputError, match="'0 with uncertain initial conditions': must be three or more"):
        uncertainty_by_neighbours(basins)
    with pytest.raises(InputError, match="at least three distinct positive lengths|must be finite"):
        uncertainty_by_shifts(basins, [0.1, 0.1, 0.2])


# Wada


def test_newtons_basins_are_wada_at_every_resolution(newton):
    found = wada_by_merging(newton[1.0])
    assert found.names == ("a", "b", "c")
    assert found.wada
    widths = [int(wada_by_merging(kb.basins(kb.newton(1.0, n))).distances.max()) for n in (250, 500)]
    assert max(*widths, found.distances.max()) <= 4  # cells, while a cell shrinks by four


def test_three_sectors_are_not_wada():
    x = kb.centres(-1.0, 1.0, 200)
    angle = np.arctan2(x[:, None], x)
    found = wada_by_merging(kb.basins(np.floor(3.0 * (angle / (2.0 * math.pi) + 0.5))), 10)
    assert not found.wada
    assert (found.distances + 11 * np.eye(3, dtype=int) == 11).all()  # further than reach, all


def test_two_basins_share_their_boundary_and_are_not_wada():
    found = wada_by_merging(kb.basins(np.arange(100).reshape(10, 10) % 10 > 4))
    assert (found.distances == 0).all()
    assert not found.wada


def test_boundaries_some_cells_apart_are_told_by_how_many():
    labels = np.zeros((40, 30))
    labels[20:] = 2
    labels[17:20] = 1  # a stripe of three cells: its boundaries are at 16 | 17 and 19 | 20
    found = wada_by_merging(kb.basins(labels), 6)
    # that of a lies in rows 16, 17 and that of c in rows 19, 20
    assert found.distances[0, 2] == found.distances[2, 0] == 3
    assert found.distances[0, 1] == 0
    assert found.distances[1, 0] == 3
    assert found.wada  # at this reach, and not at a smaller one
    assert not wada_by_merging(kb.basins(labels), 2).wada


@pytest.mark.campaign
def test_boundaries_read_in_many_blocks_are_those_read_at_once(newton):
    fine = np.kron(newton[1.0].labels[200:700, 200:700], np.ones((5, 5), np.uint8))  # more cells than a block
    coarse = wada_by_merging(kb.basins(newton[1.0].labels[200:700, 200:700]), 6)
    found = wada_by_merging(kb.basins(fine), 30)
    # a chain of n steps between boundaries of coarse cells is one of 5 n, more or less those within a cell
    assert (abs(found.distances - 5 * coarse.distances) <= 5).all()


def test_a_reach_that_cannot_be_is_told():
    with pytest.raises(InputError, match="reach = 0: must be an integer >= 1"):
        wada_by_merging(kb.basins(np.zeros((10, 10))), 0)
