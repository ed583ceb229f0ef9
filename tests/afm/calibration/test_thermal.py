"""The fit of a thermal peak: unbiased, errors that cover, spectra without a peak."""

from __future__ import annotations

import math

import numpy as np
import pytest

from saltus.afm.calibration.thermal import fitted_peak, oscillator
from saltus.errors import InputError
from selection import guarding

F = np.linspace(0.05, 50.0, 1000)
TRUE = np.array([10.0, 4.0, 0.01, 1e-9])


def spectrum(seed, averages, values=TRUE, f=F):
    return oscillator(f, values) * np.random.default_rng(seed).gamma(averages, size=len(f)) / averages


def deviations(seeds, averages):
    """Logarithms of values over the true ones, in standard errors, shape (seed, value)."""
    rows = []
    for seed in seeds:
        found = fitted_peak(F, spectrum(seed, averages), None, None)
        rows.append(np.log(found.values[:3] / TRUE[:3]) / np.sqrt(np.diag(found.covariance)[:3]))
    return np.array(rows)


def test_the_line_is_that_of_a_white_force_on_an_oscillator():
    k, f0, Q, thermal = 2.0, 70.0, 30.0, 4.1e-3
    f = np.array([3.0, 69.0, 70.0, 200.0])
    omega, own = 2e3 * math.pi * f, 2e3 * math.pi * f0
    drag = k / own / Q
    response = 1.0 / np.abs(k - k * (omega / own) ** 2 + 1j * drag * omega) ** 2
    wanted = 4.0 * thermal * drag * response  # fluctuation and dissipation, one-sided
    np.testing.assert_allclose(oscillator(f, np.array([f0, Q, thermal / k, 0.0])), wanted, rtol=1e-12)


def test_a_spectrum_without_noise_gives_its_values():
    found = fitted_peak(F, oscillator(F, TRUE), 100, None)
    np.testing.assert_allclose(found.values, TRUE, rtol=1e-5)


@pytest.mark.parametrize("averages", guarding([1, 30], 30))
def test_values_are_unbiased_and_errors_are_those_of_the_scatter(averages):
    table = deviations(range(8), averages)
    assert np.all(np.abs(table.mean(axis=0)) < 3.5 / math.sqrt(8))
    assert np.all(table.std(axis=0) < 1.8)
    assert np.all(table.std(axis=0) > 0.45)


@pytest.mark.campaign
@pytest.mark.thorough
def test_errors_cover_the_truth_in_two_of_three_spectra():
    table = np.abs(np.concatenate([deviations(range(100, 250), 1), deviations(range(250, 400), 20)]))
    share = (table < 1.0).mean(axis=0)
    assert np.all((share > 0.60) & (share < 0.76))


def test_the_scatter_tells_the_averages():
    assert fitted_peak(F, spectrum(3, 40), None, None).averages == pytest.approx(40, rel=0.2)
    assert fitted_peak(F, spectrum(3, 40), 40, None).scatter == pytest.approx(1.0, abs=0.2)


def test_lines_are_left_out():
    psd = spectrum(5, 30)
    clean = fitted_peak(F, psd, None, None)
    psd[[150, 230, 231]] *= [40.0, 25.0, 30.0]
    found = fitted_peak(F, psd, None, None)
    assert found.wild == 3
    moved = np.log(found.values / clean.values)[:3] / np.sqrt(np.diag(clean.covariance))[:3]
    assert np.all(np.abs(moved) < 0.5)


def test_bins_that_are_alike_widen_errors():
    rng = np.random.default_rng(7)
    noise = np.convolve(rng.gamma(10, size=len(F) + 3) / 10, np.ones(4) / 4.0, mode="valid")
    alike = fitted_peak(F, oscillator(F, TRUE) * noise, None, None)
    alone = fitted_peak(F, spectrum(7, 40), None, None)
    ratio = np.sqrt(np.diag(alike.covariance) / np.diag(alone.covariance))[:3]
    assert np.all(ratio > 1.6)  # four bins that are one count as one: a factor of 2


@pytest.mark.parametrize("exponent", [0.0, -1.0, -2.0])
@pytest.mark.parametrize("averages", [1, 50])
def test_a_spectrum_without_a_peak_is_refused_with_its_gain(exponent, averages):
    psd = F**exponent * np.random.default_rng(11).gamma(averages, size=len(F)) / averages
    with pytest.raises(InputError, match=r"gain of chi2 .* must be one with a peak|f0 = .* must be one with a peak"):
        fitted_peak(F, psd, None, None)


def test_a_line_is_no_peak_of_a_cantilever():
    psd = spectrum(13, 50, np.array([10.0, 4.0, 1e-12, 1e-6]))
    psd[400:402] *= 300.0
    with pytest.raises(InputError, match="spectrum"):
        fitted_peak(F, psd, 50, None)


def test_too_few_bins_are_told():
    with pytest.raises(InputError, match="bins between 9 and 9.5 kHz"):
        fitted_peak(F, spectrum(1, 30), None, (9.0, 9.5))
