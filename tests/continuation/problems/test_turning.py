"""Pairs of multipliers that turn past 1 and -1."""

from __future__ import annotations

import math

import numpy as np
import pytest

from saltus import HybridSystem, Mode, Transition, continue_orbit, find_orbit
from saltus.continuation.core.monitor import Monitor
from saltus.continuation.problems.turning import followed_pairs, products

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


def test_steps_longer_than_a_quarter_turn_and_a_first_step_tell_nothing() -> None:
    assert not turned_through([-2.0, -0.4, 1.2])[0].steady
    assert not turned_through([0.3, 0.4])[0].steady


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
