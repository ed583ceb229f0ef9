"""Orbits that are drawn, found once a run; every figure is closed after its test."""

from __future__ import annotations

import matplotlib

matplotlib.use("Agg")

import pytest
from matplotlib import pyplot as plt

import saltus
from saltus import afm


@pytest.fixture(autouse=True)
def _closed():
    yield
    plt.close("all")


@pytest.fixture(scope="session")
def tapping_orbit() -> saltus.results.PeriodicOrbit:
    """The orbit of Fig. 3 at Omega = 1.05: a flight and a contact."""
    guess = [
        ("flight", "touch", [-0.717, 0.7335], 2.95),
        ("contact", "release", [0.95, 0.85], 0.375),
        ("flight", "theta", [0.9, -0.4], 2.65),
    ]
    return saltus.solve_orbit(afm.tapping_mode(afm.table1(), modes=1), {"Omega": 1.05}, guess)
