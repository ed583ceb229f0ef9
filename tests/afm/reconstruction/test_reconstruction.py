"""Round trips: the curve of a known law, the force that it tells, and the law that has this force."""

import warnings

import numpy as np
import pandas as pd
import pytest

import saltus
from explained import unexplained
from saltus import afm
from saltus.continuation import StepControl
from saltus.errors import InputError

PROBE = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
CONTACT = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5)
DOUBLE_LAYER = afm.DLVO(tip_mC_m2=-20.0, sample_mC_m2=-20.0, debye_nm=2.0, H_aJ=0.01)


def guessed(law, factor=0.7):
    """A law with other values."""
    changed = {"H_aJ": factor, "E_GPa": factor, "debye_nm": 1.2}
    parts = [type(one)(**{k: v * changed.get(k, 1.0) for k, v in one.parameters.items()}) for one in law.parts]
    return sum(parts[1:], parts[0])


def check(force, law, vary, most):
    found = force.fit(guessed(law), vary)
    for name in vary:
        assert found.values[name] == pytest.approx(law.parameters[name], rel=0.01)
    wanted = law.force_nN(force.D_nm, R_nm=12.0)
    assert np.abs(force.F_nN - wanted).max() < most * np.abs(wanted).max()
    return found


@pytest.mark.campaign
@pytest.mark.filterwarnings("ignore:saltus")
@pytest.mark.parametrize(("A0", "sought"), [(1.5, ("H_aJ",)), (12.0, ("H_aJ", "E_GPa"))])
def test_tapping_over_elastic_contact_tells_its_law(A0, sought):
    """Both ways of a distance curve, whose jumps leave no gap that neither way passes."""
    drive = afm.Drive(A0_nm=A0)
    system = afm.model(PROBE, CONTACT, drive, Zc_nm=10.0)
    curve = afm.distance_curve(system, (0.75 * A0, A0 + 6.0), steps=StepControl(largest=0.1))
    ways = pd.concat([curve.path(way).to_dataframe() for way in curve.directions], ignore_index=True)
    force = afm.reconstruct_force(ways, PROBE, drive=drive)
    bounds = {"H_aJ": (0.01, 1.0), "E_GPa": (0.1, 10.0)}  # the small motion is attracted all the way
    found = check(force, CONTACT, {name: bounds[name] for name in sought}, 0.06)
    assert "H_aJ = 0.12" in str(found)


@pytest.mark.campaign
@pytest.mark.filterwarnings("ignore:saltus")
@pytest.mark.parametrize("A", [0.2, 10.0])
def test_frequency_shifts_tell_the_law_that_makes_them(A):
    drive = afm.Drive(A0_nm=A)
    system = afm.model(PROBE, DOUBLE_LAYER, drive, Zc_nm=A + 5.0)
    shifts = afm.frequency_shift(system, (A + 1.2, A + 17.2), A, points=101)
    force = afm.reconstruct_force(shifts.to_xarray(), PROBE, A_nm=A)
    check(force, DOUBLE_LAYER, {"H_aJ": (0.001, 0.1), "debye_nm": (0.5, 5.0)}, 0.01)


def averaged(law, nearest, A):
    """Data of a stiff lever: Giessibl's average of a law's force on the way in, by many angles."""
    angles = (np.arange(4000) + 0.5) * np.pi / 4000
    gaps = nearest[:, None] + A * (1.0 + np.cos(angles))
    force = law.force_nN(gaps if len(law.regions) == 1 else np.maximum(gaps, 0.3), next(iter(law.regions)), R_nm=12.0)
    if len(law.regions) > 1:
        force = np.where(gaps < 0.3, law.force_nN(np.minimum(gaps, 0.3), "contact", R_nm=12.0), force)
    shift = -300e3 * (force * np.cos(angles)).mean(axis=1) / (26e3 * A)
    return {"Zc_nm": nearest + A, "shift_Hz": shift, "deflection_pm": 0.0 * nearest}


STIFF = afm.Probe(k_N_m=26e3, f0_kHz=300.0, Q=400.0, R_nm=12.0, check=False)


@pytest.fixture(scope="module", params=[0.2, 10.0])
def contact(request):
    nearest = np.concatenate([np.linspace(-1.0, 1.0, 60), np.geomspace(1.05, 8.0, 30)])
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "saltus: ill-posed", RuntimeWarning)  # the bend where contact begins
        return afm.reconstruct_force(averaged(CONTACT, nearest, request.param), STIFF, A_nm=request.param)


@pytest.mark.filterwarnings("ignore:saltus")
def test_averages_tell_the_law_of_contact_at_small_and_large_amplitudes(contact):
    check(contact, CONTACT, {"H_aJ": (0.01, 1.0), "E_GPa": (0.1, 10.0)}, 0.03)


@pytest.mark.filterwarnings("ignore:saltus")
def test_an_origin_and_a_radius_can_be_unknown():
    nearest = np.geomspace(0.4, 8.0, 50)
    law = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3)
    data = averaged(law, nearest, 5.0)
    moved = data | {"Zc_nm": data["Zc_nm"] + 0.25}
    found = afm.reconstruct_force(moved, STIFF, A_nm=5.0).fit(
        law, {"H_aJ": (0.01, 1.0), "origin_nm": (-0.35, 1.0)}, D_nm=(0.6, 9.0)
    )
    assert found.values["origin_nm"] == pytest.approx(-0.25, abs=0.003)
    assert found.values["H_aJ"] == pytest.approx(0.12, rel=0.01)
    assert abs(found.correlation[0, 1]) > 0.5
    radius = afm.reconstruct_force(data, STIFF, A_nm=5.0).fit(law, {"R_nm": (5.0, 50.0)}, R_nm=20.0)
    assert radius.values["R_nm"] == pytest.approx(12.0, rel=0.01)


@pytest.mark.filterwarnings("ignore:saltus")
def test_what_data_do_not_tell_leaves_the_other_errors_finite():
    """No datum is in contact: the modulus is not told, Hamaker's constant is."""
    law = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3)
    data = averaged(law, np.geomspace(0.5, 8.0, 60), 5.0)
    force = afm.reconstruct_force(data, STIFF, A_nm=5.0, sigma={"shift_Hz": 1e-3 * np.abs(data["shift_Hz"]).max()})
    alone = force.fit(law, {"H_aJ": (0.01, 1.0)})
    both = force.fit(law + afm.DMT(E_GPa=1.5), {"H_aJ": (0.01, 1.0), "E_GPa": (0.1, 10.0)})
    assert both.sigma["H_aJ"] == pytest.approx(alone.sigma["H_aJ"], rel=1e-6)
    assert both.sigma["E_GPa"] == np.inf


@pytest.mark.campaign
@pytest.mark.filterwarnings("ignore:saltus")
def test_errors_of_a_fit_are_those_of_repeated_noise():
    rng, law = np.random.default_rng(11), afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3)
    data = averaged(law, np.geomspace(0.5, 8.0, 60), 5.0)
    noise = 0.01 * np.abs(data["shift_Hz"]).max()
    pulls = []
    for _ in range(20):
        noisy = data | {"shift_Hz": data["shift_Hz"] + noise * rng.normal(size=60)}
        force = afm.reconstruct_force(noisy, STIFF, A_nm=5.0, sigma={"shift_Hz": noise})
        found = force.fit(law, {"H_aJ": (0.01, 1.0)})
        pulls.append((found.values["H_aJ"] - 0.12) / found.sigma["H_aJ"])
    assert 0.6 < np.std(pulls) < 1.4
    assert abs(np.mean(pulls)) < 0.7


def test_a_law_of_the_force_gives_the_force_back(contact):
    law = contact.law()
    assert law.misfit < 0.05
    np.testing.assert_allclose(
        law.force_nN(contact.D_nm), contact.F_nN, atol=1.01 * law.misfit * np.abs(contact.F_nN).max()
    )


def test_a_force_survives_its_file_and_is_drawn(contact, tmp_path):
    import matplotlib

    matplotlib.use("Agg")
    assert saltus.load(contact.save(tmp_path / "force.nc")) == contact
    assert unexplained(contact.to_xarray()) == []
    axes = contact.plot({"a law": CONTACT})
    assert [axes.get_xlabel(), axes.get_ylabel()] == ["gap $D$ (nm)", "force (nN)"]
    assert "a law" in [text.get_text() for text in axes.get_legend().get_texts()]
    with pytest.raises(InputError, match=r"laws\['b'\] = 3: must be a Law"):
        contact.plot({"b": 3})
    assert f"ReconstructedForce by matrix of {len(contact.shift)} data" in repr(contact)


def test_wrong_data_are_told():
    data = averaged(CONTACT, np.geomspace(0.4, 8.0, 16), 5.0)
    few = {name: np.repeat(values[[0, 5]], 8) for name, values in data.items()}
    some = {name: np.repeat(values[:4], 8) for name, values in data.items()}
    tapping = {"Zc_nm": data["Zc_nm"], "amplitude_nm": np.full(16, 5.0), "lag_deg": np.full(16, 80.0)}
    for table, options, told in (
        (few, {"A_nm": 5.0}, "different least gaps = 2: must be 8 or more"),
        (some, {"A_nm": 5.0}, "different least gaps = 4: must be 8 or more"),
        (data | {"shift_Hz": data["shift_Hz"] - 4e5}, {"A_nm": 5.0}, "shift_Hz = -4.*: must be above -300000 Hz"),
        (data, {"A_nm": 5.0, "f_kHz": 200.0}, "f_kHz = 200.0: must be not given with A_nm"),
        (tapping, {"drive": afm.Drive(A0_nm=5.0, mode=2)}, "mode = 2: must be a mode of the probe, up to 1"),
    ):
        with pytest.raises(InputError, match=told):
            afm.reconstruct_force(table, STIFF, **options)


@pytest.mark.filterwarnings("ignore:saltus")
def test_wrong_fits_are_told(contact):
    for law, vary, options, told in (
        (3, {"H_aJ": (0.1, 1.0)}, {}, "law = 3: must be a Law"),
        (CONTACT, {}, {}, "vary = {}: must be one or more of"),
        (CONTACT, {"H": (0.1, 1.0)}, {}, "vary = 'H'"),
        (CONTACT, {"H_aJ": (0.5, 1.0)}, {}, "H_aJ = 0.12: must be between 0.5 and 1"),
        (CONTACT, {"H_aJ": (1.0, 0.1)}, {}, r"vary\['H_aJ'\]"),
        (CONTACT, {"H_aJ": (0.01, 1.0)}, {"D_nm": (50.0, 60.0)}, "D_nm = .*: must be a range with more than 1 data"),
        (afm.SLS(k1_N_m=2.0, k2_N_m=4.0, c_uNs_m=1.0), {"k1_N_m": (1.0, 3.0)}, {}, "without states of its own"),
    ):
        with pytest.raises(InputError, match=told):
            contact.fit(law, vary, **options)


@pytest.mark.filterwarnings("ignore:saltus")
def test_what_the_data_do_not_tell_has_an_infinite_error():
    data = averaged(CONTACT, np.geomspace(0.4, 8.0, 40), 5.0)  # never in contact
    found = afm.reconstruct_force(data, STIFF, A_nm=5.0).fit(CONTACT, {"E_GPa": (0.1, 10.0)})
    assert found.sigma["E_GPa"] == np.inf


@pytest.mark.filterwarnings("ignore:saltus")
def test_a_hysteretic_law_counts_on_both_ways():
    """The mean of both ways of a neck has the averages of half of it, where only the way out is wet."""
    neck = afm.Neck(gamma_N_m=0.02, h_nm=0.5, on_nm=0.6, off_nm=1.5)
    nearest, A = np.linspace(0.3, 0.55, 30), 5.0
    angles = (np.arange(4000) + 0.5) * np.pi / 4000
    gaps = nearest[:, None] + A * (1.0 + np.cos(angles))
    wet = -4.0 * np.pi * 0.02 * 12.0 / (1.0 + gaps / 0.5) ** 2
    force = 0.5 * (np.where(gaps < 0.6, wet, 0.0) + np.where(gaps < 1.5, wet, 0.0))
    shift = -300e3 * (force * np.cos(angles)).mean(axis=1) / (26e3 * A)
    data = {"Zc_nm": nearest + A, "shift_Hz": shift, "deflection_pm": 0.0 * shift}
    found = afm.reconstruct_force(data, STIFF, A_nm=A).fit(neck, {"gamma_N_m": (0.001, 0.1)})
    assert found.values["gamma_N_m"] == pytest.approx(0.02, rel=0.02)


@pytest.fixture(scope="module")
def tapping():
    """Both ways of a tapping curve, and the drive."""
    drive = afm.Drive(A0_nm=12.0)
    curve = afm.distance_curve(
        afm.model(PROBE, CONTACT, drive, Zc_nm=10.0), (9.0, 18.0), steps=StepControl(largest=0.1)
    )
    ways = [curve.path(way).to_dataframe().reset_index() for way in curve.directions]
    return pd.concat(ways, ignore_index=True)[["Zc_nm", "amplitude_nm", "lag_deg"]], drive


def with_noise(table, seed, **errors):
    random = np.random.default_rng(seed)
    return table.assign(
        **{name: table[name] + error * random.normal(size=len(table)) for name, error in errors.items()}
    )


@pytest.mark.campaign
@pytest.mark.filterwarnings("ignore:saltus")
@pytest.mark.parametrize(("amplitude_nm", "lag_deg"), [(0.03, 0.3), (0.1, 1.0)])
def test_errors_of_a_law_hold_it_as_often_as_they_should(tapping, amplitude_nm, lag_deg):
    """At 0.1 nm and 1 degree a fit at the gaps that were read gave H too small by 4.6 of its errors in the mean."""
    table, drive = tapping
    errors, pulls = {"amplitude_nm": amplitude_nm, "lag_deg": lag_deg}, []
    for seed in range(40):
        force = afm.reconstruct_force(with_noise(table, seed, **errors), PROBE, drive=drive, sigma=errors)
        found = force.fit(guessed(CONTACT), {"H_aJ": (0.01, 1.0), "E_GPa": (0.1, 10.0)})
        assert not found.misfit
        pulls.append([(found.values[one] - CONTACT.parameters[one]) / found.sigma[one] for one in found.values])
    assert np.all(np.abs(np.mean(pulls, axis=0)) < 0.5)
    assert 0.58 < np.mean(np.abs(pulls) < 1.0) < 0.8


@pytest.mark.campaign
@pytest.mark.filterwarnings("ignore:saltus")
def test_a_force_of_data_that_were_measured_twice_is_that_of_the_data(tapping):
    """Errors where the shift has an extremum are those of its bend: without, these rows counted for too much."""
    table, drive = tapping
    errors = {"amplitude_nm": 0.05, "lag_deg": 0.5}
    once = with_noise(table, 3, **errors)
    twice = afm.reconstruct_force(pd.concat([once, once], ignore_index=True), PROBE, drive=drive, sigma=errors)
    assert twice.chi2 < 1.3 * len(twice.shift)
    wanted = CONTACT.force_nN(twice.D_nm, R_nm=12.0)
    assert np.mean(np.abs(twice.F_nN - wanted) < 3.0 * twice.sigma_nN) > 0.9


@pytest.mark.campaign
@pytest.mark.filterwarnings("ignore:saltus")
def test_rows_of_one_distance_that_contradict_each_other_are_told(tapping):
    table, drive = tapping
    errors = {"amplitude_nm": 0.03, "lag_deg": 0.3}
    again = table.iloc[[5]].assign(amplitude_nm=lambda one: one["amplitude_nm"] - 2.0)
    whole = pd.concat([with_noise(table, 1, **errors), again], ignore_index=True)
    force = afm.reconstruct_force(whole, PROBE, drive=drive, sigma=errors)
    (told,) = [one for one in force.messages if one.startswith("rows of one distance")]
    assert f"5 and {len(table)} (Zc_nm = {table['Zc_nm'][5]:.9g}, by " in told
    lag = whole["lag_deg"].where(whole.index % 4 > 0, whole["lag_deg"] + 15.0)
    wrong = afm.reconstruct_force(whole.assign(lag_deg=lag), PROBE, drive=drive, sigma=errors)
    with pytest.warns(
        RuntimeWarning, match="the data do not fit: chi2/n = .* is above 1.*; the law, origin_nm or sigma"
    ):
        found = wrong.fit(guessed(CONTACT), {"H_aJ": (0.01, 1.0), "E_GPa": (0.1, 10.0)})
    assert found.misfit in str(found)
