"""Cascades of period doublings against closed forms and printed digits; files; what is refused."""

from __future__ import annotations

import math
import pickle
import re

import numpy as np
import pytest

import saltus
import systems
from oracles.closed_forms import HENON, LOGISTIC, ImpactOrbit, henon_fixed_point
from saltus import (
    InputError,
    StepControl,
    continue_locus,
    continue_orbit,
    follow_cascade,
    solve_orbit,
)
from selection import guarding

DOUBLINGS = (3.0, 1.0 + math.sqrt(6.0), 3.5440903596, 3.5644072661, 3.5687594195)
"""Where periods 1, 2, 4, 8, 16 of the logistic map double, the last three as printed to ten digits."""
ACCUMULATION = 3.569945671870945


def carried(image, **parameters):
    return systems.carried_map(tuple(image), parameters, image)


def cycle(system, points, **parameters):
    """The orbit through the given points of a carried map."""
    return solve_orbit(system, parameters, [("carry", "map", [*np.atleast_1d(x), 0.0], 1.0) for x in points])


@pytest.fixture(scope="module")
def logistic():
    return continue_orbit(cycle(carried(LOGISTIC, a=2.5), [0.6]), "a", (2.0, 3.4))


@pytest.fixture(scope="module")
def henon():
    x = henon_fixed_point(0.2, 0.3)
    return continue_orbit(cycle(carried(HENON, a=0.2, b=0.3), [(x, x)]), "a", (-1.0, 1.5))


@pytest.fixture(scope="module")
def grazing():
    form = ImpactOrbit(1.1, 1)
    guess = [("free", "impact", form.after_impact(0.5), form.period)]
    orbit = solve_orbit(systems.impact_oscillator(), {"w": 1.1, "A": form.amplitude(0.5)}, guess)
    return continue_orbit(orbit, "A", (0.05, 1.2), directions="down")


@pytest.fixture(scope="module")
def cascade(logistic):
    return follow_cascade(logistic["PD1"], (2.5, 4.0))


def test_a_cascade_doubles_where_it_is_known_to(cascade):
    np.testing.assert_allclose(cascade.values, DOUBLINGS, atol=1e-10)
    assert cascade.stopped == "after 4 branches of doubled orbits, as many as `doublings` allows"
    assert [len(point.orbit.signature) for point in cascade.points] == [1, 2, 4, 8, 16]
    assert len(cascade.branches) == 4
    for branch, point in zip(cascade.branches, cascade.points[1:], strict=True):
        assert branch["PD1"].parameters["a"] == point.parameters["a"]


def test_the_ratios_of_a_cascade_and_its_limit(cascade):
    gaps = np.diff(DOUBLINGS)
    np.testing.assert_allclose(cascade.ratios, gaps[:-1] / gaps[1:], rtol=1e-6)
    assert cascade.ratios[-1] == pytest.approx(4.669, abs=0.01)
    assert cascade.limit == pytest.approx(ACCUMULATION, abs=1e-5)


def test_a_cascade_as_a_table_and_as_text(cascade):
    table = cascade.to_dataframe()
    assert table["doublings"].tolist() == [0, 1, 2, 3, 4]
    np.testing.assert_allclose(table["period"], [1.0, 2.0, 4.0, 8.0, 16.0], rtol=1e-12)
    assert table["ratio"].isna().tolist() == [True, False, False, False, True]
    lines = repr(cascade).splitlines()
    assert lines[0] == "Cascade of 5 period doublings along a"
    assert lines[1].startswith("  period 1   doubles at 3")
    assert lines[-1] == "  ended: after 4 branches of doubled orbits, as many as `doublings` allows"


def test_a_cascade_towards_lower_values():
    system = carried({"x": "(4 - b)*x*(1 - x)"}, b=1.5)
    branch = continue_orbit(cycle(system, [0.6]), "b", (0.7, 2.0))
    cascade = follow_cascade(branch["PD1"], (0.0, 2.0), doublings=2)
    np.testing.assert_allclose(4.0 - cascade.values, DOUBLINGS[:3], atol=1e-10)


def test_a_cascade_of_a_planar_map(henon):
    cascade = follow_cascade(henon["PD1"], (-1.0, 1.5), doublings=1)
    np.testing.assert_allclose(cascade.values, [3 * 0.7**2 / 4, 0.7**2 + 1.3**2 / 4], atol=1e-9)
    assert cascade.ratios.size == 0


def test_a_cascade_ends_at_a_bound(logistic):
    cascade = follow_cascade(logistic["PD1"], (2.5, 3.5), doublings=3)
    np.testing.assert_allclose(cascade.values, DOUBLINGS[:2], atol=1e-10)
    assert len(cascade.branches) == 2
    assert cascade.stopped == "a = 3.5: bound reached"


def test_progress_is_told_along_a_cascade(logistic):
    told = []
    cascade = follow_cascade(logistic["PD1"], (2.5, 4.0), doublings=2, progress=told.append)
    assert [progress.done for progress in told] == list(range(1, len(told) + 1))
    assert {progress.text.split(":")[0] for progress in told} == {"period 2", "period 4"}
    assert cascade == follow_cascade(logistic["PD1"], (2.5, 4.0), doublings=2)


def test_true_shows_a_bar_of_all_points_of_a_cascade(logistic, capsys):
    follow_cascade(logistic["PD1"], (2.5, 3.5), doublings=1, progress=True)
    out, err = capsys.readouterr()
    assert not out
    assert "period 2: a = 3." in err


@pytest.mark.parametrize("given", [None, 3, "PD1", []])
def test_what_is_no_special_point_starts_no_cascade(given):
    refuse(f"start = {given!r}: must be a SpecialPoint", lambda: follow_cascade(given, (2.5, 4.0)))


def test_a_cascade_starts_at_a_doubling_of_a_branch(henon):
    hint = "must be a PD of a branch; branch['PD1'] is one"
    refuse(f"start = 'SN': {hint}", lambda: follow_cascade(henon["SN1"], (-1.0, 1.5)))
    locus = continue_locus(henon["PD1"], ("a", "b"), {"a": (0.0, 1.0), "b": (0.2, 0.4)})
    refuse(f"start = 'PD': {hint}", lambda: follow_cascade(locus.point(0), (-1.0, 1.5)))


@pytest.mark.parametrize("bounds", [None, 3.0, (2.0,), (4.0, 2.5), (2.5, math.nan), "ab"])
def test_a_cascade_needs_an_interval(logistic, bounds):
    refuse(f"bounds = {bounds!r}: must be two numbers", lambda: follow_cascade(logistic["PD1"], bounds))


def test_a_cascade_needs_an_interval_that_holds_its_start(logistic):
    refuse("bounds = (3.2, 4.0): must be an interval", lambda: follow_cascade(logistic["PD1"], (3.2, 4.0)))


@pytest.mark.parametrize("doublings", [0, -1, 1.5, "2", None, True])
def test_the_number_of_doublings_is_a_count(logistic, doublings):
    start = logistic["PD1"]
    refuse(f"doublings = {doublings!r}: must be", lambda: follow_cascade(start, (2.5, 4.0), doublings=doublings))


@pytest.mark.parametrize("steps", [0.1, "small", {"largest": 0.1}, StepControl])
def test_steps_of_a_cascade_are_a_step_control(logistic, steps):
    refuse("steps = ", lambda: follow_cascade(logistic["PD1"], (2.5, 4.0), steps=steps))


def test_progress_of_a_cascade_is_a_function(logistic):
    refuse("progress = 3: must be True for a bar", lambda: follow_cascade(logistic["PD1"], (2.5, 4.0), progress=3))


def test_a_cascade_ends_at_a_grazing_whatever_the_steps(logistic):
    steps = StepControl(at_grazing="pass")
    wanted = "StepControl.at_grazing = 'pass': must be left out; a cascade ends at a grazing"
    refuse(wanted, lambda: follow_cascade(logistic["PD1"], (2.5, 4.0), steps=steps))


# files


@pytest.mark.campaign
def test_a_cascade_is_saved_and_read_back_equal(cascade, tmp_path):
    again = saltus.load(cascade.save(tmp_path / "cascade.nc"))
    assert isinstance(again, saltus.results.Cascade)
    assert again == cascade
    assert repr(again) == repr(cascade)
    assert again.branches == cascade.branches
    np.testing.assert_array_equal(again.values, cascade.values)
    assert again.options == {"bounds": [2.5, 4.0], "doublings": 4, "steps": cascade.options["steps"]}
    assert (again.system, again.parameter) == (cascade.system, "a")


def test_a_cascade_travels_between_processes(cascade):
    assert pickle.loads(pickle.dumps(cascade)) == cascade


def test_a_cascade_without_branches_is_saved_too(logistic, tmp_path):
    none = saltus.results.Cascade(logistic["PD1"], (), "by hand")
    assert len(none.points) == 1
    assert math.isnan(none.limit)
    assert saltus.results.Cascade.load(none.save(tmp_path / "none.nc")) == none


@pytest.mark.campaign
@pytest.mark.parametrize("name", guarding(["level", "start", "count", "special_count", "point"], "count", campaign=1))
def test_a_parameter_with_the_name_of_a_dimension_or_a_variable_does_no_harm(name, tmp_path):
    system = carried({"x": f"{name}*x*(1 - x)"}, **{name: 2.5})
    branch = continue_orbit(cycle(system, [0.6]), name, (2.0, 3.4))
    cascade = follow_cascade(branch["PD1"], (2.5, 3.5), doublings=1)
    assert saltus.load(cascade.save(tmp_path / "cascade.nc")) == cascade


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda data: data.attrs.update(parameter="b"), "attribute 'parameter' = 'b': must be one of a"),
        (lambda data: data.attrs.pop("stopped"), "attribute 'stopped' = None: must be in the file"),
        (lambda data: data["start.type"].values.fill("SN"), "variable 'start.type' = 'SN': must be PD"),
        (lambda data: data["special_type"].values.fill("XX"), "special points = 'no PD': must be a PD on each branch"),
        (lambda data: data["count"].values.fill(3), "variable 'count' = 12: must be"),
    ],
)
def test_what_is_wrong_with_the_dataset_of_a_cascade_is_told(cascade, change, message):
    dataset = cascade.to_xarray().copy(deep=True)
    change(dataset)
    refuse(message, lambda: saltus.results.Cascade.from_xarray(dataset))


def refuse(message, call):
    """What is called raises an `InputError` that begins with a message, in one line."""
    with pytest.raises(InputError, match=f"^{re.escape(message)}") as caught:
        call()
    assert "\n" not in str(caught.value)
