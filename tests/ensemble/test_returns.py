"""Growth of perturbations along many motions in lanes: closed forms, multipliers, and one motion at a time."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import expm

import own_states
import systems
from saltus import HybridSystem, find_orbit, run_sweep
from saltus.ensemble.returns import ManyReturns, Start
from saltus.flow.variational import Average, growth_along
from saltus.options import SweepOptions
from saltus.sweeps import brute_force

TOLERANCE = (1e-9, 1e-11)


def starts_of(system, parameter, values, x, interval=None):
    full = system.full_state(x)
    return [Start(system.parameter_vector({parameter: value}), full, 0, interval) for value in values]


def test_exponents_of_a_linear_system_are_those_of_its_matrix():
    """Real eigenvalues, so that the frame turns into their directions."""
    linear = HybridSystem.smooth({"x": "v", "v": "-k*x - 3*v + cos(s)"}, {"k": 1.0, "w": 1.3}, phase=("s", "w"))
    values = [0.5, 1.0, 2.0]
    many = ManyReturns(linear, None, TOLERANCE, exponents=2)
    for growth, k in zip(many.growth(starts_of(linear, "k", values, [0.1, 0.2]), 10, 40), values, strict=True):
        expected = np.sort(np.linalg.eigvals([[0.0, 1.0], [-k, -3.0]]).real)[::-1]
        np.testing.assert_allclose(growth.exponents, expected, rtol=1e-7)
        assert growth.times[-1] == pytest.approx(40 * 2.0 * math.pi / 1.3)


def test_growth_over_impacts_is_that_of_the_saltation_matrix():
    """The determinant over a period is that of the flow times e^2 for one impact; its logarithm, the exponents' sum."""
    impacts = systems.impact_oscillator()
    values = [0.98, 1.0, 1.02]
    many = ManyReturns(impacts, None, TOLERANCE, exponents=2)
    grown = many.growth(starts_of(impacts, "A", values, [0.0, 0.0]), 200, 200)
    period = 2.0 * math.pi
    flow = np.linalg.det(expm(np.array([[0.0, 1.0], [-1.0, -0.1]]) * period))
    for growth in grown:
        assert growth.exponents.sum() * period == pytest.approx(math.log(flow * 0.8**2), rel=1e-7)


def test_exponents_are_the_logarithms_of_multipliers(impact_oscillator):
    """Next to PD at A = 4.27, where the multipliers are real."""
    orbit = find_orbit(impact_oscillator, {"w": 2.2, "A": 4.275}, [-1.92, 0.21])
    p = impact_oscillator.parameter_vector({"w": 2.2, "A": 4.275})
    start = Start(p, impact_oscillator.full_state(orbit.x0), 0)
    (growth,) = ManyReturns(impact_oscillator, None, TOLERANCE, exponents=2).growth([start], 100, 100)
    np.testing.assert_allclose(growth.exponents, np.log(np.abs(orbit.multipliers)) / orbit.period, atol=1e-5)


def test_a_cycle_has_the_exponent_zero():
    normal = HybridSystem.smooth(
        {"x": "mu*x - w*y - x*(x**2 + y**2)", "y": "w*x + mu*y - y*(x**2 + y**2)"}, {"mu": 1.0, "w": 2.0}
    )
    many = ManyReturns(normal, None, TOLERANCE, exponents=2)
    values = [0.3, 0.7]
    for growth, mu in zip(
        many.growth(starts_of(normal, "mu", values, [0.5, 0.1], math.pi), 20, 40), values, strict=True
    ):
        np.testing.assert_allclose(growth.exponents, [0.0, -2.0 * mu], atol=1e-6)


@pytest.mark.parametrize(
    "system",
    [own_states.wall(), pytest.param(systems.afm(1), marks=pytest.mark.campaign)],
    ids=["states of a mode's own", "cantilever"],
)
def test_growth_is_that_of_one_motion_at_a_time(system):
    parameter, values = ("A", [0.6, 1.0, 1.4]) if "A" in system.parameters else ("ybar", [0.1, 0.104, 0.108])
    many = ManyReturns(system, None, TOLERANCE)
    starts = starts_of(system, parameter, values, np.zeros(len(system.states)))
    found = many.growth(starts, 50, 60)
    assert sum(growth is not None for growth in found) >= 2
    for start, growth in zip(starts, found, strict=True):
        if growth is not None:
            average = Average(periods=60, discard=50)
            alone = growth_along(system, start.p, start.x, 0, average=average, exponents=1, tolerance=TOLERANCE)
            np.testing.assert_allclose(growth.x_end, alone.x_end, atol=1e-6)
            np.testing.assert_allclose(growth.exponents, alone.exponents, rtol=1e-4, atol=1e-6)
            np.testing.assert_allclose(growth.times, alone.times, rtol=1e-12)


@pytest.mark.campaign
def test_a_direction_that_a_reset_takes_away_is_left_to_others():
    """A reset to a point: no perturbation is left over."""
    lost = systems.carried_map(("x",), {"r": 3.2}, {"x": "1/2"})
    start = Start(lost.parameter_vector({}), np.array([0.3, 0.5]), 0, 1.0)
    assert ManyReturns(lost, None, TOLERANCE, exponents=2).growth([start], 4, 8) == [None]


@pytest.mark.campaign
def test_a_sweep_by_lanes_has_the_exponents_of_single_motions(impact_oscillator, monkeypatch):
    monkeypatch.setattr(brute_force, "_MANY_MEASURED", 1)
    monkeypatch.setattr(brute_force, "_FEWEST", 1)
    grown, original = [], ManyReturns.growth

    def growth(self, starts, skip, keep):
        found = original(self, starts, skip, keep)
        grown.extend(found)
        return found

    monkeypatch.setattr(ManyReturns, "growth", growth)
    options = {"follow": "restart", "discard": 300, "keep": 20}
    one, other = (
        run_sweep(impact_oscillator, "A", np.linspace(0.9, 1.1, 5), options=SweepOptions(lanes=lanes, **options))
        for lanes in (True, False)
    )
    assert one.labels.tolist() == other.labels.tolist()
    np.testing.assert_allclose(one.exponents, other.exponents, rtol=1e-4)
    np.testing.assert_allclose(one.errors, other.errors, rtol=1e-2, atol=1e-6)
    assert len(grown) >= 5
    assert None not in grown
