"""Meshes of segments on which states decay by many factors e."""

import math

import numpy as np
import pytest

import saltus
from saltus import HybridSystem, Mode
from saltus.orbits.meshes import decays, steady
from selection import guarding


@pytest.mark.parametrize("decay", [100.0, 1000.0, 30000.0])
def test_no_step_of_a_mesh_is_too_long_for_a_decay(decay):
    mesh = np.array([0.0, 0.1, 0.25, 0.3, 0.8, 1.0])
    fine = steady(mesh, decay)
    assert set(mesh) <= set(fine)
    times = fine * fine * (3.0 - 2.0 * fine)  # clustered time
    assert decay * np.diff(times).max() <= 3.0
    assert steady(mesh, 5.0) is mesh


def test_the_fastest_decay_of_a_segment_is_that_of_its_mode_over_its_duration():
    """Growing states count as ones that do not decay, rates without a number as none."""
    modes = {"fast": Mode({"x": "-3*x", "y": "-r*y"}), "slow": Mode({"x": "2*x", "y": "sqrt(y)"})}
    system = HybridSystem(("x", "y"), {"r": 50.0}, modes, [])
    blocks = np.array([[1.0, 1.0, 2.0], [1.0, 1.0, 3.0], [1.0, 0.0, 3.0]])
    found = decays(system.compiled, np.array([0, 1, 1]), blocks, system.compiled.extended(np.array([50.0])))
    assert found == [100.0, 0.0, 0.0]


@pytest.mark.parametrize("decay", guarding([50.0, 3000.0], 50.0))
def test_a_state_that_has_decayed_leaves_the_equations_regular(decay):
    """An oscillator beside a state that decays from any value: multipliers are those of both, each by itself."""
    system = HybridSystem.smooth(
        {"x": "v", "v": "-x - 0.1*v + cos(theta)", "y": "-r*y"}, {"w": 1.0, "r": decay}, phase=("theta", "w")
    )
    orbit = saltus.find_orbit(system, x0=[0.0, 0.0, 1.0])
    sizes = np.sort(np.abs(orbit.multipliers))
    assert sizes[0] < 1e-9
    assert sizes[1:] == pytest.approx(math.exp(-0.1 * math.pi), rel=1e-9)
    branch = saltus.continue_orbit(orbit, "w", (0.5, 2.0))
    assert branch.stopped == ("w = 0.5: bound reached", "w = 2: bound reached")
    np.testing.assert_allclose(
        branch.highs[:, 0], 1.0 / np.hypot(1.0 - branch.values**2, 0.1 * branch.values), rtol=1e-7
    )


def test_an_oscillator_that_nothing_moves_has_no_size_of_its_own():
    """Two oscillators beside each other, of which one is driven and the other has come to rest."""
    rates = {"x": "v", "v": "-x - 0.1*v + cos(theta)", "y": "u", "u": "-4*y - 3*u"}
    system = HybridSystem.smooth(rates, {"w": 1.0}, phase=("theta", "w"))
    orbit = saltus.solve_orbit(system, x0=[0.0, 10.0, 1e-200, 1e-190])
    assert np.sort(np.abs(orbit.multipliers)) == pytest.approx(
        [math.exp(-3.0 * math.pi)] * 2 + [math.exp(-0.1 * math.pi)] * 2, rel=1e-7
    )
