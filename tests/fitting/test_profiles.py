"""Profiles of the loss on closed forms: their ends against root finding on profiles that SciPy computes."""

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar

from closed_forms import ClosedForm, X, decay, decaying, noise
from saltus.fitting.optimum import covariance, minimised, total_loss
from saltus.fitting.profiles import Profiles

WIDE = np.array([[0.01, 0.01], [20.0, 20.0]])
START = np.array([1.0, 1.5])


def profiled(objective, names, start=START, bounds=WIDE):
    found = minimised(objective, start, bounds, most=60)
    spread = covariance(found.evaluation.jacobian, found.evaluation.residuals)
    profiles = Profiles(objective, found, spread, bounds)
    profiles.compute(names)
    return profiles


def line(x, a):
    return a * x


def of_line(spread=0.5, **how):
    return ClosedForm(line, lambda x, a: [x], line(X, 2.0) + 0.01 * noise(3), spread, ("a",), **how)


def test_of_a_linear_model_the_ends_lie_a_standard_error_off():
    profiles = profiled(of_line(), ["a"], np.array([1.0]), np.array([[-50.0], [50.0]]))
    best, error = float(profiles.found.values[0]), 0.5 / np.sqrt(X @ X)
    low, high = profiles.intervals["a"]
    assert (low, high) == pytest.approx((best - error, best + error), abs=0.01 * error)
    assert profiles.notes == []
    assert profiles.better is None


@pytest.mark.parametrize("unit", [1e-9, 1e9])
def test_an_interval_has_the_unit_of_its_parameter(unit):
    plain, other = of_line(), of_line(0.5 * unit)
    other.y = unit * plain.y
    bounds = np.array([[-50.0], [50.0]])
    one = profiled(plain, ["a"], np.array([1.0]), bounds)
    two = profiled(other, ["a"], np.array([unit]), unit * bounds)
    assert np.array(two.intervals["a"]) / unit == pytest.approx(one.intervals["a"], rel=1e-9)


def judged(objective, index, best, side, scale):
    """The end of a profile by SciPy: root finding on the least loss over the other parameter."""

    def rise(value):
        def loss(other):
            values = (value, other) if index == 0 else (other, value)
            return total_loss((decay(X, *values) - objective.y) / objective.sigma)

        return minimize_scalar(loss, bracket=(0.5, 1.0), tol=1e-10).fun - best.loss - 1.0

    middle = best.values[index]
    return brentq(rise, middle, middle + side * scale, xtol=1e-8)


@pytest.mark.parametrize("spread", [0.05, 0.3])
@pytest.mark.parametrize("name", ["a", "b"])
def test_ends_are_those_of_root_finding_also_where_they_lie_unequally_far(spread, name):
    objective = decaying(spread=spread)
    profiles = profiled(objective, [name])
    index = "ab".index(name)
    error = float(np.sqrt(profiles.spread[index, index]))
    for end, side in zip(profiles.intervals[name], (-1.0, 1.0), strict=True):
        wanted = judged(objective, index, profiles.found, side, 4.0 * error)
        assert end == pytest.approx(wanted, abs=0.01 * error)


def test_a_wide_profile_is_not_symmetric():
    """Of a rate known to a third, the upper end lies further off than the lower one."""
    profiles = profiled(decaying(spread=0.5, seed=None), ["b"])
    low, high = profiles.intervals["b"]
    assert high - 0.7 > 1.2 * (0.7 - low)


def test_a_bound_within_the_interval_ends_it():
    bounds = np.array([[0.01, 0.69], [20.0, 20.0]])
    profiles = profiled(decaying(spread=0.3, seed=None), ["b"], START, bounds)
    low, high = profiles.intervals["b"]
    assert low == 0.69
    assert 0.7 < high < 20.0


def test_at_a_bound_the_interval_begins_with_the_best_value():
    bounds = np.array([[0.01, 1.0], [20.0, 20.0]])
    objective = decaying(seed=None)
    minimised(objective, START, bounds, most=60)
    found = minimised(objective, np.array([2.0, 1.0]), bounds, fixed=(1,), most=60)
    spread = covariance(found.evaluation.jacobian, found.evaluation.residuals)
    profiles = Profiles(objective, found, spread, bounds)
    assert profiles._end(1, -1.0) == 1.0


def test_a_parameter_that_the_data_do_not_tell_has_none_and_the_next_one_has():
    def product(x, a, g, c):
        return a * g * np.exp(-x) + c

    def slopes(x, a, g, c):
        return [g * np.exp(-x), a * np.exp(-x), np.ones_like(x)]

    objective = ClosedForm(product, slopes, product(X, 1.0, 2.0, 0.3), 0.1, ("a", "g", "c"))
    profiles = profiled(objective, ["a", "c"], np.array([1.0, 2.0, 0.3]), np.array([[0.1] * 3, [5.0] * 3]))
    assert profiles.notes == ["a has no profile: the data do not tell it"]
    assert list(profiles.intervals) == ["c"]


def test_a_better_fit_that_is_met_ends_the_profiles_and_is_kept():
    """From a place that is not the best one, the way to one side goes down."""
    objective = decaying()
    here = minimised(objective, np.array([1.0, 0.5]), WIDE, fixed=(1,), most=60)
    spread = covariance(here.evaluation.jacobian, here.evaluation.residuals)
    profiles = Profiles(objective, here, spread, WIDE)
    profiles.compute(["a", "b"])
    assert profiles.better is not None
    assert profiles.better.loss < here.loss - 0.01
    assert "b" not in profiles.intervals


def test_an_interrupt_keeps_the_intervals_that_are_known():
    whole = profiled(decaying(), ["a", "b"])
    before = profiled(decaying(), ["a"]).objective.evaluations
    objective = decaying(stop_at=before + 2)
    part = profiled(objective, ["a", "b"])
    assert part.intervals == {"a": whole.intervals["a"]}
    assert part.notes == ["interrupted: not all profiles are known"]


def test_a_way_that_cannot_be_followed_leaves_no_interval_and_says_why():
    objective = decaying(spread=0.5, seed=None)
    found = minimised(objective, START, WIDE, most=60)
    spread = covariance(found.evaluation.jacobian, found.evaluation.residuals)
    objective.wall = lambda a, b: "no orbit" if b > 0.75 else ""
    profiles = Profiles(objective, found, spread, WIDE)
    profiles.compute(["b"])
    assert profiles.intervals == {}
    (note,) = profiles.notes
    assert note.startswith("b has no profile: ")
