"""Menisci, voltages and magnets: the bridge's own geometry, an exact series, the force between two loops of current."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk, ellipkm1

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


def tip(**changes):
    return afm.ElectrostaticTip(**{"bias_V": 1.0, "half_angle_deg": 15.0, "cone_height_nm": 1e4, **changes})


def test_a_cone_s_flank_feels_the_field_of_the_cone_that_touches_the_flat():
    """At the height Z the field is that of a cone from the flat through this place, exact for an endless cone."""
    R, angle, height, D = 20.0, math.radians(15.0), 3e3, 7.0
    joint = D + R * (1.0 - math.sin(angle))

    def pull(Z):
        field = math.cos(angle) / (Z * math.sin(angle) * math.log(math.tan(angle / 2.0)))
        radius = R * math.cos(angle) + (Z - joint) * math.tan(angle)
        return 0.5 * EPS0 * field**2 * 2.0 * math.pi * radius * math.tan(angle)

    flank = quad(pull, joint, joint + height, limit=200)[0]
    sphere = math.pi * EPS0 * R**2 * (1.0 - math.sin(angle)) / (D * joint)
    found = float(tip(cone_height_nm=height).force_nN(D, R_nm=R))
    assert found == pytest.approx(-(sphere + flank), rel=1e-10)


def test_a_tip_with_a_long_cone_has_the_force_in_print():
    """Hudlet 1998: the sphere's term and k**2 (log(H/Z) - 1 + R cos(a)**2/(sin(a) Z)), for gaps far below H."""
    R, H = 20.0, 1e6
    for degrees, D in ((10.0, 2.0), (25.0, 40.0)):
        a = math.radians(degrees)
        Z = D + R * (1.0 - math.sin(a))
        flank = math.log(H / Z) - 1.0 + R * math.cos(a) ** 2 / (math.sin(a) * Z)
        both = R**2 * (1.0 - math.sin(a)) / (D * Z) + flank / math.log(math.tan(a / 2.0)) ** 2
        law = tip(half_angle_deg=degrees, cone_height_nm=H, bias_V=2.0, cpd_V=1.0)
        assert float(law.force_nN(D, R_nm=R)) == pytest.approx(-math.pi * EPS0 * both, rel=1e-3)
    with pytest.raises(InputError, match="half_angle_deg"):
        tip(half_angle_deg=90.0)


def panels(D, R, angle, height):
    """Ends of a tip's panels in the half plane, up the sphere and flank and over a lid; number of the lid's first."""
    steep = math.asinh(3.0 / math.sqrt(min(1.0, D / R)))
    turn = (math.pi / 2.0 - angle) * np.sinh(steep * np.linspace(0.0, 1.0, 71)) / math.sinh(steep)
    along = np.geomspace(0.1 * R, height + 0.1 * R, 71) - 0.1 * R
    near_top = height - (np.geomspace(1e-4, 0.3, 35) - 1e-4) * height
    along = np.unique(np.concatenate([along[along < 0.7 * height], near_top]))[1:]
    r = np.concatenate([R * np.sin(turn), R * math.cos(angle) + along * math.tan(angle)])
    z = np.concatenate([D + R * (1.0 - np.cos(turn)), D + R * (1.0 - math.sin(angle)) + along])
    lid = r[-1] * (1.0 - np.geomspace(1e-4, 1.0, 35))
    return np.array([np.concatenate([r, lid]), np.concatenate([z, np.full(35, z[-1])])]), len(r) - 1


def exact_tip(D, R, angle, height):
    """Force at 1 V on sphere and flank by charges on rings, with their images in the flat."""
    places, lid = panels(D, R, angle, height)
    begin, end = places[:, :-1], places[:, 1:]
    middle, length = 0.5 * (begin + end), np.hypot(*(end - begin))

    def potential(ring, z):
        far = (middle[0][:, None] + ring) ** 2 + (middle[1][:, None] - z) ** 2
        near = (middle[0][:, None] - ring) ** 2 + (middle[1][:, None] - z) ** 2
        return ring * ellipkm1(near / far) / (math.pi * EPS0 * np.sqrt(far))

    roots, weights = np.polynomial.legendre.leggauss(16)
    matrix = np.zeros((len(length), len(length)))
    for t, weight in zip(0.5 * (roots + 1.0), 0.5 * weights, strict=True):  # denser at the middle, for the logarithm
        for side in (-0.5, 0.5):
            r, z = middle + side * t**2 * (end - begin)
            matrix += weight * t * length * (potential(r, z) - potential(r, -z))
    charge = np.linalg.solve(matrix, np.ones(len(length)))
    pull = charge**2 / EPS0 * math.pi * middle[0] * (end - begin)[0]
    return -float(pull[:lid].sum())


@pytest.mark.campaign
def test_a_tip_s_force_has_the_exact_slope_within_12_percent():
    R, step = 20.0, 0.05
    for degrees, bound in ((10.0, 0.18), (15.0, 0.12), (30.0, 0.12)):
        for D in (1.0, 10.0, 30.0, 300.0):
            ends = D * (1.0 - step), D * (1.0 + step)
            exact = [exact_tip(one, R, math.radians(degrees), 1e4) for one in ends]
            told = tip(half_angle_deg=degrees).force_nN(ends, R_nm=R)
            assert told[1] - told[0] == pytest.approx(exact[1] - exact[0], rel=bound)


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
        tip(),
        afm.MagneticDipoles(tip_A_nm2=50.0, sample_A_nm2=80.0, centres_nm=30.0),
    ],
    ids=lambda law: type(law).__name__,
)
def test_fields_lose_nothing(law):
    assert law.energy_per_cycle_eV(Zc_nm=22.0, A_nm=20.0, f_kHz=70.0, R_nm=10.0) == pytest.approx(0.0, abs=1e-12)
