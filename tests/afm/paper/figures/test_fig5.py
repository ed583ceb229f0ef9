"""Fig. 5 of the paper: what damping does to the saturated branch, against branches along one parameter."""

from __future__ import annotations

import json

import matplotlib

matplotlib.use("Agg")

import numpy as np
import pytest
from matplotlib.colors import to_rgb

import saltus
from saltus import afm
from saltus.afm.paper.figures import fig5, runner
from saltus.afm.paper.figures.files import read_results
from saltus.plotting.space import stretches_of
from selection import THOROUGH, guarding

pytestmark = [*THOROUGH]  # the whole figure

LOCI = ["SN_1", "SN_2", "grazing", "SN_1_D_rep_0.1", "SN_1_D_rep_30", "SN_1_D_att_0.025", "SN_1_D_att_0.14"]
A0 = 1.0 / 300.0


@pytest.fixture(scope="session")
def fig5_found(tmp_path_factory):
    said = []
    return runner("fig5")(tmp_path_factory.mktemp("fig5"), said.append) | {"said": said}


@pytest.fixture(scope="session")
def most(fig5_found):
    return json.loads(fig5_found["files"][1].read_text())["sn_locus_max"]


@pytest.fixture(scope="session")
def repulsive():
    guess = [
        ("flight", "touch", [-0.717, 0.7335], 2.95),
        ("contact", "release", [0.95, 0.85], 0.375),
        ("flight", "theta", [0.9, -0.4], 2.65),
    ]
    return saltus.solve_orbit(afm.tapping_mode(afm.table1(), modes=1), {"Omega": 1.05}, guess)


@pytest.fixture(scope="session")
def in_damping(most, repulsive):
    """Impacting orbits at the frequency of the maximum, as the damping in air grows."""
    way = saltus.continue_orbit(repulsive, "Omega", (most["omega"], 1.05), directions="down")
    return saltus.continue_orbit(way.solution(-1), "D_att_1", (0.025, 0.2), directions="up")


def test_four_files_are_written(fig5_found):
    assert [path.name for path in fig5_found["files"]] == ["fig5.nc", "fig5.json", "fig5.png", "fig5.pdf"]
    assert fig5_found["files"][2].read_bytes().startswith(b"\x89PNG")
    assert fig5_found["files"][3].read_bytes().startswith(b"%PDF")
    assert not fig5_found["interrupted"]


def test_json_has_the_promised_form(fig5_found):
    content = json.loads(fig5_found["files"][1].read_text())
    assert set(content) == {"figure", "parameters", "sn_locus_max"}
    assert set(content["sn_locus_max"]) == {"D_att_1", "omega"}
    assert content["parameters"]["ybar"] == 0.108
    assert content["parameters"]["D_rep_1"] == [0.1, 30.0]


def test_the_maximum_is_a_fold_of_the_branch_in_the_damping(most, in_damping):
    """At the frequency of the maximum impacting orbits turn back where the damping has reached the maximum."""
    (fold,) = (point for point in in_damping.special_points.of_type("SN") if point.orbit.min["z"] < A0)
    assert fold.parameters["D_att_1"] == pytest.approx(most["D_att_1"], abs=1e-9)
    in_contact = in_damping.column("min_z") < A0
    assert in_damping.values[in_contact].max() <= most["D_att_1"] + 1e-9


def test_slightly_below_the_maximum_the_response_in_contact_has_two_saddle_nodes(most, in_damping):
    damping = most["D_att_1"] - 2e-5
    up_to = saltus.continue_orbit(in_damping.solution(0), "D_att_1", (0.025, damping), directions="up")
    response = saltus.continue_orbit(up_to.solution(-1), "Omega", (0.95, 1.05))
    folds = [point.parameters["Omega"] for point in response.special_points.of_type("SN")]
    assert len(folds) == 2
    assert min(folds) < most["omega"] < max(folds)
    assert (response.column("min_z") < A0).all()


def test_slightly_above_the_maximum_the_response_has_no_saddle_node_and_no_contact(most, fig5_found):
    damping = most["D_att_1"] + 2e-5
    small = fig5_found["results"]["response"].solution(0)
    assert small.min["z"] > A0
    up_to = saltus.continue_orbit(small, "D_att_1", (0.025, damping), directions="up")
    response = saltus.continue_orbit(up_to.solution(-1), "Omega", (0.8, 1.4))
    assert response.stopped == ("Omega = 0.8: bound reached", "Omega = 1.4: bound reached")
    assert not list(response.special_points)
    assert response.stable.all()
    assert (response.column("min_z") > A0).all()


@pytest.mark.parametrize("beside", guarding([-0.002, 0.002], 0.002, campaign=0))
def test_beside_the_maximum_the_fold_comes_at_less_damping(most, repulsive, beside):
    omega = most["omega"] + beside
    way = saltus.continue_orbit(repulsive, "Omega", (omega, 1.05), directions="down")
    branch = saltus.continue_orbit(way.solution(-1), "D_att_1", (0.025, 0.2), directions="up")
    fold = max(point.parameters["D_att_1"] for point in branch.special_points.of_type("SN"))
    assert most["D_att_1"] - 1e-4 < fold < most["D_att_1"]


def test_the_dampings_are_those_of_the_paper(fig5_found):
    family = fig5_found["results"]["responses"]
    pairs = list(zip(*(family.over[name].tolist() for name in ("D_att_1", "D_rep_1")), strict=True))
    assert (0.04, 0.1) in pairs
    assert max(in_contact for _, in_contact in pairs) == 30.0
    assert not family.failures


def test_loci_pass_through_the_saddle_node_that_ends_each_response(fig5_found):
    """The curves, as drawn, to a thousandth of the picture: less than a line's width."""
    results = fig5_found["results"]
    size = np.array([0.4, 0.13, 0.18])
    names = ("Omega", "min_z", "D_att_1")
    ends = 0
    for branch in (results["response"], *results["responses"]):
        damping = branch.parameters["D_att_1"], branch.parameters["D_rep_1"]
        name = {4.0: "SN_1", 0.1: "SN_1_D_rep_0.1", 30.0: "SN_1_D_rep_30", 10.0: "SN_1_D_att_0.025"}[damping[1]]
        curves = [stretch.places for stretch in stretches_of(results[name], names)]
        drawn = np.concatenate(curves, axis=1).T / size
        folds = [point for point in branch.special_points.of_type("SN") if point.orbit.min["z"] < 0.0]
        end = max(folds, key=lambda point: point.parameters["Omega"], default=None)
        if end is None or damping == (0.04, 0.1):  # its end lies beyond the picture
            continue
        ends += 1
        place = np.array([end.parameters["Omega"], end.orbit.min["z"], damping[0]]) / size
        assert np.linalg.norm(drawn - place, axis=1).min() < 1e-3
    assert ends >= 8


def test_the_fold_at_the_grazing_is_where_responses_turn_back(fig5_found):
    results = fig5_found["results"]
    (curve,) = (stretch.places for stretch in stretches_of(results["grazing"], ("Omega", "D_att_1")))
    for branch in (results["response"], *results["responses"]):
        for point in branch.special_points.of_type("GR"):
            place = np.array([[point.parameters["Omega"]], [branch.parameters["D_att_1"]]])
            size = np.array([[0.4], [0.18]])
            assert np.linalg.norm((curve - place) / size, axis=0).min() < 2e-3


def test_hard_contact_loses_the_saddle_nodes_at_the_right_grazing(fig5_found):
    """As the paper says of SN_2 and SN_3 at large damping in contact."""
    results = fig5_found["results"]

    def right(branch):
        near = [point for point in branch.special_points.of_type("SN") if abs(point.orbit.min["z"]) < A0]
        return [point for point in near if point.parameters["Omega"] > 1.0]

    (hard,) = (branch for branch in results["responses"] if branch.parameters["D_rep_1"] == 30.0)
    assert (len(right(results["response"])), len(right(hard))) == (2, 0)


def test_the_data_file_gives_every_result_back_under_its_name(fig5_found):
    again = read_results(fig5_found["files"][0])
    assert list(again) == ["response", "responses", *LOCI] == list(fig5_found["results"])
    for name, result in again.items():
        assert result == fig5_found["results"][name]


@pytest.fixture(scope="session")
def panels(fig5_found):
    return fig5.draw(fig5_found["results"]).axes


def test_panel_a_is_in_space_and_panel_b_its_projection(panels):
    space, plane = panels
    assert (space.name, plane.name) == ("3d", "rectilinear")
    assert [ax.get_title(loc="left") for ax in panels] == ["(a)", "(b)"]
    assert "Omega" in space.get_xlabel()
    assert "D_1^{att}" in space.get_zlabel()
    for label in (space.get_ylabel(), plane.get_ylabel()):
        assert "bar{z}" in label
        assert "bar{a}_0" in label
    assert space.get_xlim() == pytest.approx(plane.get_xlim())
    for flat, deep in zip(plane.lines, space.lines, strict=True):
        x, y, _ = deep.get_data_3d()
        assert np.array_equal(flat.get_xdata(), x)
        assert np.array_equal(flat.get_ydata(), y)


def test_the_gap_is_counted_from_where_contact_begins(panels, fig5_found):
    (grazing,) = (line for line in panels[1].lines if line.get_label().startswith("fold at the grazing"))
    assert np.abs(grazing.get_ydata()).max() < 1e-9


def test_stable_responses_are_solid_unstable_ones_dashed_and_loci_red_and_blue(panels):
    lines = [line for line in panels[1].lines if line.get_linestyle() != "None"]
    assert {line.get_linestyle() for line in lines} == {"-", "--"}
    thick = [to_rgb(line.get_color()) for line in lines if line.get_linewidth() > 1.0]
    red = [colour for colour in thick if colour[0] > 2.0 * max(colour[1:])]
    blue = [colour for colour in thick if colour[2] > 2.0 * max(colour[:2])]
    assert red
    assert blue
    assert len(red) + len(blue) == len(thick)


def test_the_maximum_is_marked_and_named(panels, most):
    (mark,) = (line for line in panels[0].lines if line.get_marker() == "o")
    omega, _, damping = mark.get_data_3d()
    assert (omega[0], damping[0]) == (most["omega"], most["D_att_1"])
    (legend,) = panels[0].figure.legends
    assert any(f"{most['D_att_1']:.4f}" in text.get_text() for text in legend.get_texts())
