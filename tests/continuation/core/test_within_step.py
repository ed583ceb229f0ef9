"""Values that become critical at several places within one step, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from saltus.continuation.core.value_tests import border_tests, circle_tests
from saltus.continuation.core.within_step import ASIDE, Spectrum, searched, several_critical, steady


def _several(values, tests):
    def spectra(shares):
        return np.array([values(s) for s in shares], dtype=complex)

    ends = spectra(np.array([0.0, 1.0]))
    return searched(spectra, ends, (1.0,), tests)


def _pair(trace, product):
    root = np.emath.sqrt(0.25 * trace * trace - product)
    return [0.5 * trace + root, 0.5 * trace - root]


@pytest.mark.parametrize("size", [0.99, 0.999, 1.001, 1.01, 1.1])
@pytest.mark.parametrize("goal", [1.0, -1.0])
def test_a_pair_that_parts_to_1_or_to_minus_1_and_comes_back(size, goal):
    # trace of size 2 sqrt(d) cos(...) passes 1 + d only where the size exceeds (1 + d)/(2 sqrt(d))
    d = 0.81
    at = (1.0 + d) / (2.0 * np.sqrt(d)) * size

    def values(s):
        return [*_pair(2.0 * np.sqrt(d) * at * goal * np.cos(3.0 * (s - 0.37)), d), *_pair(np.sin(s), 0.3)]

    assert _several(values, circle_tests) == (size > 1.0)


@pytest.mark.parametrize("depth", [-1e-2, -1e-4, 1e-4, 1e-2])
def test_a_pair_that_touches_the_imaginary_axis(depth):
    def values(s):
        return [*_pair(2.0 * (depth - (s - 0.6) ** 2), 2.0), -0.5, -3.0 + s]

    assert _several(values, border_tests) == (depth > 0.0)


@pytest.mark.parametrize("tests", [circle_tests, border_tests])
def test_one_value_that_enters_while_another_leaves(tests):
    at = 1.0 if tests is circle_tests else 0.0
    assert _several(lambda s: [at + 0.1 * (s - 0.3), at + 0.3 * (0.7 - s), at - 0.6], tests)


def test_equal_values_cross_together():
    assert not _several(lambda s: [0.9 + 0.2 * s, 0.9 + 0.2 * s, 0.3, -0.5 - 0.1 * s], circle_tests)


def test_real_values_whose_product_is_1_are_not_a_pair():
    assert not _several(lambda s: [2.0 + s, 0.5 - 0.2 * (s - 0.5) ** 2 + 0.01], circle_tests)


def test_values_that_move_steadily_are_told():
    rows = [[0.6 + 0.02 * k, 0.3 + 0.5j + 0.01 * k, 0.3 - 0.5j + 0.01 * k, 0.05 * (-1) ** k] for k in range(3)]
    assert steady(rows, (1.0, 1.0), circle_tests)


@pytest.mark.parametrize(
    "row", [[0.9, 0.99, 0.98], [0.5, 0.7, 1.1], [0.3 + 1e-9j, 0.3, 0.3]], ids=["bends to 1", "moves far", "parts"]
)
def test_values_that_may_come_back_are_told(row):
    rows = [[value, np.conj(value)] if np.iscomplexobj(row) else [value] for value in row]
    assert not steady(rows, (1.0, 1.0), circle_tests)


def test_a_value_that_passes_infinity_is_not_taken_to_cross():
    assert _several(lambda s: [1.0 / (0.3 * (s - 0.4) + 1e-3), 0.5], circle_tests) is False


def test_nothing_is_known_where_a_value_is_no_number():
    assert _several(lambda s: [np.nan if 0.4 < s < 0.6 else 0.5], circle_tests) is None


@pytest.mark.parametrize(("apart", "others"), [(0.1, 0), (0.4, 0), (0.1, 1)])
def test_a_value_that_touches_1_at_a_fold_and_a_branch_point(apart, others):
    """Two zeros near each other are these; two that lie far apart are not, nor any third one."""

    def values(s):
        return [1.0 - (s - 0.3) * (s - 0.3 - apart), 0.5 + others * (s + 0.05)]

    def spectra(shares):
        return np.array([values(s) for s in shares], dtype=complex)

    places = spectra(np.array([0.0, ASIDE, 1.0 - ASIDE, 1.0]))
    ends = Spectrum(places[0], places[1], ASIDE), Spectrum(places[3], places[2], -ASIDE)
    assert several_critical(spectra, *ends, circle_tests)
    assert several_critical(spectra, *ends, circle_tests, touches=True) == (apart > 0.25 or others > 0)
