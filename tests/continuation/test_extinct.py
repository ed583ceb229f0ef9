"""Orbits that a motion decays to: all states die out, and the branch of the rest is the same as from 0 itself.

Populations, amplitudes and kicks whose multiplier has a closed form, so that the branch point does as well.
"""

import math

import numpy as np
import pytest

import saltus
from saltus import Mode, Transition
from selection import guarding


def seasonal(unit: float, size: int, rng: np.random.Generator) -> tuple[saltus.HybridSystem, float, str]:
    """Return a population in a season, with others that it feeds; its growth is 0 at 0.3."""
    swing = rng.uniform(0.1, 0.9)
    fields = {"n0": f"n0*(a*(1 + {swing!r}*cos(s)) - 0.3 - n0/{unit!r})"}
    fields |= {f"n{i}": f"{rng.uniform(0.1, 0.5)!r}*n{i - 1} - {rng.uniform(0.5, 2.0)!r}*n{i}" for i in range(1, size)}
    return saltus.HybridSystem.smooth(fields, {"a": 0.2}, phase=("s", "1")), 0.3, "BP"


def kicked(unit: float, size: int, rng: np.random.Generator) -> tuple[saltus.HybridSystem, float, str]:
    """Return amplitudes that decay and are turned over once a period; the first is doubled at 1."""
    rates = rng.uniform(0.1, 0.3, size).tolist()
    fields = {f"n{i}": f"-{rate!r}*n{i}" for i, rate in enumerate(rates)}
    turned = f"-exp({2.0 * math.pi * rates[0]!r})*a*n0 + {100.0 / unit**2!r}*n0**3"
    reset = {"n0": turned} | {f"n{i}": f"0.5*n{i} + 0.1*n{i - 1}" for i in range(1, size)}
    kick = Transition("m", "m", at_phase=0, reset=reset, name="kick")
    return saltus.HybridSystem([*fields], {"a": 0.8}, {"m": Mode(fields)}, [kick], phase=("s", "1")), 1.0, "PD"


@pytest.mark.parametrize("tolerance", guarding((1e-12, 1e-8, 1e-5), 1e-12))
@pytest.mark.parametrize("unit", guarding((1.0, 1e-9, 1e9), 1.0))
@pytest.mark.parametrize("kind", [seasonal, kicked])
def test_branch_of_what_dies_out(kind, unit, tolerance):
    rng = np.random.default_rng(8)
    for size in (1, 2, 3):
        system, critical, label = kind(unit, size, rng)
        start = saltus.find_orbit(system, x0=np.full(size, 0.02 * unit), tolerance=tolerance)
        assert not np.any(start.x0), start
        branch = saltus.continue_orbit(start, "a", (0.1, 1.5))
        assert sorted(branch.stopped) == ["a = 0.1: bound reached", "a = 1.5: bound reached"]
        assert [point.type for point in branch.special_points] == [label], branch
        assert abs(branch.special_points[0].parameters["a"] - critical) < max(1e-9, 30.0 * tolerance), branch
        np.testing.assert_array_equal(branch.stable, branch.values < branch.special_points[0].parameters["a"])
        assert not branch.audit.breaches, branch


@pytest.mark.parametrize("share", guarding([0.0, 0.2, 0.4, 0.6, 0.8], 0.2))
def test_a_branch_is_as_long_from_where_a_population_is_least(share):
    """Prey of 1e-16 of its size at the start is solved for in its own unit. The period is SciPy's, in logarithms."""
    eaten = "x*y/(0.22569475 + x)"
    field = {"x": f"x*(1 - x/K) - {eaten}", "y": f"1.1006372326*{eaten} - 0.25920262665*y"}
    system = saltus.HybridSystem.smooth(field, {"K": 2.3})
    orbit = saltus.find_orbit(system, x0=[0.7, 0.1])
    start = saltus.simulate(system, x0=orbit.x0, t_end=orbit.period)(share * orbit.period)
    branch = saltus.continue_orbit(saltus.solve_orbit(system, x0=start, period=orbit.period), "K", (2.3, 2.5))
    assert branch.stopped == ("K = 2.3: bound reached", "K = 2.5: bound reached")
    assert len(branch) < 60
    assert branch.column("period")[-1] == pytest.approx(74.34934902, rel=1e-7)
