"""Labels of grids: what they are, and that nothing but the inputs decides them."""

import math
import pickle
import threading
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import saltus
import saltus.basins.map.mapping
from grouped import Grouped
from oracles import known_basins
from saltus import InputError
from saltus.basins import AttractorOptions, Basins, Grid, Plane, find_attractors, map_basins
from saltus.basins.map.labelling import Labelling
from saltus.ensemble.traps import NOT_DONE, UNDECIDED, Cages, Traps
from saltus.options import BasinOptions
from saltus.progress import Progress
from saltus.system import HybridSystem, Mode
from wells import BOX, Interrupt, double_well


def test_a_cell_has_the_label_of_the_well_in_which_its_motion_ends(basins, well):
    for i, j in np.random.default_rng(5).integers((30, 20), size=(12, 2)):
        start = [basins.grid.axes[0][i], basins.grid.axes[1][j]]
        end = saltus.simulate(well, {}, start, periods=30, tolerance=(1e-10, 1e-11)).x_end
        assert basins.names[basins.labels[i, j]] == ("right" if end[0] > 0.0 else "left")


def test_both_wells_have_their_share_and_all_cells_are_done(basins):
    shares = basins.fractions()
    assert list(shares) == ["right", "left", "diverged", "undecided"]
    assert math.isclose(sum(shares.values()), 1.0)
    assert min(shares["right"], shares["left"]) > 0.4
    assert basins.stopped == "all 600 cells done"
    assert basins.orbits_per_second > 0.0


def test_labels_do_not_depend_on_units_or_order_of_coordinates(well, both, basins, small_units):
    cut = map_basins(well, {}, BOX, both)
    assert len(list(cut.grid.units())) > 10
    assert np.array_equal(cut.labels, basins.labels)
    turned = map_basins(well, {}, {"v": BOX["v"], "x": BOX["x"]}, both)
    assert np.array_equal(turned.labels.T, basins.labels)


def test_points_are_classified_as_the_cells_are(basins):
    assert np.array_equal(basins.classify(basins.grid.points()), basins.labels.ravel())
    stacked = basins.grid.points().reshape(30, 20, 2)[:4, :5]
    assert np.array_equal(basins.classify(stacked), basins.labels[:4, :5])
    assert basins.names[int(basins.classify([1.0, 0.0]))] == "right"


def test_a_plane_along_the_states_is_the_grid_of_them(well, both, basins):
    plane = Plane({"x": 0.0, "v": 0.0}, {"x": 2.0}, {"v": 1.0}, ((-1, 1), (-2, 2)), (30, 20))
    assert np.array_equal(map_basins(well, {}, plane, both).labels, basins.labels)


def test_a_section_is_what_a_grid_frozen_there_gives(well, both, basins):
    cut = basins.section(v=0.33)
    assert cut.grid.fixed["v"] == pytest.approx(0.3)
    again = map_basins(well, {}, {"x": BOX["x"], "v": cut.grid.fixed["v"]}, both)
    assert np.array_equal(cut.labels, again.labels)
    assert again.grid == cut.grid


def test_a_motion_that_never_arrives_is_undecided(well, both):
    found = map_basins(well, {}, {"x": (1.5, 2.0, 4), "v": 1.0}, both, options=BasinOptions(longest=1))
    assert "undecided" in {found.names[label] for label in found.labels.tolist()}


def test_a_preview_follows_fewer_motions_and_errs_only_beside_boundaries(well, both):
    ranges = {"x": (-2.0, 2.0, 60), "v": (-2.0, 2.0, 60)}
    exact = map_basins(well, {}, ranges, both)
    quick = map_basins(well, {}, ranges, both, options=BasinOptions(preview=True))
    assert quick.stopped == "all 3600 cells done"
    assert quick.inputs["preview"] is True
    wrong = quick.labels != exact.labels
    assert wrong.mean() < 0.02
    near = np.zeros_like(wrong)
    for axis in range(2):
        for shift in range(-4, 5):
            near |= np.roll(exact.labels, shift, axis) != exact.labels
    assert not (wrong & ~near).any()
    labelling = Labelling.from_definition(quick.inputs)
    assert sum(followed for _, _, followed in labelling.units(quick.grid, list(quick.grid.units()))) < 3600 / 2


def test_a_preview_follows_units_beside_each_other(well, both, small_units, monkeypatch):
    met, meeting = [], threading.Barrier(2)
    of = Labelling.of

    def together(self, points):
        if self.preview and not met:
            meeting.wait(timeout=60.0)  # breaks where nobody else comes
            met.append(True)
        return of(self, points)

    quick = map_basins(well, {}, BOX, both, options=BasinOptions(preview=True))
    labelling = Labelling.from_definition(quick.inputs)
    monkeypatch.setattr(Labelling, "of", together)
    labels = np.empty_like(quick.labels)
    for cells, found, _ in labelling.units(quick.grid, list(quick.grid.units())):
        labels[cells] = found
    assert met
    assert np.array_equal(labels, quick.labels)


def test_a_preview_of_one_label_follows_its_first_lattice_only(well, both):
    grid = Grid(("x", "v"), {"x": (0.9, 1.1, 17), "v": (-0.1, 0.1, 9)})
    labelling = Labelling(well, well.resolve(None), both.traps, None, 1e-8, 200, preview=True)
    ((_, labels, followed),) = labelling.units(grid, [(slice(0, 17), slice(0, 9))])
    assert followed == 5 * 3
    assert (labels == 0).all()


def test_an_interrupted_grid_keeps_what_is_done(well, both, basins, small_units):
    part = map_basins(well, {}, BOX, both, progress=Interrupt(3))
    done = part.labels != NOT_DONE
    assert 0 < done.sum() < 600
    assert part.stopped == f"interrupted: {done.sum()} of 600 cells done"
    assert np.array_equal(part.labels[done], basins.labels[done])
    assert math.isclose(part.fractions()["not done"], 1.0 - done.mean())


def test_an_interrupt_after_the_last_unit_is_told(well, both, basins, small_units, tmp_path):
    units = len(list(Grid(("x", "v"), BOX).units()))
    for store in (None, tmp_path / "a.zarr"):
        whole = map_basins(well, {}, BOX, both, path=store, progress=Interrupt(units))
        assert whole.stopped == "interrupted: 600 of 600 cells done"
        assert np.array_equal(whole.labels, basins.labels)
    assert Basins.open(tmp_path / "a.zarr").stopped == "all 600 cells done"


def test_the_time_left_goes_by_cells_even_where_few_motions_are_followed(well, both, small_units, monkeypatch):
    clock = iter([0.0] * 3)
    monkeypatch.setattr("saltus.progress.monotonic", lambda: next(clock, 10.0))
    seen: list[Progress] = []
    found = map_basins(well, {}, BOX, both, options=BasinOptions(preview=True), progress=seen.append)
    assert [told.left for told in seen] == pytest.approx([10.0 * (600 - told.done) / told.done for told in seen])
    assert {told.text for told in seen} == {"labelling cells"}
    assert found.stopped == "all 600 cells done"


def test_one_bar_is_for_the_attractors_and_the_cells(well, capsys):
    map_basins(well, {}, {**BOX, "v": 0.1}, {"options": AttractorOptions(starts=8, samples=200)}, progress=True)
    out, err = capsys.readouterr()
    assert not out
    assert "100.0 %" in err
    assert "labelling cells" in err
    seen: list[Progress] = []
    map_basins(well, {}, {**BOX, "v": 0.1}, {"options": AttractorOptions(starts=8, samples=200)}, progress=seen.append)
    assert list(dict.fromkeys(told.text for told in seen))[::2] == ["looking for attractors", "labelling cells"]


def test_a_search_shows_a_bar(well, capsys):
    region = {"x": (-2.0, 2.0), "v": (-2.0, 2.0)}
    find_attractors(well, {}, region, options=AttractorOptions(starts=8, samples=200), progress=True)
    out, err = capsys.readouterr()
    assert not out
    assert "100.0 %" in err
    with pytest.raises(InputError, match=r"^progress = 'loud': must be True for a bar, or a function of a saltus"):
        find_attractors(well, {}, region, options=AttractorOptions(starts=8), progress="loud")


@pytest.mark.campaign
def test_a_system_without_a_phase_is_looked_at_every_interval(tmp_path):
    still = HybridSystem(("x", "v"), {"c": 0.5}, {"well": Mode({"x": "v", "v": "-c*v + x - x**3"})}, name="still")
    grid, store = {"x": (-2.0, 2.0, 10), "v": (-2.0, 2.0, 8)}, tmp_path / "a.zarr"
    found = map_basins(still, {}, grid, options=BasinOptions(interval=0.7), path=store)
    assert found.attractors.interval == 0.7
    assert found.inputs["interval"] == 0.7
    right = max(found.attractors.names, key=lambda name: found.attractors.points[name][0, 0])
    assert found.names[int(found.classify([1.1, 0.0]))] == right
    assert found.fractions()[right] == 0.5  # by symmetry
    assert map_basins(still, {}, grid, path=store) == found
    with pytest.raises(
        InputError, match=r"^BasinOptions.interval = 0\.8: must be that of the attractors, 0\.7; leave it out$"
    ):
        map_basins(still, {}, grid, options=BasinOptions(interval=0.8), path=store)
    with pytest.raises(InputError, match=r"^interval = None: must be given for a system .* as BasinOptions\(interval="):
        map_basins(still, {}, grid)


def test_the_error_of_labels_is_the_share_of_those_that_were_changed(well, both, basins):
    found = basins.label_error(400)
    assert (found.wrong, found.cells, found.tolerance) == (0, 400, 1e-12)
    assert found.bound == pytest.approx(3.0 / 400, rel=0.01)
    spoilt = np.array(basins.labels)
    spoilt[np.random.default_rng(4).random(spoilt.shape) < 0.2] ^= 1
    spoilt[:2], spoilt[2:3] = NOT_DONE, UNDECIDED
    share = float((spoilt[3:] != basins.labels[3:]).mean())
    found = replace(basins, labels=spoilt).label_error(2000)
    assert 1600 < found.cells < 2000
    assert abs(found.wrong / found.cells - share) < 4.0 * math.sqrt(share / found.cells)
    assert found.wrong / found.cells < found.bound < share + 0.05


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"cells": 0}, r"^cells = 0: must be an integer >= 1$"),
        ({"by_events": -1}, r"^by_events = -1: must be an integer >= 0$"),
        ({"rng": -1}, r"^rng = -1: must be an integer >= 0$"),
        ({"tolerance": "x"}, r"^tolerance = 'x': must be a number between 1e-14 and 0\.01$"),
    ],
)
def test_what_an_error_of_labels_cannot_be_measured_with_is_told(basins, options, told):
    with pytest.raises(InputError, match=told):
        basins.label_error(**options)


def test_a_trapping_region_that_holds_too_much_is_seen_as_an_error_of_labels(well, both, basins):
    with pytest.warns(RuntimeWarning, match="or a trapping region is wrong"):
        large = map_basins(well, {}, BOX, both.but(radius=0.9))
    wrong = float((large.labels != basins.labels).mean())
    found = large.label_error(600)
    assert wrong > 0.02
    assert abs(found.wrong / found.cells - wrong) < 4.0 * math.sqrt(wrong / found.cells)


def test_a_cage_that_holds_too_much_is_seen_as_an_error_of_labels(well, both, basins):
    centres = np.concatenate([both.points[name] for name in both.names])
    rows = np.broadcast_to(np.array([[1.0, 1.0j]]), (2, 1, 2))

    def caged(bound):
        of_both = (np.zeros((2, 1)), np.full(2, bound), np.zeros(2, np.int64), np.array([0, 1], np.uint8))
        return map_basins(
            well, {}, BOX, both.but(traps_of=SimpleNamespace(traps=Traps(2, None, Cages(centres, rows, *of_both))))
        )

    right = caged(0.2)
    with pytest.warns(RuntimeWarning, match="or a trapping region is wrong"):
        large = caged(0.9)
    assert np.array_equal(right.labels, basins.labels)
    assert right.label_error(300).wrong == 0
    wrong = float((large.labels != basins.labels).mean())
    found = large.label_error(600)
    assert wrong > 0.02
    assert abs(found.wrong / found.cells - wrong) < 4.0 * math.sqrt(wrong / found.cells)


def test_what_all_lanes_get_wrong_is_seen_by_the_event_driven_flow(basins, monkeypatch):
    of = Labelling.of
    monkeypatch.setattr(Labelling, "of", lambda self, points: of(self, points) ^ 1)
    found = replace(basins, labels=basins.labels ^ 1).label_error(50, by_events=20)
    assert (found.wrong, found.cells) == (0, 50)
    assert (found.wrong_by_events, found.cells_by_events) == (20, 20)


def test_labels_are_checked_by_motions_followed_until_they_are_at_an_attractor(basins):
    found = replace(basins, inputs={**basins.inputs, "longest": 1}).label_error(300)
    assert (found.wrong, found.cells, found.nowhere, found.untold, found.missed) == (0, 300, 0, 0, "")


@pytest.mark.campaign
def test_long_chaos_before_motions_settle_is_told_and_seen_as_an_error_of_labels(tmp_path):
    """Labels are compared with those of fixed Runge-Kutta steps, which know nothing of trapping regions."""
    wild = HybridSystem(
        ("x", "v"), {"w": 1.0}, {"well": Mode({"x": "v", "v": "x - x**3 - 0.15*v + 0.2*cos(s)"})}, phase=("s", "w")
    )
    with pytest.warns(RuntimeWarning, match=r"^saltus: wrong labels: \d+ of 100 followed again, < .*: trust no single"):
        basins = map_basins(wild, {}, {"x": (-2.0, 2.0, 24), "v": (-2.0, 2.0, 24)})
    right = max(basins.attractors.names, key=lambda name: basins.attractors.points[name][0, 0])
    truth = known_basins.duffing(known_basins.centres(-2.0, 2.0, 24))
    decided = truth != UNDECIDED
    wrong = float(((basins.labels == basins.attractors.labels[right]) != (truth == 1))[decided].mean())
    assert 0.05 < wrong < basins.noted_error.bound + 0.1
    assert f"  wrong labels: {basins.noted_error}" in repr(basins)
    assert saltus.load(basins.save(tmp_path / "a.nc")) == basins
    assert saltus.load(basins.save(tmp_path / "a.zarr")).noted_error == basins.noted_error
    assert pickle.loads(pickle.dumps(basins)).noted_error == basins.noted_error
    assert 0.05 < basins.label_error(600).wrong / 600 < 0.3


def test_basins_in_memory_are_saved_read_and_pickled_equal(basins, tmp_path):
    assert saltus.load(basins.save(tmp_path / "a.nc")) == basins
    assert Basins.load(basins.save(tmp_path / "a.zarr")) == basins
    assert pickle.loads(pickle.dumps(basins)) == basins
    with pytest.raises(InputError, match=r"^path = .*a\.zarr': must be a new folder; a store is never written over$"):
        basins.save(tmp_path / "a.zarr")


def test_a_dataset_names_its_labels_and_its_frozen_coordinates(basins):
    dataset = basins.section(v=0.1).to_xarray()
    assert dataset["labels"].dims == ("x",)
    assert dataset["labels"].attrs["flag_meanings"] == "right left diverged undecided"
    assert dataset["labels"].attrs["flag_values"] == [0, 1, 253, 254]
    assert float(dataset["v"]) == basins.section(v=0.1).grid.fixed["v"]


def test_basins_tell_what_they_are(basins):
    lines = repr(basins).splitlines()
    assert lines[:3] == [
        "Basins of double well: 30 x 20 cells",
        "  x      -2 to 2, 30 cells",
        "  v      -2 to 2, 20 cells",
    ]
    assert lines[-1] == "  all 600 cells done"
    assert "  v      0.1" in repr(basins.section(v=0.05))


def test_labels_of_an_array_are_checked():
    x = np.array([0.5, 1.5, 2.5])
    assert Basins.from_array([0, 1, 254], {"x": x}, {"a": 0, "b": 1}).fractions()["undecided"] == pytest.approx(1 / 3)
    for labels, centres, told in [
        ([0, 1], x, r"^labels' shape = \(2,\): must be that of the axes, \(3,\)$"),
        ([0, 1, 2], x, r"^labels = 2: must be labels that are named: 0, 1, 253, 254$"),
        ([0, 1, 1], [0.0, 1.0, 3.0], r"^axes\['x'\] = .*: must be ascending centres of cells, evenly spaced$"),
        ([0], [0.5], r"^axes\['x'\] = \(1,\): must be centres of cells, at least two$"),
        ([0, 1, 1], ["a", 1.0, 2.0], r"^axes\['x'\] = \['a', 1\.0, 2\.0\]: must be an array of real numbers$"),
        ([0, 1, 300], x, r"^labels = 300: must be labels that are named: 0, 1, 253, 254$"),
        ([0, 1, -1], x, r"^labels = -1: must be labels that are named"),
        ([0.0, 0.5, 1.0], x, r"^labels = 'an array of float64': must be integers or booleans$"),
    ]:
        with pytest.raises(InputError, match=told):
            Basins.from_array(labels, {"x": centres}, {"a": 0, "b": 1})
    assert Basins.from_array([0, 1, 253], {"x": x}, {"a": 0, "b": 1, "diverged": 253}).names[253] == "diverged"
    for names, told in [
        ({"a": 0, "b": 0}, r"^names = \{'a': 0, 'b': 0\}: must be a label of its own for each$"),
        ({"a": 0, "b": 255}, r"^names\['b'\] = 255: must be an integer between 0 and 252$"),
        ({"a": 0, "b": 1, "undecided": 2}, r"^names\['undecided'\] = 2: must be 254$"),
    ]:
        with pytest.raises(InputError, match=told):
            Basins.from_array([0, 1, 1], {"x": x}, names)
    for points, told in [
        ({"c": [[0.5]]}, r"^points = 'c': must be one of a, b"),
        ({"a": [[0.5, 1.0]]}, r"^points\['a'\] = \[\[0\.5, 1\.0\]\]: must be rows of finite x$"),
        ({"a": [[math.nan]]}, r"^points\['a'\]\[0, 0\] = nan: must be finite$"),
    ]:
        with pytest.raises(InputError, match=told):
            Basins.from_array([0, 1, 1], {"x": x}, {"a": 0, "b": 1}, points)
    with pytest.raises(InputError, match=r"^basins = 'from an array': must be computed by map_basins"):
        Basins.from_array([0, 1, 1], {"x": x}, {"a": 0, "b": 1}).classify([[1.0]])


def test_points_of_a_grid_by_cuda_are_classified_by_the_cpu_where_that_is_asked_for(basins, monkeypatch):
    monkeypatch.setattr("saltus.ensemble.cuda.cuda_devices", lambda: ())
    elsewhere = replace(basins, inputs={**basins.inputs, "engine": "cuda"})
    points = basins.grid.points()[:40]
    with pytest.raises(InputError, match=r'^engine = \'cuda\': must be one that this machine can run; .*engine="cpu"'):
        elsewhere.classify(points)
    assert np.array_equal(elsewhere.classify(points, engine="cpu"), basins.classify(points))
    assert elsewhere.label_error(100, by_events=0).wrong == 0
    with pytest.raises(InputError, match=r"^engine = 'dask': must be one of cpu, cuda"):
        elsewhere.classify(points, engine="dask")


@pytest.mark.parametrize(
    ("points", "told"),
    [
        ([[1.0, 2.0, 3.0]], r"^points = \(1, 3\): must be an array of shape \(\.\.\., 2\): x, v$"),
        (1.0, r"^points = \(\): must be an array of shape"),
        ("here", r"^points = 'here': must be an array of shape"),
        ([[1.0, math.nan]], r"^points\[0, 1\] = nan: must be finite$"),
    ],
)
def test_points_that_cannot_be_classified_are_told(basins, points, told):
    with pytest.raises(InputError, match=told):
        basins.classify(points)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"grid": {"x": 0.0, "v": 0.0}}, r"^grid = .*: must be with a free coordinate"),
        (
            {"grid": {**BOX, "s": 0.0}},
            r"^grid = 's': must be a state other than the phase; all motions start at phase 0$",
        ),
        ({"grid": "wide"}, r"^grid = 'wide': must be a mapping of each state to a range or a value, or a Plane$"),
        ({"engine": "gpu"}, r"^BasinOptions.engine = 'gpu': must be one of cpu, cuda, dask; did you mean 'cpu'\?$"),
        ({"engine": "dask"}, r"^BasinOptions.client = None: must be given for engine='dask', and for no other$"),
        (
            {"client": "tcp://here:1"},
            r"^BasinOptions.client = 'tcp://here:1': must be given for engine='dask', and for no other$",
        ),
        (
            {"engine": "dask", "client": 3},
            r"^BasinOptions.client = 3: must be a dask\.distributed\.Client, or the address",
        ),
        ({"longest": 0}, r"^BasinOptions.longest = 0: must be an integer >= 1$"),
        ({"tolerance": 0.0}, r"^BasinOptions.tolerance = 0\.0: must be a number between 1e-14 and 0\.01$"),
        ({"tolerance": "fine"}, r"^BasinOptions.tolerance = 'fine': must be a number"),
        ({"preview": 1}, r"^BasinOptions.preview = 1: must be True or False$"),
        ({"progress": 1}, r"^progress = 1: must be True for a bar, or a function of a saltus.Progress$"),
        (
            {"attractors": [[1.0, 0.0]]},
            r"^attractors = 'list': must be an Attractors, as find_attractors returns; attractors_from makes one",
        ),
        ({"parameters": {"a": 1.0}}, r"^parameter = 'a': must be one of c, A, w"),
        ({"parameters": {"A": 0.06}}, r"^attractors = 'A = 0\.05': must be of these parameters: A = 0\.06$"),
        (
            {"grid": {**BOX, "x": (-2, 2, 10**8)}},
            r"^path = None: must be given for a grid of more than 1e\+09 cells; it has ",
        ),
        ({"path": 3}, r"^path = 3: must be the path of a folder; a text, or path-like$"),
        ({"path": ""}, r"^path = '': must be the path of a folder; a text, or path-like$"),
        (
            {"attractors": {"right": None}},
            r"^attractors = 'right': must be arguments among region, options; attractors_from makes",
        ),
        ({"path": "/nowhere/a.zarr"}, r"^path = '/nowhere/a\.zarr': must be in a folder that exists$"),
    ],
)
def test_a_grid_that_cannot_be_mapped_is_told(well, both, change, told):
    asked = {"parameters": {}, "grid": BOX, "attractors": both, **change}
    with pytest.raises(InputError, match=told):
        Grouped(map_basins, options=BasinOptions)(well, **asked)


def test_an_attractor_that_is_none_is_told(well, both):
    elsewhere = both.but(points={"right": both.points["left"], "left": both.points["right"]}, traps_of=both)
    with pytest.raises(
        InputError, match=r"^attractor = 'right': must be one; a motion that starts on it ends as 'left'$"
    ):
        map_basins(well, {}, BOX, elsewhere)
    with pytest.raises(InputError, match=r"^attractors = 'another': must be of this system, 'double well'$"):
        map_basins(well, {}, BOX, both.but(system=double_well("another")))


def test_attractors_are_found_in_the_box_of_the_grid_and_kept_in_the_store(well, both, basins, tmp_path):
    found = map_basins(well, {}, BOX, path=tmp_path / "a.zarr")
    assert sorted(found.attractors.kinds.values()) == ["period-1", "period-1"]
    names = {name: "right" if points[0, 0] > 0.0 else "left" for name, points in found.attractors.points.items()}
    for name, share in found.fractions().items():
        assert share == basins.fractions()[names.get(name, name)]
    assert found.attractors.region == {"x": (-2.0, 2.0), "v": (-2.0, 2.0)}
    again = map_basins(well, {}, BOX, path=tmp_path / "a.zarr", progress=lambda told: pytest.fail("computed"))
    assert again == found
    assert again.attractors == found.attractors
    assert pickle.loads(pickle.dumps(found)) == found


def test_attractors_are_looked_for_with_the_options_given(well, monkeypatch):
    asked = []

    def found(system, parameters, **options):
        asked.append(options)
        return find_attractors(system, parameters, **options)

    monkeypatch.setattr(saltus.basins.map.mapping, "find_attractors", found)
    basins = map_basins(well, {}, {**BOX, "v": 0.1}, {"options": AttractorOptions(starts=12, samples=200)})
    region = {"x": (-2.0, 2.0), "v": 0.1}
    options = AttractorOptions(starts=12, samples=200, motions=30)
    assert asked == [{"progress": False, "region": region, "options": options}]
    assert basins.inputs["search"]["options"]["starts"] == 12
    assert basins.inputs["search"]["region"] == {"x": [-2.0, 2.0], "v": 0.1}
    assert basins.inputs["search"]["options"]["samples"] == 200
    with pytest.raises(InputError, match=r"^attractors = 'regin': must be .*; did you mean 'region'\?$"):
        map_basins(well, {}, BOX, {"regin": {}})


def test_what_cannot_run_is_told_before_attractors_are_looked_for(well, both, tmp_path, monkeypatch):
    from saltus.ensemble.cuda import cuda_devices

    if cuda_devices():
        pytest.skip("there is a CUDA device")
    with pytest.raises(InputError, match=r'engine="cpu"'):
        map_basins(well, {}, BOX, both, options=BasinOptions(engine="cuda"), path=tmp_path / "a.zarr")
    monkeypatch.setattr(
        saltus.basins.map.mapping, "find_attractors", lambda *_, **__: pytest.fail("attractors were sought")
    )
    with pytest.raises(InputError, match=r'engine="cpu"'):
        map_basins(well, {}, BOX, options=BasinOptions(engine="cuda"), path=tmp_path / "a.zarr")
    with pytest.raises(InputError, match=r"^BasinOptions.tolerance = 1\.0: must be a number between 1e-14 and 0\.01$"):
        map_basins(well, {}, BOX, options=BasinOptions(tolerance=1.0))
    assert not (tmp_path / "a.zarr").exists()
