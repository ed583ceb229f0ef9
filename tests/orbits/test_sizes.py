"""Typical sizes of states, and which states rest, against reachability in the graph of what moves what."""

import numpy as np
import pytest

from saltus.orbits.kernels.mesh import UNSTABLE, moved
from saltus.orbits.kernels.sizes import resized, swollen
from saltus.orbits.resting import at_rest

LIMITS = (1e-9, 1e-3)


def reached(big, moves):
    """Which states are big, or moved by such through others: the closure of the relation."""
    closure = np.linalg.matrix_power(np.eye(len(moves)) + moves, len(moves)) > 0.0
    return closure @ big > 0


@pytest.mark.parametrize("seed", range(20))
def test_states_rest_that_are_small_and_that_no_other_one_moves(seed):
    draw = np.random.default_rng(seed)
    moves = draw.random((6, 6)) < 0.2
    sizes = np.where(draw.random(6) < 0.4, 1.0, 1e-12)
    sizes[draw.integers(6)] = 1.0
    np.testing.assert_array_equal(at_rest(sizes, moves), ~reached(sizes > 0.5, moves))


def test_sizes_are_the_largest_moduli_and_shrink_to_a_hundredth_at_most():
    largest, scale = np.array([1.0, 50.0, 0.0]), np.zeros(4)
    moves = np.ones((4, 4), dtype=bool)
    lows, highs = np.array([-3.0, -0.1, 0.2]), np.array([1.0, 0.2, 0.4])
    assert resized(lows, highs, LIMITS, np.full(4, 1e-20), moves, largest, scale) == (True, False)
    assert scale.tolist() == [3.0, 0.5, 0.4, 0.0]  # that of the phase stays
    assert largest.tolist() == [3.0, 50.0, 0.4]


@pytest.mark.parametrize(("low", "high", "near"), [(1e-5, 1.0, True), (-1.0, -1e-5, True), (-1e-5, 1.0, False)])
def test_a_state_comes_near_0_that_keeps_its_sign(low, high, near):
    given = np.array([low]), np.array([high]), LIMITS, np.zeros(1), np.ones((1, 1), dtype=bool)
    assert resized(*given, np.zeros(1), np.zeros(1)) == (True, near)


@pytest.mark.parametrize("high", [np.inf, np.nan])
def test_sizes_stay_where_an_extreme_is_not_finite(high):
    largest, scale = np.array([2.0]), np.array([1.5])
    given = np.array([0.0]), np.array([high]), LIMITS, np.zeros(1), np.ones((1, 1), dtype=bool)
    assert resized(*given, largest, scale) == (False, False)
    assert (largest[0], scale[0]) == (2.0, 1.5)


def test_steps_that_may_be_unstable_are_halved():
    meshes = [np.array([0.0, 0.2, 1.0]), np.array([0.0, 0.5, 0.6, 1.0])]
    places, starts = np.concatenate(meshes), np.array([0, 3, 7])
    fresh, ends = np.empty(3 * places.size + 16), np.empty_like(starts)
    loop = np.array([0, 1])
    fine, count = moved(places, starts, loop, np.zeros(7), 5.0, 2.0 * UNSTABLE, True, 500, fresh, ends)
    assert (fine, count, ends.tolist()) == (False, 12, [0, 5, 12])
    for mesh, own in zip(meshes, np.split(fresh[:count], ends[1:-1]), strict=True):
        np.testing.assert_allclose(own, np.interp(np.arange(2 * mesh.size - 1) / 2, np.arange(mesh.size), mesh))


def test_meshes_stay_where_errors_are_small_or_not_finite():
    places, starts = np.linspace(0.0, 1.0, 5), np.array([0, 5])
    for errors, fine in ((np.full(5, 0.5), True), (np.full(5, np.nan), True), (np.full(5, np.inf), False)):
        given = places, starts, np.array([0]), errors, 1.0, 1.0, True, 500
        assert moved(*given, np.empty(23), np.empty_like(starts)) == (fine, 0)


def test_an_orbit_has_swollen_by_its_range_or_its_distance():
    before = np.array([0.0, -1e-9]), np.array([1.0, 1e-9])
    for lows, highs, wanted in (
        ([0.0, 0.0], [1.1, 0.0], False),
        ([0.0, 0.0], [101.0, 0.0], True),  # a range
        ([-200.0, 0.0], [-199.5, 0.0], True),  # a distance
        ([0.0, 50.0], [1.0, 50.0], True),  # of a state that is small at first: over a tenth of the largest
        ([0.0, 5.0], [1.0, 5.0], False),
        ([0.0, np.nan], [1.0, 1e9], False),
    ):
        assert swollen(before, (np.array(lows), np.array(highs)), 2, 100.0, 0.1) == wanted, lows
