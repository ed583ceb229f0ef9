"""All kinds of solution answer the same questions."""

from __future__ import annotations

import numpy as np
import pytest

from saltus import HybridSystem, Map, find_equilibrium, find_orbit, load, solve_orbit
from saltus.solution import Solution


def _orbit():
    driven = HybridSystem.smooth({"x": "w*cos(theta) - x"}, {"w": 1.0}, phase=("theta", "w"))
    return find_orbit(driven, {}, [0.0])


def _equilibrium():
    return find_equilibrium(HybridSystem.smooth({"x": "a - x**2", "v": "-v"}, {"a": 1.0}), x0=[1.1, 0.1])


def _saddle():
    return find_equilibrium(HybridSystem.smooth({"x": "a - x**2", "v": "-v"}, {"a": 1.0}), x0=[-1.1, 0.1])


def _map_orbit():
    return solve_orbit(Map(("x",), {"r": 3.2}, {"x": "r*x*(1 - x)"}), x0=[[0.5], [0.8]])


@pytest.fixture(scope="module", params=[_orbit, _equilibrium, _saddle, _map_orbit])
def solution(request):
    return request.param()


def test_states_along_a_solution_are_of_all_its_states(solution):
    places, states = solution.states_along(60)
    assert isinstance(solution, Solution)
    assert states.shape == (len(places), len(solution.system.states))
    assert places[0] == 0.0
    assert np.all(np.diff(places) >= 0.0)


def test_extremes_enclose_the_states_along_a_solution(solution):
    states = solution.states_along(60)[1]
    low, high = solution.extremes
    size = 1e-9 * np.abs(states).max()
    assert np.all(low <= states.min(axis=0) + size)
    assert np.all(high >= states.max(axis=0) - size)


def test_x0_lies_on_the_solution(solution):
    states = solution.states_along(400)[1]
    assert np.abs(states - solution.x0).max(axis=1).min() < 1e-2


def test_a_solution_is_sound_unless_there_is_a_reason(solution):
    assert solution.sound
    assert solution.reasons == ()
    assert solution.stable == (solution.unstable == 0)


def test_a_table_names_stability_and_no_key_twice_with_a_state(solution):
    row = solution.row()
    assert row["stable"] == solution.stable
    assert any(name.endswith(solution.system.states[0]) for name in row)


def test_one_eigenvalue_or_multiplier_is_critical_unless_several_are(solution):
    name = next(iter(solution.parameters))
    assert solution.multiplicity("EX", (name,)) == 1


def test_a_solution_is_read_back_equal(solution, tmp_path):
    assert load(solution.save(tmp_path / "solution.nc")) == solution


def test_unstable_directions_are_counted():
    assert _saddle().unstable == 1
    fixed = solve_orbit(Map(("x", "y"), {"a": 2.0}, {"x": "a*x", "y": "-a*y"}), x0=[0.0, 0.0])
    assert fixed.unstable == 2


def test_a_kind_that_answers_nothing_cannot_be_made():
    with pytest.raises(TypeError, match="states_along"):
        Solution()
