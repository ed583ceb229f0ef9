"""What all results can do: files of the right kind, equality, and what `load` tells."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest

import saltus
from discrete import HENON, LOGISTIC
from saltus import InputError, iterate, load
from saltus.results import Iterates, PeriodicOrbit


@pytest.fixture(scope="module")
def found():
    return iterate(LOGISTIC, [0.2], n=6)


def test_a_result_is_read_back_equal_by_its_class_and_by_load(found, tmp_path):
    path = found.save(tmp_path / "iterates.nc")
    assert load(path) == Iterates.load(path) == found
    assert pickle.loads(pickle.dumps(found)) == copy.deepcopy(found) == found


def test_a_file_of_another_kind_is_told(found, tmp_path):
    path = found.save(tmp_path / "iterates.nc")
    with pytest.raises(InputError, match="must be the file of a PeriodicOrbit; it holds a Iterates"):
        PeriodicOrbit.load(path)


def test_results_of_other_numbers_or_systems_differ(found):
    assert found != iterate(LOGISTIC, [0.2000001], n=6)
    assert found != iterate(HENON, [0.2, 0.1], n=6)
    assert found != "a text"


def test_a_file_tells_its_version_and_its_kind(found):
    dataset = found.to_xarray()
    assert found.from_xarray(dataset) == found
    assert dataset.attrs["saltus_version"] == saltus.__version__


def test_a_folder_is_made_and_a_file_that_was_there_is_replaced(found, tmp_path):
    path = tmp_path / "new" / "a.nc"
    found.save(path)
    other = iterate(LOGISTIC, [0.3], n=3)
    other.save(path)
    assert load(path) == other


@pytest.mark.parametrize(("content", "told"), [(None, "a file that exists"), (b"text", "a NetCDF file")])
def test_what_is_no_file_of_a_result_is_told(tmp_path, content, told):
    path = tmp_path / "a.nc"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=told):
        load(path)


def test_arrays_of_a_result_are_read_only(found):
    with pytest.raises(ValueError, match="read-only"):
        np.asarray(found.states)[0] = 7.0
