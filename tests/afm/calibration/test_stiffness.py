"""Sader's spring constant against his own program, and the factors of modes."""

from __future__ import annotations

import math

import pytest
from scipy.integrate import quad

from saltus import afm
from saltus.afm.calibration.stiffness import modal_over_static, optical_chi
from saltus.afm.probe.beam import mode_shape
from saltus.afm.probe.blade_flow import blade_load
from saltus.errors import InputError

AIR = afm.Fluid.air()


def test_saders_k_is_that_of_his_program():
    # Table 1 of Rev. Sci. Instrum. 70, 3967: 397 x 29 um, 17.36 kHz, Q 55.5; his program's factor 0.1906, and the exact
    # load of a thin blade in place of his fit
    omega = math.tau * 17.36e3
    reynolds = 1.18 * omega * 29e-6**2 / 4.0 / 1.86e-5
    k = 0.1906 * 1.18 * 29e-6**2 * 397e-6 * 55.5 * blade_load(reynolds).imag * omega**2
    found = afm.sader_stiffness(17.36, 55.5, length_um=397.0, width_um=29.0, fluid=AIR)
    assert found == pytest.approx(k, rel=1e-3)
    assert found == pytest.approx(0.1573, rel=1e-3)


@pytest.mark.parametrize("mode", [1, 2])
def test_saders_k_is_that_of_a_lever_in_the_fluid(mode):
    lever = afm.Cantilever(length=397e-6, width=29e-6, thickness=2e-6, density=2320.0, young=169e9)
    static = 169e9 * 29e-6 * 2e-6**3 / 4.0 / 397e-6**3
    for fluid in (AIR, afm.Fluid.water()):
        seen = afm.fluid_modes(lever, fluid, mode)[-1]
        found = afm.sader_stiffness(seen.f0_kHz, seen.Q, length_um=397.0, width_um=29.0, fluid=fluid, mode=mode)
        assert found == pytest.approx(static, rel=1e-9)


def test_factors_of_modes_are_those_of_their_shapes():
    assert 1.0 / modal_over_static() == pytest.approx(0.971, abs=5e-4)
    assert optical_chi() == pytest.approx(1.09, abs=5e-4)
    assert 1.0 / modal_over_static() / optical_chi() ** 2 == pytest.approx(0.817, abs=1e-3)
    # equipartition over modes: displacements add up to kT/k static
    assert sum(1.0 / modal_over_static(mode) for mode in range(1, 15)) == pytest.approx(1.0, abs=2e-5)
    for mode in (1, 2, 3):
        slope = (3.0 * mode_shape(mode, 1.0) - 4.0 * mode_shape(mode, 0.9999) + mode_shape(mode, 0.9998)) / 2e-4
        assert optical_chi(mode) == pytest.approx(1.5 / abs(slope), rel=1e-5)
        work = quad(lambda x, mode=mode: float(mode_shape(mode, x)) ** 2, 0.0, 1.0)[0]
        assert work == pytest.approx(0.25, rel=1e-7)


def test_slips_are_named():
    with pytest.raises(InputError, match="in Hz\\? then it is 173.6 kHz"):
        afm.sader_stiffness(173.6e3, 55.5, length_um=397.0, width_um=29.0, fluid=AIR)
    with pytest.raises(InputError, match="for a beam of 397 um; in Hz\\? then it is 17.36 kHz"):
        afm.sader_stiffness(17.36e3, 55.5, length_um=397.0, width_um=29.0, fluid=AIR)
    with pytest.raises(InputError, match="in MHz\\? then it is 200 kHz"):
        afm.sader_stiffness(0.2, 55.5, length_um=39.7, width_um=29.0, fluid=AIR, mode=3)
    with pytest.raises(InputError, match="in m\\? then it is 397 um"):
        afm.sader_stiffness(17.36, 55.5, length_um=397e-6, width_um=29.0, fluid=AIR)
    with pytest.raises(InputError, match="at most the length of 29 um; are both swapped"):
        afm.sader_stiffness(17.36, 55.5, length_um=29.0, width_um=397.0, fluid=AIR)
    with pytest.raises(InputError, match="fluid"):
        afm.sader_stiffness(17.36, 55.5, length_um=397.0, width_um=29.0, fluid=1.18)
