"""Ellipsoids and boxes about attractors of maps whose basins are known in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from maps import round_about, strobed
from saltus import HybridSystem, Mode, Transition, find_orbit, simulate
from saltus.basins.attractors.trapping import (
    OrbitEllipsoids,
    contracting,
    core_of,
    largest_multiplier,
    map_jacobians,
    metric_of,
    orbit_jacobians,
)
from saltus.basins.attractors.visited_boxes import boxes_along


@pytest.mark.parametrize("period", [1, 3])
def test_the_metric_shrinks_distances_at_every_strobe_of_a_linear_map(period):
    rng = np.random.default_rng(period)
    jacobians = rng.standard_normal((period, 3, 3))
    once_round = np.linalg.multi_dot([np.eye(3), *jacobians[::-1]])
    jacobians *= (0.9 / np.abs(np.linalg.eigvals(once_round)).max()) ** (1.0 / period)
    points = rng.standard_normal((period, 3))
    ellipsoid = metric_of(points, jacobians, np.ones(3))
    apart = rng.standard_normal((1000, 3))
    for k in range(period):
        following = (k + 1) % period
        before = ellipsoid.sizes(points[k] + apart)[:, k]
        after = ellipsoid.sizes(points[following] + apart @ jacobians[k].T)[:, following]
        assert np.all(after < 0.95 ** (2.0 / period) * before)  # halfway between the multiplier and 1


def test_an_unstable_orbit_has_no_metric():
    assert metric_of(np.zeros((1, 2)), np.diag([0.5, 1.01])[None], np.ones(2)) is None


def test_differences_are_the_jacobians_of_a_smooth_map():
    ensemble = strobed(lambda x: np.column_stack([1.4 - x[:, 0] ** 2 + 0.3 * x[:, 1], x[:, 0]]), ("x", "y"))
    points = np.array([[0.7, -0.2], [-1.1, 0.4]])
    found = map_jacobians(ensemble, points, np.array([2.0, 0.5]))
    expected = [[[-2.0 * x, 0.3], [1.0, 0.0]] for x, _ in points]
    assert found == pytest.approx(np.array(expected), abs=1e-9)


def wall(frequency, gap):
    """A damped oscillator that hits a wall, and loses a fifth of its speed there."""
    return HybridSystem(
        ("x", "v"),
        {"w": frequency, "g": gap},
        {"free": Mode({"x": "v", "v": "-x - 0.02*v + 0.5*cos(s)"})},
        [Transition("free", "free", "x - g", 1, {"v": "-0.8*v"}, name="impact")],
        phase=("s", "w"),
    )


@pytest.mark.parametrize(("frequency", "gap", "start"), [(2.7, 0.0, [-1.0, 0.0]), (3.9, 0.2, [0.1, 0.4])])
def test_an_orbits_jacobians_shrink_areas_by_damping_and_impacts_and_multiply_to_its_multipliers(frequency, gap, start):
    system, period = wall(frequency, gap), 2.0 * np.pi / frequency
    orbit = find_orbit(system, {}, start, settle=20_000)
    points, impacts, x = [], [], orbit.x0
    for _ in range(orbit.form.turns):
        motion = simulate(system, {}, x, periods=1)
        points.append(x)
        impacts.append(int((motion.events["kind"] == "event").sum()))
        x = motion.x_end[:2]
    assert sum(impacts) >= 1
    jacobians = orbit_jacobians(orbit, np.array(points))
    # Liouville, and the determinant e^2 of an impact's saltation matrix
    areas = 0.64 ** np.array(impacts) * np.exp(-0.02 * period)
    assert np.linalg.det(jacobians) == pytest.approx(areas, rel=1e-8)
    assert largest_multiplier(jacobians) == pytest.approx(np.abs(orbit.multipliers).max(), rel=1e-6)


def test_samples_fill_the_ellipsoid_evenly():
    metrics = np.array([[[2.0, 1.0], [0.0, 0.5]], [[1.0, 0.0], [0.0, 3.0]]])
    ellipsoid = OrbitEllipsoids(np.array([[1.0, 2.0], [-4.0, 0.0]]), metrics, 0.25)
    x = ellipsoid.samples(20_000, np.random.default_rng(0))
    sizes = ellipsoid.sizes(x)
    own = np.concatenate([sizes[:10_000, 0], sizes[10_000:, 1]])
    assert own.max() < 0.25
    assert np.mean(own < 0.25 / 4.0) == pytest.approx(0.25, abs=3.0 * np.sqrt(0.25 * 0.75 / 20_000))
    assert np.abs(x[:10_000] - [1.0, 2.0]).max(axis=0) == pytest.approx(ellipsoid.half_widths()[0], rel=0.01)


def test_samples_contract_up_to_where_the_map_does():
    # |x/2 + 10 x^3| < |x| for x^2 < 1/20
    ensemble = strobed(lambda x: 0.5 * x + 10.0 * x**3)
    found = contracting(ensemble, round_about(0.0, 1.0), np.random.default_rng(0))
    assert 0.05 / 4.0 <= found.level <= 0.05


def test_a_map_that_contracts_nowhere_is_told():
    ensemble = strobed(lambda x: np.where(np.abs(x) > 0.0, 1.5 * x, x))
    assert contracting(ensemble, round_about(0.0, 1.0), np.random.default_rng(0)) is None


def test_the_core_is_what_motions_soon_reach():
    inner = round_about([0.0, 0.0], 0.3)
    levels = [
        core_of(strobed(lambda x, rate=rate: rate * x, ("x", "y")), inner, np.random.default_rng(0)).level / inner.level
        for rate in (0.5, 0.996, 0.9999)
    ]
    assert levels == pytest.approx([1.0 / 64.0, 1.0 / 4.0, 1.0])


GOLDEN = 2.0 * np.pi * 0.3819660113


def turned(x):
    """A circle of radius 1 that attracts, turned by the golden angle."""
    radius = np.linalg.norm(x, axis=1, keepdims=True)
    c, s = np.cos(GOLDEN), np.sin(GOLDEN)
    return (x @ np.array([[c, s], [-s, c]])) * (1.0 + 0.5 * (1.0 - radius))


def test_boxes_hold_the_strobes_of_a_closed_curve_and_no_state_away_from_it():
    angles = GOLDEN * np.arange(1024)
    cloud = np.column_stack([np.cos(angles), np.sin(angles)])
    boxes = boxes_along(
        strobed(turned, ("x", "y")), {3: cloud}, np.zeros((1, 2)), np.ones(2), 16, np.random.default_rng(0)
    )
    assert boxes.covered[3] >= 0.99
    cells = boxes.cells
    assert cells.visits == 16
    assert set(cells.labels.tolist()) == {3}
    assert cells.boxes.tolist() == sorted(cells.boxes.tolist())
    centres = cells.origin + (cells.boxes + 0.5) * cells.size
    assert np.abs(np.linalg.norm(centres, axis=1) - 1.0).max() < np.linalg.norm(cells.size)


def test_boxes_of_two_attractors_share_none():
    angles = GOLDEN * np.arange(1024)
    circle = np.column_stack([np.cos(angles), np.sin(angles)])

    def image(x):
        right = x[:, :1] > 0.0
        middle = np.where(right, [1.1, 0.0], [-1.1, 0.0])
        return middle + turned(x - middle)

    shift = np.array([1.1, 0.0])
    clouds = {0: circle - shift, 1: circle + shift}
    cells = boxes_along(
        strobed(image, ("x", "y")), clouds, np.empty((0, 2)), np.ones(2), 16, np.random.default_rng(0)
    ).cells
    assert len(np.unique(cells.boxes, axis=0)) == len(cells.boxes)
    assert set(cells.labels.tolist()) == {0, 1}


def test_samples_keep_a_state_that_their_mode_lacks_and_fill_the_rest_evenly():
    metric = np.array([[2.0, 0.5, 0.3], [0.0, 1.5, -0.4], [0.0, 0.0, 1.0]])
    region = OrbitEllipsoids(np.array([[1.0, 0.0, 2.0]]), metric[None], 0.25, absent=np.array([[False, True, False]]))
    x = region.samples(20_000, np.random.default_rng(4))
    assert np.all(x[:, 1] == 0.0)
    sizes = region.sizes(x)[:, 0] / 0.25
    # uniform in a disc: the squared radius is uniform
    assert np.sort(sizes)[[5000, 10_000, 15_000]] == pytest.approx([0.25, 0.5, 0.75], abs=0.015)
    assert sizes.max() < 1.0
