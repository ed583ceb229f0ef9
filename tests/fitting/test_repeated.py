"""Data of one place that contradict each other, of a linear spring."""

import numpy as np
import pytest

import saltus

SPRING = saltus.HybridSystem.smooth({"x": "v", "v": "-c*v - x + cos(s)"}, {"c": 0.25, "w": 1.0}, phase=("s", "w"))
W = np.linspace(0.7, 1.3, 12)


def fitted(w, amplitude):
    branch = saltus.continue_orbit(saltus.find_orbit(SPRING, x0=[0.0, 0.0]), "w", (0.5, 1.5))
    data = {"w": w, "amplitude(x, 1)": amplitude}
    return saltus.fit(data, branch, {"c": (0.05, 1.0)}, {"amplitude(x, 1)": 0.01})


def curve(w):
    return 1.0 / np.hypot(1.0 - w**2, 0.2 * w)


@pytest.mark.filterwarnings("ignore:saltus")
def test_which_data_of_one_place_differ_is_told():
    again = W[[2, 5]]
    found = fitted(np.append(W, again), np.append(curve(W), curve(again) + 1.0))
    for first, second in ((2, 12), (5, 13)):
        told = f"data {first} and {second} are both of w = {W[first]:.9g}, and their amplitude(x, 1) differ by 70.7"
        assert any(told in note for note in found.notes)
        assert told in found.misfit


def test_data_that_agree_are_not_told():
    found = fitted(np.append(W, W), np.append(curve(W) + 0.01, curve(W) - 0.01))
    assert not any("which is right" in note for note in found.notes)


@pytest.mark.campaign
@pytest.mark.filterwarnings("ignore:saltus")
def test_a_model_that_is_wrong_accuses_no_data():
    found = fitted(np.append(W, W[:2]), np.append(curve(W), curve(W[:2]) + 1.0) + 3.0)
    assert found.misfit
    assert not any("which is right" in note for note in found.notes)
