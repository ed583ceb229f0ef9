"""The phase plane on the page: layers, motions that are kept, a start by a click."""

import numpy as np
import pytest

from saltus.explorer import look
from saltus.explorer.live import Frame
from saltus.explorer.plane_view import PlaneView, colour_of_motion
from saltus.explorer.steps import Place

pytestmark = pytest.mark.usefixtures("heard")


@pytest.fixture
def starts() -> list:
    return []


@pytest.fixture
def view(session, starts) -> PlaneView:
    session.settings.planes = ("z", "v", "z")
    figures = look.figure_of("portrait"), look.figure_of("series")
    return PlaneView(session, *figures, lambda x0, span: starts.append((x0, span)))


def tick(view, *names) -> None:
    for name in names:
        view._boxes[name].value = True


def test_layers_are_drawn_where_they_are_ticked(view, session):
    view.draw()
    assert [view._sources[name].data["xs"] for name in ("field", "nullclines", "surfaces")] == [[], [], []]
    tick(view, "field", "nullclines", "surfaces")
    assert session.settings.layers == ("field", "nullclines", "surfaces", "live")
    assert len(view._sources["field"].data["xs"]) > 100
    assert set(view._sources["nullclines"].data["name"]) == {"z′ = 0"}  # v' = -g is never 0
    assert view._sources["surfaces"].data["name"] == ["impact: z - a*sin(theta) = 0"]
    assert "at θ = " in view._text.object
    view._boxes["field"].value = False
    assert view._sources["field"].data["xs"] == []


def test_layers_need_two_states(view, session):
    session.settings.planes = ("t", "v", "z")
    tick(view, "field")
    assert view._sources["field"].data["xs"] == []
    assert "two states" in view._text.object
    view._clicked(0.1, 0.2)
    assert "both axes are states" in view._text.object


def test_a_click_is_a_start_in_the_plane(view, session, starts):
    session.settings.x0 = (0.6, 3.1, 0.5)
    session.settings.planes = ("v", "z", "z")
    view._clicked(1.23456, 0.7)
    assert starts == [((0.7, 1.235, 0.5), 20.0)]
    view._span.value = 5.0
    view.start(session.settings.x0)
    assert starts[-1] == ((0.6, 3.1, 0.5), 5.0)


def test_motions_that_are_ticked_are_drawn(view, session, taken_steps):
    steps, results = taken_steps
    session.add(steps["motion1"], results["motion1"])
    view.draw()
    told = view._sources["motions"].data
    assert set(told["name"]) == {"motion1", "motion2"}
    assert set(told["colour"]) == {colour_of_motion(session, name) for name in ("motion1", "motion2")}
    assert len(set(told["colour"])) == 2
    assert max(map(max, view._sources["motions_over_time"].data["xs"])) == pytest.approx(results["motion1"].t_end)
    session.settings.selected = Place(of="motion1")  # drawn as what is selected
    session.settings.hidden = {"motion2"}
    view.draw()
    assert view._sources["motions"].data["xs"] == []


def frame(view, part: str, **given) -> Frame:
    curve = np.array([[0.0, 0.0], [9.0, 1.0]])
    return Frame(view.wish({"a": 1.3, "e": 0.5}), part, curve, curve, **given)


def test_a_frame_is_shown_and_taken_away(view, session):
    view.draw()
    view.show_frame(frame(view, "motion", told="the motion is drawn to t = 3"))
    view.show_frame(frame(view, "orbit", told="the orbit is carried, stable"))
    assert view._sources["live"].data["x"].tolist() == [0.0, 9.0]
    assert view._sources["carried_over_time"].data["y"].tolist() == [0.0, 1.0]
    assert view._live_text.object == "the motion is drawn to t = 3; the orbit is carried, stable"
    assert view._portrait.x_range.end > 9.0
    view.clear()
    assert len(view._sources["live"].data["x"]) == 0
    assert view._live_text.object == ""


def test_nothing_moves_where_live_is_not_ticked(view):
    view._boxes["live"].value = False
    view.show_frame(frame(view, "motion"))
    assert len(view._sources["live"].data["x"]) == 0
