"""The diagram: what is drawn, which solution a click takes, which names are written."""

import numpy as np
import pytest

from saltus.explorer import look
from saltus.explorer.diagram_view import DiagramView
from saltus.explorer.steps import Place
from saltus.plotting import style

pytestmark = pytest.mark.usefixtures("heard")


@pytest.fixture
def chosen() -> list[Place]:
    return []


@pytest.fixture
def lines() -> list[str]:
    return []


@pytest.fixture
def view(session, chosen, lines) -> DiagramView:
    session.settings.axes = ("a", "max_z")
    return DiagramView(session, chosen.append, lines.append)


def data(view: DiagramView, name: str) -> dict:
    """Return what a glyph draws."""
    return view._sources[name].data


def place_of(view: DiagramView, name: str, number: int) -> tuple[float, float]:
    """Return where a point or a mark is."""
    return data(view, name)["x"][number], data(view, name)["y"][number]


def test_the_first_axes_are_a_parameter_and_an_extreme(empty, chosen, lines):
    view = DiagramView(empty, chosen.append, lines.append)
    assert view.axes == empty.settings.axes == ("g", "max_z")
    assert all(not any(columns.values()) for columns in (data(view, name) for name in view._sources))


def test_every_point_of_a_branch_can_be_taken(view, session):
    points, branch = data(view, "points"), session.results["branch1"]
    mine = [i for i, of in enumerate(points["of"]) if of == "branch1"]
    assert [points["index"][i] for i in mine] == [*range(len(branch))]
    assert [points["x"][i] for i in mine] == branch.values.tolist()
    assert [points["told"][i] == "stable" for i in mine] == branch.stable.tolist()


def test_strands_have_the_colour_of_their_result_and_a_dash_for_their_kind(view, session):
    strands = data(view, "strands")
    number = [entry.name for entry in session.entries].index("branch1")
    colours = {colour for colour, name in zip(strands["colour"], strands["name"], strict=True) if name == "branch1"}
    assert colours <= {look.CURVES[number], "#999999"}
    locus = {colour for colour, name in zip(strands["colour"], strands["name"], strict=True) if name == "locus1"}
    assert locus <= {style.SPECIAL["SN"].colour, "#999999"}


def test_marks_have_the_form_of_the_pictures(view, session):
    marks, forms = data(view, "marks"), style.SPECIAL
    for told, of, marker, colour in zip(*(marks[key] for key in ("told", "of", "marker", "colour")), strict=True):
        form = forms[session.results[of][told].type]
        assert (marker, colour) == (look.MARKERS[form.marker], form.colour)


def test_a_sweep_is_dots_and_a_motion_is_nothing(view, session):
    view.set_axes("a", "z")
    view.redraw()
    assert sorted(set(data(view, "dots")["x"])) == [1.15, 1.2]
    assert "motion1" not in data(view, "points")["of"]
    session.settings.hidden.add("sweep1")
    view.redraw()
    assert data(view, "dots")["x"] == []


def test_a_click_takes_the_nearest_point(view, chosen, session):
    number = len(session.results["branch1"]) // 2
    at = data(view, "points")["index"].index(number, 1)
    x, y = place_of(view, "points", at)
    near = [abs(x - other) for other in data(view, "marks")["x"]]
    assert min(near) > 0.0
    view._clicked(x, y)
    (place,) = chosen
    assert place.of == "branch1"
    assert place.index == number or place.label is not None  # a special point next to it comes first


def test_special_points_come_before_others(view, chosen):
    number = [
        (of, told) for of, told in zip(data(view, "marks")["of"], data(view, "marks")["told"], strict=True)
    ].index(("branch1", "SN1"))
    view._clicked(*place_of(view, "marks", number))
    assert chosen == [Place(of="branch1", label="SN1")]


def test_an_orbit_alone_is_taken_as_it_is(empty, taken_steps, chosen, lines):
    empty.add(taken_steps[0]["orbit1"], taken_steps[1]["orbit1"])
    empty.settings.axes = ("a", "max_z")
    view = DiagramView(empty, chosen.append, lines.append)
    view._clicked(*place_of(view, "points", 0))
    assert chosen == [Place(of="orbit1")]


def test_a_click_into_the_void_takes_nothing(view, chosen):
    view._clicked(view.figure.x_range.end + 10.0, view.figure.y_range.end + 10.0)
    assert chosen == []


def test_a_cascade_is_marked_but_not_taken(empty, taken_steps, chosen, lines, monkeypatch):
    from saltus.explorer.steps import Cascade

    class Two:
        points = ()

    monkeypatch.setattr("saltus.explorer.diagram_view.drawn", lambda result, axes: doubled)
    from saltus.explorer.drawing import Drawn, Mark

    doubled = Drawn(marks=(Mark("PD", "PD1", 1.0, 2.0),))
    empty.add(Cascade(place=Place(of="branch1", label="PD1"), bounds=(0.9, 1.8)), Two())
    view = DiagramView(empty, chosen.append, lines.append)
    assert data(view, "marks")["told"] == ["PD1"]
    view._clicked(1.0, 2.0)
    assert chosen == []


def test_the_ring_is_about_what_is_selected(view, session):
    session.settings.selected = Place(of="branch1", label="SN1")
    view.mark_chosen()
    exact = session.results["branch1"]["SN1"].parameters["a"]
    assert data(view, "chosen")["x"] == pytest.approx([exact], rel=1e-12)
    session.settings.selected = Place(of="branch1", index=2)
    view.mark_chosen()
    assert data(view, "chosen")["x"] == [session.results["branch1"].values[2]]
    session.settings.hidden.add("branch1")
    view.mark_chosen()
    assert data(view, "chosen")["x"] == []


def test_other_axes_draw_anew_and_are_kept(view, session, lines):
    view._axes[1].value = "period"
    assert session.settings.axes == ("a", "period")
    mine = [y for y, of in zip(data(view, "points")["y"], data(view, "points")["of"], strict=True) if of == "branch1"]
    assert mine == session.results["branch1"].period.tolist()
    assert view.figure.yaxis[0].axis_label == "period"
    assert lines == [""]
    assert "sweep1" in view.unseen


def test_axes_on_which_nothing_can_be_drawn_are_told(view, session, lines):
    view._axes[1].value = "nothing"
    assert set(view.unseen) >= {"branch1", "orbit1"}
    session.entries[:] = session.entries[:2]
    view._axes[1].value = "nothing at all"
    assert lines[-1]


def test_a_locus_asks_for_its_axes(view, session):
    view.set_axes("a", "e")
    view.redraw()
    assert view.axes == ("a", "e")
    xs, ys = (np.concatenate(data(view, "strands")[axis]) for axis in ("xs", "ys"))
    over = np.flatnonzero(ys > 0.51)
    assert xs[over] == pytest.approx(np.pi * (1.0 - ys[over]) / (1.0 + ys[over]), rel=3e-4)  # the closed form


def test_names_of_marks_that_are_close_share_a_place(view):
    marks = {
        "x": [0.0, 1e-9, 0.0, 0.0, 2e-9, 1.0],
        "y": [0.0] * 6,
        "told": ["SN1", "SN2", "SN3", "SN4", "SN5", "PD1"],
        "label": [""] * 6,
    }
    view._name_marks(marks)
    assert marks["label"] == ["SN1 + 4", "", "", "", "", "PD1"]
    two = {"x": [0.0, 0.0], "y": [0.0, 0.0], "told": ["SN1", "PD1"], "label": ["", ""]}
    view._name_marks(two)
    assert two["label"] == ["SN1 PD1", ""]


def test_colours_begin_again(view):
    assert view.colour(0) == view.colour(len(look.CURVES)) != view.colour(1)
