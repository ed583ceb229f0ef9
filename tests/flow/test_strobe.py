"""Jumps at phase 0: the strobe looks before them, whoever looks."""

from __future__ import annotations

import math

import numpy as np
import pytest

from saltus import Average, HybridSystem, Mode, Transition, find_orbit, lyapunov_spectrum, run_sweep, simulate
from saltus.ensemble.ensemble import Ensemble
from saltus.options import SweepOptions

D, T, P = 0.4, 3.0, 2.0
LOST = math.exp(-D * T)
BEFORE = P * LOST / (1.0 - LOST)
EARLIER = [0.0, 1e-16, -1e-16, -1e-13, -1e-11, -9e-10, 2.0 * math.pi]


def doses(event="sin(s - q)", direction=1):
    """A drug that decays, given once a period at phase q."""
    return HybridSystem(
        ("y",),
        {"d": D, "T": T, "p": P, "q": 0.0},
        {"m": Mode({"y": "-d*y"})},
        [Transition("m", "m", event, direction, {"y": "y + p"}, name="dose")],
        phase=("s", "2*pi/T"),
    )


@pytest.fixture(scope="module")
def dosed():
    return doses()


@pytest.mark.parametrize("q", EARLIER)
def test_an_orbit_tells_the_state_before_its_jump_at_phase_0(dosed, q):
    orbit = find_orbit(dosed, {"q": q}, [1.0])
    assert orbit.x0[0] == pytest.approx(BEFORE, rel=1e-8)
    assert abs(orbit.multipliers[0]) == pytest.approx(LOST, rel=1e-9)
    again = simulate(dosed, {"q": q}, orbit.x0, periods=2)
    assert again.x_end[0] == pytest.approx(BEFORE, rel=1e-8)
    assert [str(kind) for kind in again.events["kind"]] == ["event", "phase", "event", "phase"]


@pytest.mark.parametrize("q", [1e-8, -1e-8, 1.0])
def test_a_jump_away_from_phase_0_is_on_its_side(dosed, q):
    since = (-q) % (2.0 * math.pi) / (2.0 * math.pi) * T
    assert find_orbit(dosed, {"q": q}, [1.0]).x0[0] == pytest.approx(P / (1.0 - LOST) * math.exp(-D * since), rel=1e-8)


@pytest.mark.parametrize("T_", [1e-6, 1e6])
def test_doses_in_other_units_of_time(dosed, T_):
    orbit = find_orbit(dosed, {"T": T_, "d": D * T / T_}, [1.0])
    assert orbit.period == pytest.approx(T_, rel=1e-12)
    assert orbit.x0[0] == pytest.approx(BEFORE, rel=1e-8)


@pytest.mark.parametrize("q", [0.0, -1e-11])
def test_sweeps_exponents_and_maps_look_before_the_jump(dosed, q):
    sweep = run_sweep(dosed, "p", [1.0, 2.0], x0=[1.0], parameters={"q": q}, options=SweepOptions(discard=60, keep=3))
    assert sweep.labels.tolist() == [["period-1", "period-1"]]
    np.testing.assert_allclose(sweep.points[0, 1, :, 0], BEFORE, rtol=1e-6)
    assert lyapunov_spectrum(dosed, {"q": q}, [1.0], average=Average(periods=50)).exponents[0] == pytest.approx(
        -D, abs=1e-9
    )
    ends, _ = Ensemble(dosed, {"q": q}).strobe([[1.0], [BEFORE]], count=4)
    np.testing.assert_allclose(ends[:, 0], BEFORE + np.array([1.0 - BEFORE, 0.0]) * LOST**4, rtol=1e-6)


@pytest.mark.parametrize(("event", "direction"), [("cos(s + pi/2)", -1), ("cos(s - pi/2)", 1), ("cos(s - pi/2)", 0)])
def test_jumps_at_phase_0_of_any_form_and_direction(event, direction):
    per_period = 1 if direction else 2
    orbit = find_orbit(doses(event, direction), {}, [1.0])
    lost = math.exp(-D * T / per_period)
    assert orbit.x0[0] == pytest.approx(P * lost / (1.0 - lost), rel=1e-8)
    assert len(orbit.segments) == per_period


def test_a_jump_at_phase_0_beside_other_events_is_seen_from_before():
    ticking = HybridSystem(
        ("y", "c"),
        {"d": D, "w": 2.0 * math.pi / T},
        {"m": Mode({"y": "-d*y", "c": "-0.5*c + 0.5*(1 - cos(s))"})},
        [
            Transition("m", "m", "sin(s)", 1, {"y": "y + 2", "c": "c/2"}),
            Transition("m", "m", "c - 10", 1, {"c": "0"}, name="full"),
        ],
        phase=("s", "w"),
    )
    orbit = find_orbit(ticking, {}, [1.0, 0.0])
    assert orbit.x0[0] == pytest.approx(BEFORE, rel=1e-8)
    back = simulate(ticking, {}, orbit.x0, periods=1).x_end[:2]
    np.testing.assert_allclose(back, orbit.x0, rtol=1e-8)
