"""Inner functions of kernels: their results are, bit by bit, those of the same text compiled by Numba."""

from __future__ import annotations

import ctypes
import math
from typing import NamedTuple

import numba
import numpy as np
import pytest
from numba import float64, int64, types

from saltus.ensemble.kernels.lanes import circular_sin, halley, polynomial, products
from saltus.system.numba_tools.machine_code import Addressed, njit, shared
from saltus.system.numba_tools.pointers import INNER, PART, keep, pointer, stack

WEIGHTS = (0.3, -0.7, 1.9)
TABLE = np.array([[1.5, -2.5], [0.25, 4.0]])
LAST = 2


class Pair(NamedTuple):
    first: float
    second: int


class Both(NamedTuple):
    pair: Pair
    numbers: object


def a_name_that_widens(x, n):
    total, count = 0, 0
    for i in range(n):
        total += x * i
        count += 1
    return total, count


def a_branch_that_widens(x, n):
    y = 1 if n > 3 else 0.5 * x
    z = x
    if n > 2:
        z = n
    return y / 3, z / 7


def whole_numbers(x, n):
    m, k = n - 7, 3 - n if n != 3 else 5
    return m // 3, m % 3, -m // 4, (m * k) % 5, m // k, abs(m), m << 2, (m | 5) & 6, True + m, int(x), -m


def floors(x, n):
    return x // 0.3, x % 0.3, -x // 0.7, x % -0.4, math.floor(x), math.ceil(x), math.floor(-x)


def powers(x, n):
    return (
        x**2,
        (abs(x) + 0.1) ** -3,
        x**0,
        (abs(x) + 0.1) ** 0.125,
        abs(x) ** -0.5,
        n**0.5,
        n**2,
        n**3,
        (x + 1.0) ** 7,
    )


def extremes(x, n):
    nothing = math.nan * x
    return max(x, 1.0, n), min(n, 3), max(nothing, x), max(x, nothing), min(nothing, 1.0), min(1.0, nothing), max(n, 2)


def results_that_widen(x, n):
    if n > 5:
        return 1, (n, True)
    if n > 2:
        return x, (2.5, n > 3)
    return n, (0, False)


def conditions(x, n):
    inside = 0.0 < x <= 1.0 and n != 4
    outside = not inside or (x > 0.5 and n > 1)
    if x and n:
        inside = not inside
    chain = -1 < n < 5 <= 2 * n
    return inside, outside, chain, inside | chain, 1 if outside else 0, x != x, inside == chain, not n, not x


def loops(x, n):
    found, steps = -1, 0
    for i in range(n, -1, -1):
        if i % 2 == 0:
            continue
        if x * i < 1.5:
            found = i
            break
        steps += 1
    while True:
        steps += 1
        if steps > n:
            return found, steps, i
        for j in range(2, 20, 5):
            if j > n:
                break
            steps += j


def weights(x, n):
    total, chosen = 0.0, 0.0
    for k in range(len(WEIGHTS)):
        total += WEIGHTS[k] * x
    for place in (0.37, 0.71, 1.0):
        chosen = chosen * x + place
        if chosen > 2.0:
            break
    row = pointer(TABLE, LAST)
    return total, chosen, TABLE[1, 0], TABLE[n % 2, -1], row[1], WEIGHTS[LAST], TABLE.size, TABLE.shape[1], math.pi * x


def records(x, n):
    pair = Pair(x, n)
    both = Both(pair, (x, n, (2.0 * x, -n)))
    a, b, (c, d) = both.numbers
    a, c = c, a
    other = Pair(*pair)
    if n > 2:
        other = Pair(2.0 * b, n + 1)
    return both.pair.first, other, a - c, d, Pair(*both.pair)


def scratch(x, n):
    total = 0.0
    for i in range(n):
        numbers = np.empty(i + 2)
        numbers[0] = x
        numbers[-1] = i
        at = pointer(numbers, 1)
        for k in range(i):
            at[k] = numbers[k] + 0.1 * k
        total += numbers[i // 2] * at[i]
        keep(numbers)
    few = stack(int64, 3)
    for k in range(3):
        few[k] = k > 1
    few[0] += n
    return total, few[0], few[2]


def elementary(x, n):
    y = abs(x) + 0.5
    return (
        math.sqrt(y), math.log(y), math.exp(x), math.sin(x), math.cos(n * x), math.copysign(y, -x), math.isnan(x),
        math.isfinite(x / n), math.sqrt(n), math.inf * x, -0.0 * x,
    )  # fmt: skip


TEXTS = (
    a_name_that_widens,
    a_branch_that_widens,
    whole_numbers,
    floors,
    powers,
    extremes,
    conditions,
    loops,
    weights,
    scratch,
    elementary,
)
CASES = [(x, n) for n in (1, 2, 3, 4, 6, 11) for x in (-1.7, -0.3, 0.0, 0.45, 0.999, 3.3e4)]


def by_both(text):
    """Return a text as an inner function, called from a kernel, and as a function of Numba's."""
    lowered = njit(**INNER)(text)

    @numba.njit(error_model="numpy")
    def kernel(x, n):
        return lowered(x, n)

    return kernel, numba.njit(error_model="numpy")(text)


@pytest.mark.parametrize("text", TEXTS, ids=lambda text: text.__name__)
def test_results_are_those_of_numba_bit_by_bit(text):
    lowered, wanted = by_both(text)
    for x, n in CASES:
        one, other = lowered(x, n), wanted(x, n)
        assert list(map(type, one)) == list(map(type, other))
        np.testing.assert_array_equal(
            np.array(one, float).view(np.int64), np.array(other, float).view(np.int64), (x, n)
        )


def test_records_come_back_as_records():
    lowered, wanted = by_both(records)
    for x, n in CASES:
        assert lowered(x, n) == wanted(x, n)
    assert type(lowered(1.0, 3)[1]) is Pair


def test_inner_functions_of_inner_functions_are_not_compiled_by_numba():
    @njit(**PART)
    def square(x):
        return x * x

    @njit(**INNER)
    def sum_of_squares(numbers, n):
        total = 0.0
        for i in range(n):
            total += square(numbers[i])
        return total

    @numba.njit
    def kernel(numbers):
        return sum_of_squares(numbers, numbers.size), sum_of_squares(pointer(numbers, 1), 2)

    numbers = np.arange(5.0)
    with numba.core.event.install_recorder("numba:run_pass") as passes:
        assert kernel(numbers) == (30.0, 5.0)
    compiled = [event for _, event in passes.buffer if event.data["name"].startswith("nopython_type_inference")]
    assert len({event.data["qualname"] for event in compiled}) == 1


def test_what_the_language_lacks_is_refused():
    def listed(x, n):
        return sum([x, n])

    kernel, _ = by_both(listed)
    with pytest.raises(NotImplementedError, match=r"\[x, n\] in the inner function .*listed"):
        kernel(1.0, 2)


def test_a_result_that_is_an_integer_first_is_a_float():
    lowered, wanted = by_both(results_that_widen)
    for x, n in CASES:
        assert lowered(x, n) == wanted(x, n)
        assert list(map(type, lowered(x, n))) == [float, tuple]


NUMBERS = types.CPointer(float64)
WAVE = {"error_model": "numpy", "fastmath": {"contract", "nsz"}}


@shared(**WAVE)
def turned(k, S, n, p, q):
    for i in range(n):
        g, change, slope = halley(p[0], p[1], p[2], S[i], p[3])
        S[i] = circular_sin(S[i]) + products(S[i], p[1], p[2], p[3]) - polynomial(g, p[0], change, slope)
    return n - k


def test_a_function_called_by_its_address_is_that_of_numba_bit_by_bit():
    address = Addressed(turned, (int64, NUMBERS, int64, NUMBERS, NUMBERS)).address
    pointer_type = ctypes.POINTER(ctypes.c_double)
    by_address = ctypes.CFUNCTYPE(
        ctypes.c_int64, ctypes.c_int64, pointer_type, ctypes.c_int64, pointer_type, pointer_type
    )(address)

    @numba.njit(**WAVE)
    def by_numba(S, p):
        return turned(3, pointer(S, 0), S.size, pointer(p, 0), pointer(p, 0))

    p, one = np.array([0.1, -0.4, 1.3, 0.2]), np.linspace(-40.0, 40.0, 64)
    other = one.copy()
    given = [array.ctypes.data_as(pointer_type) for array in (one, p)]
    assert by_address(3, given[0], 64, given[1], given[1]) == by_numba(other, p) == 61
    np.testing.assert_array_equal(one.view(np.int64), other.view(np.int64))
    assert np.isfinite(one).all()
