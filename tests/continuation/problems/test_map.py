"""Points of branches of maps whose multipliers part to 1 or -1 and come back within a step, against closed forms."""

from __future__ import annotations

import pytest

import saltus
from chains import chain_of_a_map, unlike
from selection import guarding

CASES = [(seed, start, h) for seed in range(16) for start in (0.0, 3.0) for h in (0.02, 0.1, 0.3)]


@pytest.mark.parametrize(("seed", "start", "h"), guarding(CASES, (0, 0.0, 0.1), (1, 3.0, 0.3), campaign=16))
def test_a_chain_has_all_its_points(seed, start, h):
    system, known = chain_of_a_map(seed)
    orbit = saltus.solve_orbit(system, {"p": start}, x0=[0.0] * len(system.states))
    branch = saltus.continue_orbit(orbit, "p", (0.0, 3.0), steps=saltus.StepControl(largest=h))
    assert unlike(branch, known) == ([], [])
