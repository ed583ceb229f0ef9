"""Test functions of stability on multipliers of every number and place, against the moduli themselves."""

from itertools import combinations

import numpy as np
import pytest

from saltus.optimisation.stability import stability


def pair(modulus, angle):
    return [modulus * np.exp(1j * angle), modulus * np.exp(-1j * angle)]


def values(multipliers, radius=0.9):
    multipliers = np.array(multipliers, dtype=complex)
    return stability(multipliers, np.zeros((len(multipliers), 1)), radius).values


INSIDE = {
    "none": [],
    "one": [0.5],
    "one below 0": [-0.5],
    "a pair": pair(0.8, 1.0),
    "a pair and one": [*pair(0.8, 2.5), -0.3],
    "all at 0": [0.0, 0.0, 0.0],
    "double": [0.4, 0.4],
    "two pairs": [*pair(0.5, 0.3), *pair(0.89, 3.0)],
}


@pytest.mark.parametrize("what", INSIDE)
def test_within_the_radius_all_test_functions_are_above_0(what):
    assert np.all(values(INSIDE[what]) > 0.0)


OUTSIDE = {
    "a fold": ([0.91, 0.2], 0),
    "a fold at 1": ([1.0, 0.2], 0),
    "a doubling": ([-0.91, 0.2], 1),
    "far beyond a doubling": ([-3.0, 0.2], 1),
    "a torus": (pair(0.91, 1.3), 2),
    "far beyond a torus": (pair(2.0, 2.0), 2),
    "a torus beside others": ([*pair(0.91, 0.4), 0.5, -0.5], 2),
}


@pytest.mark.parametrize("what", OUTSIDE)
def test_beyond_the_radius_the_test_function_of_its_kind_is_below_0(what):
    multipliers, index = OUTSIDE[what]
    found = values(multipliers)
    assert found[index] < 0.0
    assert np.all(np.delete(found, index) > 0.0)


def test_without_multipliers_nothing_moves_the_test_functions():
    found = stability(np.zeros(0, dtype=complex), np.zeros((0, 2), dtype=complex), 0.9)
    assert found.values == pytest.approx([1.0 / 0.1, 1.0, 1.0])
    assert found.slopes.tolist() == [[0.0, 0.0]] * 3


def test_the_test_functions_are_the_products_that_they_are_made_of():
    radius, multipliers = 0.95, np.array([*pair(0.7, 0.9), 0.3, -0.6])
    near, at, far = (np.prod(1.0 - multipliers / r).real for r in (radius, 1.0, -radius))
    tori = np.prod([1.0 - a * b / radius**2 for a, b in combinations(multipliers, 2)]).real
    wanted = [near * (2.0 * at - near) / 0.05, far, tori]
    assert values(multipliers, radius) == pytest.approx(wanted, rel=1e-12)


def test_the_order_of_multipliers_does_not_matter():
    rng = np.random.default_rng(9)
    multipliers = np.array([*pair(0.7, 0.9), 0.3, -0.6])
    slopes = np.array([*(rate := pair(0.2, 0.4)), 0.1, -0.3])[:, None] * np.ones(2)
    assert rate[0] == np.conj(rate[1])
    order = rng.permutation(4)
    one, two = stability(multipliers, slopes, 0.9), stability(multipliers[order], slopes[order], 0.9)
    for a, b in zip(one, two, strict=True):
        assert b == pytest.approx(a, rel=1e-12)


@pytest.mark.parametrize("margin", [1e-1, 1e-3, 1e-6])
def test_next_to_a_saddle_node_the_fold_function_grows_like_the_distance(margin):
    """There the multiplier is 1 - sqrt(distance): its slope is without bounds at the fold, that of the test is not."""
    at = margin**2  # distance at which the multiplier meets the radius
    slopes = []
    for distance in (at, 4.0 * at):
        root = np.sqrt(distance)
        found = stability(np.array([1.0 - root + 0j]), np.array([[-0.5 / root + 0j]]), 1.0 - margin)
        slopes.append(float(found.slopes[0, 0]))
    radius = 1.0 - margin
    # p(r) (2 p(1) - p(r)) over the margin, p(r) = (r - 1 + root)/r
    for distance, slope in zip((at, 4.0 * at), slopes, strict=True):
        ends = []
        for there in (distance * (1.0 + 1e-5), distance * (1.0 - 1e-5)):
            root = np.sqrt(there)
            p = (radius - 1.0 + root) / radius
            ends.append(p * (2.0 * root - p) / margin)
        assert slope == pytest.approx((ends[0] - ends[1]) / (2e-5 * distance), rel=1e-4)
    assert 0.4 < slopes[0] / slopes[1] < 2.5


def test_a_slope_of_rounding_counts_only_where_a_multiplier_is_not_faint():
    slopes = np.array([[1.0], [np.nan]])
    faint, strong = (stability(np.array([0.5, size + 0j]), slopes, 0.9).slopes for size in (1e-5, 2e-5))
    without = stability(np.array([0.5, 1e-5 + 0j]), np.array([[1.0], [0.0]]), 0.9).slopes
    assert faint.tolist() == without.tolist()
    assert np.isnan(strong).any()
