"""Laws of force: closed forms, potentials, energies of prescribed motions, sums and their regions."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

import saltus
from oracles.tip import jkr
from saltus import afm
from saltus.afm.laws.common_regions import product
from saltus.afm.laws.prescribed import ForceTable
from saltus.errors import InputError

EV = 1.0 / 0.1602176634  # eV in 1 aJ


def virial(law, Zc, A, R):
    """Mean of force times displacement along Zc + A cos, by the trapezoidal rule, exact for smooth periodic ones."""
    cosine = np.cos(2.0 * np.pi * np.arange(4096) / 4096)
    return float(np.mean(law.force_nN(Zc + A * cosine, R_nm=R) * A * cosine))


@pytest.mark.campaign
def test_van_der_waals_in_numbers_and_its_virial():
    law = afm.VanDerWaals(H_aJ=0.2, a0_nm=0.3)
    assert float(law.force_nN(2.0, R_nm=10.0)) == pytest.approx(-0.2 * 10.0 / 24.0, rel=1e-14)
    assert float(law.force_nN(-5.0, R_nm=10.0)) == pytest.approx(-0.2 * 10.0 / 0.54, rel=1e-14)
    wanted = 0.2 * 10.0 * 10.0**2 / 6.0 / (12.0**2 - 10.0**2) ** 1.5
    assert virial(law, 12.0, 10.0, 10.0) == pytest.approx(wanted, rel=1e-12)
    assert law.energy_per_cycle_eV(Zc_nm=9.0, A_nm=10.0, f_kHz=70.0, R_nm=10.0) == pytest.approx(0.0, abs=1e-11)


def test_dmt_is_hertz_below_the_intermolecular_distance():
    hertz, dmt = afm.Hertz(E_GPa=2.0), afm.DMT(E_GPa=2.0, a0_nm=0.3)
    depths = np.array([-1.0, 0.0, 0.4, 7.0])
    expected = 4.0 / 3.0 * 2.0 * np.sqrt(20.0) * np.maximum(depths, 0.0) ** 1.5
    np.testing.assert_allclose(hertz.force_nN(-depths, R_nm=20.0), expected, rtol=1e-13)
    np.testing.assert_allclose(dmt.force_nN(0.3 - depths, R_nm=20.0), expected, rtol=1e-13)


def test_dmts_pull_off_is_that_of_the_surface_energy():
    H, a0, R = 0.2, 0.165, 20.0
    law = afm.VanDerWaals(H_aJ=H, a0_nm=a0) + afm.DMT(E_GPa=1.0)
    energy = H / (24.0 * math.pi * a0**2)  # gamma: F = -4 pi R gamma
    assert float(law.force_nN(a0, R_nm=R)) == pytest.approx(-4.0 * math.pi * R * energy, rel=1e-13)


@pytest.mark.parametrize("depth", [0.1, 1.0, 4.0])
def test_viscous_loss_of_a_prescribed_motion(depth):
    A, R, eta, f = 20.0, 20.0, 10.0, 70.0
    law = afm.Hertz(E_GPa=1.0) + afm.KelvinVoigt(eta_Pa_s=eta)
    raw = afm.Hertz(E_GPa=1.0) + afm.KelvinVoigt(eta_Pa_s=eta, form="raw")
    found = law.energy_per_cycle_eV(Zc_nm=A - depth, A_nm=A, f_kHz=f, R_nm=R)
    series = math.sqrt(2.0) * math.pi / 4.0 * 1e-3 * eta * 2e-3 * math.pi * f * math.sqrt(R * A) * depth**2
    series *= 1.0 - depth / (8.0 * A)
    assert found == pytest.approx(series * EV, rel=2e-2 * (depth / A) ** 2 + 1e-12)
    assert raw.energy_per_cycle_eV(Zc_nm=A - depth, A_nm=A, f_kHz=f, R_nm=R) == found
    if depth == 1.0:
        assert found / EV == pytest.approx(0.0970910417, rel=1e-9)


def test_loss_of_a_dashpot_in_contact():
    A, Zc, c, f = 10.0, 9.0, 2.0, 300.0
    omega, share = 2e-3 * math.pi * f, math.acos(0.9)  # contact within share of the lowest point
    found = (afm.Hertz(E_GPa=1.0) + afm.Dashpot(c_uNs_m=c)).energy_per_cycle_eV(Zc_nm=Zc, A_nm=A, f_kHz=f, R_nm=1.0)
    assert found == pytest.approx(c * A**2 * omega * (share - 0.5 * math.sin(2.0 * share)) * EV, rel=1e-12)


@pytest.mark.campaign
@pytest.mark.parametrize("f", [1.0, 70.0, 2000.0])
def test_loss_of_a_standard_linear_solid_that_stays_in_contact_is_that_of_its_loss_modulus(f):
    law, A, omega = afm.SLS(k1_N_m=2.0, k2_N_m=4.0, c_uNs_m=1.0), 2.0, 2e-3 * math.pi * f
    found = law.energy_per_cycle_eV(Zc_nm=-20.0, A_nm=A, f_kHz=f)
    assert found == pytest.approx(math.pi * A**2 * 4.0 * (omega / 4.0) / (1.0 + (omega / 4.0) ** 2) * EV, rel=1e-9)


@pytest.mark.campaign
@pytest.mark.parametrize("c", [0.3, 1.0, 30.0])
def test_loss_of_a_standard_linear_solid_that_is_tapped(c):
    k1, k2, A, Zc, f = 2.0, 4.0, 10.0, 9.0, 70.0
    omega = 2e-3 * math.pi * f

    def rates(t, s):
        h, rate = -Zc - A * math.cos(omega * t), A * omega * math.sin(omega * t)
        if (k1 + k2) * h > k2 * s[0]:
            return [k2 * (h - s[0]) / c, (k1 * h + k2 * (h - s[0])) * rate]
        return [-k1 * k2 / (k1 + k2) * s[0] / c, 0.0]

    cycle, s = 2.0 * math.pi / omega, [0.0, 0.0]
    for _ in range(30):  # the slowest of the three keeps less than exp(-4/3 * 14.3/30) of itself in a cycle
        s = solve_ivp(rates, (0.0, cycle), [s[0], 0.0], "DOP853", rtol=1e-11, atol=1e-13, max_step=cycle / 200).y[:, -1]
    found = afm.SLS(k1_N_m=k1, k2_N_m=k2, c_uNs_m=c).energy_per_cycle_eV(Zc_nm=Zc, A_nm=A, f_kHz=f)
    assert found == pytest.approx(s[1] * EV, rel=1e-7)


def test_statics_of_adhesive_contact():
    law, R, w, E = afm.JKR(E_GPa=0.05, w_N_m=0.05), 20.0, 0.05, 0.05
    radius = (math.pi * R**2 * w / (8.0 * E)) ** (1.0 / 3.0)
    end = 3.0 * radius**2 / R
    assert (radius, end) == (pytest.approx(5.395602646, rel=1e-9), pytest.approx(4.366879188, rel=1e-9))
    assert float(law.force_nN(end, "contact", R_nm=R)) == pytest.approx(-2.617993878, rel=1e-7)
    assert float(law.force_nN(0.0, "contact", R_nm=R)) == pytest.approx(-4.188790205, rel=1e-9)
    gaps = np.linspace(-60.0, end, 20001)
    force = law.force_nN(gaps, "contact", R_nm=R)
    assert force.min() == pytest.approx(-1.5 * math.pi * w * R, rel=1e-7)
    for i in range(0, 20001, 500):
        assert force[i] == pytest.approx(jkr(gaps[i], E, w, R), rel=1e-10, abs=1e-10)
    loss = law.energy_per_cycle_eV(Zc_nm=8.0, A_nm=10.0, f_kHz=70.0, R_nm=R)
    assert loss == pytest.approx(120.1564252, rel=1e-9)
    assert loss == pytest.approx(7.092195972 * (w**5 * R**4 / E**2) ** (1.0 / 3.0) * EV, rel=1e-9)
    assert law.energy_per_cycle_eV(Zc_nm=11.0, A_nm=10.0, f_kHz=70.0, R_nm=R) == 0.0  # never touches
    stays = law.energy_per_cycle_eV(Zc_nm=0.0, A_nm=4.0, f_kHz=70.0, R_nm=R)  # never pulls off
    assert stays == pytest.approx(0.0, abs=1e-10)


def test_schwarz_transition_is_jkr_without_long_forces_and_has_dmts_pull_off_without_short_ones():
    gaps = np.linspace(-5.0, 0.2, 50)
    short = afm.Schwarz(E_GPa=1.0, w1_N_m=0.05, w2_N_m=0.0, a0_nm=0.3).force_nN(gaps, "contact", R_nm=10.0)
    np.testing.assert_allclose(short, afm.JKR(E_GPa=1.0, w_N_m=0.05).force_nN(gaps, "contact", R_nm=10.0), rtol=1e-13)
    law = afm.Schwarz(E_GPa=1.0, w1_N_m=1e-9, w2_N_m=0.05, a0_nm=0.3, check=False)
    hertz = afm.Hertz(E_GPa=1.0).force_nN(gaps[gaps < -0.5], R_nm=10.0)
    long = law.force_nN(gaps[gaps < -0.5], "contact", R_nm=10.0)
    np.testing.assert_allclose(long, hertz - 2.0 * math.pi * 10.0 * 0.05, rtol=0.0, atol=1e-2)
    assert float(law.force_nN(0.3, "far", R_nm=10.0)) == pytest.approx(-0.5 * math.pi * 10.0 * 0.05, rel=1e-13)


def test_a_neck_costs_the_area_between_both_ways_whatever_it_touches():
    neck = afm.Neck(gamma_N_m=0.072, h_nm=1.0, on_nm=1.0, off_nm=3.0)
    wanted = 4.0 * math.pi * 0.072 * 20.0 * (1.0 / 2.0 - 1.0 / 4.0) * EV
    assert wanted == pytest.approx(28.23592184, rel=1e-9)
    alone = neck.energy_per_cycle_eV(Zc_nm=10.0, A_nm=9.5, f_kHz=70.0, R_nm=20.0)
    assert alone == pytest.approx(wanted, rel=1e-11)
    law = afm.VanDerWaals(H_aJ=0.1, a0_nm=0.3) + afm.DMT(E_GPa=1.0) + neck
    deep = law.energy_per_cycle_eV(Zc_nm=10.0, A_nm=14.0, f_kHz=70.0, R_nm=20.0)  # through the pole of the neck's force
    assert deep == pytest.approx(wanted, rel=1e-9)
    assert neck.energy_per_cycle_eV(Zc_nm=2.0, A_nm=0.9, f_kHz=70.0, R_nm=20.0) == 0.0  # between both gaps
    with pytest.raises(InputError, match="above on_nm"):
        afm.Neck(gamma_N_m=0.072, h_nm=1.0, on_nm=1.0, off_nm=0.5)


def test_lennard_jones_is_least_where_its_slope_vanishes():
    law = afm.LennardJones(H_aJ=0.2, sigma_nm=0.34)
    least = (2.0 / 15.0) ** (1.0 / 6.0) * 0.34
    force = law.force_nN(least * np.array([0.999, 1.0, 1.001]), R_nm=10.0)
    assert force[1] == pytest.approx(-0.2 * 10.0 / 8.0 / least**2, rel=1e-13)  # (1/4 - 1) H R/(6 D^2)
    assert force[1] < min(force[0], force[2])


def test_a_bonds_force_is_the_slope_of_its_potential():
    law, U, length, D0 = afm.Morse(U_aJ=0.4, l_nm=0.1, D0_nm=0.3), 0.4, 0.1, 0.3

    def potential(D):
        u = (D - D0) / length
        return U * (cmath.exp(-2.0 * u) - 2.0 * cmath.exp(-u))

    for D in (0.25, 0.3, 0.37, 0.6):
        slope = potential(complex(D, 1e-30)).imag / 1e-30
        assert float(law.force_nN(D)) == pytest.approx(-slope, rel=1e-13, abs=1e-13)
    assert float(law.force_nN(D0 + length * math.log(2.0))) == pytest.approx(-U / (2.0 * length), rel=1e-13)


def test_double_layers_in_si_units():
    law = afm.DLVO(tip_mC_m2=-20.0, sample_mC_m2=-30.0, debye_nm=3.0, H_aJ=0.0)
    eps = 78.36 * 8.8541878128e-12
    newton = 4.0 * math.pi * 15e-9 * 3e-9 * 20e-3 * 30e-3 / eps * math.exp(-2.0)
    assert float(law.force_nN(6.0, R_nm=15.0)) == pytest.approx(newton * 1e9, rel=1e-13)
    attracted = afm.DLVO(tip_mC_m2=20.0, sample_mC_m2=-30.0, debye_nm=3.0, H_aJ=0.01)
    assert float(attracted.force_nN(6.0, R_nm=15.0)) == pytest.approx(-newton * 1e9 - 0.01 * 15.0 / 216.0, rel=1e-13)


# sums


def test_laws_that_touch_at_one_gap_share_their_regions():
    law = afm.VanDerWaals(H_aJ=0.2, a0_nm=0.3) + afm.DMT(E_GPa=1.0) + afm.Dashpot(c_uNs_m=1.0)
    assert list(law.regions) == ["far", "contact"]
    assert [(one.source, one.target, one.direction) for one in law.crossings] == [
        ("far", "contact", -1), ("contact", "far", 1),
    ]  # fmt: skip
    assert law.parameters == {"H_aJ": 0.2, "a0_nm": 0.3, "E_GPa": 1.0, "c_uNs_m": 1.0}


def test_regions_that_no_motion_reaches_are_dropped():
    law = afm.VanDerWaals(H_aJ=0.2, a0_nm=0.3) + afm.DMT(E_GPa=1.0)
    law += afm.Neck(gamma_N_m=0.02, h_nm=0.5, on_nm=0.6, off_nm=1.5)
    assert list(law.regions) == ["far_dry", "far_wet", "contact_wet"]  # no contact without a neck
    early = afm.VanDerWaals(H_aJ=0.2, a0_nm=0.3) + afm.Neck(gamma_N_m=0.02, h_nm=0.5, on_nm=0.1, off_nm=1.5)
    assert list(early.regions) == ["far_dry", "contact_dry", "contact_wet", "far_wet"]
    assert "D_nm - a0_nm" in law.regions["far_dry"].domain  # other values may change the order of the gaps


def test_a_neck_in_contact_sees_the_distance_of_the_surfaces():
    law = afm.VanDerWaals(H_aJ=0.0, a0_nm=0.3) + afm.Neck(gamma_N_m=0.02, h_nm=0.5, on_nm=0.6, off_nm=1.5)
    force = law.force_nN([-3.0, -0.5, 0.3], R_nm=20.0)
    np.testing.assert_allclose(force, -4.0 * math.pi * 0.02 * 20.0 / 1.6**2, rtol=1e-13)


def test_a_dashpot_follows_the_contact_that_it_is_added_to():
    levels = {
        "a0_nm": afm.VanDerWaals(H_aJ=0.2, a0_nm=0.3) + afm.Dashpot(c_uNs_m=1.0),
        "0": afm.Hertz(E_GPa=1.0) + afm.Dashpot(c_uNs_m=1.0),
    }
    for level, law in levels.items():
        assert {one.level for one in law.crossings} == {level}
    assert float((levels["0"]).force_nN(0.1, R_nm=10.0, V_nm_us=-2.0)) == 0.0
    above = afm.Neck(gamma_N_m=0.02, h_nm=0.5, on_nm=0.6, off_nm=1.5) + afm.Dashpot(c_uNs_m=1.0)
    assert [one.level for one in above.crossings if one.name == "touch"] == ["0"]  # a neck is no contact
    hysteretic = afm.JKR(E_GPa=1.0, w_N_m=0.05) + afm.Dashpot(c_uNs_m=1.0)
    assert list(product(hysteretic.parts, 10.0).regions) == ["far", "contact", "contact_far"]


@dataclass(frozen=True, kw_only=True)
class Softening(afm.Law):
    """A law with the same state as that of the standard linear solid."""

    rate_1_us: float

    @property
    def regions(self):
        return {"everywhere": afm.Region(states={"y_nm": "-rate_1_us*y_nm"})}


def test_one_name_has_one_value_in_a_sum():
    with pytest.raises(InputError, match="one value in all laws of a sum"):
        (afm.VanDerWaals(H_aJ=0.2, a0_nm=0.3) + afm.DMT(E_GPa=1.0, a0_nm=0.2)).force_nN(1.0, R_nm=10.0)
    with pytest.raises(InputError, match="a0_nm = None: must be given by one of the laws"):
        afm.DMT(E_GPa=1.0).force_nN(1.0, R_nm=10.0)
    with pytest.raises(InputError, match="R_nm may be given by the probe"):
        afm.Hertz(E_GPa=1.0).force_nN(-1.0)
    solid = afm.SLS(k1_N_m=1.0, k2_N_m=1.0, c_uNs_m=1.0)
    with pytest.raises(InputError, match="states that no other law has"):
        (solid + Softening(rate_1_us=1.0)).force_nN(1.0, "far", R_nm=1.0)
    with pytest.raises(InputError, match="without states of its own"):
        solid.force_nN(1.0)
    with pytest.raises(TypeError):
        solid + 1.0


def test_a_force_does_not_count_twice():
    attraction, jkr = afm.VanDerWaals(H_aJ=0.2, a0_nm=0.3), afm.JKR(E_GPa=1.0, w_N_m=0.05)
    with pytest.raises(InputError, match="law = 'JKR \\+ JKR': must be with JKR once; its force would count twice"):
        (jkr + jkr).force_nN(1.0, R_nm=10.0)
    with pytest.raises(InputError, match="must be with one of JKR, DMT; the elastic force would count twice"):
        (jkr + attraction + afm.DMT(E_GPa=1.0)).force_nN(1.0, R_nm=10.0)


@dataclass(frozen=True, kw_only=True)
class DampedPole(afm.Law):
    F_nN: float

    @property
    def regions(self):
        return {"everywhere": afm.Region("-F_nN/separation_nm**2*(1 + V_nm_us) + F_nN*D_nm")}


@pytest.mark.parametrize("contact", [afm.Hertz(E_GPa=1.0), afm.JKR(E_GPa=1.0, w_N_m=0.05)])
def test_a_pole_where_surfaces_touch_is_told(contact):
    pole = afm.DLVO(tip_mC_m2=-20.0, sample_mC_m2=-30.0, debye_nm=3.0, H_aJ=0.01)
    for law in (pole, afm.LennardJones(H_aJ=0.1, sigma_nm=0.34)):
        with pytest.raises(InputError, match="touch at separation 0; its force is infinite there"):
            (contact + law).force_nN(1.0, R_nm=10.0)
    goes = "take DampedPole\\(...\\) \\+ DMT\\(E_GPa=1, a0_nm=0.3\\), which touches at its cut-off a0_nm"
    with pytest.raises(InputError, match=f"'DampedPole': .* its force is infinite there; {goes}"):
        (contact + DampedPole(F_nN=1.0)).force_nN(1.0, R_nm=10.0)
    assert list((contact + afm.Hydration(F_nN=1.0, l_nm=0.3)).regions) == ["far", "contact"]


def test_a_tip_of_another_shape_is_offered_with_its_cut_off():
    pole, cone = afm.DLVO(tip_mC_m2=-20.0, sample_mC_m2=-30.0, debye_nm=3.0, H_aJ=0.01), {"E_GPa": 1.0}
    with pytest.raises(InputError, match="take DLVO\\(...\\) \\+ Cone\\(..., a0_nm=0.3\\)"):
        (pole + afm.Cone(**cone, half_angle_deg=20.0)).force_nN(1.0, R_nm=10.0)
    law = pole + afm.Cone(**cone, half_angle_deg=45.0, a0_nm=0.3)
    found = law.force_nN([0.3, -1.7], R_nm=10.0)
    np.testing.assert_allclose(np.diff(found), 2.0 / math.pi * 4.0, rtol=1e-13)


def test_lengths_of_two_laws_that_mean_different_things_have_two_names():
    bond, water = afm.Morse(U_aJ=0.4, l_nm=0.1, D0_nm=0.3), afm.Hydration(F_nN=1.0, l_nm=0.3)
    both, gaps = bond + water, np.array([0.2, 0.5, 2.0])
    assert both.parameters == {"U_aJ": 0.4, "l_nm": 0.1, "D0_nm": 0.3, "F_nN": 1.0, "l_nm_2": 0.3}
    np.testing.assert_allclose(both.force_nN(gaps), bond.force_nN(gaps) + water.force_nN(gaps), rtol=1e-14)
    assert (water + bond).parameters["l_nm"] == 0.3
    with pytest.raises(InputError, match="one value in all laws of a sum"):
        (afm.VanDerWaals(H_aJ=0.2, a0_nm=0.3) + afm.LennardJones(H_aJ=0.1, sigma_nm=0.3)).force_nN(1.0, R_nm=1.0)


def test_a_force_outside_of_the_domain_of_a_law_is_told():
    law = afm.DLVO(tip_mC_m2=-20.0, sample_mC_m2=-30.0, debye_nm=3.0, H_aJ=0.01)
    with pytest.raises(InputError, match="D_nm = -1.0: must be in the domain of the law.*D_nm > 0"):
        law.force_nN([1.0, -1.0], R_nm=10.0)


def test_a_law_with_a_pole_has_in_contact_the_force_of_the_separation_that_remains():
    pole = afm.DLVO(tip_mC_m2=-20.0, sample_mC_m2=-30.0, debye_nm=3.0, H_aJ=0.01)
    law = pole + afm.DMT(E_GPa=1.0, a0_nm=0.3)
    elastic = 4.0 / 3.0 * math.sqrt(10.0) * np.array([0.0, 1.3]) ** 1.5
    found = law.force_nN([0.3, -1.0], R_nm=10.0)
    np.testing.assert_allclose(found, float(pole.force_nN(0.3, R_nm=10.0)) + elastic, rtol=1e-13)


def test_attraction_and_a_solid_whose_surface_moves_have_crossings_with_names_of_their_own():
    law = afm.VanDerWaals(H_aJ=0.1, a0_nm=0.3) + afm.SLS(k1_N_m=2.0, k2_N_m=4.0, c_uNs_m=5.0)
    assert len({one.name for one in law.crossings}) == len(law.crossings) == 8


def test_two_crossings_at_one_gap_are_refused():
    law = afm.VanDerWaals(H_aJ=0.2, a0_nm=0.3) + afm.Neck(gamma_N_m=0.02, h_nm=0.5, on_nm=0.3, off_nm=1.5)
    with pytest.raises(InputError, match="a0_nm and on_nm.*two events coincide"):
        law.force_nN(1.0, R_nm=10.0)


def test_parameters_that_must_not_vanish_are_refused():
    with pytest.raises(InputError, match="E_GPa"):
        afm.JKR(E_GPa=0.0, w_N_m=0.05)
    with pytest.raises(InputError, match="c_uNs_m"):
        afm.SLS(k1_N_m=1.0, k2_N_m=1.0, c_uNs_m=0.0)
    with pytest.raises(InputError, match="form"):
        afm.KelvinVoigt(eta_Pa_s=1.0, form="rough")
    assert afm.Hertz(E_GPa=0.0).parameters == {"E_GPa": 0.0}


@dataclass(frozen=True, kw_only=True)
class Wall(afm.Law):
    """A linear spring below a gap of its own."""

    stiffness: float
    place_nm: float

    @property
    def regions(self):
        return {"off": afm.Region(), "on": afm.Region("stiffness*(place_nm - D_nm)", indentation="place_nm - D_nm")}

    @property
    def crossings(self):
        return afm.Crossing("off", "on", "place_nm", -1, "hit"), afm.Crossing("on", "off", "place_nm", 1, "leave")


def test_a_law_of_ones_own_is_checked():
    with pytest.raises(InputError, match="the gap falls"):
        afm.Crossing("off", "on", "place_nm", 0, "hit")

    class Lost(Wall):
        @property
        def crossings(self):
            return (afm.Crossing("off", "inside", "place_nm", -1, "hit"),)

    class Empty(Wall):
        @property
        def regions(self):
            return {}

    with pytest.raises(InputError, match="end of crossing 'hit' = 'inside': must be one of off, on"):
        Lost(stiffness=1.0, place_nm=1.0).force_nN(0.0)
    with pytest.raises(InputError, match="one region or more"):
        Empty(stiffness=1.0, place_nm=1.0).force_nN(0.0)
    probe = afm.Probe(k_N_m=1.0, f0_kHz=10.0, Q=5.0, R_nm=10.0)

    @dataclass(frozen=True, kw_only=True)
    class Greedy(Wall):
        Q: float

    with pytest.raises(InputError, match="without names of the probe"):
        afm.model(probe, Greedy(stiffness=1.0, place_nm=1.0, Q=2.0), afm.Drive(1.0), Zc_nm=3.0)


@dataclass(frozen=True, kw_only=True)
class Cushion(afm.Law):
    """An exponential repulsion that counts as contact below a gap."""

    strength_nN: float
    near_nm: float
    contact = "near_nm"

    @property
    def regions(self):
        return {"everywhere": afm.Region("strength_nN*exp(-D_nm)")}


def test_a_law_of_ones_own_tells_what_contact_is():
    split = Cushion(strength_nN=1.0, near_nm=0.7) + afm.Hydration(F_nN=1.0, l_nm=1.0)
    assert [region.indentation for region in split.regions.values()] == ["", "near_nm - D_nm"]
    np.testing.assert_allclose(split.force_nN([0.7, 0.5]), 2.0 * np.exp([-0.7, -0.5]), rtol=1e-14)

    class Told(Wall):
        contact = "place_nm"

        @property
        def regions(self):
            return {"off": afm.Region(), "on": afm.Region("stiffness*(place_nm - D_nm)")}

    law = Told(stiffness=3.0, place_nm=1.0) + afm.Dashpot(c_uNs_m=1.0)
    assert [region.indentation for region in law.regions.values()] == ["", "place_nm - D_nm"]

    class Elsewhere(Told):
        contact = "0"

    with pytest.raises(InputError, match="a law with a crossing at its gap of contact, 0"):
        (Elsewhere(stiffness=3.0, place_nm=1.0) + afm.Hydration(F_nN=1.0, l_nm=2.0)).force_nN(1.0)


@pytest.mark.campaign
def test_the_share_of_contact_of_a_law_of_ones_own_is_that_of_the_gap():
    probe = afm.Probe(k_N_m=1.0, f0_kHz=10.0, Q=5.0, R_nm=10.0)
    system = afm.model(probe, Cushion(strength_nN=1.0, near_nm=0.7), afm.Drive(5.0), Zc_nm=5.0)
    orbit = saltus.find_orbit(system, x0=[0.0, 0.0])

    def rates(t, s):
        w = 2e-2 * math.pi
        force = math.exp(-(5.0 + s[0])) + 5.0 / 5.0 * math.cos(w * t)
        return [s[1], w**2 * (force - s[0]) - w / 5.0 * s[1]]

    times = (np.arange(20000) + 0.5) / 20000 * 100.0 + 3000.0
    settled = solve_ivp(rates, (0.0, 3100.0), [0.0, 0.0], "DOP853", times, rtol=1e-10, atol=1e-12).y[0]
    below = float(np.mean(5.0 + settled < 0.7))
    assert 0.0 < below < 1.0
    assert afm.observables(orbit)["contact_fraction"] == pytest.approx(below, abs=2e-4)


def test_a_law_of_ones_own_adds_to_others():
    law = Wall(stiffness=3.0, place_nm=1.0) + afm.Hydration(F_nN=1.0, l_nm=2.0)
    np.testing.assert_allclose(law.force_nN([2.0, 0.0]), [math.exp(-1.0), 3.0 + 1.0], rtol=1e-14)
    assert law.energy_per_cycle_eV(Zc_nm=2.0, A_nm=4.0, f_kHz=1.0) == pytest.approx(0.0, abs=1e-12)
    system = afm.model(afm.Probe(k_N_m=1.0, f0_kHz=10.0, Q=5.0, R_nm=10.0), law, afm.Drive(1.0), Zc_nm=3.0)
    assert system.mode_names == ("off", "on")
    assert system.transition_names == ("hit", "leave")
    assert system.parameters["place_nm"] == 1.0


@pytest.mark.parametrize("until", ["surface", "pull_off"])
def test_a_dashpot_beside_an_adhesive_contact_ends_where_it_is_told(until):
    """The loop of the force is integrated from the closed forms of JKR, and of the dashpot over its stretch."""
    R, E, w, c, Zc, A, f = 10.0, 1.0, 0.05, 2.0, 19.0, 20.0, 300.0
    law = afm.JKR(E_GPa=E, w_N_m=w) + afm.Dashpot(c_uNs_m=c, until=until)
    pull_off = 3.0 * (math.pi * R**2 * w / (8.0 * E)) ** (2.0 / 3.0) / R
    begin = math.acos(-Zc / A)
    end = 2.0 * math.pi - math.acos(((pull_off if until == "pull_off" else 0.0) - Zc) / A)
    omega = 2e-3 * math.pi * f
    viscous = c * A**2 * omega * quad(lambda s: math.sin(s) ** 2, begin, end)[0]
    adhesive = (0.15 * 2.0 ** (8.0 / 3.0) + 0.1) * math.pi ** (5.0 / 3.0) * (w**5 * R**4 / E**2) ** (1.0 / 3.0)
    found = law.energy_per_cycle_eV(Zc_nm=Zc, A_nm=A, f_kHz=f, R_nm=R)
    assert found == pytest.approx((viscous + adhesive) / 0.1602176634, rel=1e-8)


def test_forces_at_many_gaps_are_asked_once_a_region(monkeypatch):
    """Each gap has the force of the region in which a tip from afar is, as each alone has it."""
    law = afm.VanDerWaals(H_aJ=0.1, a0_nm=0.3) + afm.DMT(E_GPa=1.0)
    law = law + afm.Neck(gamma_N_m=0.072, h_nm=1.0, on_nm=1.0, off_nm=3.0)
    gaps = np.linspace(-0.5, 4.0, 60).reshape(3, 20)
    alone = [float(law.force_nN(gap, R_nm=20.0)) for gap in gaps.ravel()]
    asked, force = [], ForceTable.force
    monkeypatch.setattr(ForceTable, "force", lambda *these: asked.append(these[-1]) or force(*these))
    np.testing.assert_array_equal(law.force_nN(gaps, R_nm=20.0), np.reshape(alone, gaps.shape))
    assert len(asked) == len(set(asked)) <= len(law.regions)
