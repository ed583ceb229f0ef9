"""Every special point has a normal form, or says why there is none."""

import math

import numpy as np
import pytest

import saltus
from saltus.continuation.core.point_types import POINT_TYPES
from saltus.continuation.results.point_normal_forms import Critical, NoNormalForm, normal_form_at


@pytest.fixture(scope="module")
def solutions():
    cycle = saltus.HybridSystem.smooth({"x": "v", "v": "mu*(1 - x**2)*v - x"}, {"mu": 1.0})
    logistic = saltus.Map(("x",), {"r": 2.5}, {"x": "r*x*(1 - x)"})
    return {
        "orbit": saltus.find_orbit(cycle, x0=[2.0, 0.0]),
        "equilibrium": saltus.find_equilibrium(cycle, x0=[0.0, 0.0]),
        "map": saltus.find_orbit(logistic, x0=[0.5]),
    }


@pytest.mark.parametrize("kind", ["orbit", "equilibrium", "map"])
@pytest.mark.parametrize("type", POINT_TYPES)
def test_every_type_has_a_normal_form_or_a_reason_for_every_solution(solutions, kind, type):
    solution = solutions[kind]
    varied = (next(iter(solution.parameters)),)
    found = normal_form_at(solution, Critical(type, f"{type}1", varied, None))
    assert repr(found).partition(": ")[2]
    if isinstance(found, NoNormalForm):  # none of these solutions is critical
        assert found.type == type
        assert math.isnan(found.coefficient)
        assert found.criticality == "undetermined"


def test_a_loop_over_the_points_of_a_cycle_ends_with_its_hopf_point():
    jerk = saltus.HybridSystem.smooth(
        {"x": "y", "y": "z", "z": "-al*z - be*y - x + x**2"}, parameters={"al": -1.0, "be": 1.0}
    )
    rests = saltus.continue_equilibrium(saltus.find_equilibrium(jerk, x0=[0, 0, 0]), "al", bounds=(-1.4, 1.8))
    cycles = saltus.continue_orbit(saltus.switch_branch(rests["HB1"]), "al", bounds=(0.6, 1.8))
    forms = {point.type: point.normal_form for point in cycles.special_points}
    assert "HB" in forms
    assert forms["HB"].criticality == rests["HB1"].normal_form.criticality
    assert forms["HB"].coefficient == pytest.approx(rests["HB1"].normal_form.coefficient, rel=1e-4)
    assert forms["HB"].frequency == pytest.approx(rests["HB1"].normal_form.frequency, rel=1e-6)


def test_a_loop_over_the_points_of_an_impacting_oscillator_raises_nothing(impact_oscillator):
    orbit = saltus.find_orbit(impact_oscillator, {"w": 1.1, "A": 0.3}, [0.0, 0.0])
    branch = saltus.continue_orbit(orbit, "A", (0.1, 1.5))
    told = [repr(point.normal_form) for point in branch.special_points]
    assert any("the sequence of events changes there" in text for text in told)
    assert np.all([text.partition(": ")[2] for text in told])
