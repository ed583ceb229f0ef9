"""Points of branches of equilibria whose eigenvalues cross the axis and come back within a step, by closed forms."""

from __future__ import annotations

import pytest

import saltus
from chains import chain_of_a_field, unlike
from selection import guarding

CASES = [(seed, start, h) for seed in range(16) for start in (0.0, 3.0) for h in (0.02, 0.1, 0.3)]


@pytest.mark.parametrize(("seed", "start", "h"), guarding(CASES, (2, 3.0, 0.3), campaign=16))
def test_a_chain_has_all_its_points(seed, start, h):
    system, known = chain_of_a_field(seed)
    start_at = saltus.find_equilibrium(system, {"p": start}, [0.0] * len(system.states))
    branch = saltus.continue_equilibrium(start_at, "p", (0.0, 3.0), steps=saltus.StepControl(largest=h))
    assert unlike(branch, known) == ([], [])
