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
