"""The package's front door: what is public, and what importing it costs."""

import copy
import inspect
import pickle
import subprocess
import sys

import pytest

import saltus
from saltus import ConvergenceError, InputError

MOST_ARGUMENTS = 8
"""Arguments that a public function may have; what is more goes into a dataclass of options."""


MOST_NAMES = 45
"""Names at the front door."""

DOORS = (saltus.options, saltus.results)
"""Modules of classes, beside the front door."""


def public_functions():
    """All functions of the front door, by name."""
    homes = {"": saltus, "afm.": saltus.afm}
    found = {before + name: getattr(home, name) for before, home in homes.items() for name in home.__all__}
    return {name: value for name, value in found.items() if inspect.isfunction(value)}


def loaded_after(code):
    probe = f"{code}\nimport sys\nprint(' '.join(sys.modules))"
    return subprocess.run([sys.executable, "-c", probe], capture_output=True, text=True, check=True).stdout.split()


def test_importing_saltus_loads_nothing_heavy():
    names = loaded_after("import saltus")
    for heavy in ("sympy", "numba", "scipy", "xarray", "matplotlib", "pandas", "h5netcdf", "pint", "typer", "rich",
                  "zarr", "pydantic", "pyvista", "distributed"):  # fmt: skip
        assert heavy not in names


def test_every_public_name_has_a_home():
    for name in saltus.__all__:
        assert getattr(saltus, name) is not None
    assert set(dir(saltus)) == set(saltus.__all__)


@pytest.mark.parametrize("name", public_functions())
def test_a_public_function_has_few_arguments_and_one_shape_of_progress(name):
    taken = inspect.signature(public_functions()[name]).parameters
    # what makes a definition takes what `HybridSystem` takes
    assert len(taken) <= MOST_ARGUMENTS or name == "filippov"
    assert not any(parameter.kind is parameter.VAR_KEYWORD for parameter in taken.values())
    if "progress" in taken:
        assert (taken["progress"].annotation, taken["progress"].default) == ("bool | Report", False)


def test_the_front_door_has_few_names_and_each_name_one_door():
    assert len(saltus.__all__) <= MOST_NAMES
    names = [name for door in (saltus, *DOORS) for name in door.__all__]
    assert len(set(names)) == len(names)
    for door in DOORS:
        assert all(isinstance(getattr(door, name), type) for name in door.__all__)
        assert dir(door) == door.__all__


@pytest.mark.parametrize(
    ("name", "home"),
    [
        ("StickingError", "errors.StickingError"),
        ("SweepOptions", "options.SweepOptions"),
        ("Limits", "options.SimulationOptions"),
        ("Branch", "results.Branch"),
    ],
)
def test_a_name_that_was_at_the_front_door_is_told_where_it_is(name, home):
    with pytest.raises(AttributeError, match=rf"^saltus\.{name} is now saltus\.{home}$"):
        getattr(saltus, name)
    with pytest.raises(ImportError, match=rf"^saltus\.{name} is now saltus\.{home}$"):
        exec(f"from saltus import {name}")


NAMED = {"parameters", "mode", "options", "steps", "directions", "events", "stop_at", "progress"}
"""Arguments that a public function takes by name; `parameters` also as its second."""


@pytest.mark.parametrize("name", public_functions())
def test_the_system_comes_first_then_parameters_then_the_state(name):
    taken = inspect.signature(public_functions()[name]).parameters
    by_name = [key for key, parameter in taken.items() if parameter.kind is parameter.KEYWORD_ONLY]
    order = [key for key in taken if key in ("system", "parameters", "x0")]
    assert order == sorted(order, key=("system", "parameters", "x0").index)
    if "system" in taken:
        assert next(iter(taken)) == "system"
    assert "map" not in taken
    second = list(taken)[1:2]
    assert not [key for key in taken if key in NAMED and key not in by_name and [key] != second]


@pytest.mark.parametrize("name", public_functions())
def test_a_class_of_options_is_always_the_argument_options(name):
    taken = inspect.signature(public_functions()[name]).parameters
    for key, parameter in taken.items():
        assert ("Options" in str(parameter.annotation)) == (key == "options")


@pytest.mark.parametrize("module", [saltus, *DOORS], ids=lambda module: module.__name__)
def test_unknown_attribute_is_told(module):
    with pytest.raises(AttributeError, match=f"No {module.__name__} attribute orbit"):
        _ = module.orbit


@pytest.mark.parametrize("content", [b"", b"not a file of saltus"])
def test_loading_something_else_is_told(tmp_path, content):
    path = tmp_path / "other.nc"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"path = '.*other\.nc': must be a NetCDF file"):
        saltus.load(path)


def test_loading_a_foreign_netcdf_is_told(tmp_path):
    import xarray as xr

    path = tmp_path / "other.nc"
    xr.Dataset({"a": 1.0}).to_netcdf(path, engine="h5netcdf")
    with pytest.raises(InputError, match="must be a file written by saltus"):
        saltus.load(path)


def test_saving_into_a_missing_folder_is_told(tmp_path):
    orbit = _circle()
    with pytest.raises(InputError, match="path = .*must be in a folder that exists"):
        orbit.save(tmp_path / "missing" / "orbit.nc")


def test_a_result_is_saved_and_read_back_equal(tmp_path):
    orbit = _circle()
    again = saltus.load(orbit.save(tmp_path / "orbit.nc"))
    assert again == orbit
    assert again.segments[0].duration == orbit.segments[0].duration
    with pytest.raises(InputError, match="it holds a PeriodicOrbit"):
        saltus.results.Branch.load(tmp_path / "orbit.nc")


def test_results_travel_between_processes():
    orbit = _circle()
    assert pickle.loads(pickle.dumps(orbit)) == orbit
    assert copy.deepcopy(orbit) == orbit


def test_errors_say_what_was_reached():
    error = ConvergenceError("periodic orbit", 0.5, 3, "start nearer")
    assert str(error) == "periodic orbit: no convergence, residual 0.5 after 3 iterations; start nearer"
    assert (error.residual, error.iterations) == (0.5, 3)


def test_the_unit_of_a_failed_search_is_told_and_survives_pickling():
    error = pickle.loads(pickle.dumps(ConvergenceError("periodic attractor", 0.5, 5311, unit="forcing periods")))
    assert str(error) == "periodic attractor: no convergence, residual 0.5 after 5311 forcing periods"
    assert error.unit == "forcing periods"


def test_results_compare_by_value_and_so_have_no_hash():
    with pytest.raises(TypeError, match="unhashable type: 'PeriodicOrbit'"):
        hash(_circle())


def _circle():
    system = saltus.HybridSystem(
        ("x", "y"), {"mu": 1.0}, {"m": saltus.Mode({"x": "y", "y": "mu*(1 - x**2)*y - x"})}, name="van der Pol"
    )
    return saltus.solve_orbit(system, {}, [("m", None, [2.0, 0.0], 6.66)])
