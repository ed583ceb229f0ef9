"""Whether residuals may be noise: white noise passes, slow residuals of the same size do not."""

import numpy as np
import pytest
from scipy.stats import chi2

from saltus.fitting.goodness import misfit_of


def test_white_noise_is_flagged_about_twice_in_a_thousand_sets():
    """By the two tests at 0.001 each, 1000 sets have 2 flags in the mean, and 8 or more once in a thousand times."""
    noise = np.random.default_rng(11)
    assert sum(bool(misfit_of([noise.normal(size=80), np.zeros(0)], 0)) for _ in range(1000)) < 8


def test_residuals_that_go_slowly_are_flagged_at_a_chi2_that_noise_may_have():
    wave = np.sqrt(2.0) * np.sin(np.linspace(0.0, 6.0 * np.pi, 80))
    assert wave @ wave / 80.0 == pytest.approx(1.0, abs=0.02)
    assert misfit_of([wave, np.zeros(0)], 1).startswith("neighbouring residuals agree")
    mixed = np.random.default_rng(2).permutation(wave)
    assert misfit_of([mixed, np.zeros(0)], 1) == ""


def test_residuals_of_exact_data_and_of_too_large_standard_errors_are_not_flagged():
    for size in (1e-9, 0.1, 0.5):
        assert misfit_of([np.full(80, size), np.zeros(0)], 1) == ""


def test_chi2_is_flagged_from_its_probability_of_one_in_a_thousand():
    limit = float(chi2.isf(1e-3, 78))
    for share, flagged in ((0.99, False), (1.01, True)):
        signs = np.tile([1.0, -1.0], 40)
        told = misfit_of([signs * np.sqrt(share * limit / 80.0), np.zeros(0)], 2)
        assert bool(told) == flagged
    assert "has a probability of 0.0008 by these standard errors" in told


def test_one_wild_residual_makes_no_neighbours_agree():
    calm = np.tile([0.5, -0.5], 40)
    calm[40], calm[41] = 8.0, 0.5
    assert "neighbouring" not in misfit_of([calm, np.zeros(0)], 1)


def test_nothing_to_judge_is_no_misfit():
    assert misfit_of([np.zeros(0)], 0) == ""
