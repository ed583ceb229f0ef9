"""Equations on the page: they open a session of their own, or it is told where they cannot be read."""

import pytest

from saltus.explorer.subjects import of_text
from saltus.explorer.views.equations_view import EquationsView

pytestmark = pytest.mark.usefixtures("heard")


@pytest.fixture
def opened(empty):
    """Return the view and the subjects of which sessions were wanted."""
    subjects: list = []

    def defined(subject) -> str:
        subjects.append(subject)
        return "ba9876543210"

    return EquationsView(empty, defined), subjects


def test_the_equations_of_the_session_are_shown_and_used(opened, empty):
    view, subjects = opened
    assert "z - a*sin(theta) falls through 0" in view._field.value
    view._field.value = view._field.value.replace("v' = -g", "v' = -g - v/10")
    view._use()
    (subject,) = subjects
    assert subject.system.modes["flight"].field["v"] == "-g - v/10"
    assert subject.x0 == empty.settings.x0
    assert 'href="?session=ba9876543210"' in view._told.object


def test_an_error_is_told_at_its_line(opened):
    view, subjects = opened
    view._field.value = "x' = v\nv' = -<b>"
    view._use()
    assert view._told.object.startswith("line 2, v")
    assert "<b>" not in view._told.object
    assert "error" in view._told.css_classes
    assert subjects == []


def test_a_text_of_other_states_starts_at_zero(opened):
    view, subjects = opened
    view._field.value = "x' = -x"
    view._use()
    assert subjects[0].x0 == ()


def test_a_saved_text_is_opened_by_its_file(opened, tmp_path, empty):
    view, _ = opened
    path = tmp_path / "equations.txt"
    path.write_text(view._field.value)
    assert of_text(path).system == empty.system
