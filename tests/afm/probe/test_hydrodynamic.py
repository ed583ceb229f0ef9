"""The hydrodynamic function against published values, limits, and the flow's own integral equations."""

from __future__ import annotations

import math

import numpy as np
import pytest

from answers.microscopy import PUBLISHED
from saltus import afm
from saltus.afm.probe.blade_flow import blade_load
from saltus.errors import InputError

EXACT = {logarithm: complex(text.replace(" ", "").replace("i", "j")) for logarithm, text in PUBLISHED.items()}


def test_far_from_walls_it_is_the_published_one():
    found = afm.hydrodynamic_function(10.0 ** np.array(list(EXACT)))
    np.testing.assert_allclose(found, list(EXACT.values()), rtol=1e-4)  # Sader's fit: 0.1 %
    np.testing.assert_allclose(np.abs(found), np.abs(list(EXACT.values())), rtol=1e-4)


def test_the_fit_follows_the_integral_equations_up_to_its_ends():
    for reynolds in (1e-2, 3e3, 1e4):
        assert complex(afm.hydrodynamic_function(reynolds)) == pytest.approx(blade_load(reynolds), rel=2e-4)


def test_a_thick_boundary_layer_leaves_the_drag_of_a_slow_flow():
    # Lamb's cylinder has 4 pi / (ln(2/q) - gamma), q = sqrt(-i Re); in a strip's mean of the Stokeslet -ln r is ln 2
    # in place of 0, and the part along the separation is 0 in place of 1/2
    for reynolds in (1e-5, 1e-6):
        drag = 4.0 * math.pi / (np.log(4.0 / np.sqrt(-1j * reynolds)) - np.euler_gamma - 0.5)
        found = complex(afm.hydrodynamic_function(reynolds)) * math.pi * reynolds / 1j
        assert found == pytest.approx(complex(drag), rel=1e-3)


def test_a_thin_boundary_layer_leaves_the_inertia_of_a_plate():
    assert complex(afm.hydrodynamic_function(1e4)) == pytest.approx(1.0, abs=0.06)  # pi rho b**2/4: Lamb, art. 71
    assert blade_load(1e4).real - 1.0 < 0.5 * (blade_load(1e3).real - 1.0)


@pytest.mark.parametrize("gap", [0.1, 0.05])
def test_a_narrow_gap_squeezes_the_film_of_reynolds(gap):
    # Reynolds: eta b**3 U / gap**3, which is 8 / gap**3 in units of half the width; the open edge adds of the order gap
    film = 8.0 / gap**3
    found = blade_load(1e-2, gap) * math.pi * 1e-2 / 1j
    assert 1.0 < found.real / film < 1.0 + 2.5 * gap
    assert abs(found.imag) < 1e-4 * found.real


def test_a_wall_far_away_is_no_wall():
    for reynolds in (1.0, 100.0):
        near, far = blade_load(reynolds, 40.0), blade_load(reynolds)
        assert near == pytest.approx(far, rel=1e-3)
        assert near != far


def test_a_wall_adds_mass_as_an_image_does():
    # An inviscid strip of half-width 1 at a distance h >> 1 meets its image's field: mass times 1 + 1/(8 h**2) + ...
    for gap in (5.0, 10.0):
        ratio = blade_load(1e4, gap).real / blade_load(1e4).real
        assert ratio - 1.0 == pytest.approx(1.0 / (8.0 * gap**2), rel=0.1)


@pytest.mark.campaign
def test_the_wall_s_load_is_that_of_more_polynomials():
    for reynolds, gap in ((0.01, 0.1), (100.0, 0.5)):
        assert blade_load(reynolds, gap) == pytest.approx(_finer(reynolds, gap), rel=1e-5)


def _finer(reynolds, gap):
    from saltus.afm.probe import blade_flow

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(blade_flow, "_TERMS", 12)
        patch.setattr(blade_flow, "_REACH", 60.0)
        return blade_load(reynolds, gap)


def test_shapes_and_ranges_are_kept():
    assert afm.hydrodynamic_function([[1.0, 2.0]]).shape == (1, 2)
    assert afm.hydrodynamic_function([1.0, 2.0], 0.5).shape == (2,)
    with pytest.raises(InputError, match="between 1e-06 and 10000"):
        afm.hydrodynamic_function(1e5)
    with pytest.raises(InputError, match="leave it out far from walls"):
        afm.hydrodynamic_function(1.0, 50.0)
    with pytest.raises(InputError, match="gap = 0.001: must be between 0.02 and 20 widths"):
        afm.hydrodynamic_function(1.0, 0.001)
    with pytest.raises(InputError, match="reynolds"):
        afm.hydrodynamic_function([1.0, math.nan])
