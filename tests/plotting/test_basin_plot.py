"""Pictures of basins: where each cell is, its colour, its part, and the attractors."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.colors import to_rgb

from saltus.basins import Basins, Grid, Plane
from saltus.basins.map.outcomes import Outcomes
from saltus.errors import InputError
from saltus.plotting.basin import colours_of, percent, places_of

LABELS = {"rest": 0, "swing": 1, "diverged": 253, "undecided": 254}


def _basins(labels, grid, points=None) -> Basins:
    return Basins(np.asarray(labels, np.uint8), grid, Outcomes(LABELS, points or {}))


@pytest.fixture
def plane() -> Basins:
    """Three cells of q by two of v, each coordinate with cells of its own size; one cell of 'swing', at the right."""
    grid = Grid(("q", "v", "w"), {"q": (0.0, 6.0, 3), "v": (-1.0, 1.0, 2), "w": 0.25})
    points = {"rest": np.array([[1.0, 0.5, 0.25]]), "swing": np.array([[5.0, -0.5, 2.0]])}
    return _basins([[0, 0], [0, 0], [1, 0]], grid, points)


def test_a_cell_has_its_true_extent_and_its_label_s_colour(plane):
    ax = plane.plot()
    (image,) = ax.images
    assert image.get_extent() == [0.0, 6.0, -1.0, 1.0]
    assert image.origin == "lower"
    colours = np.asarray(image.get_array()) / 255.0
    swing, rest = (to_rgb(colours_of(plane)[name]) for name in ("swing", "rest"))
    assert colours.shape == (2, 3, 3)
    assert colours[0, 2] == pytest.approx(swing)
    assert colours[1, 2] == pytest.approx(rest)
    assert colours[:, :2] == pytest.approx(np.broadcast_to(rest, (2, 2, 3)))


def test_axes_are_named_after_the_coordinates_in_the_order_asked_for(plane):
    ax = plane.plot()
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("$q$", "$v$")
    turned = plane.plot("v", "q")
    assert (turned.get_xlabel(), turned.get_ylabel()) == ("$v$", "$q$")
    assert turned.images[0].get_extent() == [-1.0, 1.0, 0.0, 6.0]
    assert np.array_equal(turned.images[0].get_array(), np.swapaxes(ax.images[0].get_array(), 0, 1))
    assert plane.plot(y="q").get_xlabel() == "$v$"


def test_a_new_figure_tells_what_is_frozen(plane):
    from matplotlib.figure import Figure

    assert plane.plot().get_title(loc="right") == "$w$ = 0.25"
    assert plane.plot(ax=Figure().subplots()).get_title(loc="right") == ""


def test_the_legend_has_each_label_s_part_of_the_cells(plane):
    texts = [text.get_text() for text in plane.plot().get_legend().get_texts()]
    assert texts == ["rest  83.3 %", "swing  16.7 %", "attractor", "attractor, projected"]
    assert plane.plot(legend=False).get_legend() is None


def test_cells_without_an_attractor_have_colours_of_their_own_and_are_named():
    grid = Grid(("q", "v"), {"q": (0.0, 1.0, 2), "v": (0.0, 1.0, 2)})
    basins = _basins([[0, 253], [254, 255]], grid)
    ax = basins.plot()
    colours = {tuple(colour) for colour in np.asarray(ax.images[0].get_array()).reshape(-1, 3).tolist()}
    assert len(colours) == 4
    texts = [text.get_text() for text in ax.get_legend().get_texts()]
    assert texts == ["rest  25.0 %", "swing  0 %", "diverged  25.0 %", "undecided  25.0 %", "not done  25.0 %"]


def test_an_attractor_in_the_plane_is_filled_and_one_beside_it_open(plane):
    filled, opened = plane.plot().lines
    assert filled.get_xydata().tolist() == [[1.0, 0.5]]
    assert opened.get_xydata() == pytest.approx(np.array([[5.0, -0.5]]))
    assert opened.get_markerfacecolor() == "white" != filled.get_markerfacecolor()


def test_a_point_half_a_cell_beside_the_plane_is_in_it():
    grid = Grid(("q", "v"), {"q": (0.0, 1.0, 10), "v": 0.0})
    points = {"rest": np.array([[0.5, 0.049], [0.5, 0.051]])}
    places, within = places_of(_basins(np.zeros(10), grid, points), "rest")
    assert places.tolist() == [[0.5], [0.5]]
    assert within.tolist() == [True, False]


def test_a_point_is_projected_onto_an_oblique_plane_at_right_angles():
    plane = Plane(
        {"q": 0.0, "v": 0.0, "w": 1.0}, {"q": 0.6, "v": 0.8}, {"w": 1.0}, ((-2, 2), (-2, 2)), (4, 4), ("a", "b")
    )
    on, off = np.array([0.6, 0.8, 1.5]), np.array([-0.8, 0.6, 0.0])
    basins = _basins(np.zeros((4, 4)), Grid(("q", "v", "w"), plane), {"rest": np.array([on, on + off])})
    places, within = places_of(basins, "rest")
    assert places == pytest.approx(np.array([[1.0, 0.5], [1.0, 0.5]]))
    assert within.tolist() == [True, False]
    ax = basins.plot()
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("$a$", "$b$")


def test_a_line_of_cells_is_a_band():
    basins = _basins([0, 0, 1, 1], Grid(("q", "v"), {"q": (0.0, 4.0, 4), "v": 0.0}), {"rest": np.array([[1.0, 0.0]])})
    ax = basins.plot()
    assert ax.images[0].get_extent() == [0.0, 4.0, 0.0, 1.0]
    assert ax.images[0].get_array().shape == (1, 4, 3)
    assert ax.get_yticks().size == 0
    assert ax.lines[0].get_xydata().tolist() == [[1.0, 0.5]]


def test_chosen_colours_replace_the_usual_ones(plane):
    image = plane.plot(colours={"swing": "#102030"}).images[0].get_array()
    assert image[0, 2].tolist() == [16, 32, 48]


def test_attractors_of_many_points_have_smaller_marks(plane):
    cloud = np.column_stack([np.linspace(0.0, 6.0, 50), np.zeros(50), np.full(50, 0.25)])
    few, many = (_basins(plane.labels, plane.grid, {"rest": cloud[:n]}).plot().lines[0] for n in (3, 50))
    assert many.get_markersize() < few.get_markersize()


def test_three_free_coordinates_are_answered_with_section():
    basins = _basins(np.zeros((2, 2, 2)), Grid(("q", "v", "w"), dict.fromkeys("qvw", (0.0, 1.0, 2))))
    with pytest.raises(InputError) as raised:
        basins.plot()
    assert str(raised.value) == (
        "free coordinates = 'q, v, w': must be one or two for a picture; take a section: basins.section(w=...).plot()"
    )
    assert basins.section(w=0.3).plot().images


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"x": "z"}, "coordinate = 'z': must be a free one: q, v"),
        ({"x": "w"}, "coordinate = 'w': must be a free one: q, v"),
        ({"x": "q", "y": "q"}, "y = 'q': must be another coordinate than x"),
        ({"colours": {"swin": "red"}}, "colours = 'swin': must be one of rest, swing, diverged, undecided, not done; "
         "did you mean 'swing'?"),
    ],
)  # fmt: skip
def test_a_name_that_is_not_there_is_told(plane, options, message):
    with pytest.raises(InputError) as raised:
        plane.plot(**options)
    assert str(raised.value) == message


def test_small_parts_keep_a_digit_and_none_is_rounded_to_all():
    assert [percent(part) for part in (0.0, 1.0, 0.5, 1e-5, 0.99999)] == [
        "0 %",
        "100 %",
        "50.0 %",
        "0.001 %",
        "99.999 %",
    ]


def test_names_that_look_like_mathematics_are_shown_as_they_are():
    basins = Basins.from_array([0, 1], {"x": np.arange(2.0)}, {r"$\frac$": 0, "1$ or 2$": 1})
    ax = basins.plot()
    ax.figure.canvas.draw()
    shown = [text.get_text() for text in ax.get_legend().get_texts()]
    assert shown[0].startswith(r"\$\frac\$")
    assert shown[1].startswith(r"1\$ or 2\$")


def test_no_two_of_thirty_two_attractors_have_one_colour():
    axes = {"q": np.arange(32.0), "v": np.arange(2.0)}
    names = {f"period-1 {i}": i for i in range(32)}
    many = Basins.from_array(np.repeat(np.arange(32)[:, None], 2, axis=1), axes, names)
    shown = {tuple(np.round(255.0 * np.array(to_rgb(colour)))) for colour in colours_of(many).values()}
    assert len(shown) == 32 + 3  # with those of cells without a basin
