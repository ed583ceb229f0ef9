"""Special points of random forced orbits and of random cycles, against SciPy's variational equations.

The campaign is `benchmarks/random_cycles.py`; this is a sample, and a system at which a point was once lost.
"""

from __future__ import annotations

import importlib
from collections import Counter
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
FORCED = ("forced", "symmetric", "equal")


@pytest.fixture(scope="module")
def campaign():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(BENCHMARKS)
        yield importlib.import_module("random_cycles")


@pytest.mark.parametrize("number", [0, 1, 2])
def test_random_forced_orbits_have_the_points_that_scipy_explains(campaign, number):
    assert campaign.examine(campaign.drawn(number, 1, FORCED), str(number), Counter())


@pytest.mark.campaign
def test_a_branch_point_next_to_the_end_of_a_step_is_located(campaign):
    results = Counter()
    assert campaign.examine(campaign.drawn(23, 1, FORCED), "equal", results)
    assert results["points"] == 2


@pytest.mark.thorough
@pytest.mark.campaign
def test_random_cycles_have_the_points_that_scipy_explains(campaign):
    assert campaign.examine(campaign.drawn(0, 3, ("born",)), "born", Counter())
