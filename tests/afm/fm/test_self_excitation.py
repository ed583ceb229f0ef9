"""A probe that excites itself: its equations against those of the driven probe, and the models that have none."""

from __future__ import annotations

import math

import numpy as np
import pytest

from saltus import afm
from saltus.afm.fm.self_excitation import excited_mode
from saltus.errors import InputError

PROBE = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
LAW = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5)


@pytest.fixture(scope="module")
def driven():
    return afm.model(PROBE, LAW, afm.Drive(A0_nm=10.0), Zc_nm=14.0)


def test_the_velocity_takes_the_place_of_the_drive_s_phase(driven):
    """On a circle of the held amplitude both fields are the same: there cos(theta) is the velocity over omega A."""
    excited = afm.self_excited(driven, 10.0)
    omega = 2e-3 * math.pi * 300.0
    for theta in np.linspace(0.0, 6.0, 7):
        x = [10.0 * math.sin(theta), 10.0 * omega * math.cos(theta)]
        for mode in driven.modes:
            wanted = driven.field(mode, [*x, theta])
            np.testing.assert_allclose(excited.field(mode, x), wanted[:2], rtol=1e-12)


def test_the_system_has_no_phase_and_the_amplitude_as_a_parameter(driven):
    excited = afm.self_excited(driven, 8.0)
    assert excited.phase is None
    assert set(excited.parameter_names) == set(driven.parameter_names) - {"f_kHz"} | {"A_nm"}
    assert excited.parameters["A_nm"] == 8.0
    assert excited.name == f"{driven.name}, self-excited"


def test_the_mode_that_a_model_s_drive_excites(driven):
    assert excited_mode(driven) == 1


@pytest.mark.parametrize("A_nm", [0.0, -1.0, math.nan, 1e7])
def test_an_amplitude_that_is_none_is_refused(driven, A_nm):
    with pytest.raises(InputError, match="A_nm"):
        afm.self_excited(driven, A_nm)


def test_a_drive_off_resonance_is_refused():
    system = afm.model(PROBE, LAW, afm.Drive(A0_nm=10.0, phase_deg=20.0), Zc_nm=14.0)
    with pytest.raises(InputError, match="one drive of one mode at its natural frequency"):
        afm.self_excited(system, 10.0)
