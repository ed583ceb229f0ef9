"""Table 1 of the paper: the dimensionless coefficients that its cantilever and sample give."""

from __future__ import annotations

import sys

from saltus.afm import Cantilever, table1
from saltus.afm.paper.galerkin import coefficients

EPS = sys.float_info.epsilon


def test_coefficients_need_no_geometry():
    setup = table1()
    measured = Cantilever.from_measured(k=setup.cantilever.k, f0=setup.cantilever.f0, Q=40.0)
    one, other = (coefficients(lever, setup.sample, setup.eta, 3) for lever in (setup.cantilever, measured))
    assert (one.C, one.G, one.k, one.f_1) == (other.C, other.G, other.k, other.f_1)
