"""No body passes a wall: impacts that accumulate, plastic impacts, starts at rest on the surface, in any units."""

from __future__ import annotations

import importlib
import math
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

from saltus import HybridSystem, Mode, Transition, run_sweep, simulate
from saltus.errors import ChatteringError
from saltus.options import SimulationOptions, SweepOptions

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
FALL = {"flight": Mode({"z": "v", "v": "-g"})}


@pytest.fixture(scope="module")
def campaign():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(BENCHMARKS)
        yield importlib.import_module("random_approaches")


@pytest.fixture(scope="module")
def body(campaign):
    return campaign.body_above_a_wall()


@pytest.fixture(scope="module")
def dropped():
    """A ball over the floor z = d."""
    hit = Transition("flight", "flight", "z - d", -1, {"v": "-e*v"}, name="hit")
    return HybridSystem(("z", "v"), {"g": 1.0, "e": 0.5, "d": 0.0}, FALL, [hit])


@pytest.fixture(scope="module")
def table():
    """A ball over a table at a sin(theta)."""
    reset = {"v": "-e*v + (1 + e)*a*w*cos(theta)"}
    impact = Transition("flight", "flight", "z - a*sin(theta)", -1, reset, name="impact")
    parameters = {"g": 1.0, "e": 0.5, "a": 0.5, "w": 1.0}
    return HybridSystem(("z", "v"), parameters, FALL, [impact], phase=("theta", "w"))


@pytest.fixture(scope="module")
def threshold():
    """A point that runs through x = 1, where its rate changes by a factor k and y is counted up."""
    kick = Transition("free", "free", "x - 1", 1, {"v": "k*v", "y": "y + 1"}, name="kick")
    return HybridSystem(("x", "v", "y"), {"k": 1.0}, {"free": Mode({"x": "v", "v": "0", "y": "0"})}, [kick])


@pytest.mark.campaign
def test_no_random_approach_ends_beyond_its_wall(campaign, body):
    found = Counter(campaign.outcome(body, *approach) for approach in campaign.approaches(2500, 7))
    assert found["beyond"] == 0
    assert found["told"] > 1500
    assert found["above"] > 200


def test_balls_on_a_table_too_slow_to_throw_them_are_never_below_it(table):
    rng = np.random.default_rng(5)
    told = 0
    for _ in range(150):
        p = {"e": rng.uniform(0.02, 0.9), "a": rng.uniform(0.05, 0.9)}
        x0 = [1.0 + rng.uniform(0.0, 2.0), rng.uniform(-1.0, 1.0), rng.uniform(0.0, 6.28)]
        try:
            end = simulate(table, p, x0, t_end=100.0).x_end
        except ChatteringError as error:
            end, told = error.state, told + 1
        assert end[0] - p["a"] * math.sin(end[2]) > -1e-9
    assert told > 130


@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("d", [0.0, 1.0, -3e5])
def test_a_body_at_rest_on_the_floor_is_told_to_rest(dropped, d, e):
    with pytest.raises(ChatteringError, match="last event 'hit'; the motion slides or rests there") as error:
        simulate(dropped, {"d": d, "e": e}, [d, 0.0], t_end=2.0)
    assert (error.value.time, error.value.transition) == (0.0, "hit")


@pytest.mark.parametrize("direction", [-1, 0])
@pytest.mark.parametrize("height", [1e-12, 1e-9, 1e-6, 1.0])
def test_a_plastic_impact_ends_the_fall_whatever_the_direction(direction, height):
    hit = Transition("flight", "flight", "z", direction, {"v": "0"}, name="hit")
    system = HybridSystem(("z", "v"), {"g": 1.0}, FALL, [hit])
    with pytest.raises(ChatteringError) as error:
        simulate(system, None, [height, 0.0], t_end=10.0)
    assert error.value.time == pytest.approx(math.sqrt(2.0 * height), rel=1e-9)
    assert error.value.state == pytest.approx((0.0, 0.0), abs=1e-15)


@pytest.mark.parametrize(
    ("length", "time"), [(1e-9, 1.0), (1e-9, 1e-6), (1e-9, 1e6), (1.0, 1e-6), (1e6, 1.0), (1e6, 1e6)]
)
@pytest.mark.parametrize("d", [0.0, 2.0])
def test_chattering_is_told_at_the_same_time_in_any_units(dropped, length, time, d):
    p = {"g": length / time**2, "d": d * length, "e": 0.6}
    with pytest.raises(ChatteringError) as error:
        simulate(dropped, p, [(d + 1.0) * length, 0.0], t_end=100.0 * time)
    assert error.value.time / time == pytest.approx(math.sqrt(2.0) * 1.6 / 0.4, rel=1e-7)


def test_a_ball_that_loses_nothing_keeps_its_height(dropped):
    motion = simulate(dropped, {"e": 1.0, "d": 1.0}, [1.5, 0.0], t_end=50.25)
    assert len(motion.events) == 25
    assert motion(np.arange(0.0, 50.0, 2.0))[:, 0] == pytest.approx(1.5, abs=1e-8)


@pytest.mark.parametrize("k", [0.5, 1.0, 2.0])
def test_a_threshold_that_changes_the_speed_is_passed_once(threshold, k):
    motion = simulate(threshold, {"k": k}, [0.0, 1.0, 0.0], t_end=3.0)
    assert motion.x_end == pytest.approx([1.0 + 2.0 * k, k, 1.0], abs=1e-9)


def test_a_threshold_that_turns_back_is_a_wall(threshold):
    motion = simulate(threshold, {"k": -0.5}, [0.0, 1.0, 0.0], t_end=3.0)
    assert motion.x_end == pytest.approx([0.0, -0.5, 1.0], abs=1e-9)


def test_a_threshold_touched_without_speed_counts_once():
    """x = 1 - t^2/2 begins on the threshold; its reset touches no rate, so that nothing can keep the motion there."""
    passed = Transition("fall", "fall", "x - 1", -1, {"y": "1"}, name="passed")
    system = HybridSystem(("x", "v", "y"), {}, {"fall": Mode({"x": "v", "v": "-1", "y": "0"})}, [passed])
    motion = simulate(system, None, [1.0, 0.0, 0.0], t_end=2.0)
    assert motion.x_end == pytest.approx([-1.0, -2.0, 1.0], abs=1e-9)
    assert len(motion.events) == 1


def test_a_clock_that_is_set_back_beyond_its_surface_goes_on():
    back = Transition("run", "run", "x - 1", 1, {"x": "x - 3"}, name="back")
    motion = simulate(HybridSystem(("x",), {}, {"run": Mode({"x": "1"})}, [back]), None, [0.0], t_end=10.0)
    assert motion.events["time"] == pytest.approx([1.0, 4.0, 7.0, 10.0], abs=1e-12)


def test_a_wall_that_rises_into_a_body_too_slow_for_its_reset_is_told():
    """The reset knows nothing of the wall's speed: it leaves the body moving into the wall, again and again."""
    rising = Transition("flight", "flight", "z - t", -1, {"v": "-v/2"}, name="hit")
    system = HybridSystem(("z", "v", "t"), {}, {"flight": Mode({"z": "v", "v": "0", "t": "1"})}, [rising])
    with pytest.raises(ChatteringError):
        simulate(system, None, [1.0, -0.1, 0.0], t_end=5.0)


@pytest.mark.campaign
def test_a_sweep_tells_a_ball_at_rest_as_chattering(table):
    options = SweepOptions(discard=30, keep=20)
    sweep = run_sweep(table, "a", np.linspace(0.1, 0.9, 9), parameters={"e": 0.1}, x0=[1.0, 0.0], options=options)
    assert set(sweep.labels.ravel().tolist()) == {"chattering"}
    assert all("last event 'impact'" in reason for reason in sweep.reasons.ravel())


def test_gap_of_the_campaign_is_the_height_over_the_wall(campaign, body):
    p = {"d": 0.5, "c": 0.4, "a": 0.3}
    motion = simulate(
        body, {**p, "e": 0.7}, [1.0, 3.0, 0.1, 0.0, 0.2], t_end=8.0, options=SimulationOptions(max_events=200)
    )
    impacts = motion.events[motion.events["name"] == "impact"]
    assert len(impacts) > 1
    assert campaign.gap(p, impacts["before"]) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(("unit", "x0"), [(1.0, [-0.5, 0.0]), (1e-9, [-2e-9, 0.0]), (1e6, [-1e6, 3e6])])
def test_a_start_below_the_table_is_told(unit, x0):
    with pytest.warns(RuntimeWarning, match=r"starts behind event 'bounce' of mode 'air', where its function is -"):
        simulate(ball_on_a_table(unit), x0=x0, t_end=0.1)


@pytest.mark.parametrize("x0", [[0.5, 0.0], [0.0, 1.0], [-1e-16, 1.0]])
def test_a_start_on_or_above_the_table_is_not(x0):
    simulate(ball_on_a_table(1.0), x0=x0, t_end=0.1)


def test_a_kick_that_motions_pass_is_no_wall():
    """A clock's kick adds speed where the pendulum passes its lowest place to the right."""
    kick = Transition("swing", "swing", "x", 1, {"v": "v + 0.2"}, name="kick")
    clock = HybridSystem(("x", "v"), {}, {"swing": Mode({"x": "v", "v": "-x - 0.1*v"})}, [kick])
    simulate(clock, x0=[0.5, 0.3], t_end=5.0)
    spike = Transition("rest", "rest", "u - 1", 1, {"u": "0"}, name="spike")
    neuron = HybridSystem(("u",), {}, {"rest": Mode({"u": "1.2 - u"})}, [spike])
    with pytest.warns(RuntimeWarning, match="starts behind event 'spike'"):
        simulate(neuron, x0=[1.1], t_end=1.0)


def ball_on_a_table(unit):
    """A ball that falls by one unit."""
    bounce = Transition("air", "air", "h", -1, {"v": "-0.8*v"}, name="bounce")
    return HybridSystem(("h", "v"), {"g": unit}, {"air": Mode({"h": "v", "v": "-g"})}, [bounce])


def collapse(x: float, u: float, y: float, v: float, m: float) -> float:
    """When a light ball between a shaken table and another ball has no room left, flight by flight."""
    t = 0.0
    for _ in range(230):
        height = np.polynomial.Polynomial([x, u, -0.5])

        def gap(s: float, height: np.polynomial.Polynomial = height, t: float = t) -> float:
            return height(s) - 0.3 * math.sin(2.0 * (t + s))

        ahead = np.append(np.geomspace(1e-9, 1e-3, 200), np.linspace(1e-3, 4.0, 8000)[1:])
        below = int(np.argmax(np.array([gap(s) for s in ahead.tolist()]) < 0.0))
        down = brentq(gap, ahead[below - 1], ahead[below], xtol=1e-16)
        together = (y - x) / (u - v) if u > v else math.inf
        s = min(down, together)
        x, u, y, v, t = x + u * s - 0.5 * s * s, u - s, y + v * s - 0.5 * s * s, v - s, t + s
        if down < together:
            u = -0.8 * u + 1.8 * 0.6 * math.cos(2.0 * t)
        else:
            u, v = u + 1.9 * (v - u) / (1.0 + m), v - m * 1.9 * (v - u) / (1.0 + m)
    return t


@pytest.mark.parametrize("m", [0.05, 0.1])
@pytest.mark.filterwarnings("ignore:saltus. transitions:RuntimeWarning")  # both are due at once in the end
def test_a_ball_that_two_others_take_turns_to_hit_chatters(m):
    two = HybridSystem(
        ("x", "u", "y", "v"), {"m": m}, {"air": Mode({"x": "u", "u": "-1", "y": "v", "v": "-1"})},
        [
            Transition("air", "air", "x - 0.3*sin(s)", -1, {"u": "-0.8*u + 1.8*0.6*cos(s)"}, name="table"),
            Transition("air", "air", "y - x", -1,
                       {"u": "u + 1.9*(v - u)/(1 + m)", "v": "v - m*1.9*(v - u)/(1 + m)"}, name="balls"),
        ],
        phase=("s", "2"),
    )  # fmt: skip
    with pytest.raises(ChatteringError) as error:
        simulate(two, x0=[0.5, 0.0, 1.0, 0.0], t_end=5.0)
    assert error.value.time == pytest.approx(collapse(0.5, 0.0, 1.0, 0.0, m), abs=1e-5)
