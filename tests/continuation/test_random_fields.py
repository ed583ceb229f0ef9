"""Special points of random polynomial fields are those of a scan by NumPy, none missed and none false.

The campaign is `benchmarks/random_fields.py`; this is a sample, and fields at which points were once lost.
"""

from __future__ import annotations

import importlib
from collections import Counter
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
SPREAD = ("general", "odd", "plane", "ring")


@pytest.fixture(scope="module")
def campaign():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(BENCHMARKS)
        yield importlib.import_module("random_fields")


def one_of(campaign, kinds, number, seed=1):
    return next((f, start) for index, f, start in campaign.cases(number + 1, seed, kinds) if index == number)


def assert_alike(campaign, f, start, least, name):
    results = Counter()
    assert campaign.examine(f, start, results, name)
    assert results["branches"] == 3
    assert results["points said"] >= 3 * least


@pytest.mark.parametrize("kind", ["general", "odd", "plane", "ring", "dihedral", "alike"])
def test_random_fields_have_the_points_of_a_scan_at_three_steps(campaign, kind):
    sizes = [(f, start) for _, f, start in campaign.cases(12, 7, (kind,)) if f.n in (3, 4)][:2]
    for f, start in sizes:
        assert_alike(campaign, f, start, 0, kind)


@pytest.mark.parametrize(
    ("number", "points"),
    [(42, 8), (85, 5), (173, 8), (195, 9)],
    ids=["beside a fold", "with a neutral saddle", "four real eigenvalues", "a narrow dip"],
)
def test_eigenvalues_that_cross_and_return_within_a_step_are_told(campaign, number, points):
    f, start = one_of(campaign, SPREAD, number)
    assert_alike(campaign, f, start, points, str(number))


def test_five_eigenvalues_that_vanish_at_once_are_located_as_well_as_one(campaign):
    f, start = one_of(campaign, ("dihedral", "alike"), 7)
    assert max(multiplicity for _, multiplicity, _ in campaign.said(f, start, 0.1)[0]) == 5
    assert_alike(campaign, f, start, 1, "alike")


@pytest.mark.parametrize("kind", ["general", "odd", "dihedral"])
def test_random_maps_have_the_points_of_a_scan_at_three_steps(campaign, kind):
    for _, f, start in campaign.cases(2, 11, (kind,), maps=True):
        assert_alike(campaign, f, start, 0, kind)
