"""Motions that drift are told: which states grow, by how much, and what to do."""

from __future__ import annotations

import math

import pytest

import saltus
from saltus import HybridSystem, Mode, Transition
from saltus.errors import ConvergenceError

CAR = HybridSystem(
    ("x", "v"), {"c": 0.5, "w": 3.0}, {"run": Mode({"x": "v", "v": "1 - c*v + cos(s)"})}, phase=("s", "w")
)
PENDULUM = HybridSystem(("phi", "v"), {"c": 0.3, "I": 1.5}, {"turn": Mode({"phi": "v", "v": "I - c*v - sin(phi)"})})
# a hammer falls on a nail of height y, which each blow drives in by the blow's speed squared
HAMMER = HybridSystem(
    ("y", "h", "u"),
    {"r": 0.5, "d": 0.01},
    {"fall": Mode({"y": "0", "h": "u", "u": "-1"})},
    [Transition("fall", "fall", "h", -1, {"u": "1", "y": "y - d*u**2"}, name="blow")],
)


def told(system: HybridSystem, x0: list[float]) -> str:
    with pytest.raises(ConvergenceError) as caught:
        saltus.find_orbit(system, x0=x0)
    return str(caught.value)


def test_a_forced_drift_tells_its_way_in_a_period() -> None:
    text = told(CAR, [0.0, 0.0])
    assert f"drifts (x by {2.0 * math.pi / 3.0 / 0.5:.6g} at each return)" in text
    assert "after 73 forcing periods" in text
    assert "in states that do not drift" in text


def test_blows_of_a_hammer_drift() -> None:
    assert "drifts (y by -0.01 at each return)" in told(HAMMER, [0.0, 1.0, 0.0])


@pytest.mark.parametrize("x0", [[0.0, 2.5], [3.0, 8.0]])
def test_a_state_that_turns_is_offered_as_an_angle(x0: list[float]) -> None:
    assert "angles=('phi',)" in told(PENDULUM, x0)
    forced = HybridSystem(("phi",), {"w": 1.0}, {"turn": Mode({"phi": "2 + cos(s)"})}, phase=("s", "w"))
    assert "phi by 12.5664 at each return" in (text := told(forced, [0.0]))
    assert "angles=('phi',)" in text


def test_what_settles_slowly_is_no_drift() -> None:
    slow = HybridSystem(
        ("x", "y"), {"e": 1e-6, "w": 1.0}, {"m": Mode({"x": "-x + cos(s)", "y": "e*(1 - y)"})}, phase=("s", "w")
    )
    assert "drifts" not in told(slow, [0.0, 0.0])


def test_an_angle_does_not_drift() -> None:
    angled = HybridSystem(
        ("phi", "y"),
        {"w": 1.0},
        {"m": Mode({"phi": "1.2 + 0.1*cos(s)", "y": "-y"})},
        phase=("s", "w"),
        angles=("phi",),
    )
    assert "drifts" not in told(angled, [0.0, 1.0])
