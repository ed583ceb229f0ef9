"""Buttons start steps with the values of their fields, and are shown where a step is possible."""

import pytest

from saltus.explorer.steps import Cascade, Continue, FindEquilibrium, FindOrbit, Follow, Place, Sweep, Switch
from saltus.explorer.views.action_view import ActionView, StartView

pytestmark = pytest.mark.usefixtures("heard")


@pytest.fixture
def asked() -> list:
    return []


def press(panel, name: str) -> None:
    """Click on the button of a name."""
    (button,) = panel.select(lambda part: name in getattr(part, "css_classes", ()) and hasattr(part, "clicks"))
    button.clicks += 1


def actions(session, asked, toys, **place) -> ActionView:
    """Return the buttons for a place, told."""
    session.settings.selected = Place(**place)
    made = ActionView(session, asked.append, lambda: asked.append("film"), toys.films, asked.append)
    made.show("<b>told</b>")
    return made


def shown(view: ActionView) -> set[str]:
    """Return names of the buttons that are shown."""
    return {name for name, button in view._buttons.items() if button.visible}


def test_an_orbit_is_sought_from_the_start_with_what_was_changed(empty, asked):
    empty.settings.parameters["a"], empty.settings.x0 = 1.3, (0.5, 3.0)
    view = StartView(empty, asked.append, tuple, asked.append)
    press(view.panel, "find-orbit")
    press(view.panel, "find-equilibrium")
    given = {"parameters": {"a": 1.3}, "x0": (0.5, 3.0)}
    assert asked == [FindOrbit(**given), FindEquilibrium(**given)]


def test_equilibria_are_offered_of_systems_without_a_drive(empty, still, asked):
    visible = []
    for session in (empty, still):
        view = StartView(session, asked.append, tuple, asked.append)
        (button,) = view.panel.select(lambda part: "find-equilibrium" in getattr(part, "css_classes", ()))
        visible.append(button.visible)
    assert visible == [False, True]


def test_a_sweep_has_the_values_of_its_fields(empty, asked):
    view = StartView(empty, asked.append, lambda: ("max(z)",), asked.append)
    view._range.chooser.value = "a"
    view._count.value, view._direction.value = 50, "down"
    press(view.panel, "sweep")
    assert asked == [
        Sweep(parameter="a", bounds=(0.0, 2.2), count=50, direction="down", observables=("max(z)",), x0=(0.0, 0.0))
    ]


def test_the_range_of_a_sweep_follows_its_parameter(empty, asked):
    view = StartView(empty, asked.append, tuple, asked.append)
    view._range.chooser.value = "e"
    assert [field.value for field in view._range.ends] == [0.0, 1.0]


def test_nothing_is_offered_where_nothing_is_selected(session, asked, toys):
    view = ActionView(session, asked.append, lambda: None, toys.films, asked.append)
    assert shown(view) == set()
    assert not view._one.visible
    assert not view._two.visible


@pytest.mark.parametrize(
    ("place", "names"),
    [
        ({"of": "orbit1"}, {"resume", "film"}),
        ({"of": "branch1", "index": 3}, {"resume", "film"}),
        ({"of": "branch1", "label": "SN1"}, {"resume", "follow", "film"}),
        ({"of": "branch1", "label": "PD1"}, {"resume", "switch", "cascade", "follow", "film"}),
        ({"of": "motion1"}, set()),
    ],
)
def test_only_what_a_solution_allows_is_offered(session, asked, toys, place, names):
    view = actions(session, asked, toys, **place)
    assert shown(view) == names
    assert view._text.object == "<b>told</b>"
    assert view._two.visible == ("follow" in names)


def test_a_branch_is_followed_over_the_range_of_the_fields(session, asked, toys):
    view = actions(session, asked, toys, of="branch1", index=3)
    view._first.chooser.value = "e"
    view._first.ends[1].value = 0.9
    press(view.panel, "continue")
    assert asked == [Continue(place=Place(of="branch1", index=3), parameter="e", bounds=(0.0, 0.9), of="orbit")]


def test_the_other_branch_is_followed_in_the_parameter_of_this_one(session, asked, toys):
    view = actions(session, asked, toys, of="branch1", label="PD1")
    view._first.chooser.value = "e"
    press(view.panel, "switch")
    press(view.panel, "cascade")
    place = Place(of="branch1", label="PD1")
    assert asked == [
        Switch(place=place, parameter="a", bounds=(0.0, 2.2), of="orbit"),
        Cascade(place=place, bounds=(0.0, 2.2)),
    ]


def test_cycles_are_followed_from_a_hopf_point(still, asked, toys):
    view = actions(still, asked, toys, of="branch1", label="HB1")
    view._first.chooser.value = "B"
    press(view.panel, "switch")
    assert asked == [Switch(place=Place(of="branch1", label="HB1"), parameter="B", bounds=(0.0, 3.0), of="orbit")]


def test_a_locus_is_followed_over_both_parameters(session, asked, toys):
    view = actions(session, asked, toys, of="branch1", label="SN1")
    view._first.chooser.value, view._second.chooser.value = "a", "e"
    press(view.panel, "follow")
    (step,) = asked
    assert step == Follow(
        place=Place(of="branch1", label="SN1"), parameters=("a", "e"), bounds=((0.0, 2.2), (0.0, 1.0))
    )


def test_a_film_is_asked_for(session, asked, toys):
    press(actions(session, asked, toys, of="orbit1").panel, "film")
    assert asked == ["film"]


@pytest.mark.parametrize("now", [None, Place(of="motion1"), Place(of="gone")])
def test_a_click_after_another_page_has_selected_what_allows_it_not_is_told(session, asked, toys, now):
    view = actions(session, asked, toys, of="branch1", label="PD1")
    session.settings.selected = now
    for button in view._buttons.values():
        button.clicks += 1
    selected = "none" if now is None else now.of
    labels = ["Continue", "Extend", "Switch branch", "Cascade", "Follow locus", "Film"]
    told = "it has changed since the page was drawn"
    assert asked == [
        f"selected solution = {selected!r}: must be one for which {label!r} is offered; {told}" for label in labels
    ]


def test_an_emptied_bound_is_refused(session, asked, toys):
    view = actions(session, asked, toys, of="branch1", label="SN1")
    view._second.ends[0].value = None
    press(view.panel, "follow")
    view._first.ends[1].value = None
    press(view.panel, "continue")
    assert asked == [
        "lower bound of e = 'empty': must be a finite number",
        "upper bound of g = 'empty': must be a finite number",
    ]
    starts = StartView(session, asked.append, tuple, asked.append)
    starts._count.value = None
    press(starts.panel, "sweep")
    assert asked[2] == "values = 'empty': must be a whole number"


def test_a_locus_needs_a_second_parameter(session, asked, toys):
    view = actions(session, asked, toys, of="branch1", label="SN1")
    view._second.leave_out("")
    view._second._names = ()
    view._second.leave_out("")
    view.show("")
    assert "follow" not in shown(view)
