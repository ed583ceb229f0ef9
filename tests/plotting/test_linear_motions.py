"""Motions about an equilibrium by the linearised field, against the matrix exponential and the motion itself."""

import numpy as np
import pytest
from scipy.linalg import expm

import saltus
from saltus.plotting.linear_motions import linear_motions


@pytest.fixture
def rest_at_focus():
    """Return the equilibrium of a chemical oscillator, a stable focus."""
    field = {"x": "A - (B + 1)*x + x**2*y", "y": "B*x - x**2*y"}
    return saltus.find_equilibrium(saltus.HybridSystem.smooth(field, {"A": 1.0, "B": 1.5}), x0=[1.0, 1.5])


def test_motions_are_those_of_the_matrix_exponential(rest_at_focus):
    rest = rest_at_focus
    over_time = [linear_motions(rest, ("t", name)) for name in ("x", "y")]
    assert [len(found) for found in over_time] == [2, 2]
    B, A = 1.5, 1.0
    jacobian = np.array([[B - 1.0, A**2], [-B, -(A**2)]])
    for i, found in enumerate(over_time):
        for curve, sign in zip(found, (1.0, -1.0), strict=True):
            start = np.zeros(2)
            start[i] = sign * 0.1 * rest.state[i]
            exact = [rest.state[i] + (expm(t * jacobian) @ start)[i] for t in curve[::40, 0]]
            assert curve[::40, 1] == pytest.approx(np.array(exact), abs=1e-11)


def test_a_portrait_of_an_attractor_ends_at_it_and_of_a_repeller_begins_there():
    for rate, end in ((-1.0, -1), (1.0, 0)):
        field = {"x": f"{rate}*(x - 1)", "y": f"2*{rate}*(y - 3)"}
        rest = saltus.find_equilibrium(saltus.HybridSystem.smooth(field), x0=[1.0, 3.0])
        for curve in linear_motions(rest, ("x", "y")):
            away = np.hypot((curve[:, 0] - 1.0) / 0.1, (curve[:, 1] - 3.0) / 0.3)
            assert away[end] < 0.01
            assert away[-1 - end if end else -1] == pytest.approx(1.0, rel=1e-9)


def test_motions_about_a_saddle_stay_near():
    field = {"x": "x - 1", "y": "-(y - 1)"}
    rest = saltus.find_equilibrium(saltus.HybridSystem.smooth(field), x0=[1.0, 1.0])
    found = linear_motions(rest, ("x", "y"))
    assert all(np.abs(curve - 1.0).max() < 0.13 for curve in found)
    for curve in found[1:3]:  # x and y are along the eigenvectors: their product is kept
        product = np.prod(curve - 1.0, axis=1)
        assert product == pytest.approx(np.full(len(curve), product[0]), abs=1e-12)


def test_what_is_no_state_has_no_motions(rest_at_focus):
    assert linear_motions(rest_at_focus, ("x", "x*y")) == []
    assert linear_motions(rest_at_focus, ("t", "t")) == []


def test_a_jacobian_without_a_basis_of_eigenvectors_is_left_out():
    rest = saltus.find_equilibrium(saltus.HybridSystem.smooth({"x": "y - x", "y": "-y"}), x0=[0.0, 0.0])
    assert linear_motions(rest, ("x", "y")) == []
