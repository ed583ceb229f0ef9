"""A search as a problem in units: constraints, bounds and multipliers of functions with known derivatives."""

from types import SimpleNamespace

import numpy as np
import pytest

from saltus.optimisation import task as tasks
from saltus.optimisation.expressions import Found
from saltus.optimisation.sequential import optimality, searched
from saltus.optimisation.task import Limit, Task, worded

INF = np.inf


def found_at(values, slopes, place, multipliers=(), by=None):
    multipliers = np.array(multipliers, dtype=complex)
    by = np.zeros((len(multipliers), len(place)), dtype=complex) if by is None else np.array(by, dtype=complex)
    carried = SimpleNamespace(values=np.array(place, dtype=float))
    return Found(carried, np.array(values, dtype=float), np.array(slopes, dtype=float), np.zeros(0), multipliers, by)


def task_of(first, *, limits=(), bounds=None, sign=1.0, names=("f", "g"), stable=False, at=None, told=None):
    parameters = tuple("abc"[: len(first.carried.values)])
    bounds = np.array([[-INF] * len(parameters), [INF] * len(parameters)]) if bounds is None else np.array(bounds)
    expressions = SimpleNamespace(names=names[: len(first.values)], stable=stable, at=at)
    return Task(expressions, parameters, sign, tuple(limits), bounds, 0.9, first, told or (lambda found: None))


# units


UNITS = [  # value, lower and upper bound, unit
    (2.0, -INF, INF, 2.0),
    (-2.0, -INF, INF, 2.0),
    (2.0, 0.0, INF, 2.0),
    (2.0, 1.0, 4.0, 3.0),
    (2.0, -1e3, 1e3, 20.0),
    (0.0, -1.0, 3.0, 4.0),
    (0.0, -INF, INF, 7.0 / 5.0),  # the change that moves the objective by its own size
    (0.0, 0.0, INF, 7.0 / 5.0),
]


@pytest.mark.parametrize(("value", "low", "high", "unit"), UNITS)
def test_the_unit_of_a_parameter_is_its_range_or_its_value(value, low, high, unit):
    first = found_at([-7.0], [[5.0]], [value])
    assert task_of(first, bounds=[[low], [high]]).units.tolist() == [pytest.approx(unit)]


def test_a_parameter_at_0_that_moves_nothing_has_the_unit_1():
    assert task_of(found_at([7.0], [[0.0]], [0.0])).units.tolist() == [1.0]
    assert task_of(found_at([0.0], [[4.0]], [0.0])).units.tolist() == [0.25]  # of an objective of 0 the size is 1


def test_the_unit_of_an_expression_is_the_largest_of_value_bound_and_change():
    first = found_at([1.0, -3.0, 0.5, 0.0], [[0.1], [0.1], [4.0], [0.0]], [2.0])
    limits = [Limit(0, 1, 5.0), Limit(0, -1, -6.0), Limit(1, 1, 2.0)]
    assert task_of(first, limits=limits, names=("f", "g", "h", "i")).sizes.tolist() == [6.0, 3.0, 8.0, 1.0]


def test_the_box_is_in_units():
    box = task_of(found_at([1.0], [[1.0, 1.0]], [2.0, 4.0]), bounds=[[1.0, -INF], [4.0, INF]]).box(0.25, 17)
    assert box.low.tolist() == [1.0 / 3.0, -INF]
    assert box.high.tolist() == [4.0 / 3.0, INF]
    assert (box.reach, box.most) == (0.25, 17)


# constraints


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_is_known_of_an_orbit_is_scaled_and_constraints_are_above_0_where_they_are_met(sign):
    first = found_at([4.0, 10.0], [[2.0, 0.0], [0.0, 5.0]], [2.0, 1.0])
    limits = (Limit(1, -1, 8.0), Limit(1, 1, 9.0))
    task = task_of(first, limits=limits, sign=sign)
    local = task.local(first)
    assert local.place.tolist() == [1.0, 1.0]
    assert local.objective == sign * 1.0
    assert local.gradient.tolist() == [sign * 1.0, 0.0]
    assert local.values == pytest.approx([0.2, -0.1])
    assert local.jacobian == pytest.approx(np.array([[0.0, 0.5], [0.0, -0.5]]))
    assert local.data is first


def test_three_constraints_of_stability_come_after_the_limits():
    first = found_at([4.0], [[2.0]], [2.0], [0.5, -0.3], [[0.1], [0.2]])
    task = task_of(first, limits=(Limit(0, 1, 5.0),), stable=True)
    local, kept = task.local(first), task.stability(first)
    assert local.values.tolist() == [pytest.approx(0.2), *kept.values.tolist()]
    assert local.jacobian[1:] == pytest.approx(kept.slopes * 2.0)
    assert np.all(kept.values > 0.0)


# places


@pytest.fixture
def along(monkeypatch):
    """Carrying goes straight to the values that are asked for; what is asked for is kept."""
    asked = []

    def carried(known, values):
        asked.append(values.copy())
        return "a wall" if values[0] == 300.0 else SimpleNamespace(values=values.copy())

    monkeypatch.setattr(tasks, "carried", carried)
    return asked


def square(there, near):
    a = there.values[0]
    if a == -300.0:
        return "no derivative"
    return found_at([a**2, a], [[2.0 * a], [1.0]], [a])


def test_a_place_is_asked_for_in_the_parameters_own_units_within_their_bounds(along):
    first, told = found_at([9.0, 3.0], [[6.0], [1.0]], [3.0]), []
    task = task_of(first, bounds=[[-6.0], [6.0]], at=square, told=told.append)  # a unit is 12
    near = task.local(first)
    assert task.at(np.array([0.25]), near).place.tolist() == [0.25]
    task.at(np.array([9.0]), near)
    assert [values.tolist() for values in along] == [[3.0], [6.0]]
    assert [one.values[0] for one in told] == [9.0, 36.0]


def test_a_place_next_to_a_bound_is_on_it(along):
    task = task_of(found_at([9.0, 3.0], [[6.0], [1.0]], [3.0]), bounds=[[0.1], [6.0]], at=square)
    near = task.local(task.first)
    for place, value in ((0.1 + 1e-13, 0.1), (6.0 - 1e-12, 6.0), (6.0 - 1e-9, 6.0 - 1e-9)):
        task.at(np.array([place]) / task.units, near)
        assert along[-1][0] == (value if value in (0.1, 6.0) else pytest.approx(value, rel=1e-14))


def test_a_step_beyond_bounds_is_in_units_too(along):
    task = task_of(found_at([9.0, 3.0], [[6.0], [1.0]], [3.0]), bounds=[[-6.0], [3.0]], at=square)
    there = task.local_beyond(task.local(task.first), 0, 0.5)
    assert along[-1].tolist() == [3.0 + 0.5 * 9.0]
    assert there.place.tolist() == [7.5 / 9.0]


def test_places_without_an_orbit_or_without_derivatives_are_reasons_in_words(along):
    task = task_of(found_at([9.0, 3.0], [[6.0], [1.0]], [3.0]), at=square)
    near = task.local(task.first)
    assert task.at(np.array([100.0]), near) == "a wall"
    assert task.at(np.array([-100.0]), near) == "no derivative"


def test_multipliers_that_meet_have_no_derivatives(along):
    def meeting(there, near):
        return found_at([1.0], [[1.0]], there.values, [0.5, 0.5], [[np.nan], [np.nan]])

    task = task_of(found_at([1.0], [[1.0]], [3.0], [0.5, 0.4]), at=meeting, stable=True)
    assert task.at(np.array([1.0]), task.local(task.first)) == "two multipliers meet: they have no derivatives"


# multipliers


@pytest.mark.parametrize("unit", [1.0, 1e-9, 1e9])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_multipliers_are_the_derivatives_of_the_best_objective_by_the_bounds(along, unit, sign):
    """The least (a - 3)^2 under a <= 1, or the greatest -(a - 3)^2: its derivative by the bound is 2 (1 - 3)."""

    def at(there, near):
        a = there.values[0]
        return found_at([sign * (a / unit - 3.0) ** 2, a], [[2.0 * sign * (a / unit - 3.0) / unit], [1.0]], [a])

    first = at(SimpleNamespace(values=np.array([0.5 * unit])), None)
    for limits, bounds in (((Limit(1, 1, unit),), [[-INF], [INF]]), ((), [[0.0], [unit]])):
        task = task_of(first, limits=limits, bounds=bounds, sign=sign, at=at)
        box = task.box(0.1, 100)
        ended = searched(task.at, task.local(first), box)
        rows = task.rates(optimality(ended.best, box)[1], ended.best.data)
        name, side, value, limit, rate = rows[-1]
        assert (name, side, limit) == ("g" if limits else "a", "upper", unit)
        assert value == pytest.approx(unit, rel=1e-12)
        assert rate == pytest.approx(-4.0 * sign / unit, rel=1e-8)
        assert [row[4] for row in rows[:-1]] == [0.0] * (len(rows) - 1)


def test_rows_are_limits_then_stability_then_lower_and_upper_bounds(along):
    first = found_at([4.0, 1.0], [[2.0, 0.0], [0.0, 1.0]], [2.0, 1.0], [0.5, -0.3], np.zeros((2, 2)))
    bounds = [[0.0, -INF], [3.0, 4.0]]
    task = task_of(first, limits=(Limit(1, -1, 0.5), Limit(1, 1, 1.5)), bounds=bounds, stable=True)
    rows = task.rates(np.zeros(8), first)
    assert [row[:4] for row in rows] == [
        ("g", "lower", 1.0, 0.5), ("g", "upper", 1.0, 1.5), ("stable", "upper", 0.5, 0.9),
        ("a", "lower", 2.0, 0.0), ("a", "upper", 2.0, 3.0), ("b", "upper", 1.0, 4.0),
    ]  # fmt: skip


def test_the_multiplier_of_stability_is_the_derivative_by_the_radius(along):
    """A multiplier a/2 of the least -a is held at the radius: a = 2 r, and -a falls by 2 with r."""

    def at(there, near):
        a = there.values[0]
        return found_at([-a], [[-1.0]], [a], [0.5 * a], [[0.5]])

    task = task_of(at(SimpleNamespace(values=np.array([1.0])), None), at=at, stable=True)
    box = task.box(0.1, 100)
    ended = searched(task.at, task.local(task.first), box)
    ((name, side, largest, limit, rate),) = task.rates(optimality(ended.best, box)[1], ended.best.data)
    assert (name, side, limit) == ("stable", "upper", 0.9)
    assert ended.best.data.carried.values[0] == pytest.approx(1.8, rel=1e-9)
    assert largest == pytest.approx(0.9, rel=1e-9)
    assert rate == pytest.approx(-2.0, rel=1e-6)


def test_parameters_in_words_have_nine_digits_and_leave_out_what_is_not_finite():
    assert worded(("a", "b", "c"), np.array([1.0 / 3.0, np.nan, 2e-9])) == "a = 0.333333333, c = 2e-09"
