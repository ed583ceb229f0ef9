"""Spikes whose upstroke is so steep that the rounding of its time is much of its height."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from saltus import HybridSystem, Mode, Transition, continue_orbit, find_orbit, verify
from selection import guarding


@pytest.mark.parametrize("peak", [10.0, 20.0, 25.0, 30.0])
def test_period_of_an_exponential_spike_is_its_integral(peak):
    spike = Transition("m", "m", "V - Vp", 1, {"V": "-2"}, name="spike")
    neuron = HybridSystem(("V",), {"Vp": peak}, {"m": Mode({"V": "exp(V) - V + 2"})}, [spike])
    period = mp.quad(lambda V: 1 / (mp.e**V - V + 2), [-2, 0, 2, 5, peak])
    assert find_orbit(neuron, x0=[0.0]).period == pytest.approx(float(period), rel=1e-12)


FIRING = {"C": 200.0, "gL": 10.0, "EL": -70.0, "VT": -50.0, "DT": 2.0, "tw": 100.0, "a": 2.0, "b": 60.0, "I": 400.0}
BURSTS = {"tw": 300.0, "b": 120.0, "I": 500.0, "Vr": -46.0}


def adaptive(peak, changed):
    """Exponential integrate-and-fire neuron with adaptation, in mV, pA and ms (Brette, Gerstner 2005)."""
    rates = {"V": "(-gL*(V - EL) + gL*DT*exp((V - VT)/DT) - w + I)/C", "w": "(a*(V - EL) - w)/tw"}
    spike = Transition("m", "m", f"V - ({peak})", 1, {"V": "Vr", "w": "w + b"}, name="spike")
    return HybridSystem(("V", "w"), FIRING | {"Vr": -58.0} | changed, {"m": Mode(rates)}, [spike])


def settled_period(neuron, spikes):
    """Period by SciPy, with spikes at 0 mV."""
    p = neuron.parameters

    def rates(_, x):
        upstroke = p["gL"] * p["DT"] * np.exp((x[0] - p["VT"]) / p["DT"])
        V = (-p["gL"] * (x[0] - p["EL"]) + upstroke - x[1] + p["I"]) / p["C"]
        return [V, (p["a"] * (x[0] - p["EL"]) - x[1]) / p["tw"]]

    def spike(_, x):
        return x[0]

    spike.terminal, spike.direction = True, 1
    x, times = [p["Vr"], 0.0], []
    for _ in range(120):
        found = solve_ivp(rates, (0.0, 5e3), x, method="DOP853", rtol=1e-11, atol=1e-10, events=spike)
        times.append(found.t[-1])
        x = [p["Vr"], found.y[1, -1] + p["b"]]
    return sum(times[-spikes:])


@pytest.mark.parametrize(("changed", "spikes"), guarding([({}, 1), (BURSTS, 2)], (BURSTS, 2)))
def test_bursts_with_a_peak_behind_many_doublings_are_found(changed, spikes):
    neuron = adaptive(0.0, changed)
    orbit = find_orbit(neuron, x0=[-70.0, 0.0])
    assert len(orbit.segments) == spikes
    assert orbit.stable
    assert orbit.admissible
    assert orbit.period == pytest.approx(settled_period(neuron, spikes), rel=1e-9)


@pytest.mark.parametrize("peak", guarding([-20.0, 0.0]))
def test_steps_along_a_branch_do_not_shrink_with_the_upstroke(peak):
    slow = adaptive(-30.0, {})
    fast = adaptive(peak, {})
    few = len(continue_orbit(find_orbit(slow, x0=[-70.0, 0.0]), "I", (300.0, 700.0)))
    branch = continue_orbit(find_orbit(fast, x0=[-70.0, 0.0]), "I", (300.0, 700.0))
    assert len(branch) <= few  # by small steps, one within a doubling each, it were 10 000
    assert (branch.values.min(), branch.values.max()) == (300.0, 700.0)
    assert branch.audit.passed
    assert not branch.special_points
    assert verify(branch).passed
    for current in (320.0, 650.0):
        (orbit,) = branch.at(current)
        assert orbit.admissible
        # from the lower peak to 0 the upstroke takes less than 1e-6 of the period
        assert orbit.period == pytest.approx(settled_period(adaptive(0.0, {"I": current}), 1), rel=1e-6)


def test_a_burst_from_which_a_spike_is_about_to_vanish_is_followed():
    """Where a spike less is in a burst, a predicted duration may be negative."""
    spike = Transition("m", "m", "V - 30", 1, {"V": "-50", "w": "w + 2"}, name="spike")
    rates = {"V": "0.04*V**2 + 5*V + 140 - w + I", "w": "0.02*(0.2*V - w)"}
    neuron = HybridSystem(("V", "w"), {"I": 10.0}, {"m": Mode(rates)}, [spike])
    branch = continue_orbit(find_orbit(neuron, x0=[-65.0, -13.0]), "I", (8.0, 14.0))
    assert branch.audit.passed
    assert branch.values.max() == 14.0
