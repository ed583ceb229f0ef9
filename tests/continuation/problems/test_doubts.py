"""Steps of orbits are searched for multipliers that become critical and come back."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from saltus import HybridSystem, Mode, StepControl, Transition, continue_orbit, find_orbit, solve_orbit
from saltus.continuation.core.monitor import Monitor
from saltus.continuation.core.zero_problem import Event, Examined
from saltus.continuation.problems.doubts import in_order, passing
from saltus.continuation.problems.orbit_data import OrbitData
from selection import guarding

RADIUS = 0.9


def test_steps_are_short_enough_to_follow_pairs() -> None:
    resets = {"x": "y", "y": f"-{RADIUS**2}*x + {2.0 * RADIUS}*cos(9*p)*y - y**3", "s": "0"}
    wait = {"wait": Mode({"x": "0", "y": "0", "s": "1"})}
    system = HybridSystem(
        ("x", "y", "s"), {"p": 0.05}, wait, [Transition("wait", "wait", "s - 1", 1, resets, name="map")]
    )
    branch = continue_orbit(find_orbit(system, x0=[0.0, 0.0, 0.0]), "p", (0.05, 3.0))
    assert not branch.special_points
    assert len(branch.rejected) <= 3


def test_every_pair_that_parts_to_1_or_minus_1_and_comes_back_is_found() -> None:
    """A map with determinant r^2 and trace 2 r (1 + e) cos(3 p) has multipliers 1 and -1 at closed forms."""
    trace, excess = f"{2.0 * RADIUS} * 1.02 * cos(3*p)", 1.02
    resets = {"x": "y", "y": f"-{RADIUS**2}*x + {trace}*y - y**3", "s": "0"}
    system = HybridSystem(
        ("x", "y", "s"),
        {"p": 0.3},
        {"wait": Mode({"x": "0", "y": "0", "s": "1"})},
        [Transition("wait", "wait", "s - 1", 1, resets, name="map")],
    )
    branch = continue_orbit(find_orbit(system, x0=[0.0, 0.0, 0.0]), "p", (0.3, 3.0))
    away = math.acos((1.0 + RADIUS**2) / (2.0 * RADIUS * excess))
    found = sorted(point.parameters["p"] for point in branch.special_points)
    expected = sorted((k * math.pi + side * away) / 3.0 for k in (1, 2) for side in (-1.0, 1.0))
    assert found == pytest.approx(expected, abs=1e-8)


def chain(seed: int) -> tuple[HybridSystem, list[tuple[float, str]]]:
    """A map of two or three pairs that part and come back at several rates, in turned axes, and its special points."""
    random = np.random.default_rng(seed)
    pairs = int(random.integers(2, 4))
    axes = np.linalg.qr(random.normal(size=(2 * pairs, 2 * pairs)))[0].tolist()
    names = [f"x{k}" for k in range(2 * pairs)]
    along = [
        "(" + " + ".join(f"({row[i]})*{name}" for row, name in zip(axes, names, strict=True)) + ")"
        for i in range(2 * pairs)
    ]
    images, points = [], []
    places = np.linspace(0.0, 3.0, 20001)
    for k in range(pairs):
        square, rate, begin, size = (
            float(random.uniform(*ends)) for ends in ((0.5, 0.95), (1, 9), (0, 6), (0.9, 1.15))
        )
        trace = f"{2.0 * math.sqrt(square) * size}*cos({rate}*p + {begin})"
        images += [along[2 * k + 1], f"(-{square}*{along[2 * k]} + {trace}*{along[2 * k + 1]} - {along[2 * k + 1]}**3)"]
        for kind, sign in (("BP", 1.0), ("PD", -1.0)):

            def over(p, sign=sign, square=square, rate=rate, begin=begin, size=size):
                return 1.0 + square - sign * 2.0 * math.sqrt(square) * size * math.cos(rate * p + begin)

            signs = np.sign([over(p) for p in places])
            points += [(brentq(over, places[i], places[i + 1]), kind) for i in np.nonzero(signs[1:] != signs[:-1])[0]]
    resets = {
        name: " + ".join(f"({a})*{image}" for a, image in zip(row, images, strict=True))
        for name, row in zip(names, axes, strict=True)
    }
    wait = Mode(dict.fromkeys(names, "0") | {"s": "1"})
    turn = Transition("wait", "wait", "s - 1", 1, resets | {"s": "0"}, name="map")
    return HybridSystem((*names, "s"), {"p": 0.0}, {"wait": wait}, [turn]), sorted(points)


@pytest.mark.parametrize("seed", guarding([0, 7, 9, 11, 13, 14], 9, campaign=3))
def test_all_special_points_of_pairs_that_turn_fast_are_found(seed: int) -> None:
    system, expected = chain(seed)
    orbit = solve_orbit(system, {}, [("wait", "map", [0.0] * len(system.states), 1.0)])
    branch = continue_orbit(orbit, "p", (0.0, 3.0))
    found = sorted((point.parameters["p"], point.type) for point in branch.special_points)
    assert [kind for _, kind in found] == [kind for _, kind in expected]
    assert [place for place, _ in found] == pytest.approx([place for place, _ in expected], abs=1e-7)


@pytest.mark.parametrize("largest", [0.04, 0.05, 0.1])
def test_a_multiplier_that_touches_1_where_the_period_halves_does_not_stop_the_branch(largest: float) -> None:
    """Errors of the equations part the branch point from the fold by up to 5e-5; the multiplier passes 1 at both."""
    parameters = {"A": 0.2081511141329862, "d": 0.45495686328125307, "k": 11.938908750721712, "W": 1.10011515466483}
    parameters |= {"z0": 0.04447082423660209, "z1": 0.01996415372983067, "w0": 1.0, "w1": 2.3074738351709856}
    parameters |= {"f0": 0.9546922720036848, "f1": 0.7125003511078567}
    tip, force = "(f0*q0 + f1*q1)", "k*(f0*q0 + f1*q1 - d)"
    free = {}
    for i in "01":
        free |= {f"q{i}": f"v{i}", f"v{i}": f"-2*z{i}*w{i}*v{i} - w{i}**2*q{i} + f{i}*A*cos(s)"}
    touch = free | {f"v{i}": free[f"v{i}"] + f" - f{i}*({force})" for i in "01"}
    on, off = (Transition(*way, f"{tip} - d", sign) for way, sign in ((("free", "touch"), 1), (("touch", "free"), -1)))
    modes = {"free": Mode(free), "touch": Mode(touch)}
    system = HybridSystem(("q0", "v0", "q1", "v1"), parameters, modes, [on, off], phase=("s", "W"))
    steps = StepControl(largest=largest)
    branch = continue_orbit(find_orbit(system, x0=[0.0] * 4), "W", (parameters["W"], 1.5487), steps=steps)
    assert branch.stopped[-1].endswith("the period halves")
    last = branch.special_points[-1]
    assert last.type == "BP"
    assert last.parameters["W"] == pytest.approx(1.1096599561613, abs=1e-8)
    assert [point.type for point in branch.special_points] == ["PD", "GR", "PD", "SN", "SN", "GR", "PD", "PD", "BP"]


@pytest.mark.parametrize("largest", [0.01, 0.1])
def test_a_doubled_orbit_does_not_become_the_single_one_without_a_branch_point(largest: float) -> None:
    """Its fold and the halving lie within 1e-4 of the state, and both orbits have as many unstable multipliers."""
    moved, fold, place = "(x - 1000)", 0.05, 6.25e-4
    fourth = place / fold**4
    image = f"1000 - {moved}*(1 + p - {2.0 * fourth * fold**2}*{moved}**2 + {fourth}*{moved}**4)"
    system = HybridSystem(
        ("x", "s"),
        {"p": 0.0},
        {"wait": Mode({"x": "0", "s": "1"})},
        [Transition("wait", "wait", "s - 1", 1, {"x": image, "s": "0"}, name="map")],
    )
    square = 1.9 * fold**2
    start = {"p": 2.0 * fourth * fold**2 * square - fourth * square**2}
    states = [[1000.0 + side * math.sqrt(square), 0.0] for side in (1.0, -1.0)]
    orbit = solve_orbit(system, start, [("wait", "map", state, 1.0) for state in states])
    branch = continue_orbit(orbit, "p", (-1.0, 1.0), steps=StepControl(largest=largest))
    assert branch.stopped[-1].endswith("the period halves")
    assert {point.type for point in branch.special_points} == {"SN", "BP"}
    assert branch["SN1"].parameters["p"] == pytest.approx(place, rel=1e-5)
    assert branch["BP1"].parameters["p"] == pytest.approx(0.0, abs=1e-12)


def end(arc: float, values: list[complex], kind: str = "") -> Any:
    """Return a point of smooth orbits in pieces with its multipliers, or an event of a kind there."""
    data = OrbitData(SimpleNamespace(), np.array([*values, 1.0], complex), 0, tuple(values))
    point = SimpleNamespace(arc=arc, examined=Examined({}, None, data))
    return Event(Monitor(kind), point, 0.0) if kind else point


@pytest.mark.parametrize("rising", [False, True])
@pytest.mark.parametrize("swapped", [False, True])
def test_a_multiplier_passes_1_and_minus_1_in_its_order_whatever_rounding_makes_of_it(
    rising: bool, swapped: bool
) -> None:
    cut = SimpleNamespace(signature=SimpleNamespace(flies=False, is_cut=True))
    sense, product = (-1.0 if rising else 1.0), 1e-30
    rows = [[value, product / value] for value in (sense * 1e7, 40.0, -7.0, sense * -2e7)]
    expected = ["PD", "SN"] if rising else ["SN", "PD"]
    kinds = expected[::-1] if swapped else expected
    events = [end(arc, row, kind) for arc, row, kind in zip((0.5, 0.6), rows[1:3], kinds, strict=True)]
    found = in_order(cut, events, end(0.0, rows[0]), end(1.0, rows[3]))
    assert [event.name.kind for event in found] == expected
    assert [event.point.arc for event in found] == [0.5, 0.6]
    for event in found:
        told = event.point.examined.data.told.real
        assert told[0] == {"SN": 1.0, "PD": -1.0}[event.name.kind]
        assert math.prod(told) == pytest.approx(product, rel=1e-14)


@pytest.mark.parametrize(
    ("first", "last", "kind", "index"),
    [
        ([1e7, 1e-9], [-1e7, -1e-9], "SN", 0),
        ([1e7, 0.5], [-1e7, 2.0], "SN", None),  # both pass 1: which one is where is not told
        ([3.0 + 1j, 3.0 - 1j], [-3.0 + 0j, 0.5], "SN", None),  # a pair at one end
        ([-3.0, 1e-9], [-0.5, 1e-8], "SN", None),
        ([-3.0, 1e-9], [-0.5, 1e-8], "PD", 0),
    ],
)
def test_a_multiplier_that_passes_is_told_by_the_ends_of_the_step(first, last, kind: str, index: int | None) -> None:
    for flies, is_cut in ((False, True), (True, True), (False, False)):
        problem = SimpleNamespace(signature=SimpleNamespace(flies=flies, is_cut=is_cut))
        smooth = is_cut and not flies
        assert passing(problem, kind, end(0.0, first), end(1.0, last)) == (index if smooth else None)
