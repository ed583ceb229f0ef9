"""Readings: phases as instruments show them, energy and virial by one harmonic, harmonics along curves."""

import math
from dataclasses import dataclass

import numpy as np
import pytest

import saltus
from saltus import InputError, afm

PROBE = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
LAW = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5) + afm.Dashpot(c_uNs_m=0.0)
EV = 6.241509074460763  # eV in 1 aJ


@pytest.fixture(scope="module")
def lever():
    return afm.model(PROBE, LAW, afm.Drive(A0_nm=12.0), Zc_nm=10.0)


@pytest.fixture(scope="module")
def repulsive(lever):
    return saltus.find_orbit(lever, x0=[0.0, 0.0])


@pytest.fixture(scope="module")
def attractive(lever):
    return saltus.find_orbit(lever, {"c_uNs_m": 2.0}, x0=[0.0, 0.0])


@pytest.fixture(scope="module")
def curve(lever):
    return afm.distance_curve(lever, (9.5, 14.0)).shown_as("bruker0")


# phases as instruments show them


def test_shown_phases_are_formulas_in_the_lag(repulsive, attractive):
    for orbit, lag in ((repulsive, 63.24971471), (attractive, 121.946729)):
        seen = {name: afm.observables(orbit, phase_convention=name) for name in ("lag90", "bruker0", "asylum")}
        assert [one["lag_deg"] for one in seen.values()] == pytest.approx([lag] * 3, rel=1e-8)
        assert "shown_phase_deg" not in seen["lag90"]
        assert seen["bruker0"]["shown_phase_deg"] == pytest.approx(90.0 - lag, rel=1e-7)
        assert seen["asylum"]["shown_phase_deg"] == pytest.approx(lag, rel=1e-8)
        repels = seen["lag90"]["regime"] == "repulsive"
        assert repels == (seen["bruker0"]["shown_phase_deg"] > 0.0) == (seen["asylum"]["shown_phase_deg"] < 90.0)


def test_a_free_motion_at_resonance_shows_0_or_90(lever):
    orbit = saltus.find_orbit(lever, {"Zc_nm": 100.0, "H_aJ": 0.0}, x0=[0.0, 0.0])
    for convention, wanted in (("bruker0", 0.0), ("asylum", 90.0)):
        shown = afm.observables(orbit, phase_convention=convention)["shown_phase_deg"]
        assert shown == pytest.approx(wanted, abs=1e-8)


def test_a_shown_phase_far_above_resonance_stays_in_its_range(lever):
    far = {"Zc_nm": 100.0, "H_aJ": 0.0, "f_kHz": 600.0}
    orbit = saltus.find_orbit(lever, far, x0=[0.0, 0.0])
    seen = afm.observables(orbit, phase_convention="bruker0")
    assert 179.0 < seen["lag_deg"] < 180.0
    assert seen["shown_phase_deg"] == pytest.approx(90.0 - seen["lag_deg"], abs=1e-9)


@pytest.mark.campaign
def test_columns_paths_files_and_pictures_of_a_curve_have_its_convention(curve, tmp_path):
    np.testing.assert_allclose(curve.column("shown_phase_deg"), 90.0 - curve.column("lag_deg"), atol=1e-10)
    path = curve.path("approach")
    np.testing.assert_allclose(path["shown_phase_deg"], 90.0 - path["lag_deg"], atol=1e-10)
    assert path.attrs["phase_convention"] == "bruker0"
    held = saltus.load(curve.save(tmp_path / "curve.nc"))
    assert held == curve
    assert held.phase_convention == held.to_xarray().attrs["phase_convention"] == "bruker0"
    assert held.to_xarray()["shown_phase_deg"].attrs["units"] == "degrees"
    assert held.plot()[1].get_ylabel() == "phase, bruker0 (degrees)"


def test_a_lag_of_a_further_drive_has_its_shown_phase_too():
    drive = afm.Drive.base(Y_nm=1.0) + afm.Drive(A0_nm=3.0, ratio=2, phase_deg=30.0)
    liquid = afm.Probe(k_N_m=0.5, f0_kHz=10.0, Q=2.0, R_nm=10.0)
    orbit = saltus.find_orbit(afm.model(liquid, afm.Hertz(E_GPa=1.0), drive, Zc_nm=100.0), x0=[0.0, 0.0])
    seen = afm.observables(orbit, phase_convention="bruker0")
    assert seen["shown_phase_deg_2"] == pytest.approx(90.0 - seen["lag_deg_2"], abs=1e-9)


@pytest.mark.campaign
def test_a_curve_is_shown_in_another_convention_without_being_followed_again(curve):
    jumps = curve.jumps
    back = curve.shown_as("lag90")
    assert "shown_phase_deg" not in back.readings
    assert back.ways is curve.ways
    assert back.jumps == jumps
    np.testing.assert_array_equal(back.shown_as("asylum").column("shown_phase_deg"), back.column("lag_deg"))


def test_unknown_conventions_are_told(lever, repulsive, curve):
    for call in (
        lambda: afm.observables(repulsive, phase_convention="bruker"),
        lambda: curve.shown_as("bruker"),
    ):
        with pytest.raises(InputError, match="phase_convention = 'bruker': must be one of lag90, bruker0, asylum; did"):
            call()
    with pytest.raises(InputError, match="of = 'tipp': must be one of deflection, tip"):
        afm.distance_curve(lever, (9.0, 14.0), of="tipp")


# energy and virial by one harmonic


def test_one_harmonic_is_the_textbooks_formula(repulsive, attractive):
    for orbit in (repulsive, attractive):
        seen, p = afm.observables(orbit), orbit.parameters
        k, A, lag = p["k_N_m"], seen["amplitude_nm"], math.radians(seen["lag_deg"])
        force = k * p["A0_nm"] / p["Q"]
        energy = math.pi * (force * A * math.sin(lag) - k * A**2 / p["Q"])  # Cleveland 1998, at f0
        assert seen["E_ts_1_eV"] == pytest.approx(energy * EV, rel=1e-9, abs=1e-10 * seen["E_ext_eV"])
        virial = -0.5 * force * A * math.cos(lag)  # San Paulo and Garcia 2001, at f0
        assert seen["virial_1_eV"] == pytest.approx(virial * EV, rel=1e-9)


def test_one_harmonic_misses_a_little_on_lever_s(repulsive, attractive):
    seen = afm.observables(repulsive)
    assert 1e-4 < abs(seen["virial_1_eV"] / seen["virial_eV"] - 1.0) < 1e-2
    assert 1e-7 < abs(seen["E_ts_1_eV"] - seen["E_ts_eV"]) / seen["E_ext_eV"] < 1e-2
    seen = afm.observables(attractive)
    for name in ("E_ts", "virial"):
        assert 1e-5 < abs(seen[f"{name}_1_eV"] / seen[f"{name}_eV"] - 1.0) < 1e-2


def test_one_harmonic_becomes_exact_with_the_quality_factor(attractive):
    """Stiffness grows with Q, so that the force of the drive stays: the sample bends a motion of high Q less."""
    orbit, missed = attractive, []
    for size in (1.0, 10.0, 100.0):
        for name, value in (("k_N_m", 26.0 * size), ("Q", 400.0 * size)):
            start = orbit.parameters[name]
            if value > start:
                orbit = saltus.continue_orbit(orbit, name, bounds=(start, value), directions="up").solution(-1)
                assert orbit.parameters[name] == pytest.approx(value, rel=1e-12)
        seen = afm.observables(orbit)
        missed.append([abs(seen[f"{name}_1_eV"] / seen[f"{name}_eV"] - 1.0) for name in ("E_ts", "virial")])
    assert np.all(np.array(missed[:-1]) > 5.0 * np.array(missed[1:]))


@dataclass(frozen=True, kw_only=True)
class Linear(afm.Law):
    """A spring and a dashpot at all gaps, so that all motions are harmonic."""

    stiffness: float
    drag: float

    @property
    def regions(self):
        return {"everywhere": afm.Region("-stiffness*(D_nm - 30) - drag*V_nm_us")}


@pytest.mark.parametrize(
    ("drive", "Q"),
    [
        (afm.Drive(A0_nm=10.0), (400.0, 900.0)),
        (afm.Drive(A0_nm=10.0, mode=2), (20.0, 90.0)),
        (afm.Drive.force(F0_nN=3.0), (20.0, 90.0)),
        (afm.Drive.base(Y_nm=1.0), (2.0, 7.0)),
    ],
    ids=["first mode", "second mode", "force", "base"],
)
def test_one_harmonic_is_exact_where_the_sample_is_linear(drive, Q):
    probe = afm.Probe(k_N_m=(26.0, 1021.0), f0_kHz=(300.0, 1880.0), Q=Q, R_nm=12.0)
    law = Linear(stiffness=0.4, drag=0.02)
    orbit = saltus.find_orbit(afm.model(probe, law, drive, Zc_nm=30.0, f_kHz=290.0), x0=[0.0] * 4)
    seen, tip = afm.observables(orbit), afm.observables(orbit, of="tip")
    energy = math.pi * 0.02 * 2e-3 * math.pi * 290.0 * tip["amplitude_nm"] ** 2 * EV
    virial = -0.5 * 0.4 * tip["amplitude_nm"] ** 2 * EV
    for name, wanted in (("E_ts", energy), ("virial", virial)):
        assert seen[f"{name}_eV"] == pytest.approx(wanted, rel=1e-8)
        assert seen[f"{name}_1_eV"] == pytest.approx(wanted, rel=1e-7)


# harmonics


@pytest.mark.campaign
def test_harmonics_along_a_curve_are_those_of_its_orbits(curve):
    i = int(np.argmin(curve.column("amplitude_nm")))
    seen = afm.observables(curve.branches[0].solution(i))
    for order in (1, 2, 6):
        assert curve.harmonic_nm(order)[i] == pytest.approx(seen.harmonic_nm(order), rel=1e-9)
    table = curve.to_xarray(harmonics=(2, 6))
    assert table["harmonic_nm"].attrs["units"] == "nm"
    np.testing.assert_array_equal(table["harmonic_nm"].sel(harmonic=6), curve.harmonic_nm(6))
    assert "harmonic_nm" not in curve.to_xarray()
    with pytest.raises(InputError, match="order = 0"):
        curve.to_xarray(harmonics=(0,))
    with pytest.raises(InputError, match="harmonics = 2: must be"):
        curve.to_xarray(harmonics=2)


def test_a_self_excited_model_has_no_lag_and_says_so(lever):
    alone = afm.self_excited(lever, 10.0)
    for call in (
        lambda: afm.distance_curve(alone, (1.0, 10.0)),
        lambda: afm.feedback(alone, 8.0, Ki_1_ms=1.0, tau_us=50.0),
    ):
        with pytest.raises(saltus.InputError, match="must be a driven model; frequency_shift has readings"):
            call()
