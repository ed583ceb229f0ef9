"""Where a motion diverges: far beyond the sizes that its problem has, or where the user says."""

from __future__ import annotations

import math

import pytest

from saltus import HybridSystem, find_orbit, simulate
from saltus.errors import DivergenceError, InputError
from saltus.options import SimulationOptions


def smooth(rate, parameters=None):
    return HybridSystem.smooth({"x": rate}, parameters or {})


@pytest.mark.parametrize(
    ("system", "time", "rest"),
    [
        (smooth("r*x*(1 - x/K)", {"r": 1.0, "K": 8e13}), 100.0, 8e13),
        (smooth("x*(1 - 2e-15*x)"), 100.0, 5e14),
        (smooth("1e13 - x"), 100.0, 1e13),
        (smooth("1e7 - k*x", {"k": 1e-7}), 1e9, 1e14),
    ],
)
def test_large_rests_are_no_divergence(system, time, rest):
    assert simulate(system, x0=[1.0], t_end=time).x_end[0] == pytest.approx(rest, rel=1e-8)


@pytest.mark.parametrize("start", [1e13, -1e20, 1e200])
def test_decay_is_no_divergence(start):
    assert simulate(smooth("-x"), x0=[start], t_end=3.0).x_end[0] == pytest.approx(start * math.exp(-3.0), rel=1e-9)
    assert simulate(smooth("-x"), x0=[start], t_end=3.0, options=SimulationOptions(limit=1.0)).x_end[
        0
    ] == pytest.approx(start * math.exp(-3.0))


def test_growth_without_bound_is_told_at_1e12_and_at_a_given_limit():
    with pytest.raises(DivergenceError, match=r"a state passes 1e\+12"):
        simulate(smooth("x"), x0=[1.0], t_end=100.0)
    with pytest.raises(DivergenceError, match=r"a state passes 1e\+03"):
        simulate(smooth("x"), x0=[1.0], t_end=100.0, options=SimulationOptions(limit=1e3))
    assert simulate(smooth("x"), x0=[1.0], t_end=100.0, options=SimulationOptions(limit=1e60)).x_end[
        0
    ] == pytest.approx(math.exp(100.0), rel=1e-8)
    with pytest.raises(InputError, match="limit"):
        simulate(smooth("x"), x0=[1.0], t_end=1.0, options=SimulationOptions(limit=-1.0))


@pytest.mark.parametrize("phase", [None, ("s", "w")])
def test_search_for_an_orbit_tells_growth_that_goes_on(phase):
    growing = HybridSystem.smooth({"x": "0.01*x"}, {"w": 1.0}, phase=phase)
    with pytest.raises(DivergenceError, match=r"a state passes 1e\+12"):
        find_orbit(growing, x0=[1.0])


def test_orbit_of_8e13_cells_is_found():
    field = {"x": "x*(1 + 0.5*cos(s) - x/K)"}
    forced = HybridSystem.smooth(field, {"K": 8e13, "w": 1.0}, phase=("s", "w"))
    one = HybridSystem.smooth(field, {"K": 1.0, "w": 1.0}, phase=("s", "w"))
    many = find_orbit(forced, x0=[1.0])
    assert many.x0[0] / 8e13 == pytest.approx(find_orbit(one, x0=[1.0]).x0[0], rel=1e-10)
    with pytest.raises(DivergenceError, match=r"a state passes 1e\+10"):
        find_orbit(forced, x0=[1.0], limit=1e10)
