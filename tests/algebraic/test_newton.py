"""Newton's method for algebraic equations: zeros in closed form, in all units; what is told where there is none."""

from __future__ import annotations

import math

import numpy as np
import pytest

from equations import Equations
from saltus.algebraic.newton import responses, solve_zero, state_sizes, why_none, without_rounding
from saltus.errors import ConvergenceError, InputError


def circle_and_line(unit=(1.0, 1.0)):
    """x^2 + y^2 = 2 and x = y, in other units of x and y."""
    a, b = unit
    return Equations(2, lambda u: np.array([(u[0] / a) ** 2 + (u[1] / b) ** 2 - 2.0, u[0] / a - u[1] / b]), 2)


@pytest.mark.parametrize("unit", [(1.0, 1.0), (1e-9, 1e6), (1e12, 1e-12)])
def test_a_zero_is_found_to_rounding_in_all_units(unit):
    found, _, steps = solve_zero(circle_and_line(unit), np.array([2.0 * unit[0], 0.5 * unit[1]]), "equilibrium", "")
    np.testing.assert_allclose(found / unit, [1.0, 1.0], rtol=1e-13)
    assert steps < 10


def test_steps_converge_as_fast_as_newton_s_do():
    """The number of right digits doubles at each step: 1e-13 is reached within five from 0.1."""
    root = Equations(1, lambda u: u**2 - 2.0, 1)
    found, _, steps = solve_zero(root, np.array([1.5]), "equilibrium", "")
    assert found[0] == pytest.approx(math.sqrt(2.0), rel=1e-15)
    assert steps <= 5


def test_a_far_start_of_a_flat_function_is_reached_by_shorter_steps():
    """From 3 the full steps for arctan go to and fro, ever farther."""
    flat = Equations(1, lambda u: np.arctan(u - 1.0), 1)
    found, _, _ = solve_zero(flat, np.array([4.0]), "equilibrium", "")
    assert found[0] == pytest.approx(1.0, abs=1e-12)


def test_a_state_at_rest_in_0_is_0_and_not_rounding():
    coupled = Equations(2, lambda u: np.array([u[0] - 3.0, u[1] * (1.0 + u[0])]), 2)
    found, _, _ = solve_zero(coupled, np.array([2.0, 1e-3]), "equilibrium", "")
    assert found.tolist() == [3.0, 0.0]


def test_rounding_stays_where_the_equations_need_it():
    tiny = Equations(2, lambda u: np.array([u[0] - 1.0, 1e20 * (u[1] - 1e-18)]), 2)
    u = np.array([1.0, 1e-18])
    np.testing.assert_array_equal(without_rounding(tiny, u, np.ones(2)), u)


def test_no_zero_is_told_with_the_reason():
    none = Equations(1, lambda u: u**2 + 1.0, 1)
    with pytest.raises(ConvergenceError, match="there may be none here"):
        solve_zero(none, np.array([2.0]), "equilibrium", "there may be none here")


@pytest.mark.parametrize(("what", "said"), [("equilibrium", "field"), ("orbit", "map")])
def test_a_start_without_a_value_is_told(what, said):
    pole = Equations(1, lambda u: 1.0 / u, 1)
    with np.errstate(all="ignore"), pytest.raises(InputError, match=rf"x0 = .*at which the {said} and its derivatives"):
        solve_zero(pole, np.array([0.0]), what, "")


def test_a_singular_jacobian_is_named():
    assert "singular" in why_none(np.array([[1.0, 2.0], [2.0, 4.0]]))
    assert "nearer" in why_none(np.eye(2))
    assert "nearer" in why_none(np.array([[np.nan]]))


def test_sizes_of_states_are_their_moduli_and_one_at_rest_has_that_of_its_partners():
    linear = Equations(2, lambda u: np.array([u[0] - 5.0, u[1] - 0.0 * u[0]]), 2)
    u = np.array([-5.0, 2.0])
    np.testing.assert_array_equal(state_sizes(linear, u, linear.evaluate(u)[1]), [5.0, 2.0])
    driven = Equations(2, lambda u: np.array([-u[0] + 5.0, 1e-6 * u[0] - u[1] - 5e-6]), 2)
    u = np.array([5.0, 0.0])
    assert state_sizes(driven, u, driven.evaluate(u)[1])[1] == pytest.approx(5e-6, rel=1e-9)


def test_sizes_of_states_that_all_vanish_are_their_responses_to_a_parameter():
    response = Equations(2, lambda u: np.array([u[0] - 3.0 * u[2], u[1] - 1e-3 * u[2]]), 3)
    u = np.zeros(3)
    np.testing.assert_allclose(state_sizes(response, u, response.evaluate(u)[1]), [3.0, 1e-3])


def test_responses_are_the_shortest_solutions_in_the_units_of_the_states():
    """One equation for two unknowns: x/s1 + y/s2 is shared by their squares in these units."""
    sizes = np.array([1e-9, 1e3])
    found = responses(np.array([[1e9, 1e-3]]), np.array([[1.0]]), sizes)
    np.testing.assert_allclose(found[:, 0] / sizes, [0.5, 0.5])
