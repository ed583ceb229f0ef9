"""A fit as a result: numbers and words of its parts, files, and what a file must not hold."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

import saltus
from saltus import InputError, continue_orbit, find_orbit, fit
from saltus.options import FitOptions
from saltus.results import Fit

A1 = "amplitude(x, 1)"
W = np.array([0.7, 0.85, 1.0, 1.15, 1.3])
AWAY = np.array([0.01, -0.02, 0.005, 0.01, -0.01])


@pytest.fixture(scope="module")
def found(duffing):
    data = {"w": W, "R": 0.5 / np.hypot(1.0 - W**2, 0.3 * W) + AWAY}
    start = find_orbit(duffing, {"w": 0.6, "b": 0.0, "k": 1.05, "c": 0.32}, [0.0, 0.0])
    options = FitOptions(observables={"R": A1})
    vary = {"k": (0.5, 2.0), "c": (0.01, 1.0)}
    return fit(data, continue_orbit(start, "w", (0.6, 1.4)), vary, {"R": 0.02}, options=options)


def untold(found, **changes):
    """The same fit, of which the data do not tell one parameter."""
    return replace(found, covariance=np.array([[np.inf, 0.0], [0.0, 4e-6]]), **changes)


@pytest.mark.campaign
def test_values_are_asked_for_by_name(found):
    assert found["k"] == found.values[0] == pytest.approx(1.0, abs=0.02)
    assert found["c"] == found.values[1]
    with pytest.raises(InputError, match="parameter = 'b': must be one of k, c"):
        found["b"]


def test_parameters_are_those_of_the_fit_and_of_the_branch(found):
    values = {"k": found["k"], "c": found["c"], "b": 0.0, "A": 0.5, "g": 1.0}
    assert found.parameters == values
    assert all(branch.parameters["k"] == found["k"] for branch in found.branches)


def test_residuals_and_chi2_are_of_the_same_data(found):
    model = 0.5 / np.hypot(found["k"] - W**2, found["c"] * W)
    measured = found.data["measured"].to_numpy()[:, 0]
    assert found.residuals == pytest.approx((model - measured) / 0.02, abs=1e-6)
    assert found.data["model"].to_numpy()[:, 0] == pytest.approx(model, rel=1e-8)
    assert found.chi2 == pytest.approx(np.sum(found.residuals**2), rel=1e-14)
    assert found.chi2_per_datum == pytest.approx(found.chi2 / 5.0, rel=1e-14)
    assert found.misfit == ""
    assert found.message == found.stopped == "the optimum is found"


def test_errors_and_correlation_are_those_of_the_covariance(found):
    table = found.covariance
    assert found.errors == {"k": np.sqrt(table[0, 0]), "c": np.sqrt(table[1, 1])}
    assert found.correlation.loc["k", "c"] == pytest.approx(table[0, 1] / np.sqrt(table[0, 0] * table[1, 1]), rel=1e-12)
    assert np.diag(found.correlation) == pytest.approx([1.0, 1.0], rel=1e-12)
    stiff = found["k"] - W**2
    shape = np.hypot(stiff, found["c"] * W) ** -3.0
    slopes = -0.5 * np.array([stiff * shape, found["c"] * W**2 * shape]).T / 0.02
    weights = 1.0 / np.sqrt(1.0 + found.residuals**2 / 9.0)
    assert table == pytest.approx(np.linalg.inv(slopes.T @ (weights[:, None] * slopes)), rel=1e-6)


def test_what_the_data_do_not_tell_has_an_infinite_error_and_no_correlation(found):
    one = untold(found)
    assert one.errors == {"k": np.inf, "c": pytest.approx(2e-3)}
    assert np.isnan(one.correlation.to_numpy()).tolist() == [[True, True], [True, False]]
    assert "not told by the data" in repr(one).splitlines()[1]
    assert "+- 0.002" in repr(one).splitlines()[2]


def test_the_table_has_a_row_for_each_parameter(found):
    table = replace(found, profiles={"c": (0.09, 0.12)}).to_dataframe()
    assert list(table.index) == ["k", "c"]
    assert table.loc["k", ["value", "start", "low", "high"]].tolist() == [found["k"], 1.05, 0.5, 2.0]
    assert table.loc["c", ["profile_low", "profile_high"]].tolist() == [0.09, 0.12]
    assert np.isnan(table.loc["k", "profile_low"])
    assert table["error"].tolist() == list(found.errors.values())


def test_the_words_of_a_fit_name_what_it_found(found):
    spread = np.array([[1e-4, 0.99e-4], [0.99e-4, 1e-4]])
    one = replace(found, covariance=spread, profiles={"c": (0.09, 0.12)}, notes=("a note",), evaluations=7)
    lines = repr(one).splitlines()
    assert lines[0].startswith("Fit of Duffing along w: 5 data, chi2/n = ")
    assert lines[2].endswith("+- 0.01, profile 0.09 to 0.12")
    assert "  sheet 0: 5 data" in lines
    assert "  k and c correlate by 0.990" in lines
    assert lines[-2:] == ["  a note", "  the optimum is found, after 7 evaluations"]


def test_the_only_datum_far_off_is_named_and_chi2_is_told_with_and_without_it(found):
    data = found.data.copy(deep=True)
    data["residual"][1, 0] = -50.0
    one = replace(found, data=data)
    assert one.misfit == ""
    assert one.outliers == (1,)
    rest = np.delete(found.residuals, 1)
    assert one.chi2_without_outliers == pytest.approx(rest @ rest / 4.0, rel=1e-12)
    lines = repr(one).splitlines()
    assert lines[1] == "  outlier: datum 1 at w = 0.85, whose R is 50 standard errors off"
    assert lines[2] == f"  chi2/n = 500 with 1 outlier, {one.chi2_without_outliers:.3g} without"
    assert one != found


def test_two_of_five_data_far_off_are_no_outliers_and_are_said_first(found):
    data = found.data.copy(deep=True)
    data["residual"][1, 0] = data["residual"][3, 0] = -50.0
    one = replace(found, data=data)
    assert one.outliers == ()
    assert one.misfit.startswith("the data do not fit: chi2/n = 1e+03 is above")
    assert "2 of 5 data lie more than 5 standard errors off the model" in one.misfit
    assert one.message == f"{one.misfit}; the optimum is found"
    assert repr(one).splitlines()[1] == f"  {one.misfit}"


@pytest.mark.campaign
@pytest.mark.parametrize("kind", ["as it is", "with all that it may have"])
def test_a_fit_is_read_back_equal_from_a_file(found, tmp_path, kind):
    stopped = "interrupted: the best so far"
    one = found
    if kind != "as it is":
        one = untold(found, profiles={"k": (0.9, 1.1)}, notes=("a note", "é"), stopped=stopped)
    again = saltus.load(one.save(tmp_path / "fit.nc"))
    assert isinstance(again, Fit)
    assert again == one
    assert again.profiles == one.profiles
    assert again.notes == one.notes
    assert again.formulas == {"R": (A1,)}
    assert repr(again) == repr(one)
    assert np.array_equal(again.covariance, one.covariance)


def test_a_pickle_gives_the_same_fit(found):
    assert pickle.loads(pickle.dumps(found)) == found


def test_a_dataset_has_parameters_data_and_channels_as_dimensions(found):
    dataset = found.to_xarray()
    assert dataset["vary"].to_numpy().tolist() == ["k", "c"]
    assert dataset["channel"].to_numpy().tolist() == ["R"]
    assert dataset.sizes["datum"] == 5
    assert dataset["fit_x"].to_numpy().tolist() == W.tolist()
    assert np.isnan(dataset["profile"].to_numpy()).all()


def changed(dataset, name, value):
    found = dataset.copy(deep=True)
    found[name] = (found[name].dims, np.full(found[name].shape, value))
    return found


SPOILED = {
    "no parameter": (lambda d: d.assign_coords(vary=["k", "q"]), "vary = 'q': must be one of"),
    "along": (lambda d: d.assign_attrs(along="q"), "attribute 'along' = 'q': must be one of"),
    "formulas of no channel": (lambda d: d.assign_attrs(formulas='{"S": ["max(x)"]}'), "attribute 'formulas'"),
    "too many formulas": (lambda d: d.assign_attrs(formulas='{"R": ["max(x)", "min(x)"]}'), "attribute 'formulas'"),
    "a formula": (lambda d: d.assign_attrs(formulas='{"R": [3]}'), "formulas of R"),
    "evaluations": (lambda d: d.assign_attrs(evaluations=1.5), "attribute 'evaluations' = 1.5: must be a whole number"),
    "a value": (lambda d: changed(d, "fitted", np.nan), "variable 'fitted'"),
    "a side": (lambda d: changed(d, "fit_side", 2), "variable 'fit_side'"),
    "a sheet": (lambda d: changed(d, "fit_sheet", -1), "variable 'fit_sheet'"),
    "a turn": (lambda d: changed(d, "fit_turn", -1.0), "variable 'fit_turn'"),
    "no residuals": (lambda d: d.drop_vars("fit_residual"), "dimension 'row' = None: must be of size 1 or more"),
}


@pytest.mark.parametrize("what", SPOILED)
def test_a_file_whose_parts_do_not_agree_is_refused(found, what):
    spoil, message = SPOILED[what]
    with pytest.raises(InputError, match=message):
        Fit.from_xarray(spoil(found.to_xarray()))


def test_arrays_of_a_fit_cannot_be_changed(found):
    for array in (found.values, found.start, found.bounds, found.covariance):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0.0
