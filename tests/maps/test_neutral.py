"""Motions on orbits that neither attract nor repel end a search at once, with a word."""

import math

import pytest

from saltus import Map, find_orbit, solve_orbit
from saltus.errors import ConvergenceError

GINGERBREAD = Map(("x", "y"), {}, {"x": "1 - y + abs(x)", "y": "x"})
TURN = Map(("x", "y"), {"a": 0.5 * math.pi}, {"x": "x*cos(a) - y*sin(a)", "y": "x*sin(a) + y*cos(a)"})


@pytest.mark.parametrize("moved", [0.0, 1e-13, 1e-8, 1e-3])
def test_the_gingerbread_map_stays_at_its_orbit_of_period_six(moved):
    told = r"an orbit of period 6 that is neutral: solve_orbit\(..., period=6\)"
    with pytest.raises(ConvergenceError, match=told) as found:
        find_orbit(GINGERBREAD, x0=[1.2 + moved, 1.1])
    assert found.value.iterations < 10_000
    orbit = solve_orbit(GINGERBREAD, x0=[1.2 + moved, 1.1], period=6)
    assert orbit.period == 6
    assert abs(orbit.multipliers) == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize(("share", "period"), [(0.25, 4), (1.0 / 3.0, 3), (0.4, 5)])
def test_a_rational_turn_is_told_as_a_neutral_orbit(share, period):
    with pytest.raises(ConvergenceError, match=f"an orbit of period {period} that is neutral"):
        find_orbit(TURN, {"a": 2.0 * math.pi * share}, x0=[1.0, 0.3])
