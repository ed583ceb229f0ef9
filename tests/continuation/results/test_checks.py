"""The audit simulates orbits with events afresh, from their segments' starts."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import saltus
from saltus.continuation.results.auditing import audited


def one_hit_a_turn(e: float) -> saltus.PeriodicOrbit:
    """The orbit of a preloaded mass that hits its wall once a turn, in closed form; its flight may pass the wall."""
    modes = {"fly": saltus.Mode({"x": "v", "v": "-1 + F*cos(th)"})}
    hit = saltus.Transition("fly", "fly", "x", -1, {"v": "-e*v"}, name="hit")
    system = saltus.HybridSystem(("x", "v"), {"F": 3.2, "e": e}, modes, [hit], phase=("th", 1.0))
    v = e * 2.0 * math.pi / (1.0 + e)
    start = [0.0, v, math.asin((v - math.pi) / 3.2)]
    return saltus.solve_orbit(system, segments=[("fly", "hit", start, 2.0 * math.pi)])


@pytest.mark.parametrize("e", [0.001, 1e-5])
def test_the_audit_tells_orbits_that_a_simulation_leaves(e: float) -> None:
    branch = saltus.continue_orbit(one_hit_a_turn(e), "F", (3.2, 3.22))
    assert not branch.admissible.any()
    assert branch.audit.passed  # nothing is claimed of orbits that are not admissible
    false = audited(replace(branch, admissible=np.ones_like(branch.admissible)))
    assert {breach.check for breach in false.audit.breaches} == {"afresh"}
    assert "meets 'hit'" in str(false.audit)


def test_the_audit_passes_orbits_that_a_simulation_follows() -> None:
    branch = saltus.continue_orbit(one_hit_a_turn(0.02), "F", (3.2, 3.22))
    assert branch.admissible.all()
    assert branch.audit.passed
    assert dict(branch.audit.checked)["afresh"] >= 1


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_liouville_tells_of_hits_in_any_unit(unit: float) -> None:
    """The determinant of a hit is e**2, and the flight between has the divergence 0, whatever the unit of length is."""
    values = {"g": unit, "e": 0.6, "a": 1.4 * unit}
    modes = {"fly": saltus.Mode({"z": "v", "v": "-g"})}
    hit = saltus.Transition("fly", "fly", "z - a*sin(th)", -1, {"v": "-e*v + (1 + e)*a*cos(th)"}, name="hit")
    system = saltus.HybridSystem(("z", "v"), values, modes, [hit], phase=("th", 1.0))
    phase = math.acos(0.4 / 1.6 * math.pi / 1.4)
    start = [1.4 * unit * math.sin(phase), math.pi * unit, phase]
    orbit = saltus.solve_orbit(system, segments=[("fly", "hit", start, 2.0 * math.pi)])
    branch = saltus.continue_orbit(orbit, "e", (0.6, 0.7))
    assert np.prod(np.abs(branch.multipliers), axis=1) == pytest.approx(branch.values**2, rel=1e-9)
    assert dict(branch.audit.checked)["Liouville"] == 1
    false = audited(replace(branch, multipliers=1.1 * branch.multipliers))
    assert "Liouville" in {breach.check for breach in false.audit.breaches}
