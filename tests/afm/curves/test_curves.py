"""Distance and frequency curves of a model in nanometres: numbers, ways of an experiment, files, pictures, messages."""

import json
import math
import warnings
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

import saltus
from explained import unexplained
from saltus import InputError, afm
from saltus.afm.models.parts import values_of

# Lever S of the design: jumps, grazing and readings found by an independent event-exact code as well.
PROBE = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
LAW = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5)


@pytest.fixture(scope="module")
def lever():
    return afm.model(PROBE, LAW, afm.Drive(A0_nm=12.0), Zc_nm=20.0)


@pytest.fixture(scope="module")
def curve(lever):
    return afm.distance_curve(lever, (0.5, 14.0), f_kHz="f0")


@pytest.fixture(scope="module")
def tune(lever):
    return afm.frequency_curve(lever, (298.0, 302.0), Zc_nm=8.5)


@pytest.mark.campaign
def test_jumps_and_grazing_are_those_of_an_independent_code(curve):
    found = {(f.label, round(f.value, 7)) for f in curve.special_points if f.sheet == 0}
    assert found == {("SN1", 11.5028842), ("SN2", 9.8783378), ("GR1", 11.3409137)}
    approach, retract = curve.jumps
    assert (approach.direction, approach.value) == ("approach", pytest.approx(9.878337793, abs=1e-8))
    assert (retract.direction, retract.value) == ("retract", pytest.approx(11.50288421, abs=1e-8))
    assert approach.after_nm > approach.before_nm
    assert retract.after_nm < retract.before_nm


def test_all_sheets_at_a_distance_have_their_readings(curve):
    amplitudes = [10.71569893, 10.04804853, 9.895278868]
    lags = [63.24971471, 123.1398751, 124.4512443]
    found = [afm.observables(orbit) for orbit in curve.at(Zc_nm=10.0)]
    assert [seen["amplitude_nm"] for seen in found] == pytest.approx(amplitudes, abs=1e-8)
    assert [seen["lag_deg"] for seen in found] == pytest.approx(lags, abs=1e-6)
    assert [seen["stable"] for seen in found] == [True, False, True]
    assert found[2]["deflection_pm"] == pytest.approx(-8.75335, abs=1e-5)


@pytest.mark.campaign
def test_columns_of_a_curve_are_the_readings_of_its_orbits(curve):
    for i in (0, 17, 60, len(curve.branches[0]) - 1):
        seen = afm.observables(curve.branches[0].solution(i))
        for name in curve.readings:
            along = curve.column(name)[i]
            assert math.remainder(along - seen[name], 360.0 if name == "lag_deg" else 1e9) == pytest.approx(
                0.0, abs=1e-7
            )


def test_energy_is_balanced_all_along(curve):
    balance = curve.column("E_ext_eV") - curve.column("E_ts_eV") - curve.column("E_med_eV")
    assert np.abs(balance).max() < 1e-9 * curve.column("E_ext_eV").max()
    assert np.abs(curve.column("E_ts_eV")).max() < 1e-9 * curve.column("E_ext_eV").max()


def test_paths_follow_stable_sheets_and_jump_where_these_end(curve):
    for direction, sign, place in (("approach", -1.0, 9.878337793), ("retract", 1.0, 11.50288421)):
        path = curve.path(direction)
        (behind,) = np.flatnonzero(path["jump"].values)
        assert path["Zc_nm"].values[behind - 1 : behind + 1] == pytest.approx([place, place], abs=1e-8)
        assert np.all(sign * np.diff(path["Zc_nm"].values) >= 0.0)
        assert path["amplitude_nm"].attrs == {"units": "nm", "long_name": "amplitude", "description": "Amplitude."}
        assert unexplained(path) == []
        assert path.attrs["stopped"].endswith("the end of the range")
    # a simulation that starts on the path just before the jump and goes past it settles on the path behind it
    before, after = curve.jumps[0].before_nm, curve.jumps[0].after_nm
    (orbit,) = [o for o in curve.at(9.9) if o.stable and afm.observables(o)["amplitude_nm"] < 10.0]
    settled = saltus.find_orbit(orbit.system, {**orbit.parameters, "Zc_nm": 9.85}, orbit.x0)
    assert abs(afm.observables(settled)["amplitude_nm"] - after) < 0.1 < after - before


@pytest.mark.campaign
def test_a_frequency_curve_turns_at_both_jumps(tune):
    jumps = [("down", 300.0501), ("down", 299.2872), ("up", 299.4915)]
    assert [(jump.direction, round(jump.value, 4)) for jump in tune.jumps] == jumps
    assert tune.path("up")["f_kHz"].values[[0, -1]] == pytest.approx([298.0, 302.0], abs=1e-9)


@pytest.mark.campaign
def test_a_curve_is_saved_and_read_back_equal(curve, tmp_path):
    held = saltus.load(curve.save(tmp_path / "curve.nc"))
    assert held == curve
    assert held.jumps == curve.jumps
    dataset = curve.to_xarray(harmonics=[2])
    assert unexplained(dataset) == []
    assert dataset["lag_deg"].attrs["units"] == "degrees"
    assert dataset.attrs["phase_convention"] == "lag90"
    assert "approach" in repr(curve)


def test_a_label_that_several_sheets_have_is_told_with_its_sheet(curve):
    twice = replace(curve, branches=(curve.branches[0], curve.branches[0]))
    vars(twice)["ways"] = curve.ways
    labels = [line.split()[:2] for line in repr(twice).splitlines() if line.startswith(("  SN1", "  GR1"))]
    assert labels == [["SN1", "(0)"], ["GR1", "(0)"], ["SN1", "(1)"], ["GR1", "(1)"]]


@pytest.mark.campaign
def test_a_dataset_tells_the_regime_of_each_point_and_what_the_model_is_made_of(curve, tmp_path):
    told = curve.to_xarray()
    for i in (0, 17, 60, len(curve.branches[0]) - 1):
        assert told["regime"].values[i] == afm.observables(curve.branches[0].solution(i))["regime"]
    assert set(told["regime"].values) == {"attractive", "repulsive"}
    with xr.open_dataset(curve.save(tmp_path / "curve.nc"), engine="h5netcdf") as held:
        assert held["regime"].values.tolist() == told["regime"].values.tolist()
        probe, law, drive = (json.loads(held.attrs[name]) for name in ("probe", "law", "drive"))
    assert probe == {"k_N_m": [26.0], "f0_kHz": [300.0], "Q": [400.0], "R_nm": 12.0}
    assert law["parameters"] == {"H_aJ": 0.12, "a0_nm": 0.3, "E_GPa": 1.5}
    assert law["force_nN"] == curve.system.outputs["force_nN"]
    assert drive == [{"A0_nm": 12.0}]


def test_what_a_model_is_made_of_has_the_values_that_are_held_and_all_modes_and_drives():
    probe = afm.Probe(k_N_m=(2.0, 78.5), f0_kHz=(70.0, 438.7), Q=(150.0, 450.0), R_nm=10.0)
    drive = afm.Drive(A0_nm=20.0) + afm.Drive(A0_nm=1.0, mode=2, ratio="19/3", phase_deg=30.0)
    system = afm.model(probe, afm.Hertz(E_GPa=1.0), drive, Zc_nm=40.0)
    held = {name: value for name, value in system.parameters.items() if name != "E_GPa"}
    told = values_of(system, held | {"Q_2": 500.0})
    assert told["probe"] == {"k_N_m": [2.0, 78.5], "f0_kHz": [70.0, 438.7], "Q": [150.0, 500.0], "R_nm": 10.0}
    assert told["law"]["parameters"] == {"E_GPa": None}
    assert told["drive"] == [{"A0_nm": 20.0}, {"A0_nm": 1.0, "ratio": pytest.approx(19 / 3), "phase_deg": 30.0}]


@pytest.mark.parametrize("way", ["approach", "retract"])
def test_a_way_that_is_written_as_a_text_file_is_read_back_the_same(curve, tmp_path, way):
    table = curve.path(way)[["amplitude_nm", "lag_deg", "E_ts_eV"]].to_dataframe().assign(direction=way)
    table.to_csv(tmp_path / "apd.csv", index=False)
    read = afm.read_curve(tmp_path / "apd.csv")
    assert all(np.array_equal(read[name], table[name]) for name in table)
    renamed = table.rename(columns={"Zc_nm": "Z (nm)", "amplitude_nm": "A (nm)"})
    renamed.to_csv(tmp_path / "other.csv", index=False)
    picked = afm.read_curve(tmp_path / "other.csv", {"Zc_nm": "Z (nm)", "amplitude_nm": "A (nm)", "lag_deg": "lag_deg"})
    assert all(np.array_equal(picked[name], table[name]) for name in picked)


@pytest.mark.campaign
def test_the_ways_go_through_snap_in_and_pull_off_where_static_equilibria_end():
    """At small amplitude the snap-in is at 1.5 (H R/3k)^(1/3), the pull-off at a0 + H R/(6 k a0^2)."""
    probe = afm.Probe(k_N_m=2.0, f0_kHz=70.0, Q=150.0, R_nm=12.0)
    system = afm.model(probe, LAW, afm.Drive(A0_nm=1e-3), Zc_nm=20.0)
    curve = afm.distance_curve(system, (0.0, 5.0))
    assert curve.path("approach").attrs["stopped"] == "Zc_nm = 0: the end of the range; the tip stays in contact"
    assert curve.path("retract").attrs["stopped"] == "Zc_nm = 5: the end of the range"
    snap_in, pull_off = curve.jumps
    assert snap_in.value == pytest.approx(1.5 * (0.12 * 12.0 / 6.0) ** (1 / 3), rel=1e-5)
    assert pull_off.value == pytest.approx(0.3 + 0.12 * 12.0 / (6.0 * 2.0 * 0.3**2), rel=1e-4)
    assert str(snap_in).startswith("approach at Zc_nm = 0.932")
    assert [jump.what for jump in curve.jumps] == ["snap-in: the tip stays in contact", "pull-off: the tip comes off"]
    held = afm.observables(snap_in.after)  # below its resonance the tip follows the drive as the springs together do
    stiffness = 2.0 + 2.0 * 1.5 * math.sqrt(12.0 * (0.3 - snap_in.after.max["D_nm"]))
    assert held["amplitude_nm"] == pytest.approx(2.0 * 1e-3 / 150.0 / (stiffness - 2.0), rel=1e-3)
    assert held["contact_fraction"] == pytest.approx(1.0)
    assert curve.branches[0]["SN1"].parameters["Zc_nm"] == pytest.approx(1.5 * (0.12 * 12.0 / 6.0) ** (1 / 3), rel=1e-5)
    assert len(curve) < 400


@pytest.mark.campaign
def test_a_range_below_the_pull_in_is_a_curve_that_says_so(lever, curve):
    below = afm.distance_curve(lever, (-3.0, -1.0))
    assert "contact     at all times: the tip is pulled in at larger distances already" in repr(below)
    np.testing.assert_allclose(below.column("contact_fraction"), 1.0, rtol=1e-12)
    assert "at all times" not in repr(curve)


@pytest.mark.campaign
def test_pictures_have_units_both_ways_and_jumps(curve, tune):
    upper, lower = curve.plot()
    assert [upper.get_ylabel(), lower.get_ylabel()] == ["amplitude (nm)", "lag behind the drive (degrees)"]
    assert lower.get_xlabel() == "distance $Z_c$ (nm)"
    assert {"approach", "retract", "stable", "unstable"} <= {text.get_text() for text in upper.get_legend().get_texts()}
    assert tune.plot("energy")[1].get_xlabel() == "frequency (kHz)"
    with pytest.raises(InputError, match="kind = 'apc': must be one of apd, tune, energy, force; did you mean 'apd'"):
        curve.plot("apc")
    with pytest.raises(InputError, match="ax = .*: must be two Axes"):
        curve.plot(ax=[upper])


@pytest.mark.campaign
def test_the_natural_frequency_is_that_of_the_mode_that_is_driven():
    probe = afm.Probe(k_N_m=(26.0, 1021.0), f0_kHz=(300.0, 1880.0), Q=(400.0, 1200.0), R_nm=12.0)
    for mode, f0, Q in ((1, 300.0, 400.0), (2, 1880.0, 1200.0)):
        system = afm.model(probe, LAW, afm.Drive(A0_nm=1.0, mode=mode), Zc_nm=20.0, f_kHz=250.0)
        for name, wanted in (("f0", f0), ("peak", f0 * math.sqrt(1.0 - 0.5 / Q**2))):
            curve = afm.distance_curve(system, (19.0, 20.0), f_kHz=name)
            assert curve.branches[0].parameters["f_kHz"] == pytest.approx(wanted, rel=1e-14)


def test_special_points_have_their_motions_and_jumps_are_told_in_words(curve):
    fold = next(feature for feature in curve.special_points if feature.label == "SN1")
    assert fold.orbit.multipliers.real.max() == pytest.approx(1.0, abs=1e-6)
    assert fold.parameters["Zc_nm"] == fold.value
    assert afm.observables(fold.orbit)["amplitude_nm"] == pytest.approx(fold.amplitude_nm)
    told = [str(jump) for jump in curve.jumps]
    assert told == [
        "approach at Zc_nm = 9.87834: the amplitude jumps up, amplitude from 9.847 to 10.6 nm",
        "retract at Zc_nm = 11.5029: the amplitude jumps down, amplitude from 11.99 to 11.19 nm",
    ]
    assert curve.jumps[0].before.parameters["Zc_nm"] == pytest.approx(curve.jumps[0].value)


def test_bad_input_is_told(lever, curve, impact_oscillator):
    with pytest.raises(InputError, match=r"system = 'impact oscillator': must be one of saltus.afm.model"):
        afm.distance_curve(impact_oscillator, (1.0, 2.0))
    with pytest.raises(InputError, match="bounds = "):
        afm.distance_curve(lever, (14.0, 0.5))
    with pytest.raises(InputError, match="f_kHz = 0.0: must be a finite number > 0"):
        afm.frequency_curve(lever, (0.0, 302.0))
    with pytest.raises(InputError, match="f_kHz = 'f1'.*f0, peak"):
        afm.distance_curve(lever, (1.0, 14.0), f_kHz="f1")
    with pytest.raises(InputError, match="Zc_nm = 99.0: must be between"):
        curve.at(99.0)
    with pytest.raises(InputError, match="one value of Zc_nm"):
        curve.at(f_kHz=300.0)
    with pytest.raises(InputError, match="direction = 'up': must be one of approach, retract"):
        curve.path("up")
    with pytest.raises(InputError, match="did you mean 'amplitude_nm'"):
        curve.column("amplitud_nm")


@pytest.mark.campaign
def test_the_ways_go_on_through_a_grazing_between_two_stable_motions():
    """Where the tip begins to touch, the point on the grazing has a contact of no duration, and nothing jumps there."""
    probe = afm.Probe(k_N_m=40.0, f0_kHz=270.0, Q=500.0, R_nm=20.0)
    law = afm.VanDerWaals(H_aJ=0.064, a0_nm=0.165) + afm.DMT(E_GPa=10.0)
    curve = afm.distance_curve(afm.model(probe, law, afm.Drive(A0_nm=13.0), Zc_nm=20.0), (4.0, 12.0))
    grazings = [feature.value for feature in curve.special_points if feature.label.startswith("GR")]
    assert [round(value, 3) for value in grazings] == [5.817, 9.299]
    assert curve.jumps == ()
    assert [way.stopped for way in curve.ways] == [
        "Zc_nm = 4: the end of the range",
        "Zc_nm = 12: the end of the range",
    ]


@pytest.mark.campaign
def test_jumps_do_not_depend_on_how_wide_the_range_is(lever, curve, tune):
    wide = afm.distance_curve(lever, (0.5, 14000.0))
    np.testing.assert_allclose([jump[1:] for jump in wide.jumps], [jump[1:] for jump in curve.jumps], rtol=1e-8)
    tuned = afm.frequency_curve(lever, (100.0, 302.0), Zc_nm=8.5)
    for narrow in (jump[1:] for jump in tune.jumps):
        np.testing.assert_allclose(
            min(abs(np.array([jump[1:] for jump in tuned.jumps]) - narrow).max(axis=1)), 0.0, atol=1e-8
        )


@pytest.mark.campaign
def test_a_tip_that_is_pressed_into_a_sample_without_attraction_is_not_pulled_in():
    probe = afm.Probe(k_N_m=0.05, f0_kHz=3.0, Q=2.0, R_nm=2000.0)
    system = afm.model(probe, afm.Hertz(E_GPa=1e-5), afm.Drive(A0_nm=50.0), Zc_nm=100.0)
    curve = afm.distance_curve(system, (-200.0, 60.0))
    assert curve.ways[0].stopped == "Zc_nm = -200: the end of the range; the tip stays in contact"
    (sheet,) = curve.branches
    assert [point.type for point in sheet.special_points] == ["GR", "GR"]
    places = [point.value("Zc_nm") for point in sheet.special_points]
    np.testing.assert_allclose(places, [-53.1736086174, 50.0], atol=1e-9)
    for place, mode in ((-53.3, "contact"), (-53.0, "far")):
        (orbit,) = curve.at(place)
        settled = saltus.find_orbit(system, {"Zc_nm": place}, [0.0, 0.0])
        assert mode in {part.mode for part in settled.segments}
        assert len(orbit.segments) == len(settled.segments)
        np.testing.assert_allclose(orbit.lows[:2], settled.lows[:2], rtol=1e-8)


def test_a_place_that_is_no_number_is_told(curve):
    with pytest.raises(InputError, match="Zc_nm"):
        curve.at("10")


@pytest.mark.thorough
@pytest.mark.campaign
def test_an_adhesive_contact_under_a_neck_ends_at_no_grazing_that_is_rounding():
    """The force of JKR's contact has an infinite slope at pull-off: rounding there is no second touch."""
    probe = afm.Probe(k_N_m=20.0, f0_kHz=200.0, Q=200.0, R_nm=15.0)
    law = afm.Schwarz(E_GPa=1.0, w1_N_m=0.02, w2_N_m=0.02, a0_nm=0.3)
    law = law + afm.Neck(gamma_N_m=0.02, h_nm=0.5, on_nm=0.6, off_nm=2.0)
    system = afm.model(probe, law, afm.Drive(A0_nm=25.0), Zc_nm=8.125)
    branch = saltus.continue_orbit(saltus.find_orbit(system, x0=[0.0, 0.0]), "Zc_nm", (8.0, 30.0))
    folds, grazings = (branch.special_points.of_type(name) for name in ("SN", "GR"))
    np.testing.assert_allclose([point.value("Zc_nm") for point in folds], [23.0902057, 22.0197084], atol=1e-6)
    np.testing.assert_allclose([point.value("Zc_nm") for point in grazings], [23.9495], atol=1e-4)


def stable_at(curve, value):
    return sorted(afm.observables(orbit)["amplitude_nm"] for orbit in curve.at(value) if orbit.stable)


@pytest.mark.campaign
def test_motions_and_jumps_of_a_frequency_curve_do_not_depend_on_its_range(lever, tune):
    """At 302 kHz a tip at rest settles on the small motion, and one that comes from the resonance has the large one."""
    at = {**lever.parameters, "Zc_nm": 8.5, "f_kHz": 302.0}
    small = afm.observables(saltus.find_orbit(lever, at, [0.0, 0.0]))["amplitude_nm"]
    for bounds in ((298.0, 310.0), (299.9, 302.0), (301.5, 302.5)):
        other = afm.frequency_curve(lever, bounds, Zc_nm=8.5)
        np.testing.assert_allclose(stable_at(other, 302.0), [small, 10.3606], atol=1e-4)
        if bounds[0] < 300.0:
            assert round(next(jump.value for jump in other.jumps if jump.direction == "down"), 3) == 300.050
    np.testing.assert_allclose(stable_at(tune, 302.0), [small, 10.3606], atol=1e-4)


@pytest.mark.campaign
def test_a_soft_lever_has_its_motions_in_permanent_contact_whatever_the_range():
    """Pressed in by the spring and held by the attraction, the tip follows the drive at rest in the contact."""
    system = afm.model(afm.Probe(k_N_m=0.3, f0_kHz=20.0, Q=100.0, R_nm=10.0), LAW, afm.Drive(A0_nm=10.0), Zc_nm=8.5)
    wide, narrow = (afm.distance_curve(system, bounds) for bounds in ((-20.0, 26.0), (2.0, 26.0)))
    np.testing.assert_allclose(stable_at(wide, 5.0), stable_at(narrow, 5.0), rtol=1e-7)
    held = min(wide.at(5.0), key=lambda orbit: (not orbit.stable, orbit.max["D_nm"] - orbit.min["D_nm"]))
    stiffness = 0.3 + 2.0 * 1.5 * math.sqrt(10.0 * (0.3 - 0.5 * (held.min["D_nm"] + held.max["D_nm"])))
    drive = 0.3 * 10.0 / 100.0  # nN
    assert stable_at(wide, 5.0)[0] == pytest.approx(drive / (stiffness - 0.3), rel=0.01)
    assert wide.ways[0].stopped == "Zc_nm = -20: the end of the range; the tip stays in contact"
    assert [jump.what.split(":")[0] for jump in wide.jumps] == ["snap-in", "pull-off"]


@pytest.mark.campaign
def test_a_motion_that_taps_beside_those_in_contact_is_found_in_any_range():
    """A stiffer tap beside the attracted motion: on it settles a tip drawn back, at shares of the free amplitude."""
    probe = afm.Probe(k_N_m=0.3, f0_kHz=20.0, Q=100.0, R_nm=10.0)
    system = afm.model(probe, LAW, afm.Drive(A0_nm=10.0), Zc_nm=5.0)
    changes = {"H_aJ": 0.1, "a0_nm": 0.2, "E_GPa": 1.0}
    starts = ([0.0, 0.0], [5.0, 0.0], [-5.0, 0.0])
    settled = [afm.observables(saltus.find_orbit(system, changes, x0))["amplitude_nm"] for x0 in starts]
    assert len(set(np.round(settled, 4))) == 3
    for bounds in ((-20.0, 26.0), (2.0, 26.0), (0.0, 12.0)):
        np.testing.assert_allclose(
            stable_at(afm.distance_curve(system, bounds, parameters=changes), 5.0), sorted(settled), rtol=1e-6
        )


@pytest.mark.campaign
def test_what_settles_on_no_orbit_is_told_and_kept(tune, tmp_path):
    told = replace(tune, failures=((300.0, "f_kHz = 300, from rest: the motion is chaotic"),))
    with pytest.warns(RuntimeWarning, match=r"missing at f_kHz = 300\.3: f_kHz = 300, from rest: the .* chaotic$"):
        assert len(told.at(300.3)) == len(tune.at(300.3))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        told.at(301.0)  # further away than an eighth of the range
    told.save(tmp_path / "tune.nc")
    assert afm.Curve.load(tmp_path / "tune.nc").failures == told.failures
    assert "in part     f_kHz = 300, from rest" in repr(told)


def test_distance_and_frequency_have_units_and_names_in_datasets(curve, tune):
    told = {"units": "nm", "long_name": "distance", "description": "Distance."}
    assert curve.to_xarray()["Zc_nm"].attrs == curve.path("approach")["Zc_nm"].attrs == told
    told = {"units": "kHz", "long_name": "frequency of the first drive"}
    assert tune.to_xarray()["f_kHz"].attrs == told | {"description": "Frequency of the first drive."}


def test_progress_tells_orbits_and_motions_that_settle():
    seen = []
    probe = afm.Probe(k_N_m=2.0, f0_kHz=70.0, Q=20.0, R_nm=10.0)
    system = afm.model(probe, afm.Hertz(E_GPa=1.0), afm.Drive(A0_nm=10.0), Zc_nm=20.0)
    curve = afm.distance_curve(system, (8.0, 12.0), progress=seen.append)
    assert [one.done for one in seen] == list(range(1, len(seen) + 1))
    texts = [one.text for one in seen]
    assert "a motion settles at Zc_nm = 8, from rest" in texts
    assert sum(text.startswith("Zc_nm = ") for text in texts) > len(curve) // 2


def test_a_start_in_contact_is_in_contact_where_the_base_moves():
    """The base is 2 nm up when the phase is 0: a tip at a gap of 0 is bent by 2 nm more."""
    law = afm.DLVO(tip_mC_m2=-20.0, sample_mC_m2=-30.0, debye_nm=3.0, H_aJ=0.01) + afm.DMT(E_GPa=0.01, a0_nm=0.3)
    wet = afm.Probe(k_N_m=0.8, f0_kHz=24.5, Q=3.5, R_nm=10.0)
    curve = afm.frequency_curve(afm.model(wet, law, afm.Drive.base(Y_nm=2.0), Zc_nm=8.0), (5.0, 9.0))
    assert not curve.failures
