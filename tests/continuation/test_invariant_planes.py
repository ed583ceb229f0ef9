"""Branches in an invariant plane with multipliers across it that are beyond all numbers."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

import saltus
from selection import guarding

BIRTHS, RECOVERY, CONTACTS, SHARE = 0.02, 100.0, 1800.0, 0.5


def mean_excess(T):
    """Return the mean growth rate of the infected over a period, over the contacts."""
    away = math.exp(-BIRTHS * T)
    mean = 1.0 - SHARE / (BIRTHS * T) * (1.0 - away) / (1.0 - (1.0 - SHARE) * away)
    return mean - (BIRTHS + RECOVERY) / CONTACTS


def vaccination(unit=1.0, groups=1):
    """Pulse vaccination, with `groups` kinds of infected that grow alike; times in units."""
    infected = [f"I{k}" for k in range(groups)]
    b, m, g = CONTACTS / unit, BIRTHS / unit, (BIRTHS + RECOVERY) / unit
    field = {"S": f"{m!r} - {b!r}*S*({'+'.join(infected)}) - {m!r}*S"}
    field |= {name: f"{b!r}*S*{name} - {g * (1.0 + 0.1 * k)!r}*{name}" for k, name in enumerate(infected)}
    pulse = saltus.Transition("f", "f", at_phase=0, reset={"S": "S/2"}, name="vaccination")
    return saltus.HybridSystem(
        ("S", *infected), {"T": unit}, {"f": saltus.Mode(field)}, [pulse], phase=("th", "2*pi/T")
    )


@pytest.mark.parametrize(("unit", "groups"), guarding([(1.0, 1), (1e-3, 1), (1e3, 1), (1.0, 2), (1.0, 3)], (1.0, 1)))
def test_the_disease_free_orbit_is_followed_whatever_its_multiplier_across(unit, groups):
    orbit = saltus.find_orbit(vaccination(unit, groups), x0=[0.03] + [0.0] * groups)
    branch = saltus.continue_orbit(orbit, "T", (0.5 * unit, 6.0 * unit))
    assert sorted(branch.values[[0, -1]] / unit) == pytest.approx([0.5, 6.0])
    assert branch["BP1"].parameters["T"] / unit == pytest.approx(brentq(mean_excess, 0.5, 6.0, xtol=1e-14), rel=1e-11)
    for T, values in zip(branch.values / unit, branch.multipliers, strict=True):
        size = CONTACTS * T * mean_excess(T)
        if size < 300.0:  # those of a row belong to the orbit before Newton's last step, 1e-8 in S: times 1800 T
            known = np.min(np.abs(values - math.exp(size))) < 1e-4 * max(1.0, math.exp(size))
            assert known or (size > math.log(1e10) and abs(values[0]) > 1e10)  # among several, given as infinite
        else:
            assert abs(values[0]) > 1e130


@pytest.mark.parametrize("largest", guarding([0.01, 0.02, 0.05, 0.2], 0.02))
def test_the_threshold_has_all_digits_at_every_length_of_step(largest):
    """The factor across the plane falls to 1e-6 within a period, and comes back to 1."""
    orbit = saltus.find_orbit(vaccination(), x0=[0.03, 0.0])
    branch = saltus.continue_orbit(orbit, "T", (0.5, 3.0), steps=saltus.StepControl(largest=largest))
    assert branch["BP1"].parameters["T"] == pytest.approx(brentq(mean_excess, 0.5, 6.0, xtol=1e-14), rel=3e-12)


@pytest.mark.parametrize("T", guarding([3.0, 5.0, 6.0, 9.0], 6.0))
def test_an_orbit_in_the_plane_is_found_whatever_its_multiplier_across(T):
    away = math.exp(-BIRTHS * T)
    start = SHARE * (1.0 - away) / (1.0 - (1.0 - SHARE) * away)
    orbit = saltus.solve_orbit(vaccination(), {"T": T}, segments=[("f", "vaccination", [1.1 * start, 0.0], T)])
    assert orbit.segments[0].state[:2] == pytest.approx([start, 0.0], rel=1e-10)
    assert orbit.multipliers[1].real == pytest.approx(SHARE * away, rel=1e-9)
