"""Fig. 3 of the paper: the files that the command writes, and the ten special points."""

from __future__ import annotations

import json
import os
import signal
from dataclasses import replace

import matplotlib

matplotlib.use("Agg")

import numpy as np
import pytest

import saltus
from saltus import afm
from saltus.afm.paper import figures
from saltus.afm.paper.figures import FIGURES, fig3, runner
from saltus.errors import InputError

# Reference values at a tolerance of 1e-14, not computed by what is tested here.
SPECIAL_POINTS = [
    ("SN", 0.916055296824),
    ("GR", 0.912759119335),
    ("PD", 0.912868754388),
    ("SN", 0.912882523124),
    ("SN", 0.912057721216),
    ("SN", 1.241858336410),
    ("SN", 1.080712704170),
    ("SN", 1.081291734470),
    ("GR", 1.081041092470),
    ("PD", 1.082553985300),
]
KEYS = ["type", "omega", "state", "multipliers", "min_z", "signature", "admissible"]


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    said = []
    result = runner("fig3")(tmp_path_factory.mktemp("fig3"), said.append)
    return result | {"said": said}


@pytest.fixture(scope="module")
def content(found):
    def refuse(name):
        raise AssertionError(f"{name} is not JSON")

    return json.loads(found["files"][1].read_text(), parse_constant=refuse)


def test_four_files_are_written(found):
    assert [path.name for path in found["files"]] == ["fig3.nc", "fig3.json", "fig3.png", "fig3.pdf"]
    assert found["files"][2].read_bytes().startswith(b"\x89PNG")
    assert found["files"][3].read_bytes().startswith(b"%PDF")
    assert not found["interrupted"]


def test_special_points_are_the_ten_of_the_reference(content):
    assert [point["type"] for point in content["special_points"]] == [kind for kind, _ in SPECIAL_POINTS]
    omegas = [point["omega"] for point in content["special_points"]]
    assert omegas == pytest.approx([omega for _, omega in SPECIAL_POINTS], rel=0.0, abs=1e-8)


def test_json_has_the_promised_form(content):
    assert list(content) == ["figure", "parameters", "special_points"]
    assert content["figure"] == "fig3"
    model = afm.tapping_mode(afm.table1(), modes=1)
    assert tuple(content["parameters"]) == model.parameter_names
    assert content["parameters"]["Omega"] == [0.8, 1.4]
    assert (content["parameters"]["ybar"], content["parameters"]["D_rep_1"]) == (0.108, 4.0)
    for point in content["special_points"]:
        assert list(point) == KEYS
        assert len(point["state"]) == 2
        assert [len(pair) for pair in point["multipliers"]] == [2, 2]
        assert all(len(pair) == 2 for pair in point["signature"])
        assert point["admissible"] is True


def test_multipliers_say_what_each_point_is(content):
    """A fold has the multiplier 1 and a period doubling -1; to 1e-5, for at a fold it moves like a square root."""
    wanted = {"SN": 1.0, "PD": -1.0}
    for point in content["special_points"]:
        if point["type"] in wanted:
            assert min(abs(complex(*mu) - wanted[point["type"]]) for mu in point["multipliers"]) < 1e-5


def test_grazing_orbits_touch_where_contact_begins(content):
    gaps = [point["min_z"] for point in content["special_points"] if point["type"] == "GR"]
    assert gaps == pytest.approx([1.0 / 300.0] * 2, abs=1e-9)


def test_states_are_those_at_phase_zero(content):
    """A simulation from each stable-enough point returns after one period of the drive."""
    model = afm.tapping_mode(afm.table1(), modes=1)
    for point in content["special_points"]:
        motion = saltus.simulate(model, {"Omega": point["omega"]}, point["state"], periods=1)
        assert motion.x_end[:2] == pytest.approx(point["state"], abs=1e-5)


def test_the_data_file_holds_every_point_with_a_signature_in_words(found):
    import xarray as xr

    branch = found["branch"]
    with xr.open_dataset(found["files"][0], engine="h5netcdf") as dataset:
        assert dataset.sizes["point"] == len(branch)
        for name in ("Omega", "min_z", "multiplier_re", "multiplier_im", "stable", "admissible", "signature"):
            assert name in dataset.variables
        words = dataset["signature"].values.astype(str)
        assert set(words) == {"flight:theta", "flight:touch -> contact:release"}
        assert words[0] == "flight:theta"
        deep = int(np.argmin(dataset["min_z"].values))
        assert words[deep] == "flight:touch -> contact:release"
        assert set(dataset["special_type"].values.astype(str)) == {"SN", "GR", "PD"}


def test_the_data_file_can_be_loaded_and_is_the_branch(found):
    again = saltus.load(found["files"][0])
    assert np.array_equal(again.values, found["branch"].values)
    assert [point.label for point in again.special_points] == [point.label for point in found["branch"].special_points]


def test_progress_is_told(found):
    assert found["said"][0].text == "preparing the model"
    assert found["said"][-1].text == "drawing"
    assert [told.done for told in found["said"] if told.text.startswith("Omega = ")][-1] > 60


def test_panels_show_the_response_and_the_grazings(found):
    figure = fig3.draw(found["branch"])
    panels = figure.axes[:4]
    assert [panel.get_title(loc="left") for panel in panels] == ["(a)", "(b)", "(c)", "(d)"]
    assert panels[0].get_xlim() == (0.8, 1.4)
    for panel in panels:
        assert "\\bar{\\Omega}" in panel.get_xlabel()
        assert "eta" in panel.get_ylabel()
        (level,) = (line for line in panel.lines if "contact begins" in line.get_label())
        assert level.get_linestyle() == ":"
        assert level.get_ydata() == pytest.approx([1.0 / 300.0] * 2)
    (legend,) = figure.legends
    texts = [text.get_text() for text in legend.get_texts()]
    assert texts[:4] == ["stable", "unstable", "SN, saddle-node", "GR, grazing"]
    assert "not drawn in the paper" in texts[4]


def test_every_special_point_lies_in_a_zoom_without_overlap(found):
    """In its panel, or in the inset, every dot is a dot's width (5 pt) away from every other."""
    figure = fig3.draw(found["branch"])
    figure.canvas.draw()
    _, b, c, d = figure.axes[:4]
    (inset,) = c.child_axes
    lone = []
    for point in found["branch"].special_points:
        place = found["branch"].value_at(point, "Omega"), found["branch"].value_at(point, "min_z")
        for ax in (inset, d, c, b):
            inside = ax.get_xlim()[0] < place[0] < ax.get_xlim()[1] and ax.get_ylim()[0] < place[1] < ax.get_ylim()[1]
            if inside:
                lone.append((ax, ax.transData.transform(place)))
                break
    assert len(lone) == 10
    for i, (ax, place) in enumerate(lone):
        for other, there in lone[:i]:
            if ax is other:
                assert np.linalg.norm(place - there) * 72.0 / figure.dpi > 5.0


@pytest.mark.campaign
@pytest.mark.parametrize(("moment", "done"), [("Omega = ", 60), ("drawing", 0)])
def test_an_interrupted_run_keeps_what_it_has(tmp_path, moment, done):
    def say(progress):
        if progress.text.startswith(moment) and progress.done == done:
            os.kill(os.getpid(), signal.SIGINT)

    found = fig3.run(tmp_path, say)
    assert found["interrupted"]
    assert [path.name for path in found["files"]] == ["fig3.nc", "fig3.json"]
    again = saltus.load(tmp_path / "fig3.nc")
    assert len(again) == len(found["branch"]) >= 60
    assert json.loads((tmp_path / "fig3.json").read_text())["figure"] == "fig3"


def test_a_multiplier_without_bound_is_null_in_json(found):
    branch = found["branch"]
    point = branch["GR1"]
    orbit = replace(point.orbit, multipliers=np.array([np.inf, 0.1], dtype=complex))
    changed = replace(branch, special_points=type(branch.special_points)([replace(point, solution=orbit)], "Omega"))
    content = fig3.summary(changed)
    assert content["special_points"][0]["multipliers"][0][0] is None
    json.dumps(content, allow_nan=False)


def test_the_registry_names_each_figure_with_a_module():
    for name, line in FIGURES.items():
        assert callable(runner(name))
        assert line
    with pytest.raises(InputError, match=r"figure = 'fig33': must be one of fig2, fig3, .*; did you mean 'fig3'\?"):
        runner("fig33")
    assert set(figures.__all__) == {"FIGURES", "runner"}
