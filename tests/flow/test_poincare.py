"""Returns to a section: those of the simulated motion, whatever engine finds them."""

from __future__ import annotations

import math

import numpy as np
import pytest

import systems
from oracles.closed_forms import HENON
from saltus.flow.poincare import EventSection, admits, iterate
from saltus.flow.simulation import simulate

RTOL, ATOL = 1e-11, 1e-13
PLACE = {"w": 0.9, "A": 0.7}


@pytest.fixture(scope="module")
def path(impact_oscillator):
    return simulate(impact_oscillator, PLACE, [0.2, 0.0], periods=12, tolerance=(1e-13, 1e-15))


def returns(system, x=(0.2, 0.0), **options):
    return iterate(system, system.parameter_vector(PLACE), x, 0, tolerance=(RTOL, ATOL), **options)


def test_returns_to_phase_zero_are_the_simulated_wraps(impact_oscillator, path):
    found = returns(impact_oscillator, discard=3, keep=9)
    wraps = path.events[path.events["kind"] == "phase"]["after"][3:]
    np.testing.assert_allclose(found.states, wraps, atol=1e-8)
    np.testing.assert_allclose(found.times, np.arange(4, 13) * 2.0 * math.pi / 0.9, rtol=1e-12)
    np.testing.assert_array_equal(found.x_end, found.states[-1])


def test_returns_to_a_transition_are_the_states_before_it(impact_oscillator, path):
    found = returns(impact_oscillator, discard=1, keep=5, section=EventSection((0,)))
    impacts = path.events[path.events["name"] == "impact"][1:6]
    np.testing.assert_allclose(found.states, impacts["before"], atol=1e-8)
    np.testing.assert_allclose(found.times, impacts["time"], atol=1e-8)
    np.testing.assert_allclose(found.x_end, impacts["after"][-1], atol=1e-8)


@pytest.mark.parametrize("section", [None, EventSection((0,))])
def test_a_motion_goes_on_where_it_ended(impact_oscillator, section):
    whole = returns(impact_oscillator, discard=4, keep=4, section=section)
    first = returns(impact_oscillator, discard=4, keep=0, section=section)
    rest = returns(impact_oscillator, first.x_end, discard=0, keep=4, section=section)
    np.testing.assert_allclose(rest.states, whole.states, atol=1e-8)


def test_a_start_inside_a_period_returns_at_its_end(impact_oscillator):
    found = returns(impact_oscillator, (0.2, 0.0, 1.0), discard=0, keep=1)
    assert found.times[0] == pytest.approx((2.0 * math.pi - 1.0) / 0.9, rel=1e-12)
    assert found.states[0, -1] == 0.0


def test_a_carried_map_returns_its_images():
    henon = systems.carried_map(("x", "y"), {"a": 1.4, "b": 0.3}, HENON)
    found = iterate(
        henon, henon.parameter_vector({}), [0.1, 0.2, 0.0], 0, discard=1, keep=2, section=EventSection((0,))
    )
    x, y = 1.4 - 0.1**2 + 0.3 * 0.2, 0.1
    np.testing.assert_allclose(found.states[0, :2], [x, y], rtol=1e-15)
    np.testing.assert_allclose(found.states[1, :2], [1.4 - x**2 + 0.3 * y, x], rtol=1e-14)


def test_a_motion_that_stays_away_ends_after_the_longest_wait(impact_oscillator):
    p = impact_oscillator.parameter_vector({"w": 2.0, "A": 0.1})
    found = iterate(impact_oscillator, p, [0.0, 0.0], 0, discard=2, keep=3, section=EventSection((0,), longest=200.0))
    assert found.states.shape == (0, 3)
    assert np.all(np.isfinite(found.x_end))


def test_a_mode_admits_what_is_in_its_domain_and_before_its_events(afm1):
    p = afm1.parameter_vector({})
    above, below = afm1.full_state([0.5, 0.0]), afm1.full_state([1.1, 0.0])
    assert admits(afm1, p, above, 0)
    assert not admits(afm1, p, above, 1)  # past its release
    assert admits(afm1, p, below, 1)
    assert not admits(afm1, p, below, 0)
