"""Fig. 7(a) of the paper: responses of two modes, their special points and loci, and how near they come to one mode."""

from __future__ import annotations

import json
import os
import signal

import matplotlib

matplotlib.use("Agg")

import numpy as np
import pytest

import saltus
from saltus import afm
from saltus.afm.paper.figures import fig7a, runner
from saltus.afm.paper.figures.files import read_results
from saltus.plotting.space import stretches_of
from selection import guarding

pytestmark = pytest.mark.campaign  # the whole figure

# Of the response at D_rep_2 = 4, followed in steps 125 times smaller, which pass over none.
SPECIAL_POINTS = [
    ("SN", 0.9162457916),
    ("GR", 0.9109317020),
    ("PD", 0.9112390990),
    ("SN", 0.9112627835),
    ("TR", 0.9112622102),
    ("SN", 0.9080266734),
    ("TR", 0.9080267755),
    ("TR", 0.9183629219),
    ("PD", 0.9996354625),
    ("SN", 1.0051690042),
    ("PD", 1.0049814642),
    ("GR", 1.0048787947),
    ("PD", 1.0051326761),
    ("TR", 1.0051390894),
    ("PD", 1.0354419793),
    ("GR", 1.0466852389),
    ("TR", 1.0470121531),
    ("PD", 1.1635612060),
    ("SN", 1.1946749061),
    ("PD", 1.1776537450),
    ("SN", 1.0793546117),
    ("TR", 1.0795211197),
    ("PD", 1.0804723309),
    ("PD", 1.0805667636),
    ("TR", 1.0805851398),
    ("TR", 1.0806576310),
    ("SN", 1.0806576732),
    ("GR", 1.0804153865),
    ("PD", 1.0835718825),
]
KEYS = ["type", "omega", "state", "multipliers", "min_z", "signature", "admissible"]


@pytest.fixture(scope="session")
def fig7a_found(tmp_path_factory):
    said = []
    return runner("fig7a")(tmp_path_factory.mktemp("fig7a"), said.append) | {"said": said}


@pytest.fixture(scope="session")
def fig7a_content(fig7a_found):
    def refuse(name):
        raise AssertionError(f"{name} is not JSON")

    return json.loads(fig7a_found["files"][1].read_text(), parse_constant=refuse)


@pytest.fixture(scope="session")
def two_modes():
    return afm.tapping_mode(afm.table1(), modes=2)


def _settled(system, parameters, **start):
    """Return the repulsive orbit on which a simulation settles, found without any branch."""
    x0 = np.zeros(len(system.states))
    x0[0] = -2.0
    return saltus.find_orbit(system, parameters, x0=x0, **start)


def test_four_files_are_written(fig7a_found):
    assert [path.name for path in fig7a_found["files"]] == ["fig7a.nc", "fig7a.json", "fig7a.png", "fig7a.pdf"]
    assert fig7a_found["files"][2].read_bytes().startswith(b"\x89PNG")
    assert fig7a_found["files"][3].read_bytes().startswith(b"%PDF")
    assert not fig7a_found["interrupted"]
    assert fig7a_found["said"][-1].text == "drawing"


def test_json_has_the_promised_form(fig7a_content):
    assert fig7a_content["figure"] == "fig7a"
    parameters = fig7a_content["parameters"]
    assert (parameters["D_att_1"], parameters["D_att_2"], parameters["D_rep_1"]) == (0.025, 0.025, 4.0)
    values = parameters["D_rep_2"]
    assert values[0] == 4.0
    for name in ("distance_to_sdof", "largest_difference", "saddle_nodes"):
        assert [row[0] for row in fig7a_content[name]] == values
    for point in fig7a_content["special_points"]:
        assert list(point) == KEYS
        assert len(point["state"]) == len(point["multipliers"]) == 4
        assert point["admissible"] is True


def test_special_points_are_all_those_of_the_branch_in_small_steps(fig7a_content):
    points = fig7a_content["special_points"]
    assert [point["type"] for point in points] == [kind for kind, _ in SPECIAL_POINTS]
    assert [point["omega"] for point in points] == pytest.approx([omega for _, omega in SPECIAL_POINTS], abs=1e-8)


def test_multipliers_say_what_each_point_is(fig7a_content):
    """1 at an SN, -1 at a PD, a pair on the circle at a TR; to 1e-5, for at a fold they move like a square root."""
    for point in fig7a_content["special_points"]:
        values = [complex(*mu) for mu in point["multipliers"] if None not in mu]
        if point["type"] == "SN":
            assert min(abs(mu - 1.0) for mu in values) < 1e-5
        elif point["type"] == "PD":
            assert min(abs(mu + 1.0) for mu in values) < 1e-5
        elif point["type"] == "TR":
            assert min(abs(abs(mu) - 1.0) for mu in values if mu.imag) < 1e-8
        else:
            assert point["min_z"] == pytest.approx(1.0 / 300.0, abs=1e-9) or len(point["signature"]) == 2


def test_states_are_those_at_phase_zero(fig7a_content, two_modes):
    """A simulation from each returns after one period of the drive; next to a grazing errors grow like their root."""
    for point in fig7a_content["special_points"]:
        motion = saltus.simulate(two_modes, {"Omega": point["omega"]}, point["state"], periods=1)
        slack = 1e-4 if point["type"] == "GR" else 1e-6
        assert motion.x_end[:4] == pytest.approx(point["state"], abs=slack)


def test_the_response_has_the_stable_stretches_of_the_paper(fig7a_content, two_modes):
    """Stable up to the PD near 1.0 and from the TR near 1.047 to the PD near 1.164, unstable between, by simulation."""
    doubling, torus, end = (1.0, 1.0470121531, 1.1635612060)
    for omega, periods in ((doubling - 2e-3, 1), (1.0, 2), (1.02, 4), (torus + 2e-3, 1), (end - 2e-3, 1)):
        orbit = _settled(two_modes, {"Omega": omega})
        assert orbit.period == pytest.approx(periods * 2.0 * np.pi / omega)
    assert any(abs(point["omega"] - torus) < 1e-8 for point in fig7a_content["special_points"])


@pytest.mark.parametrize(("damping", "omega"), [(4.0, 1.1), (10.0, 1.03), (60.0, 0.96), (1500.0, 1.14)])
def test_responses_are_the_motions_that_settle(fig7a_found, two_modes, damping, omega):
    orbit = _settled(two_modes, {"Omega": omega, "D_rep_2": damping})
    results = fig7a_found["results"]
    depth = fig7a._stable_depth(fig7a._two_modes(results)[damping], np.array([omega]))
    assert depth[0] == pytest.approx(orbit.min["z"], abs=1e-6)


def test_the_difference_is_that_of_the_motions_that_settle(fig7a_content, fig7a_found, two_modes):
    """At a few frequencies; their largest is below that of the figure, their mean near it."""
    one_mode = afm.tapping_mode(afm.table1(), modes=1)
    found = {4.0: [], 20.0: []}
    for omega in (0.94, 0.97, 1.06, 1.1, 1.14):
        alone = _settled(one_mode, {"Omega": omega}).min["z"]
        for damping, gaps in found.items():
            gaps.append(abs(_settled(two_modes, {"Omega": omega, "D_rep_2": damping}).min["z"] - alone))
    for damping, gaps in found.items():
        assert max(gaps) < dict(fig7a_content["largest_difference"])[damping] + 1e-6
        assert np.mean(gaps) == pytest.approx(dict(fig7a_content["distance_to_sdof"])[damping], rel=0.3)


def test_the_response_comes_to_that_of_one_mode_as_the_damping_grows(fig7a_content):
    """The distance falls all the way, to a hundredth; the end of the branch, too, comes to that of one mode."""
    distances = [distance for _, distance in fig7a_content["distance_to_sdof"]]
    assert np.all(np.diff(distances) < 0.0)
    assert distances[-1] < 0.011 * distances[0]
    ends = np.array(fig7a_content["saddle_nodes"])
    assert fig7a_content["one_mode"]["omega"] == pytest.approx(1.241858336410, abs=1e-8)
    assert abs(ends[-1, 1] - fig7a_content["one_mode"]["omega"]) < 0.03 * abs(
        ends[0, 1] - fig7a_content["one_mode"]["omega"]
    )


def test_the_last_stable_response_is_that_of_one_mode_to_a_line_s_width(fig7a_found, fig7a_content):
    figure = fig7a.draw(fig7a_found["results"])
    figure.canvas.draw()
    ax = figure.axes[0]
    (line,) = (line for line in ax.lines if line.get_label() == "one mode")
    largest = fig7a_content["largest_difference"][-1][1]
    points = (ax.transData.transform((1.0, largest)) - ax.transData.transform((1.0, 0.0)))[1] * 72.0 / figure.dpi
    assert points < 0.5 * line.get_linewidth()


def test_saddle_nodes_of_the_responses_lie_on_their_locus(fig7a_found, fig7a_content):
    """As drawn, to a thousandth of the picture, and exactly where the locus is followed to the same damping."""
    locus = fig7a_found["results"]["SN"]
    curve = np.concatenate([stretch.places for stretch in stretches_of(locus, ["Omega", "min_z"])], axis=1).T
    for _, omega, depth in fig7a_content["saddle_nodes"]:
        assert np.linalg.norm((curve - (omega, depth)) / (0.36, 0.13), axis=1).min() < 1e-3
    for damping, omega, _ in fig7a_content["saddle_nodes"][1:4]:
        row = int(np.argmin(np.abs(locus.column("D_rep_2") - damping)))
        begin = float(locus.column("D_rep_2")[row])
        bounds = {"Omega": (1.1, 1.28), "D_rep_2": (min(begin, damping), max(begin, damping))}
        way = saltus.continue_locus(locus.point(row), ("Omega", "D_rep_2"), bounds)
        at = int(np.argmin(np.abs(way.column("D_rep_2") - damping)))
        assert way.column("Omega")[at] == pytest.approx(omega, abs=1e-8)


def test_the_locus_of_torus_bifurcations_is_met_by_another_response(fig7a_found, two_modes):
    """At a damping of its own, by a branch along the frequency from a motion that settled."""
    locus = fig7a_found["results"]["TR"]
    row = int(np.argmin(np.abs(locus.column("D_rep_2") - 4.6)))
    damping = float(locus.column("D_rep_2")[row])
    assert 4.1 < damping < 5.5
    orbit = _settled(two_modes, {"Omega": 1.1, "D_rep_2": damping})
    response = saltus.continue_orbit(orbit, "Omega", (1.0, 1.12), directions="down", stop_at="TR")
    assert response["TR1"].parameters["Omega"] == pytest.approx(locus.column("Omega")[row], abs=1e-8)


def test_quasi_periodic_motion_ends_at_a_resonance(fig7a_found):
    """The locus of TR exists up to a damping not far above the paper's, and no response above it has one there."""
    results = fig7a_found["results"]
    (last,) = results["TR"].special_points.of_type("R1")
    assert 5.0 < last.parameters["D_rep_2"] < 6.0
    for branch in results["responses"]:
        assert branch.parameters["D_rep_2"] > last.parameters["D_rep_2"]
        assert all(point.orbit.min["z"] > -0.03 for point in branch.special_points.of_type("TR"))


def test_the_data_file_gives_every_result_back_under_its_name(fig7a_found):
    again = read_results(fig7a_found["files"][0])
    assert list(again) == list(fig7a_found["results"])
    assert {"one_mode", "two_modes", "responses", "SN", "TR"} <= set(again)
    for name, result in again.items():
        assert result == fig7a_found["results"][name]


@pytest.fixture(scope="session")
def fig7a_picture(fig7a_found):
    figure = fig7a.draw(fig7a_found["results"])
    figure.canvas.draw()
    return figure


def test_the_torus_bifurcation_is_an_empty_diamond_in_the_inset(fig7a_picture, fig7a_content):
    ax = fig7a_picture.axes[0]
    (inset,) = ax.child_axes
    (line,) = (line for line in inset.lines if str(line.get_label()).startswith("TR, torus"))
    assert line.get_marker() == "D"
    assert line.get_markerfacecolor() == "white"
    shown = [
        point
        for point in fig7a_content["special_points"]
        if point["type"] == "TR"
        and inset.get_xlim()[0] < point["omega"] < inset.get_xlim()[1]
        and inset.get_ylim()[0] < point["min_z"] < inset.get_ylim()[1]
    ]
    assert [point["omega"] for point in shown] == pytest.approx([1.0470121531], abs=1e-8)


def test_axes_and_legend_name_what_is_drawn(fig7a_picture, fig7a_content):
    ax = fig7a_picture.axes[0]
    assert "bar{\\Omega}" in ax.get_xlabel()
    assert "eta" in ax.get_ylabel()
    (legend,) = fig7a_picture.legends
    texts = [text.get_text() for text in legend.get_texts()]
    assert texts[0] == "one mode"
    for value in fig7a_content["parameters"]["D_rep_2"]:
        assert f"$D_2^{{rep}} = {value:g}$" in texts
    assert any(text.startswith("SN as") for text in texts)
    assert any(text.startswith("TR as") for text in texts)


def test_the_inset_covers_no_curve(fig7a_picture):
    ax = fig7a_picture.axes[0]
    (inset,) = ax.child_axes
    (left, low), (right, high) = inset.get_window_extent().get_points()
    for line in ax.lines:
        x, y = ax.transData.transform(line.get_xydata()).T
        assert not np.any((left < x) & (x < right) & (low < y) & (y < high))


@pytest.mark.parametrize(
    ("moment", "done", "kept"),
    guarding(
        [
            ("responses: ", 2, ["one_mode", "two_modes", "responses"]),
            ("Omega = ", 40, ["one_mode"]),
            ("beside SN2", 0, ["one_mode", "two_modes"]),
        ],
        campaign=1,
    ),
)
def test_an_interrupted_run_keeps_what_it_has(fig7a_found, monkeypatch, tmp_path, moment, done, kept):
    """What the whole run has found already stands for the branches before those during which the interrupt comes."""
    if kept != ["one_mode"]:
        before = iter([fig7a_found["results"][name] for name in ("one_mode", "two_modes")])
        monkeypatch.setattr(fig7a, "response", lambda *_: next(before))

    def say(progress):
        if progress.text.startswith(moment) and progress.done == done:
            os.kill(os.getpid(), signal.SIGINT)

    found = fig7a.run(tmp_path, say)
    assert found["interrupted"]
    assert [path.name for path in found["files"]] == ["fig7a.nc", "fig7a.json"]
    assert [name for name in read_results(tmp_path / "fig7a.nc") if not name.startswith("beside")] == kept
    content = json.loads((tmp_path / "fig7a.json").read_text())
    assert bool(content["special_points"]) == ("two_modes" in kept)
    assert len(content["distance_to_sdof"]) == (3 if "responses" in kept else 0)
