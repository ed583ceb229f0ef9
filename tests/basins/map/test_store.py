"""Stores: written as they go, resumed from what is done, refused to other inputs, readable whatever happens."""

import errno
import json
import os
import signal
import subprocess
import sys
import time
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
import zarr
from zarr.storage import LocalStore

import saltus
from explained import unexplained
from grouped import Grouped
from saltus import InputError
from saltus.basins import AttractorOptions, Basins, map_basins
from saltus.basins.map.store import Store
from saltus.ensemble.traps import NOT_DONE
from saltus.options import BasinOptions
from wells import BOX, Interrupt, double_well


@pytest.fixture
def stored(well, both, small_units, tmp_path):
    return map_basins(well, {}, BOX, both, path=tmp_path / "a.zarr")


def units_in(path):
    return sorted(file for file in (path / "labels" / "c").rglob("*") if file.is_file())


def test_a_store_holds_the_array_that_memory_would(stored, basins):
    assert np.array_equal(np.asarray(stored.labels), basins.labels)
    assert stored.fractions() == basins.fractions()
    assert stored.stopped == "all 600 cells done"


def test_all_inputs_are_in_the_metadata_of_a_store(stored, both, well):
    attributes = json.loads((stored.path / "zarr.json").read_text())["attributes"]
    inputs = attributes["inputs"]
    assert saltus.HybridSystem.from_definition(inputs["system"]) == well
    assert inputs["parameters"] == {"c": 0.5, "A": 0.05, "w": 1.0}
    assert (inputs["tolerance"], inputs["longest"], inputs["engine"], inputs["preview"]) == (3e-9, 200, "cpu", False)
    assert inputs["labels"] == {"right": 0, "left": 1, "diverged": 253, "undecided": 254}
    assert attributes["saltus_version"] == inputs["saltus_version"] == saltus.__version__
    assert attributes["grid"]["ranges"] == {"x": [-2.0, 2.0, 30], "v": [-2.0, 2.0, 20]}
    assert attributes["attractors"]["notes"] == both.notes
    assert np.array_equal(attributes["attractors"]["points"]["left"], both.points["left"])


def test_the_draft_that_a_killed_process_left_is_no_part_of_the_store(stored, basins):
    (stored.path / ".zarr.d4553c97e882.part.json").write_text("{")
    assert np.array_equal(saltus.load(stored.path).to_xarray()["labels"], basins.labels)


def test_any_reader_of_zarr_finds_labels_over_their_coordinates(stored, basins):
    dataset = xr.open_zarr(stored.path, chunks=None)
    assert np.array_equal(dataset["x"], basins.grid.axes[0])
    found = dataset["labels"].sel(x=0.3, v=-1.1, method="nearest")
    assert int(found) == basins.section(x=0.3).labels[basins.grid.nearest({"v": -1.1})["v"]]
    assert dataset["labels"].attrs["flag_meanings"].split()[1] == "left"


def test_a_store_tells_the_accuracy_of_its_own_labels(stored):
    attributes = zarr.open_group(stored.path, mode="r").attrs
    error = attributes["label_error"]
    assert error == {
        "wrong": 0, "cells": 500, "bound": pytest.approx(3.0 / 500, rel=0.01), "tolerance": 1e-12,
        "wrong_by_events": 0, "cells_by_events": 50,
    }  # fmt: skip
    regions = stored.attractors.measured_error
    assert attributes["accuracy"] == {"tolerance": 3e-9, "trapping_regions": regions, "label_error": error}


def test_a_store_before_its_check_and_one_of_an_array_claim_no_accuracy(well, both, small_units, tmp_path):
    begun = map_basins(well, {}, BOX, both, path=tmp_path / "begun.zarr", progress=Interrupt(2))
    assert zarr.open_group(begun.path, mode="r").attrs["accuracy"]["label_error"] is None
    array = Basins.from_array([0, 1], {"x": np.arange(2.0)}, {"a": 0, "b": 1})
    assert "accuracy" not in zarr.open_group(array.save(tmp_path / "array.zarr"), mode="r").attrs


def test_the_attractors_are_arrays_that_other_tools_read(stored, both):
    dataset = xr.open_zarr(stored.path, chunks=None)
    assert dataset["attractor_point"].attrs["states"].split() == ["x", "v"]
    for name, label in both.labels.items():
        if name in both.points:
            rows = dataset["attractor_point"].values[dataset["attractor_label"].values == label]
            assert np.array_equal(rows, both.points[name])
    held = stored.to_xarray()
    for name in ("attractor_point", "attractor_label"):
        assert held[name].equals(dataset[name])
    assert unexplained(held) == []


def test_basins_know_the_error_that_was_measured_of_their_store(stored, basins, well, both, small_units, tmp_path):
    assert stored.noted_error == stored.label_error(500, by_events=50) == stored.section(v=0.1).noted_error
    assert basins.noted_error == basins.label_error(100, by_events=0)
    assert map_basins(well, {}, BOX, both, path=tmp_path / "b.zarr", progress=Interrupt(2)).noted_error is None


def test_what_is_no_store_is_told_by_what_it_is(stored, tmp_path):
    (tmp_path / "file").touch()
    zarr.open_group(tmp_path / "group", mode="w").create_group("one")
    (tmp_path / "folder").mkdir()
    kinds = [("file", "it is a file"), ("none", "there is nothing"), ("group", "it holds one")]
    for name, told in [*kinds, ("folder", "it is a folder of something else")]:
        with pytest.raises(InputError, match=rf"{name}': must be a store of basins that saltus wrote; {told}$"):
            Basins.open(tmp_path / name)


@pytest.mark.campaign
def test_damaged_metadata_and_damaged_attractors_of_a_store_are_told(stored, well, tmp_path):
    path = tmp_path / "found.zarr"
    map_basins(well, {}, BOX, {"options": AttractorOptions(starts=12, samples=200)}, path=path)
    (file,) = (path / "attractors" / "c").iterdir()
    whole = file.read_bytes()
    for damaged in (whole[: len(whole) // 2], whole[:-9] + bytes(9), b""):
        file.write_bytes(damaged)
        for open_store in (Basins.open, lambda path: map_basins(well, {}, BOX, path=path)):
            with pytest.raises(
                InputError, match=r"^path = .*: must be a store with its attractors whole; what it holds"
            ):
                open_store(path)
    file.write_bytes(whole)
    assert Basins.open(path).attractors.names == ("period-1 A", "period-1 B")
    (stored.path / "zarr.json").write_text("{")
    with pytest.raises(InputError, match=r"^path = .*: must be a store of basins that saltus wrote; JSONDecodeError "):
        Basins.open(stored.path)


def test_a_section_of_a_store_reads_the_chunks_that_it_cuts_and_no_other(stored, basins, monkeypatch):
    cut = saltus.load(stored.path).section(v=0.95)
    read = []
    get = LocalStore.get

    async def watched(self, key, *args, **options):
        if "/c/" in key:
            read.append(key.split("/c/")[1])
        return await get(self, key, *args, **options)

    monkeypatch.setattr(LocalStore, "get", watched)
    assert np.array_equal(np.asarray(cut.labels), basins.section(v=0.95).labels)
    unit = zarr.open_group(stored.path, mode="r")["labels"]
    column = basins.grid.nearest({"v": 0.95})["v"] // (unit.shards or unit.chunks)[1]
    assert read
    assert {key.split("/")[1] for key in read} == {str(column)}


def test_labels_of_a_store_are_sliced_as_an_array_is(stored, basins):
    for key in [(3, 4), (slice(2, 9), 5), (Ellipsis, 7), (slice(None, None, 3),), (-1, -2)]:
        assert np.array_equal(stored.labels[key], basins.labels[key])
    i, j = np.array([3, 5, 7]), np.array([1, 2, 19])
    assert np.array_equal(stored.labels[i, j], basins.labels[i, j])
    assert np.array_equal(stored.section(v=0.0).labels[i], basins.section(v=0.0).labels[i])
    with pytest.raises(IndexError, match="3 indices for 2 dimensions"):
        stored.labels[0, 0, 0]


def test_a_section_of_a_store_can_be_saved_on_its_own(stored, basins, tmp_path):
    cut = stored.section(v=0.3)
    assert saltus.load(cut.save(tmp_path / "cut.nc")) == cut
    assert saltus.load(cut.save(tmp_path / "cut.zarr")) == cut
    assert cut == basins.section(v=0.3)


def test_large_stores_have_chunks_within_the_unit_of_one_writer(both, tmp_path):
    from saltus.basins.map.basins import attributes_of
    from saltus.basins.map.grid import Grid
    from saltus.basins.map.store import Store

    grid = Grid(("x", "v"), {"x": (0, 1, 4000), "v": (0, 1, 4000)})
    Store.create(tmp_path / "large.zarr", grid, attributes_of({}, grid, both), b"", {})
    array = zarr.open_group(tmp_path / "large.zarr", mode="r")["labels"]
    assert (array.chunks, array.shards, array.fill_value) == ((250, 250), (500, 1000), NOT_DONE)
    assert units_in(tmp_path / "large.zarr") == []


def test_a_run_that_was_interrupted_goes_on_from_its_units(well, both, basins, small_units, tmp_path):
    path, seen = tmp_path / "a.zarr", []
    part = map_basins(well, {}, BOX, both, path=path, progress=Interrupt(3))
    done = np.asarray(part.labels) != NOT_DONE
    assert part.stopped == f"interrupted: {done.sum()} of 600 cells done"
    assert part.fractions()["not done"] == pytest.approx(1.0 - done.mean())
    before = {file: file.stat().st_mtime_ns for file in units_in(path)}
    whole = map_basins(well, {}, BOX, both, path=path, progress=lambda told: seen.append(told.done))
    assert seen[0] > done.sum()
    assert seen[-1] == 600
    assert {file: file.stat().st_mtime_ns for file in before} == before
    assert np.array_equal(np.asarray(whole.labels), basins.labels)


def test_what_is_done_is_not_computed_again(stored, well, both):
    again = map_basins(well, {}, BOX, both, path=stored.path, progress=lambda told: pytest.fail("computed"))
    assert again == stored
    assert again.orbits_per_second == pytest.approx(stored.orbits_per_second)


KILLED = """
import sys, time
import saltus.basins.map.grid
saltus.basins.map.grid._LEAST, saltus.basins.map.grid._CHUNK = 60, 30
from saltus.basins import map_basins
from wells import BOX, double_well, wells
well = double_well()
map_basins(well, {}, BOX, wells(well), path=sys.argv[1], progress=lambda told: time.sleep(0.3))
"""


@pytest.mark.campaign
@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="no such signal")
def test_a_run_that_was_killed_goes_on_and_gives_the_identical_array(well, both, basins, small_units, tmp_path):
    path = tmp_path / "a.zarr"
    paths = os.pathsep.join([str(Path(__file__).parents[2]), *sys.path])
    victim = subprocess.Popen([sys.executable, "-c", KILLED, str(path)], env={**os.environ, "PYTHONPATH": paths})
    try:
        limit = time.monotonic() + 60.0
        while len(units_in(path)) < 2 and time.monotonic() < limit and victim.poll() is None:
            time.sleep(0.02)
    finally:
        victim.kill()
        victim.wait()
    part = saltus.load(path)
    assert part.stopped.startswith("interrupted: ")
    assert 0.0 < part.fractions()["not done"] < 1.0
    whole = map_basins(well, {}, BOX, both, path=path)
    assert np.array_equal(np.asarray(whole.labels), basins.labels)


def test_a_unit_that_was_left_empty_is_not_done(stored, well, both, basins):
    units_in(stored.path)[4].write_bytes(b"")
    again = saltus.load(stored.path)
    assert again.stopped.startswith("interrupted: ")
    assert again.fractions()["not done"] > 0.0
    assert np.array_equal(np.asarray(map_basins(well, {}, BOX, both, path=stored.path).labels), basins.labels)


@pytest.mark.parametrize("damage", [lambda held: held[:-3], lambda held: held[:6] + b"\xff" + held[7:]])
def test_a_unit_that_is_not_whole_is_told_and_computed_again(stored, well, both, basins, damage):
    file = units_in(stored.path)[4]
    file.write_bytes(damage(file.read_bytes()))
    with pytest.raises(
        InputError, match=r"^path = .*: must be a store whose chunks are whole; .* computes what is damaged"
    ):
        saltus.load(stored.path).fractions()
    whole = map_basins(well, {}, BOX, both, path=stored.path)
    assert np.array_equal(np.asarray(whole.labels), basins.labels)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"parameters": {"A": 0.06}}, r"its parameters\.A is 0\.05, not 0\.06$"),
        (
            {"grid": {**BOX, "x": (-2.0, 2.5, 30)}},
            r"its grid\.ranges\.x is \[-2\.0, 2\.0, 30\], not \[-2\.0, 2\.5, 30\]$",
        ),
        ({"grid": {"v": BOX["v"], "x": BOX["x"]}}, r"its grid\.order is \['x', 'v'\], not \['v', 'x'\]$"),
        ({"tolerance": 1e-9}, r"its tolerance is 3e-09, not 1e-09$"),
        ({"longest": 100}, r"its longest is 200, not 100$"),
        ({"preview": True}, r"its preview is False, not True$"),
        ({"system": double_well("another")}, r"its system\.name is 'double well', not 'another'$"),
    ],
)
def test_a_store_of_other_inputs_is_refused_with_both_values(stored, well, both, change, told):
    asked = {"system": well, "parameters": {}, "grid": BOX, "attractors": both, "path": stored.path, **change}
    held = {file: file.read_bytes() for file in stored.path.rglob("*") if file.is_file()}
    with pytest.raises(InputError, match=r"^path = .*: must be a new one, or that of the same input; " + told):
        Grouped(map_basins, options=BasinOptions)(**asked)
    assert {file: file.read_bytes() for file in stored.path.rglob("*") if file.is_file()} == held


def test_a_store_of_other_attractors_is_refused(stored, well, both):
    with pytest.raises(InputError, match=r"its traps\.ellipsoids\.shapes\.values is \[5\.0, .*\], not \[4\.0, "):
        map_basins(well, {}, BOX, both.but(radius=0.25), path=stored.path)
    renamed = both.but(labels={"right": 1, "left": 0, "diverged": 253, "undecided": 254})
    with pytest.raises(InputError, match=r"its labels\.right is 0, not 1$"):
        map_basins(well, {}, BOX, renamed, path=stored.path)


@pytest.mark.campaign
def test_a_store_is_resumed_with_the_search_for_attractors_that_made_it_or_without_one(well, tmp_path):
    path, search = tmp_path / "a.zarr", {"options": AttractorOptions(starts=12, samples=200)}
    found = map_basins(well, {}, BOX, search, path=path)
    assert map_basins(well, {}, BOX, search, path=path) == found
    assert map_basins(well, {}, BOX, path=path) == found
    assert map_basins(well, {}, BOX, found.attractors, path=path) == found
    for change, told in [
        ({"options": AttractorOptions(starts=16)}, r"its search\.options\.starts is 12, not 16$"),
        (
            {"region": {"x": (-2.0, 2.5), "v": (-2.0, 2.0)}},
            r"its search\.region\.x is \[-2\.0, 2\.0\], not \[-2\.0, 2\.5\]$",
        ),
        ({"options": AttractorOptions(starts=12, samples=300)}, r"its search\.options\.samples is 200, not 300$"),
    ]:
        with pytest.raises(InputError, match=r"^path = .*: must be a new one, or that of the same input; " + told):
            map_basins(well, {}, BOX, search | change, path=path)
    with pytest.raises(InputError, match=r"its search\.options\.starts is 12, not 256$"):
        map_basins(well, {}, BOX, {}, path=path)


@pytest.mark.campaign
def test_a_store_whose_search_was_written_under_other_names_is_resumed(well, tmp_path):
    path, search = tmp_path / "a.zarr", {"options": AttractorOptions(starts=12, samples=200)}
    found = map_basins(well, {}, BOX, search, path=path)
    kept = Store.open(path, writable=True)
    inputs = kept.attributes["inputs"]
    options = dict(inputs["search"]["options"])
    older = {"region": inputs["search"]["region"], "seeds": options.pop("starts"), "motions": options.pop("motions")}
    del options["interval"]
    older["search"] = {"random_seed": options.pop("rng"), **options}
    kept.note(inputs=inputs | {"search": older})
    assert map_basins(well, {}, BOX, search, path=path).fractions() == found.fractions()
    with pytest.raises(InputError, match=r"its search\.options\.starts is 12, not 256$"):
        map_basins(well, {}, BOX, {}, path=path)


def test_a_store_of_another_version_is_refused(stored, well, both, monkeypatch):
    monkeypatch.setattr(saltus.basins.map.mapping, "__version__", "9.9")
    with pytest.raises(InputError, match=rf"its saltus_version is '{saltus.__version__}', not '9\.9'$"):
        map_basins(well, {}, BOX, both, path=stored.path)


def test_a_folder_that_is_no_store_of_basins_is_refused(well, both, tmp_path):
    (tmp_path / "plain").mkdir()
    zarr.create_group(tmp_path / "other.zarr", zarr_format=3)
    for name in ("plain", "other.zarr"):
        with pytest.raises(InputError, match=r"^path = .*: must be a store of basins that saltus wrote"):
            map_basins(well, {}, BOX, both, path=tmp_path / name)
    with pytest.raises(InputError, match=r"^path = .*other\.zarr': must be a store written by saltus; KeyError "):
        saltus.load(tmp_path / "other.zarr")
    with pytest.raises(InputError, match=r"^path = .*plain': must be a file that exists; it is a folder$"):
        saltus.load(tmp_path / "plain")
    (tmp_path / "file").write_text("something else")
    with pytest.raises(InputError, match=r"^path = .*: must be a store of basins that saltus wrote"):
        map_basins(well, {}, BOX, both, path=tmp_path / "file")


def refusing(number, after, monkeypatch):
    """Let the store refuse to write once `after` labels are written."""
    put, written = LocalStore.set, []

    async def refused(self, key, *args, **options):
        if "/c/" in key:
            written.append(key)
            if len(written) > after:
                raise OSError(number, os.strerror(number))
        return await put(self, key, *args, **options)

    monkeypatch.setattr(LocalStore, "set", refused)


def test_a_full_disk_is_told_and_leaves_a_store_that_can_be_read_and_resumed(
    well, both, basins, small_units, tmp_path, monkeypatch
):
    path = tmp_path / "a.zarr"
    with monkeypatch.context() as patched:
        refusing(errno.ENOSPC, 7, patched)
        with pytest.raises(
            InputError,
            match=r"^path = .*: must be on a disk with room for it; No space left on device; what is done is kept",
        ):
            map_basins(well, {}, BOX, both, path=path)
    part = saltus.load(path)
    assert 0.0 < part.fractions()["not done"] < 1.0
    assert np.array_equal(np.asarray(map_basins(well, {}, BOX, both, path=path).labels), basins.labels)


@pytest.mark.campaign
def test_no_store_is_made_or_read_by_way_of_temporary_files(well, tmp_path, monkeypatch):
    path, options = tmp_path / "a.zarr", {"options": AttractorOptions(starts=12, samples=200)}

    def refused(*args, **kinds):
        raise OSError(errno.ENOSPC, "No space left on device")

    for name in ("TemporaryDirectory", "mkdtemp", "NamedTemporaryFile", "mkstemp"):
        monkeypatch.setattr(f"tempfile.{name}", refused)
    found = map_basins(well, {}, BOX, options, path=path)
    assert Basins.open(path).attractors == found.attractors


def test_a_store_that_cannot_be_made_leaves_nothing_behind(well, both, tmp_path, monkeypatch):
    with monkeypatch.context() as patched:
        refusing(errno.ENOSPC, 0, patched)
        with pytest.raises(
            InputError, match=r"^path = .*: must be on a disk with room for it; No space left on device"
        ):
            map_basins(well, {}, BOX, both, path=tmp_path / "a.zarr")
    assert list(tmp_path.iterdir()) == []


def test_a_read_only_file_system_is_told(well, both, small_units, tmp_path, monkeypatch):
    refusing(errno.EROFS, 3, monkeypatch)
    with pytest.raises(InputError, match=r"^path = .*: must be a folder that can be written; Read-only file system$"):
        map_basins(well, {}, BOX, both, path=tmp_path / "a.zarr")


def test_a_store_that_may_only_be_read_is_opened_and_told_when_it_is_to_be_written(stored, well, both, monkeypatch):
    import tempfile

    def refused(*args, **options):
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(tempfile, "TemporaryFile", refused)
    assert saltus.load(stored.path) == stored
    with pytest.raises(InputError, match=r"^path = .*: must be a folder that can be written; Permission denied$"):
        map_basins(well, {}, BOX, both, path=stored.path)


@pytest.mark.campaign
@pytest.mark.thorough
def test_a_grid_is_mapped_measured_and_cut_in_a_fraction_of_its_size(well, both, tmp_path, monkeypatch):
    from saltus.basins.map.labelling import Labelling

    def quadrant(self, points):
        return ((points[:, 0] > 0.0) & (points[:, 1] > 0.0)).astype(np.uint8)

    monkeypatch.setattr(Labelling, "of", quadrant)
    monkeypatch.setattr(saltus.basins.map.mapping, "_check_attractors", lambda *parts: None)
    grid = {"x": (-1.0, 1.0, 10_000), "v": (-1.0, 1.0, 10_000)}
    tracemalloc.start()
    try:
        with pytest.warns(RuntimeWarning, match="0 of 10000 followed again, .* of 50 followed one by one"):
            found = map_basins(well, {}, grid, both, path=tmp_path / "large.zarr")
        assert found.fractions() == {"right": 0.75, "left": 0.25, "diverged": 0.0, "undecided": 0.0}
        assert np.asarray(found.section(v=0.5).labels).mean() == 0.5
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < found.grid.size / 2
