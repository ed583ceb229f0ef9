"""Files of older versions are read, and hold the numbers that are computed now."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

import numpy as np
import pytest
from small_set import computed
from small_stores import SESSION, STEPS, STORE

import saltus
from saltus import InputError, load
from saltus.explorer.session import Session, new_folder
from selection import guarding

SMALL = Path(__file__).parents[1] / "golden" / "small"
STORES = {path.stem.removeprefix("stores-"): path for path in SMALL.glob("stores-*.zip")}
ARCHIVES = {path.stem.removeprefix("files-"): path for path in SMALL.glob("files-*.zip")}
KEPT = [(version, name) for version, path in ARCHIVES.items() for name in zipfile.ZipFile(path).namelist()]
LONG = {"basins.nc", "cascade.nc", "diagram.nc", "family.nc", "fit.nc", "locus.nc", "map cascade.nc", "map locus.nc"}
SAME = 1e-9  # of a variable's size: the last bits depend on the processor
# the same for points that steps along a curve lead to: the length of a step grows with what rounding leaves of an error
ALONG = 1e-6
# a conservative force loses nothing: what is left is rounding of its work; a clock begins at 0 but for rounding
VANISHING = {"E_ts_eV": "virial_eV", "min_s": "max_s"}
ROUNDING = ("residual", "special_test")  # ends of names of what is 0 but for rounding of 1
ZERO = 1e-11  # size up to which what is kept of special points is the same, as the place of a cusp at 0
CLOCKS = {"seconds", "elapsed", "created"}  # what the clock tells
# dimensions that changed: steps have other lengths where an eigenvalue touches 0, as that of a pitchfork's branch does
OTHER_POINTS = {"diagram.nc": {"branch1_point"}}
# what was computed wrongly: harmonics where an angle turns far within a step, as of a state that rests
WRONG = dict.fromkeys(("branch.nc", "cascade.nc", "family.nc", "locus.nc"), ("harmonic_re", "harmonic_im"))
# errors of exponents left out what falls like 1/t, and the tolerance with which frames are followed
WRONG |= dict.fromkeys(("spectrum.nc", "map spectrum.nc"), ("error",))
LATER = {"bifurcation", "point", "verification"}  # kinds of results that version 0.1.0 could not save
PHASE = "_s"  # end of names of phases: rounding decides whether a whole turn is 2 pi or 0
BYTES = "attractors"  # of a file within another: it is compared by itself, as a file of attractors
# what a special point has of the steps around it
OF_STEPS = {f"branch1_special_{name}" for name in ("arclength", "position", "scale", "tangent", "test")}


def kept(version, name, folder):
    with zipfile.ZipFile(ARCHIVES[version]) as archive:
        return load(archive.extract(name, folder))


@pytest.mark.campaign
def test_a_file_of_each_kind_is_kept():
    assert {name.removesuffix(".nc") for _, name in KEPT} == set(computed()) - LATER


@pytest.mark.parametrize(("version", "name"), guarding(KEPT, *(row for row in KEPT if row[1] not in LONG)))
def test_a_file_of_an_older_version_is_read_and_saved_as_it_was(version, name, tmp_path):
    found = kept(version, name, tmp_path)
    assert load(found.save(tmp_path / "again.nc")) == found


def unpacked(version, folder):
    """A folder with the store and the session of a version."""
    with zipfile.ZipFile(STORES[version]) as archive:
        archive.extractall(folder)
    return folder


@pytest.mark.parametrize("version", STORES)
def test_a_store_of_an_older_version_is_opened(version, tmp_path):
    basins = load(unpacked(version, tmp_path) / STORE)
    assert basins.grid.shape == (12,)
    assert basins.stopped == "all 12 cells done"
    assert load(basins.save(tmp_path / "again.nc")).fractions() == basins.fractions()
    left = basins.to_xarray()["labels"].to_numpy() == basins.attractors.labels["diverged"]
    assert [*np.flatnonzero(left)] == [0, 1, 10, 11]  # outside of [0, 1] the map leaves for minus infinity


@pytest.mark.parametrize("version", STORES)
def test_a_session_of_an_older_version_is_opened(version, tmp_path):
    session = Session.unpacked(unpacked(version, tmp_path) / SESSION, new_folder(tmp_path))
    assert [entry.name for entry in session.entries] == [*STEPS]
    assert [entry.step for entry in session.entries] == [*STEPS.values()]
    assert session.results["branch1"]["SN1"].parameters["a"] == pytest.approx(np.pi / 3)


def test_a_store_of_another_version_that_cannot_be_opened_says_which_version_wrote_it(tmp_path):
    store = unpacked("0.1.0", tmp_path) / STORE
    metadata = json.loads((store / "zarr.json").read_text())
    del metadata["attributes"]["grid"]
    (store / "zarr.json").write_text(json.dumps(metadata))
    said = f"saltus 0.1.0 wrote it, this is {saltus.__version__}: load it with that version"
    with pytest.raises(InputError, match=said.replace(".", r"\.")):
        load(store)


def decided(data, variable, shape):
    """Where a value is no rounding: the stability of a point is, where a multiplier is critical."""
    of, _, name = variable.rpartition("stable")
    if name or f"{of}multiplier_re" not in data:
        return np.full(shape, True)
    sizes = np.hypot(data[f"{of}multiplier_re"].to_numpy(), data[f"{of}multiplier_im"].to_numpy())
    return np.all(np.abs(sizes - 1.0) > ALONG, axis=-1)


@pytest.mark.campaign
@pytest.mark.parametrize(("version", "name"), KEPT)
def test_numbers_are_those_that_an_older_version_computed(version, name, tmp_path):
    before = kept(version, name, tmp_path).to_xarray()
    now = computed()[name.removesuffix(".nc")].to_xarray()
    moved = OTHER_POINTS.get(name, set())
    assert {size for size in before.sizes.items() if size[0] not in moved} <= set(now.sizes.items())
    assert set(before.sizes) == set(now.sizes)
    assert set(before.variables) == set(now.variables)
    for variable in set(before.variables) - CLOCKS - (OF_STEPS if name == "diagram.nc" else set()):
        if str(variable).endswith(WRONG.get(name, "nothing else")) or variable == BYTES:
            continue
        if moved.intersection(before[variable].dims):
            assert before[variable].size != now[variable].size
            continue
        one, other = before[variable].to_numpy(), now[variable].to_numpy()
        if one.dtype.kind in "fc":
            measure = before[VANISHING.get(variable, variable)].to_numpy()
            size = np.abs(measure[np.isfinite(measure)]).max(initial=1e-300)
            if str(variable).endswith(PHASE):
                other = one + np.remainder(other - one + np.pi, 2.0 * np.pi) - np.pi
            if str(variable).endswith(ROUNDING) or (size < ZERO and "special_" in str(variable)):
                size = max(size, 1.0)
            same = ALONG if any(str(name).endswith("point") for name in before[variable].dims) else SAME
            np.testing.assert_allclose(other, one, rtol=same, atol=same * size, err_msg=variable)
        elif one.dtype.kind in "iub":
            sure = decided(before, str(variable), one.shape)
            np.testing.assert_array_equal(other[sure], one[sure], err_msg=variable)
