"""Event-driven simulation against closed forms, other solvers, and its own rules."""

from __future__ import annotations

import math
import warnings

import numpy as np
import pytest

import saltus
import saltus.result
import systems
from oracles.closed_forms import TableJump
from saltus.errors import ChatteringError, DivergenceError, InputError
from saltus.flow import simulation
from saltus.flow.event_logs import events_after
from saltus.flow.simulation import simulate
from saltus.options import SimulationOptions
from saltus.system.hybrid import HybridSystem, Mode, Transition
from systems import settle

TIGHT = {"tolerance": (1e-12, 1e-14)}
TIGHT_STEPS = {"tolerance": (1e-12, 1e-14)}


def one_mode(field, transitions=(), *, parameters=None, phase=None, domain=None, **options):
    """A system of one mode 'm', transitions given as (event, direction, reset, when)."""
    rows = [Transition("m", "m", t[0], t[1], t[2], t[3], f"t{i}") for i, t in enumerate(transitions)]
    return HybridSystem(tuple(field), parameters or {}, {"m": Mode(field, domain)}, rows, phase=phase, **options)


def named(trajectory, name):
    return trajectory.events[trajectory.events["name"] == name]


# known answers


@pytest.mark.parametrize(
    ("al", "be", "r0", "r1", "period"),
    [
        (1.0, 0.5, 0.583821306681, 0.970115433417, 5.574534498412),
        (1.0, 2.0, 1.934147003190, 1.021316191287, 4.810271605994),
        (1.0, 5.0, 4.905118551832, 1.035629758769, 4.199141383946),
        (0.5, 2.0, 1.634046186660, 1.017053918799, math.pi + 1.462196263879),
    ],
)
def test_two_fields_settle_to_the_known_orbit(two_fields, al, be, r0, r1, period):
    motion = simulate(two_fields, {"al": al, "be": be}, [0.0, 1.5], mode="left", t_end=120.0, **TIGHT)
    to_left, to_right = named(motion, "to_left"), named(motion, "to_right")
    assert to_left["before"][-1] == pytest.approx([0.0, r0], abs=2e-11)
    assert to_right["before"][-1] == pytest.approx([0.0, -r1], abs=2e-11)
    assert np.diff(to_left["time"])[-1] == pytest.approx(period, abs=2e-11)


def test_impact_oscillator_keeps_its_closed_form_orbit(impact_oscillator):
    k, c, d, e, w, big_a, u = 1.0, 0.1, 1.0, 0.8, 1.0, 1.0, 1.6957329376
    period = 2.0 * math.pi / w
    root = math.sqrt(k - c * c / 4.0)
    decay, cos, sin = math.exp(-c * period / 2.0), math.cos(root * period), math.sin(root * period)
    m = decay * np.array([[cos + c / 2 / root * sin, sin / root], [-k / root * sin, cos - c / 2 / root * sin]])
    al, be = np.linalg.solve(m - np.eye(2), [0.0, 1.0 + e])
    f, g = (k - w * w) * (d - al * u) - c * (be + e) * u, (k - w * w) * (be + e) * u / w + c * w * (d - al * u)
    start = [d, -e * u, math.atan2(g, f)]
    motion = simulate(impact_oscillator, {"A": big_a}, start, periods=200, **TIGHT)
    impacts = named(motion, "impact")
    assert start == pytest.approx([1.0, -1.35658635, 0.07595216], abs=5e-9)
    assert impacts["normal_velocity"][-1] == pytest.approx(u, abs=1e-9)
    assert np.diff(impacts["time"]) == pytest.approx(period, abs=1e-8)


def test_dropped_ball_chatters_at_the_closed_form_time(ball):
    with pytest.raises(ChatteringError, match=r"chattering: events accumulate at t = 4.24264068") as error:
        simulate(ball, None, [1.0, 0.0], t_end=10.0)
    assert error.value.time == pytest.approx(3.0 * math.sqrt(2.0), abs=1e-11)
    assert error.value.state == pytest.approx([0.0, 0.0], abs=1e-12)
    assert error.value.mode == "flight"


@pytest.mark.parametrize("e", [0.05, 0.3, 0.8, 0.95])
def test_chattering_time_is_right_for_any_restitution(ball, e):
    with pytest.raises(ChatteringError) as error:
        simulate(ball, {"e": e}, [1.0, 0.0], t_end=1e6)
    assert error.value.time == pytest.approx(math.sqrt(2.0) * (1 + e) / (1 - e), rel=1e-10)


def test_an_oscillator_pressed_to_its_stop_chatters_there(impact_oscillator):
    with pytest.raises(ChatteringError) as error:
        simulate(impact_oscillator, {"w": 2.65, "A": 6.03435572809818}, [1.0, -1e-3, 1.0], periods=10)
    # hops of the speeds u, e u, ... under an acceleration nearly constant
    pressed = 6.03435572809818 * math.cos(1.0) - 1.0
    assert error.value.time == pytest.approx(2e-3 / pressed / (1.0 - 0.8), rel=2e-2)
    assert error.value.state[0] == pytest.approx(1.0, abs=1e-12)


def test_ball_on_table_keeps_its_period_one_jump(ball_on_table):
    a, e = 1.2, 0.5
    angle = math.acos(math.pi * (1 - e) / (1 + e) / a)
    motion = simulate(ball_on_table, {"a": a, "e": e}, [a * math.sin(angle), math.pi, angle], periods=100, **TIGHT)
    impacts = named(motion, "impact")
    assert np.diff(impacts["time"]) == pytest.approx(2.0 * math.pi, abs=1e-9)
    assert impacts["after"][-1] == pytest.approx([a * math.sin(angle), math.pi, angle], abs=1e-10)


def test_block_on_belt_sticks_and_slips_for_the_known_times(stick_slip):
    motion = simulate(stick_slip, None, [1.0, 0.3], mode="slip", t_end=40.0, **TIGHT)
    times = motion.events["time"]
    assert list(motion.events["name"][:4]) == ["catch", "release", "catch", "release"]
    assert np.diff([0.0, *times])[::2] == pytest.approx(4.222431654131, abs=1e-11)
    assert np.diff([0.0, *times])[1::2] == pytest.approx(3.333333333333, abs=1e-11)
    x = motion(np.linspace(0.0, 4.2224316, 4001))[:, 0]
    assert (x.min(), x.max()) == pytest.approx((-0.083095189485, 1.083095189485), abs=1e-6)


def test_relay_oscillates_with_the_known_period(relay):
    motion = simulate(relay, None, [0.1, 0.0, 0.5], t_end=100.0, **TIGHT)
    rising = named(motion, "switch_down")
    assert np.diff(rising["time"])[-1] == pytest.approx(3.679750670865, abs=2e-11)
    assert rising["before"][-1] == pytest.approx([0.725867926, 0.290630922, 0.0], abs=1e-9)


def test_carried_map_is_the_map_itself():
    system = systems.carried_map(("x",), {"r": 3.7}, {"x": "r*x*(1 - x)"})
    motion = simulate(system, None, [0.3, 0.0], t_end=40.5)
    x, orbit = 0.3, []
    for _ in range(40):
        x = 3.7 * x * (1.0 - x)
        orbit.append(x)
    assert motion.events["after"][:, 0] == pytest.approx(orbit, rel=1e-8)
    assert motion.events["time"] == pytest.approx(np.arange(1, 41), abs=1e-12)


@pytest.mark.parametrize(("n", "omega", "pair"), [(1, 1.0, None), (2, 1.15, (-0.02950, 0.48413))])
def test_cantilever_settles_to_the_tapping_orbit(n, omega, pair):
    system = systems.afm(n)
    p = system.parameter_vector({"Omega": omega})
    x, mode = settle(system, p, np.zeros(2 * n), 0, periods=400)
    log = events_after(system, p, x, mode, periods=3)
    assert log.transition.tolist() == [0, 1, -1] * 3
    assert log.x_end == pytest.approx(x, abs=1e-8)
    if pair is not None:
        assert (x[1], x[3]) == pytest.approx(pair, abs=1e-5)


# crossings


def test_free_fall_lands_at_the_closed_form_time(ball):
    for z in (1e-6, 0.37, 5.0, 1e5):
        landing = simulate(ball, None, [z, 0.0], t_end=1.5 * math.sqrt(2.0 * z)).events["time"][0]
        assert landing == pytest.approx(math.sqrt(2.0 * z), rel=1e-12)


def test_oscillator_crosses_levels_at_the_closed_form_times():
    system = one_mode({"x": "v", "v": "-x"}, [("x - c", 0, {}, None)], parameters={"c": 0.3})
    for c in (0.3, 0.9, 0.999999):
        times = simulate(system, {"c": c}, [0.0, 1.0], t_end=40.0, tolerance=(1e-13, 1e-15)).events["time"]
        turns = 2.0 * math.pi * np.arange(7)
        wanted = np.sort(np.concatenate([turns + math.asin(c), turns + math.pi - math.asin(c)]))
        assert times == pytest.approx(wanted[wanted < 40.0], abs=1e-12 / math.sqrt(1.0 - c * c))


@pytest.mark.parametrize("depth", [1e-3, 1e-6, 1e-9])
def test_a_shallow_dip_inside_one_large_step_is_found(depth):
    system = one_mode({"z": "v", "v": "g"}, [("z", 0, {}, None)], parameters={"g": 2.0})
    motion = simulate(system, None, [1.0 - depth, -2.0], t_end=5.0)
    # a rounding of 4e-15 in z, over the speed there
    assert motion.events["time"] == pytest.approx(
        [1 - math.sqrt(depth), 1 + math.sqrt(depth)], abs=1e-12 + 2e-15 / math.sqrt(depth)
    )


def test_a_dip_that_does_not_reach_is_not_found():
    system = one_mode({"z": "v", "v": "2"}, [("z", 0, {}, None)])
    assert simulate(system, None, [1.0 + 1e-9, -2.0], t_end=5.0).events.size == 0


def test_many_crossings_inside_one_step_are_all_found_in_order():
    system = one_mode({"a": "0"}, [("cos(7*theta) - 0.2*sin(theta)", 0, {}, None)], phase=("theta", "1"))
    motion = simulate(system, None, [0.0], periods=2)
    wraps = motion.events["kind"] == "phase"
    grid = np.linspace(0.0, 4.0 * math.pi, 200_001)
    signs = np.sign(np.cos(7.0 * grid) - 0.2 * np.sin(grid))
    wanted = grid[:-1][signs[1:] != signs[:-1]]
    assert np.all(np.abs(motion.events["time"][~wraps] - wanted) < 1e-4)
    assert motion.events["time"][wraps] == pytest.approx([2.0 * math.pi, 4.0 * math.pi], abs=1e-14)


@pytest.mark.campaign
def test_random_event_functions_lose_no_crossing():
    rng = np.random.default_rng(1)
    event = "c0 + c1*x + c2*x**2 + c3*sin(5*theta) + c4*cos(3*theta)*v"
    system = one_mode(
        {"x": "v", "v": "-4*x"}, [(event, 0, {}, None)], parameters=dict.fromkeys(("c0", "c1", "c2", "c3", "c4"), 0.0),
        phase=("theta", "1"),
    )  # fmt: skip
    grid = np.linspace(0.0, 6.0 * math.pi, 300_001)
    x, v = np.cos(2.0 * grid), -2.0 * np.sin(2.0 * grid)
    for _ in range(60):
        c = rng.normal(size=5)
        h = c[0] + c[1] * x + c[2] * x * x + c[3] * np.sin(5 * grid) + c[4] * np.cos(3 * grid) * v
        where = np.flatnonzero(np.sign(h[1:]) != np.sign(h[:-1]))
        parameters = {f"c{i}": value for i, value in enumerate(c)}
        motion = simulate(system, parameters, [1.0, 0.0], periods=3)
        times = motion.events["time"][motion.events["kind"] == "event"]
        assert times.size == where.size
        assert np.all(np.abs(times - grid[where]) < 1e-4)


def test_direction_selects_crossings():
    for direction, first in ((1, 1.0), (-1, 3.0), (0, 1.0)):
        system = one_mode({"x": "1", "y": "1 - x/2"}, [("y - 0.75", direction, {}, None)])
        motion = simulate(system, None, [0.0, 0.0], t_end=6.0)
        assert motion.events["time"][0] == pytest.approx(first, abs=1e-12)
        assert motion.events.size == (2 if direction == 0 else 1)


def test_an_event_whose_condition_fails_is_passed():
    system = one_mode({"x": "v", "v": "-x"}, [("x", 0, {}, "v")])
    times = simulate(system, None, [1.0, 0.0], t_end=20.0).events["time"]
    assert times == pytest.approx(math.pi * np.array([1.5, 3.5, 5.5]), abs=1e-8)


def test_an_event_of_the_phase_at_its_wrap_happens_once_a_period():
    for direction in (1, 0):
        system = one_mode({"n": "0"}, [("sin(theta)", direction, {"n": "n + 1"}, None)], phase=("theta", "1"))
        motion = simulate(system, None, [0.0, 1.0], periods=7)
        assert motion(20.0 * math.pi / 3.0)[0] == (3.0 if direction else 6.0)


# simultaneous events, starts on a surface


def test_events_at_the_same_time_happen_in_the_order_of_definition():
    reset = [{"a": "2*a"}, {"a": "a + 1"}]
    for first, second, wanted in ((0, 1, 3.0), (1, 0, 4.0)):
        events = [("x - 1", 1, reset[first], None), ("2*x - 2", 1, reset[second], None)]
        with pytest.warns(RuntimeWarning, match="'t0' and 't1' of mode 'm' are due at the same time, t = 1"):
            motion = simulate(one_mode({"x": "1", "a": "0"}, events), None, [0.0, 1.0], t_end=2.0)
        assert motion.events["name"].tolist() == ["t0", "t1"]
        assert motion.events["time"] == pytest.approx([1.0, 1.0], abs=1e-14)
        assert motion.x_end[1] == wanted


def test_events_of_either_direction_at_the_same_time_both_happen():
    events = [("x - 1", 0, {"a": "2*a"}, None), ("1 - x", 0, {"a": "a + 1"}, None)]
    with pytest.warns(RuntimeWarning, match="the first in the definition came first"):
        motion = simulate(one_mode({"x": "1", "a": "0"}, events), None, [0.0, 1.0], t_end=2.0)
    assert motion.events["name"].tolist() == ["t0", "t1"]


def test_a_simultaneous_event_that_the_first_reset_undoes_does_not_happen():
    events = [("x - 1", 1, {"x": "0"}, None), ("2*x - 2", 1, {}, None)]
    motion = simulate(one_mode({"x": "1"}, events), None, [0.0], t_end=3.5)
    assert motion.events["name"].tolist() == ["t0"] * 3


def test_a_start_on_a_surface_that_leaves_through_it_fires_at_once(ball):
    motion = simulate(ball, None, [0.0, -1.0], mode="flight", t_end=0.5)
    assert motion.events["time"].tolist() == [0.0]
    assert motion(0.25) == pytest.approx([0.125 - 0.03125, 0.25], abs=1e-14)


def test_a_start_on_a_surface_that_leaves_it_does_not_fire(ball):
    motion = simulate(ball, None, [0.0, 1.0], t_end=2.1)
    assert motion.events["time"] == pytest.approx([2.0], abs=1e-12)


def test_a_start_of_no_rate_on_a_surface_is_decided_by_the_second_derivative():
    for acceleration, fires in ((1.0, False), (-1.0, True)):
        system = one_mode({"z": "v", "v": "g"}, [("z", -1, {"v": "1"}, None)], parameters={"g": 1.0})
        motion = simulate(system, {"g": acceleration}, [0.0, 0.0], t_end=0.5)
        assert motion.events["time"].tolist() == ([0.0] if fires else [])


def test_a_counter_on_a_section_counts_each_crossing_once():
    system = one_mode({"x": "v", "v": "-x", "n": "0"}, [("x", 1, {"n": "n + 1"}, None)])
    assert simulate(system, None, [1.0, 0.0, 0.0], t_end=20.0).x_end[2] == 3.0


def test_a_motion_inside_a_surface_is_not_stopped_by_it():
    system = one_mode({"x": "v", "v": "0"}, [("v - 1", 1, {}, None)])
    assert simulate(system, None, [0.0, 1.0], t_end=3.0).x_end == pytest.approx([3.0, 1.0])


def test_sliding_is_told_as_chattering():
    modes = {"below": Mode({"x": "1"}), "above": Mode({"x": "-1"})}
    rows = [Transition("below", "above", "x", 1), Transition("above", "below", "x", -1)]
    with pytest.raises(ChatteringError) as error:
        simulate(HybridSystem(("x",), {}, modes, rows), None, [-1.0], t_end=5.0)
    assert error.value.time == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("start", [-1.0, 0.5])
@pytest.mark.parametrize("event", ["x - 1/2", "x**3 - 1/8", "sin(x - 1/2)*y"])
def test_transitions_to_and_fro_at_one_crossing_are_told_as_chattering(event, start):
    modes = dict.fromkeys("AB", Mode({"x": "y", "y": "0"}))
    rows = [Transition("A", "B", event, 1), Transition("B", "A", event, 1)]
    system = HybridSystem(("x", "y"), {}, modes, rows)
    with pytest.raises(ChatteringError) as error:
        simulate(system, None, [start, 1.0], mode="A", t_end=2.0)
    assert error.value.time == pytest.approx(0.5 - start, abs=1e-12)


def test_an_impact_within_rounding_of_the_end_is_one_impact(ball_on_table):
    form = TableJump(0.5)
    a = 0.9623702699848647 * form.doubling
    motion = simulate(ball_on_table, {"a": a}, form.after_impact(a), periods=1)
    assert named(motion, "impact")["time"] == pytest.approx([2.0 * math.pi], abs=1e-12)


def test_runs_that_end_at_an_impact_see_no_impact_twice(ball_on_table):
    form = TableJump(0.5)
    for a in form.doubling * np.linspace(0.85, 1.0, 400):
        p, start = ball_on_table.parameter_vector({"a": a}), form.after_impact(a)
        for periods in (1, 2):
            log = events_after(ball_on_table, p, start, 0, periods=periods)
            times = log.time[log.transition == 0]
            assert periods - 1 <= times.size <= periods
            assert times == pytest.approx(2.0 * math.pi * np.arange(1, times.size + 1), abs=1e-8)


@pytest.mark.parametrize("after", [0.0, 1e-15, 1e-14, 1e-13, 1e-12, 1e-10])
def test_a_run_that_ends_just_after_an_impact_has_one(after, ball_on_table):
    form = TableJump(0.5)
    for a in form.doubling * np.linspace(0.85, 1.0, 60):
        p, start = ball_on_table.parameter_vector({"a": a}), form.after_impact(a)
        landing = events_after(ball_on_table, p, start, 0, n_events=1, t_end=7.0).t_end
        log = events_after(ball_on_table, p, start, 0, t_end=landing + after)
        count = int(np.sum(log.transition == 0))
        assert count == 1 or (count == 0 and after <= 4.0 * math.ulp(landing))


def test_fast_events_that_do_not_accumulate_are_not_chattering():
    system = systems.carried_map(("x",), {}, {"x": "x"})
    motion = simulate(system, None, [0.0, 0.0], t_end=1000.0)
    assert motion.events.size in (999, 1000)


# errors


def test_a_start_outside_the_domain_is_refused(afm1):
    with pytest.raises(InputError, match=r"x0 = \[1\.0, 0\.0, 0\.0\]: must be in the domain of mode 'flight'"):
        simulate(afm1, None, [1.0, 0.0], mode="flight", periods=1)


def test_a_start_beyond_every_mode_says_why_for_each(stick_slip):
    reasons = "before its events; slip: past its event 'catch'; stick: past its event 'release'"
    with pytest.raises(InputError, match=reasons):
        simulate(stick_slip, None, [2.0, 1.0], t_end=1.0)


def test_the_mode_of_the_start_is_the_one_whose_event_is_not_passed(afm1):
    assert simulate(afm1, None, [0.0, 0.0], periods=1).mode_at(0.0) == "flight"
    assert simulate(afm1, None, [0.999, 0.0], periods=1).mode_at(0.0) == "contact"


def test_leaving_the_domain_is_told():
    system = one_mode({"x": "-1"}, domain="x")
    with pytest.raises(DivergenceError, match=r"leaves the domain of the mode, x > 0"):
        simulate(system, None, [1.0], t_end=3.0)


def test_an_explosion_is_told_with_its_time():
    with pytest.raises(DivergenceError, match=r"diverges at t = 1\.0.*a state passes 1e\+12") as error:
        simulate(one_mode({"x": "x**2"}), None, [1.0], t_end=3.0)
    assert error.value.args[0] == pytest.approx(1.0, abs=1e-9)


def test_exponential_growth_passes_the_bound():
    with pytest.raises(DivergenceError, match=r"a state passes 1e\+12"):
        simulate(one_mode({"x": "x"}), None, [1.0], t_end=100.0)


def test_a_singularity_in_the_field_is_told():
    with pytest.raises(DivergenceError, match=r"as it does before a singularity"):
        simulate(one_mode({"x": "-1/x"}), None, [1.0], t_end=3.0)


def test_a_field_that_is_not_finite_at_the_start_is_told():
    with pytest.raises(DivergenceError, match=r"the vector field is not finite"):
        simulate(one_mode({"x": "1/x"}), None, [0.0], t_end=3.0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"x0": [1.0]}, r"x0 = \[1.0\]: must be of shape \(2,\)"),
        ({"x0": [1.0, math.nan]}, r"x0 = \[1.0, nan\]: must be finite"),
        ({"x0": ["a", 1.0]}, "must be numbers, one for each of z, v"),
        ({"t_end": None}, r"t_end, periods = .*: must be exactly one of the two given"),
        ({"periods": 3}, "t_end, periods = .*: must be exactly one of the two given"),
        ({"t_end": None, "periods": 3}, "periods = 3: must be left out for a system without a phase; give t_end"),
        ({"t_end": 0.0}, "t_end = 0.0: must be a finite number > 0"),
        ({"t_end": math.inf}, "t_end = inf: must be a finite number > 0"),
        ({"t_end": "1"}, "t_end = '1': must be a finite number > 0"),
        ({"tolerance": 0.0}, "tolerance = 0.0: must be a number between 1e-14 and 0.1"),
        ({"tolerance": (1e-9, math.nan)}, r"tolerance\[1\] = nan: must be a finite number > 0"),
        ({"tolerance": (1e-9,)}, "tolerance = .*: must be a number, or a relative and an absolute one"),
        ({"options": 3}, "options = 3: must be a SimulationOptions"),
        ({"mode": "fligt"}, "mode = 'fligt': must be one of flight; did you mean 'flight'?"),
        ({"parameters": {"h": 1.0}}, "parameter = 'h': must be one of g, e"),
    ],
)
def test_bad_arguments_are_named(ball, arguments, message):
    good = {"parameters": None, "x0": [1.0, 0.0], "t_end": 1.0}
    with pytest.raises(InputError, match=message):
        simulate(ball, **(good | arguments))


@pytest.mark.parametrize(("name", "wrong"), [("max_events", 0), ("max_steps", 2.5), ("max_events", None)])
def test_limits_are_counts(name, wrong):
    with pytest.raises(InputError, match=rf"SimulationOptions.{name} = {wrong}: must be an integer >= 1"):
        SimulationOptions(**{name: wrong})


def test_periods_must_be_a_positive_integer(afm1):
    for periods in (0, 1.5, True):
        with pytest.raises(InputError, match=r"periods = .*: must be an integer >= 1"):
            simulate(afm1, None, [0.0, 0.0], periods=periods)


def test_a_phase_that_does_not_run_forward_is_refused(impact_oscillator):
    with pytest.raises(InputError, match=r"rate of the phase theta = -1.0: must be > 0"):
        simulate(impact_oscillator, {"w": -1.0}, [0.0, 0.0], t_end=1.0)


def test_settle_and_events_after_want_one_duration(ball):
    p = ball.parameter_vector(None)
    with pytest.raises(InputError, match=r"t_end, periods = .*: must be exactly one of the two given"):
        settle(ball, p, [1.0, 0.0], 0)
    with pytest.raises(InputError, match=r"periods = 2: must be left out"):
        events_after(ball, p, [1.0, 0.0], 0, periods=2)


# against other solvers


def _landed(field, event, rate, t, x, *, start_step=1e-3):
    """Time and state at which SciPy's flow reaches event = 0, by Newton on whole integrations."""
    from scipy.integrate import solve_ivp

    event.terminal = True
    guess = solve_ivp(field, (t, t + 20.0), x, method="DOP853", rtol=1e-13, atol=1e-15, events=event)
    end = guess.t_events[0][0]
    for _ in range(3):
        y = solve_ivp(field, (t, end), x, method="DOP853", rtol=1e-13, atol=1e-15).y[:, -1]
        end -= event(end, y) / rate(end, y)
    return end, solve_ivp(field, (t, end), x, method="DOP853", rtol=1e-13, atol=1e-15).y[:, -1]


def _cantilever():
    p = systems.afm(1).parameters
    ybar, a0, b1 = p["ybar"], p["a0"], p["B1"]

    def z(t, x):
        return 1.0 - x[0] - ybar * math.sin(t)

    def speed(t, x):
        return -x[1] - ybar * math.cos(t)

    def flight(t, x):
        return [x[1], -0.025 * x[1] - x[0] + systems.C - systems.C / z(t, x) ** 2 + b1 * ybar * math.sin(t)]

    def contact(t, x):
        push = systems.C / a0**2 + systems.G * max(a0 - z(t, x), 0.0) ** 1.5
        return [x[1], -4.0 * x[1] - x[0] + systems.C - push + b1 * ybar * math.sin(t)]

    return z, speed, flight, contact


def test_cantilever_agrees_with_scipy_event_by_event(afm1):
    z, speed, flight, contact = _cantilever()
    p = afm1.parameter_vector(None)
    x, mode = settle(afm1, p, [0.0, 0.0], 0, periods=300)
    log = events_after(afm1, p, x, mode, periods=3, n_events=4, tolerance=(1e-13, 1e-15))
    log = [(t, k, y) for t, k, y in zip(log.time, log.transition, log.x_before, strict=True) if k >= 0]
    t, y = 0.0, x[:2]
    for index, (time, transition, before) in enumerate(log):
        assert transition == index % 2
        field, direction = (flight, -1) if transition == 0 else (contact, 1)

        def surface(t, x):
            return z(t, x) - systems.A0

        surface.direction = direction
        t, y = _landed(field, surface, speed, t, y)
        assert time == pytest.approx(t, abs=1e-11)
        assert before[:2] == pytest.approx(y, abs=1e-11)


@pytest.mark.campaign
def test_cantilever_agrees_with_heyoka_over_a_tap(afm1):
    hy = pytest.importorskip("heyoka")
    p = afm1.parameter_vector(None)
    x, mode = settle(afm1, p, [0.0, 0.0], 0, periods=300)
    log = events_after(afm1, p, x, mode, periods=3, n_events=2, tolerance=(1e-13, 1e-15))

    ybar, b1, a0 = 0.108, systems.B[0], systems.A0
    q, v, t, w = hy.make_vars("q", "v", "t", "w")
    gap = 1.0 - q - ybar * hy.sin(hy.time)
    force = systems.C / gap**2
    rhs = [(q, v), (v, -0.025 * v - q + systems.C - force + b1 * ybar * hy.sin(hy.time))]
    touch = hy.t_event(gap - a0, direction=hy.event_direction.negative)
    flying = hy.taylor_adaptive(rhs, list(x[:2]), time=0.0, tol=1e-16, t_events=[touch])
    flying.propagate_until(20.0)
    assert log.time[0] == pytest.approx(flying.time, abs=1e-11)
    assert log.x_before[0][:2] == pytest.approx(flying.state, abs=1e-11)

    # contact in the w-form: w = sqrt(a0 - z), dt = w dsigma
    push = systems.C / a0**2 + systems.G * w * w * w
    rate = -4.0 * v - q + systems.C - push + b1 * ybar * hy.sin(t)
    rhs = [(q, w * v), (v, w * rate), (t, w), (w, 0.5 * (v + ybar * hy.cos(t)))]
    leave = hy.t_event(w, direction=hy.event_direction.negative)
    touching = hy.taylor_adaptive(rhs, [*flying.state, flying.time, 0.0], time=0.0, tol=1e-16, t_events=[leave])
    touching.propagate_until(1e4)
    assert log.time[1] == pytest.approx(touching.state[2], abs=1e-11)
    assert log.x_before[1][:2] == pytest.approx(touching.state[:2], abs=1e-11)


def test_trajectory_agrees_with_scipy_between_steps():
    from scipy.integrate import solve_ivp

    system = one_mode({"x": "v", "v": "mu*(1 - x**2)*v - x"}, parameters={"mu": 2.0})
    motion = simulate(system, None, [2.0, 0.0], t_end=20.0, **TIGHT)
    times = np.linspace(0.0, 20.0, 777)
    other = solve_ivp(
        lambda t, x: [x[1], 2.0 * (1.0 - x[0] ** 2) * x[1] - x[0]], (0.0, 20.0), [2.0, 0.0],
        method="DOP853", rtol=1e-13, atol=1e-15, t_eval=times,
    )  # fmt: skip
    assert motion(times) == pytest.approx(other.y.T, abs=1e-9)


# properties


def test_the_flow_is_a_group(afm1):
    p = afm1.parameter_vector(None)
    x, mode = settle(afm1, p, [0.0, 0.0], 0, periods=100, **TIGHT_STEPS)
    whole, mode_whole = settle(afm1, p, x, mode, t_end=9.7, **TIGHT_STEPS)
    for part in (0.3, 1.7, 5.0):
        half, mode_half = settle(afm1, p, x, mode, t_end=part, **TIGHT_STEPS)
        end, mode_end = settle(afm1, p, half, mode_half, t_end=9.7 - part, **TIGHT_STEPS)
        assert mode_end == mode_whole
        assert end == pytest.approx(whole, abs=1e-10)


def test_buffers_do_not_change_the_motion(afm1, monkeypatch):
    p = afm1.parameter_vector(None)
    whole = simulate(afm1, None, [0.0, 0.0], periods=20)
    assert np.array_equal(settle(afm1, p, [0.0, 0.0], 0, periods=20)[0], whole.x_end)
    monkeypatch.setattr(simulation, "_STEPS_KEPT", 7)
    monkeypatch.setattr("saltus.flow.motion._EVENTS_KEPT", 3)
    monkeypatch.setattr("saltus.flow.motion._BUDGET", 11)
    assert simulate(afm1, None, [0.0, 0.0], periods=20) == whole


def test_periods_end_at_the_phase_of_the_start(impact_oscillator):
    motion = simulate(impact_oscillator, {"w": 2.0}, [0.0, 0.0, 1.25], periods=3)
    assert motion.t_end == pytest.approx(3.0 * math.pi, abs=1e-13)
    assert motion.x_end[2] == pytest.approx(1.25, abs=1e-13)
    assert motion.events["time"][motion.events["kind"] == "phase"] == pytest.approx(
        [(2.0 * math.pi * k - 1.25) / 2.0 for k in (1, 2, 3)], abs=1e-13
    )


def test_stroboscopic_states_are_recorded_at_phase_zero(impact_oscillator):
    motion = simulate(impact_oscillator, {"A": 0.05}, [0.0, 0.0], periods=5)
    strobe = motion.events[motion.events["kind"] == "phase"]
    assert strobe["name"].tolist() == ["theta"] * 5
    assert strobe["after"][:, 2].tolist() == [0.0] * 5
    assert strobe["before"][:, 2].tolist() == [2.0 * math.pi] * 5
    assert motion.t_end == pytest.approx(10.0 * math.pi, rel=1e-15)


def test_a_motion_of_given_time_ends_then_even_at_a_wrap(impact_oscillator):
    motion = simulate(impact_oscillator, {"A": 0.05}, [0.0, 0.0], t_end=4.0 * math.pi)
    assert motion.t_end == 4.0 * math.pi
    assert motion.x_end[2] == 0.0


def test_events_after_stops_at_the_number_of_events(ball):
    log = events_after(ball, ball.parameter_vector(None), [1.0, 0.0], 0, t_end=100.0, n_events=3)
    assert log.transition.tolist() == [0, 0, 0]
    assert log.t_end == log.time[-1]
    assert log.x_end == pytest.approx(log.x_after[-1])


def test_too_many_events_end_the_motion_with_a_sentence(ball):
    motion = simulate(ball, {"e": 0.9}, [1.0, 0.0], t_end=20.0, options=SimulationOptions(max_events=4))
    assert motion.events.size == 4
    assert motion.stopped == f"4 events reached at t = {motion.events['time'][-1]:.12g}"
    assert motion.t_end == motion.events["time"][-1]


def test_states_are_right_continuous_at_events(ball):
    motion = simulate(ball, None, [0.5, 0.0], t_end=1.5)
    time = motion.events["time"][0]
    assert motion(time) == pytest.approx([0.0, 0.5], abs=1e-14)
    assert motion([np.nextafter(time, 0.0), time])[:, 1] == pytest.approx([-1.0, 0.5], abs=1e-13)
    assert motion(np.linspace(0.0, 1.5, 6)).shape == (6, 2)
    assert motion(1.5) == pytest.approx(motion.x_end)


def test_modes_are_known_at_every_time(stick_slip):
    motion = simulate(stick_slip, None, [1.0, 0.3], mode="slip", t_end=8.0)
    assert motion.mode_at([0.0, 4.0, 4.3, 7.5, 7.6]).tolist() == ["slip", "slip", "stick", "stick", "slip"]
    assert motion.mode_at(motion.events["time"][0]) == "stick"


def test_an_output_is_what_its_expression_says(ball):
    motion = simulate(ball, {"g": 2.0}, [1.0, 0.0], t_end=1.8)
    times = np.linspace(0.0, 1.8, 50)
    energy = motion.output("energy", times)
    assert energy[times < 1.0] == pytest.approx(2.0, rel=1e-12)
    assert energy[times > 1.0] == pytest.approx(0.5, rel=1e-12)
    assert motion.output("energy", 0.0) == pytest.approx(2.0)
    assert motion.output("energy - v**2/2", times) == pytest.approx(2.0 * motion.output("z", times), abs=1e-12)
    unknown = r"in z, v, g, e, energy and pi, but 'enrgy' is unknown; did you mean 'energy'\?"
    with pytest.raises(InputError, match=rf"expression = 'enrgy': must be {unknown}"):
        motion.output("enrgy", 0.0)


def test_times_out_of_range_are_refused(ball):
    motion = simulate(ball, None, [1.0, 0.0], t_end=1.0)
    for t in (-0.1, 1.1, [0.5, math.nan]):
        with pytest.raises(InputError, match=r"t = .*: must be between 0 and t_end = 1"):
            motion(t)


def test_a_slow_impact_is_marked_as_grazing():
    system = one_mode({"z": "v", "v": "2"}, [("z", -1, {}, None)])
    slow = simulate(system, None, [1.0 - 1e-13, -2.0], t_end=1.5, **TIGHT).events
    fast = simulate(system, None, [1.0 - 1e-9, -2.0], t_end=1.5, **TIGHT).events
    assert slow["grazing"].tolist() == [True]
    assert fast["grazing"].tolist() == [False]
    assert fast["normal_velocity"][0] == pytest.approx(-2.0 * math.sqrt(1e-9), rel=1e-4)


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_a_grazing_is_one_in_all_units(unit):
    system = one_mode({"z": "v", "v": f"2*{unit!r}"}, [("z", -1, {"v": "-v"}, None)])
    for above, grazes in ((1e-13, True), (1e-9, False), (0.5, False)):
        start = [unit * (1.0 - above), -2.0 * unit]
        motion = simulate(system, None, start, t_end=1.5, tolerance=(1e-12, 1e-13 * unit))
        assert motion.events["grazing"][0] == grazes


def test_a_field_with_a_root_on_a_surface_meets_it_with_speed():
    system = one_mode({"x": "-1 - sqrt(x)", "y": "1"}, [("x", -1, {"x": "1"}, None)])
    assert not simulate(system, None, [1.0, 0.0], t_end=3.0).events["grazing"].any()


@pytest.mark.parametrize("periods", [1, 6])
def test_a_saved_trajectory_is_read_back_equal(afm1, tmp_path, periods):
    motion = simulate(afm1, {"Omega": 1.1}, [0.3, 0.2], periods=periods)
    again = saltus.result.load(motion.save(tmp_path / "motion.nc"))
    assert again == motion
    times = np.linspace(0.0, motion.t_end, 99)
    assert np.array_equal(again(times), motion(times))
    assert np.array_equal(again.output("z", times), motion.output("z", times))
    assert np.array_equal(again.events, motion.events)
    assert again.system.mode_names == afm1.mode_names
    assert again.system == afm1


def test_the_dataset_tells_which_events_graze():
    system = one_mode({"z": "v", "v": "2"}, [("z", -1, {}, None)])
    motion = simulate(system, None, [1.0 - 1e-13, -2.0], t_end=1.5, **TIGHT)
    dataset = motion.to_xarray()
    assert dataset["event_grazing"].values.tolist() == [True]
    assert dataset["event_time"].values == pytest.approx(1.0, abs=1e-6)
    assert "1 grazing" in repr(motion)


def test_a_saved_trajectory_without_events_is_read_back_equal(ball, tmp_path):
    motion = simulate(ball, None, [1.0, 0.0], t_end=0.5)
    assert saltus.result.load(motion.save(tmp_path / "motion.nc")) == motion
    assert simulate(ball, None, [1.0, 0.0], t_end=0.6) != motion


def test_the_repr_tells_steps_events_and_end(ball):
    text = repr(simulate(ball, None, [0.5, 0.0], t_end=1.5))
    assert "Trajectory of 'bouncing ball' over 0 <= t <= 1.5" in text
    assert "1 impact" in text
    assert "ends in mode 'flight' at z = 0.125, v = " in text
    assert text.endswith("t_end = 1.5 reached")


def test_a_text_is_no_system():
    with pytest.raises(InputError, match="^system = 'osc': must be a HybridSystem$"):
        simulate("osc", None, [0.0])


def test_the_sign_of_a_state_may_be_in_an_event():
    system = HybridSystem(
        states=("x", "v"),
        parameters={},
        modes={"free": Mode({"x": "v", "v": "-x"})},
        transitions=[Transition("free", "free", "x - 0.3*sign(v)", 0, name="passed")],
    )
    seen = simulate(system, None, [0.0, 1.0], t_end=3.0).events
    assert seen["time"][0] == pytest.approx(math.asin(0.3), abs=1e-10)


def relay(reset):
    """A relay that turns at 1 and at 1/2, and moves the state when it turns at 1."""
    return HybridSystem(
        ("x",),
        {"r": 0.3, "scale": 1.0},
        {"up": Mode({"x": "scale"}), "down": Mode({"x": "-scale"})},
        [
            Transition("up", "down", "x - scale", 1, reset, name="turn"),
            Transition("down", "up", "x - scale/2", -1, name="back"),
        ],
    )


@pytest.mark.parametrize("scale", [1.0, 1e-9, 1e9])
def test_a_landing_beyond_an_event_of_the_target_mode_is_told(scale):
    system = relay({"x": "x - r*scale"})
    parameters, start = {"r": 0.7, "scale": scale}, [0.0]
    with pytest.warns(
        RuntimeWarning, match="'turn' lands beyond event 'back' of mode 'down' at t = 1, .*goes on as if"
    ):
        motion = simulate(system, parameters, start, t_end=3.0, tolerance=(1e-10, 1e-12 * scale))
    (landing,) = motion.landings_beyond
    assert (landing.transition, landing.mode, landing.event) == ("turn", "down", "back")
    assert (landing.time, landing.value) == pytest.approx((1.0, -0.2 * scale), rel=1e-9)
    assert "\n  'turn' lands beyond event 'back'" in repr(motion)
    assert motion.mode_end == "down"


@pytest.mark.parametrize("r", [0.0, 0.3, 0.5])
@pytest.mark.parametrize("scale", [1.0, 1e-9, 1e9])
def test_a_landing_on_the_near_side_or_on_the_surface_is_none(scale, r):
    motion = simulate(
        relay({"x": "x - r*scale"}), {"r": r, "scale": scale}, [0.0], t_end=9.2, tolerance=(1e-10, 1e-12 * scale)
    )
    assert motion.landings_beyond == ()


def test_a_reset_within_a_mode_that_jumps_over_an_event_is_told_once():
    system = HybridSystem(
        ("x", "y"),
        {},
        {"a": Mode({"x": "0", "y": "1"}), "b": Mode({"x": "0", "y": "1"})},
        [
            Transition("a", "b", "x - 1", 1, name="pass"),
            Transition("a", "a", "sin(y)", 1, {"x": "x + 0.6"}, name="kick"),
        ],
    )
    with pytest.warns(RuntimeWarning, match="'kick' lands beyond event 'pass' of mode 'a'"):
        motion = simulate(system, {}, [0.0, 0.1], t_end=30.0)
    assert [landing.time for landing in motion.landings_beyond] == pytest.approx([4.0 * math.pi - 0.1])


@pytest.mark.parametrize(("kick", "told"), [(0.1, True), (0.0, False), (-0.1, False)])
def test_a_kick_past_the_threshold_of_another_neuron_is_told(kick, told):
    """A neuron that is put above its threshold passes it no more, and is silent for good."""
    pair = HybridSystem(
        ("u", "v"),
        {"I": 1.5, "e": kick},
        {"f": Mode({"u": "I - u", "v": "I - v"})},
        [
            Transition("f", "f", "u - 1", 1, {"u": "0", "v": "v + e"}, name="su"),
            Transition("f", "f", "v - 1", 1, {"v": "0", "u": "u + e"}, name="sv"),
            Transition("f", "f", "u - v", 0, name="counts"),
        ],
    )
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        motion = simulate(pair, {}, [0.2, 0.6], t_end=8.0)
    assert bool(motion.landings_beyond) == told
    assert any("'sv' lands beyond event 'su' of mode 'f'" in str(warning.message) for warning in caught) == told


def test_an_orbit_that_lands_beyond_an_event_is_found_with_a_warning():
    """Up to 1, set back by r, pushed up by y, down to 1/2, and up again: for r = 0.7 it lands below 1/2."""
    system = HybridSystem(
        ("x", "y"),
        {"r": 0.3},
        {"up": Mode({"x": "1", "y": "-y"}), "down": Mode({"x": "3*y - 1", "y": "-y"})},
        [
            Transition("up", "down", "x - 1", 1, {"x": "x - r", "y": "1"}, name="turn"),
            Transition("down", "up", "x - 0.5", -1, name="back"),
        ],
    )
    near = saltus.find_orbit(system, {}, [0.6, 0.5], mode="up")
    assert near.landings_beyond == ()
    with pytest.warns(RuntimeWarning, match="'turn' lands beyond event 'back' of mode 'down'"):
        far = saltus.find_orbit(system, {"r": 0.7}, [0.6, 0.5], mode="up")
    (landing,) = far.landings_beyond
    assert landing.value == pytest.approx(-0.2)
    assert "lands beyond event 'back'" in repr(far)
