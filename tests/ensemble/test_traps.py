"""Trapping regions: what they hold, by their definitions; an ensemble sees the same."""

from __future__ import annotations

import numpy as np
import pytest

from saltus.ensemble.ensemble import Ensemble
from saltus.ensemble.traps import DIVERGED, UNDECIDED, Cages, Cells, Ellipsoids, Traps
from saltus.system.hybrid import HybridSystem, Mode, Transition


@pytest.fixture(scope="module")
def regions():
    """Three ellipsoids, two of which overlap, cut by up to two planes, a cage for either mode, and boxes."""
    generator = np.random.default_rng(1)
    ellipsoids = Ellipsoids(
        np.array([[1.0, 0.0], [1.2, 0.1], [-1.0, 0.5]]),
        generator.normal(size=(3, 2, 2)) * 2.0,
        np.array([0, 1, 2], np.uint8),
        np.array([[[1.0, 0.5], [0.0, -1.0]], [[-1.0, 0.0], [0.0, 0.0]], [[0.3, 1.0], [1.0, -0.2]]]),
        np.array([[0.1, 0.2], [0.05, 1.0], [0.15, 0.3]]),
    )
    cages = Cages(
        np.array([[0.0, -1.5], [0.0, 1.5]]),
        generator.normal(size=(2, 2, 2)) + 1j * generator.normal(size=(2, 2, 2)),
        np.array([[0.1, 0.2], [0.0, 0.3]]),
        np.array([1.5, 1.2]),
        np.array([0, 1]),
        np.array([3, 4], np.uint8),
    )
    boxes = np.array([[i, j] for i in range(-3, 4) for j in range(-3, 4) if (i + 2 * j) % 3])
    cells = Cells(np.array([0.1, -0.2]), np.array([0.4, 0.3]), boxes, (boxes[:, 0] % 2 + 5).astype(np.uint8), 2)
    return Traps(2, ellipsoids, cages, cells, limit=3.0)


@pytest.fixture(scope="module")
def points():
    return np.random.default_rng(2).uniform(-3.5, 3.5, (4000, 2))


def by_definition(traps, x, mode):
    """Label of a state, from the regions' definitions alone."""
    if not np.all(np.abs(x) < traps.limit):
        return DIVERGED
    for row in zip(
        *(getattr(traps.cages, key) for key in ("modes", "centres", "rows", "floors", "bounds", "labels")), strict=True
    ):
        of, centre, rows, floors, bound, label = row
        if of == mode and sum(max(abs(r @ (x - centre)), f) for r, f in zip(rows, floors, strict=True)) < bound:
            return label
    e = traps.ellipsoids
    within = [
        all(normal @ (x - centre) < offset for normal, offset in zip(*planes, strict=True))
        for centre, *planes in zip(e.centres, e.normals, e.offsets, strict=True)
    ]
    sizes = [
        np.linalg.norm(shape @ (x - centre)) if inside else np.inf
        for shape, centre, inside in zip(e.shapes, e.centres, within, strict=True)
    ]
    return e.labels[int(np.argmin(sizes))] if min(sizes) < 1.0 else UNDECIDED


@pytest.mark.campaign
def test_a_state_is_in_the_regions_that_hold_it(regions, points):
    seen = set()
    for mode in (0, 1):
        for x in points:
            label = regions.of(x, mode)
            assert label == by_definition(regions, x, mode)
            seen.add(label)
    assert seen == {0, 1, 2, 3, 4, DIVERGED, UNDECIDED}


def test_where_ellipsoids_overlap_the_nearer_centre_counts():
    shapes = np.array([np.eye(1), np.eye(1) / 2.0])
    traps = Traps(1, Ellipsoids(np.array([[0.0], [1.0]]), shapes, np.array([7, 8], np.uint8)))
    assert [traps.of(np.array([x]), 0) for x in (-0.9, 0.2, 0.4, 0.9, 2.9, 3.1)] == [7, 7, 8, 8, 8, UNDECIDED]


def test_beyond_a_plane_of_the_nearer_ellipsoid_the_other_counts():
    both = np.zeros((2, 1)), np.array([[[1.0]], [[1.0]]]), np.array([7, 8], np.uint8)
    traps = Traps(1, Ellipsoids(*both, np.array([[[1.0]], [[0.0]]]), np.array([[0.5], [1.0]])))
    assert [traps.of(np.array([x]), 0) for x in (-0.9, 0.4, 0.5, 0.9, 1.1)] == [7, 7, 8, 8, UNDECIDED]


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e6, -1e7])
def test_what_is_no_number_or_huge_has_diverged(bad):
    assert Traps(2, limit=1e6).of(np.array([0.0, bad]), 0) == DIVERGED


def test_without_regions_nothing_is_decided():
    assert Traps(2).of(np.zeros(2), 0) == UNDECIDED
    assert Traps(2).box_of(np.zeros(2)) == UNDECIDED


def test_a_box_holds_its_lower_corner_and_not_its_upper():
    cells = Cells(np.array([0.0]), np.array([0.5]), np.array([[0], [1], [3]]), np.array([4, 5, 6], np.uint8), 1)
    traps = Traps(1, cells=cells)
    found = [traps.box_of(np.array([x])) for x in (-1e-9, 0.0, 0.49, 0.5, 0.99, 1.0, 1.49, 1.5, 2.0)]
    assert found == [UNDECIDED, 4, 4, 5, 5, UNDECIDED, UNDECIDED, 6, UNDECIDED]


@pytest.fixture(scope="module")
def resting():
    """States that rest, in a mode for either sign of y: what is seen is the trap alone."""
    rest = {"x": "0", "y": "0"}
    return HybridSystem(
        ("x", "y"),
        {},
        {"above": Mode(rest), "below": Mode(rest)},
        [Transition("above", "below", "y", -1), Transition("below", "above", "y", 1)],
    )


@pytest.mark.campaign
def test_an_ensemble_decides_a_start_as_the_regions_do(resting, regions, points):
    traps = Traps(2, regions.ellipsoids, regions.cages, limit=3.0)
    labels, looks = Ensemble(resting, interval=1.0).settle(points, traps, longest=2)
    wanted = [by_definition(traps, x, 0 if x[1] > 0.0 else 1) for x in points]
    np.testing.assert_array_equal(labels, wanted)
    np.testing.assert_array_equal(looks, np.where(labels == UNDECIDED, 2, 0))


@pytest.mark.campaign
def test_an_ensemble_counts_looks_at_boxes_in_a_row(resting, regions, points):
    traps = Traps(2, cells=regions.cells, limit=3.0)
    labels, looks = Ensemble(resting, interval=1.0).settle(points, traps, longest=5)
    inside = (np.abs(points) < 3.0).all(axis=1)
    boxes = np.array([traps.box_of(x) for x in points])
    np.testing.assert_array_equal(labels, np.where(inside, boxes, DIVERGED))
    np.testing.assert_array_equal(looks[inside], np.where(boxes == UNDECIDED, 5, 2)[inside])
    assert set(labels) == {5, 6, DIVERGED, UNDECIDED}
