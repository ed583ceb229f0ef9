"""`verify` allows what a result may be off by its own condition: no right result is told to be wrong."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

import saltus
from saltus.verification.table import AGREES, UNCHECKED
from selection import guarding


def in_phase(count: int, seed: int, reset: str = "-e*v{i}") -> saltus.HybridSystem:
    """Return equal impact oscillators in a ring, coupled by springs."""
    draw = np.random.default_rng(seed)
    ranges = {"A": (0.6, 1.2), "w": (1.2, 1.7), "e": (0.5, 0.9), "k": (0.05, 0.3), "d": (0.3, 0.6)}
    p = {name: draw.uniform(*ends) for name, ends in ranges.items()}
    field = {}
    for i in range(count):
        both = " ".join(f"- k*(x{i} - x{j})" for j in {(i + 1) % count, (i - 1) % count} - {i})
        field |= {f"x{i}": f"v{i}", f"v{i}": f"A*cos(th) - x{i} - 0.1*v{i} {both}"}
    hits = [
        saltus.Transition("m", "m", f"x{i} - d", 1, {f"v{i}": reset.format(i=i)}, name=f"h{i}") for i in range(count)
    ]
    return saltus.HybridSystem(tuple(field), p, {"m": saltus.Mode(field)}, hits, phase=("th", "w"))


@pytest.mark.parametrize(("count", "seed"), guarding([(n, s) for n in (2, 3, 4) for s in range(6)], (3, 1), campaign=4))
def test_equal_oscillators_in_phase_are_admissible(count, seed):
    orbit = saltus.find_orbit(in_phase(count, seed), x0=[0.0] * 2 * count)
    checked = saltus.verify(orbit)
    assert checked.passed, checked
    last = orbit.durations.copy()
    short = np.flatnonzero(last < 1e-9 * orbit.period)
    if short.size:
        last[short[-1]] = -1e-17  # rounding of the other sign tells the same
        assert saltus.verify(replace(orbit, durations=last)).passed
        last[short[-1]] = -1e-3 * orbit.period
        rows = saltus.verify(replace(orbit, durations=last)).failures
        assert "admissible" in {row.what for row in rows}


def test_events_of_one_instant_whose_order_matters_cannot_be_judged():
    # a hit on one wall throws the other oscillator as well: the resets do not commute
    field = {"x": "v", "v": "cos(th) - x", "y": "u", "u": "cos(th) - y"}
    hits = [
        saltus.Transition("m", "m", "x - d", 1, {"v": "-e*v", "u": "u - c*v*v"}, name="a"),
        saltus.Transition("m", "m", "y - d", 1, {"u": "-e*u"}, name="b"),
    ]
    system = saltus.HybridSystem(
        tuple(field), {"d": 0.3, "e": 0.8, "c": 0.0}, {"m": saltus.Mode(field)}, hits, phase=("th", 1.4)
    )
    orbit = saltus.find_orbit(system, x0=[0.0] * 4)
    durations = orbit.durations.copy()
    durations[np.argmin(durations)] = -1e-18
    for c, verdict in ((0.0, AGREES), (0.1, UNCHECKED)):
        other = replace(orbit, durations=durations, parameters={**orbit.parameters, "c": c})
        (row,) = [row for row in saltus.verify(other) if row.what == "admissible"]
        assert row.verdict == verdict


@pytest.mark.parametrize("seed", guarding(range(8), 6, campaign=1))
def test_branches_with_folds_pass_however_much_errors_grow_within_a_period(seed):
    draw = np.random.default_rng(seed)
    g, _, k, a = draw.uniform(2, 5), draw.uniform(0.5, 2), draw.integers(1, 4), draw.uniform(0.2, 1)
    field = {"x": f"m + 1.5*x - x**3 + g*cos({k}*th)*x + a*sin(th)", "y": "x - 2*y + g*sin(th)*y"}
    system = saltus.HybridSystem(("x", "y"), {"m": -8.0, "g": g, "a": a}, {"q": saltus.Mode(field)}, phase=("th", 1.0))
    branch = saltus.continue_orbit(saltus.find_orbit(system, x0=[-1.5, 0.0]), "m", (-8.0, 8.0))
    checked = saltus.verify(branch)
    assert checked.passed, checked
    wrong = branch.multipliers.copy()
    wrong[len(wrong) // 2] *= 1.0 + 1e-2
    assert not saltus.verify(replace(branch, multipliers=wrong)).passed


def test_the_highest_of_maxima_that_are_nearly_equal_is_found():
    outputs = {"h": "cos(7*th) - 1e-5*cos(th - 1.9)", "flat": "1 + 0*x"}
    system = saltus.HybridSystem.smooth({"x": "cos(th) - x"}, {"w": 1.0}, phase=("th", "w"), outputs=outputs)
    orbit = saltus.find_orbit(system, x0=[0.0])
    known = max(
        -minimize_scalar(
            lambda t: 1e-5 * math.cos(t - 1.9) - math.cos(7.0 * t),
            bounds=(2.0 * math.pi * (i - 0.5) / 7.0, 2.0 * math.pi * (i + 0.5) / 7.0),
            method="bounded",
            options={"xatol": 1e-10},
        ).fun
        for i in range(7)
    )
    assert orbit.max["h"] == pytest.approx(known, abs=1e-12)
    assert saltus.verify(orbit).passed


def test_doubled_orbits_of_a_map_pass_where_they_begin():
    logistic = saltus.Map(("x",), {"r": 2.8}, {"x": "r*x*(1 - x)"})
    fixed = saltus.continue_orbit(saltus.solve_orbit(logistic, x0=[0.64]), "r", (1.5, 3.9))
    doubled = saltus.continue_orbit(saltus.switch_branch(fixed["PD1"]), "r", (2.5, 3.9))
    checked = saltus.verify(doubled)
    assert checked.passed, checked
    wrong = doubled.multipliers * (1.0 + 1e-6)
    assert "column multipliers" in {row.what for row in saltus.verify(replace(doubled, multipliers=wrong)).failures}
