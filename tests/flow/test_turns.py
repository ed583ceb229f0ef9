"""The error of an angle does not know how often it turned."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from saltus import Average, HybridSystem, Mode, Transition, lyapunov_spectrum, run_sweep, simulate
from saltus.options import SimulationOptions, SweepOptions
from saltus.system.angles import TURN
from selection import guarding

JUNCTION = HybridSystem.smooth(
    {"p": "I - sin(p) + cos(th)"}, {"I": 1.2, "w": 1.0}, phase=("th", "w"), angles=("p",), name="junction"
)
PENDULUM = HybridSystem.smooth(
    {"p": "v", "v": "T - 0.5*v - sin(p) + 0.3*cos(th)"}, {"T": 1.1, "w": 1.0}, phase=("th", "w"), angles=("p",)
)
COUNTED = HybridSystem(  # an event each turn, which changes nothing: no series
    ("p",),
    {"I": 1.2, "w": 1.0},
    {"m": Mode({"p": "I - sin(p) + cos(th)"})},
    [Transition("m", "m", "sin(p)", 1, name="turn")],
    phase=("th", "w"),
    angles=("p",),
)
FILTERED = HybridSystem.smooth(  # stiff: implicit steps
    {"p": "I - y + cos(th)", "y": "2000*(sin(p) - y)"}, {"I": 1.2, "w": 1.0}, phase=("th", "w"), angles=("p",)
)
SYSTEMS = {"junction": JUNCTION, "pendulum": PENDULUM, "stiff": FILTERED}


@pytest.mark.parametrize(
    ("name", "turns", "tolerance"),
    guarding(
        [
            (name, turns, tolerance)
            for name in SYSTEMS
            for turns in (1000, -(10**5), 10**6)
            for tolerance in (1e-5, 1e-8, 1e-10)
            if tolerance > 1e-10 or name != "stiff"  # a state that follows the sine follows its rounding
        ],
        ("junction", 10**6, 1e-8), ("pendulum", -(10**5), 1e-8), ("stiff", 10**6, 1e-8),
    ),
)  # fmt: skip
def test_a_motion_that_begins_some_turns_on_is_the_same(name, turns, tolerance):
    system = SYSTEMS[name]
    x0 = np.array([2.1, 0.5][: len(system.states)])
    one, other = (
        simulate(system, x0=x0 + [TURN * k, 0.0][: x0.size], periods=20, tolerance=tolerance) for k in (0, turns)
    )
    apart = other.x_end[:-1] - one.x_end[:-1] - [TURN * turns, 0.0][: x0.size]
    rounding = np.spacing(TURN * abs(turns)) * len(other.step_starts)  # of the sum that the state is
    assert np.abs(apart).max() <= 100.0 * tolerance + rounding
    assert len(other.step_starts) <= 1.2 * len(one.step_starts)


@pytest.mark.parametrize("tolerance", [1e-6, 1e-8, 1e-10])
def test_a_sweep_tells_rotations_at_each_tolerance(tolerance):
    values = [1.1, 1.2, 1.4, 1.6]
    sweep = run_sweep(JUNCTION, "I", values, x0=[0.0], options=SweepOptions(tolerance=tolerance))
    assert sweep.labels.ravel().tolist() == ["period-1"] * len(values)


def test_the_strobe_of_a_rotation_is_that_of_another_solver():
    sweep = run_sweep(JUNCTION, "I", [1.2, 1.6], x0=[0.0])
    for value in sweep.values:
        ends = solve_ivp(
            lambda t, y, drive: [drive - math.sin(y[0]) + math.cos(t)],
            (0.0, 60.0 * TURN), [0.0], args=(value,), method="DOP853", rtol=1e-12, atol=1e-12,
        )  # fmt: skip
        apart = sweep.at(value).points["p"] - ends.y[0, -1]
        assert np.abs((apart + math.pi) % TURN - math.pi).max() < 1e-6  # a hundred tolerances


def test_events_of_a_rotation_are_as_exact_a_million_turns_on():
    near, far = (simulate(COUNTED, x0=[2.1 + TURN * k], periods=20, tolerance=1e-9) for k in (0, 10**6))
    times = [motion.events["time"][motion.events["name"] == "turn"] for motion in (near, far)]
    assert times[0].size == 20
    np.testing.assert_allclose(times[1], times[0], atol=1e-7)


def test_the_exponent_of_a_rotation_does_not_know_its_turns():
    rates = [
        lyapunov_spectrum(JUNCTION, {}, [2.1 + TURN * k], average=Average(periods=100), tolerance=1e-8).exponents[0]
        for k in (0, 10**5)
    ]
    assert rates[1] == pytest.approx(rates[0], abs=1e-6)


def test_an_angle_does_not_diverge():
    limited = SimulationOptions(limit=20.0)
    motion = simulate(JUNCTION, x0=[0.0], periods=10, options=limited)
    assert motion.x_end[0] > 50.0
    assert run_sweep(JUNCTION, "I", [1.2], x0=[0.0], options=SweepOptions(limit=20.0)).labels[0, 0] == "period-1"
