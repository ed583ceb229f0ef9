"""Where motions of a model settle, in words, and the sheets of a curve that are found by them."""

import math
import warnings

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import saltus
from saltus import InputError, afm
from saltus.afm.files.configuration import read_experiment
from saltus.afm.files.sets import text_of
from saltus.afm.models import settling
from saltus.afm.models.settling import described, settled, settled_orbit
from saltus.errors import ConvergenceError
from saltus.results import PeriodicOrbit

NECKS = afm.VanDerWaals(H_aJ=0.1, a0_nm=0.3) + afm.DMT(E_GPa=1.0)
NECKS = NECKS + afm.Neck(gamma_N_m=0.072, h_nm=1.0, on_nm=1.0, off_nm=3.0)


@pytest.fixture(scope="module")
def necks():
    probe = afm.Probe(k_N_m=2.0, f0_kHz=70.0, Q=150.0, R_nm=20.0)
    return afm.model(probe, NECKS, afm.Drive(A0_nm=40.0), Zc_nm=33.0)


@pytest.fixture(scope="module")
def viscous():
    """A soft and viscous sample, on which motions become chaotic."""
    probe = afm.Probe(k_N_m=0.33243, f0_kHz=225.584, Q=33.9158, R_nm=40.885)
    law = afm.VanDerWaals(H_aJ=0.0914746, a0_nm=0.270715) + afm.DMT(E_GPa=0.0137787) + afm.KelvinVoigt(eta_Pa_s=9.055)
    return afm.model(probe, law, afm.Drive.base(1.258), Zc_nm=36.75)


@pytest.mark.campaign
def test_a_motion_of_several_periods_is_told_with_its_necks(necks):
    found = settled(necks, necks.parameters | {"Zc_nm": 30.0}, [0.0, 0.0])
    assert found.form.turns == 3
    assert described(found).startswith("a motion of period 3 with 2 necks: far_dry:form -> far_wet:break -> ")
    # the same motion, simulated on: three periods bring it back
    again = saltus.simulate(necks, found.parameters, found.x0, periods=3).x_end
    np.testing.assert_allclose(again[:2], found.x0[:2], rtol=0.0, atol=1e-6 * np.abs(found.x0[:2]).max())


@pytest.mark.campaign
def test_a_motion_without_a_period_is_told_by_its_kind(viscous):
    assert settled(viscous, viscous.parameters, [0.0, 0.0]) == "the motion is chaotic"


def test_a_motion_that_has_settled_when_it_is_looked_at_last_is_found(monkeypatch):
    """The free motion has the amplitude of the drive at its resonance; the first look is the last one."""
    monkeypatch.setattr(settling, "_AGAIN", 0.0)
    probe = afm.Probe(k_N_m=1.0, f0_kHz=100.0, Q=5.0, R_nm=20.0)
    system = afm.model(probe, afm.Hertz(E_GPa=1.0), afm.Drive(A0_nm=7.0), Zc_nm=20.0)
    found = settled_orbit(system, system.parameters, [1.0, 0.0])
    assert found.max["z1_nm"] == pytest.approx(7.0, rel=1e-9)
    with pytest.raises(ConvergenceError, match="no convergence, residual .* after 73 forcing periods"):
        settled_orbit(system, system.parameters | {"Q": 500.0}, [1.0, 0.0])


def test_a_motion_that_is_lost_is_told_with_the_reason():
    probe = afm.Probe(k_N_m=1.0, f0_kHz=100.0, Q=5.0, R_nm=20.0)
    system = afm.model(probe, afm.LennardJones(H_aJ=0.1, sigma_nm=0.3), afm.Drive(A0_nm=1.0), Zc_nm=1.0)
    assert settled(system, system.parameters, [-1.0, 0.0]).startswith("the motion is lost: ")


@pytest.mark.campaign
def test_a_way_says_what_the_motion_does_where_no_orbit_goes_on(necks):
    """The free motion ends where the first neck forms; behind it a neck forms in five periods or in more."""
    curve = afm.distance_curve(necks, (39.6, 45.0))
    assert curve.ways[1].stopped == "Zc_nm = 45: the end of the range"
    assert curve.ways[0].stopped.startswith("Zc_nm = 40.9044689: the motion ")
    assert "no convergence" not in curve.ways[0].stopped


def after_four_periods(p, x0):
    """Return the state after four periods from phase 0 without a neck, by SciPy: one oscillator with vdW and necks."""
    omega, period = 2e-3 * math.pi * p["f0_kHz"], 1e3 / p["f_kHz"]
    t, x, wet = 0.0, np.array(x0[:2]), False
    attraction, neck = p["H_aJ"] * p["R_nm"] / 6.0, 4.0 * math.pi * p["gamma_N_m"] * p["R_nm"]

    def field(t, x):
        gap = p["Zc_nm"] + x[0]
        force = p["k_N_m"] * p["A0_nm"] / p["Q"] * math.cos(2e-3 * math.pi * p["f_kHz"] * t) - attraction / gap**2
        force -= neck / (1.0 + gap / p["h_nm"]) ** 2 if wet else 0.0
        return x[1], omega**2 * (force / p["k_N_m"] - x[0]) - omega / p["Q"] * x[1]

    while t < 4.0 * period:

        def switched(t, x, wet=wet):
            return p["Zc_nm"] + x[0] - (p["off_nm"] if wet else p["on_nm"])

        switched.terminal, switched.direction = True, 1.0 if wet else -1.0
        part = solve_ivp(
            field, (t, 4.0 * period), x, "DOP853", rtol=1e-10, atol=1e-12, max_step=period / 400, events=switched
        )
        t, x = part.t[-1], part.y[:, -1]
        wet = wet != (part.status == 1)
    return x


@pytest.mark.campaign
def test_a_way_goes_on_to_the_motion_with_a_neck_in_four_periods(necks):
    """SciPy's motion repeats after four periods too, and comes nearer from starts beside it."""
    curve = afm.distance_curve(necks, (39.0, 45.0))
    (window,) = curve.ways[0].windows
    (double,), end = curve.branches[1].special_points.of_type("PD"), curve.branches[1].special_points.of_type("GR")[0]
    assert (window.begin, window.end) == pytest.approx((40.9044689, double.parameters["Zc_nm"]), abs=1e-6)
    assert curve.ways[0].stopped.startswith(f"Zc_nm = {end.parameters['Zc_nm']:.9g}: the motion settles on no sheet")
    (branch,) = (branch for branch in curve.branches if branch.solution(0).form.turns == 4)
    (orbit,) = branch.at(39.3)
    start, moves = orbit.x0[:2], 1e-5 * np.eye(2)
    np.testing.assert_allclose(after_four_periods(orbit.parameters, start), start, rtol=0.0, atol=1e-6)
    beside = [[after_four_periods(orbit.parameters, start + sign * move) for move in moves] for sign in (1.0, -1.0)]
    multipliers = np.linalg.eigvals((np.array(beside[0]) - beside[1]).T / 2e-5)
    np.testing.assert_allclose(np.abs(multipliers), np.abs(orbit.multipliers), rtol=1e-4)
    assert np.abs(multipliers).max() < 1.0


@pytest.mark.campaign
def test_a_way_may_end_just_before_the_range_does():
    """The motion beyond the end of the sheet is out of the range, and no sheet."""
    probe = afm.Probe(k_N_m=2.0, f0_kHz=70.0, Q=150.0, R_nm=20.0)
    law = afm.VanDerWaals(H_aJ=0.1, a0_nm=0.3) + afm.DMT(E_GPa=1.0)
    law = law + afm.Neck(gamma_N_m=0.02, h_nm=0.5, on_nm=0.6, off_nm=1.5)
    system = afm.model(probe, law, afm.Drive(A0_nm=40.0), Zc_nm=50.0)
    (end,) = afm.distance_curve(system, (40.0, 45.0)).branches[0].special_points.of_type("GR")
    place = end.parameters["Zc_nm"]
    curve = afm.distance_curve(system, (place - 1e-6, 45.0))
    assert curve.values.min() == pytest.approx(place, abs=1e-7)
    assert f"Zc_nm = {place:.9g}: the motion settles" in curve.ways[0].stopped


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("name", "place", "amplitude"),
    [("lever-p-kelvin-voigt", 24.0, 24.94540152), ("lever-p-bimodal", 17.0, 17.77164878)],
)
def test_a_sheet_onto_which_no_way_jumps_is_found(name, place, amplitude, tmp_path):
    path = tmp_path / "set.toml"
    path.write_text(text_of(name))
    curve, _ = read_experiment(path).around()
    seen = [afm.observables(orbit)["amplitude_nm"] for orbit in curve.at(place) if orbit.stable]
    assert min(abs(value - amplitude) for value in seen) < 1e-6
    assert not any(jump.after_nm == pytest.approx(amplitude, abs=1e-3) for jump in curve.jumps)


@pytest.mark.campaign
def test_a_sheet_with_only_a_corner_in_the_range_is_found_without_and_with_further_starts(tmp_path):
    """A range in which the closed sheet of a viscous sample has only its end, at the lower bound."""
    path = tmp_path / "set.toml"
    path.write_text(text_of("lever-p-kelvin-voigt"))
    whole, _ = read_experiment(path).around()
    top = min(float(branch.values.max()) for branch in whole.branches)
    bounds = (top - 0.3, top + 2.5)
    sheets = [afm.distance_curve(whole.system, bounds, starts=starts).at(top - 0.05) for starts in (0, 6)]
    for orbits in sheets:
        assert [orbit.stable for orbit in orbits].count(True) == 2
    for wrong in (-1, 1.5):
        with pytest.raises(InputError, match=f"starts = {wrong}: must be"):
            afm.distance_curve(whole.system, bounds, starts=wrong)


@pytest.mark.campaign
def test_motions_are_sought_where_no_motion_of_the_curve_is_stable(necks):
    """Below the first neck motions of many necks follow each other; far below they have two in three periods."""
    curve = afm.distance_curve(necks, (20.0, 45.0))
    (window,) = curve.ways[0].windows
    assert 24.0 < window.end < 33.0 < 40.0 < window.begin
    assert "period" in window.words
    (orbit,) = (orbit for orbit in curve.at(24.0) if orbit.stable)
    again = saltus.simulate(necks, orbit.parameters, orbit.x0, periods=3).x_end
    np.testing.assert_allclose(again[:2], orbit.x0[:2], rtol=0.0, atol=1e-6 * np.abs(orbit.x0[:2]).max())
    assert [jump.value for jump in curve.jumps if jump.after_nm < 24.5] == []


@pytest.mark.campaign
@pytest.mark.parametrize("law", [afm.Hertz(E_GPa=1.0), afm.Hydration(F_nN=1.0, l_nm=0.5)], ids=["Hertz", "hydration"])
def test_a_mode_that_nothing_moves_far_away_is_no_hindrance(law):
    probe = afm.Probe(k_N_m=(2.0, 78.5), f0_kHz=(70.0, 438.7), Q=(150.0, 940.0), R_nm=10.0)
    system = afm.model(probe, law, afm.Drive(A0_nm=20.0), Zc_nm=20.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        curve = afm.distance_curve(system, (10.0, 30.0))
    assert [way.stopped.split(": ")[1] for way in curve.ways] == ["the end of the range"] * 2
    free = curve.at(30.0)[0]
    decays = [np.exp(-np.pi / (Q * 70.0 / f0)) for Q, f0 in zip((150.0, 940.0), (70.0, 438.7), strict=True)]
    sizes = np.sort(np.abs(free.multipliers))
    np.testing.assert_allclose(sizes, np.repeat(np.sort(decays), 2), rtol=1e-6)


@pytest.mark.campaign
def test_a_sample_that_relaxes_fast_in_a_period_has_a_whole_curve():
    """The surface relaxes by 450 factors e in a period; energies are those of all harmonics, and balanced."""
    probe = afm.Probe(k_N_m=5.7292, f0_kHz=19.0707, Q=227.0, R_nm=160.0)
    law = afm.SLS(k1_N_m=0.24486, k2_N_m=0.79386, c_uNs_m=0.021847)
    curve = afm.distance_curve(afm.model(probe, law, afm.Drive(A0_nm=26.0), Zc_nm=26.0), (15.0, 30.0))
    assert [way.stopped.split(": ")[1] for way in curve.ways] == ["the end of the range"] * 2
    assert len(curve.branches) == 1
    found = curve.at(20.0)[0]
    assert isinstance(found, PeriodicOrbit)
    seen = afm.observables(found)
    assert seen["E_ext_eV"] == pytest.approx(seen["E_med_eV"] + seen["E_ts_eV"], rel=1e-9)
    # where the dashpot yields at once the sample is the spring k1 alone, which loses nothing
    spring = afm.SLS(k1_N_m=0.24486, k2_N_m=1e-4, c_uNs_m=0.021847)
    alone = saltus.find_orbit(afm.model(probe, spring, afm.Drive(A0_nm=26.0), Zc_nm=20.0), x0=[0.0, 0.0, 0.0])
    assert seen["amplitude_nm"] == pytest.approx(afm.observables(alone)["amplitude_nm"], rel=5e-3)


def test_a_tip_that_is_pulled_in_above_the_range_is_not_followed_through_the_saddle():
    """Nearer than 2.2 nm a soft lever has no rest away from the sample: its curve below is that of a tip in contact."""
    probe = afm.Probe(k_N_m=0.2328, f0_kHz=37.2742, Q=156.326, R_nm=30.38)
    law = afm.VanDerWaals(H_aJ=0.2027, a0_nm=0.1768) + afm.DMT(E_GPa=1.7607)
    law = law + afm.KelvinVoigt(eta_Pa_s=0.5413, form="raw")
    curve = afm.distance_curve(afm.model(probe, law, afm.Drive(A0_nm=1.0342), Zc_nm=1.0), (0.2, 1.5))
    assert len(curve) < 100
    assert {mode for mode, _ in curve.at(1.0)[0].signature} == {"contact"}
    assert curve.ways[0].stopped == "Zc_nm = 0.2: the end of the range; the tip stays in contact"


def test_a_branch_ends_where_its_orbits_need_too_many_pieces():
    probe = afm.Probe(k_N_m=0.5456, f0_kHz=20.9963, Q=19.6362, R_nm=183.79)
    system = afm.model(probe, afm.LennardJones(H_aJ=0.0373, sigma_nm=0.3129), afm.Drive(A0_nm=9.0321), Zc_nm=13.5)
    far = saltus.find_orbit(system, x0=[0.0, 0.0])
    branch = saltus.continue_orbit(far, "Zc_nm", (1.8, 13.5), steps=saltus.StepControl(pieces=4))
    assert branch.stopped[0].endswith("an orbit so unstable that it needs more than 4 pieces")
    assert max(len(branch.solution(i).form) for i in range(len(branch))) <= 4
    with pytest.raises(InputError, match=r"StepControl.pieces = 0: must be"):
        saltus.StepControl(pieces=0)


def test_a_motion_of_a_probe_in_vacuum_settles(monkeypatch):
    """Ten thousand periods pass until the free motion falls to 1/e: no less than some of these are waited for."""
    probe = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=30000.0, R_nm=12.0)
    law = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5)
    system = afm.model(probe, law, afm.Drive(A0_nm=12.0), Zc_nm=2.1875)
    found = settled(system, system.parameters, [5.0, 0.0])
    assert isinstance(found, PeriodicOrbit)
    assert found.stable
    monkeypatch.setattr("saltus.afm.models.settling._MOST", 1000.0)
    assert settled(system, system.parameters, [5.0, 0.0]) == "the motion has not settled after 1000 periods"
