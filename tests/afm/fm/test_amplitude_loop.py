"""The amplitude loop: its orbits are those of the distance curve, and where it rings a simulation rings."""

from __future__ import annotations

import math

import numpy as np
import pytest

import saltus
from saltus import afm
from saltus.errors import InputError

SET = 8.0  # nm
TAU = 50.0  # us
FAR = (0.0, 0.0, 0.0, 0.0, 20.0)  # at rest 20 nm above the sample


@pytest.fixture(scope="module")
def lever():
    probe = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
    law = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5)
    return afm.model(probe, law, afm.Drive(A0_nm=12.0), Zc_nm=10.0)


@pytest.fixture(scope="module")
def loop(lever):
    return afm.feedback(lever, SET, Ki_1_ms=0.5, tau_us=TAU)


@pytest.fixture(scope="module")
def held(loop):
    return saltus.find_orbit(loop, x0=FAR)


@pytest.fixture(scope="module")
def onset(held):
    return saltus.continue_orbit(held, "Ki_1_ms", (0.1, 20.0))["TR1"]


@pytest.mark.campaign
def test_the_loop_comes_from_afar_to_the_set_amplitude(held):
    seen = afm.observables(held)
    share = 1.0 / (4.0 * 2e-3 * math.pi * 300.0 * TAU) ** 2  # what the low-pass lets through at twice the frequency
    assert held.stable
    assert 1.0 - seen["amplitude_nm"] / SET == pytest.approx(share, rel=2e-3)
    assert held.observe("mean(in_phase_nm)")["mean(in_phase_nm)"] == pytest.approx(
        seen["amplitude_nm"] * math.cos(math.radians(seen["lag_deg"])), abs=1e-6
    )


@pytest.mark.campaign
def test_orbits_of_the_loop_are_those_of_the_distance_curve(lever, held):
    place = held.observe("mean(Zc_nm)")["mean(Zc_nm)"]
    fixed = saltus.find_orbit(lever, {"Zc_nm": place}, x0=held.x0[:2])
    with_loop, without = afm.observables(held), afm.observables(fixed)
    assert (held.max["Zc_nm"] - held.min["Zc_nm"]) < 2e-5
    for name in ("amplitude_nm", "lag_deg", "E_ext_eV", "virial_eV", "peak_force_nN"):
        assert with_loop[name] == pytest.approx(without[name], rel=1e-5)


def test_a_loop_that_does_nothing_leaves_the_multipliers_of_the_model(lever, held):
    still = saltus.continue_orbit(held, "Ki_1_ms", (1e-6, 0.5)).solution(0)
    assert still.parameters["Ki_1_ms"] == pytest.approx(1e-6)
    own = saltus.find_orbit(lever, {"Zc_nm": float(held.x0[4])}, x0=held.x0[:2]).multipliers
    low_pass = math.exp(-held.period / TAU)
    wanted = np.sort(np.abs([*own, low_pass, low_pass, 1.0]))
    np.testing.assert_allclose(np.sort(np.abs(still.multipliers)), wanted, atol=1e-5)


@pytest.mark.campaign
def test_a_simulated_loop_rings_above_the_onset_only(loop, held, onset):
    """A shift of 1 pm dies away below; above, it grows at the rate that the multipliers tell."""
    times = np.arange(0.0, 13000.0, 0.5)  # us
    Ki, swing = onset.value("Ki_1_ms"), {}
    for factor in (0.9, 1.1):
        x0 = [*onset.orbit.x0[:4], onset.orbit.x0[4] + 1e-3]
        motion = saltus.simulate(loop, {"Ki_1_ms": factor * Ki}, x0=x0, t_end=13000.0)
        Zc = motion(times)[:, 4]
        swing[factor] = [np.ptp(Zc[(times >= begin) & (times < begin + 1000.0)]) for begin in (4000.0, 12000.0)]
    assert swing[0.9][1] < 2e-4
    assert swing[0.9][1] < swing[0.9][0]
    beyond = saltus.continue_orbit(held, "Ki_1_ms", (0.5, 1.1 * Ki)).solution(-1)
    assert not beyond.stable
    rate = math.log(np.abs(beyond.multipliers).max()) / beyond.period
    assert math.log(swing[1.1][1] / swing[1.1][0]) / 8000.0 == pytest.approx(rate, rel=0.1)


@pytest.mark.campaign
def test_of_two_drives_the_first_is_read():
    probe = afm.Probe(k_N_m=(2.0, 78.5), f0_kHz=(70.0, 438.7), Q=(150.0, 450.0), R_nm=10.0)
    drive = afm.Drive(A0_nm=20.0) + afm.Drive(A0_nm=1.0, mode=2, ratio="19/3")
    loop = afm.feedback(afm.model(probe, afm.Hertz(E_GPa=1.0), drive, Zc_nm=17.0), 18.0, Ki_1_ms=0.5, tau_us=TAU)
    field = loop.definition()["modes"]["far"]["field"]
    assert "cos(3*theta)" in field["in_phase_nm"]
    assert "z2_nm" in field["quadrature_nm"]


def test_wrong_arguments_are_told(lever, loop, afm1):
    with pytest.raises(InputError, match=r"saltus\.afm\.model"):
        afm.feedback(afm1, SET, Ki_1_ms=0.5, tau_us=TAU)
    with pytest.raises(InputError, match="Zc_nm is a parameter"):
        afm.feedback(loop, SET, Ki_1_ms=0.5, tau_us=TAU)
    with pytest.raises(InputError, match="in s"):
        afm.feedback(lever, SET, Ki_1_ms=0.5, tau_us=5e-5 * 1e-3)
    with pytest.raises(InputError, match="setpoint_nm"):
        afm.feedback(lever, -8.0, Ki_1_ms=0.5, tau_us=TAU)
