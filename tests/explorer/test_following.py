"""Axes follow results, unless they are fixed."""

import pytest

from saltus.explorer.following import followed_axes, told_where_fixed, varied_of


@pytest.mark.parametrize(
    ("name", "before", "fixed", "after"),
    [
        ("branch1", ("g", "max_z"), "", ("a", "max_z")),
        ("branch1", ("g", "max_z"), "x", ("g", "max_z")),
        ("branch1", ("g", "mean(z)"), "", ("a", "mean(z)")),
        ("branch1", ("a", "e"), "", ("a", "max_z")),  # left by a locus
        ("branch1", ("g", "e"), "y", ("a", "e")),
        ("branch1", ("g", "nothing"), "", ("a", "max_z")),
        ("locus1", ("g", "max_z"), "", ("a", "e")),
        ("locus1", ("g", "max_z"), "xy", ("g", "max_z")),
        ("locus1", ("e", "max_z"), "x", ("e", "a")),
        ("sweep1", ("g", "max_z"), "", ("a", "z")),
        ("orbit1", ("g", "max_z"), "", ("g", "max_z")),
    ],
)
def test_axes_are_those_on_which_a_result_is_seen(results, ball_on_table, name, before, fixed, after):
    assert followed_axes(results[name], before, fixed, ball_on_table) == after


def test_a_fixed_axis_that_does_not_show_a_result_is_told(results):
    told = told_where_fixed(results["branch1"], ("g", "z"), "x")
    assert told.startswith("this result goes along a, and the axis to the right is fixed at g")
    assert told_where_fixed(results["branch1"], ("a", "z"), "x") == ""
    assert told_where_fixed(results["branch1"], ("g", "z"), "") == ""
    assert told_where_fixed(results["orbit1"], ("g", "z"), "x") == ""


def test_what_varies(results):
    assert [varied_of(results[name]) for name in ("branch1", "locus1", "sweep1", "motion1")] == [
        ("a",), ("a", "e"), ("a",), (),
    ]  # fmt: skip
