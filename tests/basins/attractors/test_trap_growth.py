"""Trapping regions enlarged as far as samples allow, by maps whose basins are known in closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from maps import round_about, strobed
from saltus import ConvergenceError
from saltus.basins.attractors.found import AttractorOptions
from saltus.basins.attractors.trap_growth import Enlarging
from saltus.basins.attractors.trapping import OrbitEllipsoids


def whole_of(trial, inner, core):
    """The ellipsoids without planes, grown and verified."""
    return trial.verified(trial.grown(inner), inner, core)


def beyond(trial, whole):
    """Larger ones cut by planes, whatever they cost."""
    return trial.beyond(whole, lambda *_: 1.0, lambda: 0.0)


INNER, CORE = round_about(0.0, 0.01), round_about(0.0, 0.002)


def enlarging(image, widest, *, samples, states=("x",)):
    """What enlarges regions of motions by a map, each followed for 200 strobes."""

    def settles(x, modes, region, longest):
        for _ in range(200):
            x = image(x)
        return region.holds(x)

    rng, search = np.random.default_rng(1), AttractorOptions(samples=samples)
    return Enlarging(strobed(image, states), settles, np.asarray(widest), np.empty((0, len(states))), rng, search)


def half_plane(x):
    """Motions end at 0 where x < 1, far away elsewhere."""
    return np.where(x[:, :1] < 1.0, 0.5 * x, np.array([9.0, 0.0]))


def test_an_ellipsoid_grows_to_the_basins_edge_and_no_further():
    # x^3 has the basin |x| < 1 of 0; rungs multiply the squared radius by sqrt 2, 0.8 of the last good one is kept
    found = whole_of(enlarging(lambda x: np.clip(x**3, -1e9, 1e9), [5.0], samples=2000), INNER, CORE)
    assert 0.8 / np.sqrt(2.0) <= found.level <= 0.8


def test_an_ellipsoid_that_is_all_basin_grows_to_the_width_asked_for():
    trial = enlarging(lambda x: 0.5 * x, [5.0], samples=500)
    found = whole_of(trial, INNER, CORE)
    assert 5.0 * np.sqrt(0.8) / 2.0**0.25 <= found.half_widths()[0, 0] <= 5.0 * np.sqrt(0.8)
    assert beyond(trial, found).half_widths()[0, 0] <= 5.0


def test_an_ellipsoid_that_motions_leave_at_every_size_is_refused():
    with pytest.raises(ConvergenceError, match="trapping region: .*motions leave it"):
        whole_of(enlarging(lambda x: x + 1.0, [5.0], samples=200), INNER, CORE)


def test_an_attractor_inside_the_ellipsoid_that_contracts_is_left_out():
    # beside 0, on which all else ends, what starts near 0.05 stays there
    inner, core = round_about(0.0, 0.1), round_about(0.0, 0.1 / 8.0)

    def image(x):
        return np.where(np.abs(x - 0.05) < 1e-3, 0.05 + 0.5 * (x - 0.05), 0.5 * x)

    found = whole_of(enlarging(image, [5.0], samples=4000), inner, core)
    assert core.level < found.level < 0.049**2


@pytest.mark.campaign
def test_beyond_a_plane_side_of_the_basin_the_ellipsoid_goes_on_growing():
    trial = enlarging(half_plane, [5.0, 5.0], samples=4000, states=("x", "y"))
    whole = whole_of(trial, round_about([0.0, 0.0], 0.01), round_about([0.0, 0.0], 0.002))
    assert 0.75 <= whole.half_widths()[0, 0] <= 0.9
    region = beyond(trial, whole)
    x = np.random.default_rng(2).uniform(-5.0, 5.0, (100_000, 2))
    held = region.holds(x)
    assert np.mean(x[held, 0] >= 1.0) < 3.0 / 4000
    assert x[held, 0].min() < -1.5
    assert held.sum() > 2.0 * whole.holds(x).sum()
    # of a circle with a side cut off at 1, at least two fifths are left
    assert np.sqrt(region.level) > 1.5
    assert region.share(20_000, np.random.default_rng(3)) >= 0.35


def test_what_is_measured_is_the_part_that_ends_elsewhere():
    trial = enlarging(half_plane, [5.0, 5.0], samples=4000, states=("x", "y"))
    found, followed = trial.elsewhere(round_about([0.0, 0.0], 1.5), round_about([0.0, 0.0], 0.1), 20_000)
    assert followed == 20_000
    beyond = (np.arccos(2.0 / 3.0) - 2.0 / 3.0 * np.sqrt(5.0) / 3.0) / np.pi  # of a disc, past 2/3 of its radius
    assert found / 20_000 == pytest.approx(beyond, abs=3.0 * np.sqrt(beyond * (1.0 - beyond) / 20_000))


def test_a_sample_from_which_no_motion_may_start_measures_nothing():
    trial = enlarging(half_plane, [5.0, 5.0], samples=4000, states=("x", "y"))
    trial.ensemble.admits = lambda x: x[0] < 0.0 or x[1] < 0.0
    found, followed = trial.elsewhere(round_about([1.5, 0.0], 0.3), round_about([0.0, 0.0], 0.1), 20_000)
    assert found == followed == pytest.approx(10_000, abs=3.0 * np.sqrt(5000.0))


def test_states_that_motions_entered_and_left_are_cut_out_too():
    trial = enlarging(lambda x: 0.5 * x, [5.0, 5.0], samples=500, states=("x", "y"))
    whole, region = round_about([0.0, 0.0], 1.0), round_about([0.0, 0.0], 2.0)
    left_out = np.array([[1.5, 0.1], [0.0, -1.6], [1.7, 0.1]])
    found = trial.without(region, left_out, whole)
    assert not found.holds(left_out).any()
    assert found.offsets[0] == pytest.approx(np.sqrt(0.8) * np.array([np.hypot(1.5, 0.1), 1.6]))
    assert found.holds(np.array([[-1.7, 0.5], [1.0, 0.1]])).all()
    # nearer than the whole region no plane is left out by samples: they all end in it
    assert trial.without(region, np.full((40, 2), [1.5, 0.1]), whole).offsets.shape == (1, 1)


def test_too_many_planes_leave_the_whole_region():
    trial = enlarging(lambda x: 0.5 * x, [5.0, 5.0], samples=500, states=("x", "y"))
    angles = np.linspace(0.0, 2.0 * np.pi, 200, endpoint=False)
    whole, around = round_about([0.0, 0.0], 1.0), 1.01 * np.column_stack([np.cos(angles), np.sin(angles)])
    assert trial.without(round_about([0.0, 0.0], 2.0), around, whole) is whole


def test_a_state_is_cut_out_of_every_ellipsoid_that_holds_it_and_of_no_other():
    metrics = np.stack([np.eye(2)] * 3)
    region = OrbitEllipsoids(np.array([[0.0, 0.0], [1.0, 0.0], [9.0, 0.0]]), metrics, 1.0)
    x = np.array([[0.4, 0.0], [0.0, 5.0]])
    found = region.cut(x, 1.0)  # a plane through the state itself leaves it out, too
    assert not found.holds(x).any()
    assert found.offsets.tolist() == [[pytest.approx(0.4)], [pytest.approx(0.6)], [1.0]]
    assert not found.normals[2].any()


def test_an_ellipsoid_holds_motions_in_its_mode_where_it_has_one():
    region = replace(OrbitEllipsoids(np.zeros((2, 1)), np.ones((2, 1, 1)), 1.0), modes=np.array([0, 2]))
    assert region.holds(np.zeros((3, 1))).all()
    assert region.holds(np.zeros((3, 1)), np.array([0, 1, 2])).tolist() == [True, False, True]


def test_samples_of_a_cut_ellipsoid_are_uniform_in_what_is_left():
    rng = np.random.default_rng(4)
    metrics = np.array([[[2.0, 1.0], [0.0, 0.5]], [[1.0, 0.0], [0.0, 3.0]]])
    whole = OrbitEllipsoids(np.array([[1.0, 2.0], [-4.0, 0.0]]), metrics, 1.0)
    region = whole.cut(np.array([[-4.0, 1e-9]]), 1.0)  # half of the second ellipsoid, and none of the first
    x = region.samples(20_000, rng)
    first, second = np.split(x, 2)
    assert region.holds(x).all()
    assert region.offsets.tolist() == [[1.0], [pytest.approx(3e-9)]]
    assert second[:, 1].max() < 1e-8
    assert np.mean(second[:, 0] < -4.0) == pytest.approx(0.5, abs=0.015)
    assert np.mean(first[:, 1] < 2.0) == pytest.approx(0.5, abs=0.015)
    assert region.share(20_000, rng) == pytest.approx(0.5, abs=0.015)
