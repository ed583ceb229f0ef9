"""Laws of a table: near its rows and between them, continuous, in models and their files."""

import math

import numpy as np
import pytest

import saltus
from saltus import afm
from saltus.errors import InputError

CONTACT = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5)
BENT = np.linspace(-1.5, 6.0, 150)


@pytest.fixture(scope="module")
def bent():
    return afm.Law.tabulated(BENT, CONTACT.force_nN(BENT, R_nm=12.0))


@pytest.mark.parametrize(
    ("law", "least", "most"),
    [
        (afm.VanDerWaals(H_aJ=0.1, a0_nm=0.3), 0.35, 20.0),
        (afm.Morse(U_aJ=0.4, l_nm=0.1, D0_nm=0.3), 0.2, 5.0),
        (afm.LennardJones(H_aJ=0.2, sigma_nm=0.34), 0.2, 10.0),
        (CONTACT, -1.5, 6.0),
    ],
    ids=lambda one: type(one).__name__,
)
def test_a_law_of_a_table_is_near_between_the_rows_too(law, least, most):
    D = least + (most - least) * np.linspace(0.0, 1.0, 120) ** 1.5
    F = law.force_nN(D, R_nm=12.0)
    found = afm.Law.tabulated(D, F)
    between = 0.5 * (D[1:] + D[:-1])
    np.testing.assert_allclose(found.force_nN(between), law.force_nN(between, R_nm=12.0), atol=0.02 * np.abs(F).max())
    assert found.misfit < 0.003


def test_both_pieces_meet_where_the_table_bends(bent):
    bend = float(bent.bend)
    assert bend == pytest.approx(0.3, abs=0.02)
    far, near = (float(bent.force_nN(bend, region)) for region in ("far", "contact"))
    assert far == pytest.approx(near, abs=1e-9)


def test_the_force_falls_with_the_distance_squared_beyond_the_table(bent):
    far = bent.force_nN(np.array([1e4, 2e4]))
    assert far[0] / far[1] == pytest.approx(4.0, rel=1e-2)


@pytest.mark.parametrize(
    "force",
    [
        lambda D: np.exp(-D / 2.0),
        lambda D: np.exp(-D / 0.3),
        lambda D: np.exp(-D / 0.5) * np.cos(2.0 * np.pi * D),
        lambda D: np.maximum(3.0 - D, 0.0) ** 1.5,
    ],
    ids=["slow", "fast", "layers", "contact"],
)
def test_no_force_comes_up_beyond_a_table(force):
    D = np.linspace(0.3, 6.0, 80)
    law = afm.Law.tabulated(D, force(D))
    beyond = D[-1] * np.geomspace(1.01, 1e4, 200)
    wanted = force(D[-1]) * (D[-1] / beyond) ** 2
    np.testing.assert_allclose(law.force_nN(beyond), wanted, atol=2.5 * law.misfit * np.abs(force(D)).max())


def test_a_gap_in_a_table_is_not_filled_by_waves():
    D = np.concatenate([np.linspace(-0.8, -0.5, 20), np.linspace(0.2, 4.0, 30)])
    F = CONTACT.force_nN(D, R_nm=12.0)
    law = afm.Law.tabulated(D, F)
    inside = law.force_nN(np.linspace(-0.5, 0.2, 50))
    assert np.abs(inside).max() < 1.3 * np.abs(F).max()


def test_a_tabulated_law_moves_a_tip_as_the_law_of_its_table(bent):
    probe = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
    system = afm.model(probe, bent, afm.Drive(A0_nm=12.0), Zc_nm=10.0)
    orbit = saltus.find_orbit(system, x0=[0.0, 0.0])
    seen = afm.observables(orbit)
    assert seen["amplitude_nm"] == pytest.approx(10.71569893, abs=0.01)
    assert seen["lag_deg"] == pytest.approx(63.24971465, abs=0.1)
    assert seen["contact_fraction"] == pytest.approx(0.1394, abs=2e-3)
    rate = 2e-3 * math.pi * 300.0 / 400.0
    assert np.prod(orbit.multipliers).real == pytest.approx(math.exp(-rate * orbit.period), rel=1e-9)
    again = saltus.HybridSystem.from_definition(system.definition())
    assert afm.parts_of(again).law == bent


def test_wrong_tables_are_told():
    D = np.linspace(0.3, 5.0, 30)
    rough = np.random.default_rng(1).normal(size=30)
    for table, told in (
        ((D[::-1], -1.0 / D), "D_nm"),
        ((D, -1.0 / D[1:]), r"F_nN = \[29\]: must be one number for each of 30 gaps"),
        ((D, -1.0 / D, [0.1]), r"sigma_nN = \[1\]"),
        ((D[:5], -1.0 / D[:5]), "D_nm = 5: must be 8 gaps or more"),
        ((1e-9 * D, -1.0 / D), r"D_nm = .*: must be gaps that span 0.001 nm or more; in m\? then 4.7 nm"),
        ((D, 0.0 * D), "a force that is not 0"),
        ((D, rough), r"F_nN = 0.\d+: must be a table that formulas fit to 0.05 of its peak"),
        ((D, [*(-1.0 / D[1:]), np.nan]), r"F_nN\[29\] = nan"),
    ):
        with pytest.raises(InputError, match=told):
            afm.Law.tabulated(*table)
