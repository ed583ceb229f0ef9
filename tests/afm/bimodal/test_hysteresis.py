"""Means over two phases of laws whose contact ends later than it begins: brute sums, closed forms, the whole motion."""

import math

import numba
import numpy as np
import pytest

from oracles.several_modes import harmonics
from saltus import afm
from saltus.afm.bimodal.averages import FINE, STANDARD
from saltus.afm.bimodal.balance import Balance
from saltus.errors import InputError
from selection import guarding

PROBE = afm.Probe(k_N_m=(2.0, 80.0), f0_kHz=(70.0, 440.0), Q=(150.0, 450.0), R_nm=10.0)
NECK = {"gamma_N_m": 0.02, "h_nm": 0.5, "on_nm": 0.6, "off_nm": 1.5}
JKR = afm.JKR(E_GPa=1.0, w_N_m=0.05)
LAWS = {
    "JKR": JKR,
    "Schwarz": afm.Schwarz(E_GPa=1.0, w1_N_m=0.05, w2_N_m=0.02, a0_nm=0.3),
    "viscous": JKR + afm.KelvinVoigt(eta_Pa_s=10.0),
    "neck": afm.VanDerWaals(H_aJ=0.1, a0_nm=0.3) + afm.DMT(E_GPa=1.0) + afm.Neck(**NECK),
    "two": JKR + afm.Neck(**NECK),
}
# whole turns in contact, dips and misses of the faster mode, and the faster mode as the larger one
MOTIONS = [(9.2, 10.0, 0.5), (10.2, 10.0, 0.5), (9.5, 10.0, 1.5), (9.0, 2.0, 10.0)]
A_C = (math.pi * 10.0**2 * 0.05 / 8.0) ** (1.0 / 3.0)  # unit of JKR's contact radius, in nm
MODES = (afm.AM(A0_nm=30.0, setpoint_nm=25.0), afm.FM(A_nm=0.5))


def means(law, c, A, A2, nodes=FINE, **changes):
    """Means and derivatives: of the force, then of the damping of each mode."""
    balance = Balance(PROBE, law)
    own = {"mean_gap_nm": c, "amplitude_nm": A, "amplitude_nm_2": A2, "shift_Hz": 0.0, "shift_Hz_2": 0.0} | changes
    q = balance.values({name: np.array([value]) for name, value in own.items()}, 1)
    force, damping = balance.means(q, nodes)[..., 0]
    return np.concatenate([force, damping[1:]])


def brute(c, A, A2, turns=400, steps=8000):
    """Means of JKR's force over turns at as many phases of the second mode, by steps in time."""
    ratio = 440.0 / 70.0
    phi = (np.arange(steps) + 0.5) * 2.0 * math.pi / steps
    psi = ((np.arange(turns) + 0.5) * 2.0 * math.pi / turns)[:, None] + ratio * phi
    D, held = c + A * np.cos(phi) + A2 * np.cos(psi), np.zeros((turns, steps), dtype=bool)
    for i in range(1, steps):
        held[:, i] = np.where(held[:, i - 1], D[:, i] < 3.0 * A_C**2 / 10.0, D[:, i] < 0.0)
    F = np.zeros_like(D)
    F[held] = JKR.force_nN(D[held], "contact", R_nm=10.0)
    rates = 2e-3 * math.pi * np.array([70.0 * A, 440.0 * A2])
    rows = [F, F * np.cos(phi), F * np.cos(psi), F * np.sin(phi) / rates[0], F * np.sin(psi) / rates[1]]
    return np.array([row.mean() for row in rows])


@pytest.mark.campaign
@pytest.mark.parametrize("motion", MOTIONS[:3])
def test_means_are_those_of_a_motion_that_is_followed_in_time(motion):
    told, plain = means(JKR, *motion)[:, 0], brute(*motion)
    # the events of the steps are late by half a step
    assert np.abs(told - plain)[:3].max() < 3e-3 * np.abs(plain[:3]).max()
    assert np.abs(told - plain)[3:].max() < 1e-2 * np.abs(plain[3:]).max()


@pytest.mark.parametrize("law", guarding(LAWS, "neck"))
def test_derivatives_are_differences_of_the_means(law):
    motion, names = MOTIONS[1], Balance(PROBE, LAWS[law]).layers.names
    told, values = means(LAWS[law], *motion), {"R_nm": 10.0, **LAWS[law].parameters}
    columns = {"mean_gap_nm": (motion[0], 1), "amplitude_nm": (motion[1], 2), "amplitude_nm_2": (motion[2], 3)}
    columns |= {name: (values[name], 4 + i) for i, name in enumerate(names)}
    for name, (value, column) in columns.items():
        step = 1e-5 * max(1.0, abs(value))
        ends = [means(LAWS[law], *motion, **{name: value + sign * step})[:, 0] for sign in (1.0, -1.0)]
        slope = (ends[0] - ends[1]) / (2.0 * step)
        assert np.abs(slope - told[:, column]).max() <= 1e-6 * np.abs(told[:, column]).max() + 1e-10
    for name, column in (("shift_Hz", -2), ("shift_Hz_2", -1)):
        ends = [means(LAWS[law], *motion, **{name: sign * 30.0})[:, 0] for sign in (1.0, -1.0)]
        slope = (ends[0] - ends[1]) / 60.0
        assert np.abs(slope - told[:, column]).max() <= 1e-4 * np.abs(told[:, column]).max() + 1e-10


@pytest.mark.parametrize("law", guarding(LAWS, "JKR", "neck"))
def test_standard_nodes_resolve_the_means(law):
    for motion in MOTIONS:
        rough, fine = (means(LAWS[law], *motion, nodes=nodes) for nodes in (STANDARD, FINE))
        assert np.abs(rough - fine)[:, 0].max() < 1e-6 * np.abs(fine[:, 0]).max()


def test_the_energies_of_both_modes_are_those_of_a_contact_or_a_neck():
    # the second mode is too small to touch twice in a turn of the first
    c, A, A2 = MOTIONS[0]
    lost = {"JKR": (0.15 * 2 ** (8 / 3) + 0.1) * (math.pi**5 * 0.05**5 * 10.0**4) ** (1 / 3)}
    lost["neck"] = 4.0 * math.pi * 0.02 * 10.0 * 0.5 * (1.0 / (1.0 + 0.6 / 0.5) - 1.0 / (1.0 + 1.5 / 0.5))
    for law, energy in lost.items():
        damping = means(LAWS[law], c, A, A2)[3:, 0]
        power = sum((2e-3 * math.pi * f * a) ** 2 * one for f, a, one in zip((70, 440), (A, A2), damping, strict=True))
        assert power / 70e-3 == pytest.approx(energy, rel=1e-6)


def test_a_motion_that_need_not_leave_the_sample_has_no_means():
    assert np.isnan(means(JKR, 0.1, 0.3, 0.2)).all()
    assert not means(JKR, 20.0, 10.0, 0.5)[:, 0].any()


@pytest.mark.campaign
def test_a_pixel_whose_motion_need_not_leave_the_sample_says_so():
    seen = afm.bimodal(PROBE, JKR, (afm.AM(A0_nm=0.5), afm.FM(A_nm=0.3)), Zc_nm=0.2)
    assert "no motion that leaves the sample in each turn" in seen.reason()


def test_three_modes_are_refused():
    probe = afm.Probe(k_N_m=(2.0, 80.0, 620.0), f0_kHz=(70.0, 440.0, 1230.0), Q=(150.0, 450.0, 700.0), R_nm=10.0)
    with pytest.raises(InputError, match="a probe with two modes"):
        afm.bimodal(probe, JKR, (*MODES, afm.FM(A_nm=0.2)))


@pytest.mark.campaign
def test_modulus_and_adhesion_come_back_with_derivatives():
    sample = {"E_GPa": np.array([1.0, 2.5]), "w_N_m": np.array([0.04, 0.07])}
    seen = afm.bimodal(PROBE, JKR, MODES, parameters=sample)
    step, ends = 1e-4, []
    for sign in (1.0, -1.0):
        moved = sample | {"w_N_m": sample["w_N_m"] + sign * step * 0.1}
        ends.append(afm.bimodal(PROBE, JKR, MODES, parameters=moved)["lag_deg"])
    assert seen.derivatives["lag_deg", "w_N_m"] == pytest.approx((ends[0] - ends[1]) / (0.2 * step), rel=1e-4)
    errors = {"amplitude_nm": 0.02, "lag_deg": 0.1, "shift_Hz_2": 2.0, "excitation_nm_2": 0.002}
    readings = {name: seen[name] for name in errors}
    back = afm.bimodal_map(readings, PROBE, JKR, MODES, unknowns=("E_GPa", "w_N_m"), sigma=errors)
    for name, value in sample.items():
        assert back[name] == pytest.approx(value, rel=1e-6)


@numba.njit
def sticky(gap, _rate, held):
    """JKR's contact of 1 GPa and 0.05 N/m, a tip of 10 nm."""
    if not held:
        return 0.0
    q = max(-3.0, -gap * 10.0 / A_C**2)
    root = 1.0 + math.sqrt(1.0 + q**3 / 27.0)
    m = root ** (1.0 / 3.0) - q / (3.0 * root ** (1.0 / 3.0))
    u = math.sqrt(2.0 * m)
    one = 0.5 * (u + math.sqrt(max(0.0, 4.0 * math.sqrt(2.0 / m) - 2.0 * m)))
    return math.pi * 0.05 * 10.0 * (one**6 / 6.0 - one**3)


@pytest.mark.campaign
@pytest.mark.thorough
def test_a_long_simulation_has_the_amplitudes_and_lags():
    f, Q, A0 = np.array([0.07, 0.43917]), np.array([200.0, 500.0]), np.array([30.0, 0.6])
    probe = afm.Probe(k_N_m=(2.0, 80.0), f0_kHz=tuple(1e3 * f), Q=tuple(Q), R_nm=10.0)
    seen = afm.bimodal(probe, JKR, [afm.AM(A0_nm=one) for one in A0], Zc_nm=24.0)
    levels = (0.0, 3.0 * A_C**2 / 10.0)
    cosine, sine = harmonics(np.array(PROBE.k_N_m), f, Q, A0, 24.0, sticky, levels, 120.0, 3000.0).T
    for i, end in enumerate(("", "_2")):
        assert np.hypot(cosine[i], sine[i]) == pytest.approx(seen[f"amplitude_nm{end}"], rel=0.02)
        assert np.degrees(np.arctan2(sine[i], cosine[i])) == pytest.approx(seen[f"lag_deg{end}"], abs=1.0)
