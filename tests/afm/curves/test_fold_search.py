"""Folds of distance curves over free amplitude and distance, and the tip's radius that a critical amplitude tells."""

from __future__ import annotations

import matplotlib
import pytest

import saltus
from explained import unexplained
from saltus import afm
from saltus.afm.curves import fold_search
from saltus.errors import InputError
from selection import guarding

matplotlib.use("Agg")

CRITICAL = 10.5434078  # nm, free amplitude at which the folds of lever S turn
RADIUS = 12.0  # nm, of lever S


@pytest.fixture(scope="module")
def lever():
    probe = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=RADIUS)
    law = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5)
    return afm.model(probe, law, afm.Drive(A0_nm=12.0), Zc_nm=10.0)


@pytest.fixture(scope="module")
def region(lever):
    return afm.bistability(lever)


@pytest.mark.parametrize(
    ("below", "above", "begins"),
    [
        ([], [10.79], True),
        ([], [], False),
        ([0.5332], [10.79], True),  # a squeezed tip jumps next to the sample as well
        ([0.5332], [0.5351], False),
        ([0.5332, 10.75], [0.5340, 10.79], False),
        ([0.5332], [0.5351, 10.79], True),
    ],
)
def test_a_jump_elsewhere_does_not_hide_the_jump_that_begins(lever, monkeypatch, below, above, begins):
    def jumps(system, p, Zc_nm, steps):
        return above if p["A0_nm"] > 18.157 else below

    monkeypatch.setattr(fold_search, "approach_jumps", jumps)
    told = fold_search._begins_to_jump(lever, lever.resolve(None), 18.157, (0.5, 30.0), None)
    assert told is begins


@pytest.mark.campaign
def test_the_raw_form_of_kelvin_and_voigt_is_refused_at_once_with_the_cure():
    probe = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
    law = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5)
    raw, impulse = (
        afm.model(probe, law + afm.KelvinVoigt(eta_Pa_s=10.0, form=form), afm.Drive(A0_nm=12.0), Zc_nm=10.0)
        for form in ("raw", "impulse")
    )
    for call in (lambda: afm.bistability(raw), lambda: afm.tip_radius(raw, 10.0)):
        with pytest.raises(InputError, match='in contact its slope is infinite there.*as form="impulse" of a law does'):
            call()
    assert afm.bistability(impulse, A0_nm=(9.0, 13.0), Zc_nm=(4.0, 12.0)).critical_amplitude_nm > 10.0


@pytest.mark.campaign
def test_cusp_and_critical_amplitude(region):
    assert region.cusp == pytest.approx((25.6149973, 25.1789782), abs=1e-7)
    assert region.critical_amplitude_nm == pytest.approx(CRITICAL, abs=1e-7)
    assert region.critical_distance_nm == pytest.approx(5.9804976, abs=1e-6)
    assert len(region.loci) == 1  # the folds of all distances lie on one locus
    assert region.failures == ()


@pytest.mark.campaign
def test_an_approach_jumps_above_the_critical_amplitude_only(lever):
    below, above = (
        afm.distance_curve(lever, (3.0, 14.0), parameters={"A0_nm": CRITICAL + shift}) for shift in (-0.01, 0.01)
    )
    assert below.jumps == ()
    assert [jump.direction for jump in above.jumps] == ["approach", "retract"]
    assert above.jumps[0].value == pytest.approx(5.98, abs=0.5)


PROBES = {  # natural Q, R, H, a0, E, c; the critical amplitude lies between
    "a tip of 9 nm": (450.0, 9.0, 0.1, 0.165, 3.0, 1.0, (18.3, 18.4)),
    "a stiff sample": (450.0, 9.0, 0.1, 0.165, 50.0, 1.5, (13.4, 13.6)),
    "a lever of 12 nm": (400.0, 12.0, 0.12, 0.3, 1.5, 1.0, (11.1, 11.2)),
    "more damping": (400.0, 12.0, 0.12, 0.3, 1.5, 2.0, (12.9, 13.2)),
}


def losing(Q, R, H, a0, E, c):
    probe = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=Q, R_nm=R)
    law = afm.VanDerWaals(H_aJ=H, a0_nm=a0) + afm.DMT(E_GPa=E) + afm.Dashpot(c_uNs_m=c)
    return afm.model(probe, law, afm.Drive(A0_nm=10.0), Zc_nm=9.0)


@pytest.mark.campaign
@pytest.mark.parametrize("name", guarding(PROBES, "a tip of 9 nm", campaign=0))
def test_where_contact_loses_energy_an_approach_jumps_from_the_critical_amplitude_on(name):
    *values, around = PROBES[name]
    model = losing(*values)
    found = afm.bistability(model)
    assert around[0] < found.critical_amplitude_nm < around[1]
    assert found.least_bistable_amplitude_nm <= found.critical_amplitude_nm
    for A0, jumps in zip(around, (False, True), strict=True):
        curve = afm.distance_curve(model, (0.5, 1.2 * A0), parameters={"A0_nm": A0})
        assert any(jump.direction == "approach" for jump in curve.jumps) is jumps


@pytest.mark.campaign
def test_a_radius_comes_back_where_two_folds_turn_at_different_amplitudes():
    model = losing(*PROBES["a tip of 9 nm"][:-1])
    region = afm.bistability(model)
    assert region.least_bistable_amplitude_nm == pytest.approx(11.4736856, abs=1e-6)
    assert region == afm.Bistability.from_xarray(region.to_xarray())
    assert "least bistable      A0_nm = 11.47" in repr(region)
    radius = afm.tip_radius(model, region.critical_amplitude_nm, parameters={"R_nm": 12.0})
    assert radius == pytest.approx(9.0, rel=1e-6)


def test_folds_of_a_distance_curve_lie_on_the_locus(lever, region):
    """At 12 nm the curve folds at distances that an independent code has found."""
    A0, Zc = (region.locus.column(name) for name in ("A0_nm", "Zc_nm"))
    crossing = [i for i in range(len(A0) - 1) if (A0[i] - 12.0) * (A0[i + 1] - 12.0) < 0.0]
    between = sorted(Zc[i] + (12.0 - A0[i]) / (A0[i + 1] - A0[i]) * (Zc[i + 1] - Zc[i]) for i in crossing)
    for fold in (9.878337793, 11.50288421):
        assert min(abs(value - fold) for value in between) < 0.02  # interpolated between the locus' points


@pytest.mark.campaign
def test_region_comes_back_from_its_file(region, tmp_path):
    assert saltus.load(region.save(tmp_path / "region.nc")) == region
    held = region.to_xarray()
    assert unexplained(held) == []
    for change, told in (
        ({"loci": "[]"}, "one locus or more"),
        ({"A0_nm": "[3, 1]"}, "the lower one first"),
        ({"Zc_nm": '["x", 1]'}, "the lower one first"),
        ({"jumping": "[0, 99]"}, "the numbers of a locus and of a special point on it"),
    ):
        with pytest.raises(InputError, match=told):
            afm.Bistability.from_xarray(held.assign_attrs(change))


def test_picture_marks_cusp_and_critical_amplitude(region):
    ax = region.plot()
    labels = ax.get_legend_handles_labels()[1]
    assert {"cusp", "critical amplitude, 10.54 nm"} < set(labels)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("free amplitude $A_0$ (nm)", "distance $Z_c$ (nm)")
    assert "cusp" not in region.plot(special=False).get_legend_handles_labels()[1]


def test_ranges_without_folds_are_told(lever):
    with pytest.raises(InputError, match=r"no distance curve folds on the ways along A0_nm at Zc_nm = 30.25, 37.25"):
        afm.bistability(lever, A0_nm=(30.0, 40.0), Zc_nm=(25.0, 60.0))


@pytest.mark.campaign
def test_no_critical_amplitude_where_the_turn_is_out_of_range(lever):
    part = afm.bistability(lever, A0_nm=(11.0, 30.0), Zc_nm=(0.5, 30.0))
    assert part.critical_amplitude_nm is None
    assert part.critical_distance_nm is None
    assert "critical amplitude  none" in repr(part)
    assert part.cusp == pytest.approx((25.6149973, 25.1789782), abs=1e-7)


@pytest.mark.campaign
@pytest.mark.parametrize("start", guarding([4.0, RADIUS, 30.0], 4.0, campaign=0))
def test_radius_from_the_critical_amplitude(lever, start):
    assert afm.tip_radius(lever, CRITICAL, parameters={"R_nm": start}) == pytest.approx(RADIUS, abs=1e-5)


@pytest.mark.campaign
def test_radius_of_another_tip_comes_back(lever):
    amplitude = afm.bistability(lever, parameters={"R_nm": 7.0}).critical_amplitude_nm
    assert afm.tip_radius(lever, amplitude) == pytest.approx(7.0, abs=1e-8)


@pytest.mark.campaign
def test_wrong_arguments_are_told(lever, afm1):
    with pytest.raises(InputError, match=r"saltus\.afm\.model"):
        afm.bistability(afm1)
    probe = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=RADIUS)
    pushed = afm.model(probe, afm.Hertz(E_GPa=1.0), afm.Drive.force(1.0), Zc_nm=10.0)
    with pytest.raises(InputError, match="one drive"):
        afm.bistability(pushed)
    with pytest.raises(InputError, match="R_nm"):
        afm.tip_radius(lever, CRITICAL, R_nm=(20.0, 30.0))
    with pytest.raises(InputError, match="ranges with a fold"):
        afm.tip_radius(lever, 2.0)
    with pytest.raises(saltus.ConvergenceError, match="critical amplitude"):
        afm.tip_radius(lever, 18.0, R_nm=(5.0, 14.0))
