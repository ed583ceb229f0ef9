"""The check of an optimum on quadratic functions with known curvature, right and wrong derivatives, and walls."""

from types import SimpleNamespace

import numpy as np
import pytest

from saltus.optimisation.sequential import Box, Local
from saltus.optimisation.verifying import verified

INF = np.inf
FREE = Box(np.full(2, -INF), np.full(2, INF))


def quadratic(hessian, gradient=(0.0, 0.0), heights=None):
    hessian, gradient = np.array(hessian, dtype=float), np.array(gradient, dtype=float)

    def at(x):
        values, rows = heights(x) if heights else (np.zeros(0), np.zeros((0, 2)))
        return Local(x, gradient @ x + 0.5 * x @ hessian @ x, gradient + hessian @ x, values, rows)

    return at


def around(at, refused=lambda index, step: ""):
    """A task whose places a step further are those of a function; `refused` says why a step is none."""

    def beyond(near, index, step):
        return refused(index, step) or at(near.place + step * np.eye(2)[index])

    return SimpleNamespace(names=("a", "b"), local_beyond=beyond)


@pytest.mark.parametrize(
    ("hessian", "least"), [([[2, 0], [0, 3]], 2.0), ([[2, 1], [1, 2]], 1.0), ([[0, 0], [0, 1]], 0.0)]
)
def test_without_constraints_the_least_curvature_is_the_least_eigenvalue(hessian, least):
    at = quadratic(hessian)
    found = verified(around(at), at(np.zeros(2)), FREE)
    assert found.curvature == pytest.approx(least, abs=1e-8)
    assert found.mismatch < 1e-10
    assert found.notes == ()


def test_a_saddle_is_no_optimum():
    at = quadratic([[1.0, 0.0], [0.0, -0.5]])
    found = verified(around(at), at(np.zeros(2)), FREE)
    assert found.curvature == pytest.approx(-0.5, abs=1e-8)
    assert found.notes == (
        "no optimum: the objective gets better in a direction in which all first derivatives vanish",
    )


def test_a_bound_takes_the_direction_in_which_the_objective_falls():
    """At b = 0 the saddle is an optimum within b >= 0 if its slope there is above 0."""
    at = quadratic([[1.0, 0.0], [0.0, -0.5]], (0.0, 2.0))
    found = verified(around(at), at(np.zeros(2)), Box(np.array([-INF, 0.0]), np.full(2, INF)))
    assert found.curvature == pytest.approx(1.0, abs=1e-8)
    assert found.notes == ()


def test_constraints_that_leave_no_direction_leave_an_infinite_curvature():
    at = quadratic([[-1.0, 0.0], [0.0, -1.0]], (1.0, 2.0))
    assert verified(around(at), at(np.zeros(2)), Box(np.zeros(2), np.full(2, INF))).curvature == INF


def test_a_curved_constraint_bends_the_curvature_along_it():
    """The least -b within the unit disk: along the circle it grows by 1/2 the angle squared, so 1 is the curvature."""

    def heights(x):
        return np.array([1.0 - x @ x]), np.array([-2.0 * x])

    at = quadratic(np.zeros((2, 2)), (0.0, -1.0), heights)
    found = verified(around(at), at(np.array([0.0, 1.0])), FREE)
    assert found.curvature == pytest.approx(1.0, rel=1e-6)
    assert found.mismatch < 1e-6


@pytest.mark.parametrize("error", [1e-3, -0.5])
def test_derivatives_that_are_not_those_of_differences_are_told(error):
    right = quadratic([[2.0, 0.0], [0.0, 3.0]])

    def wrong(x):
        one = right(x)
        return Local(x, one.objective, one.gradient + np.array([error, 0.0]), one.values, one.jacobian)

    found = verified(around(wrong), wrong(np.zeros(2)), FREE)
    assert found.mismatch == pytest.approx(abs(error), rel=1e-3)
    assert found.notes[0] == f"exact derivatives and differences disagree by {abs(error):.2g} of the largest"


def test_derivatives_of_an_inactive_constraint_are_not_tested_and_those_of_an_active_one_are():
    def heights(height):
        return lambda x: (np.array([height]), np.array([[5.0, 0.0]]))  # it does not change, so its slope is wrong

    for height, wrong in ((1.0, False), (0.0, True)):
        at = quadratic([[2.0, 0.0], [0.0, 3.0]], heights=heights(height))
        found = verified(around(at), at(np.zeros(2)), FREE)
        assert (found.mismatch > 1e-4) == wrong
        assert bool(found.notes) == wrong


def test_a_long_step_that_finds_nothing_gives_way_to_a_shorter_one():
    at = quadratic([[2.0, 0.0], [0.0, 3.0]])
    steps = []

    def refused(index, step):
        steps.append(abs(step))
        return "a wall" if abs(step) > 2e-6 else ""

    found = verified(around(at, refused), at(np.zeros(2)), FREE)
    assert found.notes == ()
    assert found.curvature == pytest.approx(2.0, rel=1e-6)
    assert set(steps) == {1e-4, 1e-5, 1e-6}


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_parameter_with_a_wall_on_one_side_is_told_and_the_other_is_tested(side):
    at = quadratic([[2.0, 0.0], [0.0, 3.0]])
    task = around(at, lambda index, step: "a wall" if index == 1 and step * side > 0.0 else "")
    found = verified(task, at(np.zeros(2)), FREE)
    assert found.notes == ("derivatives by b are not tested: a wall",)
    assert np.isnan(found.curvature)
    assert found.mismatch < 1e-10


def test_where_nothing_is_found_nothing_is_known():
    at = quadratic([[2.0, 0.0], [0.0, 3.0]])
    found = verified(around(at, lambda index, step: "a wall"), at(np.zeros(2)), FREE)
    assert np.isnan(found.mismatch)
    assert np.isnan(found.curvature)
    assert len(found.notes) == 2
