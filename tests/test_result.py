"""What all results can do: files of the right kind, equality, and what `load` tells."""

from __future__ import annotations

import copy
import pickle
from html import escape

import numpy as np
import pytest
import xarray as xr

import saltus
from discrete import HENON, LOGISTIC
from saltus import InputError, iterate, load
from saltus.files import write_sealed
from saltus.result import netcdf, tagged
from saltus.results import Iterates, PeriodicOrbit


@pytest.fixture(scope="module")
def found():
    return iterate(LOGISTIC, x0=[0.2], n=6)


def test_a_result_is_read_back_equal_by_its_class_and_by_load(found, tmp_path):
    path = found.save(tmp_path / "iterates.nc")
    assert load(path) == Iterates.load(path) == found
    assert pickle.loads(pickle.dumps(found)) == copy.deepcopy(found) == found


def test_a_file_of_another_kind_is_told(found, tmp_path):
    path = found.save(tmp_path / "iterates.nc")
    with pytest.raises(InputError, match="must be the file of a PeriodicOrbit; it holds a Iterates"):
        PeriodicOrbit.load(path)


def test_results_of_other_numbers_or_systems_differ(found):
    assert found != iterate(LOGISTIC, x0=[0.2000001], n=6)
    assert found != iterate(HENON, x0=[0.2, 0.1], n=6)
    assert found != "a text"


def test_a_dataset_gives_the_result_back(found):
    dataset = found.to_xarray()
    assert found.from_xarray(dataset) == found


def test_a_file_says_which_version_wrote_it_and_what_it_holds(found, tmp_path):
    with xr.open_dataset(found.save(tmp_path / "a.nc"), engine="h5netcdf") as dataset:
        assert (dataset.attrs["saltus_version"], dataset.attrs["saltus_result"]) == (saltus.__version__, "Iterates")


@pytest.mark.parametrize("version", ["99.0.0", "0.2.1", "1.0"])
def test_a_file_of_a_newer_version_says_so(found, tmp_path, version):
    dataset = tagged(found).assign_attrs(saltus_version=version)
    write_sealed(tmp_path / "a.nc", netcdf({"": dataset}))
    with pytest.warns(RuntimeWarning, match=f"the newer version saltus {version} wrote it, this is"):
        assert saltus.load(tmp_path / "a.nc") == found
    write_sealed(tmp_path / "b.nc", netcdf({"": dataset.drop_vars("x")}))
    with pytest.raises(InputError, match=f"the newer version saltus {version} wrote it"):
        saltus.load(tmp_path / "b.nc")


@pytest.mark.parametrize("name", ["a.csv", "a.PNG"])
def test_a_name_of_another_format_is_refused(found, tmp_path, name):
    with pytest.raises(InputError, match=r"a name of a NetCDF file, as 'result.nc'; to_xarray\(\)\[\["):
        found.save(tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_was_there_is_replaced_and_a_folder_that_is_not_is_told(found, tmp_path):
    path = tmp_path / "a.nc"
    found.save(path)
    other = iterate(LOGISTIC, x0=[0.3], n=3)
    other.save(path)
    assert load(path) == other
    with pytest.raises(InputError, match="must be in a folder that exists"):
        found.save(tmp_path / "new" / "a.nc")


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


def test_a_notebook_shows_a_result_as_text_with_a_small_picture(found):
    shown = found._repr_html_()
    assert shown.startswith(f"<pre>{escape(repr(found))}</pre>")
    assert '<img alt="" src="data:image/png;base64,iVBOR' in shown
