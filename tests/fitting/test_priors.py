"""What is known beforehand: posterior values and errors of a linear response against Gauss's formulas."""

from __future__ import annotations

import numpy as np
import pytest

from saltus import continue_orbit, find_orbit, fit
from saltus.errors import InputError

W = np.linspace(0.6, 1.4, 9)
SIGMA = 0.02


@pytest.fixture(scope="module")
def branch(linear_spring):
    return continue_orbit(find_orbit(linear_spring, {}, [0.0, 0.0]), "w", (0.5, 1.5))


@pytest.fixture(scope="module")
def linear_spring():
    from saltus import HybridSystem

    return HybridSystem.smooth({"x": "v", "v": "-c*v - k*x + cos(s)"}, {"k": 1.2, "c": 0.3, "w": 1.0}, phase=("s", "w"))


def amplitude(k, c):
    return 1.0 / np.hypot(k - W**2, c * W)


def fitted(branch, priors):
    data = {"w": W, "amplitude(x, 1)": amplitude(1.0, 0.2)}
    vary = {"k": (0.5, 2.0), "c": (0.05, 1.0)}
    return fit(data, branch, vary, {"amplitude(x, 1)": SIGMA}, priors=priors)


@pytest.mark.campaign
def test_a_prior_that_agrees_narrows_errors_as_gauss_says(branch):
    found = fitted(branch, {"c": (0.2, 0.001)})
    step = 1e-6
    slopes = np.stack(
        [
            (amplitude(1.0 + step, 0.2) - amplitude(1.0 - step, 0.2)) / 2 / step,
            (amplitude(1.0, 0.2 + step) - amplitude(1.0, 0.2 - step)) / 2 / step,
        ],
        axis=1,
    )
    information = slopes.T @ slopes / SIGMA**2 + np.diag([0.0, 1.0 / 0.001**2])
    np.testing.assert_allclose(found.covariance, np.linalg.inv(information), rtol=1e-4)
    assert found["c"] == pytest.approx(0.2, abs=1e-7)
    assert found.residuals.size == len(W)  # the prior is no datum of chi2


@pytest.mark.campaign
def test_a_prior_that_disagrees_pulls_by_its_weight(branch):
    free = fitted(branch, None)
    error = free.errors["c"]
    pulled = fitted(branch, {"c": (0.2 + 0.2 * error, error)})
    assert (pulled["c"] - 0.2) / error == pytest.approx(0.1, abs=0.01)
    assert pulled.errors["c"] == pytest.approx(error / np.sqrt(2.0), rel=0.01)


def test_wrong_priors_are_refused(branch):
    with pytest.raises(InputError, match="what is not varied has no prior"):
        fitted(branch, {"w": (1.0, 0.1)})
    with pytest.raises(InputError, match="a pair of a value and its standard error"):
        fitted(branch, {"c": 0.2})
    with pytest.raises(InputError, match="priors\\['c'\\]"):
        fitted(branch, {"c": (0.2, 0.0)})


def test_a_prior_that_contradicts_the_data_is_told(branch):
    with pytest.warns(RuntimeWarning, match=r"prior of c, 26 \+- 0.5, is 51.* of its standard errors off"):
        found = fitted(branch, {"c": (26.0, 0.5)})
    assert any("the prior of c" in note for note in found.notes)
