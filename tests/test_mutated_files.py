"""Files that are damaged or made to do harm are told in a line; what `load` returns can be used."""

from __future__ import annotations

import errno
import json
import os
import re
from dataclasses import replace

import h5py
import numpy as np
import pytest

import mutated
from explained import unexplained
from saltus import InputError, load
from saltus.afm.paper.figures.files import read_results
from saltus.files import write_sealed
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.signature import Signature
from saltus.result import netcdf, tagged
from selection import guarding


@pytest.fixture(scope="module")
def held():
    return mutated.samples()


@pytest.mark.campaign
@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # what is computed of an absurd number may be none
@pytest.mark.parametrize("files", guarding([8, 60], 8, campaign=0))
def test_files_with_one_thing_changed_are_told_in_a_line_or_can_be_used(held, tmp_path, files):
    outcomes = set()
    for seed in range(files):
        name = list(held)[seed % len(held)]
        said = mutated.mutate(held[name], np.random.default_rng(seed), tmp_path / "a.nc")
        outcome = mutated.tried(tmp_path / "a.nc", held[name])
        assert outcome in ("told", "used", "told at use", "another system"), (name, seed, said, outcome)
        outcomes.add(outcome)
    assert {"told", "used"} <= outcomes


def test_every_variable_of_every_dataset_says_what_it_is(held):
    assert {name: told for name, result in held.items() if (told := unexplained(result.to_xarray()))} == {}


@pytest.mark.campaign
def test_files_that_nobody_changed_can_be_used(held, tmp_path):
    for name, result in held.items():
        assert mutated.tried(result.save(tmp_path / f"{name}.nc"), result) == "used"
        assert load(tmp_path / f"{name}.nc") == result


def _changed(result, tmp_path, change):
    dataset = tagged(result)
    change(dataset)
    write_sealed(tmp_path / "a.nc", netcdf({"": dataset}))
    return tmp_path / "a.nc"


@pytest.mark.parametrize("place", [0, 1, 2])
@pytest.mark.parametrize("index", [10**12, -2, 5])
def test_an_orbit_whose_index_is_none_of_the_systems_is_told(held, tmp_path, place, index):
    orbit = held["orbit"]

    def change(dataset):
        form = json.loads(dataset.attrs["form"])
        form[place][0] = index
        dataset.attrs["form"] = json.dumps(form)

    told = r"must be the whole file of a PeriodicOrbit; signature's (mode|transition|end) = "
    with pytest.raises(InputError, match=told):
        load(_changed(orbit, tmp_path, change))
    columns = [list(orbit.form.modes), list(orbit.form.transitions), list(orbit.form.kinds)]
    columns[place][0] = index
    form = Signature(*map(tuple, columns), orbit.form.turns)
    with pytest.raises(InputError, match=r"signature's (mode|transition|end) = "):
        OrbitProblem(orbit.system, form, orbit.system.parameter_vector(None))
    with pytest.raises(InputError, match=r"signature's (mode|transition|end) = "):
        replace(orbit, form=form)


def test_an_orbit_of_other_shapes_is_told(held):
    orbit = held["orbit"]
    for name in ("states", "durations", "x0", "lows", "highs"):
        with pytest.raises(InputError, match=rf"{name} of an orbit = .*must be of shape"):
            replace(orbit, **{name: np.zeros(7)})


def test_signatures_are_made_of_as_many_integers_for_each_segment():
    for parts in (((0,), (0, 0), (0,), 0), ((), (), (), 0), ((0.5,), (0,), (0,), 0), ((0,), (0,), (0,), "1")):
        with pytest.raises(InputError, match="signature = "):
            Signature(*parts)


@pytest.mark.campaign
def test_what_is_wrong_with_a_file_is_said(held, tmp_path):
    def lose(dataset):
        del dataset["step_mode"]

    def exceed(dataset):
        dataset["step_mode"][3] = 10**12

    def shorten(dataset):
        dataset.attrs["parameters"] = '{"k": 1.0}'

    for change, told in (
        (lose, "variable 'step_mode' = None: must be in the file"),
        (exceed, "variable 'step_mode' = 1000000000000: must be between 0 and 0"),
        (shorten, "parameters = ['k']: must be values of all of k, c, d, e, w, A"),
    ):
        path = _changed(held["trajectory"], tmp_path, change)
        whole = re.escape(f"path = {str(path)!r}: must be the whole file of a Trajectory; {told}")
        with pytest.raises(InputError, match=f"^{whole}$"):
            load(path)


@pytest.mark.campaign
def test_a_small_file_that_unpacks_to_a_huge_one_is_refused(tmp_path):
    path = tmp_path / "bomb.nc"
    with h5py.File(path, "w") as file:
        file.create_dataset("x", (10**12,), "f8", chunks=(10**6,))
        file.attrs["saltus_result"] = "Trajectory"
    assert path.stat().st_size < 10_000
    with pytest.raises(InputError, match="bytes when unpacked = 8000000000000: must be at most"):
        load(path)


@pytest.mark.campaign
def test_a_damaged_file_of_a_figure_is_told(held, tmp_path):
    path = tmp_path / "fig.nc"
    write_sealed(path, netcdf({"one": tagged(held["orbit"]), "two": tagged(held["branch"])}))
    assert read_results(path) == {"one": held["orbit"], "two": held["branch"]}
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    with pytest.raises(InputError, match="must be a whole file; it is damaged"):
        read_results(path)


@pytest.mark.campaign
def test_a_file_that_another_program_has_written_is_read_all_the_same(held, tmp_path, monkeypatch):
    path = held["array"].save(tmp_path / "a.nc")
    path.write_bytes(path.read_bytes()[:-50])
    assert load(path) == held["array"]
    monkeypatch.setattr("saltus.result._PATIENCE", 0.0)
    monkeypatch.setattr("saltus.result._PACE", np.inf)
    with pytest.raises(InputError, match="must be a NetCDF file; it is damaged: reading it does not end"):
        load(path)


@pytest.mark.skipif(os.name == "nt", reason="of POSIX")
def test_a_file_that_may_not_be_read_is_told(held, tmp_path, monkeypatch):
    path = held["array"].save(tmp_path / "a.nc")

    def refuse(*args, **options):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))

    monkeypatch.setattr(type(path), "open", refuse)
    with pytest.raises(InputError, match="must be a file that can be read; Permission denied"):
        load(path)


def test_an_orbit_without_a_period_is_told(held, tmp_path):
    def stand(dataset):
        dataset["segment_duration"] = ("segment", np.zeros(dataset.sizes["segment"]))

    with pytest.raises(InputError, match="durations of a positive sum, the period"):
        load(_changed(held["orbit"], tmp_path, stand))


def test_attractors_inside_a_file_of_basins_have_a_seal_of_their_own(held, tmp_path):
    def damage(dataset):
        content = np.array(dataset["attractors"].values)
        content[content.size // 2] ^= 1
        dataset["attractors"] = (dataset["attractors"].dims, content)

    with pytest.raises(InputError, match="attractors = .*it is damaged: its content is not what was written"):
        load(_changed(held["basins"], tmp_path, damage))
