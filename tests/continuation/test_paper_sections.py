"""The paper's tapping cantilever: ten special points of n = 1, and the period doubling near 1.15 of n = 2."""

from __future__ import annotations

import math

import numpy as np
import pytest

from oracles.tapping import Tapping
from saltus import StepControl, continue_orbit, solve_orbit
from saltus.afm import table1, tapping_mode

POINTS = {
    "SN": [0.9120577212, 0.9128825231, 0.9160552968, 1.0807127042, 1.0812917345, 1.2418583364],
    "PD": [0.9128687544, 1.0825539853],
    "GR": [0.9127591193, 1.0810410925],
}
"""In Omega, at a tolerance of 1e-14."""

STARTS = {0.95: [-0.26936714, 0.82217769], 1.0: [-0.48489216, 0.8003283], 1.2: [-1.36427611, 0.07033167]}


def impacting_orbit(system, n, Omega, x):
    _, ((t1, touch), (t2, release)) = Tapping(n, Omega).map(np.array(x), 1e-7)
    end = 2.0 * math.pi / Omega - t2
    segments = [("flight", "touch", x, t1), ("contact", "release", touch, t2 - t1), ("flight", "theta", release, end)]
    return solve_orbit(system, {"Omega": Omega}, segments)


@pytest.fixture(scope="module")
def one_mode():
    return tapping_mode(table1(), modes=1)


def assert_ten_points(branch):
    for kind, expected in POINTS.items():
        got = sorted(p.parameters["Omega"] for p in branch.special_points if p.type == kind)
        assert len(got) == len(expected), (kind, got)
        np.testing.assert_allclose(got, expected, atol=1e-8, rtol=0.0, err_msg=kind)
    assert len(branch.special_points) == 10


@pytest.mark.parametrize("Omega", list(STARTS))
@pytest.mark.parametrize("largest", [0.05, 0.1, 0.2])
def test_ten_special_points_whatever_the_start_and_the_step(one_mode, Omega, largest):
    orbit = impacting_orbit(one_mode, 1, Omega, STARTS[Omega])
    assert_ten_points(continue_orbit(orbit, "Omega", (0.85, 1.3), steps=StepControl(largest=largest)))


@pytest.mark.parametrize("bounds", [(0.8, 1.26), (0.88, 1.6)])
def test_ten_special_points_whatever_the_bounds(one_mode, bounds):
    assert_ten_points(continue_orbit(impacting_orbit(one_mode, 1, 1.0, STARTS[1.0]), "Omega", bounds))


def test_ten_special_points_from_the_motion_without_contact(one_mode):
    still = Tapping(1, 0.86)
    x = np.zeros(2)
    for _ in range(400):
        x, crossings = still.map(x, 1e-6)
    assert not crossings
    orbit = solve_orbit(one_mode, {"Omega": 0.86}, [("flight", "theta", x, 2.0 * math.pi / 0.86)])
    assert_ten_points(continue_orbit(orbit, "Omega", (0.85, 1.3)))


def test_the_repulsive_attractor_of_two_modes_doubles_near_1_164():
    system = tapping_mode(table1(), modes=2)
    orbit = impacting_orbit(system, 2, 1.15, [-1.23947331, -0.02950304, 0.40286884, 0.48412771])
    assert orbit.stable
    np.testing.assert_allclose(orbit.x0[[1, 3]], [-0.02950, 0.48413], atol=5e-6)
    branch = continue_orbit(orbit, "Omega", (1.14, 1.2), directions="up", stop_at="PD")
    assert [p.type for p in branch.special_points] == ["PD"]
    assert branch["PD1"].parameters["Omega"] == pytest.approx(1.164, abs=5e-4)
    assert branch.stable[:-1].all()
