"""Table 1 of the paper: the dimensionless coefficients that its cantilever and sample give."""

from __future__ import annotations

import sys

import pytest

from saltus.afm import Cantilever, table1
from saltus.afm.paper.galerkin import coefficients

EPS = sys.float_info.epsilon


def test_coefficients_are_the_table_of_the_model():
    setup = table1()
    c = coefficients(setup.cantilever, setup.sample, setup.eta, 2)
    assert f"{c.f_1:.2f}" == "51519.24"
    assert f"{c.k:.7f}" == "1.9434665"
    assert [f"{K:.7f}" for K in c.K] == ["1.0000000", "39.2739482"]
    assert [f"{B:.8f}" for B in c.B] == ["1.56598351", "-0.86787179"]
    assert f"{c.C:.8e}" == "-2.35038841e-06"
    assert f"{c.G:.8f}" == "247.16423658"
    assert c.a0_bar == pytest.approx(1.0 / 300.0, rel=2.0 * EPS)


def test_coefficients_need_no_geometry():
    setup = table1()
    measured = Cantilever.from_measured(k=setup.cantilever.k, f0=setup.cantilever.f0, Q=40.0)
    one, other = (coefficients(lever, setup.sample, setup.eta, 3) for lever in (setup.cantilever, measured))
    assert (one.C, one.G, one.k, one.f_1) == (other.C, other.G, other.k, other.f_1)
