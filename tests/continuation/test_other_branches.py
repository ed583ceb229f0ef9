"""At a branch point the other branch is given, never the point's own: symmetric oscillators, told apart by symmetry."""

from __future__ import annotations

import numpy as np
import pytest

import saltus
from saltus import HybridSystem, StepControl

BOUNDS = (0.05, 12.0)


def oscillator(seed):
    """A driven oscillator with a cubic spring, and a third state that it feeds; branches of symmetric orbits fork."""
    rng = np.random.default_rng(seed)
    d, w, k, s = rng.uniform(0.05, 0.4), rng.uniform(0.4, 1.6), rng.uniform(0.5, 2.0), rng.choice([-1.0, 1.0])
    field = {"x": "v", "v": f"-{d}*v - {s}*x - {k}*x**3 + F*cos(th)", "u": "x**2 - u"}
    return HybridSystem.smooth(field, {"F": float(rng.uniform(3.0, 8.0)), "w": float(w)}, phase=("th", "w"))


def asymmetry(orbit):
    """How far x and v are from having opposite extremes, over their size."""
    low, high = (np.array(ends)[:2] for ends in orbit.extremes)
    return float(np.max(np.abs(low + high) / (high - low)))


def forks(branch):
    return [point for point in branch.special_points if point.type == "BP"]


@pytest.mark.campaign
@pytest.mark.parametrize("seed", [0, 1, 2, 7, 11, 12, 14, 15])
def test_a_symmetric_orbit_forks_into_orbits_without_symmetry_and_these_into_it(seed):
    start = saltus.find_orbit(oscillator(seed), x0=[0.1, 0.0, 0.0])
    branch = saltus.continue_orbit(start, "F", BOUNDS, steps=StepControl(max_points=200))
    symmetric = asymmetry(start) < 1e-6
    for point in forks(branch):
        other = saltus.switch_branch(point)
        assert (asymmetry(other) > 1e-5) if symmetric else (asymmetry(other) < 1e-6), point
        fork = saltus.continue_orbit(other, "F", BOUNDS, steps=StepControl(max_points=60))
        back = [item for item in forks(fork) if abs(item.parameters["F"] - point.parameters["F"]) < 1e-6]
        assert len(back) == 1, fork
        again = asymmetry(saltus.switch_branch(back[0]))
        assert (again < 1e-6) if symmetric else (again > 1e-5), fork


@pytest.mark.campaign
@pytest.mark.parametrize("seed", [0, 2, 11, 12, 14, 15])
def test_orbits_next_to_the_vertex_of_a_fork_are_those_of_the_fork(seed):
    """They are asked for at values between the vertex and the next point, where the symmetric orbit is near."""
    start = saltus.find_orbit(oscillator(seed), x0=[0.1, 0.0, 0.0])
    branch = saltus.continue_orbit(start, "F", BOUNDS, steps=StepControl(max_points=200))
    point = forks(branch)[0]
    fork = branch
    if asymmetry(start) < 1e-6:
        fork = saltus.continue_orbit(saltus.switch_branch(point), "F", BOUNDS, steps=StepControl(max_points=40))
    vertex = min(forks(fork), key=lambda item: abs(item.parameters["F"] - point.parameters["F"]))
    beyond = float(fork.values[np.abs(fork.arclength - vertex.arclength).argsort()[1]])
    for share in (1e-3, 1e-2, 0.1, 0.3, 0.6, 0.9):
        value = vertex.parameters["F"] + share * (beyond - vertex.parameters["F"])
        nearest = sorted(fork.at(value), key=lambda orbit: np.abs(orbit.x0 - vertex.solution.x0).max())[:2]
        assert [asymmetry(orbit) > 1e-8 for orbit in nearest] == [True, True], (share, value)


def test_a_branch_point_far_below_the_bounds_has_its_tangent_in_the_parameters_own_unit():
    """The bounds reach to six times the parameter there; in their unit the point's own branch came out as the other."""
    start = saltus.find_orbit(oscillator(12), x0=[0.1, 0.0, 0.0])
    branch = saltus.continue_orbit(start, "F", BOUNDS, steps=StepControl(max_points=200))
    for point in forks(branch):
        value, width = point.parameters["F"], 1e-4
        low, high = (
            min(branch.at(value + side * width), key=lambda o: np.abs(o.x0 - point.solution.x0).max()).x0
            for side in (-1.0, 1.0)
        )
        slope = (high - low) / (2.0 * width)
        np.testing.assert_allclose(point.tangent[:3] / point.tangent[-1], slope, rtol=1e-2, atol=1e-2)
