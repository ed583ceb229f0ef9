"""The same special points, places and words in all units of states, time and parameter, and at all tolerances."""

from __future__ import annotations

import functools
import itertools
import math
from typing import Any

import numpy as np
import pytest

import units
from saltus import HybridSystem, Mode, find_orbit, solve_orbit, verify
from selection import guarding

EVERY = [(name, unit, tol) for name in units.CASES for unit in units.UNITS for tol in units.TOLERANCES]
DRAWN = [(name, seed, tol) for seed in range(8) for name in units.CASES for tol in (1e-12, 1e-8, 1e-5)] + [
    ("belt", 11, 1e-8)
]  # rounding ends the excursion past its touch
SAMPLE = np.random.default_rng(2026).permutation(len(EVERY))[:24].tolist()
QUICK = [EVERY[i] for i in SAMPLE]
KEPT = [
    ("relay", "mixed", 1e-12),
    ("integrate and fire", "small", 1e-12),
    ("stick-slip", "large", 1e-5),
    ("Brusselator, cycles", "mixed, turned", 1e-8),
]
LOCI = [(name, unit) for name, case in units.CASES.items() if case.second for unit in units.UNITS]


@functools.cache
def reference(name: str) -> dict[str, Any]:
    """Return what the branch of a case tells in units of one at the finest tolerance."""
    case, one = units.CASES[name], units.Units()
    return units.told(units.branch_of(case, one, 1e-12), (case.parameter,), one)


@functools.cache
def reference_loci(name: str) -> dict[str, dict[str, Any]]:
    """Return the same of the loci of its special points."""
    case, one = units.CASES[name], units.Units()
    loci = units.loci_of(case, units.branch_of(case, one, 1e-12), one)
    return {kind: units.told(locus, case.varied, one) for kind, locus in loci.items()}


def error(tolerance: float) -> float:
    return max(1e-7, 100.0 * tolerance)


@pytest.mark.parametrize(("name", "unit", "tolerance"), guarding(EVERY, *KEPT, *QUICK, campaign=70))
def test_special_points_and_words_are_those_in_units_of_one(name: str, unit: str, tolerance: float) -> None:
    case, new = units.CASES[name], units.NAMED[unit]
    branch = units.branch_of(case, new, tolerance)
    units.assert_same(reference(name), units.told(branch, (case.parameter,), new), error(tolerance))


@pytest.mark.parametrize(
    ("name", "seed", "tolerance"),
    guarding(DRAWN, ("Lorenz", 2, 1e-12), ("belt", 6, 1e-5), ("belt", 11, 1e-8), campaign=30),
)
def test_special_points_are_the_same_in_random_units_of_all_kinds(name: str, seed: int, tolerance: float) -> None:
    case, new = units.CASES[name], units.drawn(seed)
    branch = units.branch_of(case, new, tolerance)
    units.assert_same(reference(name), units.told(branch, (case.parameter,), new), error(tolerance))


@pytest.mark.parametrize(
    ("name", "unit"), guarding(LOCI, ("hard stop, grazing", "small"), ("Bazykin", "parameter small"), campaign=24)
)
def test_loci_have_the_same_points_in_all_units(name: str, unit: str) -> None:
    case, new = units.CASES[name], units.NAMED[unit]
    loci = units.loci_of(case, units.branch_of(case, new, 1e-12), new)
    assert loci.keys() == reference_loci(name).keys()
    for kind, locus in loci.items():
        units.assert_same(reference_loci(name)[kind], units.told(locus, case.varied, new), 1e-6)


CHECKED = ("two wells", "hard stop", "Brusselator", "Henon", "Roessler", "relay")


@pytest.mark.parametrize(
    ("name", "unit"), guarding(itertools.product(CHECKED, units.UNITS), ("Henon", "small"), campaign=18, spread=True)
)
def test_branches_pass_verification_in_all_units(name: str, unit: str) -> None:
    checked = verify(units.branch_of(units.CASES[name], units.NAMED[unit], 1e-12))
    assert checked.passed, checked


@pytest.mark.parametrize("unit", guarding((1e-12, 1e-9, 1e-6, 1.0, 1e9), 1e-9, 1e9))
def test_locking_of_an_integrate_and_fire_neuron_ends_at_the_closed_form(unit: float) -> None:
    # u' = I - u + a sin(3 t + s) fires once a period T where I + a (sin s - 3 cos s)/10 = 1/(1 - exp(-T))
    a, T = 0.2, 2.0 * math.pi / 3.0
    branch = units.branch_of(units.CASES["integrate and fire"], units.Units((unit,)), 1e-12)
    found = sorted(point.parameters["I"] for point in branch.special_points.of_type("SN"))
    middle, reach = 1.0 / (1.0 - math.exp(-T)), a / math.sqrt(10.0)
    assert found == pytest.approx([middle - reach, middle + reach], rel=1e-10)


@pytest.mark.parametrize("unit", guarding((1e-9, 1e-6, 1.0, 1e9), 1e-9))
def test_a_state_that_a_constant_drives_has_multipliers_of_its_own_beside_a_larger_one(unit: float) -> None:
    # x and y know nothing of each other's size: x' = -x +- 1 falls by exp(-T) in a period, whatever unit y has
    case = units.CASES["relay"]
    one, found = (units.start_of(case, units.Units(sizes), 1e-12) for sizes in ((1.0,), (unit, 1.0 / unit)))
    assert found.stable
    assert found.period == pytest.approx(one.period, rel=1e-11)
    np.testing.assert_allclose(found.multipliers, one.multipliers, rtol=1e-7, atol=1e-12)


def test_a_reset_that_alone_moves_a_small_state_is_seen() -> None:
    # y falls by exp(-T) between two spikes and rises by b at each: just before one it is b/(exp(T) - 1)
    case = units.CASES["integrate and fire, adaptive"]
    for sizes in ((1.0,), (1e9, 1e-9), (1e-9, 1e9)):
        orbit = units.start_of(case, units.Units(sizes), 1e-12)
        last = orbit.min["y"] / units.Units(sizes).of(2)[1]
        assert last == pytest.approx(0.5 / (math.exp(0.3 * orbit.period) - 1.0), rel=1e-9)


def test_what_is_rounding_of_a_sum_that_vanishes_drives_nothing() -> None:
    field = {"x": "v", "v": "cos(s) - 0.1*v - 2*x", "y": "sin(s)**2 + cos(s)**2 - 1 - y"}
    orbit = solve_orbit(HybridSystem(tuple(field), {}, {"m": Mode(field)}, phase=("s", "1")), x0=[1.0, 0.0, 0.0])
    assert orbit.stable
    assert abs(orbit.max["y"]) < 1e-14


def test_dense_output_is_that_of_the_meshes_whenever_they_were_moved() -> None:
    field = {"x": "1 - (b + 1)*x + x**2*y", "y": "b*x - x**2*y"}
    orbit = find_orbit(HybridSystem.smooth(field, {"b": 2.5}), x0=[1.0, 1.0], tolerance=1e-8)
    problem = orbit.problem()
    finer = type(problem)(problem.system, problem.signature, problem.p, tol=1e-12)
    finer.start(orbit.unknowns)
    nodes = finer.dense()[2].copy()
    finer.resolve(orbit.unknowns)
    places, _, moved, _ = finer.dense()
    assert len(places) == len(moved)
    for low, high, name in zip(nodes.min(axis=0), nodes.max(axis=0), field, strict=True):
        assert moved[:, list(field).index(name)].min() == pytest.approx(low, rel=1e-2)
        assert moved[:, list(field).index(name)].max() == pytest.approx(high, rel=1e-2)
