"""What every solution answers in the same words, whatever its kind."""

from __future__ import annotations

import numpy as np
import pytest

import fields
import systems
from discrete import HENON
from saltus import find_equilibrium, solve_orbit
from saltus.solution import Solution

KINDS = {
    "an orbit": lambda: solve_orbit(
        systems.carried_map(("x",), {"r": 2.5}, {"x": "r*x*(1 - x)"}), {}, [("carry", "map", [0.6, 0.0], 1.0)]
    ),
    "an equilibrium": lambda: find_equilibrium(fields.lorenz(), x0=[1.0, 1.0, 1.0]),
    "an orbit of a map": lambda: solve_orbit(HENON, {"a": 0.3}, x0=[0.7, 0.2]),
}


@pytest.fixture(scope="module", params=KINDS)
def solution(request):
    return KINDS[request.param]()


def test_each_kind_is_a_solution_and_answers(solution):
    assert isinstance(solution, Solution)
    assert solution.noun.startswith(("a ", "an "))
    assert solution.sound == (not solution.reasons)
    assert solution.stable == (solution.unstable == 0)
    assert solution.residual < 1e-9
    assert set(solution.parameters) == set(solution.system.parameter_names)
    assert np.all(np.isfinite(solution.x0))


def test_no_kind_is_made_without_its_answers():
    with pytest.raises(TypeError, match="abstract"):
        Solution()
