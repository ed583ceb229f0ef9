"""What all solutions and all their curves have in common, whatever their kind."""

from __future__ import annotations

import numpy as np
import pytest

import saltus
from saltus import HybridSystem, InputError, Map, continue_equilibrium, continue_locus, continue_orbit, find_equilibrium

FOLD = HybridSystem.smooth({"x": "r + h*x - x**3"}, {"r": 1.0, "h": 3.0})
HENON = Map(("x", "y"), {"a": 1.0, "b": 0.3}, {"x": "1 - a*x**2 + y", "y": "b*x"})
SWING = HybridSystem.smooth({"x": "v", "v": "-x - 0.2*v - x**3 + F*cos(s)"}, {"F": 0.1, "w": 1.0}, phase=("s", "w"))


def equilibria():
    return continue_equilibrium(find_equilibrium(FOLD, {}, [2.0]), "r", (-4.0, 4.0))


def cycles():
    orbit = saltus.find_orbit(HENON, {"a": 0.5}, x0=[0.5, 0.2])
    return continue_orbit(orbit, "a", (0.4, 0.8))


def orbits():
    return continue_orbit(saltus.find_orbit(SWING, x0=[0.0, 0.0]), "F", (0.05, 0.2))


def folds():
    return continue_locus(equilibria()["SN1"], ("r", "h"), {"r": (0.5, 4.0), "h": (2.0, 4.0)})


@pytest.mark.parametrize("make", [equilibria, cycles, orbits, folds], ids=lambda make: make.__name__)
def test_extremes_and_soundness_of_a_curve_are_those_of_its_solutions(make):
    curve = make()
    lows, highs = curve.extremes
    assert lows.shape == highs.shape == (len(curve), len(curve.system.states))
    assert curve.sound.shape == (len(curve),)
    for i in (0, len(curve) // 2, len(curve) - 1):
        solution = list(curve)[i]
        low, high = solution.extremes
        assert lows[i] == pytest.approx(low, rel=1e-9, abs=1e-12)
        assert highs[i] == pytest.approx(high, rel=1e-9, abs=1e-12)
        assert np.all(low <= solution.x0[: low.size] + 1e-12)
        assert np.all(solution.x0[: low.size] <= high + 1e-12)


@pytest.mark.parametrize("make", [equilibria, cycles, orbits, folds], ids=lambda make: make.__name__)
def test_a_label_that_no_special_point_has_is_told_with_those_there_are(make):
    curve = make()
    for point in curve.special_points:
        assert curve[point.label] is point
    with pytest.raises(InputError, match="label"):
        curve["XX9"]


@pytest.mark.parametrize(("system", "told"), [(FOLD, "a hybrid system"), (HENON, "a map")])
def test_a_system_without_a_name_is_called_what_it_is(system, told):
    assert system.unnamed == told
    assert f" of {told}: " in repr(equilibria() if system is FOLD else cycles())
