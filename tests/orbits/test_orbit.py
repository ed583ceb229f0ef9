"""What an orbit says of its drive and of outputs without a value."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from saltus import HybridSystem, Mode, Transition, continue_orbit, find_orbit, solve_orbit


@pytest.mark.parametrize(
    ("k", "drive"), [(1, "cos(s)"), (2, "cos(2*s)"), (3, "cos(3*s)"), (4, "cos(4*s)"), (1, "cos(2*s) + cos(3*s)")]
)
def test_a_phase_that_runs_through_several_periods_of_its_drive_is_told(k, drive):
    system = HybridSystem(
        ("x", "v"), {"w": 1.0}, {"m": Mode({"x": "v", "v": f"-0.1*v - 2*x + x**2 + 0.1*({drive})"})},
        phase=("s", f"w/{k}"),
    )  # fmt: skip
    orbit = find_orbit(system, x0=[0.0, 0.0])
    assert orbit.period == pytest.approx(2.0 * math.pi)
    assert orbit.repeats == k
    assert (f"the drive repeats {k} times per turn of s" in repr(orbit)) == (k > 1)


def test_impacts_twice_in_the_round_of_a_phase_are_told():
    system = HybridSystem(
        ("x", "v"), {"w": 1.0}, {"free": Mode({"x": "v", "v": "cos(2*s) - 0.1*v - x"})},
        [Transition("free", "free", "x - 1", 1, {"v": "-0.8*v"}, name="impact")], phase=("s", "w/2"),
    )  # fmt: skip
    guess = [("free", "impact", [1.0, -1.3, 0.05], 6.28), ("free", "impact", [1.0, -1.3, 0.05 + math.pi], 6.28)]
    assert solve_orbit(system, {}, guess).repeats == 2


def test_extremes_of_an_output_without_a_value_on_part_of_the_orbit_are_none():
    """x = 10 sin(s): log(x) has no value on half the orbit, log(x + 20) has one everywhere."""
    system = HybridSystem(
        ("x", "v"), {"A": 1.0}, {"m": Mode({"x": "v", "v": "-0.1*v - x + A*cos(s)"})}, phase=("s", "1"),
        outputs={"r": "log(x)", "l": "log(x + 20)"},
    )  # fmt: skip
    orbit = find_orbit(system, x0=[0.0, 0.0])
    assert math.isnan(orbit.min["r"])
    assert math.isnan(orbit.max["r"])
    assert (orbit.min["l"], orbit.max["l"]) == pytest.approx((math.log(10.0), math.log(30.0)), rel=1e-9)
    branch = continue_orbit(orbit, "A", (0.5, 1.5))
    assert all(math.isnan(value) for value in branch.highs[:, 3])
    assert branch.highs[:, 4] == pytest.approx([math.log(20.0 + 10.0 * A) for A in branch.values], rel=1e-8)


@pytest.mark.parametrize("mode", ["flight", "stance"])
def test_a_reset_that_depends_on_the_state_leaves_a_runner_the_slope_of_its_map_of_heights(mode):
    """A spring leg leaves the ground at length 1 and is swung ahead; the height of a flight maps to the next one's."""
    energy, k, alpha, spring = 2.3, 20.0, math.radians(65.0), "20*(1/sqrt(x**2 + y**2) - 1)"
    system = HybridSystem(
        ("x", "y", "u", "v"),
        {"alpha": alpha},
        {
            "stance": Mode({"x": "u", "y": "v", "u": f"{spring}*x", "v": f"{spring}*y - 1"}),
            "flight": Mode({"x": "0", "y": "v", "u": "0", "v": "-1"}),
        },
        [
            Transition("stance", "flight", "x**2 + y**2 - 1", 1, {"x": "0"}),
            Transition("flight", "stance", "y - sin(alpha)", -1, {"x": "-cos(alpha)", "u": "sqrt(2*(2.3 - y) - v**2)"}),
        ],
    )

    def next_height(height):
        def stance(_, s):
            force = k * (1.0 / math.hypot(s[0], s[1]) - 1.0)
            return s[2], s[3], force * s[0], force * s[1] - 1.0

        def leaves(_, s):
            return s[0] ** 2 + s[1] ** 2 - 1.0

        leaves.terminal, leaves.direction = True, 1.0
        v = -math.sqrt(2.0 * (height - math.sin(alpha)))
        start = -math.cos(alpha), math.sin(alpha), math.sqrt(2.0 * (energy - height)), v
        end = solve_ivp(stance, (0.0, 9.0), start, "DOP853", events=leaves, rtol=1e-12, atol=1e-13).y[:, -1]
        return end[1] + 0.5 * end[3] ** 2

    first = find_orbit(system, x0=[0.0, 0.92, math.sqrt(2.0 * (energy - 0.92)), 0.0], mode="flight")
    start = next(segment.state for segment in first.segments if segment.mode == mode)
    orbit = find_orbit(system, x0=start, mode=mode)
    height = orbit.max["y"]
    assert next_height(height) == pytest.approx(height, abs=1e-9)
    slope = (next_height(height + 1e-5) - next_height(height - 1e-5)) / 2e-5
    others = sorted(orbit.multipliers, key=lambda mu: abs(mu - 1.0))[1:]  # without the trivial one
    assert sorted(np.abs(others)) == pytest.approx([0.0, 0.0, abs(slope)], abs=1e-6)
