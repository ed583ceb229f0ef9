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
