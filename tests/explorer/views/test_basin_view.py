"""Basins over a plane: where it lies, what is asked for, which motion a click runs."""

import numpy as np
import pytest

from saltus.basins import Basins, Grid
from saltus.basins.map.outcomes import Outcomes
from saltus.explorer.views.basin_view import BasinView

pytestmark = pytest.mark.usefixtures("heard")

LABELS = {"low": 0, "high": 1, "diverged": 253, "undecided": 254}


@pytest.fixture
def asked() -> list:
    return []


@pytest.fixture
def view(session, asked) -> BasinView:
    return BasinView(session, lambda *given: asked.append(given), asked.append)


@pytest.fixture
def basins() -> Basins:
    """Return three cells of z by two of v; one of them is high."""
    grid = Grid(("z", "v"), {"z": (0.0, 6.0, 3), "v": (-1.0, 1.0, 2)})
    points = {"low": np.array([[1.0, 0.5]]), "high": np.array([[5.0, -0.5], [3.0, 0.0]])}
    return Basins(np.array([[0, 0], [0, 0], [1, 0]], np.uint8), grid, Outcomes(LABELS, points))


def ends(view) -> list[float]:
    """Return the ranges of both coordinates."""
    return [field.value for field in view._ends]


def test_a_plane_lies_about_the_orbit(view, session):
    assert ends(view) == [-1.0, 1.0, -1.0, 1.0]
    orbit = session.results["orbit1"]
    view.solution_is(orbit)
    wide = orbit.max["z"] - orbit.min["z"]
    assert ends(view)[:2] == pytest.approx([orbit.min["z"] - 0.6 * wide, orbit.max["z"] + 0.6 * wide], rel=1e-3)


def test_a_plane_lies_about_an_equilibrium_as_wide_as_its_states(still):
    view = BasinView(still, print, print)
    view.solution_is(still.results["equilibrium1"])
    assert ends(view) == pytest.approx([1.0 - 1.2, 1.0 + 1.2, 1.5 - 1.8, 1.5 + 1.8])


def test_time_between_looks_is_needed_without_a_drive_only(view, session, still):
    view.solution_is(session.results["orbit1"])
    assert view.interval is None
    at_rest = BasinView(still, print, print)
    assert at_rest.interval == pytest.approx(2.0 * np.pi)
    cycle = still.results["branch2"].solution(5)
    at_rest.solution_is(cycle)
    assert at_rest.interval == cycle.period


def test_a_plane_is_asked_for_coarsely_then_finely(view, session, asked):
    view.solution_is(session.results["orbit1"])
    for field, value in zip(view._ends, (0.0, 2.0, -1.0, 4.0), strict=True):
        field.value = value
    view._cells.value = 200
    view._go()
    assert asked == [({"z": (0.0, 2.0), "v": (-1.0, 4.0)}, {}, (50, 200))]


def test_one_coordinate_twice_is_one_range_and_the_other_is_that_of_the_orbit(view, session, asked):
    view.solution_is(session.results["orbit1"])
    view._pair[1].value = "z"
    view._go()
    ((free, frozen, _),) = asked
    assert list(free) == ["z"]
    assert frozen == {"v": session.results["orbit1"].x0[1]}


def test_attractors_are_sought_in_a_box_of_all_states(view, session):
    view.solution_is(session.results["orbit1"])
    box = view.region({"z": (0.0, 1.0)})
    assert list(box) == ["z", "v"]
    assert box["z"] == (0.0, 1.0)
    assert box["v"][0] < session.results["orbit1"].min["v"]


def test_cells_are_drawn_at_their_true_size_with_the_attractors(view, basins):
    view.show(basins)
    data = view._image.data
    assert [data[side][0] for side in ("x", "y", "dw", "dh")] == pytest.approx([0.0, -1.0, 6.0, 2.0])
    pixels = data["image"][0]
    assert pixels.shape == (2, 3)
    assert len({int(pixel) for pixel in pixels.ravel()}) == 2
    assert (pixels == pixels[0, 2]).sum() == 1  # v upwards from -0.5, z to the right up to 5
    assert view._dots.data["name"] == ["low", "high", "high"]
    assert view._dots.data["x"] == pytest.approx([1.0, 5.0, 3.0])
    assert (view.figure.xaxis[0].axis_label, view.figure.yaxis[0].axis_label) == ("z", "v")


def test_the_legend_has_shares_of_what_occurs(view, basins):
    view.show(basins)
    legend = view._legend.object
    assert "low <b>83" in legend
    assert "high <b>17" in legend.replace("16.7", "17")
    assert "diverged" not in legend
    assert "3 x 2 cells" in legend


def test_a_click_runs_the_motion_from_the_centre_of_its_cell(view, basins, asked):
    view._cell(4.4, -0.9)
    assert asked == []
    view.show(basins)
    view._cell(4.4, -0.9)
    view._cell(-3.0, 9.0)
    assert asked == [[5.0, -0.5], [1.0, 0.5]]


def test_basins_that_are_shown_are_not_drawn_again(view, basins):
    view.show(basins)
    before = view._image.data
    view.show(basins)
    assert view._image.data is before
