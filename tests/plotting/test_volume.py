"""Pictures of basins in space; where there is nothing to render with, only what needs no renderer is tested."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from saltus.basins import Basins, Grid
from saltus.basins.map.outcomes import Outcomes
from saltus.errors import InputError, SaltusError
from saltus.plotting import volume
from saltus.plotting.volume import Volume, check_renderer

LABELS = {"rest": 0, "swing": 1, "diverged": 253, "undecided": 254}


def _can_render() -> bool:
    try:
        check_renderer()
    except SaltusError:
        return False
    return True


needs_renderer = pytest.mark.skipif(not _can_render(), reason="no PyVista, or neither a display nor EGL")


def _basins(labels, points=None, ranges=((-1.0, 1.0), (-1.0, 1.0), (-1.0, 1.0))) -> Basins:
    axes = {name: (*ends, n) for name, ends, n in zip("qvw", ranges, labels.shape, strict=True)}
    return Basins(labels.astype(np.uint8), Grid(("q", "v", "w"), axes), Outcomes(LABELS, points or {}))


def _ball(n: int, radius: float, **options) -> Basins:
    x = (np.arange(n) + 0.5) * 2.0 / n - 1.0
    squares = np.add.outer(np.add.outer(x**2, x**2), x**2)
    return _basins(squares < radius**2, **options)


@needs_renderer
def test_a_ball_s_body_has_the_volume_and_the_extent_of_a_ball():
    body = Volume(_ball(60, 0.6), "swing").body
    assert body.volume == pytest.approx(4.0 / 3.0 * np.pi * 0.6**3, rel=0.02)
    assert np.abs(body.points).max() == pytest.approx(0.6, abs=1.0 / 60)


@needs_renderer
def test_means_over_blocks_keep_the_volume(monkeypatch):
    """Smoothing by s shrinks a ball of radius r by s^2 / r: here by 0.2 % of it."""
    monkeypatch.setattr(volume, "_BLOCKS", 50)
    monkeypatch.setattr(volume, "_SLAB", 7)
    found = Volume(_ball(100, 0.6), "swing")
    assert found.body.volume == pytest.approx(4.0 / 3.0 * np.pi * 0.6**3, rel=0.02)
    labels = np.asarray(found.basins.labels)
    assert float(found._means().mean()) == pytest.approx(float(labels.mean()), rel=1e-6)


@needs_renderer
@pytest.mark.parametrize("blocks", [200, 4])
def test_a_basin_that_fills_the_box_is_the_box(blocks, monkeypatch):
    """Also where the last block of an axis has fewer cells than the others."""
    monkeypatch.setattr(volume, "_BLOCKS", blocks)
    body = Volume(_basins(np.ones((9, 11, 10))), "swing").body
    assert body.bounds == pytest.approx((-1.0, 1.0) * 3, abs=1e-6)


@needs_renderer
def test_a_cut_body_ends_at_the_middle_of_the_section_s_cells():
    found = Volume(_ball(60, 0.6), "swing", cut=("w", 0.1))
    (cell,) = found.basins.grid.nearest({"w": 0.1}).values()
    height = found.basins.grid.axes[2][cell]
    assert found.body.points[:, 2].max() == pytest.approx(height, abs=1e-6)


@needs_renderer
def test_a_hollow_body_has_no_faces_at_the_sides_of_the_box():
    half = _basins(np.broadcast_to(np.arange(20)[:, None, None] < 10, (20, 20, 20)))
    assert np.abs(Volume(half, "swing", hollow=True).body.points[:, 0]).max() < 0.1
    assert np.abs(Volume(half, "swing").body.points[:, 0]).max() == pytest.approx(1.0, abs=1e-6)


def _where(image, colour):
    """The middle of what has a colour, about, in the picture [-1, 1], upwards."""
    rows, columns = np.nonzero(np.abs(image.astype(int) - np.array(colour)).max(axis=-1) < 40)
    assert rows.size
    size = len(image)
    return np.array([2.0 * columns.mean() / size - 1.0, 1.0 - 2.0 * rows.mean() / size])


@needs_renderer
@pytest.mark.campaign
def test_the_section_is_seen_where_its_cells_are():
    """A block of another label at the corner of low q and high v, seen from above and through the projection."""
    labels = np.zeros((20, 20, 20))
    labels[:6, 14:, :] = 1
    found = Volume(_basins(labels), "rest", cut=("w", 0.0), colours={"rest": "#808080", "swing": "#ff0000"})
    for azimuth in (-60.0, 30.0, 170.0):
        image = found.render(azimuth, 40.0, 300)
        middle = np.array([[-0.7, 0.7, found._height]])
        assert _where(image, (255, 0, 0)) == pytest.approx(volume._View(azimuth, 40.0).of(middle)[0], abs=0.03)


@needs_renderer
def test_attractors_are_seen_where_they_are_in_front_of_everything():
    """The inside of a full box would hide it."""
    place = np.array([[12.0, 0.5, -0.25]])
    ranges = ((10.0, 20.0), (0.0, 2.0), (-1.0, 0.0))
    full = _basins(np.zeros((8, 8, 8)), {"rest": place}, ranges)
    image = Volume(full, "rest", colours={"rest": "#ffffff"}, marks={"rest": "#0000ff"}).render(-58.0, 26.0, 300)
    blue = image[..., 2].astype(int) - image[..., 0]
    rows, columns = np.nonzero(blue > 60)
    seen = 2.0 * columns.mean() / 300 - 1.0, 1.0 - 2.0 * rows.mean() / 300
    assert seen == pytest.approx(tuple(volume._View(-58.0, 26.0).of(np.array([[-0.6, -0.5, 0.5]]))[0]), abs=0.02)


@needs_renderer
def test_ticks_are_at_their_values_and_coordinates_have_names():
    ax = Volume(_ball(10, 0.6, ranges=((0.0, 4.0), (-1.0, 1.0), (-1.0, 1.0))), "swing").draw(pixels=100)
    texts = {text.get_text(): text.get_position() for text in ax.texts}
    assert {"$q$", "$v$", "$w$", "0", "2", "4", "−0.5"} <= set(texts)
    view = volume._View(-58.0, 26.0)
    edge, outward = view.edge(0)
    assert edge.tolist() == [0.0, -1.0, -1.0]
    assert texts["2"] == pytest.approx(tuple(view.of((edge + volume._TICK_LABEL * outward)[None])[0]))
    named = Volume(_ball(10, 0.6), "swing").draw(pixels=100, names={"q": "displacement"})
    assert "displacement" in {text.get_text() for text in named.texts}


@needs_renderer
@pytest.mark.campaign
def test_an_edge_that_is_seen_end_on_has_a_name_but_no_ticks():
    texts = [text.get_text() for text in Volume(_ball(10, 0.6), "swing").draw(azimuth=1.0, elevation=5.0).texts]
    assert {"$q$", "$v$", "$w$"} <= set(texts)
    assert texts.count("0.5") == 2


@needs_renderer
def test_the_window_of_a_film_does_not_move():
    found = Volume(_ball(10, 0.6), "swing")
    windows = [found.draw(azimuth=a, pixels=50, turning=True).axis() for a in (0.0, 47.0, 200.0)]
    assert windows[0] == windows[1] == windows[2]


@needs_renderer
def test_a_basin_without_cells_is_an_empty_box():
    assert Volume(_basins(np.zeros((4, 4, 4))), "swing").render(-58.0, 26.0, 60).shape == (60, 60, 3)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"name": "swin"}, "basin = 'swin': must be one of rest, swing, diverged, undecided; did you mean 'swing'?"),
        ({"cut": ("z", 0.0)}, "coordinate = 'z': must be a free coordinate: q, v, w"),
        ({"cut": ("w", 3.0)}, "w = 3.0: must be between -1 and 1"),
    ],
)
@needs_renderer
def test_what_is_not_there_is_told(options, message):
    with pytest.raises(InputError) as raised:
        Volume(_ball(4, 0.6), **{"name": "swing", **options})
    assert str(raised.value) == message


def test_a_plane_is_no_space():
    grid = Grid(("q", "v"), {"q": (0.0, 1.0, 2), "v": (0.0, 1.0, 2)})
    with pytest.raises(InputError, match="free coordinates = 'q, v': must be three for a picture in space"):
        Volume(Basins(np.zeros((2, 2), np.uint8), grid, Outcomes(LABELS)), "rest")


def test_a_missing_pyvista_is_told(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyvista", None)
    with pytest.raises(SaltusError, match=r'pictures in space need PyVista: pip install "saltus\[3d\]"'):
        check_renderer()


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="EGL is for Linux")
def test_a_missing_egl_is_told_where_there_is_no_display(monkeypatch):
    pytest.importorskip("pyvista")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.setattr("ctypes.util.find_library", lambda name: None)
    with pytest.raises(SaltusError, match="apt install libegl1 libgl1-mesa-dri"):
        check_renderer()
