"""What the page draws is what the package's own pictures draw."""

import numpy as np
import pytest

import saltus
import systems
from saltus.errors import InputError
from saltus.explorer.drawing import default_axes, drawn, quantities_of


@pytest.fixture
def branch(results):
    return results["branch1"]


@pytest.mark.parametrize("name", ["max_z", "v", "period", "e", "mean(z)", "-2*amplitude(z, 1)"])
def test_points_and_marks_are_those_of_the_branch(branch, name):
    found = drawn(branch, ("a", name))
    assert np.array_equal(found.points[:, 0], branch.values)
    constant = name in branch.parameters and name not in branch.varied
    expected = np.full(len(branch), branch.parameters[name]) if constant else branch.column(name)
    assert np.array_equal(found.points[:, 1], expected)
    assert [mark.label for mark in found.marks] == [point.label for point in branch.special_points]
    on_curve = np.concatenate([strand.x for strand in found.strands])
    assert np.isin(branch.values, on_curve).all()


def test_an_orbit_alone_lies_where_its_branch_has_it(branch):
    for name in ("max_z", "v", "period", "e", "mean(z)", "min_z"):
        alone = drawn(branch.solution(5), ("a", name)).points[0, 1]
        assert alone == pytest.approx(drawn(branch, ("a", name)).points[5, 1], rel=1e-9)


def test_the_points_of_a_sweep_are_drawn_against_its_parameter_only(ball_on_table):
    options = saltus.options.SweepOptions(discard=5, keep=4, observables=("max(z)",))
    sweep = saltus.run_sweep(ball_on_table, "a", [1.1, 1.2], x0=[0.6, 3.1], options=options)
    assert drawn(sweep, ("a", "z")).dots.shape == (8, 2)
    assert drawn(sweep, ("a", "max_z")).dots.shape == (2, 2)
    with pytest.raises(InputError, match="with a to the right"):
        drawn(sweep, ("e", "z"))


def test_a_locus_is_drawn_over_its_parameters(branch):
    locus = saltus.continue_locus(branch["SN1"], ("a", "e"), {"a": (0.1, 3.0), "e": (0.3, 0.7)})
    over = drawn(locus, ("a", "e"))
    a, e = (np.concatenate([getattr(strand, axis) for strand in over.strands]) for axis in "xy")
    assert a == pytest.approx(np.pi * (1.0 - e) / (1.0 + e), rel=3e-4)  # between points it is interpolated
    away = np.abs(locus.values[:, None, :] - np.column_stack([a, e])).max(axis=2).min(axis=1)
    assert away.max() < 1e-12
    with pytest.raises(InputError, match="must be with a or e"):
        drawn(locus, ("g", "w"))


def test_an_unknown_quantity_is_told(branch):
    with pytest.raises(InputError, match="must be one of"):
        drawn(branch, ("a", "maximum"))


def test_names_of_axes(ball_on_table):
    assert {"a", "z", "min_z", "max_v", "period"} <= set(quantities_of(ball_on_table))
    assert default_axes(ball_on_table, "a") == ("a", "max_z")
    assert default_axes(systems.ball(), "e") == ("e", "min_energy")


def test_equilibria_are_drawn_as_their_branch(rests):
    _, found = rests
    along = drawn(found["branch1"], ("B", "y"))
    assert along.points[:, 1] == pytest.approx(along.points[:, 0])  # y = B/A
    assert [mark.label for mark in along.marks] == ["HB1"]
    assert {strand.kind for strand in along.strands} == {"stable", "unstable"}
    alone = drawn(found["equilibrium1"], ("B", "max_y"))
    assert alone.points == pytest.approx(np.array([[1.5, 1.5]]))
    assert alone.stable.tolist() == [True]


def test_doublings_of_a_cascade_are_marked_in_order(results):
    cascade = saltus.follow_cascade(results["branch1"]["PD1"], (0.9, 1.8), doublings=1)
    found = drawn(cascade, ("a", "period"))
    assert [mark.label for mark in found.marks] == ["PD1", "PD2"]
    assert found.marks[1].y == pytest.approx(2.0 * found.marks[0].y)
    assert [mark.x for mark in found.marks] == [point.parameters["a"] for point in cascade.points]
    assert found.points.shape == (0, 2)


def test_a_motion_is_not_drawn_on_the_diagram(results):
    nothing = drawn(results["motion1"], ("a", "z"))
    assert (nothing.strands, nothing.marks, len(nothing.points), len(nothing.dots)) == ((), (), 0, 0)
