"""Tips of several shapes: Sneddon's integrals by quadrature, limits, and what follows where shapes join."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from saltus import afm
from saltus.errors import InputError


def sneddon(slope, joins, depth, a_most):
    """Force of a profile with a given slope at a depth, at modulus 1: contact radius and both integrals numerically.

    The substitution r = a sin(x) takes the pole at r = a away.
    """

    def reached(a):
        kinks = sorted(math.asin(join / a) for join in joins if join < a)
        ends = [0.0, *kinks, math.pi / 2.0]
        parts = [quad(lambda x: slope(a * math.sin(x)), *part, epsabs=1e-13, epsrel=1e-12) for part in pairwise(ends)]
        return a * sum(value for value, _ in parts)

    a = brentq(lambda a: reached(a) - depth, 1e-9, a_most, xtol=1e-13, rtol=1e-14)
    kinks = [join for join in joins if join < a]
    return 2.0 * (a * depth - quad(reached, 0.0, a, points=kinks or None, epsabs=1e-11, epsrel=1e-10)[0])


@pytest.mark.parametrize("half_angle", [12.0, 35.0])
def test_a_cone_has_the_force_of_its_profile(half_angle):
    slope = 1.0 / math.tan(math.radians(half_angle))
    law = afm.Cone(E_GPa=2.0, half_angle_deg=half_angle)
    expected = [2.0 * sneddon(lambda r: slope, [], depth, 1e3) for depth in (0.3, 7.0)]
    np.testing.assert_allclose(law.force_nN([-0.3, -7.0]), expected, rtol=1e-9)


@pytest.mark.parametrize("half_angle", [5.0, 20.0, 60.0, 85.0])
def test_a_sphere_on_a_cone_has_the_force_of_its_profile(half_angle):
    R, angle = 10.0, math.radians(half_angle)
    b = R * math.cos(angle)

    def slope(r):
        return r / math.sqrt(R**2 - r**2) if r < b else 1.0 / math.tan(angle)

    join = b * math.atanh(b / R)
    depths = np.array([0.01 * join, 0.9 * join, 1.01 * join, 1.5 * join, 8.0 * join, 100.0 * join])
    law = afm.SphereCone(E_GPa=0.5, half_angle_deg=half_angle)
    expected = [0.5 * sneddon(slope, [b], depth, 1e5) for depth in depths]
    np.testing.assert_allclose(law.force_nN(-depths, R_nm=R), expected, rtol=1e-7)


def test_a_sphere_on_a_cone_is_hertzs_paraboloid_at_small_depths_and_grows_as_a_cone_at_large_ones():
    law, cone = afm.SphereCone(E_GPa=1.0, half_angle_deg=30.0), afm.Cone(E_GPa=1.0, half_angle_deg=30.0)
    small = float(law.force_nN(-1e-3, R_nm=10.0) / afm.Hertz(E_GPa=1.0).force_nN(-1e-3, R_nm=10.0))
    assert small == pytest.approx(1.0, abs=1e-4)  # the sphere's correction is of the order of the depth over R
    ratios = [float(law.force_nN(-d, R_nm=10.0) / cone.force_nN(-d)) for d in (1e3, 1e4)]
    assert 1.0 - ratios[1] == pytest.approx(0.1 * (1.0 - ratios[0]), rel=0.05)  # the blunt end costs a constant depth


def test_the_force_and_its_slope_are_continuous_where_the_cone_touches():
    law = afm.SphereCone(E_GPa=1.0, half_angle_deg=40.0)
    join = 10.0 * math.cos(math.radians(40.0)) * math.atanh(math.cos(math.radians(40.0)))
    away = np.array([-2e-4, -1e-4, 1e-4, 2e-4])
    force = law.force_nN(-join + away, R_nm=10.0)
    assert force[0] - force[1] == pytest.approx(force[2] - force[3], rel=1e-3)
    assert force[1] - force[2] == pytest.approx(2.0 * (force[2] - force[3]), rel=1e-3)
    assert list(law.regions) == ["far", "contact", "flank"]


def test_a_punch_is_a_spring():
    law = afm.FlatPunch(E_GPa=0.1, punch_nm=30.0, a0_nm=0.2)
    np.testing.assert_allclose(law.force_nN([0.5, 0.2, -1.8]), [0.0, 0.0, 2.0 * 0.1 * 30.0 * 2.0], atol=1e-12)


@pytest.mark.parametrize(
    "law",
    [
        afm.Cone(E_GPa=1.0, half_angle_deg=20.0),
        afm.SphereCone(E_GPa=1.0, half_angle_deg=60.0),
        afm.FlatPunch(E_GPa=1.0, punch_nm=10.0),
    ],
    ids=lambda law: type(law).__name__,
)
def test_elastic_contact_loses_nothing(law):
    scale = float(law.force_nN(-5.0, R_nm=10.0)) * 5.0
    lost = law.energy_per_cycle_eV(Zc_nm=15.0, A_nm=20.0, f_kHz=70.0, R_nm=10.0)
    assert lost == pytest.approx(0.0, abs=1e-9 * scale)


def test_attraction_is_added_at_a_common_gap():
    law = afm.VanDerWaals(H_aJ=0.1, a0_nm=0.3) + afm.Cone(E_GPa=1.0, half_angle_deg=45.0, a0_nm=0.3)
    assert list(law.regions) == ["far", "contact"]
    assert float(law.force_nN(-0.7, R_nm=9.0)) == pytest.approx(2.0 / math.pi - 0.1 * 9.0 / 0.54, rel=1e-13)


def test_angles_that_are_none_are_refused():
    with pytest.raises(InputError, match="below 90, where the cone is a plane"):
        afm.Cone(E_GPa=1.0, half_angle_deg=90.0, check=False)
    with pytest.raises(InputError, match="from 5 to 85, the range of the fit"):
        afm.SphereCone(E_GPa=1.0, half_angle_deg=3.0)
    with pytest.raises(InputError, match=r"half_angle_deg = 0.35: .* in rad\? then it is 20.05"):
        afm.Cone(E_GPa=1.0, half_angle_deg=0.35)
    assert "half_angle_deg" not in afm.SphereCone(E_GPa=1.0, half_angle_deg=30.0).parameters
