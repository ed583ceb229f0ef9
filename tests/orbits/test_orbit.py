"""What an orbit says of its drive and of outputs without a value."""

import math

import pytest

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
    assert orbit.period == pytest.approx(2.0 * math.pi * k)
    assert orbit.repeats == k
    assert (f"repeats itself {k} times, as its drive does" in repr(orbit)) == (k > 1)


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
