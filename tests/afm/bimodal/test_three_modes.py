"""Three modes at once: round trips of three unknowns, derivatives, and a long simulation by other means."""

import math

import numba
import numpy as np
import pytest

from oracles.several_modes import harmonics
from saltus import afm
from saltus.errors import InputError
from selection import guarding

PROBE = afm.Probe(k_N_m=(2.0, 80.0, 620.0), f0_kHz=(70.0, 440.0, 1230.0), Q=(150.0, 450.0, 700.0), R_nm=10.0)
SPHERE = afm.VanDerWaals(H_aJ=0.1, a0_nm=0.2) + afm.DMT(E_GPa=2.0) + afm.KelvinVoigt(eta_Pa_s=20.0)
UNKNOWNS = ("E_GPa", "eta_Pa_s", "H_aJ")
MODES = {
    "AM-FM-FM": (afm.AM(A0_nm=30.0, setpoint_nm=24.0), afm.FM(A_nm=0.5), afm.FM(A_nm=0.2)),
    "AM-AM-AM": (afm.AM(A0_nm=30.0, setpoint_nm=24.0), afm.AM(A0_nm=0.5), afm.AM(A0_nm=0.3)),
    "FM-FM-FM": (afm.FM(A_nm=20.0, setpoint_Hz=100.0), afm.FM(A_nm=0.5), afm.FM(A0_nm=0.2)),
}


def read(seen):
    """The readings that a set point does not hold."""
    return {name: seen[name] for name in seen.found if name not in ("mean_gap_nm", "Zc_nm")}


@pytest.mark.campaign
@pytest.mark.parametrize("modes", guarding(MODES, campaign=1))
def test_three_unknowns_come_back_from_a_distant_guess(modes):
    sample = {"E_GPa": np.array([1.0, 3.0])[:, None], "eta_Pa_s": 10.0, "H_aJ": np.array([0.05, 0.15])}
    seen = afm.bimodal(PROBE, SPHERE, MODES[modes], parameters=sample)
    guess = afm.VanDerWaals(H_aJ=0.3, a0_nm=0.2) + afm.DMT(E_GPa=20.0) + afm.KelvinVoigt(eta_Pa_s=200.0)
    found = afm.bimodal_map(read(seen), PROBE, guess, MODES[modes], unknowns=UNKNOWNS)
    assert found.freedom == 2
    for name in UNKNOWNS:
        assert np.abs(found[name] / sample[name] - 1.0).max() < 1e-7


def test_derivatives_of_a_third_mode_are_differences():
    seen = afm.bimodal(PROBE, SPHERE, MODES["AM-FM-FM"], parameters={"E_GPa": [2.0, 2.001, 1.999]})
    for name in ("shift_Hz_3", "excitation_nm_3", "lag_deg"):
        slope = (seen[name][1] - seen[name][2]) / 0.002
        assert seen.derivatives[name, "E_GPa"][0] == pytest.approx(slope, rel=1e-4)
    low = seen["mean_gap_nm"] - sum(seen[f"amplitude_nm{end}"] for end in ("", "_2", "_3"))
    assert np.abs(seen["indentation_nm"] - (0.2 - low)).max() < 1e-12
    drawn = seen.plot(("amplitude_nm_3", "lag_deg_3", "virial_eV_3"))
    titles = [axes.get_ylabel().replace("\n", " ") for axes in drawn]
    assert titles == ["amplitude, mode 3 (nm)", "lag behind the drive, mode 3 (degrees)", "virial, mode 3 (eV)"]


def test_as_many_modes_are_operated_as_the_probe_has():
    with pytest.raises(InputError, match="3 of AM"):
        afm.bimodal(PROBE, SPHERE, MODES["AM-FM-FM"][:2])


@numba.njit
def viscous(gap, rate, _held):
    """Hertz's contact of 1 GPa with 10 Pa s, a tip of 10 nm."""
    depth = max(0.0, -gap)
    return 4.0 / 3.0 * math.sqrt(10.0) * depth**1.5 - 1e-2 * math.sqrt(10.0 * depth) * rate


@pytest.mark.campaign
@pytest.mark.thorough
def test_a_long_simulation_differs_by_less_as_the_quality_factors_rise():
    k, f, A0 = np.array([2.0, 80.0, 620.0]), np.array([0.07, 0.43917, 1.1937]), np.array([30.0, 0.6, 0.4])
    law, differences = afm.Hertz(E_GPa=1.0) + afm.KelvinVoigt(eta_Pa_s=10.0), []
    for Q in (np.array([50.0, 100.0, 150.0]), np.array([200.0, 400.0, 600.0])):
        probe = afm.Probe(k_N_m=tuple(k), f0_kHz=tuple(1e3 * f), Q=tuple(Q), R_nm=10.0)
        seen = afm.bimodal(probe, law, [afm.AM(A0_nm=one) for one in A0], Zc_nm=24.0)
        cosine, sine = harmonics(k, f, Q, A0, 24.0, viscous, (0.0, 0.0), 80.0, 3000.0).T
        for i, end in enumerate(("", "_2", "_3")):
            assert np.hypot(cosine[i], sine[i]) == pytest.approx(seen[f"amplitude_nm{end}"], rel=0.03)
            assert np.degrees(np.arctan2(sine[i], cosine[i])) == pytest.approx(seen[f"lag_deg{end}"], abs=2.0)
        differences.append(abs(np.hypot(cosine[0], sine[0]) - seen["amplitude_nm"]))
    assert differences[1] < 0.4 * differences[0]
