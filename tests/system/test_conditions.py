"""Conditions that are the speed at which a surface is crossed."""

import pytest

from saltus import HybridSystem, Mode, Transition


@pytest.mark.parametrize(
    ("event", "direction", "when", "found"),
    [
        ("x - d", 1, "v", True),
        ("x - d", 1, "3*v", True),
        ("d - x", -1, "v", True),
        ("k*(x - d)**3", 1, "k*v", False),  # the speed has the square of the distance as a factor
        ("k*(x - d)", 1, "v", True),
        ("x - d", 1, "-v", False),
        ("x - d", 1, "v - 0.1", False),
        ("x - d", 0, "v", False),
        ("x - d*cos(s)", 1, "v + d*w*sin(s)", True),
        ("x - d*cos(s)", 1, "v", False),
        ("x - d", 1, None, False),
    ],
)
def test_a_condition_on_the_speed_is_told_by_its_formula(event, direction, when, found):
    system = HybridSystem(
        ("x", "v"), {"d": 1.0, "k": 2.0, "w": 0.7}, {"free": Mode({"x": "v", "v": "cos(s) - x"})},
        [Transition("free", "free", event, direction, {"v": "-v"}, when=when)], phase=("s", "w"),
    )  # fmt: skip
    assert system.velocity_conditions == frozenset([0] if found else [])
