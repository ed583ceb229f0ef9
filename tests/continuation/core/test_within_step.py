"""Values that become critical at several places within one step, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from saltus.continuation.core.within_step import border_tests, circle_tests, several_critical


def _several(values, tests):
    def spectra(shares):
        return np.array([values(s) for s in shares], dtype=complex)

    ends = spectra(np.array([0.0, 1.0]))
    return several_critical(spectra, (ends[0], ends[1]), tests)


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
