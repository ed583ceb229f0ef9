"""Spikes whose upstroke is so steep that the rounding of its time is much of its height."""

from __future__ import annotations

import mpmath as mp
import pytest

from saltus import HybridSystem, Mode, Transition, find_orbit


@pytest.mark.parametrize("peak", [10.0, 20.0, 25.0, 30.0])
def test_period_of_an_exponential_spike_is_its_integral(peak):
    spike = Transition("m", "m", "V - Vp", 1, {"V": "-2"}, name="spike")
    neuron = HybridSystem(("V",), {"Vp": peak}, {"m": Mode({"V": "exp(V) - V + 2"})}, [spike])
    period = mp.quad(lambda V: 1 / (mp.e**V - V + 2), [-2, 0, 2, 5, peak])
    assert find_orbit(neuron, x0=[0.0]).period == pytest.approx(float(period), rel=1e-12)
