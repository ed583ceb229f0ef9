"""Spiking models of one state: branches, loci and their ends in closed form."""

import math

import numpy as np
import pytest

from saltus import HybridSystem, Mode, Transition, continue_locus, continue_orbit, find_orbit


def neuron(rate: str, parameters: dict[str, float], **more) -> HybridSystem:
    spike = Transition("m", "m", "v - vp", 1, {"v": "vr"}, name="spike")
    return HybridSystem(("v",), parameters, {"m": Mode({"v": rate})}, [spike], **more)


QUADRATIC = neuron("v**2 + I", {"I": -1.0, "vr": 2.0, "vp": 10.0})
LEAKY = neuron("I - v", {"I": 1.5, "vr": 0.0, "vp": 1.0})


@pytest.mark.parametrize("directions", ["both", "down"])
@pytest.mark.parametrize("start", [3.0, 3.0 + 1e-13, 1.5])
def test_the_period_of_a_quadratic_neuron_is_the_closed_form_up_to_infinity(start, directions):
    branch = continue_orbit(find_orbit(QUADRATIC, x0=[start]), "vr", (0.0, 9.0), directions=directions)
    vr = branch.values
    assert branch.period == pytest.approx(np.log(9.0 * (vr + 1.0) / (11.0 * (vr - 1.0))) / 2.0, rel=1e-8)
    assert vr.min() == pytest.approx(1.0, abs=1e-6)
    end = branch.stopped[0] if directions == "both" else branch.stopped[1]
    assert "the period grows without bound" in end


def test_a_quadratic_neuron_whose_reset_reaches_its_peak_shrinks_to_nothing():
    branch = continue_orbit(find_orbit(QUADRATIC, x0=[3.0]), "vr", (0.0, 12.0))
    assert branch.values.max() == pytest.approx(10.0, abs=1e-6)
    assert "the cycle shrinks to nothing" in branch.stopped[1]


@pytest.mark.parametrize(
    ("parameter", "bounds", "limit"), [("I", (0.5, 3.0), 1.0), ("vp", (0.5, 3.0), 1.5), ("vr", (-3.0, 0.9), None)]
)
def test_the_period_of_a_leaky_neuron_is_the_closed_form(parameter, bounds, limit):
    branch = continue_orbit(find_orbit(LEAKY, x0=[0.2]), parameter, bounds)
    p = {"I": 1.5, "vr": 0.0, "vp": 1.0} | {parameter: branch.values}
    # the exponential is compared: near infinity the period magnifies the parameter's rounding
    assert np.exp(-branch.period) == pytest.approx((p["I"] - p["vp"]) / (p["I"] - p["vr"]), rel=1e-9, abs=1e-11)
    if limit is not None:
        assert np.abs(branch.values - limit).min() < 1e-6
        assert any("the period grows without bound" in end for end in branch.stopped)


def test_an_exponential_neuron_ends_where_its_rest_is_born():
    """min of -v + I + D exp((v - 1)/D) is at v = 1, and is 0 at I = 1 - D: the period is like 1/sqrt there."""
    system = neuron("-v + I + D*exp((v - 1)/D)", {"I": 1.5, "vr": 0.0, "vp": 5.0, "D": 0.5})
    branch = continue_orbit(find_orbit(system, x0=[0.2]), "I", (-0.5, 3.0))
    assert 0.0 < branch.values.min() - 0.5 < 1e-3
    assert "the period grows without bound" in branch.stopped[0]
    assert branch.period[0] == pytest.approx(2.0 * math.pi / math.sqrt(2.0 / 0.5 * (branch.values[0] - 0.5)), rel=0.1)


def test_a_forced_neuron_with_a_moving_threshold_has_folds_and_their_loci():
    """Locked once to the drive: v = I + k cos(s - a) + C exp(-t) from vr, to the threshold a period later."""
    system = HybridSystem(
        ("v",), {"I": 1.5, "vr": 0.0, "w": 5.0, "b": 0.2}, {"m": Mode({"v": "I - v"})},
        [Transition("m", "m", "v - 1 - b*cos(s)", 1, {"v": "vr"}, name="spike")], phase=("s", "w"),
    )  # fmt: skip
    branch = continue_orbit(find_orbit(system, x0=[0.2]), "I", (0.5, 3.0))
    grown = 1.0 - math.exp(-2.0 * math.pi / 5.0)  # of I, at the threshold
    # locked where I grown = 1 + b cos(s), of which |cos(s)| = 1 are folds
    assert branch["SN1"].parameters["I"] == pytest.approx((1.0 - 0.2) / grown, rel=1e-9)
    locus = continue_locus(branch["SN1"], ("I", "b"), {"I": (0.5, 3.0), "b": (0.05, 0.4)})
    assert locus.values[:, 0] * grown == pytest.approx(1.0 - locus.values[:, 1], rel=1e-8)
    assert len(locus) > 3
