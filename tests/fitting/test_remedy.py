"""Unknowns of a measurement that would explain data: falls of chi2 against least squares, an origin off by 0.3 nm."""

import numpy as np
import pytest

from saltus import afm
from saltus.fitting.evaluation import Evaluation
from saltus.fitting.instrument import Instrument
from saltus.fitting.measured import read_measured
from saltus.fitting.remedy import falls, remedy_of

SIGMA = {"amplitude_nm": 0.1, "lag_deg": 1.0}
UNKNOWN = Instrument("Zc_offset_nm", "gain", ("amplitude_nm",), "f0_drift_Hz", {"f0_kHz": 1e-3})


def test_falls_are_those_of_least_squares_with_one_more_column():
    noise = np.random.default_rng(5)
    residuals, varied, others = 1e-4 * noise.normal(size=30), noise.normal(size=(30, 3)), noise.normal(size=(30, 2))
    lower, steps = falls(residuals, varied, others)
    before = np.linalg.lstsq(varied, residuals)[1][0]
    for k in range(2):
        found = np.linalg.lstsq(np.column_stack([varied, others[:, k]]), -residuals)
        assert before - found[1][0] == pytest.approx(lower[k], rel=1e-6)
        assert found[0][3] == pytest.approx(steps[k], rel=1e-6)


def test_an_unknown_that_the_varied_ones_replace_lowers_nothing():
    noise = np.random.default_rng(6)
    varied = noise.normal(size=(20, 2))
    others = np.column_stack([varied @ [1.0, -2.0], np.zeros(20)])
    assert np.all(falls(noise.normal(size=20), varied, others)[0] == 0.0)


@pytest.fixture(scope="module")
def curve():
    probe = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
    law = afm.VanDerWaals(H_aJ=0.1, a0_nm=0.3) + afm.DMT(E_GPa=3.0)
    return afm.distance_curve(afm.model(probe, law, afm.Drive(A0_nm=12.0), Zc_nm=8.5), (10.2, 13.0))


@pytest.mark.parametrize(("origin_nm", "gain"), [(0.3, 1.0), (0.0, 1.1)])
def test_what_is_wrong_with_a_measurement_is_named(curve, origin_nm, gain):
    Zc_nm, noise = np.array([10.3, 10.6, 10.9, 11.2, 12.0, 12.2, 12.4, 12.6]), np.random.default_rng(1)
    data = {"Zc_nm": Zc_nm + origin_nm}
    seen = [afm.observables(max(curve.at(z), key=lambda one: one.max["z1_nm"])) for z in Zc_nm]
    for name, sigma in SIGMA.items():
        data[name] = np.array([one[name] for one in seen]) + noise.normal(0.0, sigma, len(seen))
    data["amplitude_nm"] *= gain
    measured = read_measured(data, "Zc_nm", curve.system, SIGMA, afm_formulas(curve), {"lag_deg": 360.0})
    found = Evaluation(measured, curve.branches, ("E_GPa",))
    told = remedy_of(found, np.array([3.0]), np.array([[0.2], [30.0]]), UNKNOWN)
    if origin_nm:
        assert told.startswith("by a linear estimate it helps to vary Zc_offset_nm (near -0.3")
    else:
        assert told.startswith("by a linear estimate it helps to vary gain (near 1.1, ")
    own = np.array([3.0]), np.array([[0.2], [30.0]])
    assert remedy_of(found, *own, Instrument()) == ""


def afm_formulas(curve):
    """Observables of the columns."""
    return {name: curve.formula(name) for name in SIGMA}
