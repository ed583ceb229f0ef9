"""Thin samples against a numerical solution of the layer's integral equation, and against formulas in print.

A layer of thickness 1 under a pressure: ``phi(t) - 1/pi int_-a^a K(t - s) phi(s) ds = q - profile(t)`` with
``K(u) = int_0^inf (1 - L(w)) cos(w u) dw``. The depth q makes ``phi(a) = 0`` for a tip without an edge. The force is
``2 E int_0^a phi dt``. Nothing is expanded here.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from scipy.optimize import brentq

from saltus import afm
from saltus.errors import InputError

FAR = 30.0  # wavenumbers up to which 1 - L counts: it falls as exp(-2 w)
WAVES = np.polynomial.legendre.leggauss(120)
POINTS = np.polynomial.legendre.leggauss(30)
GARCIA = {"sphere": (1.133, 1.497, 1.469, 0.755), "cone": (0.721, 0.650, 0.491, 0.225)}
GARCIA_PUNCH = (1.133, 1.283, 0.598, -0.291)


def compliance(w, nu, support):
    """The layer's answer to a pressure of wavenumber w, that of a half space being 1."""
    if support == "slipping":
        return (np.cosh(2.0 * w) - 1.0) / (np.sinh(2.0 * w) + 2.0 * w)
    kappa = 3.0 - 4.0 * nu
    below = 2.0 * kappa * np.cosh(2.0 * w) + 1.0 + kappa**2 + 4.0 * w**2
    return (2.0 * kappa * np.sinh(2.0 * w) - 4.0 * w) / below


@cache
def layer(a, shape, nu, support):
    """Depth and force of a contact of radius a, in units of the thickness and at modulus 1; at depth 1 for a punch."""
    w = FAR / 2.0 * (WAVES[0] + 1.0)
    kernel = (1.0 - compliance(w, nu, support)) * FAR / 2.0 * WAVES[1]
    half, size = POINTS
    t, size = a / 2.0 * (half + 1.0), a / 2.0 * size  # phi is even: both halves at once
    waves, end = np.cos(np.outer(t, w)), np.cos(a * w)
    matrix = np.eye(t.size) - 2.0 / math.pi * (waves * kernel) @ waves.T * size
    row = 2.0 / math.pi * (end * kernel) @ waves.T * size
    profile = {"sphere": lambda r: r**2, "cone": lambda r: math.pi / 2.0 * r, "punch": lambda r: 0.0 * r}[shape]
    level, bent = np.linalg.solve(matrix, np.ones(t.size)), np.linalg.solve(matrix, profile(t))
    depth = 1.0 if shape == "punch" else (profile(a) + row @ bent) / (1.0 + row @ level)
    return depth, 2.0 * float(size @ (depth * level - bent))


def ratios(radii, shape, nu, support, thickness=500.0):
    """Forces of the laws over those of the layer, for a paraboloid of R = thickness, a cone of 45 degrees, a punch."""
    common = {"E_GPa": 1e-5, "thickness_nm": thickness, "nu": nu, "support": support}
    depths, forces = np.array([layer(a, shape, nu, support) for a in radii]).T
    if shape == "punch":
        laws = [afm.ThinPunch(punch_nm=a * thickness, **common) for a in radii]
        found = [float(law.force_nN(-thickness)) for law in laws]
    else:
        law = afm.ThinSphere(**common) if shape == "sphere" else afm.ThinCone(half_angle_deg=45.0, **common)
        found = law.force_nN(-depths * thickness, "contact", R_nm=thickness)
    return np.array(found) / (1e-5 * thickness**2 * forces)


KINDS = [("bonded", 0.0), ("bonded", 0.3), ("bonded", 0.5), ("slipping", 0.2)]


@pytest.mark.parametrize(("support", "nu"), KINDS)
@pytest.mark.parametrize("shape", ["sphere", "cone", "punch"])
def test_the_rest_of_the_series_is_of_the_fifth_order(shape, support, nu):
    errors = np.abs(ratios((0.05, 0.1, 0.2), shape, nu, support) - 1.0)
    assert errors[:2].max() < 2e-5  # the fits of the moments
    assert errors[2] < 2e-4


@pytest.mark.parametrize(("support", "nu"), KINDS)
@pytest.mark.parametrize(("shape", "most"), [("sphere", 0.55), ("cone", 0.8), ("punch", 0.7)])
def test_the_series_is_within_its_stated_error_up_to_its_limit(shape, most, support, nu):
    inside = {"sphere": lambda d, a: math.sqrt(d), "cone": lambda d, a: d, "punch": lambda d, a: a}[shape]
    radii = [a for a in np.arange(0.1, 0.751, 0.1) if inside(layer(a, shape, nu, support)[0], a) <= most]
    radii += [] if shape == "punch" else [brentq(lambda a: inside(layer(a, shape, nu, support)[0], a) - most, 0.3, 0.9)]
    errors = np.abs(ratios(np.array(radii) * (1.0 - 1e-9), shape, nu, support) - 1.0)
    assert errors.max() < 0.025
    assert shape == "punch" or errors[-1] > 3e-3  # the limit is where the error begins to count


@pytest.mark.parametrize("ratio", [0.1, 0.3, 1.0, 3.0, 10.0])
def test_a_sphere_of_any_size_follows_the_integral_equation(ratio):
    """Thickness over radius from 0.1 to 10: lengths along the surface scale with sqrt(R t), R d/t**2 is what counts."""
    R, a = 1000.0, 0.25
    law, thickness = afm.ThinSphere(E_GPa=1e-5, thickness_nm=ratio * 1000.0), ratio * 1000.0
    depth, force = layer(a, "sphere", 0.5, "bonded")
    found = float(law.force_nN(-depth * thickness**2 / R, R_nm=R))
    assert found == pytest.approx(force * 1e-5 * thickness**3 / R, rel=5e-4)


@pytest.mark.parametrize("shape", ["sphere", "cone"])
def test_formulas_in_print_agree_to_what_their_moments_allow(shape):
    depth, force = layer(0.2, shape, 0.5, "bonded")
    x = math.sqrt(depth) if shape == "sphere" else depth
    thick = 4.0 / 3.0 * depth**1.5 if shape == "sphere" else 2.0 / math.pi * depth**2
    assert thick * np.polyval([*GARCIA[shape][::-1], 1.0], x) == pytest.approx(force, rel=2e-3)
    if shape == "sphere":  # Dimitriadis et al. (2002), whose second order lacks the growth of the contact
        assert thick * np.polyval([0.0975, 0.769, 1.283, 1.133, 1.0], x) / force - 1.0 == pytest.approx(
            -0.0088, abs=2e-3
        )


def test_the_punch_in_print_agrees_too():
    assert 2.0 * 0.3 * np.polyval([*GARCIA_PUNCH[::-1], 1.0], 0.3) == pytest.approx(
        layer(0.3, "punch", 0.5, "bonded")[1], rel=4e-3
    )  # its m0 is 0.5 % larger


def test_a_thick_sample_is_a_half_space():
    thin = afm.ThinSphere(E_GPa=0.01, thickness_nm=1e7), afm.ThinCone(E_GPa=0.01, thickness_nm=1e7, half_angle_deg=30.0)
    thick = afm.Hertz(E_GPa=0.01), afm.Cone(E_GPa=0.01, half_angle_deg=30.0)
    for layered, whole in zip(thin, thick, strict=True):
        np.testing.assert_allclose(
            layered.force_nN([-1.0, -30.0], R_nm=50.0), whole.force_nN([-1.0, -30.0], R_nm=50.0), rtol=1e-5
        )


def test_a_law_outside_of_its_validity_is_told():
    with pytest.raises(InputError, match=r"D_nm = -400.0: .*not valid: its domain .*0.55\*thickness_nm"):
        afm.ThinSphere(E_GPa=1e-5, thickness_nm=1000.0).force_nN([-100.0, -400.0], R_nm=1000.0)
    with pytest.raises(InputError, match=r"not valid: its domain .*0.8 - "):
        afm.ThinCone(E_GPa=1e-5, thickness_nm=100.0, half_angle_deg=45.0).energy_per_cycle_eV(
            Zc_nm=100.0, A_nm=200.0, f_kHz=5.0
        )
    with pytest.raises(InputError, match="punch_nm = 800.0: must be at most 0.7 of thickness_nm = 1000.0"):
        afm.ThinPunch(E_GPa=1e-5, punch_nm=800.0, thickness_nm=1000.0)
    with pytest.raises(InputError, match="nu = 0.6: must be at most 0.5"):
        afm.ThinSphere(E_GPa=1e-5, thickness_nm=1000.0, nu=0.6, check=False)
    with pytest.raises(InputError, match="support"):
        afm.ThinSphere(E_GPa=1e-5, thickness_nm=1000.0, support="glued")
