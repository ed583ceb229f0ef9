"""Orbits of conservative motions: none is isolated, which is told, and a branch along a damping follows them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.special import ellipk

from saltus import (
    ConvergenceError,
    HybridSystem,
    Mode,
    StepControl,
    Transition,
    continue_orbit,
    find_orbit,
    solve_orbit,
)
from saltus.orbits.orbit import orbit_at
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.signature import CLOSED_END, Signature

FAMILY = "orbits form a family there at fixed parameters"


def swing(x):
    """Period of a pendulum of that amplitude."""
    return 4.0 * ellipk(math.sin(x / 2.0) ** 2)


@pytest.fixture(scope="module")
def pendulum():
    """A pendulum with damping -la, in units of time 1/n."""
    field = {"x": "n*v", "v": "n*(-sin(x) + la*v)"}
    return HybridSystem(("x", "v"), {"la": 0.0, "n": 1.0}, {"m": Mode(field)})


@pytest.mark.parametrize(("n", "late"), [(1.0, 1.0), (1.0, 1.02), (1e6, 1.0)])
def test_an_orbit_of_a_conservative_motion_is_told_to_be_one_of_a_family(pendulum, n, late):
    with pytest.raises(ConvergenceError, match=FAMILY):
        solve_orbit(pendulum, {"n": n}, [("m", None, [1.0, 0.0], late * swing(1.0) / n)])


def test_a_conservative_motion_is_told_to_be_one_of_a_family(pendulum):
    with pytest.raises(ConvergenceError, match=FAMILY):
        find_orbit(pendulum, {}, [1.0, 0.0], settle=200.0)


def test_a_guess_that_shrinks_to_a_rest_is_no_orbit(pendulum):
    with pytest.raises(ConvergenceError, match="it shrinks to a rest at"):
        solve_orbit(pendulum, {"la": -0.1}, [("m", None, [1.0, 0.0], swing(1.0))])


def test_the_jumps_of_an_elastic_ball_are_a_family():
    system = HybridSystem(
        ("z", "v"),
        {"e": 1.0},
        {"flight": Mode({"z": "v", "v": "-1"})},
        [Transition("flight", "flight", "z", -1, {"v": "-e*v"}, name="hit")],
    )
    with pytest.raises(ConvergenceError, match=FAMILY):
        solve_orbit(system, {}, [("flight", "hit", [0.0, 1.0], 2.0)])


def test_a_branch_along_a_damping_follows_the_family_without_folds(pendulum):
    problem = OrbitProblem(pendulum, Signature((0,), (-1,), (CLOSED_END,), 0), pendulum.parameter_vector({}))
    u = np.array([1.0, 0.0, swing(1.0)])
    problem.start(u)
    orbit = orbit_at(problem, u, problem.resolve(u)[1])
    branch = continue_orbit(orbit, "la", (-0.2, 0.2), steps=StepControl(max_points=40))
    assert np.abs(branch.values).max() < 1e-10
    # without damping the rest is a centre: a Hopf point, and no fold
    assert {point.type for point in branch.special_points} <= {"HB"}
    amplitude = branch.highs[:, 0]
    assert amplitude.max() > 1.9
    below = amplitude < 2.9  # towards the upright pendulum the period varies without bound
    np.testing.assert_allclose(branch.period[below], [swing(x) for x in amplitude[below]], rtol=1e-9)


@pytest.mark.parametrize("w", [1.0, 1e6])
def test_the_motions_of_an_undamped_oscillator_at_resonance_are_a_family(w):
    system = HybridSystem(
        ("x", "v"),
        {"la": 0.0, "w": 1.0},
        {"m": Mode({"x": "w*v", "v": "w*(-x + la*v)"})},
        phase=("s", "w"),
    )
    guess = [("m", "s", [1.1, 0.3], 2.0 * math.pi / w)]
    with pytest.raises(ConvergenceError, match=FAMILY):
        solve_orbit(system, {"w": w}, guess)
    rest = solve_orbit(system, {"w": w, "la": -1e-3}, guess)
    np.testing.assert_allclose(rest.x0, 0.0, atol=1e-12)
