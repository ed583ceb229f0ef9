"""Relays, thermostats and neurons against closed forms: rests beyond the events of their mode are no attractors."""

from __future__ import annotations

import math

import numpy as np
import pytest

from saltus import HybridSystem, Mode, Transition, find_attractors, map_basins, simulate
from saltus.basins.attractors.found import AttractorOptions
from selection import guarding

GOLDEN = 0.381966


def relay(low_field, high_field, numbers, low, high):
    """A relay whose mode 'on' goes off where T rises through `high`, and whose mode 'off' goes on at `low`."""
    modes = {"on": Mode({"T": low_field}), "off": Mode({"T": high_field})}
    ways = [Transition("on", "off", f"T - ({high!r})", 1), Transition("off", "on", f"T - ({low!r})", -1)]
    return HybridSystem(("T",), numbers, modes, ways)


def searched(system, region, interval, **more):
    options = AttractorOptions(**{"interval": interval, "starts": 32, "samples": 200, **more})
    return find_attractors(system, {}, region, options=options)


def rests_of(found):
    return sorted(found.points[name][0].tolist() for name in found.names if found.kinds[name] == "rest")


def random_relay(seed, unit):
    """A linear relay, its admissible rests in the order of the modes, its cycle's period, and its upper bound."""
    rng = np.random.default_rng(seed)
    low, high = -rng.uniform(0.2, 1.0) * unit, rng.uniform(0.2, 1.0) * unit
    warm, cold = rng.uniform(-2.0, 3.0) * unit, rng.uniform(-3.0, 2.0) * unit
    k, m = rng.uniform(0.3, 2.0, 2)
    system = relay("-k*(T - A)", "-m*(T - B)", {"k": k, "m": m, "A": warm, "B": cold}, low, high)
    rests = [warm] * (warm < high) + [cold] * (cold > low)
    if rests:
        return system, rests, None, high
    period = math.log((warm - low) / (warm - high)) / k + math.log((high - cold) / (low - cold)) / m
    return system, rests, period, high


RELAYS = guarding(
    [(seed, 1.0) for seed in range(30)] + [(seed, unit) for unit in (1e-9, 1e9) for seed in range(4)],
    (1, 1.0), (8, 1.0), campaign=8,
)  # fmt: skip


@pytest.mark.parametrize(("seed", "unit"), RELAYS)
def test_a_random_relay_has_its_admissible_rests_or_its_cycle_and_no_other_attractor(seed, unit):
    system, rests, period, high = random_relay(seed, unit)
    interval = 0.37 if period is None else GOLDEN * period
    found = searched(system, {"T": (-4.0 * unit, 4.0 * unit)}, interval)
    assert np.ravel(rests_of(found)) == pytest.approx(sorted(rests), abs=1e-6 * unit)
    assert [orbit.period for orbit in found.orbits.values()] == pytest.approx([period] * (not rests), rel=1e-8)
    basins = map_basins(system, {}, {"T": (-4.0 * unit, 4.0 * unit, 80)}, found)
    assert basins.fractions()["undecided"] == 0.0
    if len(rests) == 2:  # a motion starts in the first mode that it may, 'on' below its upper bound
        ends = [float(found.points[basins.names[int(label)]][0, 0]) for label in basins.labels]
        assert ends == pytest.approx([rests[0 if high > T else 1] for T in basins.grid.axes[0]], abs=1e-6 * unit)


def test_a_thermostat_has_its_cycle_alone():
    numbers = {"hot": 30.0, "cold": 10.0}
    system = relay("-(T - hot)", "-(T - cold)", numbers, 18.0, 22.0)
    basins = map_basins(system, {}, {"T": (5.0, 35.0, 30)}, searched(system, {"T": (5.0, 35.0)}, 0.3))
    assert basins.attractors.names == ("limit cycle",)
    assert basins.attractors.orbits["limit cycle"].period == pytest.approx(2.0 * math.log(1.5), rel=1e-9)
    assert basins.fractions()["limit cycle"] == 1.0


def test_both_rests_of_a_nonlinear_relay_attract_where_both_modes_may_be():
    system = relay("-sinh(T + 0.4)", "-(T - 0.9) - (T - 0.9)**3", {}, -0.5, 1.0)
    basins = map_basins(system, {}, {"T": (-4.0, 4.0, 80)}, searched(system, {"T": (-4.0, 4.0)}, 0.37))
    assert np.ravel(rests_of(basins.attractors)) == pytest.approx([-0.4, 0.9], abs=1e-9)
    assert sorted(basins.fractions().values()) == [0.0, 0.0, 0.375, 0.625]


def oscillator(seed):
    """A planar relay, and the positions of its admissible rests."""
    rng = np.random.default_rng(seed)
    high, low = rng.uniform(0.2, 1.0), -rng.uniform(0.2, 1.0)
    d, k = rng.uniform(0.2, 1.5, 2).tolist(), rng.uniform(0.5, 2.0, 2).tolist()
    on, off = rng.uniform(-2.0, 2.5), rng.uniform(-2.5, 2.0)
    modes = {
        name: Mode({"x": "v", "v": f"-{stiffness!r}*(x - ({place!r})) - {damping!r}*v"})
        for name, stiffness, place, damping in zip(("on", "off"), k, (on, off), d, strict=True)
    }
    ways = [Transition("on", "off", f"x - ({high!r})", 1), Transition("off", "on", f"x - ({low!r})", -1)]
    return HybridSystem(("x", "v"), {}, modes, ways), sorted([on] * (on < high) + [off] * (off > low))


@pytest.mark.parametrize("seed", guarding(range(100, 124), 107, campaign=5))
def test_of_a_random_planar_relay_each_cell_ends_where_its_simulation_does(seed):
    system, rests = oscillator(seed)
    box = {"x": (-3.0, 3.0), "v": (-3.0, 3.0)}
    found = searched(system, box, 0.73)
    assert [x for x, _ in rests_of(found)] == pytest.approx(rests, abs=1e-9)
    basins = map_basins(system, {}, {name: (*ends, 20) for name, ends in box.items()}, found)
    assert basins.fractions()["undecided"] == 0.0
    for i, j in np.random.default_rng(seed).integers(0, 20, (6, 2)):
        start = [basins.grid.axes[0][i], basins.grid.axes[1][j]]
        late = simulate(system, {}, start, t_end=150.0)(np.linspace(120.0, 150.0, 61))[:, 0]
        name = basins.names[int(basins.labels[i, j])]
        assert (np.ptp(late) < 1e-3) == (found.kinds[name] == "rest")
        if found.kinds[name] == "rest":
            assert late[-1] == pytest.approx(found.points[name][0, 0], abs=1e-3)


def neuron(reset, drive="1.5", **more):
    return HybridSystem(
        ("v",), {}, {"m": Mode({"v": f"{drive} - v"})}, [Transition("m", "m", "v - 1", 1, reset)], **more
    )


def test_a_neuron_that_fires_has_no_rest_above_its_threshold():
    found = searched(neuron({"v": "0"}), {"v": (-1.0, 3.0)}, 0.3)
    assert found.names == ("limit cycle",)
    assert found.orbits["limit cycle"].period == pytest.approx(math.log(3.0), rel=1e-9)
    assert found.fates["limit cycle"] == found.fates["undecided"] == 16
    basins = map_basins(neuron({"v": "0"}), {}, {"v": (-1.0, 3.0, 30)}, found)
    assert basins.fractions() == {"limit cycle": 0.5, "diverged": 0.0, "undecided": 0.5}
    assert "stay beyond an event of their mode" in basins.undecided


def test_a_neuron_that_does_not_fire_rests():
    found = searched(neuron({"v": "0"}, "0.9"), {"v": (-1.0, 0.99)}, 0.3)
    assert rests_of(found) == [pytest.approx([0.9], abs=1e-9)]


@pytest.mark.campaign
def test_a_forced_neuron_has_no_attractor_above_its_threshold():
    system = neuron({"v": "0"}, "1.5 + 0.1*cos(s)", phase=("s", 6.5))
    found = searched(system, {"v": (-1.0, 0.9)}, None)
    assert found.names
    assert all(points.max() <= 1.0 for points in found.points.values())


@pytest.mark.parametrize("reset", [{}, {"v": "0.5 + v/2"}, {"v": "v + 0.1"}])
def test_a_rest_behind_an_event_that_lets_motions_through_is_one(reset):
    found = searched(neuron(reset), {"v": (-1.0, 0.9)}, 0.3)
    assert rests_of(found) == [pytest.approx([1.5], abs=1e-9)]
    assert found.fates["rest"] == 32


def test_a_ball_pressed_through_a_wall_rests_nowhere():
    system = HybridSystem(
        ("x", "v"), {}, {"free": Mode({"x": "v", "v": "2 - x - 0.3*v"})},
        [Transition("free", "free", "x - 1", 1, {"v": "-0.5*v"}, name="impact")],
    )  # fmt: skip
    assert rests_of(searched(system, {"x": (-1.0, 3.0), "v": (-1.0, 1.0)}, 0.7)) == []


def conditional_relay(high, when, unit=1.0):
    """A relay whose mode 'a' goes to 'b' where x rises through `high`, if `when` holds; z runs to 1 in both modes."""
    z, u = f"0.5*({unit!r} - z)", unit
    modes = {"a": Mode({"x": f"{2 * u!r} - x", "z": z}), "b": Mode({"x": f"{-u!r}", "z": z})}
    ways = [Transition("a", "b", f"x - {high * u!r}", 1, when=when), Transition("b", "a", f"x + {u!r}", -1)]
    return HybridSystem(("x", "z"), {}, modes, ways)


def ends_at_rest(x, z, high):
    """Whether a motion of the conditional relay in mode 'a' has z below 0 where it passes `high`, in the units of x."""
    passing = math.log((2.0 - x) / (2.0 - high))
    return 1.0 - (1.0 - z) * math.exp(-0.5 * passing) < 0.0


@pytest.mark.parametrize("unit", guarding([1.0, 1e-9, 1e9], 1.0, campaign=2))
def test_a_rest_behind_an_event_with_a_condition_attracts_what_passes_where_it_does_not_hold(unit):
    box = {"x": (-2.0 * unit, 0.5 * unit), "z": (-6.0 * unit, 2.0 * unit)}
    system = conditional_relay(1.0, "z", unit)
    found = searched(system, box, 0.37, starts=128)
    assert rests_of(found) == [pytest.approx([2.0 * unit, unit], abs=1e-6 * unit)]
    basins = map_basins(system, {}, {name: (*ends, 20) for name, ends in box.items()}, found)
    assert basins.fractions()["undecided"] == 0.0
    kinds = [[found.kinds[basins.names[int(label)]] == "rest" for label in row] for row in basins.labels]
    xs, zs = (axis / unit for axis in basins.grid.axes)
    assert kinds == [[ends_at_rest(x, z, 1.0) for z in zs] for x in xs]


def test_a_rest_behind_an_event_attracts_what_passes_through_a_narrow_gap_of_its_condition():
    system = conditional_relay(1.0, "(z + 3)**2 - 1e-6")  # open from -3.001 to -2.999: sampled states may miss it
    passing = math.log(2.0)  # from x = 0 to 1
    z = 1.0 - 4.0 * math.exp(0.5 * passing)
    found = searched(system, {"x": 0.0, "z": (z - 1e-3, z + 1e-3)}, 0.37)
    assert rests_of(found) == [pytest.approx([2.0, 1.0], abs=1e-6)]
    assert found.fates["rest"] == 32


def test_two_events_of_one_surface_whose_conditions_share_it_leave_no_rest_behind():
    z = "0.5*(1 - z)"
    modes = {"a": Mode({"x": "2 - x", "z": z}), "b": Mode({"x": "-1", "z": z}), "c": Mode({"x": "-2", "z": z})}
    ways = [
        Transition("a", "b", "x - 1", 1, when="z"), Transition("a", "c", "x - 1", 1, when="1e-300 - z"),
        Transition("b", "a", "x + 1", -1), Transition("c", "a", "x + 1", -1),
    ]  # fmt: skip
    found = searched(HybridSystem(("x", "z"), {}, modes, ways), {"x": (-2.0, 0.5), "z": (-6.0, 2.0)}, 0.37)
    assert rests_of(found) == []
    assert found.fates["limit cycle"] == 32


def test_a_rest_beyond_an_event_attracts_where_another_transition_lands_beyond():
    modes = {"a": Mode({"x": "2 - x"}), "b": Mode({"x": "-1"})}
    ways = [Transition("a", "b", "x - 1", 1), Transition("b", "a", "x + 1", -1, {"x": "1.5"})]
    found = searched(HybridSystem(("x",), {}, modes, ways), {"x": (-2.0, 0.9)}, 0.37)
    assert rests_of(found) == [pytest.approx([2.0], abs=1e-9)]
    assert found.fates["rest"] == 32


def carried_over(place):
    """A ball pressed to a wall at x = 1, and carried over it from `place`."""
    ways = [
        Transition("free", "free", "x - 1", 1, {"v": "-0.5*v"}, name="impact"),
        Transition("free", "free", f"x - ({place!r})", -1, {"x": "1.5", "v": "0"}, name="carried over"),
    ]
    return HybridSystem(("x", "v"), {}, {"free": Mode({"x": "v", "v": "2 - x - 0.6*v"})}, ways)


def test_a_rest_behind_a_wall_attracts_what_a_second_event_puts_there():
    system = carried_over(-1.0)
    found = searched(system, {"x": (-0.9, 0.9), "v": (-8.0, 2.0)}, 0.37)
    assert rests_of(found) == [pytest.approx([2.0, 0.0], abs=1e-9)]
    with pytest.warns(RuntimeWarning, match="'carried over' lands beyond event 'impact' of mode 'free'"):
        ahead = simulate(system, {}, [0.5, -6.0], t_end=60.0)(60.0)
    assert ahead == pytest.approx([2.0, 0.0], abs=1e-6)
    assert found.fates["rest"] > 0


@pytest.mark.campaign
def test_a_rest_beyond_an_event_attracts_where_a_kick_at_a_phase_lands_beyond():
    ways = [
        Transition("a", "a", "v - 1", 1, {"v": "0"}),
        Transition("a", "a", "sin(s)", 1, {"v": "1.2"}, name="kick", when="0.9 - v"),
    ]
    system = HybridSystem(("v",), {}, {"a": Mode({"v": "1.5 - v"})}, ways, phase=("s", 6.5))
    found = searched(system, {"v": (-1.0, 0.9)}, None)
    assert rests_of(found) == [pytest.approx([1.5], abs=1e-9)]
    assert found.fates["rest"] == 32


def test_a_second_event_that_no_motion_meets_puts_nothing_behind_a_wall():
    found = searched(carried_over(-30.0), {"x": (-1.0, 3.0), "v": (-4.0, 4.0)}, 0.37)
    assert rests_of(found) == []


@pytest.mark.campaign
def test_a_rest_attracts_what_comes_from_a_surface_outside_the_region():
    modes = {"a": Mode({"x": "2 - x"}), "b": Mode({"x": "-1"})}
    ways = [Transition("a", "b", "x - 1", 1), Transition("b", "a", "x + 7", -1, {"x": "1.5"})]
    found = searched(HybridSystem(("x",), {}, modes, ways), {"x": (0.0, 0.9)}, 0.37)
    assert rests_of(found) == [pytest.approx([2.0], abs=1e-9)]
    assert found.fates["rest"] == 32
