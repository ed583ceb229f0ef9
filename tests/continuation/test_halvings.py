"""Where the period halves: the branch point knows the orbit of half the period, against that orbit's own branch."""

from __future__ import annotations

import math

import numpy as np
import pytest

import saltus
from saltus import HybridSystem, Mode, Transition
from saltus.results import MapOrbit


def duffing():
    system = HybridSystem.smooth(
        {"x": "v", "v": "-d*v + x - x**3 + F*cos(th)"}, {"d": 0.3, "F": 0.2, "w": 1.2}, phase=("th", "w")
    )
    return saltus.find_orbit(system, x0=[1.0, 0.0]), "F", (0.1, 0.5)


def roessler():
    system = HybridSystem.smooth({"x": "-y - z", "y": "x + a*y", "z": "b + z*(x - c)"}, {"a": 0.2, "b": 0.2, "c": 2.5})
    return saltus.find_orbit(system, x0=[1.0, 1.0, 0.0]), "c", (2.3, 3.5)


def kicked():
    system = HybridSystem(
        ("x", "s"), {"r": 2.8}, {"carry": Mode({"x": "0", "s": "1"})},
        [Transition("carry", "carry", "s - 1", 1, {"x": "r*x*(1 - x)", "s": "0"}, name="map")],
    )  # fmt: skip
    return saltus.solve_orbit(system, {}, [("carry", "map", [0.64, 0.0], 1.0)]), "r", (2.5, 3.4)


def logistic():
    return saltus.find_orbit(saltus.Map(("x",), {"r": 2.9}, {"x": "r*x*(1-x)"}), x0=[0.6]), "r", (2.8, 3.4)


SYSTEMS = [duffing, roessler, kicked, logistic]


@pytest.fixture(scope="module", params=SYSTEMS, ids=lambda make: make.__name__)
def branches(request):
    """A branch, its first doubling, and the doubled branch."""
    start, name, bounds = request.param()
    branch = saltus.continue_orbit(start, name, bounds)
    point = next(point for point in branch.special_points if point.type == "PD")
    return branch, point, saltus.continue_orbit(saltus.switch_branch(point), name, bounds)


def states(orbit):
    if isinstance(orbit, MapOrbit):
        return np.concatenate([orbit.points.min(axis=0), orbit.points.max(axis=0)])
    return np.concatenate(orbit.extremes)


def test_the_other_branch_at_a_halving_is_that_of_the_single_period(branches):
    branch, doubling, doubled = branches
    halving = next(point for point in doubled.special_points if point.type == "BP")
    found = saltus.switch_branch(halving)
    name = halving.varied[-1]
    (single,) = branch.at(found.parameters[name])
    np.testing.assert_allclose(states(found), states(single), rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(found.period, single.period, rtol=1e-8)
    assert math.isclose(halving.parameters[name], doubling.parameters[name], rel_tol=1e-8)


def test_a_halving_tells_what_the_doubling_does(branches):
    _, doubling, doubled = branches
    halving = next(point for point in doubled.special_points if point.type == "BP")
    form, told = doubling.normal_form, halving.normal_form.reason
    assert f"the orbit of half the period doubles there ({form.criticality}, coefficient " in told
    value = float(told.split("coefficient ")[1].split(")")[0])
    assert value == pytest.approx(form.coefficient, rel=1e-4)


@pytest.mark.parametrize("branches", SYSTEMS[:3], indirect=True)
def test_the_tangent_at_a_halving_is_that_of_the_doubled_branch(branches):
    """Its two halves are opposite, so no parameter changes to first order."""
    halving = next(point for point in branches[2].special_points if point.type == "BP")
    assert abs(halving.tangent[-1]) < 1e-4 * np.abs(halving.tangent[:-1]).max()


def test_orbits_that_are_gone_round_twice_pass_the_doubling():
    orbit, name, bounds = duffing()
    twice = saltus.solve_orbit(orbit.system, {}, x0=orbit.x0, period=2.0 * orbit.period)
    assert twice.rounds == 2
    branch = saltus.continue_orbit(twice, name, bounds)
    assert all(reason.endswith("bound reached") for reason in branch.stopped)
    once = saltus.continue_orbit(orbit, name, bounds)
    assert branch["BP1"].parameters[name] == pytest.approx(once["PD1"].parameters[name], rel=1e-9)
    assert saltus.switch_branch(branch["BP1"]).rounds == 1
