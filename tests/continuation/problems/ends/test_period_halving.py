"""Where a branch of doubled period ends: its last orbit is the shorter one, gone round twice."""

import numpy as np

from saltus import HybridSystem, Mode, Transition, continue_orbit, find_orbit


def test_where_one_impact_a_period_doubles_both_impacts_are_equal():
    """Halves that differ by rounding put the second start before the impact: a motion through the seat."""
    valve = HybridSystem(
        states=("x", "v", "p"),
        parameters={"q": 6.05, "kappa": 1.25, "beta": 20.0, "delta": 10.0, "r": 0.8},
        modes={"open": Mode({"x": "v", "v": "p - kappa*v - x - delta", "p": "beta*(q - x*sqrt(p))"})},
        transitions=[Transition("open", "open", event="x", direction=-1, reset={"v": "-r*v"}, name="seat")],
        name="relief valve",
    )
    branch = continue_orbit(find_orbit(valve, {"q": 5.8}, x0=[2.0, 0.0, 12.0]), "q", bounds=(5.7, 6.07))
    orbit = branch["BP1"].orbit
    first, second = orbit.segments
    np.testing.assert_allclose(second.state, first.state, atol=1e-9)
    assert abs(first.duration - second.duration) < 1e-9
    assert orbit.min["x"] > -1e-9
