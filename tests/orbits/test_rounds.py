"""How many times an orbit goes round a shorter one."""

from __future__ import annotations

import math

import pytest

from saltus.orbits import find_orbit, solve_orbit
from saltus.system import HybridSystem, Mode


def test_forced_smooth_orbit_of_three_periods_is_found_to_repeat_one() -> None:
    driven = HybridSystem(("x",), {"w": 2.0}, {"free": Mode({"x": "cos(s) - x"})}, phase=("s", "w"))
    x0 = 1.0 / 5.0
    once = solve_orbit(driven, {}, [("free", "s", [x0], math.pi)])
    thrice = solve_orbit(driven, {}, [("free", "s", [x0], 3.0 * math.pi)])
    assert (once.rounds, thrice.rounds) == (1, 3)
    assert "3 times round" in repr(thrice)
    assert "times round" not in repr(once)


def test_impacting_orbit_twice_round_is_told(impact_oscillator: HybridSystem) -> None:
    once = find_orbit(impact_oscillator, {"A": 1.0, "w": 1.0}, x0=[0.0, 0.0])
    guess = [(part.mode, part.transition, part.state, part.duration) for part in once.segments]
    twice = solve_orbit(impact_oscillator, dict(once.parameters), guess * 2)
    assert (once.rounds, twice.rounds) == (1, 2)


def test_autonomous_hybrid_cycle_four_times_round_is_told(two_fields: HybridSystem) -> None:
    once = find_orbit(two_fields, x0=[-0.5, 0.5])
    guess = [(part.mode, part.transition, part.state, part.duration) for part in once.segments]
    assert once.rounds == 1
    assert solve_orbit(two_fields, dict(once.parameters), guess * 4).rounds == 4


@pytest.mark.parametrize("rounds", [2, 3, 5, 6])
def test_smooth_cycle_several_times_round_is_told(rounds: int) -> None:
    field = {"x": "mu*x - y - x*(x**2 + y**2)", "y": "x + mu*y - y*(x**2 + y**2)"}
    planar = HybridSystem(("x", "y"), {"mu": 0.1}, {"m": Mode(field)})
    orbit = solve_orbit(planar, {}, [("m", None, [math.sqrt(0.1), 0.0], 2.0 * math.pi * rounds)])
    assert orbit.rounds == rounds


def test_orbit_of_twice_the_period_of_its_drive_goes_once_round() -> None:
    parametric = HybridSystem(
        ("x", "v"),
        {"w": 2.0, "d": 0.1},
        {"m": Mode({"x": "v", "v": "-(1 + 0.6*cos(s))*x - d*v - x**3"})},
        phase=("s", "w"),
    )
    orbit = find_orbit(parametric, x0=[0.5, 0.0])
    assert orbit.form.turns == 2
    assert orbit.rounds == 1


def test_orbit_at_rest_goes_round_each_period_of_the_drive() -> None:
    still = HybridSystem(("x",), {"p": 0.5}, {"m": Mode({"x": "p - x"})}, phase=("s", "1"))
    assert solve_orbit(still, {}, [("m", "s", [0.5], 4.0 * math.pi)]).rounds == 2
    assert find_orbit(still, x0=[0.1]).form.turns == 1
