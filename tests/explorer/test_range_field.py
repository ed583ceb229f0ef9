"""A parameter and its range: kept in the session, refused where empty, never that of another list."""

import math

import pytest

from saltus.errors import InputError
from saltus.explorer.range_field import RangeField
from saltus.explorer.session import Session

pytestmark = pytest.mark.usefixtures("heard")


def test_a_range_is_that_of_its_parameter(empty):
    field = RangeField(empty, "parameter")
    assert (field.name, field.bounds) == ("g", (0.0, 2.0))
    field.chooser.value = "e"
    assert (field.name, field.bounds) == ("e", (0.0, 1.0))
    assert field.bounds_of("a") == (0.0, 2.2)
    assert empty.settings.ranges == {}


def test_what_was_chosen_and_typed_comes_back_with_the_session(empty):
    field = RangeField(empty, "parameter")
    field.chooser.value = "a"
    field.ends[1].value = 3.5
    again = Session.reopened(empty.folder)
    other = RangeField(again, "parameter")
    assert (other.name, other.bounds) == ("a", (0.0, 3.5))
    assert RangeField(again, "sweep").name == "g"
    other.chooser.value = "e"
    assert other.bounds == (0.0, 1.0)
    assert other.bounds_of("a") == (0.0, 3.5)


def test_an_empty_end_is_no_number(empty):
    field = RangeField(empty, "parameter")
    field.ends[0].value = None
    with pytest.raises(InputError, match="lower bound of g = 'empty': must be a finite number"):
        field.bounds  # noqa: B018
    field.ends[0].value = -math.inf
    with pytest.raises(InputError, match="lower bound of g = -inf: must be a finite number"):
        field.bounds  # noqa: B018
    assert field.bounds_of("a") == (0.0, 2.2)


def test_two_lists_never_have_the_same_parameter(empty):
    first, second = RangeField(empty, "parameter"), RangeField(empty, "and")
    for name in ("g", "e", "a", "w"):
        first.chooser.value = name
        second.leave_out(name)
        assert second.name not in (name, "")
        assert name not in second.chooser.options.values()
