"""A definition that nobody uses is forgotten with its compiled functions; results keep what they need of it."""

from __future__ import annotations

import gc
import sys
import weakref

import numpy as np
import pytest

import saltus
import systems
from saltus import HybridSystem, Map
from saltus.options import AttractorOptions, SweepOptions
from saltus.system import compiled, generated
from wells import double_well

SHORT = SweepOptions(discard=20, keep=8)


def van_der_pol(k: float) -> HybridSystem:
    return HybridSystem.smooth({"x": "v", "v": f"-{k}*x + (mu - x**2)*v - g*x**3"}, {"mu": 1.0, "g": 0.1})


def smooth():
    system = van_der_pol(1.2345)
    orbit = saltus.find_orbit(system, x0=[2.0, 0.0])
    orbit.sensitivity(["period", "max(x)"])
    saltus.continue_orbit(orbit, "mu", (0.8, 1.2))
    rest = saltus.find_equilibrium(system, x0=[0.0, 0.0])
    (hopf,) = saltus.continue_equilibrium(rest, "mu", (-0.5, 1.5)).special_points
    assert hopf.normal_form.coefficient < 0.0
    saltus.continue_locus(hopf, ("mu", "g"), {"mu": (-1.0, 1.0), "g": (0.05, 0.2)})
    return system


def impacting():
    system = systems.impact_oscillator()
    saltus.run_sweep(system, "A", [0.2, 1.2], options=SHORT)
    saltus.simulate(system, x0=[0.0, 0.0], t_end=20.0)
    return system


def discrete():
    system = Map(("x", "y"), {"a": 0.3, "b": 0.3}, {"x": "1 - a*x**2 + y", "y": "b*x"})
    saltus.continue_orbit(saltus.solve_orbit(system, x0=[0.8, 0.2]), "a", (0.1, 1.0))
    saltus.run_sweep(system, "a", [0.2, 0.5], x0=[0.1, 0.1], options=SHORT)
    return system


def wells():
    system = double_well()
    region = {"x": (-2.0, 2.0), "v": (-2.0, 2.0)}
    found = saltus.find_attractors(system, {}, region, options=AttractorOptions(starts=8))
    saltus.map_basins(system, {}, {"x": (-2, 2, 10), "v": (-2, 2, 10)}, found)
    return system


@pytest.mark.parametrize(
    "used",
    [
        smooth,
        discrete,
        pytest.param(impacting, marks=pytest.mark.campaign),
        pytest.param(wells, marks=pytest.mark.campaign),
    ],
)
def test_a_system_that_nobody_uses_is_forgotten_with_its_functions(used):
    system = used()
    kept = weakref.ref(system), weakref.ref(system.compiled)
    del system
    gc.collect()
    assert [ref() for ref in kept] == [None, None]


@pytest.mark.campaign
def test_of_forgotten_systems_only_the_last_few_modules_stay():
    most = generated._RECENT.maxlen
    stiffness = [1.5 + i / 64 for i in range(most + 4)]
    for k in stiffness:
        van_der_pol(k).field("smooth", [1.0, 1.0])
    gc.collect()
    files = [generated.source_file(compiled.FLOW, van_der_pol(k)) for k in stiffness]
    assert [f"saltus_{file.stem}" in sys.modules for file in files] == [False] * 4 + [True] * most


@pytest.mark.campaign
def test_results_go_on_when_their_system_is_no_longer_at_hand():
    orbit = saltus.find_orbit(van_der_pol(1.75), x0=[2.0, 0.0])
    branch = saltus.continue_orbit(orbit, "mu", (0.8, 1.2))
    for i in range(generated._RECENT.maxlen + 2):
        van_der_pol(2.0 + i / 64).field("smooth", [1.0, 1.0])
    gc.collect()
    (again,) = branch.at(1.1)
    assert saltus.verify(again).passed
    slopes = again.sensitivity(["period"])
    periods = [saltus.continue_orbit(again, "mu", (1.0, 1.2)).at(mu)[0].period for mu in (1.1 - 1e-4, 1.1 + 1e-4)]
    assert float(slopes["period"].sel(parameter="mu")) == pytest.approx(np.diff(periods)[0] / 2e-4, rel=1e-5)
