"""Menisci, voltages and magnets: the bridge's own geometry, an exact series, the force between two loops of current."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

from saltus import afm
from saltus.errors import InputError

EV = 1.0 / 0.1602176634  # eV in 1 aJ
EPS0 = 8.8541878128e-3  # nN/V^2


@pytest.mark.parametrize("angle", [0.0, 40.0])
def test_a_meniscus_pulls_as_a_bridge_of_its_volume(angle):
    """The bridge's rim at the radius r is where its volume is used up; its height there sets the pressure."""
    gamma, V, R, phi = 0.05, 300.0, 50.0, math.radians(angle)
    law = afm.Meniscus(gamma_N_m=gamma, V_nm3=V, on_nm=1.0, contact_angle_deg=angle)

    def volume(r, D):
        return quad(lambda x: 2.0 * math.pi * x * (D + x**2 / (2.0 * R)), 0.0, r)[0]

    for D in (0.0, 0.3, 2.0):
        rim = brentq(lambda r, D=D: volume(r, D) - V, 0.0, 1e3)
        pressure = 2.0 * gamma * math.cos(phi) / (D + rim**2 / (2.0 * R))
        assert float(law.force_nN(D, "wet", R_nm=R)) == pytest.approx(-math.pi * rim**2 * pressure, rel=1e-9)


def test_a_meniscus_costs_the_area_between_both_ways():
    gamma, V, R, on = 0.072, 50.0, 20.0, 0.5
    law = afm.Meniscus(gamma_N_m=gamma, V_nm3=V, on_nm=on)
    end = V ** (1.0 / 3.0)
    area = quad(lambda D: -float(law.force_nN(D, "wet", R_nm=R)), on, end, epsabs=1e-11)[0]
    found = law.energy_per_cycle_eV(Zc_nm=20.2, A_nm=20.0, f_kHz=70.0, R_nm=R)
    assert found == pytest.approx(area * EV, rel=1e-9)
    assert law.energy_per_cycle_eV(Zc_nm=21.0, A_nm=20.0, f_kHz=70.0, R_nm=R) == 0.0
    with pytest.raises(InputError, match="below 3.68403 nm, where a bridge of this volume breaks"):
        afm.Meniscus(gamma_N_m=gamma, V_nm3=V, on_nm=4.0)


def exact_electrostatic(D, R):
    """Force at 1 V by the images of sphere and plane.

    The capacity is ``4 pi eps0 R sinh(a) sum 1/sinh(n a)`` with ``cosh(a) = 1 + D/R``.
    """

    def slope(a):
        n = np.arange(1, 20000)
        n = n[n * a < 300.0]
        terms = math.cosh(a) / np.sinh(n * a) - math.sinh(a) * n * np.cosh(n * a) / np.sinh(n * a) ** 2
        return terms.sum() / (R * math.sinh(a))

    return 0.5 * 4.0 * math.pi * EPS0 * R * slope(math.acosh(1.0 + D / R))


def test_a_voltage_attracts_within_a_twentieth_of_the_exact_series_and_exactly_far_away():
    law, R = afm.Electrostatic(bias_V=1.0), 20.0
    gaps = np.array([0.5, 2.0, 10.0, 50.0, 300.0])
    exact = [exact_electrostatic(D, R) for D in gaps]
    np.testing.assert_allclose(law.force_nN(gaps, R_nm=R), exact, rtol=0.052)
    assert float(law.force_nN(1e5, R_nm=R)) == pytest.approx(exact_electrostatic(1e5, R), rel=1e-3)
    assert float(law.force_nN(1e-3, R_nm=R)) == pytest.approx(-math.pi * EPS0 * R / 1e-3, rel=1e-4)


def test_a_voltage_counts_from_the_contact_potential_difference():
    at = [float(afm.Electrostatic(bias_V=bias, cpd_V=0.4).force_nN(3.0, R_nm=20.0)) for bias in (0.4, 1.4, -0.6)]
    assert at[0] == 0.0
    assert at[1] < 0.0
    assert at[1] == pytest.approx(at[2], rel=1e-14)


def test_dipoles_attract_as_small_loops_of_current():
    """The mutual inductance of two coaxial loops is Maxwell's, with elliptic integrals; its slope times I**2 is F."""
    mu0, r, current, z = 1256.63706212, 0.5, 100.0, 50.0

    def inductance(z):
        m = 4.0 * r * r / (4.0 * r * r + z * z)
        k = math.sqrt(m)
        return mu0 * r * ((2.0 / k - k) * ellipk(m) - 2.0 / k * ellipe(m))

    moment = current * math.pi * r**2
    law = afm.MagneticDipoles(tip_A_nm2=moment, sample_A_nm2=moment, centres_nm=40.0)
    step = 0.5
    slope = (
        8.0 * (inductance(z + step) - inductance(z - step)) - inductance(z + 2 * step) + inductance(z - 2 * step)
    ) / (12.0 * step)
    assert float(law.force_nN(10.0)) == pytest.approx(current**2 * slope, rel=2e-3)
    opposed = afm.MagneticDipoles(tip_A_nm2=moment, sample_A_nm2=-moment, centres_nm=40.0)
    assert float(opposed.force_nN(10.0)) == -float(law.force_nN(10.0))


@pytest.mark.parametrize(
    "law",
    [
        afm.Electrostatic(bias_V=2.0, cpd_V=0.5),
        afm.MagneticDipoles(tip_A_nm2=50.0, sample_A_nm2=80.0, centres_nm=30.0),
    ],
    ids=lambda law: type(law).__name__,
)
def test_fields_lose_nothing(law):
    assert law.energy_per_cycle_eV(Zc_nm=22.0, A_nm=20.0, f_kHz=70.0, R_nm=10.0) == pytest.approx(0.0, abs=1e-12)
