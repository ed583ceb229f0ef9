"""The search within a box: what is left of a gradient, bounds that bind, walls, SciPy on the same problems."""

import numpy as np
import pytest
from scipy.optimize import minimize

from saltus.optimisation.sequential import Box, Local, optimality, searched, violation

INF = np.inf


def bowl(centre, sizes=(1.0, 1.0), heights=None):
    """Half of a weighted distance from a centre, squared; heights: constraints and their derivatives."""
    centre, sizes = np.array(centre, dtype=float), np.array(sizes, dtype=float)

    def at(x, near=None):
        values, rows = heights(x) if heights else (np.zeros(0), np.zeros((0, len(x))))
        return Local(x, 0.5 * float(sizes @ (x - centre) ** 2), sizes * (x - centre), values, rows)

    return at


def box(low=(-INF, -INF), high=(INF, INF), **how):
    return Box(np.array(low, dtype=float), np.array(high, dtype=float), **how)


# what is known at a place


def test_the_violation_is_that_of_the_lowest_constraint():
    local = Local(np.zeros(1), 0.0, np.zeros(1), np.array([0.5, -2.0, -1.0]), np.zeros((3, 1)))
    assert violation(local) == 2.0
    assert violation(bowl([0.0, 0.0])(np.zeros(2))) == 0.0


def test_bounds_come_after_constraints_the_lower_ones_first_and_infinite_ones_not_at_all():
    local = Local(np.array([1.0, 2.0]), 0.0, np.zeros(2), np.array([7.0]), np.array([[3.0, 4.0]]))
    values, rows = box((0.5, -INF), (4.0, 2.5)).rows(local)
    assert values.tolist() == [7.0, 0.5, 3.0, 0.5]
    assert rows.tolist() == [[3.0, 4.0], [1.0, 0.0], [-1.0, 0.0], [0.0, -1.0]]


def test_steps_end_at_bounds_and_at_the_radius():
    low, high = box((0.5, -INF), (4.0, 2.5)).around(np.array([1.0, 2.0]), 1.0)
    assert low.tolist() == [-0.5, -1.0]
    assert high.tolist() == [1.0, 0.5]


def test_at_a_corner_the_multipliers_are_the_slopes_and_nothing_is_left():
    local = bowl([3.0, -2.0])(np.array([1.0, 0.0]))
    left, multipliers = optimality(local, box((-INF, 0.0), (1.0, INF)))
    assert left == pytest.approx(0.0, abs=1e-14)
    assert multipliers == pytest.approx([2.0, 2.0])


def test_a_bound_on_the_wrong_side_holds_nothing():
    local = bowl([3.0, 0.0])(np.array([1.0, 0.0]))
    left, multipliers = optimality(local, box((1.0, -INF)))
    assert left == pytest.approx(2.0)
    assert multipliers.tolist() == [0.0]


def test_a_constraint_that_holds_the_place_from_afar_is_left():
    height = 4e-7  # within what is taken as active
    local = Local(np.zeros(1), 0.0, np.array([1.0]), np.array([height]), np.array([[1.0]]))
    left, multipliers = optimality(local, Box(np.array([-INF]), np.array([INF])))
    assert left == pytest.approx(height, rel=1e-9)
    assert multipliers == pytest.approx([1.0])


# searches


@pytest.mark.parametrize("sizes", [(1.0, 1.0), (1.0, 1e4), (1e-3, 1e-3)])
def test_a_bowl_of_any_shape_has_its_least_place_at_its_centre(sizes):
    at = bowl([0.3, -0.2], sizes)
    ended = searched(at, at(np.array([1.0, 1.0])), box())
    assert ended.why == "found"
    assert ended.best.place == pytest.approx([0.3, -0.2], abs=1e-6)


def test_a_start_at_the_least_place_looks_at_no_other():
    at = bowl([0.3, -0.2])
    ended = searched(at, at(np.array([0.3, -0.2])), box())
    assert (ended.why, ended.looked, len(ended.path)) == ("found", 0, 1)


@pytest.mark.parametrize(("low", "high", "best"), [((0.5, -INF), (INF, -0.7), (0.5, -0.7)), ((-1, 0), (0, 1), (0, 0))])
def test_bounds_that_bind_hold_the_place_exactly(low, high, best):
    at, bounds = bowl([0.3, -0.2]), box(low, high)
    start = np.clip(np.array([0.9, -0.9]), bounds.low, bounds.high)
    ended = searched(at, at(start), bounds)
    assert ended.why == "found"
    assert ended.best.place == pytest.approx(best, rel=1e-14, abs=1e-14)
    assert optimality(ended.best, bounds)[0] < 1e-11


@pytest.mark.parametrize("seed", range(6))
def test_a_bowl_in_a_ball_and_below_a_plane_is_where_scipy_has_it(seed):
    rng = np.random.default_rng(seed)
    centre, sizes, plane = rng.normal(size=3) * 2.0, rng.uniform(0.2, 3.0, size=3), rng.normal(size=3)

    def heights(x):
        return np.array([1.0 - x @ x, 0.3 - plane @ x]), np.array([-2.0 * x, -plane])

    at, bounds = bowl(centre, sizes, heights), box((-0.6,) * 3, (INF,) * 3)
    start = rng.uniform(-0.5, 1.5, size=3)
    ended = searched(at, at(start), bounds)
    other = minimize(
        lambda x: at(x).objective, start, jac=lambda x: at(x).gradient, bounds=[(-0.6, None)] * 3, method="SLSQP",
        constraints={"type": "ineq", "fun": lambda x: heights(x)[0], "jac": lambda x: heights(x)[1]},
        options={"ftol": 1e-14, "maxiter": 500},
    )  # fmt: skip
    assert ended.why == "found"
    assert violation(ended.best) < 1e-9
    assert ended.best.place == pytest.approx(other.x, abs=1e-5)
    assert ended.best.objective <= other.fun + 1e-9


def test_every_step_of_a_search_without_constraints_goes_down():
    at = bowl([0.3, -0.2], (1.0, 50.0))
    ended = searched(at, at(np.array([2.0, 2.0])), box())
    assert np.all(np.diff([one.objective for one in ended.path]) <= 0.0)
    assert ended.path[0].place.tolist() == [2.0, 2.0]
    assert ended.path[-1].place.tolist() == ended.best.place.tolist()


def test_no_step_leaves_the_bounds_and_the_first_one_not_its_reach():
    seen = []

    def at(x, near=None):
        seen.append(x.copy())
        return bowl([3.0, 3.0])(x)

    bounds = box((0.0, 0.0), (1.0, 2.0), reach=0.25)
    ended = searched(at, at(np.array([0.5, 0.5])), bounds)
    assert ended.best.place == pytest.approx([1.0, 2.0], rel=1e-14)
    assert all(np.all((bounds.low <= x) & (x <= bounds.high)) for x in seen)
    assert np.abs(seen[1] - seen[0]).max() <= 0.25 * (1.0 + 1e-12)


def test_a_search_looks_at_no_more_places_than_allowed():
    at = bowl([9.0, 9.0])
    ended = searched(at, at(np.zeros(2)), box(most=3))
    assert (ended.why, ended.looked) == ("most", 3)
    assert ended.best.objective < at(np.zeros(2)).objective


def test_an_interrupt_keeps_the_last_place_that_was_taken():
    calls = []

    def at(x, near=None):
        calls.append(x)
        if len(calls) == 4:
            raise KeyboardInterrupt
        return bowl([9.0, 9.0])(x)

    ended = searched(at, at(np.zeros(2)), box())
    assert ended.why == "interrupted"
    assert ended.best.place.tolist() == calls[2].tolist()


def test_at_a_corner_of_the_objective_no_step_leads_further():
    """Of |x| the slope does not tell where it ends; the search stops there and says that it is no optimum."""

    def at(x, near=None):
        return Local(x, abs(x[0]), np.array([1.0 if x[0] >= 0.0 else -1.0]), np.zeros(0), np.zeros((0, 1)))

    ended = searched(at, at(np.array([0.7])), Box(np.array([-INF]), np.array([INF])))
    assert ended.why == "stuck"
    assert abs(ended.best.place[0]) < 1e-9


def test_each_place_is_looked_at_from_the_one_that_was_taken_last():
    pairs = []

    def at(x, near=None):
        pairs.append((x, near))
        return bowl([0.3, -0.2], (1.0, 50.0))(x)

    start = bowl([0.3, -0.2], (1.0, 50.0))(np.array([2.0, 2.0]))
    ended = searched(at, start, box())
    assert ended.looked == len(pairs)
    assert pairs[0][1] is start
    taken = [tuple(one.place) for one in ended.path]
    for k, (_, near) in enumerate(pairs):
        seen = {tuple(start.place), *(tuple(x) for x, _ in pairs[:k])}
        assert tuple(near.place) == [place for place in taken if place in seen][-1]


def test_a_violated_equality_is_met_before_the_objective_is_least():
    """On the line x + y = 1 the place nearest to the centre is its foot."""

    def heights(x):
        height = x.sum() - 1.0
        return np.array([height, -height]), np.array([[1.0, 1.0], [-1.0, -1.0]])

    at = bowl([2.0, 0.0], heights=heights)
    ended = searched(at, at(np.array([-3.0, -3.0])), box())
    assert ended.why == "found"
    assert ended.best.place == pytest.approx([1.5, -0.5], abs=1e-9)
    multipliers = optimality(ended.best, box())[1]
    assert multipliers[1] - multipliers[0] == pytest.approx(0.5, abs=1e-8)
