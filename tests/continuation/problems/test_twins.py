"""Multipliers that are equal by a symmetry cross the unit circle at once: one point, whose multiplicity is told."""

from __future__ import annotations

import math

import pytest

import saltus
from saltus import StepControl

_WELL = {"x": "v", "v": "-0.2*v + x - x**3 + A*cos(theta)"}
_TWO = {f"{name}{i}": rate.replace("x", f"x{i}").replace("v", f"v{i}") for i in (1, 2) for name, rate in _WELL.items()}
PARAMETERS = {"A": 0.05, "w": 1.2}
ONE_WELL = saltus.HybridSystem.smooth(_WELL, PARAMETERS, phase=("theta", "w"))
TWO_WELLS = saltus.HybridSystem.smooth(_TWO, PARAMETERS, phase=("theta", "w"))


def told(branch):
    return sorted((p.type, p.multiplicity, round(p.value("A"), 8)) for p in branch.special_points)


@pytest.mark.parametrize("step", [0.03, 0.1, 0.3])
def test_two_equal_oscillators_have_the_points_of_one_twice(step):
    control = StepControl(largest=step)
    one = saltus.continue_orbit(saltus.find_orbit(ONE_WELL, x0=[1.0, 0.0]), "A", (0.0, 0.4), steps=control)
    both = saltus.find_orbit(TWO_WELLS, x0=[1.0, 0.0, 1.0, 0.0])
    two = saltus.continue_orbit(both, "A", (0.0, 0.4), steps=control)
    assert {kind for kind, _, _ in told(one)} == {"SN", "PD"}
    # at a fold of both the antisymmetric orbits meet as well: a branch point
    twice = [("BP" if kind == "SN" else kind, 2, value) for kind, _, value in told(one)]
    assert told(two) == sorted(twice)
    assert "(2 at once)" in repr(two)


def test_a_verified_branch_with_a_double_doubling_passes():
    both = saltus.find_orbit(TWO_WELLS, {"A": 0.2}, x0=[1.0, 0.0, 1.0, 0.0])
    checked = saltus.verify(saltus.continue_orbit(both, "A", (0.2, 0.25), directions="up"), points=3)
    assert checked.passed, checked


_R = "(x**2 + y**2)"
_PAIRS = {
    "x": f"x*(m - {_R}) - y",
    "y": f"y*(m - {_R}) + x",
    **{f"u{i}": f"u{i}*(b - {_R}/2) - w*v{i}" for i in (1, 2)},
    **{f"v{i}": f"v{i}*(b - {_R}/2) + w*u{i}" for i in (1, 2)},
}
PAIRS = saltus.HybridSystem.smooth(_PAIRS, {"m": 1.0, "b": 0.2, "w": math.sqrt(2.0)})


@pytest.mark.parametrize("step", [0.03, 0.1, 0.3])
def test_two_equal_pairs_cross_at_one_torus_point(step):
    cycle = saltus.solve_orbit(PAIRS, x0=[1.0, 0.0, 0.0, 0.0, 0.0, 0.0], period=2.0 * math.pi)
    branch = saltus.continue_orbit(cycle, "m", (0.1, 1.5), steps=StepControl(largest=step))
    assert [(p.type, p.multiplicity) for p in branch.special_points] == [("TR", 2)]
    assert branch["TR1"].value("m") == pytest.approx(0.4, abs=1e-8)
