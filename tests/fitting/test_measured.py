"""Measured data: columns read from tables of several kinds, residuals, their derivatives, and what is refused."""

import math

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from saltus import InputError, MeasuredPoint
from saltus.fitting.measured import Channel, read_measured, read_table

W = [0.5, 1.0, 1.5]
Z = "harmonic(x, 1)"
PHASE = "phase(x, 1)"


def read(system, data, sigma=None, observables=None, turns=None):
    return read_measured(data, "w", system, sigma or {"max(x)": 0.1}, observables or {}, turns or {})


def turn_of(system, formula):
    return read(system, {"w": W, "y": W}, {"y": 0.1}, {"y": formula}).channels[0].turn


# tables

TABLES = {
    "columns": {"w": W, "max(x)": [1, 2, 3], "direction": ["up", "up", "down"]},
    "tuples": {"w": tuple(W), "max(x)": (1.0, 2.0, 3.0), "direction": ("up", "up", "down")},
    "frame": pd.DataFrame({"w": W, "max(x)": [1, 2, 3], "direction": pd.Categorical(["up", "up", "down"])}),
    "index": pd.DataFrame({"max(x)": [1.0, 2.0, 3.0], "direction": ["up", "up", "down"]}, pd.Index(W, name="w")),
    "dataset": xr.Dataset({"max(x)": ("w", [1.0, 2.0, 3.0]), "direction": ("w", ["up", "up", "down"])}, {"w": W}),
    "nullable": pd.DataFrame(
        {"w": pd.array(W, "Float64"), "max(x)": pd.array([1, 2, 3], "Int64"), "direction": ["up", "up", "down"]}
    ),
}


@pytest.mark.parametrize("kind", TABLES)
def test_all_kinds_of_tables_hold_the_same_data(duffing, kind):
    found = read(duffing, TABLES[kind])
    assert found.x.tolist() == W
    assert found.channels[0].values.tolist() == [1.0, 2.0, 3.0]
    assert found.channels[0].values.dtype == np.float64
    assert found.channels[0].sigma.tolist() == [0.1, 0.1, 0.1]
    assert found.direction == ("up", "up", "down")
    assert (found.dropped, found.unused, found.points) == (0, (), ())


def test_a_single_number_is_a_column_of_one_datum(duffing):
    found = read(duffing, {"w": 0.5, "max(x)": 2.0})
    assert (len(found), found.count, found.direction) == (1, 1, ("",))


def test_levels_of_an_index_become_columns_that_are_not_told_as_unused(duffing):
    index = pd.MultiIndex.from_product([["a", "b"], W], names=["run", "w"])
    table = pd.DataFrame({"max(x)": np.arange(6.0), "heat": np.ones(6)}, index)
    whole = read_table(table)
    assert whole["run"].tolist() == ["a"] * 3 + ["b"] * 3
    assert whole.attrs["index"] == ["run", "w"]
    assert read(duffing, table).unused == ("heat",)
    assert "index" not in table.attrs  # the caller's table is as it was


@pytest.mark.parametrize(
    "values",
    [
        [1.0, np.nan, 3.0],
        [1.0, np.inf, 3.0],
        np.array([1.0, None, 3.0], dtype=object),
        np.array([1.0, pd.NA, 3.0], dtype=object),
        pd.array([1, pd.NA, 3], dtype="Int64"),
        np.ma.array([1.0, 2.0, 3.0], mask=[False, True, False]),
        np.ma.array([1, 2, 3], mask=[False, True, False]),
    ],
    ids=["nan", "infinite", "None", "NA", "nullable", "masked", "masked integers"],
)
def test_a_missing_number_leaves_its_row_out_with_its_error_and_way(duffing, values):
    data = {"w": W, "max(x)": values, "direction": ["up", "down", "retract"]}
    found = read(duffing, data, {"max(x)": [0.1, 0.2, 0.3]})
    assert found.dropped == 1
    assert found.x.tolist() == [0.5, 1.5]
    assert found.channels[0].values.tolist() == [1.0, 3.0]
    assert found.channels[0].sigma.tolist() == [0.1, 0.3]
    assert found.direction == ("up", "retract")


def test_a_masked_complex_number_is_missing(duffing):
    values = np.ma.array([1j, 2j, 3j], mask=[True, False, False])
    found = read(duffing, {"w": W, Z: values}, {Z: 0.1})
    assert found.dropped == 1
    assert found.channels[0].values.tolist() == [2j, 3j]


@pytest.mark.parametrize("missing", [None, np.nan, pd.NA], ids=["None", "nan", "NA"])
def test_a_way_that_is_missing_is_no_way(duffing, missing):
    table = pd.DataFrame({"w": W, "max(x)": W, "direction": np.array(["up", missing, "down"], dtype=object)})
    assert read(duffing, table).direction == ("up", "", "down")


def test_rows_that_repeat_are_those_alike_in_value_parameter_and_way(duffing):
    data = {"w": [1.0] * 4, "max(x)": [2.0, 2.0, 2.0, 3.0], "heat": [0.0, 1.0, 2.0, 3.0]}
    assert read(duffing, data).repeated == 2
    assert read(duffing, {**data, "direction": ["up", "down", "up", "up"]}).repeated == 1


def test_residuals_are_counted_by_their_parts_and_points(duffing):
    found = read(duffing, {"w": W, Z: 1j * np.ones(3), "max(x)": W}, {Z: 0.1, "max(x)": 0.2})
    assert found.rows == 3
    assert found.formulas == ("amplitude(x, 1)", PHASE, "max(x)")
    both = found.with_points([MeasuredPoint("SN", 1.2, 0.1)])
    assert (both.count, found.count) == (10, 9)


# residuals


def test_a_residual_of_a_real_datum_is_its_distance_in_standard_errors():
    channel = Channel("y", ("max(x)",), np.array([2e-9, 3e9]), np.array([1e-10, 1e8]))
    seen = np.array([[2.5e-9, 2.8e9]])
    assert channel.residual(seen, np.arange(2)) == pytest.approx(np.array([[5.0, -2.0]]), rel=1e-12)
    assert channel.residual(seen[:, 1], 1) == pytest.approx(np.array([-2.0]), rel=1e-12)
    assert not channel.is_complex


def test_a_residual_of_a_complex_datum_has_two_parts():
    channel = Channel(Z, ("a", "p"), np.array([1.0 + 2.0j]), np.array([0.5]))
    seen = np.array([[2.0], [0.5 * math.pi]])
    assert channel.model(seen) == pytest.approx(np.array([2j]), abs=1e-15)
    assert channel.residual(seen, np.arange(1)) == pytest.approx(np.array([[-2.0], [0.0]]), abs=1e-14)
    assert (channel.rows, channel.is_complex) == (2, True)


@pytest.mark.parametrize("turn", [2.0 * math.pi, 360.0, 1e-9])
@pytest.mark.parametrize("rounds", [-3, 0, 1])
def test_an_angle_is_compared_by_the_shorter_way_round(turn, rounds):
    channel = Channel("y", (PHASE,), np.array([0.45 * turn]), np.array([0.01 * turn]), turn)
    near = channel.residual(np.array([[-0.45 * turn + rounds * turn]]), np.arange(1))
    assert near == pytest.approx(np.array([[10.0]]), rel=1e-9)


def test_slopes_of_residuals_are_those_of_differences():
    values, rates = np.array([1.3, 0.7]), np.array([[0.4, -1.0], [2.0, 0.3]])
    for channel in (
        Channel(Z, ("a", "p"), np.array([0.2 - 0.4j]), np.array([0.05])),
        Channel("y", ("a",), np.array([0.2]), np.array([0.05])),
    ):
        exact = channel.slopes(values[: channel.rows], rates[: channel.rows], 0)
        for j in range(2):
            ends = [channel.residual((values + side * 1e-6 * rates[:, j])[: channel.rows], 0) for side in (1.0, -1.0)]
            assert exact[:, j] == pytest.approx((ends[0] - ends[1]) / 2e-6, rel=1e-7, abs=1e-7)


# turns

TURNS = {
    "max(x)": 0.0,
    PHASE: 2.0 * math.pi,
    "phase (x, 1)": 2.0 * math.pi,
    "phase(x, 1/2)": math.pi,
    "degrees(phase(x, 1))": 360.0,
    "degrees(phase(x, 1/2)) - 90": 180.0,
    "phase(x, 1)/2": math.pi,
    "2*phase(x, 1)": 4.0 * math.pi,
    "phase(x, 1) - phase(v, 1)": 2.0 * math.pi,
    "3*phase(x, 1) - 2*phase(v, 1)": 2.0 * math.pi,
    "phase(x, 1) + max(x)": 2.0 * math.pi,
    "1e-9*phase(x, 1)": 2e-9 * math.pi,
    "50*sin(phase(x, 1))": 0.0,
    "phase(x, 1)/2 + cos(phase(v, 1))": math.pi,
    "phase(x, 1)**2": 0.0,
    "max(x)*phase(x, 1)": 0.0,
    "log(-max(x))*phase(x, 1)": 0.0,
}


@pytest.mark.parametrize("formula", TURNS)
def test_a_formula_repeats_after_what_it_grows_by_in_a_turn_of_its_phases(duffing, formula):
    assert turn_of(duffing, formula) == pytest.approx(TURNS[formula], rel=1e-9, abs=0.0)


def test_a_large_difference_of_what_only_looks_like_an_angle_is_not_made_smaller(duffing):
    """50 sin(phase) may well be 20 off, which no turn of the phase mends."""
    data = {"w": W, "y": [30.0, 0.0, 0.0]}
    channel = read(duffing, data, {"y": 1.0}, {"y": "50*sin(phase(x, 1))"}).channels[0]
    assert channel.residual(np.array([50.0]), 0).tolist() == [20.0]


def test_a_turn_that_is_given_is_taken(duffing):
    data = {"w": W, "max(x)": W, PHASE: W}
    found = read(duffing, data, {"max(x)": 0.1, PHASE: 0.1}, turns={"max(x)": 2.5, PHASE: 0})
    assert [one.turn for one in found.channels] == [2.5, 0.0]


# what is refused

BAD = {
    "a turn": ({"turns": {"max(x)": "360"}}, r"turns\['max\(x\)'\] = '360': must be a finite number >= 0"),
    "a turn below 0": ({"turns": {"max(x)": -1.0}}, r"turns\['max\(x\)'\] = -1.0"),
    "no number as a turn": ({"turns": {"max(x)": np.nan}}, r"turns\['max\(x\)'\] = nan"),
    "a turn of complex data": (
        {"data": {"w": W, Z: 1j * np.ones(3)}, "sigma": {Z: 0.1}, "turns": {Z: 6.3}}, "must be columns of real data"
    ),
    "a column twice": ({"data": pd.DataFrame(np.ones((2, 3)), columns=["w", "max(x)", "max(x)"])}, "one column 'max"),
    "the parameter twice": ({"data": pd.DataFrame(np.ones((2, 3)), columns=["w", "w", "max(x)"])}, "one column 'w'"),
    "ragged": ({"data": {"w": W, "max(x)": [[1], [2, 3], [4]]}}, r"column 'max\(x\)' = .*a number for each row"),
    "a table in a column": ({"data": {"w": W, "max(x)": np.ones((3, 2))}}, "columns of one length"),
    "a masked table in a column": ({"data": {"w": W, "max(x)": np.ma.ones((3, 2))}}, "columns of one length"),
    "complex parameter": ({"data": {"w": 1j * np.ones(3), "max(x)": W}}, "column 'w' = .*must be real numbers"),
    "truths": ({"data": {"w": W, "max(x)": [True, False, True]}}, "must be numbers"),
    "times": ({"data": {"w": W, "max(x)": np.array([1, 2, 3], dtype="m8[s]")}}, "must be numbers"),
    "no data": ({"data": {"w": [], "max(x)": []}}, "data = '0 rows'"),
    "missing error": ({"sigma": {"max(x)": [0.1, np.nan, 0.1]}}, r"sigma\['max\(x\)'\]\[1\] = nan: must be finite"),
    "infinite error": ({"sigma": {"max(x)": math.inf}}, "must be a finite number > 0"),
    "no errors by name": ({"sigma": 0.1}, "sigma = 0.1: must be a mapping"),
    "observables": ({"observables": {"max(x)": 3}}, "observable = 3: must be text"),
}  # fmt: skip


@pytest.mark.parametrize("what", BAD)
def test_data_that_cannot_be_used_are_told(duffing, what):
    given, message = BAD[what]
    with pytest.raises(InputError, match=message):
        read(duffing, **({"data": {"w": W, "max(x)": W}} | given))
