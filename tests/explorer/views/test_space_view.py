"""Branches and loci over three quantities: places in the cube, their projection, what cannot be shown."""

import numpy as np
import pytest

from saltus.explorer.views.space_view import SpaceView, projected

pytestmark = pytest.mark.usefixtures("heard")


@pytest.fixture
def view(session) -> SpaceView:
    return SpaceView(session, lambda number: "#123456")


def test_a_projection_keeps_lengths_across_the_view():
    turned = projected(np.eye(3), 30.0, 50.0)
    seen = np.array([np.cos(np.radians(50.0)) * np.cos(np.radians(30.0)),
                     np.cos(np.radians(50.0)) * np.sin(np.radians(30.0)), np.sin(np.radians(50.0))])  # fmt: skip
    assert turned @ seen == pytest.approx(0.0)  # the direction of the view is a point
    assert turned @ turned.T == pytest.approx(np.eye(2))


def test_branches_and_loci_fill_the_cube(view, session):
    told = view._tables["curves"].data
    assert {*told["name"]} == {"branch1", "locus1"}
    for axis, name in zip("xyz", ("g", "e", "max_z"), strict=True):
        assert view._axes["xyz".index(axis)].value == name
    view._axes[0].value = "a"
    told = view._tables["curves"].data
    every = {axis: np.concatenate(told[axis]) for axis in "xyz"}
    for values in every.values():
        assert (values.min(), values.max()) == pytest.approx((-1.0, 1.0))
    low, high = (float(text) for text in view._tables["ends"].data["name"][:3:2])
    of_branch = [told["x"][k] for k, name in enumerate(told["name"]) if name == "branch1"]
    values = low + (np.concatenate(of_branch) + 1.0) / 2.0 * (high - low)
    assert values.max() == pytest.approx(session.results["branch1"].values.max(), rel=1e-3)
    assert np.array([told["u"][0], told["v"][0]]) == pytest.approx(
        projected(np.array([told[axis][0] for axis in "xyz"]), -58.0, 24.0)
    )


def test_special_points_have_their_names(view, session):
    names = [p.label for entry in ("branch1", "locus1") for p in session.results[entry].special_points]
    assert view._tables["marks"].data["name"] == names


def test_what_has_no_such_quantity_is_told(view):
    view._axes[2].value = "nothing"
    assert "branch1" in view._text.object
    assert view._tables["curves"].data["x"] == []


def test_hidden_results_are_not_drawn(view, session):
    session.settings.hidden = {"branch1"}
    view.redraw()
    assert {*view._tables["curves"].data["name"]} == {"locus1"}


def boxes_of(view) -> list[tuple[float, float, float, float]]:
    """Return left, right, top and bottom of each label that is written, in pixels; a letter has 6, a line 12."""
    across, down = 600.0 / 3.8, 340.0 / 3.8
    found = []
    for name in ("ends", "marks"):
        told = view._tables[name].data
        columns = (told[key] for key in ("u", "v", "label", "align", "aside", "below"))
        for u, v, label, align, aside, below in zip(*columns, strict=True):
            x, y, wide = (u + 1.9) * across + aside, (1.9 - v) * down + below, 6.0 * len(label)
            left = x if align == "left" else x - wide
            if label:
                found.append((left, left + wide, y - 12.0, y))
    return found


def overlaps(boxes) -> int:
    pairs = ((a, b) for i, a in enumerate(boxes) for b in boxes[:i])
    return sum(a[0] < b[1] and b[0] < a[1] and a[2] < b[3] and b[2] < a[3] for a, b in pairs)


@pytest.mark.parametrize("azimuth", [-58.0, 0.0, 45.0, 90.0, 137.0])
@pytest.mark.parametrize("elevation", [24.0, 0.0, 90.0])
def test_no_label_stands_on_another_from_wherever_space_is_seen(view, azimuth, elevation):
    view._view.data = {"azimuth": [azimuth], "elevation": [elevation]}
    told = view._tables["marks"].data
    places = np.array([told[axis] for axis in "xyz"])
    assert np.array([told["u"], told["v"]]) == pytest.approx(projected(places, azimuth, elevation))
    boxes = boxes_of(view)
    assert len(boxes) > 9  # texts of the axes, and some marks
    assert overlaps(boxes) == 0
