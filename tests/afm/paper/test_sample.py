"""The force of Eq. (1): values, limits, scaling, and what is refused."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from saltus.afm import DMTSample, table1, tip_force
from saltus.errors import InputError

EPS = np.finfo(float).eps
SAMPLE = {"R": 20e-9, "H": 2.96e-19, "E_star": 10.4e9, "a0": 2e-10}
MODULI = {
    "R": 20e-9, "H": 1e-19, "a0": 2e-10,
    "young_tip": 130e9, "poisson_tip": 0.28, "young_sample": 2e9, "poisson_sample": 0.4,
}  # fmt: skip
FACTOR = st.floats(0.01, 100.0)


def test_pull_at_the_onset_of_contact_is_24_67_nanonewtons():
    # 2.96e-19 * 20e-9 / (6 * (2e-10)**2), by hand.
    assert float(tip_force(2e-10, DMTSample(**SAMPLE))) == pytest.approx(-74e-9 / 3.0, rel=8.0 * EPS)


@pytest.mark.filterwarnings("ignore:saltus:RuntimeWarning")  # units of one's own
def test_contact_without_attraction_is_that_of_hertz():
    assert float(tip_force(-3.0, DMTSample(R=4.0, H=0.0, E_star=3.0, a0=1.0))) == pytest.approx(64.0, rel=4.0 * EPS)


def test_force_is_continuous_where_contact_begins():
    sample = DMTSample(**SAMPLE)
    below, at, above = tip_force(sample.a0 * (1.0 + np.array([-1e-9, 0.0, 1e-9])), sample)
    assert below == pytest.approx(at, rel=1e-8)
    assert above == pytest.approx(at, rel=1e-8)


def test_attraction_falls_to_a_quarter_at_twice_the_gap():
    near, far = tip_force([3e-9, 6e-9], DMTSample(**SAMPLE))
    assert far == pytest.approx(near / 4.0, rel=8.0 * EPS)


def test_contact_force_grows_eightfold_at_four_times_the_depth():
    onset, once, four_times = tip_force([2e-10, 1e-10, -2e-10], DMTSample(**SAMPLE))
    # The depths are differences of gaps rounded to 15 digits.
    assert four_times - onset == pytest.approx(8.0 * (once - onset), rel=1e-14)


def test_attraction_never_repels_and_contact_repels_in_the_end():
    z = np.linspace(-1e-9, 1e-7, 1001)
    force = tip_force(z, DMTSample(**SAMPLE))
    assert np.all(force[z > SAMPLE["a0"]] < 0.0)
    assert force[0] > 0.0
    assert np.all(np.diff(force[z <= SAMPLE["a0"]]) < 0.0)


@pytest.mark.parametrize("shape", [(), (3,), (2, 5), (0,)])
def test_force_has_the_shape_of_the_gap(shape):
    assert tip_force(np.full(shape, 1e-9), DMTSample(**SAMPLE)).shape == shape


@pytest.mark.campaign
@given(metre=FACTOR, kilogram=FACTOR, second=FACTOR, gap=st.floats(-20.0, 20.0))
@settings(max_examples=100)
@pytest.mark.filterwarnings("ignore:saltus:RuntimeWarning")  # units of one's own
def test_force_in_other_units_is_the_same_force(metre, kilogram, second, gap):
    pascal, joule, newton = (
        kilogram / (metre * second**2),
        kilogram * metre**2 / second**2,
        kilogram * metre / second**2,
    )
    here = DMTSample(**SAMPLE)
    there = DMTSample(R=here.R * metre, H=here.H * joule, E_star=here.E_star * pascal, a0=here.a0 * metre)
    # Attraction and contact nearly cancel somewhere: compare with their size, not with the sum.
    size = 1e-7 * newton
    z = gap * here.a0
    assert float(tip_force(z * metre, there)) == pytest.approx(
        float(tip_force(z, here)) * newton, rel=1e-13, abs=1e-13 * size
    )


def test_equal_materials_have_half_the_modulus_of_one():
    both = {"young_tip": 3e9, "poisson_tip": 0.0, "young_sample": 3e9, "poisson_sample": 0.0}
    assert DMTSample.from_moduli(**MODULI | both).E_star == pytest.approx(1.5e9, rel=4.0 * EPS)


def test_rigid_tip_leaves_the_plane_strain_modulus_of_the_sample():
    rigid = DMTSample.from_moduli(**MODULI | {"young_tip": 1e30})
    assert rigid.E_star == pytest.approx(2e9 / 0.84, rel=8.0 * EPS)


@given(
    young=st.tuples(st.floats(1e3, 1e12), st.floats(1e3, 1e12)),
    poisson=st.tuples(st.floats(-0.9, 0.5), st.floats(-0.9, 0.5)),
)
@settings(max_examples=100)
@pytest.mark.filterwarnings("ignore:saltus:RuntimeWarning")  # units of one's own
def test_tip_and_sample_may_be_exchanged(young, poisson):
    names = ("young_tip", "young_sample"), ("poisson_tip", "poisson_sample")
    one = dict(zip(names[0], young, strict=True)) | dict(zip(names[1], poisson, strict=True))
    other = dict(zip(names[0], young[::-1], strict=True)) | dict(zip(names[1], poisson[::-1], strict=True))
    first, second = (DMTSample.from_moduli(**MODULI | values).E_star for values in (one, other))
    assert first == pytest.approx(second, rel=8.0 * EPS)
    assert first < min(E / (1.0 - nu**2) for E, nu in zip(young, poisson, strict=True)) * (1.0 + 4.0 * EPS)


def test_table_1_has_the_sample_of_the_paper():
    assert table1().sample == DMTSample(**SAMPLE)


@pytest.mark.parametrize("value", [-1.0, 0.0, float("nan"), float("inf"), "20 nm", None, True], ids=repr)
@pytest.mark.parametrize("name", ["R", "a0"])
def test_length_that_is_not_positive_is_refused(name, value):
    with pytest.raises(InputError) as error:
        DMTSample(**SAMPLE | {name: value})
    assert str(error.value) == f"{name} = {value!r}: must be a finite number > 0 (in m)"


@pytest.mark.parametrize("value", [-1e-30, float("nan"), float("inf"), "much", None, False], ids=repr)
@pytest.mark.parametrize(("name", "unit"), [("H", "J"), ("E_star", "Pa")])
def test_strength_that_is_negative_is_refused(name, unit, value):
    with pytest.raises(InputError) as error:
        DMTSample(**SAMPLE | {name: value})
    assert str(error.value) == f"{name} = {value!r}: must be a finite number >= 0 (in {unit})"


@pytest.mark.parametrize("value", [-1.0, 0.51, float("nan"), None], ids=repr)
@pytest.mark.parametrize("name", ["poisson_tip", "poisson_sample"])
def test_poisson_ratio_that_no_solid_has_is_refused(name, value):
    with pytest.raises(InputError) as error:
        DMTSample.from_moduli(**MODULI | {name: value})
    assert str(error.value) == f"{name} = {value!r}: must be above -1 and at most 1/2"


@pytest.mark.parametrize("name", ["young_tip", "young_sample"])
def test_modulus_that_is_not_positive_is_refused(name):
    with pytest.raises(InputError) as error:
        DMTSample.from_moduli(**MODULI | {name: 0.0})
    assert str(error.value) == f"{name} = 0.0: must be a finite number > 0 (in Pa)"


@pytest.mark.parametrize(
    ("z", "message"),
    [
        (float("nan"), "z = nan: must be finite"),
        ([1e-9, -float("inf")], "z[1] = -inf: must be finite"),
        (np.array([[1.0, 2.0], [np.nan, np.nan]]), "z[1, 0] = nan: must be finite"),
        ("near", "z = 'near': must be an array of real numbers"),
        (None, "z = None: must be an array of real numbers"),
    ],
)
def test_gap_that_is_no_number_is_refused(z, message):
    with pytest.raises(InputError) as error:
        tip_force(z, DMTSample(**SAMPLE))
    assert str(error.value) == message
