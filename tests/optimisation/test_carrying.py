"""Orbits carried to other parameters, against orbits that are found there and closed forms."""

import numpy as np
import pytest

from saltus import find_orbit
from saltus.optimisation.carrying import carried, carrying

LINEAR = {"b": 0.0, "A": 1.0, "c": 0.4, "w": 0.6}


@pytest.fixture(scope="module")
def orbit(duffing):
    return find_orbit(duffing, LINEAR, [0.0, 0.0])


def amplitude(w, c=0.4, A=1.0):
    return A / np.hypot(1.0 - w**2, c * w)


def test_slopes_are_those_of_orbits_nearby(duffing, orbit):
    known = carrying(orbit, ("c", "w"))
    for j, name in enumerate(("c", "w")):
        ends = [
            find_orbit(duffing, {**LINEAR, name: LINEAR[name] + side * 1e-5}, orbit.unknowns[:2]).unknowns
            for side in (1.0, -1.0)
        ]
        assert known.slopes[:, j] == pytest.approx((ends[0] - ends[1]) / 2e-5, rel=1e-5, abs=1e-6)


def test_slopes_stand_in_the_order_of_the_names(orbit):
    one, two = carrying(orbit, ("c", "w")), carrying(orbit, ("w", "c"))
    assert one.values.tolist() == [0.4, 0.6]
    assert two.values.tolist() == [0.6, 0.4]
    assert two.slopes[:, ::-1] == pytest.approx(one.slopes, rel=1e-10)


def test_onward_is_exact_for_a_parameter_in_which_the_orbit_is_linear(orbit):
    known = carrying(orbit, ("A",))
    assert known.onward(known.values).tolist() == orbit.unknowns.tolist()
    there = carried(known, np.array([3.0]))
    assert known.onward(np.array([3.0])) == pytest.approx(there.orbit.unknowns, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("w", [0.61, 0.95, 1.6, 0.1])
def test_an_orbit_is_carried_near_and_far(orbit, w):
    there = carried(carrying(orbit, ("w",)), np.array([w]))
    assert there.orbit.parameters["w"] == w
    assert there.values.tolist() == [w]
    assert there.orbit.max["x"] == pytest.approx(amplitude(w), rel=1e-8)
    assert there.u[-1] == w


def test_an_orbit_that_is_carried_nowhere_is_the_same(orbit):
    known = carrying(orbit, ("w", "A"))
    there = carried(known, known.values)
    assert there.orbit.unknowns == pytest.approx(orbit.unknowns, rel=1e-12)
    assert there.slopes == pytest.approx(known.slopes, rel=1e-9)


def test_the_way_there_and_back_ends_where_it_began_and_the_way_does_not_matter(orbit):
    known = carrying(orbit, ("w", "c"))
    there = carried(known, np.array([1.3, 0.2]))
    assert there.orbit.max["x"] == pytest.approx(amplitude(1.3, 0.2), rel=1e-8)
    around = carried(carried(known, np.array([1.3, 0.4])), np.array([1.3, 0.2]))
    assert around.orbit.unknowns == pytest.approx(there.orbit.unknowns, rel=1e-7, abs=1e-9)
    back = carried(there, known.values)
    assert back.orbit.unknowns == pytest.approx(orbit.unknowns, rel=1e-7, abs=1e-9)


@pytest.mark.parametrize("unit", [1e-9, 1e9])
def test_the_unit_of_the_amplitude_does_not_matter(duffing, unit):
    start = find_orbit(duffing, {**LINEAR, "A": unit}, [0.0, 0.0])
    there = carried(carrying(start, ("w", "A")), np.array([1.3, 2.0 * unit]))
    assert there.orbit.max["x"] == pytest.approx(2.0 * unit * amplitude(1.3), rel=1e-8)


@pytest.mark.parametrize(("name", "value"), [("A", np.inf), ("c", np.nan)])
def test_what_the_system_does_not_allow_is_a_reason_in_words(orbit, name, value):
    lost = carried(carrying(orbit, (name,)), np.array([value]))
    assert isinstance(lost, str)
    assert name in lost


def test_a_forcing_that_stands_still_has_no_period(orbit):
    assert carried(carrying(orbit, ("w",)), np.array([0.0])).startswith("periodic orbit: no convergence")


def test_where_no_orbit_is_left_the_reason_is_told(duffing):
    """With a softening spring the force has a fold: beyond it no orbit of this sheet is left."""
    start = find_orbit(duffing, {"b": -1.0, "w": 0.7, "A": 0.02}, [0.0, 0.0])
    known = carrying(start, ("A",))
    assert carried(known, np.array([0.04])).orbit.parameters["A"] == 0.04
    lost = carried(known, np.array([0.5]))
    assert isinstance(lost, str)
    assert known.orbit.parameters["A"] == 0.02
