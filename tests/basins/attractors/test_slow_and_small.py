"""Basins of systems far from the usual: weakly damped, in small or large units, slow, conservative, at rest."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import systems
from saltus import HybridSystem, InputError, Mode, find_attractors, map_basins
from saltus.basins.attractors import search as recurrence
from saltus.basins.attractors.found import AttractorOptions
from saltus.basins.map.cost import estimate_cost
from saltus.basins.map.labelling import units_of
from saltus.basins.map.patience import decay_periods, patience_for
from saltus.options import BasinOptions
from saltus.results import Attractors

FEW = AttractorOptions(starts=64, samples=300)

QUICK = {"options": FEW}


@pytest.fixture(scope="module")
def forced():
    """x'' + c x' + k x + h x^3 = A cos(w t)."""
    field = {"x": "v", "v": "A*cos(s) - c*v - k*x - h*x**3"}
    numbers = {"c": 1.0 / 300.0, "k": 1.0, "h": 0.1, "A": 0.01, "w": 1.1}
    return HybridSystem(("x", "v"), numbers, {"free": Mode(field)}, phase=("s", "w"), name="forced oscillator")


@pytest.fixture(scope="module")
def free():
    """x'' + (c + mu (x^2 - 1)) x' + k x = 0."""
    field = {"x": "v", "v": "-k*x - (c + mu*(x**2 - 1))*v"}
    return HybridSystem(("x", "v"), {"c": 0.1, "mu": 0.0, "k": 1.0}, {"free": Mode(field)}, name="free oscillator")


@pytest.fixture(scope="module")
def resonant(forced):
    """Basins of a Duffing oscillator of quality 300, on its two branches, in a box ten times as wide as the motions."""
    return map_basins(forced, {}, {"x": (-10, 10, 40), "v": (-10, 10, 40)}, QUICK)


@pytest.mark.campaign
def test_no_cell_of_a_weakly_damped_oscillator_is_undecided(resonant):
    assert resonant.attractors.names == ("period-1 A", "period-1 B")
    assert resonant.fractions()["undecided"] == 0.0
    assert resonant.undecided == ""
    decay = math.exp(-math.pi / 300.0 / 1.1)  # of the linear oscillator; both multipliers have this modulus
    assert resonant.attractors.decays == pytest.approx(dict.fromkeys(resonant.attractors.names, decay), rel=1e-9)
    assert resonant.inputs["longest"] > 4.0 * math.log(2.0) / -math.log(decay)
    assert "4 times the" in resonant.inputs["longest_reason"]
    assert f"longest {resonant.inputs['longest']} periods: 4 times the" in repr(resonant)


@pytest.mark.campaign
def test_why_cells_are_undecided_is_told_and_kept(forced, resonant, tmp_path):
    grid = {"x": (-10, 10, 20), "v": (-10, 10, 20)}
    short = map_basins(forced, {}, grid, resonant.attractors, options=BasinOptions(longest=50))
    assert short.fractions()["undecided"] > 0.2
    assert short.undecided.endswith("reach no trapping region within 50 periods")
    assert f"undecided: {short.undecided}" in repr(short)
    assert "longest 50 periods: as given" in repr(short)
    stored = map_basins(
        forced, {}, grid, resonant.attractors, options=BasinOptions(longest=50), path=tmp_path / "short.zarr"
    )
    assert stored.undecided == short.undecided
    assert type(short).load(short.save(tmp_path / "short.nc")).undecided == short.undecided


@pytest.mark.campaign
def test_attractors_keep_their_decay_in_a_file(resonant, tmp_path):
    again = Attractors.load(resonant.attractors.save(tmp_path / "found.nc"))
    assert dict(again.decays) == dict(resonant.attractors.decays)
    assert (again.slowest, again.scale) == (resonant.attractors.slowest, resonant.attractors.scale)


@pytest.mark.campaign
@pytest.mark.parametrize(("length", "time"), [(1e-9, 1e-6), (1e9, 1.0), (1e-3, 1e3)])
def test_units_of_length_and_time_change_no_label(forced, resonant, length, time):
    numbers = {"c": 1.0 / 300.0 / time, "k": time**-2.0, "h": 0.1 / (length * time) ** 2, "A": 0.01 * length / time**2}
    ends = {"x": 10.0 * length, "v": 10.0 * length / time}
    grid = {name: (-end, end, 40) for name, end in ends.items()}
    found = map_basins(forced, numbers | {"w": 1.1 / time}, grid, QUICK)
    assert found.attractors.names == resonant.attractors.names
    # motions beside the boundary are followed for thousands of periods; rounding alone moves some cells
    assert np.mean(found.labels != resonant.labels) < 0.005
    assert set(np.unique(found.labels)) == {0, 1}


def test_a_frozen_state_has_the_size_that_motions_give_it(forced):
    length, time = 1e-9, 1e-6
    numbers = {"c": 0.3 / time, "k": time**-2.0, "h": 0.0, "A": length / time**2, "w": 1.1 / time}
    found = find_attractors(
        forced, numbers, {"x": (-length, length), "v": 0.0}, options=AttractorOptions(starts=16, samples=100)
    )
    assert found.scale[0] == length
    assert 1e-4 < found.scale[1] < 1e-2


def test_units_are_steps_of_a_thousand():
    assert units_of((5.0, 0.04, 31.0, 2.2e-9, 3e8)) == pytest.approx((1.0, 1.0, 1.0, 1e-9, 1e9))
    assert units_of(None) is None


def test_a_state_that_does_not_move_is_at_rest_also_in_a_forced_system(forced, free):
    still = find_attractors(forced, {"A": 0.0, "c": 0.5}, {"x": (-1, 1), "v": (-1, 1)}, options=FEW)
    assert dict(still.kinds) == {"rest": "rest"}
    moving = find_attractors(forced, {"A": 1e-9, "c": 0.5}, {"x": (-1, 1), "v": (-1, 1)}, options=FEW)
    assert dict(moving.kinds) == {"period-1": "period-1"}
    damped = find_attractors(free, {}, {"x": (-1, 1), "v": (-1, 1)}, options=replace(FEW, interval=1.0))
    assert dict(damped.kinds) == {"rest": "rest"}
    assert damped.decays["rest"] == pytest.approx(math.exp(-0.05), rel=1e-6)


@pytest.mark.parametrize("rate", [1e-8, 1e8])
def test_rates_far_from_one_are_as_good_as_any_if_the_interval_fits(free, rate):
    grid = {"x": (-1, 1, 20), "v": (-rate, rate, 20)}
    found = map_basins(free, {"k": rate**2, "c": rate}, grid, QUICK, options=BasinOptions(interval=1.0 / rate))
    assert found.fractions() == {"rest": 1.0, "diverged": 0.0, "undecided": 0.0}


def test_where_nothing_attracts_that_is_told(forced, free):
    region = {"x": (-1, 1), "v": (-1, 1)}
    told = "must be one with attractors: along 8 motions volumes change by less than 1 % in the 4000 periods followed"
    with pytest.raises(InputError, match=told):
        find_attractors(forced, {"c": 0.0}, region, options=FEW)
    with pytest.raises(InputError, match=told):
        find_attractors(free, {"c": 0.0}, region, options=replace(FEW, interval=1.0))
    with pytest.raises(InputError, match=f"{told}; it conserves them, or the interval is far shorter than its decay"):
        find_attractors(free, {"k": 1e-16, "c": 1e-8}, region, options=replace(FEW, interval=1.0))
    with pytest.raises(InputError, match=told):
        find_attractors(systems.ball(), {"e": 1.0}, {"z": (0.1, 2), "v": (-1, 1)}, options=replace(FEW, interval=1.0))


@pytest.mark.campaign
def test_a_limit_cycle_to_which_motions_creep_is_one_attractor(free):
    found = map_basins(
        free, {"c": 0.0, "mu": 0.01}, {"x": (-3, 3, 16), "v": (-3, 3, 16)}, QUICK, options=BasinOptions(interval=1.0)
    )
    assert found.fractions() == {"limit cycle": 1.0, "diverged": 0.0, "undecided": 0.0}
    # the multiplier of van der Pol's cycle is exp(-2 pi mu), to order mu^2
    assert found.attractors.decays["limit cycle"] == pytest.approx(math.exp(-0.01), rel=1e-4)
    assert np.hypot(*found.attractors.points["limit cycle"].T) == pytest.approx(2.0, abs=0.02)


def test_all_motions_that_diverge_leave_no_attractor(free):
    found = map_basins(free, {"c": -0.5}, {"x": (1, 2, 8), "v": (1, 2, 8)}, QUICK, options=BasinOptions(interval=1.0))
    assert found.fractions() == {"diverged": 1.0, "undecided": 0.0}


@pytest.mark.campaign
def test_patience_is_four_times_the_decay_within_its_bounds(resonant):
    found = resonant.attractors
    label, decay = found.labels["period-1 A"], found.decays["period-1 A"]
    low, high = np.array([-10.0, -10.0]), np.array([10.0, 10.0])
    short, long = (decay_periods(found.traps, label, d, low, high) for d in (decay, decay**0.1))
    assert long == pytest.approx(10.0 * short)
    assert patience_for(found, {"x": (-1e-9, 1e-9), "v": (-1e-9, 1e-9)}).periods >= 200
    slow = Attractors(**{**vars(found), "decays": {"period-1 A": 1.0 - 1e-9}})
    most = patience_for(slow, {"x": (-10, 10), "v": (-10, 10)})
    assert most.periods == 100_000
    assert most.reason.startswith("the most by default, less than 4 times the ")


def test_a_search_tells_how_far_it_is_and_asks_for_no_more_samples_than_are_worth_it(forced):
    seen = []
    region = {"x": (-2, 2), "v": (-2, 2)}
    few = find_attractors(
        forced, {"c": 0.3}, region, options=AttractorOptions(starts=16, motions=100), progress=seen.append
    )
    many = find_attractors(forced, {"c": 0.3}, region, options=AttractorOptions(starts=16, motions=10**8))
    assert [told.done for told in seen] == sorted(told.done for told in seen)
    assert all(told.done <= told.total for told in seen)
    assert {told.text for told in seen} >= {"looking for attractors", "measuring trapping regions"}
    assert (seen[-1].done, seen[-1].left) == (seen[-1].total, 0.0)
    assert "measured: 1000 samples" in few.notes["period-1"]
    assert "measured: 20000 samples" in many.notes["period-1"]


def test_an_estimate_counts_the_search(forced, resonant):
    grid = {"x": (-2, 2, 20), "v": (-2, 2, 20)}
    cost = estimate_cost(forced, {"c": 0.3}, grid, QUICK, seconds=0.0)
    assert cost.search_seconds > 0.0
    assert cost.seconds() == cost.search_seconds + cost.cells / cost.orbits_per_second
    assert estimate_cost(forced, {}, grid, resonant.attractors, seconds=0.0).search_seconds == 0.0


@pytest.mark.campaign
def test_an_angle_that_runs_on_makes_no_endless_copies_of_a_transient(monkeypatch):
    """A driven pendulum turns over again and again, into one copy of its well after another, for a very long time."""
    seen = []
    monkeypatch.setattr(
        recurrence.AttractorSearch, "_stay", lambda search, found: seen.append(found) or recurrence.Stay(1, 1.0, 1)
    )
    pendulum = HybridSystem(
        ("x", "v"), {}, {"m": Mode({"x": "v", "v": "-0.2*v - sin(x) + 1.66*cos(s)"})}, phase=("s", "1")
    )
    found = find_attractors(pendulum, {}, {"x": (-3.0, 3.0), "v": (-3.0, 3.0)}, options=FEW)
    assert 1 <= len(seen) <= 16
    assert set(found.orbits) == set(found.names)
