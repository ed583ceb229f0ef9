"""Compiled linear algebra and bits against NumPy."""

from __future__ import annotations

import numpy as np
import pytest

from saltus.system.hybrid import HybridSystem
from saltus.system.numba_tools import bits, linear
from saltus.system.numba_tools.machine_code import kernel, njit


@pytest.mark.parametrize("m", [1, 2, 5, 9])
def test_solutions_and_determinants_are_numpy_s(m):
    random = np.random.default_rng(m)
    matrix, rhs = random.normal(size=(m, m)), random.normal(size=(m, 3))
    solved = rhs.copy()
    sign, log = linear.solve(matrix.copy(), solved)
    np.testing.assert_allclose(solved, np.linalg.solve(matrix, rhs), rtol=1e-10)
    assert (sign, log) == pytest.approx(np.linalg.slogdet(matrix), rel=1e-12)


def test_rows_are_exchanged_where_a_pivot_vanishes():
    solved = np.array([[1.0], [2.0]])
    assert linear.solve(np.array([[0.0, 2.0], [4.0, 0.0]]), solved) == pytest.approx((-1.0, np.log(8.0)))
    np.testing.assert_array_equal(solved, [[0.5], [0.5]])


def test_a_singular_matrix_has_no_sign():
    assert linear.solve(np.ones((2, 2)), np.ones((2, 1))) == (0.0, -np.inf)


def test_a_bordered_step_solves_its_equations():
    random = np.random.default_rng(4)
    J, F, row, u = random.normal(size=(3, 4)), random.normal(size=3), random.normal(size=4), random.normal(size=4)
    guess, scale = random.normal(size=4), np.array([1.0, 2.0, 4.0, 0.5])
    solutions, sign, log, size, top = linear.bordered(J, F, row, u, guess, scale)
    matrix = np.vstack([J, row])
    np.testing.assert_allclose(matrix @ solutions[:, 0], [*-F, -row @ (u - guess)], atol=1e-12)
    np.testing.assert_allclose(matrix @ solutions[:, 1], [0.0, 0.0, 0.0, 1.0], atol=1e-12)
    assert (sign, log) == pytest.approx(np.linalg.slogdet(matrix), rel=1e-10)
    assert size == pytest.approx(np.max(np.abs(solutions[:, 0]) / scale))
    assert top == pytest.approx(np.max(np.abs(F) / scale[:3]))


@pytest.mark.parametrize("unit", [1e-3, 1e-9, 1e-12])
def test_a_bordered_step_keeps_its_digits_in_units_far_apart(unit):
    random = np.random.default_rng(5)
    J, F, row, u = random.normal(size=(5, 6)), random.normal(size=5), random.normal(size=6), random.normal(size=6)
    known, sign, log, *_ = linear.bordered(J, F, row, u, u, np.ones(6))
    columns, rows = unit ** np.array([1.0, -1.0, 0.0, 1.0, 0.0, 0.0]), unit ** np.array([1.0, -1.0, 0.5, 1.0, 0.0])
    other = linear.bordered(J * rows[:, None] / columns, F * rows, row / columns, u * columns, u * columns, columns)
    np.testing.assert_allclose(other[0] / columns[:, None], known, rtol=1e-12)
    assert other[1] == sign
    assert other[2] == pytest.approx(log + np.log(rows).sum() - np.log(columns).sum(), rel=1e-10)


@njit()
def there_and_back(number):
    return bits.bits_of(number), bits.float_of(bits.bits_of(number))


@pytest.mark.parametrize("number", [0.0, 1.0, -2.5, 1e-310, np.inf])
def test_bits_are_those_of_ieee_754(number):
    whole, back = there_and_back(number)
    assert whole == int(np.float64(number).view(np.int64))
    assert back == number


def _scaled(values, factor, out):
    """Write multiples of values; return the largest one and how many are negative."""
    largest, negative = -np.inf, 0
    for i in range(values.size):
        out[i] = factor * values[i]
        largest = max(largest, out[i])
        negative += 1 if out[i] < 0.0 else 0
    return largest, negative


def test_a_kernel_does_what_numba_makes_of_its_text():
    values = np.random.default_rng(1).normal(size=20)
    out, expected = np.empty(20), np.empty(20)
    assert kernel(_scaled)(values, 1.7, out) == njit(error_model="numpy")(_scaled)(values, 1.7, expected)
    assert np.array_equal(out, expected)


def test_a_kernel_refuses_an_array_with_gaps():
    values = np.arange(20.0)
    with pytest.raises(NotImplementedError, match="in an inner function"):
        kernel(_scaled)(values[::2], 1.0, np.empty(10))


@pytest.fixture(scope="module")
def compiled():
    return HybridSystem.smooth({"x": "exp(-a)*x"}, {"a": 2.0}).compiled


def test_a_generated_function_reads_arrays_that_cannot_be_written(compiled):
    x, p = np.array([3.0]), np.array([0.5])
    x.flags.writeable = p.flags.writeable = False
    assert compiled.field(0, x, p)[0] == pytest.approx(3.0 * np.exp(-0.5), rel=1e-15)


def test_a_generated_function_refuses_an_array_with_gaps(compiled):
    with pytest.raises(TypeError, match="contiguous"):
        compiled.call("field", 0, 0, np.ones(4)[::2], compiled.extended(np.array([0.5])), np.empty(1))


def test_constants_are_those_of_the_parameters_given_and_belong_to_the_caller(compiled):
    first = compiled.extended(np.array([0.5]))
    first[:] = np.nan
    again, other = compiled.extended(np.array([0.5])), compiled.extended(np.array([1.5]))
    assert abs(again[-1]) == pytest.approx(np.exp(-0.5), rel=1e-15)
    assert abs(other[-1]) == pytest.approx(np.exp(-1.5), rel=1e-15)
    np.testing.assert_array_equal(compiled.extended(np.array([0.5])), again)
