"""Fig. 2 of the paper: the two orbits against an independent integration, their segments, files and picture."""

from __future__ import annotations

import json
import math
import os
import signal

import matplotlib

matplotlib.use("Agg")

import numpy as np
import pytest

from oracles.tapping import Tapping
from saltus.afm.paper.figures import fig2, runner
from saltus.afm.paper.figures.files import read_results

pytestmark = pytest.mark.campaign


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    said = []
    return runner("fig2")(tmp_path_factory.mktemp("fig2"), said.append) | {"said": said}


@pytest.fixture(scope="module")
def content(found):
    return json.loads(found["files"][1].read_text())


def test_four_files_are_written(found):
    assert [path.name for path in found["files"]] == ["fig2.nc", "fig2.json", "fig2.png", "fig2.pdf"]
    assert not found["interrupted"]
    assert found["said"][-1].text == "drawing"


@pytest.mark.parametrize("name", ["impacting", "non_impacting"])
def test_orbits_return_after_a_period_by_another_integrator(content, name):
    orbit = content[name]
    x, crossings = Tapping(2, orbit["omega"]).map(np.array(orbit["x0"]))
    assert x == pytest.approx(orbit["x0"], abs=1e-9)
    assert len(crossings) == (2 if name == "impacting" else 0)


def test_segments_end_where_another_integrator_crosses_the_surface(content):
    orbit = content["impacting"]
    flight, touch, contact = (orbit["segments"][i] for i in (0, 1, 2))
    _, crossings = Tapping(2, orbit["omega"]).map(np.array(orbit["x0"]))
    assert touch["duration"] == pytest.approx(crossings[0][0], abs=1e-9)
    assert touch["duration"] + contact["duration"] == pytest.approx(crossings[1][0], abs=1e-9)
    assert contact["start"][:4] == pytest.approx(crossings[0][1], abs=1e-9)
    assert flight["start"][:4] == pytest.approx(crossings[1][1], abs=1e-9)


def test_segments_are_named_as_in_the_paper(content):
    """I1 reaches the phase reset, I2 the surface, I3 is the contact; the other orbit has I1 alone."""
    told = [[(s["name"], s["mode"], s["ends"]) for s in content[name]["segments"]] for name in fig2._NAMES]
    assert told == [
        [("I1", "flight", "theta"), ("I2", "flight", "touch"), ("I3", "contact", "release")],
        [("I1", "flight", "theta")],
    ]
    for name in fig2._NAMES:
        total = sum(segment["duration"] for segment in content[name]["segments"])
        assert total == pytest.approx(2.0 * math.pi / content[name]["omega"], rel=1e-12)
        assert content[name]["period"] == pytest.approx(total, rel=1e-12)


def test_the_dashed_orbit_stays_above_the_surface_and_near_it(content):
    a0 = 1.0 / 300.0
    near, deep = content["non_impacting"], content["impacting"]
    assert near["above_contact"] == pytest.approx(near["min_z"] - a0, abs=1e-15)
    assert 0.0 < near["above_contact"] < 0.02
    assert deep["above_contact"] < 0.0
    assert content["grazing"]["min_z"] == pytest.approx(a0, abs=1e-9)
    assert content["grazing"]["omega"] == pytest.approx(0.9109317020, abs=1e-9)  # as the grazing of Fig. 7(a)


def test_parameters_are_the_captions(content):
    p = content["parameters"]
    assert (p["Omega"], p["ybar"]) == ([0.98, 0.916], 0.108)
    assert (p["D_att_1"], p["D_att_2"], p["D_rep_1"], p["D_rep_2"]) == (0.025, 0.025, 4.0, 4.0)


def test_the_data_file_gives_the_orbits_back(found):
    again = read_results(found["files"][0])
    assert list(again) == ["impacting", "non_impacting", "response"]
    assert again["impacting"] == found["results"]["impacting"]


def test_curves_run_from_event_to_event(found):
    """Phase 0 to 2 pi in all, contact below the surface, velocity down at the touch and up at the release."""
    one, two, three = fig2.segments_of(found["results"]["impacting"])
    assert two.curve[0, 0] == 0.0
    assert one.curve[0, -1] == pytest.approx(2.0 * math.pi, abs=1e-12)
    for before, after in ((two, three), (three, one)):
        assert before.curve[:, -1] == pytest.approx(after.curve[:, 0], abs=1e-9)
        assert after.curve[2, 0] == pytest.approx(1.0 / 300.0, abs=1e-12)
    assert three.curve[2, 1:-1].max() < 1.0 / 300.0
    assert three.curve[1, 0] < 0.0 < three.curve[1, -1]


def test_the_picture_has_solid_segments_and_a_dashed_orbit_in_both_panels(found):
    figure = fig2.draw(found["results"])
    space, plane = figure.axes
    for ax in (space, plane):
        named = {str(line.get_label()): line for line in ax.lines if not str(line.get_label()).startswith("_")}
        solid = [label for label in named if "I_" in label]
        assert len(solid) == 3
        assert all(named[label].get_linestyle() == "-" for label in solid)
        assert any("0.916" in label and named[label].get_linestyle() == "--" for label in named)
    texts = {text.get_text() for text in space.texts} & {text.get_text() for text in plane.texts}
    assert {"$I_1$", "$I_2$", "$I_3$"} <= texts
    (legend,) = figure.legends
    assert "phase reset" in [text.get_text() for text in legend.get_texts()]


def test_an_interrupted_run_keeps_the_orbit_it_has(tmp_path):
    def say(progress):
        if progress.text.startswith("orbit without contact"):
            os.kill(os.getpid(), signal.SIGINT)

    found = fig2.run(tmp_path, say)
    assert found["interrupted"]
    assert [path.name for path in found["files"]] == ["fig2.nc", "fig2.json"]
    content = json.loads((tmp_path / "fig2.json").read_text())
    assert content["impacting"]["omega"] == 0.98
    assert "non_impacting" not in content
