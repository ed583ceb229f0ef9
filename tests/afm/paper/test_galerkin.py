"""Modes of the clamped-free beam and the coefficients of Eq. (7): literature, quadrature, high precision, sum rules."""

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from saltus.afm import Cantilever, DMTSample, table1
from saltus.afm.paper.galerkin import coefficients
from saltus.afm.probe.beam import mode_shape, mode_shape_integrals, wavenumbers
from saltus.errors import InputError

EPS = np.finfo(float).eps
NODES, WEIGHTS = (0.5 * (a + shift) for a, shift in zip(np.polynomial.legendre.leggauss(200), (1.0, 0.0), strict=True))
FACTOR = st.floats(0.01, 100.0)


def exact_wavenumber(i):
    """Root of the frequency equation in the digits that mpmath works with."""
    start = mpmath.mpf("1.875") if i == 1 else (i - mpmath.mpf(1) / 2) * mpmath.pi
    return mpmath.findroot(lambda b: mpmath.cos(b) + mpmath.sech(b), start)


def test_wavenumbers_are_those_of_the_literature():
    published = [1.875104068711961, 4.694091132974175, 7.854757438237613, 10.995540734875467, 14.13716839104647]
    np.testing.assert_allclose(wavenumbers(5), published, rtol=1.5 * EPS)


def test_wavenumbers_are_right_to_the_last_digit():
    b = wavenumbers(40)
    with mpmath.workdps(60):
        errors = [abs(float(mpmath.mpf(float(b[i - 1])) - exact_wavenumber(i))) for i in range(1, 41)]
    assert np.all(errors <= 0.51 * np.spacing(b))


def test_wavenumbers_far_up_are_odd_multiples_of_half_pi():
    b = wavenumbers(400)
    np.testing.assert_allclose(b[15:], (np.arange(16, 401) - 0.5) * np.pi, rtol=EPS)


def test_fewer_wavenumbers_are_the_first_of_more():
    np.testing.assert_array_equal(wavenumbers(3), wavenumbers(30)[:3])


@pytest.mark.parametrize("i", [1, 2, 3, 8, 20, 150])
def test_mode_shape_is_the_textbook_formula_in_high_precision(i):
    # The argument b x of the sine is rounded: an error of b EPS or so is inherent.
    x = np.linspace(0.0, 1.0, 23)
    with mpmath.workdps(60 + 4 * i):
        b = exact_wavenumber(i)
        sigma = (mpmath.cosh(b) + mpmath.cos(b)) / (mpmath.sinh(b) + mpmath.sin(b))

        def textbook(x):
            return mpmath.cosh(b * x) - mpmath.cos(b * x) - sigma * (mpmath.sinh(b * x) - mpmath.sin(b * x))

        expected = [float(textbook(mpmath.mpf(float(a))) / textbook(mpmath.mpf(1))) for a in x]
    np.testing.assert_allclose(mode_shape(i, x), expected, rtol=0.0, atol=2.0 * EPS * (2.0 + float(b)))


def test_mode_shapes_are_zero_at_the_clamp_and_one_at_the_tip():
    for i in range(1, 31):
        np.testing.assert_allclose(mode_shape(i, [0.0, 1.0]), [0.0, 1.0], rtol=0.0, atol=2.0 * EPS * wavenumbers(i)[-1])


def test_mode_shape_has_one_node_fewer_than_its_number():
    x = np.linspace(0.001, 1.0, 4001)
    for i in range(1, 31):
        assert np.count_nonzero(np.diff(np.sign(mode_shape(i, x)))) == i - 1


def test_mode_shape_keeps_the_shape_of_x():
    assert mode_shape(2, 0.5).shape == ()
    assert mode_shape(2, np.zeros((3, 4))).shape == (3, 4)


def test_mode_shapes_are_orthogonal():
    phi = np.array([mode_shape(i, NODES) for i in range(1, 21)])
    np.testing.assert_allclose((phi * WEIGHTS) @ phi.T, np.eye(20) / 4.0, rtol=0.0, atol=1e-14)


def test_integrals_are_those_of_quadrature():
    phi = np.array([mode_shape(i, NODES) for i in range(1, 21)])
    closed, closed_squared = mode_shape_integrals(20)
    np.testing.assert_allclose(closed, phi @ WEIGHTS, rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(closed_squared, phi**2 @ WEIGHTS, rtol=0.0, atol=1e-14)


def test_compliances_of_all_modes_add_up_to_the_static_one():
    # 1/k_static = L^3/(3 E I) = sum 1/k_i, that is sum b**-4 = 1/12; the modes left out are about 1 / (3 pi**4 n**3).
    assert np.sum(wavenumbers(2000) ** -4.0) == pytest.approx(1.0 / 12.0, abs=1e-12)


def test_modes_together_make_a_rigid_translation():
    # 1 = sum phi_i int(phi_i) / int(phi_i**2): its norm is 1, and at the tip the sum of B_i is 1.
    phi, phi_squared = mode_shape_integrals(4000)
    rest = 4.0 / (np.pi**2 * 4000)
    assert np.sum(phi**2 / phi_squared) == pytest.approx(1.0 - rest, abs=1e-3 * rest)
    sums = np.cumsum(phi / phi_squared)
    assert 0.5 * (sums[-1] + sums[-2]) == pytest.approx(1.0, abs=1e-6)


def test_coefficients_of_more_modes_begin_with_those_of_fewer():
    setup = table1()
    few, many = (coefficients(setup.cantilever, setup.sample, setup.eta, n) for n in (2, 6))
    np.testing.assert_array_equal(few.B, many.B[:2])
    np.testing.assert_array_equal(few.K, many.K[:2])
    assert (few.C, few.G) == (many.C, many.G)


@pytest.mark.campaign
@given(metre=FACTOR, kilogram=FACTOR, second=FACTOR)
@settings(max_examples=50)
@pytest.mark.filterwarnings("ignore:saltus:RuntimeWarning")  # units of one's own
def test_dimensionless_coefficients_do_not_depend_on_units(metre, kilogram, second):
    pascal, joule = kilogram / (metre * second**2), kilogram * metre**2 / second**2
    setup = table1()
    lever, sample = setup.cantilever, setup.sample
    here = coefficients(lever, sample, setup.eta, 3)
    there = coefficients(
        Cantilever(
            length=lever.length * metre,
            width=lever.width * metre,
            thickness=lever.thickness * metre,
            density=lever.density * kilogram / metre**3,
            young=lever.young * pascal,
        ),
        DMTSample(
            R=sample.R * metre, H=sample.H * joule, E_star=sample.E_star * pascal, a0=sample.a0 * metre
        ),
        setup.eta * metre,
        3,
    )  # fmt: skip
    np.testing.assert_array_equal(here.K, there.K)
    np.testing.assert_array_equal(here.B, there.B)
    rounding = 40.0 * EPS
    assert (there.C, there.G, there.a0_bar) == pytest.approx((here.C, here.G, here.a0_bar), rel=rounding)
    assert there.k == pytest.approx(here.k * kilogram / second**2, rel=rounding)
    assert there.f_1 == pytest.approx(here.f_1 / second, rel=rounding)


def test_arrays_are_read_only():
    setup = table1()
    c = coefficients(setup.cantilever, setup.sample, setup.eta, 2)
    for array in (wavenumbers(2), *mode_shape_integrals(2), c.K, c.B):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 2.0


@pytest.mark.parametrize("n", [0, -1, 1.5, 2.0, True, "two", None])
def test_count_of_modes_that_is_none_is_refused(n):
    for function in (wavenumbers, mode_shape_integrals):
        with pytest.raises(InputError) as error:
            function(n)
        assert str(error.value) == f"n = {n!r}: must be an integer >= 1"


def test_numpy_integers_count():
    assert len(wavenumbers(np.int64(3))) == 3


def test_number_of_a_mode_shape_that_is_none_is_refused():
    with pytest.raises(InputError) as error:
        mode_shape(0, 0.5)
    assert str(error.value) == "i = 0: must be an integer >= 1"


@pytest.mark.parametrize(
    ("x", "message"),
    [
        (-0.01, "x = -0.01: must be from 0 (clamp) to 1 (tip), in units of the beam's length"),
        ([0.0, 1.5], "x[1] = 1.5: must be from 0 (clamp) to 1 (tip), in units of the beam's length"),
        ([[0.0, 1.0], [0.5, float("nan")]], "x[1, 1] = nan: must be finite"),
        ("tip", "x = 'tip': must be an array of real numbers"),
        ([0.5, 1j], "x = [0.5, 1j]: must be an array of real numbers"),
        ([[0.5], [0.1, 0.2]], "x = [[0.5], [0.1, 0.2]]: must be an array of real numbers"),
    ],
)
def test_place_off_the_beam_is_refused(x, message):
    with pytest.raises(InputError) as error:
        mode_shape(1, x)
    assert str(error.value) == message


@pytest.mark.parametrize("eta", [0.0, -60e-9, float("nan"), float("inf"), None])
def test_gap_that_is_no_positive_length_is_refused(eta):
    setup = table1()
    with pytest.raises(InputError) as error:
        coefficients(setup.cantilever, setup.sample, eta, 1)
    assert str(error.value) == f"eta = {eta!r}: must be a finite number > 0 (in m)"
