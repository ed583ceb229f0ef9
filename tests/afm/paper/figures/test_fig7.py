"""Fig. 7 of the paper: the labels of the motions that it names, the files, the panels."""

from __future__ import annotations

import json

import matplotlib

matplotlib.use("Agg")

import numpy as np
import pytest
from matplotlib.figure import Figure

from saltus.afm.paper.figures import fig7, fig7a, runner
from saltus.afm.paper.figures.files import read_results
from saltus.results import Sweep

pytestmark = pytest.mark.campaign  # the whole figure


@pytest.fixture(scope="module")
def few():
    """The sweep with a value in each of the ranges of period one and two, and the portraits of the latter."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fig7a, "SWEPT", (0.996, 1.004))
        sweep = fig7.sweep_of(3)
    return sweep


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    said = []
    return runner("fig7")(tmp_path_factory.mktemp("fig7"), said.append) | {"said": said}


def test_a_sweep_s_rows_are_in_the_json_in_order(few):
    content = fig7.summary({"sweep": few})
    assert [row["omega"] for row in content["sweep"]] == [0.996, 1.0, 1.004]
    assert [list(row) for row in content["sweep"]] == [["omega", "label", "period", "lyapunov"]] * 3
    assert [(row["label"], row["period"]) for row in content["sweep"]] == [
        ("period-1", 1),
        ("period-2", 2),
        ("period-2", 2),
    ]
    assert all(row["lyapunov"] < 0.0 for row in content["sweep"])
    assert content["parameters"]["ybar"] == 0.108
    assert (content["parameters"]["D_att_2"], content["parameters"]["D_rep_2"]) == (0.025, 4.0)
    json.dumps(content, allow_nan=False)


def test_a_portrait_is_a_whole_number_of_periods_that_closes(few):
    motion = fig7._portrait(few, 1.0, 2)
    assert motion.t_end == pytest.approx(4.0 * np.pi, rel=1e-12)
    assert motion.x_end[:4] == pytest.approx(motion(0.0)[:4], abs=1e-6)


@pytest.mark.thorough
class TestWhole:
    """The whole figure, some 40 s."""

    def test_labels_are_those_in_print(self, found):
        content = json.loads(found["files"][1].read_text())
        assert content["labels"] == {
            "1.00": "period-2",
            "1.02": "period-4",
            "1.023": "chaotic",
            "1.046": "locked-20",
        }
        assert (content["periods"]["1.00"], content["periods"]["1.02"], content["periods"]["1.023"]) == (2, 4, 0)
        for named, value in content["at"].items():
            assert value == pytest.approx(float(named), abs=0.5 * 0.055 / 299)

    def test_the_sweep_is_the_captions(self, found):
        rows = json.loads(found["files"][1].read_text())["sweep"]
        assert len(rows) == 300
        assert (rows[0]["omega"], rows[-1]["omega"]) == (0.995, 1.05)
        sweep = found["results"]["sweep"]
        assert (sweep.settings["discard"], sweep.settings["keep"]) == (600, 100)
        assert sweep.points.shape == (1, 300, 100, 1)

    def test_period_one_ends_at_the_branch_s_period_doubling(self, found):
        """At the PD of Fig. 7(a), 0.99963546; the value next to it, where 600 periods settle only 5 times, aside."""
        rows = json.loads(found["files"][1].read_text())["sweep"]
        step, doubling = 0.055 / 299, 0.9996354625
        assert {row["label"] for row in rows if row["omega"] < doubling - step} == {"period-1"}
        assert {row["label"] for row in rows if doubling < row["omega"] < 1.005} == {"period-2"}

    def test_period_one_is_back_above_the_branch_s_torus_bifurcation(self, found):
        """From the TR of Fig. 7(a) at 1.0470121531 on."""
        rows = json.loads(found["files"][1].read_text())["sweep"]
        above = [row["label"] for row in rows if row["omega"] > 1.0472]
        assert set(above) == {"period-1"}
        below = [row["label"] for row in rows if 1.0463 < row["omega"] < 1.0470121531]
        assert "period-1" not in below

    def test_the_data_file_gives_sweep_portraits_and_responses_back(self, found):
        again = read_results(found["files"][0])
        assert list(again)[:4] == ["sweep", "portrait (c)", "portrait (d)", "portrait (e)"]
        assert {"one_mode", "two_modes", "responses", "SN", "TR"} <= set(again)
        assert again["sweep"] == found["results"]["sweep"]

    def test_panels_are_lettered(self, found):
        figure = fig7.draw(found["results"])
        letters = [ax.get_title(loc="left") for ax in figure.axes]
        assert [letter for letter in letters if letter] == ["(a)", "(b)", "(c)", "(d)", "(e)"]

    def test_progress_is_told(self, found):
        assert any(told.text.startswith("sweep: Omega = ") and told.done == told.total == 300 for told in found["said"])
        assert found["said"][-1].text == "drawing"


def test_an_interrupted_sweep_is_kept(tmp_path, monkeypatch):
    import os
    import signal

    monkeypatch.setattr(fig7, "COUNT", 4)
    monkeypatch.setattr(fig7a, "SWEPT", (0.996, 0.999))

    def say(progress):
        if progress.text.startswith("sweep: ") and progress.done == 2:
            os.kill(os.getpid(), signal.SIGINT)

    found = fig7.run(tmp_path, say)
    assert found["interrupted"]
    assert [path.name for path in found["files"]] == ["fig7.nc", "fig7.json"]
    rows = json.loads((tmp_path / "fig7.json").read_text())["sweep"]
    assert [row["label"] for row in rows] == ["period-1"] * len(rows)
    assert 2 <= len(rows) < 4
    assert int(read_results(found["files"][0])["sweep"].done.sum()) == len(rows)
    assert int(Sweep.load(tmp_path / "fig7-sweep.nc").done.sum()) == len(rows)


def test_an_interrupted_sweep_goes_on_where_it_stopped(tmp_path, monkeypatch):
    monkeypatch.setattr(fig7, "COUNT", 3)
    monkeypatch.setattr(fig7a, "SWEPT", (0.996, 0.999))
    monkeypatch.setattr(fig7, "PORTRAITS", {})
    monkeypatch.setattr(fig7a, "compute", lambda progress: iter(()))
    monkeypatch.setattr(fig7, "draw", lambda results: Figure())

    def interrupt(progress):
        if progress.text.startswith("sweep: ") and progress.done == 2:
            raise KeyboardInterrupt

    assert fig7.run(tmp_path, interrupt)["interrupted"]
    said = []
    found = fig7.run(tmp_path, said.append)
    assert not found["interrupted"]
    assert [(told.done, told.total) for told in said if told.text.startswith("sweep: ")] == [(3, 3)]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["fig7.json", "fig7.nc", "fig7.pdf", "fig7.png"]
    assert found["results"]["sweep"] == fig7.sweep_of(3)
