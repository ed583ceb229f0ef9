"""Only what a selected solution allows is offered."""

import pytest

from saltus.explorer.choices import Choices, choices_at
from saltus.explorer.steps import Place


def never(system) -> bool:
    """Return that no orbit is filmed."""
    return False


def at(results, of: str, films=never, **where) -> Choices:
    """Return what a place in results allows."""
    return choices_at(Place(of=of, **where), results, films)


def test_nothing_is_offered_where_nothing_is(results):
    assert choices_at(None, results, never) == Choices()
    assert at(results, "nothing1") == Choices()


@pytest.mark.parametrize("name", ["motion1", "sweep1", "branch1", "locus1"])
def test_nothing_is_offered_of_what_is_no_solution(results, name):
    assert at(results, name) == Choices()


def test_a_branch_is_followed_through_an_orbit_and_an_equilibrium(results, rests):
    assert at(results, "orbit1") == Choices("orbit", resume=True)
    assert at(results, "branch1", index=3) == Choices("orbit", resume=True)
    assert at(rests[1], "equilibrium1") == Choices("equilibrium", resume=True)


def test_a_fold_has_a_locus_and_no_other_branch(results):
    assert at(results, "branch1", label="SN1") == Choices("orbit", resume=True, follow=True)


def test_a_doubling_has_another_branch_a_locus_and_a_cascade(results):
    assert at(results, "branch1", label="PD1") == Choices("orbit", True, "orbit", follow=True, cascade=True)


def test_cycles_and_equilibria_meet_at_a_hopf_point_from_both_sides(rests):
    found = rests[1]
    assert at(found, "branch1", label="HB1") == Choices("equilibrium", True, "orbit", follow=True)
    labels = [point.label for point in found["branch2"].special_points if point.type == "HB"]
    assert all(at(found, "branch2", label=label).switch == "equilibrium" for label in labels)


def test_no_branch_meets_a_special_point_of_a_locus_here(results):
    locus = results["locus1"]
    for point in locus.special_points:
        found = at(results, "locus1", label=point.label)
        assert (found.switch, found.follow, found.cascade) == ("", False, False)


def test_orbits_are_filmed_where_the_application_says_so(results, rests, toys):
    assert at(results, "orbit1", toys.films).film
    assert at(results, "branch1", toys.films, index=2).film
    assert not at(rests[1], "equilibrium1", toys.films).film
    assert not at(rests[1], "branch2", toys.films, index=2).film
