"""The diagram: what is drawn, which solution a click takes, which names are written."""

import numpy as np
import pytest

from saltus.explorer import colours
from saltus.explorer.drawing import Drawn
from saltus.explorer.steps import Place
from saltus.explorer.views.diagram_view import DiagramView
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
    found = {colour for colour, name in zip(strands["colour"], strands["name"], strict=True) if name == "branch1"}
    assert found <= {colours.CURVES[number], colours.FAULTY}
    locus = {colour for colour, name in zip(strands["colour"], strands["name"], strict=True) if name == "locus1"}
    assert locus <= {style.SPECIAL["SN"].colour, colours.FAULTY}
    assert view.colour(2) == style.SPECIAL["SN"].colour  # as the list of results has it


def test_marks_have_the_form_of_the_pictures(view, session):
    marks, keys = data(view, "marks"), ("told", "of", "marker", "angle", "colour")
    for told, of, *drawn in zip(*(marks[key] for key in keys), strict=True):
        form = colours.form_of(session.results[of][told].type)
        assert drawn == [*colours.MARKERS[form.marker], form.colour]


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

    monkeypatch.setattr("saltus.explorer.views.diagram_view.drawn", lambda result, axes: doubled)
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
        "of": ["branch1"] * 6,
    } | {key: [""] * 6 for key in ("label", "align", "aside", "below")}
    view.figure.x_range.update(start=0.0, end=2.0)
    view.figure.y_range.update(start=-1.0, end=1.0)
    view._name_marks(marks)
    assert marks["label"] == ["SN1, SN2, SN3, SN4, SN5", "", "", "", "", "PD1"]
    marks |= {"x": [0.0] * 5 + [1.9], "of": ["branch1", "branch2"] * 3, "told": ["HB1", "HB1", *"abcd"]}
    view._name_marks(marks)
    assert marks["label"][0] == "branch1 HB1 + 4"  # the branch is named where two have the same label
    assert marks["label"][5] == "d"
    assert marks["align"][5] == "left"
    marks |= {"x": [0.0] * 5 + [1.999], "label": [""] * 6}
    view._name_marks(marks)
    assert (marks["align"][5], marks["aside"][5]) == ("right", -8.0)  # else the frame would cut it


@pytest.fixture
def crossing(still, chosen, lines) -> DiagramView:
    """Return the diagram of equilibria and of the cycles that are born from them, at HB1 of both branches."""
    still.settings.axes = ("B", "max_x")
    return DiagramView(still, chosen.append, lines.append)


def test_special_points_of_two_branches_that_coincide_can_be_chosen(crossing, chosen):
    at = place_of(crossing, "marks", 0)
    assert data(crossing, "marks")["told"] == ["HB1", "HB1"]
    assert data(crossing, "marks")["label"] == ["branch1 HB1, branch2 HB1", ""]
    crossing._clicked(*at, (300.0, 200.0))
    assert chosen == [Place(of="branch1", label="HB1")]
    assert crossing.marks.panel.visible
    told = crossing.marks.panel.object
    assert told.count("<li>") == 2
    assert "2 points at one place" in told
    assert "<b>branch2 HB1</b> Hopf point" in told
    crossing._clicked(at[0] + 100.0, at[1])
    assert not crossing.marks.panel.visible


def test_a_mark_alone_opens_no_list(view, chosen):
    number = data(view, "marks")["told"].index("PD1")
    view._clicked(*place_of(view, "marks", number))
    assert chosen == [Place(of="branch1", label="PD1")]
    assert not view.marks.panel.visible


def test_dots_of_a_sweep_are_larger_than_a_curve_is_wide_and_have_its_colour(view, session):
    view.set_axes("a", "z")
    view.redraw()
    dots, number = data(view, "dots"), [entry.name for entry in session.entries].index("sweep1")
    assert set(dots["colour"]) == {view.colour(number)}
    assert min(dots["size"]) > 2.0 * max(data(view, "strands")["width"])


def test_many_dots_above_each_other_are_small(empty, chosen, lines, taken_steps, monkeypatch):
    x, y = np.repeat([1.0, 2.0], 40), np.r_[np.linspace(0.0, 1.0, 40), np.tile([0.25, 0.5], 20)]
    monkeypatch.setattr(
        "saltus.explorer.views.diagram_view.drawn", lambda result, axes: Drawn(dots=np.column_stack([x, y]))
    )
    empty.add(taken_steps[0]["sweep1"], taken_steps[1]["sweep1"])
    sizes = data(DiagramView(empty, chosen.append, lines.append), "dots")["size"]
    assert (set(sizes[:40]), set(sizes[40:])) == ({2.5}, {5.5})


def test_an_axis_is_fixed_by_the_user_and_freed_where_it_is_emptied(view, session, taken_steps):
    branch = taken_steps[1]["branch1"]
    view.set_axes("g", "max_z")
    assert session.settings.fixed == set()
    view.follow(branch)
    assert view.axes == ("a", "max_z")
    view._axes[0].value = "g"
    assert session.settings.fixed == {"x"}
    assert view._axes[0].name == "to the right, fixed"
    view.follow(branch)
    assert view.axes == ("g", "max_z")
    view._axes[0].value = ""
    assert session.settings.fixed == set()
    assert view.axes == ("a", "z")  # of the newest result, a sweep
    assert view._axes[0].name == "to the right"


def test_a_result_that_fixed_axes_do_not_show_is_told(view, session, taken_steps, lines):
    view._axes[0].value = "g"
    view.follow(taken_steps[1]["branch1"])
    assert "goes along a" in lines[-1]


def test_colours_begin_again(view, session):
    session.entries[:] = session.entries[:2] * len(colours.CURVES)
    assert view.colour(0) == view.colour(len(colours.CURVES)) != view.colour(1)
