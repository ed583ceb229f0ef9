"""Calibrations from spectra with a known cantilever, by each way to a stiffness; errors; files; what does not go."""

from __future__ import annotations

import math

import numpy as np
import pytest

import saltus
from explained import unexplained
from saltus import afm
from saltus.afm.calibration.thermal import oscillator
from saltus.errors import InputError

AIR = afm.Fluid.air()
LEVER = afm.Cantilever(length=240e-6, width=35e-6, thickness=2.3e-6, density=2320.0, young=169e9)
STATIC = 169e9 * 35e-6 * 2.3e-6**3 / 4.0 / 240e-6**3  # N/m
T_K = 295.0
THERMAL = 1.380649e-23 * T_K  # J
INVOLS = 60.0  # nm/V, by pressing on a sample
CHI = 1.5 / 1.3765058  # static over dynamic slope at the end of a uniform beam
MODE = afm.fluid_modes(LEVER, AIR)[0]
SIZES = {"length_um": (240.0, 1.0), "width_um": (35.0, 0.5), "fluid": AIR}


def spectrum(seed, unit, white=3e-9, averages=100):
    """What light shows of the lever's motion, in nm of the static sensitivity or in V."""
    variance = THERMAL / LEVER.k * 1e18 / CHI**2  # nm^2
    f = np.linspace(0.05, 200.0, 4000)
    psd = oscillator(f, np.array([MODE.f0_kHz, MODE.Q, variance, white]))
    psd *= np.random.default_rng(seed).gamma(averages, size=len(f)) / averages
    scale = 1.0 if unit == "psd_nm2_Hz" else INVOLS**-2
    return {"f_kHz": f, unit: psd * scale}


@pytest.fixture(scope="module")
def in_volts():
    return afm.calibrate(spectrum(1, "psd_V2_Hz"), T_K=(T_K, 1.0), invols_nm_V=(INVOLS, 1.0), **SIZES)


@pytest.fixture(scope="module")
def without_invols():
    return afm.calibrate(spectrum(2, "psd_V2_Hz"), T_K=T_K, **SIZES)


def test_both_stiffnesses_are_the_lever_s(in_volts):
    for name in ("k_sader_N_m", "k_equipartition_N_m"):
        assert abs(in_volts[name] - STATIC) < 3.0 * in_volts.errors[name]
        assert in_volts.errors[name] < 0.06 * STATIC
    assert in_volts.method == "sader"
    assert in_volts["k_static_N_m"] == in_volts["k_sader_N_m"]
    assert in_volts["k_N_m"] / in_volts["k_static_N_m"] == pytest.approx(1.0302, abs=5e-5)


def test_invols_follow_from_sader_s_stiffness(without_invols):
    assert abs(without_invols["invols_nm_V"] - INVOLS) < 3.0 * without_invols.errors["invols_nm_V"]
    assert without_invols.errors["invols_nm_V"] < 0.03 * INVOLS
    assert without_invols["amplitude_nm"] == pytest.approx(1e9 * math.sqrt(THERMAL / LEVER.k), rel=0.03)


def test_errors_add_up_as_by_hand(in_volts):
    errors, spread = in_volts.errors, in_volts.covariance
    names = list(in_volts.names)
    relative = {name: errors[name] / in_volts[name] for name in names}
    by_hand = math.sqrt(relative["variance"] ** 2 + 4.0 * (1.0 / INVOLS) ** 2 + (1.0 / T_K) ** 2)
    assert relative["k_equipartition_N_m"] == pytest.approx(by_hand, rel=1e-6)
    i, j = names.index("k_N_m"), names.index("k_static_N_m")
    assert spread[i, j] / math.sqrt(spread[i, i] * spread[j, j]) == pytest.approx(1.0, abs=1e-9)
    assert relative["k_sader_N_m"] > math.hypot(relative["Q"], 1.0 / 240.0)


def test_a_displacement_has_no_factor_of_the_slope():
    data = spectrum(4, "psd_nm2_Hz")
    light, end = (
        afm.calibrate(data, T_K=T_K, options=afm.CalibrationOptions(lever=lever))
        for lever in ("optical", "displacement")
    )
    ratio = end["k_equipartition_N_m"] / light["k_equipartition_N_m"]
    assert ratio == pytest.approx(CHI**2, rel=1e-6)
    assert light.method == "equipartition"


def test_a_given_stiffness_comes_first_and_method_chooses():
    data = spectrum(5, "psd_V2_Hz")
    found = afm.calibrate(data, T_K=T_K, k_static_N_m=(1.5, 0.1), **SIZES)
    assert (found.method, found["k_static_N_m"]) == ("given", 1.5)
    assert found.errors["k_static_N_m"] == pytest.approx(0.1)
    assert (
        afm.calibrate(data, T_K=T_K, k_static_N_m=1.5, options=afm.CalibrationOptions(method="sader"), **SIZES).method
        == "sader"
    )


def test_a_probe_and_priors_have_the_values(in_volts):
    probe = in_volts.probe(R_nm=8.0)
    assert (probe.k_N_m, probe.f0_kHz, probe.Q) == (
        (in_volts["k_N_m"],),
        (in_volts["f0_kHz"],),
        (in_volts["Q"],),
    )
    assert in_volts.priors["Q"] == (in_volts["Q"], in_volts.errors["Q"])
    assert set(in_volts.priors) == {"f0_kHz", "Q", "k_N_m"}


def test_a_second_mode_makes_a_probe_of_two(in_volts):
    second = afm.fluid_modes(LEVER, AIR, 2)[1]
    f = np.linspace(200.0, 600.0, 4000)
    psd = oscillator(f, np.array([second.f0_kHz, second.Q, 1e-7, 1e-12]))
    psd *= np.random.default_rng(6).gamma(100, size=len(f)) / 100
    found = afm.calibrate({"f_kHz": f, "psd_V2_Hz": psd}, T_K=T_K, options=afm.CalibrationOptions(mode=2), **SIZES)
    assert abs(found["k_static_N_m"] - STATIC) < 3.0 * found.errors["k_static_N_m"]
    assert found["k_N_m"] / found["k_static_N_m"] == pytest.approx(4.6940911**4 / 12.0, rel=1e-7)
    assert in_volts.probe(R_nm=8.0, higher=[found]).modes == 2
    with pytest.raises(InputError, match="modes are 1, 2, 3"):
        found.probe(R_nm=8.0)


def test_a_file_goes_to_a_probe_in_one_call_and_results_are_kept(tmp_path, in_volts):
    data = spectrum(1, "psd_V2_Hz")
    rows = zip(data["f_kHz"].tolist(), data["psd_V2_Hz"].tolist(), strict=True)
    file = tmp_path / "thermal.csv"
    file.write_text("f_kHz,psd_V2_Hz\n" + "".join(f"{f!r},{psd!r}\n" for f, psd in rows))
    assert afm.calibrate(file, T_K=(T_K, 1.0), invols_nm_V=(INVOLS, 1.0), **SIZES) == in_volts
    again = saltus.load(in_volts.save(tmp_path / "lever.nc"))
    assert again == in_volts
    assert unexplained(again.to_xarray()) == []
    assert repr(again) == repr(in_volts)
    assert "k_sader_N_m" in repr(again)


def test_a_picture_shows_spectrum_and_fit(in_volts):
    pytest.importorskip("matplotlib").use("Agg")
    axes = in_volts.plot()
    assert axes.get_ylabel() == "power spectral density (V$^2$/Hz)"
    assert any("kHz, Q" in line.get_label() for line in axes.lines)
    np.testing.assert_array_equal(in_volts.model(), in_volts.model(in_volts.f_kHz))
    used = in_volts.f_kHz[in_volts.used]
    assert used[0] / 2.0 < axes.get_xlim()[0] <= used[0] < used[-1] <= axes.get_xlim()[1] < 2.0 * used[-1]


def test_what_disagrees_is_told():
    data = spectrum(7, "psd_nm2_Hz")
    found = afm.calibrate(data, T_K=T_K, length_um=240.0, width_um=45.0, fluid=AIR)
    assert any("more than the errors explain" in note for note in found.notes)
    assert any(
        "times that of 7 averages" in note
        for note in afm.calibrate(data, options=afm.CalibrationOptions(averages=7)).notes
    )
    assert "more than the errors explain" in repr(found)


@pytest.mark.campaign
def test_bins_that_are_not_of_one_oscillator_are_told():
    f = np.linspace(0.05, 200.0, 4000)
    noise = np.random.default_rng(2).gamma(50, size=f.size) / 50
    peak = oscillator(f, np.array([60.0, 150.0, 1e-3, 1e-9]))
    both = {"f_kHz": f, "psd_nm2_Hz": (peak + oscillator(f, np.array([110.0, 200.0, 1e-3, 0.0]))) * noise}
    told = "not those of one oscillator"
    assert any(told in note for note in afm.calibrate(both).notes)  # the fit is one broad peak, with a Q of 1.6
    alone = afm.calibrate(both, options=afm.CalibrationOptions(range_kHz=(45.0, 80.0)))
    assert abs(alone["Q"] - 150.0) < 3.0 * alone.errors["Q"]
    with pytest.raises(InputError, match="0 bins between 45000 and 80000 kHz.* in Hz\\? then it is 45 to 80 kHz$"):
        afm.calibrate(both, options=afm.CalibrationOptions(range_kHz=(45e3, 80e3)))
    water = oscillator(f, np.array([12.0, 2.0, 1e-3, 1e-8]))
    sloped = {"f_kHz": f, "psd_nm2_Hz": (water + 3e-7 / f) * noise}
    assert any(told in note for note in afm.calibrate(sloped).notes)  # Q is 1.41
    for data in ({"f_kHz": f, "psd_nm2_Hz": peak * noise}, {"f_kHz": f, "psd_nm2_Hz": water * noise}):
        assert not any(told in note for note in afm.calibrate(data).notes)


def test_what_does_not_go_together_is_refused():
    data = spectrum(8, "psd_nm2_Hz")
    with pytest.raises(InputError, match="length_um, width_um and fluid together"):
        afm.calibrate(data, length_um=240.0)
    with pytest.raises(InputError, match="left out for a spectrum in nm"):
        afm.calibrate(data, invols_nm_V=60.0)
    with pytest.raises(InputError, match="method = 'sader': must be one of equipartition"):
        afm.calibrate(data, options=afm.CalibrationOptions(method="sader"))
    with pytest.raises(InputError, match="in m\\? then it is 240 um"):
        afm.calibrate(data, length_um=240e-6, width_um=35.0, fluid=AIR)
    with pytest.raises(InputError, match="are both swapped"):
        afm.calibrate(data, length_um=35.0, width_um=240.0, fluid=AIR)
    with pytest.raises(InputError, match="T_K = 22.0: .* in degrees C"):
        afm.calibrate(data, T_K=22.0)
    with pytest.raises(InputError, match="T_K"):
        afm.calibrate(data, T_K=-3.0)
    with pytest.raises(InputError, match="error of T_K = 400.0: must be below the value 300"):
        afm.calibrate(data, T_K=(300.0, 400.0))
    with pytest.raises(InputError, match="lever"):
        afm.CalibrationOptions(lever="laser")
    with pytest.raises(InputError, match="give calibrate length_um"):
        afm.calibrate(spectrum(8, "psd_V2_Hz")).probe(R_nm=8.0)


def test_white_noise_that_is_not_seen_is_told():
    told = "no white noise is seen"
    assert any(told in note for note in afm.calibrate(spectrum(4, "psd_nm2_Hz", white=0.0)).notes)
    assert not any(told in note for note in afm.calibrate(spectrum(1, "psd_nm2_Hz")).notes)
