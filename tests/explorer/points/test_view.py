"""The table on the page: it asks for normal forms once it is seen, and is sorted by its heads."""

import pytest

from saltus.explorer.points.view import PointView

pytestmark = pytest.mark.usefixtures("heard")


@pytest.fixture
def asked() -> list[tuple]:
    return []


@pytest.fixture
def view(session, asked) -> PointView:
    session.settings.axes = ("a", "max_z")
    made = PointView(session, lambda name, done: asked.append((name, done)))
    made.show()
    return made


def test_normal_forms_are_asked_for_when_the_table_is_seen(view, asked):
    assert asked == []
    view.seen()
    view.show()
    assert [name for name, _ in asked] == ["branch1", "locus1"][: len(asked)]
    asked[0][1]({"SN1": "nondegenerate, <coefficient> 1"})
    assert "nondegenerate, &lt;coefficient&gt; 1" in view._table.object


def test_forms_of_a_result_that_was_dropped_are_left_out(view, asked, session):
    view.seen()
    name, done = asked[0]
    session.entries[:] = [entry for entry in session.entries if entry.name != name]
    view.forget_gone()
    done({"SN1": "supercritical"})
    assert "supercritical" not in view._table.object


def test_a_second_click_on_a_head_turns_the_order(view):
    view.sort("x")
    assert 'aria-sort="ascending"' in view._table.object
    first = view._table.object
    view.sort("x")
    assert 'aria-sort="descending"' in view._table.object
    view.sort("no column")
    view.sort("x")
    assert view._table.object == first


def test_the_text_to_copy_is_that_of_the_table(view):
    assert 'data-copy="result\tpoint\tmeaning\ta\tmax_z\tnormal form\n' in view._table.object


def test_an_empty_session_has_no_text_to_copy(empty, asked):
    empty.settings.axes = ("a", "max_z")
    view = PointView(empty, lambda name, done: asked.append(name))
    view.seen()
    assert "data-copy" not in view._table.object
    assert asked == []
