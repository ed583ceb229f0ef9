"""Why a motion is unresolved, against closed forms: what grows for ever, what falls below all doubles."""

from __future__ import annotations

import math
import warnings

import pytest

from saltus import HybridSystem, Map, Mode, Transition, run_sweep
from saltus.options import SweepOptions
from saltus.sweeps.section import Section

CHARGED = (
    HybridSystem(  # a current that starts above its peak is never switched off: it grows by r in each unit of time
        ("i",),
        {"r": 3.0, "peak": 1.0, "w": 2.0 * math.pi},
        {"on": Mode({"i": "r"}), "off": Mode({"i": "-10*i"})},
        [
            Transition("on", "off", event="i - peak", direction=1, name="peak"),
            Transition("off", "on", at_phase=0, name="clock"),
        ],
        phase=("th", "w"),
    )
)


def test_what_grows_for_ever_is_told_with_its_pace_and_the_event_it_passed():
    options = SweepOptions(mode="on", follow="restart")
    sweep = run_sweep(CHARGED, "r", [0.5, 3.0], x0=[2.0], options=options)
    assert sweep.labels.ravel().tolist() == ["unresolved"] * 2
    for reason, rate in zip(sweep.reasons[0], (0.5, 3.0), strict=True):
        assert f"i changes by {rate:.6g} every return, always alike: a larger discard or keep tells no more" in reason
        assert "in mode 'on' it is beyond event 'peak', which it does not meet again" in reason
        assert "may tell" not in reason


def test_a_map_that_goes_on_in_two_steps_is_told_with_both():
    system = Map(("n", "s"), {"a": 2.0}, {"n": "n + a + s", "s": "-s"})
    sweep = run_sweep(system, "a", [2.0], x0=[0.0, 0.5])
    assert sweep.labels[0, 0] == "unresolved"
    assert "n changes by 4 every 2 returns" in sweep.reasons[0, 0]


@pytest.mark.parametrize("unit", [1.0, 1e-9, 1e9])
def test_a_heteroclinic_cycle_is_unresolved_and_says_why(unit):
    # it attracts where al + be > 2 (May and Leonard 1975); all populations stay below 1
    system = HybridSystem.smooth(
        {a: f"{unit!r}*{a}*(1 - {a} - al*{b} - be*{c})" for a, b, c in ("xyz", "yzx", "zxy")}, {"al": 1.2, "be": 0.9}
    )
    options = SweepOptions(section=Section("x-y", 1), follow="restart")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        sweep = run_sweep(system, "al", [1.2, 1.4], x0=[0.5, 0.3, 0.2], options=options)
    assert sweep.labels.ravel().tolist() == ["unresolved"] * 2
    assert all("fell below the least double" in reason for reason in sweep.reasons[0])


def test_a_motion_that_comes_to_rest_without_its_predator_does_not_return():
    # (d - c*x) > 0 at the prey's rest, x = 1: the predator dies out for good
    system = HybridSystem.smooth({"x": "x*(1 - x - y)", "y": "y*(0.5*x - d)"}, {"d": 0.8})
    options = SweepOptions(section=Section("x-y", 1))
    sweep = run_sweep(system, "d", [0.8], x0=[0.3, 0.5], options=options)
    assert sweep.labels[0, 0] == "no return"
