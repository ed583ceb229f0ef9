"""Branches of cycles that shrink to a Hopf point lose no bifurcation on the way."""

from __future__ import annotations

import math

import pytest

import saltus
from saltus import StepControl

_R = "(x**2 + y**2)"
_Q = "(u**2 + v**2)"
# The cycle x^2 + y^2 = m has the multiplier exp(2 pi (b - m/2)) twice, as a pair: a torus point at m = 2 b.
PAIR = saltus.HybridSystem.smooth(
    {
        "x": f"x*(m - {_R} - {_Q}/2) - y",
        "y": f"y*(m - {_R} - {_Q}/2) + x",
        "u": f"u*(b - {_R}/2 - {_Q}) - w*v",
        "v": f"v*(b - {_R}/2 - {_Q}) + w*u",
    },
    {"m": 1.0, "b": 0.2, "w": math.sqrt(2.0)},
)


@pytest.mark.parametrize("step", [0.03, 0.1, 0.3])
@pytest.mark.parametrize("start", [0.1, 0.3, 1.0])
def test_a_torus_point_between_a_cycle_and_its_hopf_point_is_told(start, step):
    cycle = saltus.solve_orbit(PAIR, {"m": start}, x0=[math.sqrt(start), 0.0, 0.0, 0.0], period=2.0 * math.pi)
    branch = saltus.continue_orbit(cycle, "m", (-0.2, 1.5), steps=StepControl(largest=step))
    assert [(p.type, p.value("m")) for p in branch.special_points] == [
        ("HB", pytest.approx(0.0, abs=1e-9)),
        ("TR", pytest.approx(0.4, abs=1e-8)),
    ]
    assert not branch.stable[branch.values < 0.399].any()
    assert branch.stable[branch.values > 0.401].all()


def test_a_branch_without_one_still_ends_at_its_hopf_point():
    cycle = saltus.solve_orbit(PAIR, {"b": -0.2}, x0=[1.0, 0.0, 0.0, 0.0], period=2.0 * math.pi)
    branch = saltus.continue_orbit(cycle, "m", (-0.2, 1.5))
    assert [p.label for p in branch.special_points] == ["HB1"]
    assert branch.stable.all()
