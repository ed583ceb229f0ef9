"""What lanes are made of: functions without branches against NumPy, traps and boxes against their definitions."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from numba import njit

from saltus.ensemble.kernels import lanes as kernels
from saltus.ensemble.traps import DIVERGED, UNDECIDED

FAST = kernels.FAST


@njit(fastmath=FAST)
def mapped_sin(x):
    out = np.empty_like(x)
    for i in range(x.size):
        out[i] = kernels.circular_sin(x[i])
    return out


@njit(fastmath=FAST)
def mapped_cos(x):
    out = np.empty_like(x)
    for i in range(x.size):
        out[i] = kernels.circular_cos(x[i])
    return out


@njit(fastmath=FAST)
def mapped_short(x):
    out = np.empty((2, x.size))
    for i in range(x.size):
        out[0, i], out[1, i] = kernels.short_sin(x[i]), kernels.short_cos(x[i])
    return out


@njit(error_model="numpy", fastmath=FAST)
def mapped_root(e, q):
    out = np.empty_like(e)
    for i in range(e.size):
        out[i] = kernels.root(e[i], q)
    return out


@njit
def moved(lanes, size, count):
    """Field 1 becomes three times field 0, field 2 stays."""
    for lane in range(count):
        kernels.st(lanes, 1 * size, lane, 3.0 * kernels.ld(lanes, 0 * size, lane))


@njit
def three_products(a, b, c, d, e, f):
    return kernels.products(a, b, c, d, e, f)


# sines, exponentials, roots


@pytest.mark.parametrize("largest", [1.0, 10.0, 1e3, 1e6])
@pytest.mark.parametrize(("found", "wanted"), [(mapped_sin, np.sin), (mapped_cos, np.cos)], ids=["sin", "cos"])
def test_sines_without_branches_are_sines(found, wanted, largest):
    x = np.random.default_rng(1).uniform(-largest, largest, 20_000)
    # the product of the turns and pi/2 is rounded, by half a unit in the last place of x
    np.testing.assert_allclose(found(x), wanted(x), rtol=0.0, atol=5e-16 + 0.5 * np.spacing(largest))


def test_sines_without_branches_hold_at_the_ends_of_the_quarters():
    ends = np.arange(-40, 41) * (math.pi / 4.0)
    x = np.concatenate([ends, np.nextafter(ends, np.inf), np.nextafter(ends, -np.inf)])
    np.testing.assert_allclose(mapped_sin(x), np.sin(x), rtol=0.0, atol=5e-15)
    np.testing.assert_allclose(mapped_cos(x), np.cos(x), rtol=0.0, atol=5e-15)


def test_sines_of_short_angles_are_sines():
    x = np.linspace(-math.pi, math.pi, 10_001)
    np.testing.assert_allclose(mapped_short(x), [np.sin(x), np.cos(x)], rtol=0.0, atol=2e-15)


def test_a_sine_of_no_number_is_none():
    x = np.array([np.nan, np.inf, -np.inf])
    assert np.isnan(mapped_sin(x)).all()
    assert np.isnan(mapped_cos(x)).all()


@pytest.mark.parametrize(("largest", "error"), [(1.0, 4e-15), (4.0, 8e-12)])
def test_growth_is_the_exponential(largest, error):
    # the first term left out, (x/16)**10/10!, 16 times
    x = np.random.default_rng(2).uniform(-largest, largest, 5000)
    found = np.array([kernels.grown(value) for value in x])
    np.testing.assert_allclose(found, np.exp(x), rtol=error)


@pytest.mark.parametrize("q", [6.0, 8.0, 9.0, 10.0, 12.0])
def test_roots_by_bits_are_roots_to_some_per_cent(q):
    e = 10.0 ** np.random.default_rng(3).uniform(-30.0, 30.0, 20_000)
    found = mapped_root(e, q) * e ** (1.0 / q)
    # the logarithm of a mantissa m in [1, 2) is taken as m - 1, which is off by at most 0.0861 towards zero
    assert found.min() > 1.0 - 1e-9
    assert found.max() < 1.0 + 0.0861


def test_a_larger_error_never_has_a_longer_step():
    e = np.sort(10.0 ** np.random.default_rng(4).uniform(-30.0, 300.0, 5000))
    assert (np.diff(mapped_root(e, 10.0)) <= 0.0).all()


# sums, lanes


def test_sums_of_products_are_exact_to_rounding():
    generator = np.random.default_rng(5)
    for factors in generator.normal(size=(200, 6)) * 10.0 ** generator.integers(-5, 6, (200, 6)):
        exact = [Fraction(a) * Fraction(b) for a, b in zip(factors[::2], factors[1::2], strict=True)]
        rounding = 3.0 * np.finfo(float).eps * float(sum(abs(term) for term in exact))
        assert abs(three_products(*factors) - float(sum(exact))) <= rounding


def test_a_lane_is_read_from_and_written_to_its_own_place():
    lanes = np.arange(24.0)
    moved(lanes, 8, 5)
    wanted = np.arange(24.0)
    wanted[8:13] = 3.0 * np.arange(5.0)
    np.testing.assert_array_equal(lanes, wanted)


# traps and boxes


def no_cages(n):
    return np.empty((0, 2 + n))


def no_ellipsoids(n):
    return np.empty((0, 1 + n + n * n))


def test_ellipsoids_hold_what_their_quadratic_forms_say():
    generator = np.random.default_rng(6)
    n, count = 3, 4
    forms = [np.linalg.inv(np.cov(generator.normal(size=(n, 5)))) for _ in range(count)]
    centres = generator.normal(size=(count, n))
    rows = [np.concatenate([[-1.0], c, np.linalg.cholesky(f).T.ravel()]) for c, f in zip(centres, forms, strict=True)]
    labels = np.array([7, 2, 9, 4])
    seen = set()
    for x in generator.normal(size=(2000, n)):
        sizes = [float((x - c) @ f @ (x - c)) for c, f in zip(centres, forms, strict=True)]
        wanted = labels[int(np.argmin(sizes))] if min(sizes) < 1.0 else UNDECIDED
        assert kernels.fate(x, 0, 1e6, no_cages(n), np.array(rows), labels) == wanted
        seen.add(int(wanted))
    assert seen == {7, 2, 9, 4, UNDECIDED}


def test_a_cage_holds_motions_of_its_mode_whose_moduli_and_floors_stay_below_its_bound():
    generator = np.random.default_rng(7)
    n, bound, floors = 2, 1.5, np.array([0.2, 0.5])
    rows = generator.normal(size=(2, n)) + 1j * generator.normal(size=(2, n))
    centre = np.array([0.3, -0.1])
    flat = np.concatenate([floors[:, None], rows.real, rows.imag], axis=1).ravel()
    cages = np.concatenate([[1.0, bound], centre, flat])[None]
    seen = set()
    for x in generator.normal(size=(1000, n)):
        total = sum(max(abs(row @ (x - centre)), floor) for row, floor in zip(rows, floors, strict=True))
        wanted = 5 if total < bound else UNDECIDED
        assert kernels.fate(x, 1, 1e6, cages, no_ellipsoids(n), np.array([5])) == wanted
        assert kernels.fate(x, 0, 1e6, cages, no_ellipsoids(n), np.array([5])) == UNDECIDED
        seen.add(wanted)
    assert seen == {5, UNDECIDED}


def test_a_cage_comes_before_an_ellipsoid():
    cages = np.array([[0.0, 10.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0]])
    ellipsoids = np.array([[-1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0]])
    x, labels = np.array([0.1, 0.2]), np.array([3, 8])
    assert kernels.fate(x, 0, 1e6, cages, ellipsoids, labels) == 3
    assert kernels.fate(x, 1, 1e6, cages, ellipsoids, labels) == 8


def test_an_ellipsoid_holds_what_is_before_its_planes_in_its_mode():
    # the unit disc where x < 1/2 and x + y < 1/2, for motions in mode 2
    ellipsoid = np.array([[2.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.5, 1.0, 1.0, 0.5]])
    for x in np.random.default_rng(8).uniform(-1.2, 1.2, (1000, 2)):
        inside = x @ x < 1.0 and x[0] < 0.5 and x.sum() < 0.5
        found = [kernels.fate(x, mode, 10.0, no_cages(2), ellipsoid, np.array([4])) for mode in (1, 2)]
        assert found == [UNDECIDED, 4 if inside else UNDECIDED]


@pytest.mark.parametrize("bad", [11.0, -11.0, 10.0, np.inf, -np.inf, np.nan])
def test_a_component_beyond_the_limit_has_diverged(bad):
    whole = np.array([[-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]])
    labels = np.array([1])
    assert kernels.fate(np.array([0.0, 9.9]), 0, 10.0, no_cages(2), whole, labels) == 1
    for x in ([bad, 0.0], [0.0, bad]):
        assert kernels.fate(np.array(x), 0, 10.0, no_cages(2), whole, labels) == DIVERGED


@pytest.mark.parametrize("n", [1, 2, 4])
def test_the_box_of_a_state_is_the_one_that_holds_it(n):
    generator = np.random.default_rng(8)
    boxes = np.unique(generator.integers(-3, 3, (40, n)), axis=0)
    labels = np.arange(len(boxes)) + 10
    origin, size = generator.normal(size=n), generator.uniform(0.1, 2.0, n)
    seen = 0
    for x in origin + size * generator.uniform(-4.0, 4.0, (1500, n)):
        corners = origin + size * boxes
        holds = ((corners <= x) & (x < corners + size)).all(axis=1)
        wanted = int(labels[holds][0]) if holds.any() else UNDECIDED
        assert kernels.box_of(x, origin, size, boxes, labels) == wanted
        seen += wanted != UNDECIDED
    assert 0 < seen < 1500


def test_there_is_no_box_among_none():
    nothing = np.empty((0, 2), np.int64)
    assert kernels.box_of(np.zeros(2), np.zeros(2), np.ones(2), nothing, np.empty(0, np.int64)) == UNDECIDED
