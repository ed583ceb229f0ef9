"""Other branches of solutions that lie in an invariant plane, where some states are 0 all along."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import saltus


@pytest.fixture(scope="module")
def prey():
    """Prey in seasons without predators (y = 0); units of prey X and predators Y."""
    return saltus.HybridSystem(
        ("x", "y"), {"d": 0.9, "X": 1.0, "Y": 1.0},
        {"m": saltus.Mode({"x": "x*(1 + 0.3*cos(th) - x/X) - x*y/Y/(0.5 + x/X)", "y": "y*(x/X/(0.5 + x/X) - d)"})},
        phase=("th", "2*pi"),
    )  # fmt: skip


def hunted(orbit):
    """The state after a season, in units of X and Y, by SciPy."""
    d, X, Y = (orbit.parameters[name] for name in ("d", "X", "Y"))
    start = np.array(orbit.x0)[:2] / (X, Y)

    def rates(t, z):
        eaten = z[0] / (0.5 + z[0])
        return [z[0] * (1.0 + 0.3 * math.cos(2.0 * math.pi * t) - z[0]) - z[1] * eaten, z[1] * (eaten - d)]

    return start, solve_ivp(rates, (0.0, 1.0), start, rtol=1e-12, atol=1e-16).y[:, -1]


@pytest.mark.parametrize(("prey_unit", "predator_unit"), [(1.0, 1.0), (1e-6, 1e9)])
def test_predators_appear_where_the_switch_leaves_the_plane_without_them(prey, prey_unit, predator_unit):
    start = saltus.find_orbit(prey, {"X": prey_unit, "Y": predator_unit}, x0=[0.9 * prey_unit, 0.0])
    point = saltus.continue_orbit(start, "d", (0.3, 0.95))["BP1"]
    other = saltus.switch_branch(point)
    before, after = hunted(other)
    assert before[1] > 1e-7
    # at the branch point itself the predators of any number up to rounding would return
    assert abs(other.parameters["d"] - point.parameters["d"]) > 1e-9
    np.testing.assert_allclose(after, before, rtol=1e-9)


@pytest.mark.campaign
def test_pests_that_survive_pulses_of_predators_are_more_than_none():
    pest = saltus.HybridSystem(
        ("x", "y"), {"T": 3.0, "p": 2.0},
        {"m": saltus.Mode({"x": "x*(1 - x) - 1.2*x*y", "y": "0.6*x*y - 0.4*y"})},
        [saltus.Transition("m", "m", "sin(s)", 1, {"y": "y + p"}, name="pulse")],
        phase=("s", "2*pi/T"), positive=["T"],
    )  # fmt: skip
    point = saltus.continue_orbit(saltus.find_orbit(pest, x0=[0.5, 0.5]), "p", (0.1, 10.0))["BP1"]
    assert point.parameters["p"] == pytest.approx(3.0 * 0.4 / 1.2, rel=1e-9)  # growth T = b p / d of the loss
    other = saltus.switch_branch(point)
    assert other.max["x"] > 1e-6
    lasting = saltus.continue_orbit(other, "p", (0.5, 2.0))
    settled = min(lasting, key=lambda orbit: abs(orbit.parameters["p"] - 0.5))
    # the mean growth of a pest that lasts is 0, so that the mean of x + 1.2 y is 1; the orbit starts before its pulse
    ways = solve_ivp(
        lambda t, z: [z[0] * (1 - z[0] - 1.2 * z[1]), z[1] * (0.6 * z[0] - 0.4), z[0] + 1.2 * z[1]],
        (0.0, 3.0), [settled.x0[0], settled.x0[1] + 0.5, 0.0], rtol=1e-12, atol=1e-14,
    )  # fmt: skip
    assert settled.max["x"] > 0.1
    assert ways.y[2, -1] == pytest.approx(3.0, rel=1e-8)


@pytest.mark.parametrize("shift", [0.0, 1.0])
def test_doubled_orbits_of_the_standard_map_go_on_wherever_its_momentum_is_zero(shift):
    """x = pi +- d with sin d = 4 d/K, from K = 4 on."""
    standard = saltus.Map(("p", "x"), {"K": 3.5, "h": shift}, {"p": "p + K*sin(x)", "x": "x + (p - h) + K*sin(x)"})
    single = saltus.continue_orbit(saltus.solve_orbit(standard, x0=[shift, 3.0]), "K", (1.0, 8.0))
    doubled = saltus.continue_orbit(saltus.switch_branch(single["PD1"]), "K", (3.0, 8.0))
    assert not any("without bound" in text for text in doubled.stopped)
    assert doubled.values.max() == pytest.approx(8.0, rel=1e-12)
    d = np.abs(doubled.x0[:, 1] - math.pi)
    np.testing.assert_allclose(np.sin(d) * doubled.values, 4.0 * d, atol=1e-8)
