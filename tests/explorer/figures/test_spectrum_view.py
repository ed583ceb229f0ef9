"""Multipliers about the unit circle, eigenvalues beside the imaginary axis, and arrows to those far away."""

import numpy as np
import pytest

from saltus.explorer.figures.spectrum_view import SpectrumView, far_from
from saltus.explorer.solutions import Traits, traits_of

pytestmark = pytest.mark.usefixtures("heard")


def shown(what: str, *values: complex) -> SpectrumView:
    view = SpectrumView()
    view.show(Traits(what, "Floquet multipliers", np.array(values, complex), circle=what == "orbit"))
    return view


def test_multipliers_lie_about_the_unit_circle(results):
    view, found = SpectrumView(), results["orbit1"].multipliers
    view.show(traits_of(results["orbit1"]))
    assert view.figure.title.text == "Floquet multipliers"
    assert np.array_equal(view.values.data["x"], found.real)
    assert view.figure.x_range.end == view.figure.y_range.end == -view.figure.x_range.start
    assert np.hypot(view._border.data["x"], view._border.data["y"]) == pytest.approx(1.0)
    assert view.numbers.object.count("|·|") == len(found)
    assert view.arrows.data["x"] == []


def test_the_figure_is_square_so_that_the_circle_is_one():
    made = SpectrumView().figure
    assert made.frame_width == made.frame_height


def test_a_multiplier_of_1e15_leaves_the_circle_as_large_as_it_was():
    view = shown("orbit", 1.0, -0.5, 2.5e15, -7e9)
    assert view.values.data["x"] == [1.0, -0.5]
    assert view.figure.x_range.end < 2.0
    arrows = view.arrows.data
    assert arrows["text"] == ["2.5e15", "−7e9"]
    assert (arrows["x"][0] > 1.0, arrows["x"][1] < -1.0) == (True, True)
    assert max(np.abs(arrows["x"])) < view.figure.x_range.end
    assert arrows["align"] == ["right", "left"]  # within the frame
    assert view.figure.title.text == "Floquet multipliers; arrows lead outside"


def test_numbers_of_arrows_to_one_side_stand_below_each_other():
    arrows = shown("orbit", 1e8, 1e9, np.inf).arrows.data
    assert arrows["text"] == ["infinite", "1e9", "1e8"]
    assert arrows["below"] == [0, 15, 30]


def test_eigenvalues_have_the_imaginary_axis_and_a_scale_of_their_own():
    view = shown("equilibrium", -0.25 + 1j, -0.25 - 1j)
    assert set(view._border.data["x"]) == {0.0}
    assert view.figure.y_range.end == pytest.approx(1.35)
    assert far_from(np.array([-1e-3, -1.0 + 0j]), circle=False).tolist() == [False, True]
    assert not far_from(np.array([0.0, 3.0 + 0j]), circle=False).any()


def test_nothing_is_shown_of_nothing():
    view = SpectrumView()
    view.show(Traits())
    assert (view.values.data["x"], view.arrows.data["x"], view.numbers.object) == ([], [], "")
