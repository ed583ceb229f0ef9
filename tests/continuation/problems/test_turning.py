"""Pairs of multipliers that turn past 1 and -1."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from saltus import HybridSystem, Mode, Transition, continue_orbit, find_orbit, solve_orbit
from saltus.continuation.core.monitor import Monitor
from saltus.continuation.problems.turning import followed_pairs, longest_step, parting, products
from selection import guarding

RADIUS = 0.9


def turned_through(angles: list[float], radius: float = RADIUS) -> tuple:
    """A pair whose multiplier above the axis has such an angle, or less by what it parts, followed step by step."""
    pairs: tuple = ()
    for angle in angles:
        value = radius * np.exp(1j * math.acos(math.cos(angle)))
        pairs = followed_pairs(pairs, [complex(value), complex(value.conjugate())], 0.1)
    return pairs


def test_a_pair_that_turns_past_the_axis_is_followed_through_it() -> None:
    (pair,) = turned_through([-1.9, -1.2, -0.5, 0.2, 0.9])
    assert pair.steady
    assert abs(math.remainder(abs(pair.angle) - 0.9, 2.0 * math.pi)) < 1e-12
    assert abs(pair.rate) == pytest.approx(7.0)
    values, fold = [pair.value, pair.value.conjugate(), 0.5], Monitor("BP")
    assert products([pair], values, {fold: 1.0}) == {fold: ((0,), -0.5)}
    assert products([pair], [*values, complex(np.inf)], {fold: 1.0}) == {}


def test_a_pair_that_parts_far_enough_is_not_taken_to_turn_on() -> None:
    """The cosine is 1.01 times that of a steady pair: beyond (1 + r^2) / 2 r = 1.0056 the pair reaches 1."""
    parts = [math.acos(1.01 * math.cos(angle)) for angle in (-1.9, -1.2, -0.5, 0.2)]
    assert not turned_through(parts)[0].steady
    assert turned_through([math.acos(1.0001 * math.cos(angle)) for angle in (-1.9, -1.2, -0.5, 0.2)])[0].steady


def test_steps_longer_than_a_quarter_turn_and_a_first_step_next_to_the_axis_tell_nothing() -> None:
    assert not turned_through([-2.0, -0.4, 1.2])[0].steady
    assert not turned_through([0.3, 0.6])[0].steady
    assert turned_through([0.3, 0.4])[0].steady


def test_a_pair_that_may_have_parted_is_told_unless_the_step_is_fine() -> None:
    assert parting(turned_through([-1.9, -1.2, -0.5, 0.2])) is None
    assert "may part to 1 or -1" in str(
        parting(turned_through([math.acos(1.01 * math.cos(a)) for a in (-1.9, -0.5, 0.2)]))
    )
    assert parting(turned_through([-0.4, -0.2, -0.009, 0.009])) is None


def test_a_pair_that_is_too_small_or_too_large_to_reach_1_leaves_no_doubt() -> None:
    """Its cosine would have to pass 1 by (1 - r)^2 / 2 r, 9 at 0.05 and 20, and 4 at 0.1."""
    for radius, steady in ((0.05, True), (20.0, True), (0.1, False)):
        pairs = turned_through([0.3, 2.9, 0.6], radius)
        assert pairs[0].steady is steady
        assert (parting(pairs) is None) is steady
        assert math.isnan(pairs[0].rate)


def test_the_next_step_turns_no_pair_farther_than_it_can_be_followed() -> None:
    evenly = longest_step(turned_through([-1.9, -1.2, -0.5, 0.2]))
    assert 7.0 * evenly == pytest.approx(1.05)
    faster = longest_step(turned_through([0.7, 0.8, 1.0, 1.3]))
    assert 3.0 * faster + 5.0 * (faster + 0.1) * faster == pytest.approx(1.05)
    assert longest_step(turned_through([-1.9, -1.2, -0.5, 0.2], 0.05)) == math.inf
    assert longest_step(turned_through([0.3, 0.6])) == math.inf


@pytest.mark.parametrize("rounding", [(0.0, 1e-13, 0.0), (1e-13, 0.0, 2e-13), (0.0, -1e-13, -1e-13), (0.0, 0.0, 0.0)])
def test_a_pair_that_rests_leaves_steps_as_long_as_they_are(rounding) -> None:
    assert longest_step(turned_through([1.2, *(1.2 + off for off in rounding)])) > 1e4


def test_steps_are_short_enough_to_follow_pairs() -> None:
    resets = {"x": "y", "y": f"-{RADIUS**2}*x + {2.0 * RADIUS}*cos(9*p)*y - y**3", "s": "0"}
    wait = {"wait": Mode({"x": "0", "y": "0", "s": "1"})}
    system = HybridSystem(
        ("x", "y", "s"), {"p": 0.05}, wait, [Transition("wait", "wait", "s - 1", 1, resets, name="map")]
    )
    branch = continue_orbit(find_orbit(system, x0=[0.0, 0.0, 0.0]), "p", (0.05, 3.0))
    assert not branch.special_points
    assert len(branch.rejected) <= 3


def test_two_pairs_whose_angles_cross_keep_their_rates() -> None:
    pairs: tuple = ()
    for k in range(9):
        values = [0.9 * np.exp(1j * (0.5 + 0.2 * k)), 0.9 * np.exp(1j * (2.2 - 0.1 * k))]
        pairs = followed_pairs(pairs, [complex(v) for v in values] + [complex(v.conjugate()) for v in values], 0.1)
    assert sorted(pair.rate for pair in pairs) == pytest.approx([-1.0, 2.0])


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
