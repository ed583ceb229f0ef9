"""Powers with a parameter as exponent: field and derivatives are their limits where the base is 0."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest
import sympy

from saltus import HybridSystem, continue_equilibrium, diagram, find_equilibrium
from saltus.system.powers import opened, slope_of

HILL = {"x": "x**n/(1 + x**n) - d*x"}


def hill(n=3.0, d=0.4):
    return HybridSystem.smooth(HILL, {"n": n, "d": d})


@pytest.mark.parametrize("n", [1.0, 1.5, 2.0, 3.0, 4.5])
def test_hill_function_has_finite_derivatives_at_zero(n):
    system = hill(n)
    p = system.parameter_vector({})
    slope, J = system.compiled.linearised(0, np.zeros(1), system.compiled.extended(p))
    assert slope[0] == 0.0
    assert J[0, 0] == (1.0 if n == 1.0 else 0.0) - 0.4
    along = np.empty(1)
    system.compiled.call("field_p", 0, 0, np.zeros(1), system.compiled.extended(p), along)
    assert along[0] == 0.0


@pytest.mark.parametrize("n", [3.0, 4.0, 5.5])
def test_second_derivatives_of_a_hill_function_are_zero_at_zero(n):
    system = hill(n)
    second = system.second((0,)).field(0, np.zeros(1), np.ones(2), system.parameter_vector({}))
    np.testing.assert_array_equal(second, 0.0)


@pytest.mark.parametrize("n", [1.0, 2.0])
def test_whole_exponents_have_all_derivatives_in_the_state(n):
    system = HybridSystem.smooth({"x": "x**n - x"}, {"n": n})
    third = system.third.field(0, np.zeros(1), *np.ones((3, 1)), p=system.parameter_vector({}))
    second = system.second(()).field(0, np.zeros(1), np.ones(1), system.parameter_vector({}))
    assert second[0, 0] == n * (n - 1.0)
    assert third[0] == 0.0


def test_derivatives_are_those_of_mpmath_beside_zero():
    x, n, K = sympy.symbols("x n K", real=True)
    f = (x / K) ** n / (1 + (x / K) ** n) + n ** (x / K)
    at = {x: mp.mpf("0.3"), n: mp.mpf("2.7"), K: mp.mpf("1.9")}
    call = sympy.lambdify((x, n, K), f, "mpmath")
    orders = {
        (x,): (1, 0, 0),
        (n,): (0, 1, 0),
        (K,): (0, 0, 1),
        (x, n): (1, 1, 0),
        (n, n): (0, 2, 0),
        (x, K): (1, 0, 1),
    }
    with mp.workdps(40):
        for variables, order in orders.items():
            found = f
            for variable in variables:
                found = slope_of(found, variable)
            value = sympy.lambdify((x, n, K), opened(found), "mpmath")(*at.values())
            assert abs(value - mp.diff(call, tuple(at.values()), order)) < 1e-12


@pytest.mark.parametrize("start", [0.0, 0.01])
def test_equilibria_of_a_hill_function_are_found_at_zero(start):
    found = find_equilibrium(hill(), x0=[start])
    assert abs(found.state[0]) < 1e-12
    np.testing.assert_allclose(found.eigenvalues, -0.4, rtol=1e-9)
    branch = continue_equilibrium(found, "d", (0.2, 1.0))
    assert {float(branch.values.min()), float(branch.values.max())} == {0.2, 1.0}


def test_diagram_of_a_hill_function_has_the_branch_of_zero():
    branches = diagram(hill(), "d", (0.2, 1.0)).branches
    assert any(np.all(np.abs(branch.states) < 1e-9) for branch in branches)
