"""What a companion does: a step of plain data gives a result, its time and its warnings."""

import subprocess
import sys
import warnings

import pytest

from saltus.errors import InputError
from saltus.explorer import tasks
from saltus.explorer.steps import FindOrbit
from saltus.explorer.subjects import definition_of


def test_a_step_of_plain_data_gives_the_result_of_its_call(taken_steps, ball_on_table):
    steps, results = taken_steps
    found = tasks.take(definition_of(ball_on_table), steps["motion1"].model_dump(), {}, (), bool)
    assert found.result == results["motion1"]
    assert found.seconds > 0.0
    assert found.notes == ()


def test_warnings_are_notes_each_once(taken_steps, ball_on_table, monkeypatch):
    def run(self, system, results, progress):
        for text, kind in (("slow", RuntimeWarning), ("old", DeprecationWarning), ("slow", RuntimeWarning)):
            with warnings.catch_warnings():
                warnings.simplefilter("always")
                warnings.warn(text, kind, stacklevel=1)
        return taken_steps[1]["orbit1"]

    monkeypatch.setattr(FindOrbit, "run", run)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        found = tasks.take(definition_of(ball_on_table), taken_steps[0]["orbit1"].model_dump(), {}, (), bool)
    assert found.notes == ("slow",)


def test_what_is_no_step_is_refused(ball_on_table):
    with pytest.raises(InputError, match="step = "):
        tasks.take(definition_of(ball_on_table), {"kind": "erase"}, {}, (), bool)


def test_a_step_whose_result_is_missing_is_refused(taken_steps, ball_on_table):
    with pytest.raises(InputError, match="result = 'orbit1': must be found first"):
        tasks.take(definition_of(ball_on_table), taken_steps[0]["branch1"].model_dump(), {}, (), bool)


def test_the_last_orbit_is_told_by_its_place_on_the_axes(ball_on_table, taken_steps):
    steps, results = taken_steps
    told, plain = [], steps["branch1"].model_dump()
    outcome = tasks.take(
        definition_of(ball_on_table), plain, {"orbit1": results["orbit1"]}, ("a", "max_z"), told.append
    )
    (a, z), *_ = [progress.last for progress in told if progress.last is not None]
    values, heights = outcome.result.values, outcome.result.column("max_z")
    assert [a, z] in [[value, pytest.approx(height)] for value, height in zip(values, heights, strict=True)]
    assert all(progress.last is None or isinstance(progress.last, tuple) for progress in told)


_AFTER_ALL = """
import sys
from saltus.explorer import tasks
assert "scipy.optimize" not in sys.modules, "imported, and no orbit needs it"
tasks.prepare()
before = set(sys.modules)
import scipy.linalg.lapack, xarray
xarray.Dataset({"x": ("n", [0.0])})
assert not set(sys.modules) - before, set(sys.modules) - before
"""


def test_what_an_orbit_needs_is_imported_before_it_is_asked_for():
    subprocess.run([sys.executable, "-c", _AFTER_ALL], check=True, timeout=300)
