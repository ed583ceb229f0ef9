"""Operating points of two modes and maps of the sample: exact orbits, round trips, noise, refusals."""

import json

import numpy as np
import pytest

import saltus
from explained import unexplained
from saltus import afm
from saltus.errors import InputError

PROBE = afm.Probe(k_N_m=(2.0, 80.0), f0_kHz=(70.0, 440.0), Q=(150.0, 450.0), R_nm=10.0)
VISCOUS = afm.Hertz(E_GPa=1.0) + afm.KelvinVoigt(eta_Pa_s=10.0)
SPHERE = afm.VanDerWaals(H_aJ=0.1, a0_nm=0.2) + afm.DMT(E_GPa=2.0) + afm.KelvinVoigt(eta_Pa_s=20.0)
AM_FM = (afm.AM(A0_nm=30.0, setpoint_nm=25.0), afm.FM(A_nm=0.5))
NEGATIVE = {"amplitude_nm": -25.0, "lag_deg": 57.0, "shift_Hz_2": 700.0, "excitation_nm_2": 0.51}
MODES = {
    "AM-FM": AM_FM,
    "FM-FM": (afm.FM(A_nm=20.0, setpoint_Hz=300.0), afm.FM(A_nm=0.5)),
    "AM-AM": (afm.AM(A0_nm=30.0, setpoint_nm=24.0), afm.AM(A0_nm=0.5)),
    "AM-FM at constant drive": (afm.AM(A0_nm=30.0, setpoint_nm=24.0), afm.FM(A0_nm=0.5)),
}


def read(seen):
    """The readings that a set point does not hold."""
    return {name: seen[name] for name in seen.found if name not in ("mean_gap_nm", "Zc_nm")}


@pytest.mark.parametrize("modes", MODES)
def test_a_map_comes_back_from_its_readings_and_a_distant_guess(modes):
    E, eta = np.linspace(0.5, 4.0, 4)[:, None], np.linspace(2.0, 30.0, 3)
    seen = afm.bimodal(PROBE, VISCOUS, MODES[modes], parameters={"E_GPa": E, "eta_Pa_s": eta})
    guess = afm.Hertz(E_GPa=30.0) + afm.KelvinVoigt(eta_Pa_s=500.0)
    found = afm.bimodal_map(read(seen), PROBE, guess, MODES[modes])
    assert np.abs(found["E_GPa"] / E - 1.0).max() < 1e-7
    assert np.abs(found["eta_Pa_s"] / eta - 1.0).max() < 1e-7
    assert np.abs(found["Zc_nm"] - seen["Zc_nm"]).max() < 1e-7


def test_the_hamaker_constant_comes_back_beside_modulus_and_viscosity():
    H, E = np.linspace(0.05, 0.15, 3)[:, None], np.linspace(1.0, 3.0, 3)
    modes = (afm.AM(A0_nm=30.0, setpoint_nm=24.0), afm.FM(A_nm=0.3))
    seen = afm.bimodal(PROBE, SPHERE, modes, parameters={"H_aJ": H, "E_GPa": E})
    found = afm.bimodal_map(read(seen), PROBE, SPHERE, modes, unknowns=("E_GPa", "eta_Pa_s", "H_aJ"))
    assert max(np.abs(found["H_aJ"] - H).max(), np.abs(found["E_GPa"] - E).max()) < 1e-6
    assert np.abs(found["eta_Pa_s"] - 20.0).max() < 1e-5


@pytest.mark.parametrize("unknowns", [("E_GPa", "eta_Pa_s"), ("E_GPa",)], ids=len)
def test_a_map_comes_back_where_some_readings_are_exact_and_others_have_errors(unknowns):
    E = np.linspace(0.5, 3.0, 8)
    seen = afm.bimodal(PROBE, VISCOUS, AM_FM, parameters={"E_GPa": E})
    for sigma in ({"lag_deg": 0.1, "shift_Hz_2": 2.0, "excitation_nm_2": 0.005}, {"shift_Hz_2": 20.0}):
        found = afm.bimodal_map(read(seen), PROBE, VISCOUS, AM_FM, unknowns=unknowns, sigma=sigma)
        assert np.abs(found["E_GPa"] / E - 1.0).max() < 1e-7
        assert found.chi2.max() < 1e-9


@pytest.mark.campaign
def test_noise_is_covered_by_the_standard_errors():
    sigma = {"amplitude_nm": 0.02, "lag_deg": 0.1, "shift_Hz_2": 2.0, "excitation_nm_2": 0.005}
    seen = afm.bimodal(PROBE, VISCOUS, AM_FM, parameters={"E_GPa": np.full(400, 1.5), "eta_Pa_s": 20.0})
    random = np.random.default_rng(20)
    noisy = {name: seen[name] + error * random.standard_normal(400) for name, error in sigma.items()}
    found = afm.bimodal_map(noisy, PROBE, VISCOUS, AM_FM, sigma=sigma)
    for name, true in (("E_GPa", 1.5), ("eta_Pa_s", 20.0), ("Zc_nm", seen["Zc_nm"])):
        share = np.mean(np.abs(found[name] - true) < found.sigma[name])
        assert 0.60 < share < 0.76  # 68 % within three standard errors of 400 pixels
    assert found.chi2.mean() == pytest.approx(found.freedom, abs=0.25)


def test_a_large_error_of_a_lag_is_covered_where_other_readings_are_exact():
    E, sigma = np.linspace(0.5, 3.0, 100), {"lag_deg": 3.0, "shift_Hz_2": 50.0}
    seen = read(afm.bimodal(PROBE, VISCOUS, AM_FM, parameters={"E_GPa": E}))
    random = np.random.default_rng(3)
    noisy = {name: seen[name] + sigma.get(name, 0.0) * random.standard_normal(100) for name in seen}
    found = afm.bimodal_map(noisy, PROBE, VISCOUS, AM_FM, unknowns=("E_GPa",), sigma=sigma)
    assert np.sqrt(np.mean(((found["E_GPa"] - E) / found.sigma["E_GPa"]) ** 2)) < 1.5


def test_derivatives_are_differences_of_both_ways():
    seen = afm.bimodal(PROBE, SPHERE, AM_FM, parameters={"E_GPa": [2.0, 2.001, 1.999]})
    slope = (seen["shift_Hz_2"][1] - seen["shift_Hz_2"][2]) / 0.002
    assert seen.derivatives["shift_Hz_2", "E_GPa"][0] == pytest.approx(slope, rel=1e-5)
    own = {name: np.repeat(value[:1], 3) for name, value in read(seen).items()}
    own["shift_Hz_2"] = own["shift_Hz_2"] + np.array([0.0, 0.01, -0.01])
    modes = (afm.AM(A0_nm=30.0, setpoint_nm=25.0), afm.FM(A_nm=0.5))
    found = afm.bimodal_map(own, PROBE, SPHERE, modes, unknowns=("E_GPa", "eta_Pa_s", "H_aJ"))
    slope = (found["E_GPa"][1] - found["E_GPa"][2]) / 0.02
    assert found.derivatives["E_GPa", "shift_Hz_2"][0] == pytest.approx(slope, rel=1e-4)


def test_what_cannot_be_solved_is_told_pixel_by_pixel():
    readings = {
        "lag_deg": [56.5684812, 90.0, np.nan, 56.5684812],
        "shift_Hz_2": [748.830651, 0.0, 700.0, -5000.0],
        "excitation_nm_2": [0.511464328, 0.5, 0.5, 0.6],
        "amplitude_nm": [25.0, 30.0, 25.0, 25.0],
    }
    found = afm.bimodal_map(readings, PROBE, VISCOUS, AM_FM)
    assert found["E_GPa"][0] == pytest.approx(1.0, rel=1e-6)
    assert not found.reason(0)
    assert np.isnan(found["E_GPa"][1:3]).all()
    assert "free probe" in found.reason(1)
    assert found.reason(2) == "a reading is missing"
    assert "disagree" in found.reason(3) or np.isnan(found["E_GPa"][3])


def test_a_map_is_saved_loaded_and_drawn(tmp_path):
    seen = afm.bimodal(PROBE, VISCOUS, AM_FM, parameters={"E_GPa": [[1.0, 2.0], [0.5, 3.0]]})
    found = afm.bimodal_map(read(seen), PROBE, VISCOUS, AM_FM, sigma={"lag_deg": 0.1})
    again = saltus.load(found.save(tmp_path / "map.nc"))
    assert again.to_xarray().equals(found.to_xarray())
    assert unexplained(again.to_xarray()) == []
    assert again.derivatives.keys() == found.derivatives.keys()
    assert json.loads(again.to_xarray().attrs["found"]) == list(found.found)
    assert len(found.plot(("E_GPa", "eta_Pa_s"))) == 2
    assert len(seen.plot()) == len(seen.found) - 1


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: afm.bimodal(PROBE, VISCOUS, AM_FM, Zc_nm=20.0), "not by 1 modes"),
        (lambda: afm.bimodal(PROBE, VISCOUS, (afm.AM(A0_nm=30.0), afm.FM(A_nm=0.5))), "setpoint_nm"),
        (lambda: afm.bimodal(PROBE, VISCOUS, AM_FM[:1]), "2 of AM"),
        (lambda: afm.bimodal(PROBE, VISCOUS, AM_FM, parameters={"E_Gpa": 1.0}), "E_GPa"),
        (lambda: afm.bimodal(PROBE, VISCOUS, AM_FM, parameters={"E_GPa": 1e9}), "in Pa"),
        (lambda: afm.bimodal_map({"lag_deg": 60.0}, PROBE, VISCOUS, AM_FM), "there are 5 equations"),
        (lambda: afm.bimodal_map(NEGATIVE, PROBE, VISCOUS, AM_FM), "positive, in nm"),
        (lambda: afm.bimodal_map({"lag": 60.0}, PROBE, VISCOUS, AM_FM), "lag_deg"),
        (lambda: afm.FM(A_nm=0.5, A0_nm=0.5), "exactly one"),
        (lambda: afm.AM(A0_nm=0.0), "> 0"),
        (lambda: afm.AM(A0_nm=30e-9, setpoint_nm=25e-9), "in m"),
    ],
)
def test_slips_are_told_in_a_line(call, words):
    with pytest.raises(InputError, match=words):
        call()


@pytest.mark.campaign
@pytest.mark.thorough
def test_a_map_of_64_times_64_pixels_comes_back():
    E, eta = np.linspace(0.5, 3.0, 64)[:, None], np.linspace(1.0, 30.0, 64)
    seen = afm.bimodal(PROBE, VISCOUS, AM_FM, parameters={"E_GPa": E, "eta_Pa_s": eta})
    found = afm.bimodal_map(read(seen), PROBE, VISCOUS, AM_FM)
    assert np.abs(found["E_GPa"] / E - 1.0).max() < 1e-7


def test_of_two_samples_that_nearly_agree_the_one_that_does_is_told():
    """Their mean gaps are 0.5 nm apart: the depths from afar lay as far from each other, and E came out as 5.6 GPa."""
    modes = (afm.AM(A0_nm=30.0, setpoint_nm=24.0), afm.FM(A_nm=0.5))
    E, eta = np.linspace(2.2, 2.6, 3)[:, None], np.linspace(22.0, 30.0, 3)
    seen = afm.bimodal(PROBE, SPHERE, modes, parameters={"E_GPa": E, "eta_Pa_s": eta})
    found = afm.bimodal_map(read(seen), PROBE, SPHERE, modes)
    assert np.abs(found["E_GPa"] / E - 1.0).max() < 1e-7
    assert found.reason(0, 2) == "several solutions agree with the readings; that with the least chi2 is told"
