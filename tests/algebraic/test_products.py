"""Products of many factors by sign and size."""

from __future__ import annotations

import numpy as np
import pytest

from saltus.algebraic.products import combined, pairs


def test_the_sign_is_that_of_the_product_and_it_vanishes_with_a_factor():
    factors = np.random.default_rng(1).normal(size=(40, 9)) + 0j
    np.testing.assert_array_equal(np.sign(combined(factors)), np.sign(np.prod(factors.real, axis=-1)))
    factors[3, 4] = 0.0
    assert combined(factors)[3] == 0.0


def test_the_size_is_near_the_smallest_factor_however_many_there_are():
    for count in (1, 10, 300):
        found = float(combined(np.array([1e-6] + [5.0] * (count - 1)) + 0j))
        assert found == pytest.approx(1e-6, rel=1e-3)


def test_pairs_of_complex_factors_count_by_their_moduli():
    pair = np.array([1.0 + 2.0j, 1.0 - 2.0j, -3.0])
    wanted = -((2.0 / 5.0 + 1.0 / 9.0) ** -0.5)
    assert float(combined(pair)) == pytest.approx(wanted, rel=1e-12)


def test_pairs_are_all_pairs_once():
    first, second = pairs(5)
    assert {(int(a), int(b)) for a, b in zip(first, second, strict=True)} == {
        (a, b) for a in range(5) for b in range(a + 1, 5)
    }
