"""Branches that meet at special points, and cascades of period doublings, against closed forms."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

import systems
from oracles.closed_forms import CUSP, DELAYED, HENON, LOGISTIC, ImpactOrbit, henon_fixed_point, henon_two_cycle
from saltus import (
    InputError,
    continue_orbit,
    grazing_orbits,
    solve_orbit,
    switch_branch,
)

DOUBLINGS = (3.0, 1.0 + math.sqrt(6.0), 3.5440903596, 3.5644072661, 3.5687594195)
"""Where periods 1, 2, 4, 8, 16 of the logistic map double, the last three as printed to ten digits."""


def carried(image, **parameters):
    return systems.carried_map(tuple(image), parameters, image)


def cycle(system, points, **parameters):
    """The orbit through the given points of a carried map."""
    return solve_orbit(system, parameters, [("carry", "map", [*np.atleast_1d(x), 0.0], 1.0) for x in points])


def logistic_two_cycle(a):
    return (a + 1.0 + np.array([-1.0, 1.0]) * math.sqrt((a - 3.0) * (a + 1.0))) / (2.0 * a)


@pytest.fixture(scope="module")
def logistic():
    return continue_orbit(cycle(carried(LOGISTIC, a=2.5), [0.6]), "a", (2.0, 3.4))


@pytest.fixture(scope="module")
def henon():
    x = henon_fixed_point(0.2, 0.3)
    return continue_orbit(cycle(carried(HENON, a=0.2, b=0.3), [(x, x)]), "a", (-1.0, 1.5))


@pytest.fixture(scope="module")
def grazing():
    form = ImpactOrbit(1.1, 1)
    guess = [("free", "impact", form.after_impact(0.5), form.period)]
    orbit = solve_orbit(systems.impact_oscillator(), {"w": 1.1, "A": form.amplitude(0.5)}, guess)
    return continue_orbit(orbit, "A", (0.05, 1.2), directions="down")


# switch_branch


def test_the_doubled_orbit_is_the_two_cycle_of_its_own_parameter(logistic):
    doubled = switch_branch(logistic["PD1"])
    a = doubled.parameters["a"]
    assert 3.0 < a < 3.01
    assert doubled.period == pytest.approx(2.0, abs=1e-12)
    assert doubled.stable
    np.testing.assert_allclose(np.sort(doubled.states[:, 0]), logistic_two_cycle(a), atol=1e-10)


def test_the_doubled_orbit_of_a_planar_map(henon):
    doubled = switch_branch(henon["PD1"])
    expected = sorted(henon_two_cycle(doubled.parameters["a"], 0.3))
    np.testing.assert_allclose(np.sort(doubled.states[:, 0]), expected, atol=1e-9)
    assert len(doubled.signature) == 2


def test_the_branch_of_doubled_orbits_leads_from_the_doubling_to_the_next(logistic):
    branch = continue_orbit(switch_branch(logistic["PD1"]), "a", (3.0, 3.5))
    for a, orbit in zip(branch.values[::5], list(branch)[::5], strict=True):
        np.testing.assert_allclose(np.sort(orbit.states[:, 0]), logistic_two_cycle(max(a, 3.0)), atol=2e-5)
    assert branch["PD1"].parameters["a"] == pytest.approx(DOUBLINGS[1], abs=1e-10)


def test_the_other_branch_at_a_transcritical_point():
    """Of the delayed logistic map with c = 0: x = 1 - 1/a and x = 0 cross at a = 1."""
    orbit = cycle(carried(DELAYED, a=1.5, c=0.0), [(1 / 3, 1 / 3)])
    other = switch_branch(continue_orbit(orbit, "a", (0.5, 1.8))["BP1"])
    np.testing.assert_allclose(other.x0[:2], 0.0, atol=1e-9)
    assert 0.0 < abs(other.parameters["a"] - 1.0) < 0.01


def test_the_other_branch_at_a_pitchfork():
    """Of h x - x^3: x = 0 and x^2 = h - 1."""
    branch = continue_orbit(cycle(carried(CUSP, r=0.0, h=0.5), [0.0]), "h", (0.2, 1.5))
    other = switch_branch(branch["BP1"])
    assert other.x0[0] ** 2 == pytest.approx(other.parameters["h"] - 1.0, abs=1e-10)
    assert abs(other.x0[0]) > 1e-4
    assert other.stable


def test_a_grazing_orbit_in_both_signatures(grazing):
    point = grazing["GR1"]
    own, *others = grazing_orbits(point)
    assert own is point.orbit
    assert switch_branch(point) == others[0]
    assert {orbit.signature for orbit in (own, *others)} == {(("free", "impact"),), (("free", "theta"),)}
    for orbit in others:
        assert orbit.parameters == pytest.approx(dict(point.parameters))
        assert orbit.max["x"] == pytest.approx(1.0, abs=1e-9)


def test_the_orbit_beyond_a_grazing_starts_the_branch_that_goes_on_there(grazing):
    assert [point.type for point in grazing.special_points] == ["SN", "GR"]
    ended = continue_orbit(grazing.solution(0), "A", (0.05, 1.2), directions="down", stop_at="GR")
    assert ended.stopped[1] == f"A = {ended['GR1'].parameters['A']:.9g}: grazing"
    assert len(ended.forms) == 1
    for orbit in grazing_orbits(ended["GR1"]):
        again = continue_orbit(orbit, "A", (0.05, 1.2))
        assert {form.names(again.system) for form in again.forms} == {(("free", "impact"),), (("free", "theta"),)}
        assert again["SN1"].parameters["A"] == pytest.approx(grazing["SN1"].parameters["A"], abs=1e-9)


@pytest.mark.parametrize("given", [None, 3, "PD1", [], {}])
def test_what_is_no_special_point_has_no_other_branch(given):
    refuse(f"point = {given!r}: must be a SpecialPoint", lambda: switch_branch(given))
    refuse(f"point = {given!r}: must be a SpecialPoint", lambda: grazing_orbits(given))


def test_only_at_a_grazing_signatures_meet(henon):
    refuse(
        "point = 'SN': must be of type GR, CS, GS, SS, AS, BC; only there signatures meet",
        lambda: grazing_orbits(henon["SN1"]),
    )


def test_an_orbit_or_a_branch_is_no_special_point(logistic):
    for given in (logistic, logistic.solution(0)):
        refuse("point = ", lambda given=given: switch_branch(given))


def test_at_a_fold_no_other_branch_meets(henon):
    message = "point = 'SN': must be of type PD, BP, GR, HB or BE; no other branch meets there"
    refuse(message, lambda: switch_branch(henon["SN1"]))


def refuse(message, call):
    """What is called raises an `InputError` that begins with a message, in one line."""
    with pytest.raises(InputError, match=f"^{re.escape(message)}") as caught:
        call()
    assert "\n" not in str(caught.value)
