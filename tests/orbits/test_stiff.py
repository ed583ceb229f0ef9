"""Stiff cycles: van der Pol's relaxation oscillation."""

from __future__ import annotations

import numpy as np
import pytest

import saltus
from saltus.orbits import find_orbit
from saltus.system import HybridSystem, Mode


@pytest.fixture(scope="module")
def relaxation() -> HybridSystem:
    return HybridSystem(("x", "y"), {"mu": 1.0}, {"m": Mode({"x": "y", "y": "mu*(1 - x**2)*y - x"})})


@pytest.mark.parametrize(
    ("mu", "period"),
    [(1.0, 6.663286859323193), (5.0, 11.612230667718), (20.0, 34.682323311), (100.0, 162.8370710)],
)
def test_relaxation_oscillation_has_its_period(relaxation: HybridSystem, mu: float, period: float) -> None:
    """The periods are SciPy's, DOP853 and Radau at 1e-11."""
    orbit = find_orbit(relaxation, {"mu": mu}, x0=[2.0, 0.0])
    assert orbit.period == pytest.approx(period, rel=1e-8)
    assert orbit.rounds == 1


def test_multipliers_that_the_flow_cannot_resolve_are_zero(relaxation: HybridSystem) -> None:
    """Their logarithms, integrals of the divergence, are -34.9 at mu = 3 and below -85 from mu = 5 on."""
    assert find_orbit(relaxation, {"mu": 1.0}, x0=[2.0, 0.0]).multipliers[0] == pytest.approx(8.5969506e-4, rel=1e-7)
    for mu in (3.0, 5.0, 20.0):
        assert find_orbit(relaxation, {"mu": mu}, x0=[2.0, 0.0]).multipliers[0] == 0.0


@pytest.mark.campaign
def test_branch_of_stiff_cycles_ends_with_what_limits_it(relaxation: HybridSystem, monkeypatch) -> None:
    monkeypatch.setattr("saltus.flow.kernels.segment.MOST_STEPS", 4000)
    branch = saltus.continue_orbit(find_orbit(relaxation, x0=[2.0, 0.0]), "mu", (0.01, 1000.0))
    assert branch.stopped[0] == "mu = 0.01: bound reached"
    assert "the flow is stiff: explicit steps stay stable only if" in branch.stopped[1]
    assert len(branch.special_points) == 0
    asymptotic = 3.0 - 2.0 * np.log(2.0)  # period over mu for large mu
    assert branch.period[-1] / branch.values[-1] == pytest.approx(asymptotic, rel=0.2)
