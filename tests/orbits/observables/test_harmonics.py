"""First harmonics of an orbit are those of its states, however few steps it takes."""

import math

import numpy as np
import pytest

import saltus


def harmonics_of(orbit: saltus.results.PeriodicOrbit) -> np.ndarray:
    """Return the column of a branch: harmonics as its survey sums them."""
    return orbit.problem().survey(orbit.unknowns).harmonics


def test_state_that_rests_between_kicks_has_no_harmonic_and_the_clock_that_of_a_saw():
    """Over a period of length 1 the state is constant and the clock is t, of harmonic -1/pi."""
    kick = saltus.Transition("carry", "carry", "s - 1", 1, {"x": "r*x*(1 - x)", "s": "0"}, name="map")
    system = saltus.HybridSystem(("x", "s"), {"r": 2.8}, {"carry": saltus.Mode({"x": "0", "s": "1"})}, [kick])
    orbit = saltus.find_orbit(system, x0=[0.6, 0.0])
    np.testing.assert_allclose(harmonics_of(orbit), [0.0, -1.0 / math.pi], atol=1e-11)


@pytest.mark.parametrize("power", [1, 2, 3])
def test_harmonics_of_a_ramp_are_those_of_its_integral(power):
    """A state with x' = k t^(k-1) that is set back each period has the harmonic of t^k."""
    back = saltus.Transition("up", "up", "s - 1", 1, {"x": "0", "s": "0"}, name="back")
    rate = f"{power}*s**{power - 1}" if power > 1 else "1"
    system = saltus.HybridSystem(("x", "s"), {}, {"up": saltus.Mode({"x": rate, "s": "1"})}, [back])
    orbit = saltus.find_orbit(system, x0=[0.0, 0.0])
    places, weights = np.polynomial.legendre.leggauss(40)
    t = 0.5 + 0.5 * places
    truth = 2.0j * np.sum(0.5 * weights * t**power * np.exp(-2.0j * math.pi * t))
    assert harmonics_of(orbit)[0] == pytest.approx(truth, abs=1e-11)
