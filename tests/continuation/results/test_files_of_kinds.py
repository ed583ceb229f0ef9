"""Files of results of other packages, and of other versions."""

from __future__ import annotations

import json

import pytest
import xarray as xr

from saltus import InputError, Map, continue_orbit, load, solve_orbit
from saltus.result import Result, netcdf, tagged


class Reading(Result):
    """A result of somebody else's module."""

    def __init__(self, value):
        self.value = value

    def to_xarray(self):
        return xr.Dataset(attrs={"value": self.value})

    @classmethod
    def _read(cls, held):
        return cls(held.number("value"))


@pytest.fixture(scope="module")
def branch():
    return continue_orbit(solve_orbit(Map(("x",), {"r": 2.5}, {"x": "r*x*(1 - x)"}), x0=[0.6]), "r", (2.2, 3.2))


def written(path, dataset):
    path.write_bytes(netcdf({"": dataset}))
    return path


def test_a_class_of_another_module_is_saved_and_loaded(tmp_path):
    assert load(Reading(2.5).save(tmp_path / "reading.nc")) == Reading(2.5)


@pytest.mark.campaign
def test_a_kind_that_nobody_defines_is_named(tmp_path):
    dataset = tagged(Reading(2.5)).assign_attrs(saltus_result="Sighting")
    with pytest.raises(InputError, match="import the module that has the class Sighting"):
        load(written(tmp_path / "sighting.nc", dataset))


@pytest.mark.campaign
def test_a_file_of_an_older_version_loads(branch, tmp_path):
    dataset = tagged(branch).assign_attrs(saltus_version="0.0.9")
    assert load(written(tmp_path / "older.nc", dataset)) == branch


@pytest.mark.campaign
def test_a_file_that_cannot_be_read_tells_which_version_wrote_it(branch, tmp_path):
    dataset = tagged(branch).assign_attrs(saltus_version="0.0.9").drop_vars("multiplier_re")
    with pytest.raises(InputError, match=r"saltus 0\.0\.9 wrote it, this is .*: load it with that version"):
        load(written(tmp_path / "older.nc", dataset))


@pytest.mark.campaign
def test_a_file_of_this_version_does_not_tell_of_versions(branch, tmp_path):
    dataset = tagged(branch).drop_vars("multiplier_re")
    with pytest.raises(InputError) as caught:
        load(written(tmp_path / "damaged.nc", dataset))
    assert "wrote it" not in str(caught.value)


def test_an_accessor_of_before_names_the_one_of_now(branch):
    assert json.loads(branch.to_xarray().attrs["varied"]) == ["r"]
    with pytest.raises(AttributeError, match="'orbit': it is now solution"):
        branch.orbit(0)
    with pytest.raises(AttributeError, match="'cycle': it is now map_orbit"):
        _ = next(iter(branch.special_points)).cycle
