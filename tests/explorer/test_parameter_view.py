"""Parameters and start: fields and sliders, what a definition allows, sets of values."""

import math

import param
import pytest

import saltus
from saltus.explorer.parameter_view import ParameterView, range_of
from saltus.explorer.session import Session
from saltus.explorer.subjects import of_system
from systems import afm

pytestmark = pytest.mark.usefixtures("heard")


@pytest.fixture
def shown(empty):
    """Return the view of a session and the changes that it tells."""
    changes: list[dict[str, float]] = []
    return viewed(empty, lambda: changes.append(empty.changed())), changes


def viewed(session, changed=lambda: None, moved=lambda values: None, tell=print) -> ParameterView:
    """Return the view of a session."""
    return ParameterView(session, changed, moved, tell)


def bounded(tmp_path, **given) -> Session:
    """Return a session of a spring whose stiffness has bounds."""
    modes = {"free": saltus.Mode({"x": "v", "v": "-k*x"})}
    spring = saltus.HybridSystem(("x", "v"), {"k": 2.0, "c": 0.0, "n": -4.0}, modes, **given)
    return Session(of_system(spring), tmp_path)


def slide(field, place: int) -> None:
    """Move a slider and let it go."""
    with param.edit_constant(field._slider):
        field._slider.param.update(value=place, value_throttled=place)


def test_a_number_is_taken_and_moves_the_slider(shown, empty):
    view, changes = shown
    field = view._fields["a"]
    field._number.value = 1.65
    assert changes == [{"a": 1.65}]
    assert field._slider.value == 150  # of 200 steps from 0 to 2.2
    assert empty.settings.parameters["a"] == 1.65


def test_a_slider_moves_the_number(shown):
    view, changes = shown
    slide(view._fields["a"], 50)
    assert view._fields["a"]._number.value == pytest.approx(0.55)
    assert changes == [{"a": 0.55}]


def test_a_slider_that_moves_is_told_and_takes_nothing_before_it_is_let_go(empty):
    changes, moves = [], []
    view = viewed(empty, lambda: changes.append(1), moves.append)
    field = view._fields["a"]
    for place in (60, 70, 70):
        field._slider.value = place
    assert [round(values["a"], 9) for values in moves] == [0.66, 0.77]
    assert {values["e"] for values in moves} == {empty.settings.parameters["e"]}
    assert changes == []
    assert empty.changed() == {}
    field._slider.value = 100  # back where it was
    assert moves[-1]["a"] == empty.settings.parameters["a"]


def test_a_value_that_is_not_allowed_is_put_back(tmp_path):
    session, changes = bounded(tmp_path, parameter_bounds={"k": (1.0, 3.0)}, positive=("k",)), []
    lines: list[str] = []
    field = viewed(session, lambda: changes.append(1), tell=lines.append)._fields["k"]
    for wrong, told in {
        3.5: "k = 3.5: must be between 1 and 3",
        0.5: "k = 0.5: must be between 1 and 3",
        -1.0: "k = -1.0: must be > 0",
        None: "k = 'empty': must be a finite number",
        math.inf: "k = inf: must be a finite number",
    }.items():
        field._number.value = wrong
        assert field._number.value == 2.0
        assert lines.pop() == told
    assert changes == lines == []
    field._number.value = 3.0
    assert session.settings.parameters["k"] == 3.0


def test_a_slider_never_makes_a_positive_parameter_zero(tmp_path):
    session = bounded(tmp_path, positive=("k",))
    field = viewed(session)._fields["k"]
    slide(field, 0)
    assert 0.0 < session.settings.parameters["k"] <= 4.0 / 200


def test_a_range_is_that_of_the_subject_or_about_the_value_within_bounds(tmp_path, toys):
    session = bounded(tmp_path, parameter_bounds={"k": (1.0, 3.0)})
    assert range_of(session, "k") == (1.0, 3.0)
    assert range_of(session, "c") == (-1.0, 1.0)
    assert range_of(session, "n") == (-8.0, 0.0)
    session.subject = session.subject._replace(ranges={"k": (1.5, 2.5)})
    assert range_of(session, "k") == (1.5, 2.5)


def test_the_start_is_taken(shown, empty):
    view, changes = shown
    view._starts[1].value = 3.5
    assert empty.settings.x0 == (0.0, 3.5)
    assert changes == [{}]


def test_a_start_that_is_no_finite_number_is_put_back_and_told(empty):
    changes, lines = [], []
    view = viewed(empty, lambda: changes.append(1), tell=lines.append)
    for wrong, told in {None: "'empty'", math.inf: "inf"}.items():
        view._starts[1].value = wrong
        assert view._starts[1].value == empty.settings.x0[1]
        assert lines.pop() == f"start v = {told}: must be a finite number"
    assert changes == lines == []


def test_the_start_has_a_phase_where_the_session_has_one(empty):
    empty.settings.x0 = (0.6, 3.1, 0.5)
    view = viewed(empty)
    assert [field.name for field in view._starts] == ["z", "v", "θ"]


def test_a_mode_is_chosen_where_there_are_several(tmp_path, shown):
    assert not shown[0]._mode.visible
    session = Session(of_system(afm()), tmp_path)
    view = viewed(session)
    assert view._mode.visible
    view._mode.value = "contact"
    assert session.settings.mode == "contact"
    view._mode.value = ""
    assert session.settings.mode is None


def test_a_set_of_values_comes_back_by_its_name(shown, empty):
    view, changes = shown
    view._fields["e"]._number.value = 0.25
    view._starts[0].value = 0.7
    view._named.value_input = " low "
    view._save()
    view._fields["e"]._number.value = 0.75
    view._starts[0].value = 0.0
    view._chosen.value = "low"
    assert (empty.settings.parameters["e"], empty.settings.x0) == (0.25, (0.7, 0.0))
    assert (view._fields["e"]._number.value, view._starts[0].value) == (0.25, 0.7)
    assert view._chosen.value == "saved sets"
    assert changes[-1] == {"e": 0.25}


def test_a_set_without_a_name_is_not_saved(shown, empty):
    view, changes = shown
    view._named.value_input = "  "
    view._save()
    assert (empty.settings.sets, changes) == ({}, [])
