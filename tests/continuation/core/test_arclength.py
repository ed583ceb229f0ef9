"""The arclength core on zero problems that know no orbits: a circle, a cubic, a pitchfork, the Bratu problem."""

from __future__ import annotations

import math
from itertools import pairwise
from types import MappingProxyType

import numpy as np
import pytest
from scipy.optimize import brentq, root

from saltus.continuation.core.arclength import Failure, StepControl, follow
from saltus.continuation.core.locating import events_between, locate
from saltus.continuation.core.monitor import Monitor
from saltus.continuation.core.zero_problem import Event, Examined, Point, correct, start_point

FOLD, LOW, HIGH, DETERMINANT = "fold", "low", "high", "determinant"
BRATU_FOLD = 3.513830719


class Toy:
    """A `ZeroProblem` of a function and its Jacobian, both of all unknowns; its monitors are the fold and the bounds.

    With `branching` the determinant of the bordered equations is a monitor, too, and singular at its zeros.
    """

    noise = MappingProxyType({})

    def __init__(self, function, jacobian, unknowns=2, bounds=(-math.inf, math.inf), branching=False):
        self.function, self.jacobian, self.bounds, self.branching = function, jacobian, bounds, branching
        self.unknowns = unknowns
        self.singular = frozenset({DETERMINANT} if branching else ())
        self.continuous = ()
        self.departed, self.forbidden = 0, math.inf

    def evaluate(self, u):
        return np.asarray(self.function(u), float), np.asarray(self.jacobian(u), float)

    def accurate(self, *, met=True):
        return True

    def metric(self, u):
        return np.append(np.full(u.size - 1, 1.0 / (u.size - 1)), 1.0)

    def scale(self):
        return np.ones(self.unknowns)

    def examine(self, point, before):
        fault = "beyond what is allowed" if point.parameter > self.forbidden else None
        names = [FOLD, *([DETERMINANT] if self.branching else [])]
        names += [name for name, bound in zip((LOW, HIGH), self.bounds, strict=True) if math.isfinite(bound)]
        return Examined({name: self.monitor(name, point) for name in names}, fault)

    def depart(self, point):
        self.departed += 1

    def recover(self, point):
        return False

    def leading(self, names):
        return names

    def sort_out(self, events):
        return events

    def crowded(self, names):
        return len(names) > 1

    def monitor(self, name, point):
        if name == FOLD:
            return float(point.tangent[-1])
        if name == DETERMINANT:
            return point.sign * math.exp(point.log)
        distance = point.parameter - self.bounds[name == HIGH]
        return distance if abs(distance) > 1e-12 else 0.0


def circle(**options):
    return Toy(lambda u: [u[0] ** 2 + u[1] ** 2 - 1.0], lambda u: np.array([[2.0 * u[0], 2.0 * u[1]]]), **options)


def followed(problem, u, *, control=None, most=400, orientation=1.0, log=None):
    """Points, events and the reason of a branch that ends, or of its first items."""
    start = start_point(problem, np.asarray(u, float), orientation)
    start.examined = problem.examine(start, None)
    points, events, reason = [start], [], None
    for item in follow(problem, start, control or StepControl(), log=[] if log is None else log):
        if isinstance(item, str):
            reason = item
            break
        (events if isinstance(item, Event) else points).append(item)
        if isinstance(item, Event) and item.name in (LOW, HIGH):
            break
        if len(points) > most:
            break
    return points, events, reason


@pytest.mark.parametrize("steps", [StepControl(largest=0.02), None, StepControl(largest=0.3)])
def test_the_circle_turns_at_both_folds_and_closes(steps):
    problem = circle()
    points, events, reason = followed(problem, [-1.0, 0.0], control=steps, most=800)
    angles = np.unwrap([math.atan2(p.u[1], -p.u[0]) for p in points])
    assert reason is None
    assert np.all(np.diff(angles) > 0.0)
    np.testing.assert_allclose([np.hypot(*p.u) for p in points], 1.0, atol=1e-12)
    first, second = events[:2]
    np.testing.assert_allclose(first.point.u, [0.0, 1.0], atol=1e-9)
    np.testing.assert_allclose(second.point.u, [0.0, -1.0], atol=1e-9)
    assert {event.name for event in events} == {FOLD}
    assert angles[-1] - angles[0] > 2.0 * math.pi


def test_points_carry_a_unit_tangent_and_the_way_along_the_chord():
    points, _, _ = followed(circle(), [-1.0, 0.0], most=60)
    for before, point in pairwise(points):
        assert float(point.weights @ point.tangent**2) == pytest.approx(1.0, abs=1e-12)
        assert abs(float(point.u @ point.tangent)) < 1e-9  # across the radius
        assert point.arc - before.arc == pytest.approx(float(np.linalg.norm(point.u - before.u)), rel=1e-12)


def test_a_bound_is_located_where_the_parameter_takes_its_value():
    points, events, _ = followed(circle(bounds=(-2.0, 0.6)), [-1.0, 0.0])
    assert [event.name for event in events] == [HIGH]
    np.testing.assert_allclose(events[0].point.u, [-0.8, 0.6], atol=1e-11)
    assert all(point.parameter < 0.6 for point in points)


def test_orientation_is_the_way_of_the_parameter():
    for orientation in (1.0, -1.0):
        start = start_point(circle(), np.array([-0.9, 0.1]), orientation)
        assert math.copysign(1.0, start.tangent[-1]) == orientation
        assert np.hypot(*start.u) == pytest.approx(1.0, abs=1e-14)


def test_where_there_is_no_branch_no_start_is_given():
    nowhere = Toy(lambda u: [u[0] ** 2 + u[1] ** 2 + 1.0], lambda u: np.array([[2.0 * u[0], 2.0 * u[1]]]))
    with pytest.raises(ValueError, match="Newton"):
        start_point(nowhere, np.array([0.3, 0.4]))


def test_steps_shrink_to_an_end_where_points_are_forbidden():
    problem, log = circle(), []
    problem.forbidden = 0.5
    points, events, reason = followed(problem, [-1.0, 0.0], control=StepControl(smallest=1e-4), log=log)
    assert reason == "step below 0.0001: beyond what is allowed"
    assert not events
    assert 0.4998 < points[-1].parameter <= 0.5
    assert all(isinstance(failure, Failure) and failure.step > 0.0 for failure in log)
    assert log[-1].reason == "beyond what is allowed"


def test_a_step_departs_from_each_point():
    problem = circle()
    points, _, _ = followed(problem, [-1.0, 0.0], most=20)
    assert problem.departed >= len(points) - 1


def test_two_folds_of_a_cubic_are_found_in_steps_longer_than_their_distance():
    """mu = x^3 - 3 e^2 x turns at x = +-e: a step in which the parameter turns twice is not taken."""
    e = 0.05
    problem = Toy(
        lambda u: [u[0] ** 3 - 3.0 * e * e * u[0] - u[1]], lambda u: np.array([[3.0 * u[0] ** 2 - 3.0 * e * e, -1.0]]),
        bounds=(-math.inf, 1.0),
    )  # fmt: skip
    _, events, _ = followed(problem, [-1.0, -1.0], control=StepControl(initial=0.3, largest=1.0))
    assert [event.name for event in events] == [FOLD, FOLD, HIGH]
    np.testing.assert_allclose([event.point.u[0] for event in events[:2]], [-e, e], atol=1e-8)
    np.testing.assert_allclose([event.point.parameter for event in events[:2]], [2.0 * e**3, -2.0 * e**3], atol=1e-12)


def test_a_branch_is_followed_through_a_branch_point_that_is_located():
    """x (mu - x^2) = 0: the branch x = 0 meets the parabola at mu = 0."""
    problem = Toy(
        lambda u: [u[0] * (u[1] - u[0] ** 2)], lambda u: np.array([[u[1] - 3.0 * u[0] ** 2, u[0]]]),
        bounds=(-math.inf, 1.0), branching=True,
    )  # fmt: skip
    points, events, _ = followed(problem, [0.0, -0.73])
    assert [event.name for event in events] == [DETERMINANT, HIGH]
    assert events[0].point.parameter == pytest.approx(0.0, abs=1e-9)
    assert all(abs(point.u[0]) < 1e-12 for point in points)


def test_events_between_two_points_and_one_alone():
    problem = circle()
    ends = []
    for angle in (1.3, 1.7):
        guess = np.array([-math.cos(angle), math.sin(angle)])
        tangent = np.array([math.sin(angle), math.cos(angle)])
        end = correct(problem, guess, tangent, np.ones(2), 7)
        assert isinstance(end, Point)
        end.arc, end.examined = angle, problem.examine(end, None)
        ends.append(end)
    (event,) = events_between(problem, *ends)
    np.testing.assert_allclose(event.point.u, [0.0, 1.0], atol=1e-9)
    values = [end.examined.monitors[FOLD] for end in ends]
    alone = locate(problem, FOLD, *ends, *values)
    np.testing.assert_array_equal(alone.point.u, event.point.u)
    assert events_between(problem, ends[0], ends[0]) == []


@pytest.mark.parametrize("kind", ["high", "other"])
def test_a_bound_that_cannot_be_located_ends_a_short_step_all_the_same(kind, monkeypatch):
    """Other zeros are left out there; a bound that is left out would be passed for good."""
    name, problem, ends = Monitor(kind), circle(), []
    for parameter, value in ((0.5, -3e-6), (0.500009, 6e-6)):
        end = start_point(problem, np.array([math.sqrt(1.0 - parameter**2), parameter]))
        end.arc, end.examined = parameter, Examined({name: value}, None)
        ends.append(end)
    monkeypatch.setattr("saltus.continuation.core.locating.locate", lambda *_: None)
    found = events_between(problem, *ends)
    assert [event.name for event in found] == ([name] if kind == "high" else [])
    assert [event.point.arc for event in found] == pytest.approx([0.500003] * len(found), abs=1e-12)
    # the arclengths of this test are the parameters themselves, so the cubic is a little off
    assert [event.point.u[-1] for event in found] == pytest.approx([0.500003] * len(found), abs=1e-6)


# Bratu: -u'' = lambda exp(u), u(0) = u(1) = 0


def bratu(points):
    """The equations at the inner points of a mesh, by central differences."""
    h = 1.0 / (points + 1)
    second = (2.0 * np.eye(points) - np.eye(points, k=1) - np.eye(points, k=-1)) / h**2
    return Toy(
        lambda u: second @ u[:-1] - u[-1] * np.exp(u[:-1]),
        lambda u: np.column_stack([second - u[-1] * np.diag(np.exp(u[:-1])), -np.exp(u[:-1])]),
        unknowns=points + 1,
    )


def fold_by_scipy(problem, points):
    """The fold of the discretised equations: they and a null vector of their Jacobian, of unit length, by SciPy."""

    def extended(w):
        u, v = np.append(w[:points], w[-1]), w[points:-1]
        F, J = problem.evaluate(u)
        return np.concatenate([F, J[:, :-1] @ v, [v @ v - 1.0]])

    x = np.linspace(0.0, 1.0, points + 2)[1:-1]
    shape = np.sin(math.pi * x)
    found = root(extended, np.concatenate([1.2 * shape, shape / np.linalg.norm(shape), [3.5]]), tol=1e-13)
    assert found.success
    return found.x[-1], found.x[points // 2]


def test_the_fold_of_the_bratu_problem_is_that_of_scipy():
    points = 31
    problem = bratu(points)
    branch, events, _ = followed(problem, np.zeros(points + 1), control=StepControl(largest=0.5), most=60)
    fold = next(event for event in events if event.name == FOLD)
    wanted, middle = fold_by_scipy(bratu(points), points)
    assert fold.point.parameter == pytest.approx(wanted, abs=1e-10)
    assert fold.point.u[points // 2] == pytest.approx(middle, abs=1e-6)
    assert [event.name for event in events].count(FOLD) == 1
    assert branch[-1].u[points // 2] > 4.0  # on the upper half


def test_the_folds_of_the_discretised_bratu_problem_tend_to_the_continuous_one():
    """The fold lies where theta tanh(theta) = 1: lambda = 8 (theta / cosh(theta))^2; errors fall like h^2."""
    theta = brentq(lambda t: t * math.tanh(t) - 1.0, 1.0, 1.5, xtol=1e-15)
    assert 8.0 * (theta / math.cosh(theta)) ** 2 == pytest.approx(BRATU_FOLD, abs=1e-9)
    errors = []
    for points in (15, 31):
        _, events, _ = followed(bratu(points), np.zeros(points + 1), control=StepControl(largest=0.5), most=60)
        errors.append(next(event for event in events if event.name == FOLD).point.parameter - BRATU_FOLD)
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.02)
    assert (4.0 * errors[1] - errors[0]) / 3.0 == pytest.approx(0.0, abs=1e-5)
