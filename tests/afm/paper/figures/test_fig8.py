"""Fig. 8 of the paper: the box, the section that is highlighted, the files, and the film."""

from __future__ import annotations

import json
from dataclasses import asdict

import matplotlib

matplotlib.use("Agg")

import numpy as np
import pytest
from PIL import Image

from basin_sections import made
from saltus import load
from saltus.afm.paper.figures import fig8, runner
from saltus.errors import SaltusError
from saltus.plotting.volume import check_renderer
from selection import THOROUGH


def _can_render() -> bool:
    try:
        check_renderer()
    except SaltusError:
        return False
    return True


pytestmark = [
    *THOROUGH,
    pytest.mark.skipif(not _can_render(), reason="no PyVista, or neither a display nor EGL"),
]

RESOLUTION = 12


@pytest.fixture
def box():
    """The half q1 > 0 of the box is attractive."""
    labels = np.ones((10, 10, 10))
    labels[5:] = 0
    return made(labels, 2, v2=fig8.V2)


def test_both_bodies_are_drawn_with_their_parts_of_the_box(box):
    figure = fig8.draw({"basins": box})
    titles = [(ax.get_title(loc="left"), ax.get_title(loc="center")) for ax in figure.axes]
    assert titles == [("(a)", "repulsive basin: 50.0 % of the box"), ("(b)", "attractive basin: 50.0 % of the box")]
    for ax in figure.axes:
        names = {text.get_text() for text in ax.texts}
        assert {r"$\bar{q}_1$", r"$\bar{q}_1'$", r"$\bar{q}_2$", "−4", "4"} <= names
    legend = [text.get_text() for text in figure.legends[0].get_texts()]
    assert legend[0] == r"repulsive, cut at $\bar{q}_2$ = −0.5"


def test_the_highlighted_section_is_at_the_repulsive_attractor(box):
    assert fig8._height(box) == -0.03


def test_the_film_turns_once(box, tmp_path, monkeypatch):
    monkeypatch.setattr(fig8, "_TURNS", 4)
    said = []
    with Image.open(fig8.film(box, tmp_path / "fig8.gif", said.append)) as film:
        assert film.n_frames == 4
        assert film.info["duration"] == 100
        assert film.info["loop"] == 0
        frames = []
        for index in range(4):
            film.seek(index)
            frames.append(np.asarray(film.convert("RGB")).astype(int))
    changes = [np.abs(a - b).mean() for a, b in zip(frames, frames[1:] + frames[:1], strict=True)]
    assert min(changes) > 1.0
    assert [(told.done, told.total) for told in said] == [(i, 4) for i in range(1, 5)]


def test_an_interrupted_film_keeps_the_figure(box, tmp_path, monkeypatch):
    def stop(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(fig8, "film", stop)
    monkeypatch.setattr(
        fig8, "write_sections", lambda *_, **__: {"files": [], "results": {"basins": box}, "interrupted": False}
    )
    assert fig8.run(tmp_path, animate=True)["interrupted"]


def test_a_missing_renderer_is_told_before_the_work(tmp_path, monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "pyvista", None)
    with pytest.raises(SaltusError, match="pictures in space need PyVista"):
        fig8.run(tmp_path)
    assert not list(tmp_path.iterdir())


def test_all_files_are_written_and_the_section_is_one_of_the_store(tmp_path, monkeypatch):
    monkeypatch.setattr(fig8, "_TURNS", 2)
    found = runner("fig8")(tmp_path, resolution=RESOLUTION, animate=True)
    names = ["fig8.nc", "fig8.zarr", "fig8.json", "fig8.png", "fig8.pdf", "fig8.gif"]
    assert [path.name for path in found["files"]] == names
    content = json.loads((tmp_path / "fig8.json").read_text())
    basins = load(tmp_path / "fig8.zarr")
    labels = np.asarray(basins.labels)
    assert labels.shape == (RESOLUTION,) * 3
    assert basins.grid.names == ("q1", "v1", "q2")
    assert content["grid"]["v2"] == 0.485640
    assert content["fractions"]["repulsive"] == pytest.approx((labels == 1).mean())
    assert content["undecided"] == 0
    assert content["label_error"] == asdict(basins.noted_error)
    middle = RESOLUTION // 2 - 1
    assert content["section"]["q2"] == pytest.approx(basins.grid.axes[2][middle])
    assert content["section"]["fractions"]["repulsive"] == pytest.approx((labels[..., middle] == 1).mean())
