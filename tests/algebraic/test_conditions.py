"""Singular points of algebraic equations against closed forms, in any units."""

from __future__ import annotations

import numpy as np
import pytest

from equations import Equations
from saltus.algebraic.conditions import Singular, solve_branch_point, solve_saddle_node


def fold(unit=1.0):
    """A fold at (x, y, p) = (1, 2, 3): y = 2 x, and p = 3 + (x - 1)^2; each equation has the unit of its state."""

    def function(u):
        x, y, p = u[0] / unit, u[1], u[2]
        return np.array([unit * (p - 3.0 - (x - 1.0) ** 2), y - 2.0 * x])

    return Equations(2, function, 3)


@pytest.mark.parametrize("unit", [1.0, 1e-9, 1e9])
def test_a_saddle_node_is_located_to_rounding_in_all_units(unit):
    sizes = np.array([unit, 2.0])
    found = solve_saddle_node(fold(unit), np.array([1.1 * unit, 2.1, 3.05]), sizes)
    np.testing.assert_allclose(found / [unit, 1.0, 1.0], [1.0, 2.0, 3.0], rtol=1e-8)


def test_where_no_saddle_node_is_near_none_is_returned():
    line = Equations(1, lambda u: np.array([u[0] - u[1]]), 2)
    assert solve_saddle_node(line, np.array([1.0, 1.0]), np.ones(1)) is None


def pitchfork():
    """Branches x = 0 and x^2 = p, beside y = p: they meet at (0, 0, 0)."""
    return Equations(2, lambda u: np.array([u[2] * u[0] - u[0] ** 3, u[1] - u[2]]), 3)


def transcritical():
    return Equations(1, lambda u: np.array([(u[0] - 1.0) * (u[1] - 2.0) - (u[0] - 1.0) ** 2]), 2)


def test_branch_points_are_located_where_branches_cross():
    found = solve_branch_point(pitchfork(), np.array([0.02, 0.001, 0.001]), np.ones(2))
    np.testing.assert_allclose(found, 0.0, atol=1e-10)
    found = solve_branch_point(transcritical(), np.array([1.05, 2.05]), np.ones(1))
    np.testing.assert_allclose(found, [1.0, 2.0], rtol=1e-10)


def test_the_condition_vanishes_on_the_fold_and_its_gradient_is_a_difference():
    problem, u = fold(), np.array([1.2, 2.4, 3.04])
    condition = Singular(problem, u, np.array([1.0, 2.0]))
    none = np.zeros(0)

    def value(at):
        return condition.evaluate(at, none, problem.evaluate(at)[1])[0][0]

    gradient = condition.evaluate(u, none, problem.evaluate(u)[1])[1][0]
    step = 1e-5
    differences = [(value(u + step * e) - value(u - step * e)) / (2.0 * step) for e in np.eye(3)]
    np.testing.assert_allclose(gradient, differences, atol=1e-7)
    assert abs(value(np.array([1.0, 2.0, 3.0]))) < 1e-12
    assert value(np.array([0.9, 1.8, 3.01])) * value(np.array([1.1, 2.2, 3.01])) < 0.0


def test_new_borders_leave_the_zeros_where_they_are():
    problem = fold()
    condition = Singular(problem, np.array([1.3, 2.6, 3.09]), np.array([1.0, 2.0]))
    condition.adjust()
    at = np.array([1.0, 2.0, 3.0])
    assert abs(condition.evaluate(at, np.zeros(0), problem.evaluate(at)[1])[0][0]) < 1e-12


def test_a_shift_moves_the_condition_to_another_multiplier():
    """A = 1 + p at x = 0: singular at p = -1, and with a shift of 2 at p = -3."""
    problem = Equations(1, lambda u: np.array([(1.0 + u[1]) * u[0]]), 2)
    for shift, place in ((None, -1.0), (2.0 * np.eye(1), -3.0)):
        condition = Singular(problem, np.array([0.0, place + 0.5]), np.ones(1), shift)
        at = np.array([0.0, place])
        assert abs(condition.evaluate(at, np.zeros(0), problem.evaluate(at)[1])[0][0]) < 1e-14
