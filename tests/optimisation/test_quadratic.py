"""Quadratic models, their multipliers and the search, on functions with known answers and on SciPy's."""

import numpy as np
import pytest
from scipy.optimize import minimize

from saltus.optimisation.quadratic import lagrange_multipliers, least_quadratic, reachable_share
from saltus.optimisation.sequential import Box, Local, optimality, searched
from saltus.optimisation.stability import stability

FREE = Box(np.full(2, -np.inf), np.full(2, np.inf))


@pytest.mark.parametrize("seed", range(8))
def test_a_quadratic_model_has_the_least_value_that_scipy_finds_and_multipliers_that_balance_its_slope(seed):
    rng = np.random.default_rng(seed)
    root, gradient, rows = rng.normal(size=(3, 3)), rng.normal(size=3), rng.normal(size=(5, 3))
    hessian, least = root @ root.T + 0.1 * np.eye(3), -np.abs(rng.normal(size=5))
    place, multipliers = least_quadratic(hessian, gradient, rows, least)
    assert np.all(rows @ place >= least - 1e-10)
    assert np.all(multipliers >= 0.0)
    assert hessian @ place + gradient == pytest.approx(rows.T @ multipliers, abs=1e-9)
    assert multipliers @ (rows @ place - least) == pytest.approx(0.0, abs=1e-9)
    other = minimize(
        lambda d: gradient @ d + 0.5 * d @ hessian @ d, np.zeros(3), jac=lambda d: gradient + hessian @ d,
        constraints={"type": "ineq", "fun": lambda d: rows @ d - least}, method="SLSQP", options={"ftol": 1e-14},
    )  # fmt: skip
    assert place == pytest.approx(other.x, abs=1e-5)


def test_inequalities_without_a_common_place_are_told():
    rows, least = np.array([[1.0], [-1.0]]), np.array([1.0, 0.0])
    assert least_quadratic(np.eye(1), np.zeros(1), rows, least) is None


def test_the_share_of_a_violation_that_a_box_can_repair():
    values, rows = np.array([-2.0, 0.5]), np.array([[1.0], [-1.0]])
    assert reachable_share(values, rows, np.array([-1.0]), np.array([1.0])) == pytest.approx(0.25)  # the other holds
    assert reachable_share(values, rows[:1].repeat(2, axis=0), np.array([-3.0]), np.array([3.0])) == pytest.approx(1.0)
    assert reachable_share(np.array([1.0]), rows[:1], np.array([-1.0]), np.array([1.0])) == 1.0


def rosenbrock(disk):
    """Rosenbrock's valley over 100, within the unit disk or without constraints."""

    def at(x, near=None):
        value = 100.0 * (x[1] - x[0] ** 2) ** 2 + (1.0 - x[0]) ** 2
        slope = np.array([-400.0 * x[0] * (x[1] - x[0] ** 2) - 2.0 * (1.0 - x[0]), 200.0 * (x[1] - x[0] ** 2)])
        heights, rows = np.array([1.0 - x @ x]), np.array([-2.0 * x])
        return Local(x, value / 100.0, slope / 100.0, heights[: int(disk)], rows[: int(disk)])

    return at


@pytest.mark.parametrize("start", [(-1.2, 1.0), (0.0, 0.0), (2.0, 2.0)])
@pytest.mark.parametrize(("disk", "answer"), [(False, (1.0, 1.0)), (True, (0.7864151541684, 0.6176983125233))])
def test_rosenbrocks_valley_from_several_starts_also_from_outside(start, disk, answer):
    at = rosenbrock(disk)
    ended = searched(at, at(np.array(start)), FREE)
    assert ended.why == "found"
    assert ended.best.place == pytest.approx(answer, abs=1e-8)
    assert optimality(ended.best, FREE)[0] < 1e-9


def test_problem_71_of_hock_and_schittkowski_within_bounds():
    """An equality and a product, from a start that violates the equality."""

    def at(x, near=None):
        value = x[0] * x[3] * (x[0] + x[1] + x[2]) + x[2]
        slope = [x[3] * (2 * x[0] + x[1] + x[2]), x[0] * x[3], x[0] * x[3] + 1.0, x[0] * (x[0] + x[1] + x[2])]
        product, square = np.prod(x), x @ x
        heights = np.array([product - 25.0, square - 40.0, 40.0 - square])
        return Local(x, value, np.array(slope), heights, np.array([product / x, 2.0 * x, -2.0 * x]))

    box = Box(np.ones(4), np.full(4, 5.0), 0.5)
    ended = searched(at, at(np.array([1.0, 5.0, 5.0, 1.0])), box)
    assert ended.why == "found"
    assert ended.best.objective == pytest.approx(17.0140173, abs=1e-7)
    assert ended.best.place == pytest.approx([1.0, 4.7429994, 3.8211503, 1.3794082], abs=1e-6)


def test_a_step_along_a_curved_equality_is_corrected():
    """The example of Maratos: full steps near the solution make both the objective and the violation worse."""

    def at(x, near=None):
        height = x @ x - 1.0
        rows = np.array([2.0 * x, -2.0 * x])
        return Local(x, 2.0 * height - x[0], 4.0 * x - np.array([1.0, 0.0]), np.array([height, -height]), rows)

    ended = searched(at, at(np.array([0.8, 0.6])), FREE)
    assert ended.best.place == pytest.approx([1.0, 0.0], abs=1e-8)
    assert ended.looked < 20


def test_where_nothing_can_be_evaluated_steps_are_shortened_and_the_reason_is_kept():
    def at(x, near=None):
        if x[0] < -0.125:
            return "a wall"
        return Local(x, x[0] + x[1] ** 2, np.array([1.0, 2.0 * x[1]]), np.zeros(0), np.zeros((0, 2)))

    ended = searched(at, at(np.array([0.5, 0.25])), FREE)
    assert (ended.why, ended.refused) == ("refused", "a wall")
    assert -0.125 <= ended.best.place[0] < -0.125 + 1e-6


def test_constraints_that_nothing_meets_end_where_their_violation_is_least():
    def at(x, near=None):
        return Local(x, x[0], np.array([1.0, 0.0]), np.array([-1.0 - x @ x]), np.array([-2.0 * x]))

    ended = searched(at, at(np.array([0.5, 0.3])), FREE)
    assert ended.why == "infeasible"
    assert ended.best.place == pytest.approx([0.0, 0.0], abs=1e-6)


def test_multipliers_are_not_negative():
    found, left = lagrange_multipliers(np.array([-1.0, 0.0]), np.array([[1.0, 0.0]]))
    assert found.tolist() == [0.0]
    assert left.tolist() == [-1.0, 0.0]


def test_test_functions_of_stability_vanish_at_the_radius_and_have_the_slopes_of_differences():
    rate, radius, step = np.array([0.1 + 0.2j, 0.1 - 0.2j, 0.2, 0.5]), 0.9, 1e-6
    values = np.array([0.5 + 0.3j, 0.5 - 0.3j, -0.2, 0.7])
    found = stability(values, rate[:, None], radius)
    ends = [stability(values + side * step * rate, rate[:, None], radius).values for side in (1.0, -1.0)]
    assert found.slopes[:, 0] == pytest.approx((ends[0] - ends[1]) / (2.0 * step), abs=1e-8)
    ends = [stability(values, rate[:, None], radius + side * step).values for side in (1.0, -1.0)]
    assert found.by_radius == pytest.approx((ends[0] - ends[1]) / (2.0 * step), abs=1e-8)
    assert np.all(found.values > 0.0)
    for index, critical in enumerate(([0.9, 0.1], [-0.9, 0.1], [0.9j, -0.9j])):
        there = stability(np.array(critical, dtype=complex), np.zeros((2, 1)), radius)
        assert there.values[index] == pytest.approx(0.0, abs=1e-14)
        assert np.sum(np.abs(there.values) < 1e-12) == 1


def test_a_multiplier_that_is_rounding_needs_no_derivative_and_another_one_does():
    rate = np.array([[0.5], [complex("nan")]])
    assert np.all(np.isfinite(stability(np.array([0.5, 1e-9 + 0j]), rate, 0.9).slopes))
    assert np.isnan(stability(np.array([0.5, 0.1 + 0j]), rate, 0.9).slopes).any()
