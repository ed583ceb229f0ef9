"""What counts as a number, a count, a name, a path; and messages that stay short whatever the value."""

from __future__ import annotations

import datetime
import math
import pickle
import re
import subprocess
import sys
from decimal import Decimal
from fractions import Fraction
from numbers import Real
from pathlib import Path

import numpy as np
import pytest
import sympy
import xarray as xr

import fuzzing
from saltus import (
    HybridSystem,
    InputError,
    Mode,
    Plane,
    SaltusError,
    Section,
    StepControl,
    checks,
    simulate,
    solve_orbit,
)
from saltus.basins import Basins, Grid
from saltus.errors import ChatteringError, ConvergenceError, DivergenceError, nearest, shown
from saltus.options import SimulationOptions


def named(value: object) -> str:
    """Return the name of a value in tests, which no address in memory may enter: several processes collect them."""
    return re.sub(r" at 0x[0-9a-f]+", "", shown(value))


NUMBERS = [
    (3, 3.0), (0.5, 0.5), (np.int8(3), 3.0), (np.float16(0.5), 0.5), (np.longdouble(2), 2.0), (np.array(1.5), 1.5),
    (np.uint64(2**63), 2.0**63), (Fraction(1, 4), 0.25), (Decimal("0.1"), 0.1), (sympy.Integer(3), 3.0),
    (sympy.Rational(1, 4), 0.25), (sympy.Float(2.5), 2.5), (sympy.pi, math.pi), (sympy.sqrt(2), math.sqrt(2)),
    (xr.DataArray(2.0), 2.0), (np.array(Fraction(1, 4), dtype=object), 0.25),
]  # fmt: skip

NO_NUMBERS = [
    True, np.True_, np.array(True), 1j, 1 + 0j, np.complex128(1), np.array(1 + 0j), "1", b"1", bytearray(b"1"), None,
    datetime.date(2020, 1, 1), datetime.timedelta(1), np.datetime64("2020-01-01"), np.timedelta64(3, "s"), sympy.I,
    sympy.Symbol("x"), sympy.zoo, sympy.nan, sympy.true, math.nan, np.ma.masked, int, object(), {1.0}, {1: 2.0},
    10**400, -(10**5000), Fraction(10**400, 3), Decimal("sNaN"), Decimal("1e400"), np.longdouble("1e4000"),
    sympy.Float(10) ** 400,
]  # fmt: skip


class Measured(float):
    """A float of one's own."""


@Real.register
class Length:
    """A number of one's own, without float among its ancestors."""

    def __init__(self, metres):
        self.metres = metres

    def __float__(self):
        return self.metres / 1


@pytest.fixture(scope="module")
def slow() -> HybridSystem:
    return HybridSystem(("x",), {"a": 1.0}, {"free": Mode({"x": "-a*x"})}, name="slow")


@pytest.mark.parametrize(("value", "found"), NUMBERS, ids=named)
def test_real_numbers_of_every_library_are_numbers(value, found):
    assert checks.number("t", value) == found
    assert checks.array("t", value).item() == found
    assert checks.array("t", [value, 1]).tolist() == [found, 1.0]


def test_numbers_of_ones_own_are_numbers():
    assert checks.number("t", Measured(2.0)) == checks.number("t", Length(2.0)) == 2.0


@pytest.mark.parametrize("value", NO_NUMBERS, ids=named)
def test_what_is_no_finite_real_number_is_refused_alone_and_in_a_list(value):
    with pytest.raises(InputError, match="^t = .*: must be a finite number"):
        checks.number("t", value)
    for given in (value, [1.0, value], np.array([1.0, value], dtype=object)):
        with pytest.raises(InputError, match="^t"):
            checks.array("t", given)


def test_a_number_that_raises_is_told():
    with pytest.raises(InputError, match="^t = .*: must be a finite number; float says: unsupported operand"):
        checks.number("t", Length("long"))


@pytest.mark.parametrize(
    "value",
    [
        [1, True], [[0.5], [np.True_]], np.array([True]), np.array([1 + 0j]), ["1", 2], np.array(["a"]), [1, None],
        np.zeros(2, dtype=[("a", "f8")]), np.array([1], dtype="m8[s]"), [[1.0], [1.0, 2.0]], {1.0, 2.0}, {"a": 1.0},
        (value for value in (1.0, 2.0)), memoryview(b"ab"), fuzzing.Hostile(),
    ],
    ids=named,
)  # fmt: skip
def test_arrays_of_anything_else_are_refused(value):
    with pytest.raises(InputError, match="^z = .*: must be an array of real numbers$"):
        checks.array("z", value)


def test_masked_entries_are_no_numbers():
    with pytest.raises(InputError, match=r"^z\[1\] = nan: must be finite$"):
        checks.array("z", np.ma.array([1.0, 2.0], mask=[False, True]))


def test_an_entry_too_large_is_named():
    with pytest.raises(InputError, match=r"^z\[1\] = an integer of 1329 bits: .* beyond the range of floating-point"):
        checks.array("z", [1, 10**400])


@pytest.mark.parametrize("value", [True, 2.0, "2", None, 2 + 0j, 0, -1, 10**400, np.timedelta64(2), Fraction(2, 1)])
def test_a_count_is_an_integer(value):
    with pytest.raises(InputError, match="^n = .*: must be an integer "):
        checks.count("n", value)


@pytest.mark.parametrize("value", [2, np.int8(2), np.uint64(2), sympy.Integer(2), np.array(2)])
def test_integers_of_every_library_count(value):
    assert checks.count("n", value) == 2
    assert type(checks.count("n", value)) is int


def test_an_endless_sequence_of_names_is_refused_at_its_first_item():
    with pytest.raises(InputError, match="^stop_at = 0: must be a sequence of types"):
        checks.names("stop_at", fuzzing.VALUES["endless"](), "types")


@pytest.mark.parametrize("value", ["", b"a.nc", None, 3, "a\0b", "\ud800", "a" * 300, ["a.nc"], Path])
def test_what_names_no_place_on_disk_is_refused(value):
    with pytest.raises(InputError, match="^path = .*: must be the path of a file; "):
        checks.path("path", value)


@pytest.mark.parametrize(
    "value",
    [
        fuzzing.Mute(), [fuzzing.Mute()], fuzzing.Talker(), "a" * 10**6, b"a" * 10**6, 10**5000, [1.0] * 10**6,
        {"k" * 10**5: 1.0}, np.zeros((1000, 1000)), fuzzing.Hostile(), "a\nb", lambda: None,
    ],
    ids=named,
)  # fmt: skip
def test_messages_stay_short_and_survive_pickling(value):
    error = InputError("name " * 100, value, "one of " + "names, " * 100, "did you mean " * 50)
    said = str(error)
    assert len(said) < 300
    assert "\n" not in said
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is InputError
    assert str(again) == said


def test_short_messages_are_told_in_full():
    error = InputError("t_end, periods", {"t_end": None, "periods": 3}, "exactly one of the two given", "leave one")
    assert (
        str(error) == "t_end, periods = {'t_end': None, 'periods': 3}: must be exactly one of the two given; leave one"
    )


def test_other_errors_stay_short():
    state = [0.123456789012345678] * 50
    for error in (
        ChatteringError(1.0, state, "free"),
        DivergenceError(1.0, state, "free", "a state passes 1e+12 " * 30),
        ConvergenceError("periodic orbit", 0.1, 3, "start from a nearer guess " * 30, unit="periods"),
    ):
        assert len(str(error)) < 300
        assert str(pickle.loads(pickle.dumps(error))) == str(error)


def test_nothing_is_near_to_what_is_no_name():
    assert nearest(fuzzing.Mute(), ["a"]) == nearest("a" * 10**6, ["a"]) == ""


WRONG = [1j, True, np.True_, "0.5", b"0.5", datetime.date(2020, 1, 1), np.datetime64("2020"), np.timedelta64(1), None]


@pytest.mark.parametrize("wrong", WRONG, ids=named)
def test_no_door_takes_what_is_no_number(slow, wrong):
    x = np.array([0.0, 1.0])
    doors = [
        lambda: slow.resolve({"a": wrong}),
        lambda: slow.full_state([wrong]),
        lambda: simulate(slow, {}, [1.0], t_end=1.0, tolerance=wrong),
        lambda: simulate(slow, {}, [1.0], t_end=1.0, options=SimulationOptions(max_events=wrong)),
        lambda: solve_orbit(slow, {}, [("free", None, [1.0], wrong)]),
        lambda: solve_orbit(slow, {}, [("free", None, [1.0], 1.0)], tolerance=wrong),
        lambda: StepControl(initial=wrong),
        lambda: StepControl(max_points=wrong),
        lambda: Section("x", wrong),
        lambda: Grid(("x",), {"x": (wrong, 1.0, 3)}),
        lambda: Grid(("x",), {"x": (0.0, 1.0, wrong)}),
        lambda: Grid(("x", "y"), Plane({"x": wrong, "y": 0.0}, {"x": 1.0}, {"y": 1.0}, ((0, 1), (0, 1)), (2, 2))),
        lambda: Basins.from_array([0, 0], {"x": [0.0, wrong]}, {"a": 0}),
        lambda: Basins.from_array([0, 0], {"x": x}, {"a": wrong}),
        lambda: HybridSystem(("x",), {"a": wrong}, {"free": Mode({"x": "a"})}),
        lambda: HybridSystem(
            ("x",), {"a": 1.0}, {"free": Mode({"x": "a"})}, parameter_bounds={"a": (wrong, 2.0)}
        ),
    ]  # fmt: skip
    for door in doors:
        with pytest.raises(InputError):
            door()


def test_every_number_of_a_definition_may_be_of_any_library(slow, ball):
    exact = HybridSystem(("x",), {"a": Fraction(1, 4)}, {"free": Mode({"x": sympy.pi})}, parameter_bounds={})
    assert exact.parameters == {"a": 0.25}
    assert slow.resolve({"a": Decimal("0.5")})["a"] == 0.5
    assert simulate(ball, {"g": np.float32(1.0)}, [sympy.Rational(1, 2), 0], t_end=Fraction(1, 2)).t_end == 0.5


@pytest.mark.parametrize("rate", [sympy.I, 1j, True, 10**5000, math.inf, b"x"], ids=named)
def test_an_expression_is_real(rate):
    with pytest.raises(InputError, match="^mode 'free' = "):
        HybridSystem(("x",), {}, {"free": Mode({"x": rate})})


def test_the_checks_need_no_numpy_before_they_are_asked():
    code = "import sys, saltus; assert 'numpy' not in sys.modules; saltus.InputError; assert 'numpy' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.fixture(scope="module")
def listed(tmp_path_factory):
    return fuzzing.calls(fuzzing.objects(), tmp_path_factory.mktemp("fuzz"))


def test_arguments_of_wrong_kinds_are_told_in_one_line(listed, monkeypatch, tmp_path):
    import matplotlib
    from matplotlib import pyplot

    matplotlib.use("Agg")
    monkeypatch.chdir(tmp_path)
    bad = []
    for drawn in fuzzing.drawn(listed, 250, 14):
        if not (found := fuzzing.tried(*drawn)).good:
            bad.append(found)
        pyplot.close("all")
    assert not bad


def test_the_calls_of_the_fuzz_are_right_before_anything_is_replaced(listed):
    for name in ("simulate", "find_orbit", "solve_orbit", "continue_orbit", "Branch.column", "tip_force", "Grid"):
        assert fuzzing.tried(name, listed[name], {}).ended == "returned"


def test_an_error_is_a_saltus_error_for_each_kind_of_object(listed):
    for name, argument, value in (
        ("simulate", "system", "list"), ("continue_orbit", "orbit", "class of orbits"),
        ("Branch.column", "name", "dict"), ("switch_branch", "point", "None"), ("load", "path", "bytes"),
        ("Trajectory.plot", "ax", "object"),
    ):  # fmt: skip
        found = fuzzing.tried(name, listed[name], {argument: value})
        assert found.ended == "told", found
    assert issubclass(InputError, SaltusError)
