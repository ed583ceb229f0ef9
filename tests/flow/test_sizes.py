"""Motions in units far from one: tolerances of steps fit the states, whatever they are measured in."""

from __future__ import annotations

import numpy as np
import pytest

from saltus import Average, HybridSystem, Mode, Transition, lyapunov_spectrum, run_sweep, simulate
from saltus.options import SweepOptions

UNITS = [(1e-9, 1e-6), (1e-9, 1.0), (1e-6, 1e-3), (1e9, 1e6), (1e-3, 1.0)]


def oscillator(length, time):
    """A driven oscillator that hits a stop at 0.8 of the unit of length, in units of length and time."""
    field = {"x": "v", "v": "(-x - 0.1*v*T + L*cos(s))/T**2"}
    stop = Transition("m", "m", "x - 0.8*L", 1, {"v": "-0.7*v"}, name="hit")
    parameters = {"w": 1.0 / time, "L": length, "T": time}
    return HybridSystem(("x", "v"), parameters, {"m": Mode(field)}, [stop], phase=("s", "w"))


@pytest.fixture(scope="module")
def of_one():
    system = oscillator(1.0, 1.0)
    motion = simulate(system, {}, [0.0, 0.0], periods=30)
    sweep = run_sweep(system, "w", [1.0, 1.1], x0=[0.0, 0.0], options=SweepOptions(discard=50, keep=5))
    return motion, sweep


@pytest.mark.parametrize(("length", "time"), UNITS)
def test_a_motion_in_other_units_is_as_accurate(of_one, length, time):
    motion = simulate(oscillator(length, time), {}, [0.0, 0.0], periods=30)
    units = np.array([length, length / time])
    assert motion.x_end[:2] / units == pytest.approx(of_one[0].x_end[:2], abs=1e-11)
    assert motion.events["time"] / time == pytest.approx(of_one[0].events["time"], rel=1e-12)
    assert len(motion.step_times) < 1.2 * len(of_one[0].step_times)


@pytest.mark.parametrize(("length", "time"), UNITS)
def test_a_sweep_in_other_units_has_the_same_points(of_one, length, time):
    sweep = run_sweep(
        oscillator(length, time),
        "w",
        np.array([1.0, 1.1]) / time,
        x0=[0.0, 0.0],
        options=SweepOptions(discard=50, keep=5),
    )
    assert sweep.labels.tolist() == of_one[1].labels.tolist()
    assert sweep.points / np.array([length, length / time]) == pytest.approx(of_one[1].points, abs=1e-9)


@pytest.mark.parametrize(("length", "time"), UNITS)
def test_exponents_in_other_units_have_the_sum_of_the_damping(length, time):
    found = lyapunov_spectrum(oscillator(length, time), {}, [0.0, 0.0], average=Average(periods=100))
    hits = simulate(oscillator(length, time), {}, [0.0, 0.0], periods=100).events["name"].tolist().count("hit")
    assert hits == 100
    # between hits -0.1, and 0.7 squared at each
    assert found.exponents.sum() * time == pytest.approx(-0.1 + 2.0 * np.log(0.7) / (2.0 * np.pi), abs=1e-8)


def test_an_absolute_tolerance_that_is_given_is_used():
    assert simulate(oscillator(1e-9, 1.0), {}, [0.0, 0.0], periods=2, tolerance=(1e-10, 1e-13)).tolerance == (
        1e-10,
        1e-13,
    )


@pytest.mark.parametrize("field", ["-y + sin(s)**2 + cos(s)**2 - 1", "-y", "x*1e-18 - y"])
def test_a_state_that_is_rounding_or_zero_costs_no_steps(field):
    system = HybridSystem(("x", "y"), {}, {"m": Mode({"x": "-x + cos(s)", "y": field})}, phase=("s", "1"))
    motion = simulate(system, {}, [0.0, 0.0], periods=20)
    alone = HybridSystem(("x",), {}, {"m": Mode({"x": "-x + cos(s)"})}, phase=("s", "1"))
    assert len(motion.step_times) < 2.0 * len(simulate(alone, {}, [0.0], periods=20).step_times)
    assert motion.x_end[0] == pytest.approx(0.5, abs=1e-9)


@pytest.mark.parametrize("size", [1e-100, 1e-130, 1e-170, 1e-300, 5e-324])
def test_a_state_next_to_nothing_is_followed(size):
    kept = Mode({"x": "0", "s": "1"})
    system = HybridSystem(("x", "s"), {}, {"m": kept}, [Transition("m", "m", "s - 1", 1, {"x": "-x/2", "s": "0"})])
    motion = simulate(system, {}, [size, 0.0], t_end=3.5)
    assert motion.x_end[0] == pytest.approx(-size / 8.0, rel=1e-9, abs=1e-323)
    assert motion.x_end[1] == pytest.approx(0.5, abs=1e-12)
