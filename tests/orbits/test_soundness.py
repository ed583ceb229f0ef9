"""What is handed out as an orbit solves its equations, and is called what it is."""

import math

import numpy as np
import pytest

from saltus import HybridSystem, Mode, Transition, find_orbit, solve_orbit
from saltus.errors import ConvergenceError
from selection import guarding

RUNAWAY = HybridSystem(("x",), {"k": 50.0}, {"m": Mode({"x": "k*x + cos(s)"})}, phase=("s", "1"))
INVERTED = HybridSystem(
    ("x", "v"), {"k": 100.0, "u": 1.0}, {"m": Mode({"x": "v", "v": "u*k*sin(x/u) + u*cos(s)"})}, phase=("s", "1")
)


@pytest.mark.parametrize("start", [0.0, 1.0, 1.0 + 1e-13, -3.0])
@pytest.mark.parametrize("k", guarding([5.0, 20.0, 50.0, 100.0, 200.0], 5.0, 100.0))
def test_a_strongly_unstable_orbit_is_solved_in_pieces(k, start):
    """x = (cos s) (-k) / (k^2 + 1) + ..., of amplitude 1/sqrt(k^2 + 1), multiplier exp(2 pi k)."""
    orbit = solve_orbit(RUNAWAY, {"k": k}, x0=[start])
    assert orbit.max["x"] == pytest.approx(1.0 / math.hypot(k, 1.0), rel=1e-9)
    assert orbit.min["x"] == pytest.approx(-1.0 / math.hypot(k, 1.0), rel=1e-9)
    assert orbit.residual < 1e-9 * orbit.max["x"]
    if k <= 100.0:
        assert math.log(abs(orbit.multipliers[0])) == pytest.approx(2.0 * math.pi * k, rel=1e-6)


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e6])
def test_a_pendulum_shaken_about_its_upper_rest_from_a_start_at_that_rest(unit):
    """The response is -cos(s)/(k + 1) to third order of the amplitude; with 3 harmonics by harmonic balance."""
    orbit = solve_orbit(INVERTED, {"u": unit}, x0=[0.0, 0.0])
    amplitude = 1.0 / 101.0
    for _ in range(50):  # k sin(a cos s) has the first harmonic 2 k J1(a), a - a^3/8 to fifth order
        amplitude = 1.0 / (1.0 + 100.0 * (1.0 - amplitude**2 / 8.0))
    assert orbit.observe("amplitude(x, 1)")["amplitude(x, 1)"] == pytest.approx(unit * amplitude, rel=1e-8)
    assert not orbit.stable


def test_a_ring_of_runaways_is_solved_in_pieces():
    count = 4
    A = np.array([[(20.0 + 10.0 * i) * (i == j) + 0.1 * (j == (i + 1) % count) for j in range(count)]
                  for i in range(count)])  # fmt: skip
    rates = {f"x{i}": f"{20 + 10 * i}*x{i} + 0.1*x{(i + 1) % count} + cos(s)" for i in range(count)}
    ring = HybridSystem(tuple(rates), {}, {"m": Mode(rates)}, phase=("s", "1"))
    orbit = solve_orbit(ring, x0=np.zeros(count))
    wanted = np.abs(np.linalg.solve(1j * np.eye(count) - A, np.ones(count)))
    assert [orbit.max[name] for name in rates] == pytest.approx(wanted, rel=1e-9)


@pytest.mark.campaign
def test_an_orbit_too_unstable_for_its_pieces_is_refused():
    with pytest.raises(ConvergenceError):
        solve_orbit(RUNAWAY, {"k": 5000.0}, x0=[0.0])


def test_an_equilibrium_is_called_one():
    brusselator = HybridSystem.smooth({"x": "1 - (B + 1)*x + x**2*y", "y": "B*x - x**2*y"}, {"B": 1.5})
    for start in ([1.0, 1.5], [1.0 + 1e-13, 1.5]):
        with pytest.raises(ConvergenceError, match=r"x = 1, y = 1\.5 is an equilibrium"):
            solve_orbit(brusselator, x0=start, period=1.0)
    pendulum = HybridSystem.smooth({"x": "v", "v": "-sin(x)"})
    with pytest.raises(ConvergenceError, match="x = 0, v = 0 is an equilibrium"):
        solve_orbit(pendulum, x0=[0.0, 0.0], period=6.0)
    with pytest.raises(ConvergenceError, match="as in a conservative system"):
        solve_orbit(pendulum, x0=[2.0, 0.0], period=9.0)


def test_oscillators_that_do_not_act_on_each_other_are_told():
    one = {"x": "v", "v": "(1 - x**2)*v - x"}
    two = HybridSystem.smooth(one | {"y": "w", "w": "(1 - y**2)*w - y"})
    cycle = find_orbit(HybridSystem.smooth(one), x0=[2.0, 0.0])
    with pytest.raises(ConvergenceError, match=r"parts that do not act on each other, \(x, v\) and \(y, w\)"):
        solve_orbit(two, x0=[*cycle.x0, *cycle.x0], period=cycle.period)


def test_a_contact_without_speed_is_not_admissible():
    """At the amplitude |k - w^2 + i c w| the swing just reaches the wall at x = 1, and stops there."""
    c, w = 0.1, 0.7
    amplitude = math.hypot(1.0 - w * w, c * w)
    swing = HybridSystem(
        ("x", "v"), {"A": amplitude}, {"free": Mode({"x": "v", "v": f"A*cos(s) - {c}*v - x"})},
        [Transition("free", "free", "x - 1", 1, {"v": "-0.8*v"}, name="wall")], phase=("s", str(w)),
    )  # fmt: skip
    lag = math.atan2(c * w, 1.0 - w * w)  # the swing is at its top where s = lag
    orbit = solve_orbit(swing, {}, [("free", "wall", [1.0, 0.0, lag], 2.0 * math.pi / w)])
    assert abs(orbit.multipliers[0]) > 1e10
    assert not orbit.admissible
    assert "an event is met without speed, so that a multiplier is infinite" in orbit.reasons
