"""The labels of the paper's basins, and the one-period map they rest on, are as exact as is said of them.

The measurement is `benchmarks/basin_accuracy.py`, which on 20 000 cells a grid takes minutes; this is a small one.
"""

from __future__ import annotations

import importlib
from pathlib import Path
from types import ModuleType

import pytest
from scipy.stats import binom

BENCHMARKS = Path(__file__).parents[3] / "benchmarks"


@pytest.fixture(scope="module")
def accuracy():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(BENCHMARKS)
        yield importlib.import_module("basin_accuracy")


def wrong_at_most(cells: int, share: float) -> int:
    """How many wrong labels a method with this share of them exceeds in one of a hundred samples."""
    return int(binom.ppf(0.99, cells, share))


def errors_in(accuracy: ModuleType, cells: int, *, planes: bool) -> tuple[int, int]:
    """Wrong labels, and cells, of all planes, or of all grids of more dimensions."""
    names = [name for name, (_, grid) in accuracy.grids().items() if (len(grid.shape) == 2) == planes]
    found = [accuracy.label_errors(name, cells, seed=7) for name in names]
    assert sum(row.undecided for row in found) == 0
    return sum(row.wrong for row in found), sum(row.cells for row in found)


@pytest.mark.campaign
def test_labels_of_the_planes_are_where_motions_converge(accuracy):
    wrong, cells = errors_in(accuracy, 300, planes=True)
    assert wrong <= wrong_at_most(cells, accuracy.WRONG["plane"])


@pytest.mark.campaign
@pytest.mark.thorough
def test_labels_of_the_boxes_are_where_motions_converge(accuracy):
    wrong, cells = errors_in(accuracy, 1000, planes=False)
    assert wrong <= wrong_at_most(cells, accuracy.WRONG["box"])


@pytest.mark.campaign
def test_wrong_labels_are_counted(accuracy):
    """At a tolerance of 0.01 so many labels of the box flip that the bound of the test above is passed."""
    found = accuracy.label_errors("[-5, 5]^4", 2000, seed=7, tolerance=1e-2)
    assert found.wrong > wrong_at_most(found.cells, found.allowed)
    assert len(found.examples) == min(found.wrong, accuracy.SHOWN)


@pytest.mark.campaign
def test_the_map_of_lanes_is_that_of_the_event_driven_flow(accuracy):
    error = accuracy.map_error(500, seed=8)
    assert error.median <= accuracy.MEDIAN
    assert error.percentile_99 <= accuracy.PERCENTILE_99


@pytest.mark.campaign
def test_the_map_of_lanes_is_that_of_another_solver(accuracy):
    error = accuracy.map_error_by_scipy(30, seed=9)
    assert error.median <= accuracy.MEDIAN


@pytest.mark.campaign
def test_the_error_of_the_map_follows_the_tolerance(accuracy):
    loose, tight = (accuracy.map_error(100, seed=8, tolerance=tolerance) for tolerance in (1e-4, 1e-10))
    assert loose.median > 100.0 * tight.median
    assert loose.median > accuracy.MEDIAN
