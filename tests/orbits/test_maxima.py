"""Maxima of orbits, how they depend on parameters, and where they are greatest along a branch; most in closed form."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import brentq

import systems
from saltus import HybridSystem, Mode, Transition, continue_orbit, solve_orbit
from saltus.results import PeriodicOrbit
from selection import guarding

DIFFERENCED = 1e-8
"""Relative error of a slope by differences at four points 1e-3 apart, of values with errors of 1e-12."""

Solve = Callable[[dict[str, float]], PeriodicOrbit]


def slope(value: Callable[[float], float], at: float) -> float:
    """Return a derivative by the central difference of fourth order."""
    h = 1e-3 * at
    near, far = (value(at + k * h) - value(at - k * h) for k in (1.0, 2.0))
    return (8.0 * near - far) / (12.0 * h)


@pytest.fixture(scope="module")
def linear() -> HybridSystem:
    field = {"x": "v", "v": "A*cos(s) - c*v - k*x"}
    return HybridSystem.smooth(field, {"k": 1.0, "c": 0.1, "A": 1.0, "w": 1.1}, phase=("s", "w"))


@pytest.fixture(scope="module")
def duffing() -> HybridSystem:
    field = {"x": "v", "v": "A*cos(s) - c*v - x - x**3"}
    return HybridSystem.smooth(field, {"c": 0.1, "A": 0.5, "w": 1.2}, phase=("s", "w"))


@pytest.fixture(scope="module")
def friction() -> HybridSystem:
    """Return a driven oscillator on a belt: faster than the belt (P), slower (M), or stuck to it (S)."""
    return HybridSystem(
        ("x", "v"),
        {"F": 0.4, "u": 0.3, "w": 0.6},
        {
            "P": Mode({"x": "v", "v": "cos(s) - x - F"}),
            "M": Mode({"x": "v", "v": "cos(s) - x + F"}),
            "S": Mode({"x": "u", "v": "0"}),
        },
        [
            Transition("M", "P", "v - u", 1, name="overtakes"),
            Transition("P", "S", "v - u", -1, {"v": "u"}, name="sticks"),
            Transition("S", "M", "cos(s) - x + F", -1, name="slips"),
        ],
        phase=("s", "w"),
    )


def swept(system: HybridSystem) -> Solve:
    """Return what solves the orbit of a driven system at other parameters."""
    start = solve_orbit(system, x0=[1.1, 0.0])
    return lambda parameters: solve_orbit(system, parameters, x0=start.x0)


def sliding(system: HybridSystem) -> Solve:
    durations = (5.465404127244443, 4.183504304163894, 0.823067080557641)
    angles = 0.2371220509225717 + 0.6 * np.cumsum([0.0, *durations])
    starts = ([1.372018047367355, 0.3, angles[0]], [-1.8, 0.3, angles[1]], [1.13, 0.3, angles[2]])
    ends = (("M", "overtakes"), ("P", "sticks"), ("S", "slips"))
    guess = [(*end, start, duration) for end, start, duration in zip(ends, starts, durations, strict=True)]
    return lambda parameters: solve_orbit(system, parameters, guess)


def test_greatest_displacement_and_speed_of_a_linear_oscillator(linear: HybridSystem) -> None:
    orbit = swept(linear)({})
    assert orbit.max["x"] == pytest.approx(4.218245406095978, rel=1e-12)
    assert orbit.max["v"] == pytest.approx(1.1 * 4.218245406095978, rel=1e-12)
    assert orbit.observe("amplitude(x, 1)")["amplitude(x, 1)"] == pytest.approx(4.218245406095978, rel=1e-12)


@pytest.mark.parametrize("name", ["max_x", "amplitude(x, 1)"])
@pytest.mark.parametrize(
    ("parameter", "wanted"),
    [("A", 4.218245406095978), ("k", 15.76212696228034), ("c", -9.081987440171056), ("w", -35.50231453885049)],
)
def test_slopes_of_the_amplitude_of_a_linear_oscillator(
    linear: HybridSystem, name: str, parameter: str, wanted: float
) -> None:
    solve = swept(linear)
    found = slope(lambda p: read(solve({parameter: p}), name), linear.parameters[parameter])
    assert found == pytest.approx(wanted, rel=DIFFERENCED)


def read(orbit: PeriodicOrbit, name: str) -> float:
    return orbit.max["x"] if name == "max_x" else float(orbit.observe(name)[name])


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("name", "most", "w"),
    guarding(
        [
            ("max_x", 10.01252348643518, 0.9974968671630),
            ("amplitude(x, 1)", 10.01252348643518, 0.9974968671630),
            ("max_v", 10.0, 1.0),
        ],
        ("max_x", 10.01252348643518, 0.9974968671630),
    ),
)
def test_resonance_of_a_linear_oscillator_is_where_its_amplitude_turns(
    linear: HybridSystem, name: str, most: float, w: float
) -> None:
    orbit = solve_orbit(linear, x0=[1.1, 0.0], fix={name: 4.3}, free="w")
    branch = continue_orbit(orbit, name, (4.2, 12.0))
    assert [point.type for point in branch.special_points] == ["TP"]
    top = branch["TP1"]
    assert top.value(name) == pytest.approx(most, rel=1e-12)
    assert top.parameters["w"] == pytest.approx(w, rel=1e-9)


BELT = {"Fs": (4.901960784313725, 0.857492925712544), "Fk": (-4.901960784313725, 0.142507074287456),
        "v0": (-8.169934640522876, 0.514495755427527)}  # fmt: skip


@pytest.mark.parametrize("parameter", BELT)
def test_slopes_of_period_and_reach_of_a_block_on_a_belt(parameter: str) -> None:
    belt = systems.stick_slip()
    guess = [("slip", "catch", [0.9, 0.3], 4.0), ("stick", "release", [-0.05, 0.3], 3.0)]
    at = belt.parameters[parameter]
    period, reach = BELT[parameter]
    orbits = functools.cache(lambda p: solve_orbit(belt, {parameter: p}, guess))
    assert slope(lambda p: orbits(p).period, at) == pytest.approx(period, rel=DIFFERENCED)
    assert slope(lambda p: orbits(p).max["x"], at) == pytest.approx(reach, rel=DIFFERENCED)


def test_a_sliding_orbit_reaches_and_sticks_as_in_print(friction: HybridSystem) -> None:
    orbit = sliding(friction)({})
    assert orbit.max["x"] == pytest.approx(1.590482681836873, rel=1e-12)
    assert orbit.durations[2] == pytest.approx(0.823067080557641, rel=1e-11)
    assert orbit.segments[0].state[2] == pytest.approx(0.237122050922572, rel=1e-11)
    assert np.sort(np.abs(orbit.multipliers)) == pytest.approx([0.0, 0.5803268689697], abs=1e-11)


FRICTION = {
    "w": (1.799731289906542, -15.82939620536257, -5.536483173543649),
    "F": (0.107947632708561, 2.768920146550127, 2.590978293215913),
    "u": (1.010884203012708, 2.881802821656006, -0.370070390109363),
}


@pytest.mark.parametrize("parameter", FRICTION)
def test_slopes_of_reach_stick_and_exit_of_a_sliding_orbit(friction: HybridSystem, parameter: str) -> None:
    orbits = functools.cache(lambda p: sliding(friction)({parameter: p}))
    at = friction.parameters[parameter]
    found = (
        slope(lambda p: orbits(p).max["x"], at),
        slope(lambda p: orbits(p).durations[2], at),
        slope(lambda p: orbits(p).segments[0].state[2], at),
    )
    assert found == pytest.approx(FRICTION[parameter], rel=20.0 * DIFFERENCED)  # fifth derivatives are larger here


@pytest.mark.parametrize(("parameter", "wanted"), [("w", 1.1648354693), ("c", -0.1649331205), ("A", 0.4888856049)])
def test_slopes_of_the_reach_of_duffings_oscillator(duffing: HybridSystem, parameter: str, wanted: float) -> None:
    solve = swept(duffing)
    assert solve({}).max["x"] == pytest.approx(1.104462419581, abs=1e-12)
    found = slope(lambda p: solve({parameter: p}).max["x"], duffing.parameters[parameter])
    assert found == pytest.approx(wanted, rel=DIFFERENCED)


@pytest.mark.campaign
def test_folds_and_greatest_reach_of_duffings_oscillator(duffing: HybridSystem) -> None:
    branch = continue_orbit(swept(duffing)({}), "w", (0.3, 3.0))
    folds = [(point.parameters["w"], point.orbit.max["x"]) for point in branch.special_points.of_type("SN")]
    assert len(folds) == 2
    assert folds[0] == pytest.approx((2.211935317020, 2.315979800650), abs=2e-11)
    assert folds[1] == pytest.approx((1.438670145514, 0.699671905673), abs=2e-11)
    reach = branch.column("max_x")
    near = branch.solution(int(np.argmax(reach)))
    freed = solve_orbit(duffing, near.parameters, x0=near.x0, fix={"max_x": near.max["x"]}, free="w")
    top = continue_orbit(freed, "max_x", (2.0, 2.5))["TP1"]
    # the slope of the reach along the branch comes from differences, and so does the place where it vanishes
    assert top.value("max_x") == pytest.approx(2.317827633297, abs=5e-12)
    assert top.parameters["w"] == pytest.approx(2.2105446945534, abs=DIFFERENCED)
    assert top.orbit.x0 == pytest.approx([0.04759249, 4.44726994], abs=1e-6)  # changes with w 30 times as much
    assert np.sort_complex(top.orbit.multipliers) == pytest.approx(
        [0.86449664 - 0.07234539j, 0.86449664 + 0.07234539j], abs=1e-7
    )
    assert math.dist(top.orbit.x0, near.x0) > 1e-6  # the branch's own points lie beside it


@pytest.mark.parametrize("before", [False, True])
@pytest.mark.parametrize("share", [5e-6, 2e-5, 5e-5, 1e-4, 2e-4, 5e-4, 2e-3])
@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_an_extreme_beside_a_kick_is_found(unit: float, share: float, before: bool) -> None:
    """An oscillator is kicked each turn; its extreme of x lies a share of the turn behind the kick, or before."""
    # behind a kick the motion grows, so that it comes back with speed where it left with none
    c, jump = (0.2 if before else -0.2), -unit

    def at(t: float) -> np.ndarray:
        rate = math.sqrt(1.0 - c * c / 4.0)
        sine, cosine = math.sin(rate * t) / rate, math.cos(rate * t)
        inner = [[cosine + c / 2.0 * sine, sine], [-sine, cosine - c / 2.0 * sine]]
        return math.exp(-c * t / 2.0) * np.array(inner)

    def start(turn: float) -> np.ndarray:
        return np.linalg.solve(np.eye(2) - at(turn), [0.0, jump])

    def rate(turn: float) -> float:  # of x, at the place that is to be the greatest
        place = turn * (1.0 - share) if before else turn * share
        return float((at(place) @ start(turn))[1]) / unit

    turns = np.linspace(2.0, 9.0, 400)
    rates = [rate(turn) for turn in turns]
    found = 0
    for low, high, one, other in zip(turns, turns[1:], rates, rates[1:], strict=False):
        if one * other >= 0.0 or abs(one - other) > 1.0:
            continue
        turn = float(brentq(rate, low, high, xtol=1e-14))
        begin, place = start(turn), turn * (1.0 - share) if before else turn * share
        extreme = float((at(place) @ begin)[0])
        times = np.linspace(0.0, turn, 2001)
        values = np.array([(at(t) @ begin)[0] for t in times])
        sign = 1.0 if extreme > values.mean() else -1.0
        if float((sign * values).max()) > sign * extreme + 1e-12 * unit:
            continue
        system = HybridSystem(
            ("x", "v"),
            {"c": c, "J": jump, "w": 2.0 * math.pi / turn},
            {"free": Mode({"x": "v", "v": "-x - c*v"})},
            [Transition("free", "free", "sin(s - 1)", 1, {"v": "v + J"}, name="kick")],
            phase=("s", "w"),
        )
        orbit = solve_orbit(system, segments=[("free", "kick", [*begin.tolist(), 1.0], turn)])
        best = orbit.max["x"] if sign > 0.0 else orbit.min["x"]
        assert best == pytest.approx(extreme, abs=1e-11 * float(np.ptp(values))), (turn, sign)
        found += 1
    assert found
