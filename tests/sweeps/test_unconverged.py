"""Intervals of exponents hold the limit, also where a rate has not converged."""

from __future__ import annotations

import math

import numpy as np
import pytest

from saltus import Average, HybridSystem, Map, Piece, lyapunov_spectrum
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


def test_an_intermittent_map_without_a_mean_stay_has_an_exponent_of_0():
    """Pomeau and Manneville's x + x^2 mod 1: its invariant measure is infinite."""
    end = 0.5 * (math.sqrt(5.0) - 1.0)
    pieces = {
        "slow": Piece({"x": "x + x**2"}, where=f"{end!r} - x"),
        "back": Piece({"x": "x + x**2 - 1"}, where=f"x - {end!r}"),
    }
    intermittent = Map(("x",), {}, pieces=pieces)
    for start in np.random.default_rng(3).uniform(0.05, 0.95, 5):
        spectrum = lyapunov_spectrum(intermittent, x0=[start], average=Average(periods=20000))
        assert spectrum.exponents[0] <= spectrum.errors[0]


def _growths(power: float, count: int, motions: int) -> tuple[np.ndarray, np.ndarray]:
    """Return times, and growth along motions of x + x^power mod 1 in 500 rows, shape (row, motion)."""
    x = np.random.default_rng(11).random(motions)
    for _ in range(count // 2):
        x = (x + x**power) % 1.0
    logs = np.zeros((500, motions))
    for row in logs:
        for _ in range(count // 500):
            row += np.log1p(power * x ** (power - 1.0))
            x = (x + x**power) % 1.0
    return np.arange(1.0, 501.0) * (count // 500), logs


@pytest.mark.parametrize(("power", "count"), [(2.0, 10000), (2.0, 50000), (2.5, 10000), (3.0, 10000)])
def test_intervals_of_intermittent_motions_hold_0_in_95_of_100(power, count):
    times, logs = _growths(power, count, 200)
    held = [unconverged(times, log[:, None], count // 2)[0] >= log.sum() / times[-1] for log in logs.T]
    assert np.mean(held) >= 0.95


@pytest.mark.parametrize("power", [1.2, 1.5])
def test_intermittent_motions_with_a_mean_stay_keep_their_exponents(power):
    """At 1.5 the index is 2, which few stays tell from 1 by chance: 11 of 200 intervals hold 0."""
    times, logs = _growths(power, 10000, 200)
    held = [unconverged(times, log[:, None], 5000)[0] >= log.sum() / times[-1] for log in logs.T]
    assert np.mean(held) <= 0.1


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
