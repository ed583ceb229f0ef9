"""The start of a branch, copied for its second direction: nothing is seen of what the first direction leaves."""

import numpy as np
import pytest

import saltus
import systems


def cycle():
    """A cycle without a phase, whose plane moves along the branch."""
    fields = {"x": "v", "v": "mu*(1 - x**2)*v - x"}
    system = saltus.HybridSystem.smooth(fields, {"mu": 0.7}, name="van der Pol's oscillator")
    return saltus.find_orbit(system, {}, [2.0, 0.0]), "mu", (0.3, 1.5)


def impacts():
    """Impacts of a forced oscillator."""
    return saltus.find_orbit(systems.impact_oscillator(), {}, [0.0, 0.0]), "A", (0.9, 1.2)


@pytest.mark.parametrize("start", [cycle, impacts])
def test_the_second_direction_is_that_of_a_run_of_its_own(start):
    both = saltus.continue_orbit(*start())
    up = saltus.continue_orbit(*start(), directions="up")
    assert len(both) > len(up) > 3
    for name in ("values", "x0", "multipliers", "period", "lows", "means", "residual"):
        np.testing.assert_array_equal(getattr(both, name)[-len(up) :], getattr(up, name), err_msg=name)
