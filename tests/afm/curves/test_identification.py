"""Fits of models to distance and frequency curves: values that made the data are found again."""

import numpy as np
import pytest

import saltus
from saltus import InputError, MeasuredPoint, afm
from saltus.continuation.results.sheets import sheets_of
from saltus.options import FitOptions
from selection import CAMPAIGN, guarding

TRUE = {"H_aJ": 0.12, "E_GPa": 1.5, "c_uNs_m": 2.0, "Zc_nm": 8.5}
SIGMA = {"amplitude_nm": 0.03, "lag_deg": 0.3}
VARY = {"H_aJ": (0.01, 1.0), "E_GPa": (0.05, 20.0), "c_uNs_m": (0.0, 20.0), "Zc_nm": (6.0, 12.0)}


def lever(**changes):
    values = TRUE | changes
    probe = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
    law = afm.VanDerWaals(H_aJ=values["H_aJ"], a0_nm=0.3) + afm.DMT(E_GPa=values["E_GPa"])
    law = law + afm.Dashpot(c_uNs_m=values["c_uNs_m"])
    return afm.model(probe, law, afm.Drive(A0_nm=12.0), Zc_nm=values["Zc_nm"])


@pytest.fixture(scope="module")
def tune():
    return afm.frequency_curve(lever(), (298.5, 301.0))


def swept(curve, values):
    """Readings on both ways, without noise."""
    jumps = {jump.direction: jump.value for jump in real_jumps(curve)}
    rows = []
    for way, first, sign in zip(curve.directions, (0, -1), (-1.0, 1.0), strict=True):
        for value in values:
            found = [afm.observables(orbit) for orbit in curve.at(value) if orbit.stable]
            found.sort(key=lambda one: one["lag_deg"], reverse=curve.along == "f_kHz")
            jumped = sign * value > sign * jumps[way]
            seen = found[-1 - first if jumped else first]
            rows.append((value, seen["amplitude_nm"], seen["lag_deg"], way))
    names = (curve.along, "amplitude_nm", "lag_deg", "direction")
    return {name: [row[k] for row in rows] for k, name in enumerate(names)}


def real_jumps(curve):
    """Jumps at which the amplitude changes."""
    return [jump for jump in curve.jumps if abs(jump.after_nm - jump.before_nm) > 0.1]


@pytest.fixture(scope="module")
def folds(tune):
    return [MeasuredPoint("SN", jump.value, 0.005, jump.direction) for jump in real_jumps(tune)]


@pytest.mark.campaign
@pytest.mark.thorough
def test_three_unknowns_are_found_by_a_distance_curve():
    curve = afm.distance_curve(lever(c_uNs_m=0.3), (6.0, 13.0))
    data = swept(curve, np.linspace(7.0, 12.5, 6))
    ways = {"approach": "down", "retract": "up"}
    points = [MeasuredPoint("SN", jump.value, 0.05, ways[jump.direction]) for jump in real_jumps(curve)]
    vary = {name: VARY[name] for name in ("H_aJ", "E_GPa", "c_uNs_m")}
    start = lever(H_aJ=0.14, E_GPa=1.2, c_uNs_m=0.36)
    found = afm.fit(data, start, vary, SIGMA, jumps=points, options=FitOptions(profile=()))
    assert found.values == pytest.approx([0.12, 1.5, 0.3], rel=1e-5)
    assert found.stopped == "the optimum is found"
    assert abs(found.correlation.loc["H_aJ", "E_GPa"]) > 0.5


@pytest.mark.campaign
def test_the_radius_enters_as_a_product_and_a_root_only(tune, folds):
    """R dA/dR = H dA/dH + E/2 dA/dE: the data do not change along H -1 %, R +1 %, E -0.5 %."""
    data = swept(tune, np.linspace(298.9, 300.5, 5))
    vary = {"H_aJ": (0.01, 1.0), "E_GPa": (0.05, 20.0), "R_nm": (5.0, 30.0)}
    found = afm.fit(data, lever(), vary, SIGMA, jumps=folds)
    (note,) = [note for note in found.notes if "combination" in note]
    assert "H_aJ +1 %, E_GPa +0.5 %, R_nm -1 %" in note or "H_aJ -1 %, E_GPa -0.5 %, R_nm +1 %" in note
    assert all(np.isinf(error) for error in found.errors.values())


@pytest.mark.campaign
def test_frequencies_in_hertz_and_lags_of_another_turn_are_the_same_data(tune, folds):
    data = swept(tune, np.linspace(298.9, 300.5, 5))
    same = {"f_Hz": 1e3 * np.array(data["f_kHz"]), "amplitude_nm": data["amplitude_nm"], "direction": data["direction"]}
    same["lag_deg"] = np.array(data["lag_deg"]) - 360.0
    found = afm.fit(same, lever(H_aJ=0.13), {"H_aJ": (0.01, 1.0)}, SIGMA, jumps=folds)
    assert found["H_aJ"] == pytest.approx(0.12, rel=1e-6)


BAD = {
    "no curve": ({"data": {"amplitude_nm": [1.0]}}, "one column of Zc_nm, f_kHz or f_Hz"),
    "two frequencies": ({"data": {"f_kHz": [300.0], "f_Hz": [3e5], "amplitude_nm": [1.0]}}, "f_kHz or f_Hz"),
    "implausible": ({"vary": {"H_aJ": (0.01e-18, 1e-18)}}, "H_aJ"),
    "unknown": ({"vary": {"H": (0.01, 1.0)}}, "H"),
    "no units": ({"sigma": {"lag": 0.3}, "data": {"Zc_nm": [20.0], "lag": [90.0]}}, "its unit: lag_deg"),
    "frequencies in words": ({"data": {"f_Hz": ["a", "b"], "amplitude_nm": [1.0, 2.0]}}, "column 'f_Hz'.*real numbers"),
    "distances in words": ({"data": {"Zc_nm": ["a", "b"], "amplitude_nm": [1.0, 2.0]}}, "column 'Zc_nm'.*real numbers"),
    "nothing varied": ({"vary": None}, "vary = {}: must be at least one parameter"),
    "nothing fitted": ({"sigma": None}, "sigma = {}: must be the standard error of at least one column"),
    "a frequency of 0": ({"data": {"f_kHz": [0.0, 300.0], "amplitude_nm": [1.0, 2.0]}}, "f_kHz = 0.0"),
    "no reading": ({"sigma": {"height_nm": 1.0}}, "with a column 'height_nm'"),
    "a parameter of contact far away": (
        {"data": {"Zc_nm": [30.0, 31.0, 32.0], "amplitude_nm": [12.0] * 3}, "vary": {"E_GPa": (0.1, 10.0)}},
        "vary = 'E_GPa': must be parameters on which a datum depends",
    ),
}


@pytest.mark.parametrize("what", BAD)
def test_bad_input_is_told(what):
    given, message = BAD[what]
    data = {"Zc_nm": [20.0, 21.0], "amplitude_nm": [12.0, 12.0]}
    arguments = {"data": data, "vary": {"H_aJ": (0.01, 1.0)}, "sigma": {"amplitude_nm": 0.1}} | given
    with pytest.raises(InputError, match=message):
        afm.fit(model=lever(), **arguments)


@pytest.mark.campaign
def test_a_motion_that_only_begins_to_touch_parts_no_sheet(tune):
    """Contact begins on the stable sheets: the curve has one jump on each way, and two stable sheets."""
    assert [jump.direction for jump in tune.jumps] == ["down", "up"]
    assert len(sheets_of(tune.branches)) == 2


@pytest.mark.campaign
@pytest.mark.thorough
def test_a_viscosity_comes_back_from_a_tune_whose_way_down_begins_with_a_small_motion():
    """Noise of known size: the value is found within its error, and data above the jump are on a sheet of their own."""

    def sample(eta_Pa_s):
        probe = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
        law = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5) + afm.KelvinVoigt(eta_Pa_s=eta_Pa_s)
        return afm.model(probe, law, afm.Drive(A0_nm=12.0), Zc_nm=8.5)

    curve, noise, rows = afm.frequency_curve(sample(30.0), (298.5, 301.5)), np.random.default_rng(7), []
    for way in ("up", "down"):
        path = curve.path(way).sortby("f_kHz")
        for f in np.r_[298.6:299.2:4j, 299.24:299.56:9j, 299.7:301.4:5j]:
            swept_nm = np.interp(f, path.f_kHz, path.amplitude_nm)
            stable = [afm.observables(orbit) for orbit in curve.at(f_kHz=f) if orbit.stable]
            seen = min(stable, key=lambda one, there=swept_nm: abs(one["amplitude_nm"] - there))
            rows.append(
                (f, seen["amplitude_nm"] + noise.normal(0.0, 0.05), seen["lag_deg"] + noise.normal(0.0, 0.5), way)
            )
    data = dict(zip(("f_kHz", "amplitude_nm", "lag_deg", "direction"), map(list, zip(*rows, strict=True)), strict=True))
    at_rest = saltus.find_orbit(sample(30.0), {"f_kHz": 301.4}, [0.0, 0.0])
    assert data["amplitude_nm"][-1] == pytest.approx(afm.observables(at_rest)["amplitude_nm"], abs=0.2)
    found = afm.fit(data, sample(60.0), {"eta_Pa_s": (1.0, 300.0)}, {"amplitude_nm": 0.05, "lag_deg": 0.5})
    assert abs(found["eta_Pa_s"] - 30.0) < 2.5 * found.errors["eta_Pa_s"] < 5.0


# unknowns of the measurement, on curves that no other model has


def elastic(E_GPa=3.0, Zc_nm=8.5, H_aJ=0.1):
    probe = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
    law = afm.VanDerWaals(H_aJ=H_aJ, a0_nm=0.3) + afm.DMT(E_GPa=E_GPa)
    return afm.model(probe, law, afm.Drive(A0_nm=12.0), Zc_nm=Zc_nm)


ROUGH = {"amplitude_nm": 0.1, "lag_deg": 1.2}
MODULUS = {"E_GPa": (0.2, 30.0)}


@pytest.fixture(scope="module")
def approach():
    return afm.distance_curve(elastic(), (5.0, 13.8))


def along_way(curve, way, values, early=0.0):
    """Readings on a way, without noise; jumps come earlier by some distance."""
    path, sign = curve.path(way).sortby(curve.along), 1.0 if way in ("up", "retract") else -1.0
    jumps = [jump.value for jump in real_jumps(curve) if jump.direction == way]
    rows = []
    for value in values:
        jumped = any(0.0 <= sign * (jump - value) < early for jump in jumps)
        place = jumps[0] + sign * 1e-3 if jumped else value
        swept_nm = np.interp(place, path[curve.along], path.amplitude_nm)
        stable = [afm.observables(orbit) for orbit in curve.at(value) if orbit.stable]
        seen = min(stable, key=lambda one: abs(one["amplitude_nm"] - swept_nm))
        rows.append((value, seen["amplitude_nm"], seen["lag_deg"], way))
    return rows


def as_data(along, rows):
    names = (along, "amplitude_nm", "lag_deg", "direction")
    return {name: [row[k] for row in rows] for k, name in enumerate(names)}


def with_noise(data, sigma, seed):
    noise = np.random.default_rng(seed)
    return data | {
        name: np.array(data[name]) + noise.normal(0.0, size, len(data[name])) for name, size in sigma.items()
    }


@pytest.mark.campaign
def test_origin_and_gain_come_back_from_exact_data(approach):
    data = as_data("Zc_nm", along_way(approach, "approach", np.linspace(6.0, 13.0, 10)))
    data["Zc_nm"] = np.array(data["Zc_nm"]) + 0.3
    data["amplitude_nm"] = 1.1 * np.array(data["amplitude_nm"])
    vary = MODULUS | {"Zc_offset_nm": (-0.8, 0.8), "gain": (0.5, 2.0)}
    found = afm.fit(data, elastic(E_GPa=2.0), vary, ROUGH, jumps=False, options=FitOptions(profile=()))
    assert found.values == pytest.approx([3.0, -0.3, 1.1], rel=1e-5)
    assert "Zc_offset_nm" not in found.parameters


@pytest.mark.campaign
@pytest.mark.parametrize("seed", guarding([1, 2], campaign=1))
def test_a_wrong_origin_is_flagged_and_a_free_one_mends_it(approach, seed):
    places = np.linspace(5.5, 13.0, 20)
    rows = along_way(approach, "approach", places) + along_way(approach, "retract", places)
    data = with_noise(as_data("Zc_nm", rows), ROUGH, seed)
    data["Zc_nm"] = np.array(data["Zc_nm"]) + 0.3
    options = FitOptions(profile=())
    with pytest.warns(RuntimeWarning, match=r"the data do not fit.*it helps to vary Zc_offset_nm \(near -0\.[23]"):
        wrong = afm.fit(data, elastic(E_GPa=2.0), MODULUS, ROUGH, options=options)
    assert wrong["E_GPa"] > 3.0 + 5.0 * wrong.errors["E_GPa"]
    found = afm.fit(data, elastic(E_GPa=2.0), MODULUS | {"Zc_offset_nm": (-1.0, 1.0)}, ROUGH, options=options)
    assert not found.misfit
    for name, true in (("E_GPa", 3.0), ("Zc_offset_nm", -0.3)):
        assert abs(found[name] - true) < 3.0 * found.errors[name]


@pytest.mark.campaign
@pytest.mark.parametrize("seed", guarding([1, 2], campaign=1))
def test_a_jump_before_its_fold_does_not_spoil_a_constant(approach, seed):
    """Taken as the fold, a jump 0.4 nm early pulls Hamaker's constant away by many of its errors."""
    rows = along_way(approach, "approach", np.linspace(5.5, 13.0, 40), early=0.4)
    sigma = {"amplitude_nm": 0.05, "lag_deg": 0.5}
    data, vary = with_noise(as_data("Zc_nm", rows), sigma, seed), {"H_aJ": (0.01, 1.0)}
    found = afm.fit(data, elastic(H_aJ=0.12), vary, sigma)
    assert abs(found["H_aJ"] - 0.1) < 3.0 * found.errors["H_aJ"]
    assert not found.misfit
    assert any("bounds its fold from one side" in note for note in found.notes)


@pytest.mark.campaign
def test_a_drift_comes_back_along_the_frequency_by_the_scaling_of_elastic_samples():
    """With all frequencies higher by a factor an elastic sample sees the same motion faster."""
    curve, drift_Hz = afm.frequency_curve(elastic(), (298.5, 301.5)), 60.0
    order = [("up", f) for f in np.linspace(298.7, 301.3, 10)] + [("down", f) for f in np.linspace(301.3, 298.7, 10)]
    rows = []
    for k, (way, f) in enumerate(order):
        scale = 1.0 + 1e-3 * drift_Hz / 300.0 * k / (len(order) - 1)
        ((_, *seen),) = along_way(curve, way, [f / scale])
        rows.append((f, *seen))
    vary = MODULUS | {"f0_drift_Hz": (-300.0, 300.0)}
    found = afm.fit(as_data("f_kHz", rows), elastic(E_GPa=2.5), vary, ROUGH)
    assert found.values == pytest.approx([3.0, drift_Hz], rel=1e-4)


def test_a_drift_needs_times_that_differ():
    data = {"Zc_nm": [9.0, 8.0, 7.0], "time_s": [2.0] * 3, "amplitude_nm": [8.0, 7.0, 6.0], "lag_deg": [80.0] * 3}
    told = "column 'time_s' = 2.0: must be times that differ, where a drift is sought; leave the column out"
    with pytest.raises(InputError, match=told):
        afm.fit(data, elastic(), {"f0_drift_Hz": (-300.0, 300.0)}, ROUGH)


@pytest.mark.campaign
def test_a_drift_comes_back_along_the_distance_from_motions_that_settled():
    places, times, drift_Hz = np.linspace(9.0, 7.0, 6), np.array([0.0, 1.0, 2.0, 5.0, 6.0, 10.0]), 60.0
    seen = [
        afm.observables(saltus.find_orbit(elastic(Zc_nm=z), {"f0_kHz": 300.0 + 1e-3 * drift_Hz * t / 10.0}, [0.0, 0.0]))
        for z, t in zip(places, times, strict=True)
    ]
    data = {"Zc_nm": places, "time_s": times} | {name: [one[name] for one in seen] for name in ROUGH}
    vary = MODULUS | {"f0_drift_Hz": (-300.0, 300.0)}
    found = afm.fit(data, elastic(E_GPa=2.5), vary, ROUGH)
    assert found.values == pytest.approx([3.0, drift_Hz], rel=1e-4)


@pytest.mark.campaign
def test_a_sweep_down_that_begins_on_the_small_motion_finds_its_sheet():
    curve, sigma = afm.frequency_curve(elastic(), (298.5, 301.5)), {"amplitude_nm": 0.05, "lag_deg": 0.5}
    data = with_noise(as_data("f_kHz", along_way(curve, "down", np.linspace(300.9, 299.6, 25))), sigma, 3)
    assert data["amplitude_nm"][0] < 5.0
    found = afm.fit(data, elastic(E_GPa=2.0), MODULUS, sigma)
    assert not found.misfit
    assert abs(found["E_GPa"] - 3.0) < 3.0 * found.errors["E_GPa"]
    assert len(np.unique(found.data["sheet"])) == 2


@pytest.mark.parametrize(
    ("vary", "message"),
    [
        ({"Zc_nm": (6.0, 12.0)}, "Zc_offset_nm varies its origin"),
        ({"Zc_offset_nm": (-1e9, 1.0)}, r"Zc_offset_nm = -1000000000.0: must be between"),
        ({"gain": (0.0, 2.0)}, "gain = 0.0"),
        ({"drift": (0.0, 2.0)}, "vary = 'drift'"),
    ],
)
def test_unknowns_of_the_measurement_that_cannot_be_used_are_told(vary, message):
    data = {"Zc_nm": [20.0, 21.0], "amplitude_nm": [12.0, 12.0]}
    with pytest.raises(InputError, match=message):
        afm.fit(data, lever(), vary, {"amplitude_nm": 0.1})


def test_a_frequency_curve_has_no_origin_of_the_distance():
    data = {"f_kHz": [299.0, 300.0], "amplitude_nm": [5.0, 12.0]}
    with pytest.raises(InputError, match="vary = 'Zc_offset_nm'"):
        afm.fit(data, lever(), {"Zc_offset_nm": (-1.0, 1.0)}, {"amplitude_nm": 0.1})


@pytest.mark.campaign
@pytest.mark.thorough
def test_the_range_of_a_wide_tune_stays_above_0():
    """A margin of 2 % of 500 kHz would begin below 0."""
    data = {"f_kHz": [1.0, 150.0, 299.0, 500.0]}
    response = [1.0 / np.hypot(1.0 - (f / 300.0) ** 2, f / 300.0 / 400.0) for f in data["f_kHz"]]
    data["amplitude_nm"] = [12.0 / 400.0 * one for one in response]
    found = afm.fit(data, lever(Zc_nm=80.0), {"A0_nm": (1.0, 20.0)}, {"amplitude_nm": 0.01}, jumps=False)
    assert found["A0_nm"] == pytest.approx(12.0, rel=1e-3)


@pytest.mark.parametrize(
    ("shown", "told"),
    [
        pytest.param(
            lambda lag: 90.0 - lag,
            "the data fit with lags read as 90 - lag_deg, of phase_convention 'bruker0': chi2/n = ",
            id="bruker0",
            marks=CAMPAIGN,
        ),
        pytest.param(lambda lag: -lag, "the data fit with lags read as -lag_deg: chi2/n = ", id="sign", marks=CAMPAIGN),
        pytest.param(np.radians, "the data fit with lags read as lag_deg in radians: chi2/n = ", id="radians"),
    ],
)
def test_a_wrong_convention_of_the_phase_is_named(shown, told):
    """A fit of such data ended with a hint at the gain of the detector."""
    model = lever()
    path = afm.distance_curve(model, (13.0, 15.0)).path("approach")
    whole = path[["amplitude_nm", "lag_deg"]].to_dataframe().reset_index()
    data = whole[["Zc_nm", "amplitude_nm", "lag_deg"]].assign(lag_deg=shown(whole["lag_deg"]))
    options = FitOptions(max_evaluations=10)
    errors = {"amplitude_nm": 0.03, "lag_deg": abs(shown(0.3) - shown(0.0))}
    with pytest.warns(RuntimeWarning, match="the data do not fit"):
        found = afm.fit(data, lever(H_aJ=0.2), {"H_aJ": (0.01, 1.0)}, errors, jumps=False, options=options)
    assert found.remedy.startswith(told)
    assert "gain" not in found.message
