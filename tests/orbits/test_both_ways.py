"""Surfaces that two transitions watch, one for each direction, both with conditions."""

import math

import numpy as np
import pytest

from saltus import HybridSystem, Mode, Transition, continue_orbit, find_orbit, simulate

SWING = HybridSystem(
    ("x", "v", "y"), {"c": 2.0, "x0": 1.0, "v0": 0.0, "u": 1.0}, {"m": Mode({"x": "v", "v": "-x", "y": "1"})},
    [
        Transition("m", "m", "x", way, {"x": "x0*u", "v": "v0*u", "y": "0"}, name=name, when="y - c")
        for name, way in (("down", -1), ("up", 1))
    ],
)  # fmt: skip


@pytest.mark.parametrize("unit", [1e-9, 1.0])
@pytest.mark.parametrize(
    ("x0", "v0", "c", "period", "event"),
    [
        (1.0, 0.0, 1.0, 0.5 * math.pi, "down"),
        (1.0, 0.0, 2.0, 1.5 * math.pi, "up"),
        (1.0, 0.0, 4.0, 1.5 * math.pi, "up"),
        (1.0, 0.0, 5.0, 2.5 * math.pi, "down"),
        (-1.0, 0.0, 2.0, 1.5 * math.pi, "down"),
        (0.0, 1.0, 2.0, math.pi, "down"),
        (0.0, 1.0, 3.5, 2.0 * math.pi, "up"),
        (0.0, 1.0, 4.7, 2.0 * math.pi, "up"),
        (0.0, -1.0, 3.5, 2.0 * math.pi, "down"),
    ],
)
def test_an_event_passed_while_its_condition_does_not_hold_is_no_event_later(x0, v0, c, period, event, unit):
    given = {"x0": x0, "v0": v0, "c": c, "u": unit}
    start = [x0 * unit, v0 * unit, 0.0]
    seen = simulate(SWING, given, start, t_end=1.01 * period).events
    orbit = find_orbit(SWING, given, start)
    assert [name for name, _ in [(e["name"], e["time"]) for e in seen]] == [event]
    assert orbit.signature == (("m", event),)
    assert orbit.period == pytest.approx(period, rel=1e-11)
    assert orbit.admissible


def test_an_event_whose_condition_comes_to_hold_before_its_passage_ends_the_branch():
    """The swing passes x = 0 first at pi/2: there the condition holds for c < pi/2."""
    branch = continue_orbit(find_orbit(SWING, x0=[1.0, 0.0, 0.0]), "c", (1.0, 4.5))
    assert branch.period[branch.values > 1.6] == pytest.approx(1.5 * math.pi, rel=1e-10)
    assert branch.values[branch.admissible].min() >= 0.5 * math.pi - 1e-6
    assert branch.values.max() == pytest.approx(4.5)


def gait(ways: tuple[int, ...]) -> HybridSystem:
    """Return a compass gait (Goswami, Thuilot and Espiau 1996), legs exchanged at tn + ts + 2 phi = 0."""
    c, n = "cos(ts - tn)", "sin(ts - tn)"
    r1, r2 = f"(-2*ws**2*{n} - 19.6*sin(tn))", f"(2*wn**2*{n} + 137.2*sin(ts))"
    det = f"(13 - 4*{c}**2)"
    field = {"tn": "wn", "ts": "ws", "wn": f"(13*{r1} + 2*{c}*{r2})/{det}", "ws": f"({r2} + 2*{c}*{r1})/{det}"}
    b1, b2 = f"(-wn + (12*{c} - 1)*ws)", "(-ws)"
    q11, q12, q22 = f"(1 - 2*{c})", f"(13 - 2*{c})", f"(-2*{c})"
    dq = f"({q11}*{q22} - {q12})"
    reset = {"tn": "ts", "ts": "tn", "wn": f"({b1}*{q22} - {q12}*{b2})/{dq}", "ws": f"({q11}*{b2} - {b1})/{dq}"}
    strikes = [
        Transition("swing", "swing", "tn + ts + 2*phi", way, reset, name=f"strike{i}", when="tn - ts - 0.1")
        for i, way in enumerate(ways)
    ]
    return HybridSystem(("tn", "ts", "wn", "ws"), {"phi": 0.05235987755982989}, {"swing": Mode(field)}, strikes)


@pytest.mark.campaign
def test_a_compass_gait_is_the_same_orbit_whether_its_ground_is_watched_one_way_or_both():
    start = [-0.3233886, 0.2186688, -0.3771816, -1.0918267]
    one, both = (find_orbit(gait(ways), x0=start) for ways in ((-1,), (1, -1)))
    assert both.period == pytest.approx(0.7347210, abs=5e-8)
    assert both.period == pytest.approx(one.period, rel=1e-10)
    np.testing.assert_allclose(both.states, one.states, rtol=1e-8)
    np.testing.assert_allclose(np.abs(both.multipliers), np.abs(one.multipliers), rtol=1e-5, atol=1e-7)
    assert both.admissible
