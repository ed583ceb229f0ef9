"""Fig. 9 of the paper: the repulsive basin with one mode and with two, the files, going on, the picture."""

from __future__ import annotations

import json

import matplotlib

matplotlib.use("Agg")

import numpy as np
import pytest
from matplotlib.colors import to_rgb

from basin_sections import made
from saltus import load
from saltus.afm.paper.figures import fig9, runner
from saltus.afm.paper.figures.files import read_results
from saltus.errors import InputError

pytestmark = pytest.mark.campaign  # the whole figure

RESOLUTION = 24


@pytest.fixture
def quarters():
    """With one mode the half q1 > 0 is repulsive, with two the half v1 > 0."""
    one, two = np.zeros((2, 2)), np.zeros((2, 2))
    one[1, :], two[:, 1] = 1, 1
    return {"one_mode": made(one, 1), "two_modes": made(two, 2, **fig9.SECOND)}


def test_the_plane_is_that_of_the_paper_s_attractor():
    assert dict(fig9.SECOND) == {"q2": -0.028993, "v2": 0.485640}
    assert dict(fig9.PARAMETERS) == {"Omega": 1.15, "D_att": 0.025, "D_rep": 4.0}


def test_cells_are_coloured_by_the_basins_they_are_in(quarters):
    panel = fig9.draw(quarters).axes[0]
    (image,) = panel.images
    assert image.get_extent() == [-5.0, 5.0, -5.0, 5.0]
    colours = np.asarray(image.get_array())
    wanted = [[fig9._NEITHER, fig9._ONE], [fig9._TWO, fig9._BOTH]]
    for row in range(2):
        for column in range(2):
            assert tuple(colours[row, column]) == pytest.approx(to_rgb(wanted[row][column]))
    assert (panel.get_xlabel(), panel.get_ylabel()) == (r"$\bar{q}_1$", r"$\bar{q}_1'$")


def test_cells_without_an_attractor_are_seen_and_named(quarters):
    labels = np.array(quarters["two_modes"].labels)
    labels[0, 0] = 254
    figure = fig9.draw(quarters | {"two_modes": made(labels, 2, **fig9.SECOND)})
    assert tuple(np.asarray(figure.axes[0].images[0].get_array())[0, 0]) == pytest.approx(to_rgb(fig9._UNCERTAIN))
    assert "no attractor found" in {text.get_text() for text in figure.legends[0].get_texts()}
    usual = {text.get_text() for text in fig9.draw(quarters).legends[0].get_texts()}
    assert "no attractor found" not in usual
    assert {"both", "one mode alone", "two modes alone", "neither", "repulsive orbit, one mode"} <= usual


def test_panels_are_lettered_and_tell_the_repulsive_part(quarters):
    titles = [(ax.get_title(loc="left"), ax.get_title(loc="right")) for ax in fig9.draw(quarters).axes]
    assert titles == [
        ("(a)", "basins of the repulsive motion"),
        ("(b)", "one mode: 50.0 %"),
        ("(c)", "two modes: 50.0 %"),
    ]


@pytest.mark.parametrize("resolution", [1, 2.5, True])
def test_a_resolution_that_cannot_be_is_told(tmp_path, resolution):
    with pytest.raises(InputError, match=f"resolution = {resolution}: must be an integer >= 2"):
        fig9.run(tmp_path, resolution=resolution)


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    said = []
    return runner("fig9")(tmp_path_factory.mktemp("fig9"), said.append, resolution=RESOLUTION) | {"said": said}


@pytest.fixture(scope="module")
def content(found):
    return json.loads((found["files"][0].parent / "fig9.json").read_text())


@pytest.mark.thorough
class TestWhole:
    """The figure with few cells, some 15 s."""

    def test_all_files_are_written(self, found):
        assert [path.name for path in found["files"]] == ["fig9.nc", "fig9.zarr", "fig9.json", "fig9.png", "fig9.pdf"]
        assert all(path.exists() for path in found["files"])

    def test_the_attractor_of_two_modes_is_the_paper_s(self, content):
        """The paper's (q2, q2') at phase 0; the difference comes from the rounding of its Table 1."""
        (state,) = content["two_modes"]["attractors"]["repulsive"]["states"]
        assert state["q2"] == pytest.approx(-0.028993, abs=6e-4)
        assert state["v2"] == pytest.approx(0.485640, abs=1.6e-3)

    def test_each_number_of_modes_has_its_own_two_stable_attractors(self, content):
        for name, modes in (("one_mode", 1), ("two_modes", 2)):
            attractors = content[name]["attractors"]
            assert list(attractors) == ["attractive", "repulsive"]
            for attractor in attractors.values():
                assert attractor["kind"] == "period-1"
                assert len(attractor["multipliers"]) == 2 * modes
                assert max(np.hypot(*mu) for mu in attractor["multipliers"]) < 1.0
            touches = {regime: len(attractors[regime]["signature"]) > 1 for regime in attractors}
            assert touches == {"attractive": False, "repulsive": True}

    def test_parts_are_those_of_the_labels_and_add_up(self, found, content):
        for name in ("one_mode", "two_modes"):
            parts, labels = content[name]["fractions"], np.asarray(load(found["files"][1] / name).labels)
            assert sum(parts.values()) == pytest.approx(1.0)
            assert parts["repulsive"] == pytest.approx((labels == 1).mean())
            assert content[name]["undecided"] == (labels == 254).sum() == 0
            assert content[name]["orbits_per_second"] > 0.0
            error = content[name]["label_error"]
            assert (error["wrong"], error["cells"]) == (0, 500)
            assert (error["wrong_by_events"], error["cells_by_events"]) == (0, 50)
            assert "theorem" in content[name]["traps"]["attractive"]
            assert "measured" in content[name]["traps"]["repulsive"]

    def test_a_few_cells_end_where_the_event_driven_flow_takes_them(self, found):
        """The oracle settles for 300 periods at a tolerance of 1e-10, and looks whether the tip still touches."""
        from saltus import simulate

        basins = found["results"]["one_mode"]
        labels = np.asarray(basins.labels)
        for i, j in np.random.default_rng(3).integers(0, RESOLUTION, (6, 2)):
            start = [basins.grid.axes[0][i], basins.grid.axes[1][j]]
            motion = simulate(basins.attractors.system, fig9.PARAMETERS, start, periods=300, tolerance=(1e-10, 1e-10))
            last = motion.events["time"] > motion.t_end - 2.0 * motion.t_end / 300.0
            touched = bool(np.any(motion.events["kind"][last] == "event"))
            assert labels[i, j] == int(touched), (i, j)

    def test_the_orbits_are_read_back(self, found):
        orbits = read_results(found["files"][0])
        assert sorted(orbits) == sorted(
            f"{regime}, {modes}" for regime in ("attractive", "repulsive") for modes in ("1 mode", "2 modes")
        )
        assert orbits["repulsive, 2 modes"].stable

    def test_progress_is_told(self, found):
        assert any(told.text.startswith("two modes") and told.done == told.total == 576 for told in found["said"])
        assert found["said"][-1].text == "drawing"

    def test_a_second_run_takes_the_labels_that_are_there(self, found):
        said = []
        again = fig9.run(found["files"][0].parent, said.append, resolution=RESOLUTION)
        assert {told.text for told in said} == {"preparing the model", "drawing"}
        for name, basins in found["results"].items():
            assert np.array_equal(again["results"][name].labels, basins.labels)

    def test_another_resolution_is_refused_not_to_lose_what_is_there(self, found):
        with pytest.raises(
            InputError, match=r"path = '.*one_mode': must be a new one, or that of the same input; .*24"
        ):
            fig9.run(found["files"][0].parent, resolution=RESOLUTION + 1)
