"""The search for least losses against SciPy's, on closed forms, and what the derivatives tell of the parameters."""

import numpy as np
import pytest
from scipy.optimize import curve_fit, minimize

from closed_forms import ClosedForm, X, decay, decay_slopes, decaying, noise
from saltus import ConvergenceError
from saltus.fitting.optimum import (
    FOUND,
    INTERRUPTED,
    NOTHING,
    covariance,
    degeneracies,
    loss_weights,
    minimised,
    total_loss,
)

WIDE = np.array([[0.01, 0.01], [20.0, 20.0]])
START = np.array([1.0, 1.5])


# losses


def test_the_loss_is_the_square_of_small_residuals_and_grows_like_large_ones():
    small, large = np.array([1e-4, -2e-4]), np.array([1e6])
    assert total_loss(small) == pytest.approx(small @ small, rel=1e-8)
    assert total_loss(large) == pytest.approx(2.0 * 3.0 * 1e6, rel=1e-5)
    assert total_loss(np.zeros(0)) == 0.0


@pytest.mark.parametrize("residual", [-30.0, -3.0, 0.5, 4.0])
def test_half_the_slope_of_the_loss_is_the_residual_times_its_weight(residual):
    ends = [total_loss(np.array([residual + side * 1e-5])) for side in (1.0, -1.0)]
    weight = float(loss_weights(np.array([residual]))[0])
    assert (ends[0] - ends[1]) / 2e-5 == pytest.approx(2.0 * residual * weight, rel=1e-8)


# the search


def judged(objective, start):
    """The least loss and its parameters by SciPy's simplex, which has no derivatives."""
    found = minimize(
        lambda values: total_loss((decay(X, *values) - objective.y) / objective.sigma), start,
        method="Nelder-Mead", options={"xatol": 1e-10, "fatol": 1e-13, "maxiter": 4000, "maxfev": 4000},
    )  # fmt: skip
    return found.x, float(found.fun)


@pytest.mark.parametrize("wild", [0.0, 5.0])
def test_the_optimum_is_that_of_another_method_also_with_a_wild_datum(wild):
    objective = decaying()
    objective.y = objective.y + wild * (np.arange(len(X)) == 7)
    found = minimised(objective, START, WIDE, most=60)
    values, loss = judged(objective, START)
    assert found.values == pytest.approx(values, rel=1e-5)
    assert found.loss == pytest.approx(loss, rel=1e-8)
    assert found.loss == total_loss(found.evaluation.residuals)
    assert (found.stopped, found.is_interrupted) == (FOUND, False)


def test_data_without_noise_give_their_parameters_back():
    found = minimised(decaying(seed=None), START, WIDE, most=60)
    assert found.values == pytest.approx([2.0, 0.7], rel=1e-9)
    assert found.loss < 1e-15


@pytest.mark.parametrize("unit", [1e-9, 1e9])
def test_units_of_a_parameter_and_of_the_data_change_nothing_else(unit):
    plain, other = decaying(), decaying()
    other.y, other.sigma = unit * plain.y, unit * plain.sigma
    one = minimised(plain, START, WIDE, most=60)
    two = minimised(other, START * [unit, 1.0], WIDE * [unit, 1.0], most=60)
    assert two.values / [unit, 1.0] == pytest.approx(one.values, rel=1e-8)
    assert two.loss == pytest.approx(one.loss, rel=1e-10)


def test_the_order_of_the_data_does_not_matter():
    order = np.random.default_rng(2).permutation(len(X))
    plain, mixed = decaying(), decaying()
    mixed.y = plain.y[order]
    mixed.function = lambda x, *values: decay(x[order], *values)
    mixed.slopes = lambda x, *values: decay_slopes(x[order], *values)
    one, two = (minimised(objective, START, WIDE, most=60) for objective in (plain, mixed))
    assert two.values == pytest.approx(one.values, rel=1e-9)


def test_the_weights_of_data_are_the_squares_of_their_standard_errors():
    objective = decaying()
    objective.sigma = np.where(X > 2.0, 0.3, 0.05)
    found = minimised(objective, START, WIDE, most=60)
    values, errors = curve_fit(decay, X, objective.y, p0=START, sigma=objective.sigma, absolute_sigma=True)
    assert np.all(np.abs(found.values - values) < 0.1 * np.sqrt(np.diag(errors)))  # the loss is not quite the square
    assert found.values == pytest.approx(judged(objective, START)[0], rel=1e-5)


def test_a_bound_that_binds_is_reached_and_the_other_parameter_is_best_there():
    bounds = np.array([[0.01, 1.0], [20.0, 3.0]])
    objective = decaying()
    found = minimised(objective, START, bounds, most=60)
    assert found.values[1] == pytest.approx(1.0, abs=1e-6)
    alone = minimize(
        lambda a: total_loss((decay(X, a[0], found.values[1]) - objective.y) / 0.05), [1.0], method="Nelder-Mead",
        options={"xatol": 1e-10, "fatol": 1e-13},
    )  # fmt: skip
    assert found.values[0] == pytest.approx(alone.x[0], rel=1e-5)


@pytest.mark.parametrize("start", [[0.01, 20.0], [20.0, 0.01], [0.01, 0.01]])
def test_a_search_may_start_in_a_corner_of_its_bounds(start):
    found = minimised(decaying(seed=None), np.array(start), WIDE, most=200)
    assert found.values == pytest.approx([2.0, 0.7], rel=1e-6)


def test_a_parameter_may_start_at_zero():
    objective = decaying(seed=None)
    found = minimised(objective, np.array([0.0, 0.5]), np.array([[-5.0, 0.0], [5.0, 5.0]]), most=60)
    assert found.values == pytest.approx([2.0, 0.7], rel=1e-8)


@pytest.mark.parametrize("names", [("a", "b"), ("a", "b", "c")])
def test_a_start_at_the_optimum_is_found_at_once_also_where_a_combination_has_no_effect(names):
    """Without noise all residuals are 0, and SciPy would divide by the length of a step of 0."""

    def product(x, a, b, c=1.0):
        return decay(x, a * c, b)

    def slopes(x, a, b, c=1.0):
        by_product, by_rate = decay_slopes(x, a * c, b)
        return [c * by_product, by_rate, a * by_product][: len(names)]

    objective = ClosedForm(product, slopes, decay(X, 2.0, 0.7), 0.05, names)
    start = np.array([2.0, 0.7, 1.0])[: len(names)]
    found = minimised(objective, start, np.array([[0.01], [20.0]]) * np.ones(len(names)), most=60)
    assert (found.values.tolist(), found.loss, found.stopped) == (start.tolist(), 0.0, FOUND)


def test_a_fixed_parameter_keeps_its_value_and_the_others_are_best_beside_it():
    objective = decaying()
    found = minimised(objective, START, WIDE, fixed=(1,), most=60)
    assert found.values[1] == START[1]
    shape = np.exp(-START[1] * X)
    slope = loss_weights(found.evaluation.residuals) * found.evaluation.residuals @ shape
    assert abs(slope) < 1e-5 * np.abs(found.evaluation.residuals) @ shape


def test_where_all_is_fixed_the_start_is_what_is_found():
    objective = decaying()
    found = minimised(objective, START, WIDE, fixed=(0, 1), most=60)
    assert (found.stopped, objective.evaluations) == (NOTHING, 1)
    assert found.values.tolist() == START.tolist()
    assert found.loss == total_loss((decay(X, *START) - objective.y) / 0.05)


def test_no_more_evaluations_than_allowed_are_made():
    objective = decaying()
    found = minimised(objective, START, WIDE, most=2)
    assert found.stopped == "no more evaluations are allowed"
    assert objective.evaluations <= 2
    assert found.loss <= total_loss((decay(X, *START) - objective.y) / 0.05)


def test_an_interrupt_leaves_the_best_so_far():
    objective = decaying(stop_at=4)
    found = minimised(objective, START, WIDE, most=60)
    assert (found.stopped, found.is_interrupted) == (INTERRUPTED, True)
    losses = [total_loss((decay(X, *place) - objective.y) / 0.05) for place in objective.places[:3]]
    assert found.loss == min(losses)
    assert found.values.tolist() == objective.places[int(np.argmin(losses))].tolist()


def test_steps_that_cannot_be_followed_are_shortened_and_kept_in_words():
    objective = decaying(seed=None, wall=lambda a, b: "no orbit" if a > 2.05 else "")
    found = minimised(objective, np.array([0.5, 0.2]), WIDE, most=100)
    assert found.values == pytest.approx([2.0, 0.7], rel=1e-6)
    assert objective.failures
    assert all("no orbit" in why for why in objective.failures)


def test_a_wall_before_the_optimum_is_told_as_no_optimum():
    found = minimised(decaying(seed=None, wall=lambda a, b: "no orbit" if a > 1.5 else ""), START, WIDE, most=100)
    assert "perhaps this is no optimum" in found.stopped
    assert found.values[0] <= 1.5


def test_a_start_without_a_model_is_an_error():
    with pytest.raises(ConvergenceError, match="no orbit"):
        minimised(decaying(wall=lambda a, b: "no orbit"), START, WIDE, most=60)


# the objective


def test_the_best_parameters_are_evaluated_once_and_worse_ones_do_not_replace_them():
    objective = decaying()
    best = objective.at(np.array([2.0, 0.7]))
    assert objective.at(np.array([2.0, 0.7])) is best
    worse = objective.at(np.array([1.9, 0.7]))
    assert objective.best[2] is best
    assert worse is not best
    assert objective.evaluations == 2
    assert objective.is_worse(objective.at(np.array([9.0, 0.7])))


def test_the_rough_loss_of_parameters_without_a_model_is_infinite():
    objective = decaying(wall=lambda a, b: "no orbit" if a > 5.0 else "")
    assert objective.rough_loss(np.array([6.0, 0.7])) == np.inf
    assert objective.rough_loss(START) == total_loss((decay(X, *START) - objective.y) / 0.05)
    assert objective.best is None  # it is no candidate


def test_derivatives_that_are_not_finite_refuse_the_place():
    objective = ClosedForm(decay, lambda x, a, b: [x * np.nan, x], decay(X, 2.0, 0.7), 0.1, ("a", "b"))
    with pytest.raises(ConvergenceError, match="an end of a sheet has none"):
        objective.at(START)


# what the derivatives tell


def test_the_covariance_is_the_inverse_of_the_normal_equations():
    rng = np.random.default_rng(4)
    jacobian, residuals = rng.normal(size=(30, 3)), 3.0 * rng.normal(size=30)
    weights = 1.0 / np.sqrt(1.0 + residuals**2 / 9.0)
    wanted = np.linalg.inv(jacobian.T @ (weights[:, None] * jacobian))
    assert covariance(jacobian, residuals) == pytest.approx(wanted, rel=1e-10)
    order = rng.permutation(30)
    assert covariance(jacobian[order], residuals[order]) == pytest.approx(wanted, rel=1e-10)


def test_the_covariance_is_that_of_curve_fit_where_residuals_vanish():
    values, table = curve_fit(decay, X, decay(X, 2.0, 0.7), p0=START, sigma=np.full(25, 0.05), absolute_sigma=True)
    jacobian = np.array(decay_slopes(X, *values)).T / 0.05
    assert covariance(jacobian, np.zeros(25)) == pytest.approx(table, rel=1e-5)


@pytest.mark.parametrize("unit", [1e-9, 1e9])
def test_the_covariance_has_the_units_of_its_parameters(unit):
    jacobian = np.random.default_rng(6).normal(size=(10, 2))
    plain, other = (covariance(jacobian / one, np.zeros(10)) for one in ([1.0, 1.0], [unit, 1.0]))
    assert other / np.outer([unit, 1.0], [unit, 1.0]) == pytest.approx(plain, rel=1e-9)


def test_parameters_of_a_combination_without_effect_have_no_covariance_and_others_keep_theirs():
    shape = np.random.default_rng(7).normal(size=(12, 2))
    jacobian = np.column_stack([shape[:, 0], 3e5 * shape[:, 0], shape[:, 1], np.zeros(12)])
    found = covariance(jacobian, np.zeros(12))
    assert np.isinf(np.diag(found)).tolist() == [True, True, False, True]
    assert np.all(found[[0, 1, 3]][:, 2] == 0.0)
    assert found[2, 2] == pytest.approx(np.linalg.inv(shape.T @ shape)[1, 1], rel=1e-9)
    assert np.isinf(covariance(np.zeros((5, 1)), np.zeros(5))[0, 0])


def test_a_product_of_parameters_is_told_as_the_combination_that_leaves_it_as_it_is():
    values = np.array([2.0, 5e8, 0.7])
    jacobian = np.column_stack([X / 2.0, X / 5e8, np.exp(-X)])  # of a function of log(a b)
    (told,) = degeneracies(jacobian, values, ("a", "b", "c"))
    assert told in {
        f"the data do not change along a {a}1 %, b {b}1 %: only a combination of these is known"
        for a, b in (("+", "-"), ("-", "+"))
    }


def test_parameters_that_no_datum_depends_on_and_none_at_all_are_told():
    jacobian = np.column_stack([X, np.zeros(25)])
    assert degeneracies(jacobian, np.array([1.0, 0.0]), ("a", "b")) == ("no datum depends on b",)
    assert degeneracies(np.column_stack([X, np.exp(-X)]), np.array([0.0, 1.0]), ("a", "b")) == ()
    assert degeneracies(noise(8)[:, None], np.array([1.0]), ("a",)) == ()
