"""Further diagrams: axes of their own, the same results, kept with the session."""

import pytest

from saltus.explorer.session import Session
from saltus.explorer.steps import Place
from saltus.explorer.views.diagram_view import DiagramView
from saltus.explorer.views.diagrams_view import DiagramsView

pytestmark = pytest.mark.usefixtures("heard")


@pytest.fixture
def places() -> list:
    return []


def viewed(session, places) -> DiagramsView:
    """Return the diagrams of a session."""
    first = DiagramView(session, places.append, lambda line: None)
    return DiagramsView(session, first, places.append, lambda line: None, session.keep)


def test_another_diagram_has_axes_of_its_own(session, places):
    view = viewed(session, places)
    first = session.settings.axes
    view._more.clicks += 1
    (other,) = view._others
    other._axes[0].value, other._axes[1].value = "a", "min_v"
    assert session.settings.axes == first
    assert session.settings.more_axes == [("a", "min_v")]
    assert other.figure.yaxis.axis_label == "min v"
    assert other._sources["marks"].data["told"] == view._first._sources["marks"].data["told"] or first[0] != "a"
    session.settings.hidden = {"branch1"}
    view.redraw()
    assert "branch1" not in other._sources["strands"].data["name"]


def test_what_is_selected_is_marked_in_each(session, places):
    session.settings.axes = ("a", "max_z")
    view = viewed(session, places)
    view._more.clicks += 1
    session.settings.selected = Place(of="branch1", index=3)
    view.mark_chosen()
    rings = [made._sources["chosen"].data["x"] for made in (view._first, *view._others)]
    assert rings[0] == rings[1] != []


def test_diagrams_are_kept_and_closed(session, places):
    view = viewed(session, places)
    for _ in range(3):
        view._more.clicks += 1
    assert view._more.disabled
    view._less.clicks += 1
    assert len(view._row) == 3
    session.keep()
    again = Session.reopened(session.folder)
    assert again.settings.more_axes == session.settings.more_axes
    other = viewed(again, places)
    assert len(other._others) == 2
    again.settings.more_axes = [("a", "min_v")]  # as another page does
    other.redraw()
    assert [made.axes for made in other._others] == [("a", "min_v")]
    other._others[0]._axes[1].value = "z"
    assert "x" not in again.settings.fixed | session.settings.fixed


def test_lists_are_closed_in_each(session, places):
    view = viewed(session, places)
    view._more.clicks += 1
    (other,) = view._others
    other.marks.panel.visible = True
    view.close_lists()
    assert not other.marks.panel.visible
