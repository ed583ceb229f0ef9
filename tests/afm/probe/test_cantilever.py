"""The cantilever: handbook values, scaling, the two ways to make one, and what is refused."""

import copy
import dataclasses
import pickle

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from saltus.afm import Cantilever, table1
from saltus.errors import InputError, shown

EPS = np.finfo(float).eps
BEAM = {"length": 240e-6, "width": 64e-6, "thickness": 2.1e-6, "density": 2300.0, "young": 176e9}
MEASURED = {"k": 2.0, "f0": 70e3, "Q": 200.0}
UNITS = {
    "length": " (in m)", "width": " (in m)", "thickness": " (in m)", "density": " (in kg/m**3)", "young": " (in Pa)",
    "k": " (in N/m)", "f0": " (in Hz)", "Q": "",
}  # fmt: skip
NOT_POSITIVE = [-1.0, 0.0, 0, float("nan"), float("inf"), -float("inf"), "240 um", None, True, [1.0], 1j, 10**400]


def test_frequency_is_the_handbook_one():
    # f = 0.1615 (t / L**2) sqrt(E / rho), the handbooks' formula in four digits.
    assert Cantilever(**BEAM).f0 == pytest.approx(0.1615 * 2.1e-6 / 240e-6**2 * np.sqrt(176e9 / 2300.0), rel=4e-4)


def test_modal_mass_is_a_quarter_of_the_beam():
    assert Cantilever(**BEAM).mass == pytest.approx(2300.0 * 240e-6 * 64e-6 * 2.1e-6 / 4.0, rel=8.0 * EPS)


def test_ratios_of_frequencies_are_those_of_a_uniform_beam():
    ratios = Cantilever.from_measured(**MEASURED).frequencies(4) / 70e3
    np.testing.assert_allclose(ratios, [1.0, 6.2669, 17.5475, 34.3861], rtol=1e-5)


def test_stiffnesses_are_the_modal_mass_times_frequencies_squared():
    lever = Cantilever(**BEAM)
    expected = lever.mass * (2.0 * np.pi * lever.frequencies(5)) ** 2
    np.testing.assert_allclose(lever.stiffnesses(5), expected, rtol=16.0 * EPS)


@given(factor=st.floats(0.01, 100.0))
@settings(max_examples=50)
def test_beam_enlarged_is_stiffer_and_slower(factor):
    lever = Cantilever(**BEAM)
    larger = Cantilever(**BEAM | {name: factor * BEAM[name] for name in ("length", "width", "thickness")})
    assert larger.k == pytest.approx(factor * lever.k, rel=20.0 * EPS)
    assert larger.f0 == pytest.approx(lever.f0 / factor, rel=20.0 * EPS)


@given(factor=st.floats(0.01, 100.0))
@settings(max_examples=50)
@pytest.mark.filterwarnings("ignore:saltus:RuntimeWarning")  # units of one's own
def test_stiffness_grows_with_the_modulus_and_not_with_the_density(factor):
    lever = Cantilever(**BEAM)
    stiffer = Cantilever(**BEAM | {"young": factor * BEAM["young"]})
    heavier = Cantilever(**BEAM | {"density": factor * BEAM["density"]})
    assert stiffer.k == pytest.approx(factor * lever.k, rel=20.0 * EPS)
    assert stiffer.f0 == pytest.approx(np.sqrt(factor) * lever.f0, rel=20.0 * EPS)
    assert heavier.k == pytest.approx(lever.k, rel=20.0 * EPS)
    assert heavier.f0 == pytest.approx(lever.f0 / np.sqrt(factor), rel=20.0 * EPS)


def test_damping_is_the_width_of_the_resonance():
    # |1 / (1 - w**2 + i D w)|**2 falls to half at frequencies that are f1 / Q apart, up to D**2.
    D = Cantilever.from_measured(**MEASURED).damping
    w = np.linspace(1.0 - 2.0 * D, 1.0 + 2.0 * D, 400_001)
    power = 1.0 / ((1.0 - w**2) ** 2 + (D * w) ** 2)
    width = np.ptp(w[power > 0.5 * power.max()])
    assert 1.0 / width == pytest.approx(200.0, rel=1e-4)


def test_damping_of_a_beam_that_was_not_measured_is_not_known():
    assert Cantilever(**BEAM).damping is None


def test_measured_values_are_kept():
    lever = Cantilever.from_measured(**MEASURED)
    assert (lever.k, lever.f0, lever.Q, lever.length, lever.young) == (2.0, 70e3, 200.0, None, None)


@pytest.mark.parametrize("lever", [Cantilever(**BEAM), Cantilever.from_measured(**MEASURED)], ids=["beam", "measured"])
def test_cantilever_is_a_value(lever):
    again = eval(repr(lever), {"Cantilever": Cantilever})
    assert again == lever
    assert hash(again) == hash(lever)
    assert copy.deepcopy(lever) == lever
    assert pickle.loads(pickle.dumps(lever)) == lever
    assert len({lever, again}) == 1
    with pytest.raises(dataclasses.FrozenInstanceError):
        lever.k = 1.0


def test_replacing_one_value_gives_the_new_beam():
    assert dataclasses.replace(table1().cantilever, young=160e9) == Cantilever(**BEAM | {"young": 160e9})


def test_numbers_of_any_kind_are_kept_as_floats():
    lever = Cantilever(**BEAM | {"density": 2300, "young": np.float32(2e11)})
    assert isinstance(lever.density, float)
    assert type(lever.young) is float


@pytest.mark.parametrize("value", NOT_POSITIVE, ids=repr)
@pytest.mark.parametrize("name", list(BEAM))
def test_geometry_that_is_not_positive_is_refused(name, value):
    with pytest.raises(InputError) as error:
        Cantilever(**BEAM | {name: value})
    assert str(error.value).startswith(f"{name} = {shown(value)}: must be a finite number > 0{UNITS[name]}")


@pytest.mark.parametrize("value", NOT_POSITIVE, ids=repr)
@pytest.mark.parametrize("name", list(MEASURED))
def test_measurement_that_is_not_positive_is_refused(name, value):
    with pytest.raises(InputError) as error:
        Cantilever.from_measured(**MEASURED | {name: value})
    assert str(error.value).startswith(f"{name} = {shown(value)}: must be a finite number > 0{UNITS[name]}")


def test_beam_beyond_all_numbers_is_refused():
    with pytest.raises(InputError) as error:
        Cantilever(**BEAM | {"length": 1e-200})
    assert str(error.value) == "k = inf: must be a finite number > 0 (in N/m)"


@pytest.mark.parametrize("n", [0, 2.5, True])
def test_count_of_modes_that_is_none_is_refused(n):
    lever = Cantilever(**BEAM)
    for method in (lever.frequencies, lever.stiffnesses):
        with pytest.raises(InputError) as error:
            method(n)
        assert str(error.value) == f"n = {n!r}: must be an integer >= 1"


def test_units_of_a_lever_are_those_of_the_other_quantities_by_their_names():
    lever = Cantilever.from_measured(k_N_m=2.0, f0_kHz=70.0, Q=200.0)
    assert lever == Cantilever.from_measured(**MEASURED)
    beam = Cantilever.from_geometry(length_um=240, width_um=64, thickness_um=2.1, density_kg_m3=2300, young_GPa=176)
    assert (beam.k, beam.f0) == pytest.approx((Cantilever(**BEAM).k, Cantilever(**BEAM).f0), rel=1e-14)
    with pytest.raises(InputError, match=r"f0 = 300\.0: must be at least 1000 Hz; in kHz\? then f0_kHz=300$"):
        Cantilever.from_measured(k=26.0, f0=300.0, Q=400.0)
    with pytest.raises(InputError, match="k_N_m = 2.0: must be given once, without k"):
        Cantilever.from_measured(k_N_m=2.0, k=2.0, f0_kHz=70.0, Q=200.0)
    slow = Cantilever.from_measured(k_N_m=0.01, f0_kHz=0.3, Q=20.0)
    assert eval(repr(slow), {"Cantilever": Cantilever}) == slow
