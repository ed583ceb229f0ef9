"""Intervals of exponents hold the limit, also where a rate has not converged."""

from __future__ import annotations

import math

import numpy as np
import pytest

from saltus import Average, HybridSystem, Map, lyapunov_spectrum
from saltus.sweeps.unconverged import unconverged
from selection import guarding

CUBIC = HybridSystem.smooth({"x": "-x**3"})


@pytest.mark.parametrize(
    ("start", "time", "discard"),
    guarding([(1.0, 1e3, None), (1.0, 1e3, 0.0), (0.01, 1e3, None), (1.0, 1e3, 5e3)], (0.01, 1e3, None)),
)
def test_a_cubic_rest_has_an_exponent_of_0(start, time, discard):
    """x' = -x^3: the rate is -3 x^2 = -3/(2 t + 1/x0^2), whose limit is 0."""
    spectrum = lyapunov_spectrum(CUBIC, x0=[start], average=Average(t_end=time, discard=discard))
    assert abs(spectrum.exponents[0]) <= spectrum.errors[0]
    assert spectrum.errors[0] < 2.0 * abs(spectrum.exponents[0])


def test_a_critical_map_has_an_exponent_of_0():
    spectrum = lyapunov_spectrum(Map(("x",), {}, {"x": "x - x**3"}), x0=[0.5], average=Average(periods=5000))
    assert abs(spectrum.exponents[0]) <= spectrum.errors[0]


@pytest.mark.parametrize("speed", guarding([0.0, 0.5, 1.9], 0.5))
@pytest.mark.parametrize("force", ["-sin(x)", "-x"])
def test_librations_have_exponents_of_0(force, speed):
    spectrum = lyapunov_spectrum(
        HybridSystem.smooth({"x": "v", "v": force}), x0=[0.1, speed], average=Average(t_end=300.0)
    )
    assert np.all(np.abs(spectrum.exponents) <= spectrum.errors)


def test_rates_that_have_converged_keep_their_batches_error():
    spectrum = lyapunov_spectrum(Map(("x",), {}, {"x": "4*x*(1 - x)"}), x0=[0.3], average=Average(periods=20000))
    assert abs(spectrum.exponents[0] - math.log(2.0)) < spectrum.errors[0]
    assert unconverged(spectrum.times, spectrum.logs)[0] < spectrum.errors[0] < 2e-3


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("power", [1.0, 0.5])
def test_a_drift_to_a_limit_is_seen_through_noise(power, seed):
    """Rates a + c/(t + s)^power with little noise: the interval holds a at the power 1."""
    rng = np.random.default_rng(seed)
    times = np.arange(1.0, 501.0)
    limit, size, origin = rng.uniform(-1.0, 1.0), rng.uniform(0.5, 2.0), rng.uniform(50.0, 500.0)
    rates = limit + size * ((times - 0.5 + origin) / origin) ** -power + 1e-4 * size * rng.standard_normal(500)
    found = unconverged(times, rates[:, None])[0]
    away = abs(rates.mean() - limit)
    assert found > (0.95 * away if power == 1.0 else 0.3 * away)


def test_a_drift_that_does_not_slow_down_has_no_limit():
    times = np.arange(1.0, 501.0)
    assert unconverged(times, (times**2)[:, None])[0] == math.inf
    still = lyapunov_spectrum(HybridSystem.smooth({"x": "y", "y": "0"}), x0=[0.0, 1.0], average=Average(t_end=50.0))
    assert np.all(np.abs(still.exponents) <= still.errors)
