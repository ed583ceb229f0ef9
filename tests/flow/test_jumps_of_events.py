"""Poles and jumps of an event function are no events: a change of sign counts where the function itself is zero."""

import math

import numpy as np
import pytest

from saltus import HybridSystem, Mode, Transition, continue_orbit, find_orbit, run_sweep, simulate
from saltus.options import SweepOptions

N = np.arange(1, 4)  # of whole turns


def times(event: str, direction: int) -> list[float]:
    """Times of an event of x = t, which changes nothing but a count."""
    count = Transition("run", "run", event, direction, {"n": "n + 1"}, name="count")
    system = HybridSystem(("x", "n"), {}, {"run": Mode({"x": "1", "n": "0"})}, [count])
    return simulate(system, None, [0.05, 0.0], t_end=9.5).events["time"] + 0.05


@pytest.mark.parametrize("direction", [-1, 0, 1])
@pytest.mark.parametrize("event", ["1/(x - 1)", "1/(x - 1)**3", "sign(x - 1)*(1 + x)"])
def test_a_pole_or_a_jump_is_no_event(event, direction):
    assert times(event, direction).size == 0


@pytest.mark.parametrize(
    ("event", "direction", "truth"),
    [
        ("tan(x)", 1, math.pi * N),
        ("tan(x)", 0, math.pi * N),
        ("tan(x)", -1, []),
        ("atan2(sin(x), cos(x)) - 1", 1, [1.0, 1.0 + 2.0 * math.pi]),
        ("atan2(sin(x), cos(x)) - 1", -1, []),
        ("atan2(sin(x), cos(x)) - 1", 0, [1.0, 1.0 + 2.0 * math.pi]),
        ("1/(x - 1) + 2", 0, [0.5]),
        ("1/(x - 1) - 2", -1, [1.5]),
        ("abs(x - 1) - 1/2", 0, [0.5, 1.5]),
        ("abs(x - 1) - 1/2", 1, [1.5]),
    ],
)
def test_zeros_beside_poles_jumps_and_kinks_are_events(event, direction, truth):
    assert times(event, direction) == pytest.approx(truth, abs=1e-9)


@pytest.mark.campaign
def test_a_sweep_by_series_counts_what_a_simulation_counts():
    """A driven oscillator past the poles of tan(3 x); every zero of it adds 1 to y, which decays."""
    count = Transition("swing", "swing", "tan(3*x)", 1, {"y": "y + 1"}, name="count")
    field = {"x": "v", "v": "-0.3*v - 4*x + 3*A*cos(th)", "y": "-y"}
    system = HybridSystem(("x", "v", "y"), {"A": 1.0}, {"swing": Mode(field)}, [count], phase=("th", "1"))
    sweep = run_sweep(system, "A", [1.0, 1.1], x0=[0.0, 0.0, 0.0], options=SweepOptions(discard=20, keep=5))
    assert sweep.labels.tolist() == [["period-1", "period-1"]]
    assert sweep.states[0, 0, :3] == pytest.approx(simulate(system, None, [0.0] * 3, periods=60).x_end[:3], abs=1e-7)


def test_an_orbit_past_a_pole_of_an_event_is_admissible():
    """x = A sin(t) is the orbit; 1/(x - 1/2) has poles on it, and no zero."""
    pole = Transition("swing", "swing", "1/(x - 1/2)", 1, {"x": "x + 1"}, name="pole")
    field = {"x": "v", "v": "-v/10 - 4*x + 3*A*cos(th)"}
    system = HybridSystem(("x", "v"), {"A": 1.0}, {"swing": Mode(field)}, [pole], phase=("th", "1"))
    orbit = find_orbit(system, {"A": 1.0}, x0=[0.0, 0.0])
    assert max(orbit.max["x"], 0.5) > 0.9
    assert orbit.admissible
    assert all(continue_orbit(orbit, "A", (1.0, 1.2)).admissible)
