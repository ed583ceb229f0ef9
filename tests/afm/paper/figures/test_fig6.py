"""Fig. 6 of the paper: isolines of SN1 against branches along one parameter, their turning points and the cusp."""

from __future__ import annotations

import json
import os
import signal

import matplotlib

matplotlib.use("Agg")

import numpy as np
import pytest
from matplotlib.colors import to_hex

import saltus
from saltus import afm
from saltus.afm.paper.figures import fig6, runner
from saltus.afm.paper.figures.files import read_results
from selection import THOROUGH

pytestmark = [*THOROUGH]  # the whole figure

A0 = 1.0 / 300.0
KEYS = ["D_att_1", "D_rep_1", "omega", "min_z"]


@pytest.fixture(scope="session")
def fig6_found(tmp_path_factory):
    said = []
    return runner("fig6")(tmp_path_factory.mktemp("fig6"), said.append) | {"said": said}


@pytest.fixture(scope="session")
def fig6_content(fig6_found):
    def refuse(name):
        raise AssertionError(f"{name} is not JSON")

    return json.loads(fig6_found["files"][1].read_text(), parse_constant=refuse)


@pytest.fixture(scope="session")
def fig6_isolines(fig6_found):
    return {name: result for name, result in fig6_found["results"].items() if name.startswith("D_")}


@pytest.fixture(scope="session")
def left():
    """A stable orbit of the repulsive branch left of all saddle-nodes of the chart."""
    guess = [
        ("flight", "touch", [-0.717, 0.7335], 2.95),
        ("contact", "release", [0.95, 0.85], 0.375),
        ("flight", "theta", [0.9, -0.4], 2.65),
    ]
    orbit = saltus.solve_orbit(afm.tapping_mode(afm.table1(), modes=1), {"Omega": 1.05}, guess)
    return _moved(orbit, "Omega", 0.97)


def _moved(orbit, name, value):
    """Return the orbit of the same branch at another value of a parameter, without a fold on the way."""
    begin = orbit.parameters[name]
    if value == begin:
        return orbit
    bounds, direction = (min(begin, value), max(begin, value)), "up" if value > begin else "down"
    way = saltus.continue_orbit(orbit, name, bounds, directions=direction)
    assert not way.special_points.of_type("SN")
    end = way.solution(-1)
    assert end.parameters[name] == pytest.approx(value, rel=1e-12)
    return end


def _end_of_branch(left, D_att, D_rep):
    """Return where the saturated branch ends at two dampings, by branches along one parameter alone."""
    orbit = _moved(_moved(left, "D_rep_1", D_rep), "D_att_1", D_att)
    response = saltus.continue_orbit(orbit, "Omega", (0.97, 1.4), directions="up", stop_at="SN")
    return response["SN1"]


def _turns(isoline, name):
    return [point for point in isoline.special_points.of_type("TP") if point.of == name]


def test_four_files_are_written(fig6_found):
    assert [path.name for path in fig6_found["files"]] == ["fig6.nc", "fig6.json", "fig6.png", "fig6.pdf"]
    assert fig6_found["files"][2].read_bytes().startswith(b"\x89PNG")
    assert fig6_found["files"][3].read_bytes().startswith(b"%PDF")
    assert not fig6_found["interrupted"]
    assert fig6_found["said"][-1].text == "drawing"


def test_json_has_the_promised_form(fig6_content):
    assert fig6_content["figure"] == "fig6"
    for name in ("sn1", "folded", "turning_points", "cusps"):
        assert fig6_content[name]
        assert all(list(place) == KEYS for place in fig6_content[name])
    assert list(fig6_content["cusp"]) == list(fig6_content["reference"]) == KEYS
    assert fig6_content["parameters"]["ybar"] == 0.108
    assert fig6_content["parameters"]["D_rep_1"] == [0.1, 100.0]


def test_grazing_orbits_are_no_saddle_nodes(fig6_content):
    """Isolines may end at one; it is not among their points."""
    for name in ("sn1", "folded"):
        assert max(place["min_z"] for place in fig6_content[name]) < A0 - 1e-9


@pytest.mark.thorough
def test_both_families_of_isolines_are_there(fig6_content):
    """Several values of each damping, the other varying over most of its interval."""
    table = np.array([[place[key] for key in KEYS] for place in fig6_content["sn1"]])
    for fixed, varied, whole in ((0, 1, fig6.BOUNDS["D_rep_1"]), (1, 0, (0.005, 0.17))):
        values, counts = np.unique(table[:, fixed], return_counts=True)
        families = values[counts > 20]
        assert len(families) >= 8
        spans = [np.ptp(table[table[:, fixed] == value, varied]) for value in families]
        assert max(spans) > 0.95 * (whole[1] - whole[0])


@pytest.mark.parametrize(
    ("D_att", "D_rep"), [(0.025, 30.0), (0.025, 4.0), (0.1, 10.0), (0.15, 0.5), (0.005, 100.0), (0.16, 2.0)]
)
def test_isolines_lie_where_the_saturated_branch_ends(fig6_isolines, left, D_att, D_rep):
    isoline = fig6_isolines[f"D_rep_1={D_rep:g}"]
    found = fig6._at(isoline, "D_att_1", D_att)
    end = _end_of_branch(left, D_att, D_rep)
    assert found.parameters["Omega"] == pytest.approx(end.parameters["Omega"], abs=1e-8)
    assert found.orbit.min["z"] == pytest.approx(end.orbit.min["z"], abs=1e-5)


def test_points_of_the_json_lie_where_the_saturated_branch_ends(fig6_content, left):
    """Four of them, from one isoline to another, where that branch is there left of resonance."""
    places = [place for place in fig6_content["sn1"] if place["D_att_1"] <= 0.16]
    for place in (places[0], places[len(places) // 3], places[2 * len(places) // 3], places[-1]):
        end = _end_of_branch(left, place["D_att_1"], place["D_rep_1"])
        assert place["omega"] == pytest.approx(end.parameters["Omega"], abs=1e-8)


def test_the_reference_is_the_saddle_node_that_the_paper_marks(fig6_content, left):
    mark = fig6_content["reference"]
    assert (mark["D_att_1"], mark["D_rep_1"]) == (0.025, 30.0)
    assert mark["omega"] == pytest.approx(_end_of_branch(left, 0.025, 30.0).parameters["Omega"], abs=1e-8)


def test_isolines_of_the_two_families_cross_where_their_dampings_are_equal(fig6_isolines):
    """A point of one, found along the other."""
    for D_att, D_rep in ((0.025, 6.0), (0.1, 30.0), (0.16, 1.5)):
        along = fig6._at(fig6_isolines[f"D_rep_1={D_rep:g}"], "D_att_1", D_att)
        across = fig6._at(fig6_isolines[f"D_att_1={D_att:g}"], "D_rep_1", D_rep)
        assert along.parameters["Omega"] == pytest.approx(across.parameters["Omega"], abs=1e-9)


def test_the_critical_multiplier_is_one_all_along_the_isolines(fig6_isolines):
    for isoline in fig6_isolines.values():
        touching, arc = isoline.column("min_z") > A0 - 1e-9, isoline.arclength
        inside = np.minimum(arc - arc[0], arc[-1] - arc) > 1e-3  # min_z is a parabola next to the grazing
        assert not touching[inside].any(), "an isoline ends at a grazing, where a multiplier has no bound"
        assert np.abs(isoline.multipliers[~touching] - 1.0).min(axis=1).max() < 1e-5


def test_isolines_of_fixed_damping_in_air_turn_once_at_their_least_frequency(fig6_content, fig6_isolines):
    """The turning point lies below all points of the isoline, by as little as a parabola through the nearest says."""
    turning = {place["D_att_1"]: place for place in fig6_content["turning_points"]}
    assert len(turning) == len(fig6_content["turning_points"])
    expected = {isoline.parameters["D_att_1"] for isoline in fig6_isolines.values() if "D_rep_1" in isoline.names}
    assert set(turning) == expected - {0.17}, "at the strongest damping SN1 ends at a grazing before it turns"
    for name, isoline in fig6_isolines.items():
        if name.startswith("D_att_1") and isoline.parameters["D_att_1"] in turning:
            low, high = fig6._first_sheet(isoline)
            rows = np.flatnonzero((isoline.arclength >= low) & (isoline.arclength <= high))
            omega, s = isoline.column("Omega")[rows], isoline.arclength[rows]
            least = turning[isoline.parameters["D_att_1"]]["omega"]
            assert omega.min() >= least - 1e-12
            near = int(np.clip(np.argmin(omega), 1, len(rows) - 2))
            bend = np.polyfit(s[near - 1 : near + 2] - s[near], omega[near - 1 : near + 2], 2)
            assert bend[2] - bend[1] ** 2 / (4.0 * bend[0]) == pytest.approx(least, abs=1e-4)


def test_the_saturated_branch_ends_first_at_the_turning_point(fig6_content, left):
    """A hundredth more or less damping in contact: it ends later, by equal amounts."""
    place = next(place for place in fig6_content["turning_points"] if place["D_att_1"] == 0.025)
    later = [
        _end_of_branch(left, 0.025, place["D_rep_1"] * factor).parameters["Omega"] - place["omega"]
        for factor in (0.99, 1.01)
    ]
    assert min(later) > 0.0
    assert later[0] == pytest.approx(later[1], rel=0.1)


def test_the_curve_of_turning_points_is_smooth(fig6_content):
    """No cusp: along it the damping in air grows, that in contact and the frequency fall, the gap grows."""
    assert fig6_content["turning_points_cusp"] is None
    table = np.array([[place[key] for key in KEYS] for place in fig6_content["turning_points"]])
    steps = np.diff(table, axis=0)
    assert np.all(np.sign(steps) == [1.0, -1.0, -1.0, 1.0])
    chords = steps[:, 1:] / np.ptp(table[:, 1:], axis=0)
    chords /= np.linalg.norm(chords, axis=1, keepdims=True)
    assert np.sum(chords[1:] * chords[:-1], axis=1).min() > 0.9


def test_both_parameters_turn_at_the_cusp_points(fig6_content, fig6_isolines):
    cusps = [
        point
        for isoline in fig6_isolines.values()
        if "D_att_1" in isoline.names
        for point in isoline.special_points.of_type("CP")
    ]
    assert len(cusps) == len(fig6_content["cusps"])
    for isoline in fig6_isolines.values():
        for point in isoline.special_points.of_type("CP"):
            for name in isoline.names:
                nearest = min(_turns(isoline, name), key=lambda turn: abs(turn.arclength - point.arclength))
                assert nearest.parameters["Omega"] == pytest.approx(point.parameters["Omega"], abs=1e-8)


@pytest.mark.parametrize(("beyond", "count"), [(-5e-5, 2), (5e-5, 0)])
def test_cusp_points_meet_at_the_cusp(fig6_content, fig6_isolines, beyond, count):
    """Just below it an isoline has two, around it, some 7e-4 apart in arclength; just above none, and does not fold."""
    cusp = fig6_content["cusp"]
    start = fig6._at(fig6_isolines["D_att_1=0.16"], "D_rep_1", cusp["D_rep_1"] + beyond)
    wide = {"Omega": (0.99, 1.07), "D_att_1": (0.15, 0.172)}
    up_to = saltus.continue_locus(start, ("Omega", "D_att_1"), wide | {"D_att_1": (0.15, 0.1659)})
    near = up_to.point(int(np.argmax(up_to.column("D_att_1"))))
    steps = saltus.StepControl(initial=4e-4, largest=4e-4, max_points=200)
    isoline = saltus.continue_locus(near, ("Omega", "D_att_1"), wide, steps=steps)
    gaps = isoline.column("min_z")
    assert gaps.min() < cusp["min_z"] - 1e-3 < cusp["min_z"] + 1e-3 < gaps.max()
    points = isoline.special_points.of_type("CP")
    assert len(points) == count
    for point in points:
        assert point.parameters["Omega"] == pytest.approx(cusp["omega"], abs=1e-6)
        assert point.parameters["D_att_1"] == pytest.approx(cusp["D_att_1"], abs=1e-6)
    if count:
        below, above = sorted(point.orbit.min["z"] for point in points)
        assert below < cusp["min_z"] < above
    else:
        assert len(set(np.sign(np.diff(isoline.column("Omega"))))) == 1


def test_the_curve_of_cusp_points_turns_back_at_the_cusp(fig6_content):
    """A semicubical cusp: the two branches part by the root of the distance in min z, by its power 3/2 in Omega."""
    cusp = fig6_content["cusp"]
    deep = {place["D_rep_1"]: place for place in fig6_content["cusps"] if place["min_z"] < cusp["min_z"]}
    high = {place["D_rep_1"]: place for place in fig6_content["cusps"] if place["min_z"] > cusp["min_z"]}
    near = [value for value in high if value > 2.05]
    assert len(near) >= 4
    away = np.log([cusp["D_rep_1"] - value for value in near])
    for key, power in (("min_z", 0.5), ("omega", 1.5), ("D_att_1", 1.5)):
        apart = np.log([abs(high[value][key] - deep[value][key]) for value in near])
        assert np.polyfit(away, apart, 1)[0] == pytest.approx(power, abs=0.1)


def test_points_beyond_the_edge_of_sn1_are_told_apart(fig6_content, fig6_isolines):
    """An isoline that folds has both kinds; they are separated by its first cusp point."""
    cusp = next(place for place in fig6_content["cusps"] if place["D_rep_1"] == 1.0)
    mine = [place for place in fig6_content["sn1"] if place["D_rep_1"] == 1.0]
    others = [place for place in fig6_content["folded"] if place["D_rep_1"] == 1.0]
    assert len(mine) + len(others) == len(fig6_isolines["D_rep_1=1"]), "this isoline ends at no grazing"
    assert max(place["min_z"] for place in mine) <= cusp["min_z"] + 1e-9
    assert min(place["min_z"] for place in others) > cusp["min_z"]


def test_the_data_file_has_a_group_for_each_result(fig6_found):
    """A few of them read back: a branch, an isoline of each kind, an orbit."""
    import h5py
    import xarray as xr

    from saltus.continuation import Branch, Locus
    from saltus.orbits import PeriodicOrbit

    path, results = fig6_found["files"][0], fig6_found["results"]
    kinds = {"response": Branch, "D_rep_1=0.5": Locus, "D_att_1=0.1685": Locus, "reference": PeriodicOrbit}
    for name, kind in kinds.items():
        with xr.open_dataset(path, group=name, engine="h5netcdf") as dataset:
            assert kind.from_xarray(dataset.load()) == results[name]
    with h5py.File(path) as file:
        assert list(file) == list(results)


@pytest.fixture(scope="session")
def fig6_picture(fig6_found):
    figure = fig6.draw(fig6_found["results"])
    figure.canvas.draw()
    return figure


def test_the_chart_has_the_paper_s_two_colours_the_marked_point_and_the_inset(fig6_picture, fig6_content):
    ax = fig6_picture.axes[0]
    (inset,) = ax.child_axes
    mark, cusp = fig6_content["reference"], fig6_content["cusp"]
    for axes in (ax, inset):
        colours = {to_hex(line.get_color()) for line in axes.lines}
        assert set(fig6._COLOURS.values()) <= colours
        points = [line.get_xydata()[0].tolist() for line in axes.lines if len(line.get_xdata()) == 1]
        assert [mark["omega"], mark["min_z"]] in points
        assert [cusp["omega"], cusp["min_z"]] in points
    assert "bar{\\Omega}" in ax.get_xlabel()
    assert "eta" in ax.get_ylabel()
    assert inset.get_xlim()[0] < cusp["omega"] < inset.get_xlim()[1]
    assert ax.get_xlim()[0] < mark["omega"] < ax.get_xlim()[1]


def test_the_inset_covers_no_curve(fig6_picture):
    ax = fig6_picture.axes[0]
    (inset,) = ax.child_axes
    (left, low), (right, high) = inset.get_window_extent().get_points()
    for line in ax.lines:
        x, y = ax.transData.transform(line.get_xydata()).T
        assert not np.any((left < x) & (x < right) & (low < y) & (y < high))


def test_the_curve_of_turning_points_passes_through_them(fig6_picture, fig6_content):
    (curve,) = (line for line in fig6_picture.axes[0].lines if "turns at fixed" in str(line.get_label()))
    for place in fig6_content["turning_points"]:
        away = np.hypot(curve.get_xdata() - place["omega"], curve.get_ydata() - place["min_z"])
        assert away.min() < 1e-3


@pytest.mark.parametrize(("moment", "kept"), [("isoline D_att_1 = 0.16", 2), ("isoline D_rep_1 = 0.5", 3)])
def test_an_interrupted_run_keeps_what_it_has(tmp_path, moment, kept):
    def say(progress):
        if progress.text == moment:
            os.kill(os.getpid(), signal.SIGINT)

    found = fig6.run(tmp_path, say)
    assert found["interrupted"]
    assert [path.name for path in found["files"]] == ["fig6.nc", "fig6.json"]
    assert kept <= len(read_results(tmp_path / "fig6.nc")) <= kept + 1
    content = json.loads((tmp_path / "fig6.json").read_text())
    assert content["cusp"] is None
    assert content["sn1"]
