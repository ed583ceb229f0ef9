"""Operating points of two modes: exact orbits, set points that no motion meets."""

import numpy as np
import pytest

import saltus
from saltus import afm

PROBE = afm.Probe(k_N_m=(2.0, 80.0), f0_kHz=(70.0, 440.0), Q=(150.0, 450.0), R_nm=10.0)
VISCOUS = afm.Hertz(E_GPa=1.0) + afm.KelvinVoigt(eta_Pa_s=10.0)


@pytest.mark.campaign
def test_an_exact_bimodal_orbit_differs_by_little():
    # k2 = 2 (6.267)**2, f2 = 19/3 f1: A1 = 17.77703712, lag 63.53805690 by an event-exact integration
    probe = afm.Probe(k_N_m=(2.0, 2 * 6.267**2), f0_kHz=(70.0, 70 * 19 / 3), Q=(150.0, 450.0), R_nm=10.0)
    law = afm.VanDerWaals(H_aJ=0.1, a0_nm=0.2) + afm.DMT(E_GPa=2.0)
    seen = afm.bimodal(probe, law, (afm.AM(A0_nm=20.0), afm.AM(A0_nm=1.0)), Zc_nm=17.0)
    assert seen["amplitude_nm"] == pytest.approx(17.77703712, rel=5e-3)
    assert seen["lag_deg"] == pytest.approx(63.53805690, abs=1.0)


@pytest.mark.campaign
def test_one_mode_of_two_has_the_exact_distance_curve_but_for_the_bending_of_the_other():
    # lever S of 26 N/m at 10 nm: 10.71569893 nm and 63.24971471 degrees, 9.895278868 nm and 124.4512443 degrees
    probe = afm.Probe(k_N_m=(26.0, 1e4), f0_kHz=(300.0, 1880.0), Q=(400.0, 400.0), R_nm=12.0)
    law = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5)
    modes = (afm.AM(A0_nm=12.0), afm.FM(A_nm=1e-3))
    seen = afm.bimodal(probe, law, modes, Zc_nm=10.0)
    assert seen["amplitude_nm"] == pytest.approx(10.71569893, rel=1e-3)
    assert seen["lag_deg"] == pytest.approx(63.24971471, abs=0.1)
    other = afm.bimodal(probe, law, modes, Zc_nm=10.0, regime="attractive")
    assert int(other.solutions) == 2  # the saddle is attractive too
    assert "several attractive motions" in other.reason()
    assert other["amplitude_nm"] == pytest.approx(9.895278868, rel=1e-4)


@pytest.mark.thorough
@pytest.mark.campaign
def test_the_difference_to_exact_orbits_falls_as_the_quality_factors_rise():
    law, differences = afm.Hertz(E_GPa=1.0), []
    for Q in (50.0, 200.0):
        probe = afm.Probe(k_N_m=(20.0, 800.0), f0_kHz=(70.0, 70.0 * 63 / 10), Q=(Q, Q), R_nm=10.0)
        held = afm.bimodal(probe, law, (afm.AM(A0_nm=20.0, setpoint_nm=19.0), afm.AM(A0_nm=1.0)))
        drive = afm.Drive(A0_nm=20.0) + afm.Drive(A0_nm=1.0, mode=2, ratio="63/10")
        model = afm.model(probe, law, drive, Zc_nm=float(held["Zc_nm"]))
        orbit = afm.observables(saltus.find_orbit(model, x0=[19.0, 0.1, 0.0, 0.0]))
        differences.append(abs(orbit["amplitude_nm"] - 19.0))
    assert differences[1] < 0.5 * differences[0]


def test_set_points_that_no_motion_meets_are_told():
    seen = afm.bimodal(PROBE, VISCOUS, (afm.AM(A0_nm=30.0, setpoint_nm=31.0), afm.FM(A_nm=0.5)))
    assert np.isnan(seen["Zc_nm"])
    assert seen.reason() == "no motion meets the set points"
