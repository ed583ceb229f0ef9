"""Fig. 10 of the paper: its sections, the files, and the picture."""

from __future__ import annotations

import json

import matplotlib

matplotlib.use("Agg")

import numpy as np
import pytest

import saltus.basins.map.grid
from basin_sections import made
from saltus.afm.paper.figures import fig10, runner

pytestmark = pytest.mark.campaign  # the whole figure

RESOLUTION = 10


def _section(q2: float, part: float):
    labels = np.zeros((10, 10))
    labels[: round(10 * part)] = 1
    return made(labels, 2, q2=q2, v2=fig10.V2)


def test_sections_are_the_paper_s():
    assert fig10.SECTIONS == (-4.39, -2.89, -1.39, 0.11, 1.61, 3.12)
    assert fig10.V2 == 0.485640


def test_panels_tell_the_section_and_the_repulsive_part():
    sections = {f"q2={q2}": _section(q2, 0.1 * (3 + k)) for k, q2 in enumerate(fig10.SECTIONS)}
    figure = fig10.draw(sections)
    assert [ax.get_title(loc="left") for ax in figure.axes] == [f"({letter})" for letter in "abcdef"]
    titles = [ax.get_title(loc="right") for ax in figure.axes]
    assert titles[0] == r"$\bar{q}_2$ = −4.39:  30.0 %"
    assert titles[5] == r"$\bar{q}_2$ = 3.12:  80.0 %"
    assert [ax.get_ylabel() for ax in figure.axes] == [r"$\bar{q}_1'$", "", "", r"$\bar{q}_1'$", "", ""]
    for ax in figure.axes:
        assert ax.images[0].get_extent() == [-5.0, 5.0, -5.0, 5.0]
        assert ax.get_aspect() == 1.0


def test_undecided_cells_are_named_only_where_there_are_some():
    sections = {f"q2={q2}": _section(q2, 0.5) for q2 in fig10.SECTIONS}
    texts = [text.get_text() for text in fig10.draw(sections).legends[0].get_texts()]
    assert texts == [
        "repulsive basin", "attractive basin", "repulsive orbit, projected", "attractive orbit, projected",
    ]  # fmt: skip
    labels = np.array(sections["q2=0.11"].labels)
    labels[0, 0] = 254
    lost = fig10.draw(sections | {"q2=0.11": made(labels, 2, q2=0.11, v2=fig10.V2)})
    assert "undecided" in [text.get_text() for text in lost.legends[0].get_texts()]


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    return runner("fig10")(tmp_path_factory.mktemp("fig10"), resolution=RESOLUTION)


@pytest.mark.thorough
class TestWhole:
    """The figure with few cells, some 10 s."""

    def test_the_sections_have_their_parts(self, found):
        content = json.loads(found["files"][2].read_text())
        assert [section["q2"] for section in content["sections"]] == list(fig10.SECTIONS)
        for section, basins in zip(content["sections"], found["results"].values(), strict=True):
            labels = np.asarray(basins.labels)
            assert section["fractions"]["repulsive"] == pytest.approx((labels == 1).mean())
            assert content["repulsive"][f"{section['q2']:g}"] == section["fractions"]["repulsive"]
            assert section["grid"]["v2"] == fig10.V2
            assert (section["label_error"]["wrong"], section["label_error"]["cells"]) == (0, 100)
        assert content["undecided"] == 0
        assert content["orbits_per_second"] > 0.0
        assert list(content["attractors"]) == ["attractive", "repulsive"]
        assert list(content["traps"]) == ["attractive", "repulsive"]

    def test_stores_lie_in_one_group(self, found):
        import zarr

        group = zarr.open_group(found["files"][1], mode="r")
        assert sorted(group.group_keys()) == sorted(f"q2={q2}" for q2 in fig10.SECTIONS)

    def test_an_interrupted_figure_keeps_its_sections_and_goes_on(self, found, tmp_path, monkeypatch):
        monkeypatch.setattr(saltus.basins.map.grid, "_LEAST", 30)
        monkeypatch.setattr(saltus.basins.map.grid, "_CHUNK", 15)

        def interrupt(progress):
            if progress.text.startswith("q2 = -1.39"):
                raise KeyboardInterrupt

        part = fig10.run(tmp_path, interrupt, resolution=RESOLUTION)
        assert part["interrupted"]
        assert list(part["results"])[:2] == ["q2=-4.39", "q2=-2.89"]
        assert not (tmp_path / "fig10.png").exists()
        whole = fig10.run(tmp_path, resolution=RESOLUTION)
        assert not whole["interrupted"]
        for name, basins in found["results"].items():
            assert np.array_equal(whole["results"][name].labels, basins.labels)
