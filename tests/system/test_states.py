"""States as a user hands them in: numbers or a mapping, and what is said of those that do not fit."""

from __future__ import annotations

import numpy as np
import pytest

import saltus
from saltus import HybridSystem, InputError, Map, Mode, Transition

FORCED = HybridSystem(
    ("x", "v"), {"w": 1.0}, {"m": Mode({"x": "v", "v": "-x - 0.1*v + cos(s)"})}, phase=("s", "w"), name="forced"
)
STICKS = HybridSystem(
    ("x", "v"),
    {},
    {"slip": Mode({"x": "v", "v": "-x"}), "stick": Mode({"x": "0.1"}, states=("x",))},
    [Transition("slip", "stick", "v - 0.1", -1), Transition("stick", "slip", "x - 1", 1, {"v": "0.1"})],
)
LOGISTIC = Map(("x",), {"r": 3.2}, {"x": "r*x*(1 - x)"})
VAN_DER_POL = HybridSystem.smooth({"x": "v", "v": "(1 - x**2)*v - x"}, {})


@pytest.mark.parametrize("order", [("x", "v"), ("v", "x")])
def test_a_mapping_is_the_state_whatever_its_order(order):
    values = {"x": 0.5, "v": -1.0}
    assert FORCED.full_state({name: values[name] for name in order}).tolist() == [0.5, -1.0, 0.0]


def test_a_mapping_may_name_the_phase():
    assert FORCED.full_state({"s": 2.0, "v": -1.0, "x": 0.5}).tolist() == [0.5, -1.0, 2.0]


def test_states_that_a_mode_lacks_may_be_left_out():
    assert STICKS.full_state({"x": 0.5}, mode="stick").tolist() == [0.5, 0.0]


@pytest.mark.parametrize(
    ("x0", "said"),
    [
        ({"x": 1.0}, "x0 = {'x': 1.0}: must be a value for each of x, v; 'v' is missing"),
        ({"x": 1.0, "V": 0.0}, "x0 = 'V': must be one of x, v, s; did you mean 'v'?"),
        ({"x": 1.0, "v": np.inf}, "x0['v'] = inf: must be a finite number"),
        ([1.0], "x0 = [1.0]: must be of shape (2,), one number for each of x, v, or (3,) with the phase s"),
        ([[1.0, 2.0, 3.0]], "x0 = [[1.0, 2.0, 3.0]]: must be of shape (2,)"),
    ],
)
def test_what_does_not_fit_is_told_with_what_does(x0, said):
    with pytest.raises(InputError) as told:
        FORCED.full_state(x0)
    assert str(told.value).startswith(said)


def test_the_length_of_a_mode_with_states_of_its_own_is_told():
    with pytest.raises(InputError, match=r"of shape \(2,\), .* or \(1,\) for x of mode 'stick'"):
        STICKS.full_state([1.0, 2.0, 3.0], mode="stick")


def of_orbit(found):
    return np.array([found.period, *found.x0])


@pytest.mark.parametrize(
    ("call", "numbers", "names"),
    [
        (lambda x0: saltus.simulate(FORCED, x0=x0, t_end=3.0)(3.0), [1.0, 0.0], {"x": 1.0, "v": 0.0}),
        (lambda x0: of_orbit(saltus.find_orbit(VAN_DER_POL, x0=x0)), [2.0, 0.0], {"v": 0.0, "x": 2.0}),
        (lambda x0: of_orbit(saltus.solve_orbit(VAN_DER_POL, x0=x0, period=6.6)), [2.0, 0.0], {"v": 0.0, "x": 2.0}),
        (lambda x0: saltus.find_equilibrium(VAN_DER_POL, x0=x0).x0, [0.1, 0.0], {"v": 0.0, "x": 0.1}),
        (lambda x0: saltus.iterate(LOGISTIC, x0=x0, n=4).states, [0.3], {"x": 0.3}),
        (lambda x0: saltus.find_orbit(LOGISTIC, x0=x0).points, [0.3], {"x": 0.3}),
        (lambda x0: saltus.solve_orbit(LOGISTIC, x0=x0, period=2).points, [[0.5], [0.8]], [{"x": 0.5}, {"x": 0.8}]),
        (lambda x0: saltus.run_sweep(LOGISTIC, "r", [3.2, 3.5], x0=x0).points, [0.3], {"x": 0.3}),
        (
            lambda x0: saltus.lyapunov_spectrum(LOGISTIC, x0=x0, average=saltus.Average(periods=200)).exponents,
            [0.3],
            {"x": 0.3},
        ),
        (lambda x0: saltus.diagram(LOGISTIC, "r", (2.5, 2.9), x0=x0)[0].values, [0.6], {"x": 0.6}),
    ],
)
def test_a_mapping_serves_wherever_a_state_is_asked_for(call, numbers, names):
    np.testing.assert_array_equal(call(names), call(numbers))


def test_segments_of_an_orbit_take_mappings_with_and_without_phase():
    found = saltus.find_orbit(FORCED, x0=[0.0, 0.0])
    x, v = found.x0
    for guess in ({"x": x, "v": v}, {"x": x, "v": v, "s": 0.0}):
        solved = saltus.solve_orbit(FORCED, segments=[("m", None, guess, found.period)])
        np.testing.assert_allclose(solved.x0, [x, v], atol=1e-9)


def test_names_that_a_result_lacks_are_told_with_the_nearest_one():
    found = saltus.find_orbit(VAN_DER_POL, x0=[2.0, 0.0])
    with pytest.raises(KeyError, match="state or output = 'V': must be one of x, v; did you mean 'v'"):
        found.max["V"]
    assert found.max.get("V") is None
    with pytest.raises(InputError, match="parameter = 'mu': must be left out, as there is none"):
        found.parameters["mu"]


def test_a_label_of_a_branch_without_points_is_told():
    branch = saltus.continue_orbit(saltus.solve_orbit(LOGISTIC, {"r": 2.7}, x0=[0.6]), "r", (2.5, 2.9))
    with pytest.raises(InputError, match=r"label = 'PD1': must be left out: the \d+ points from r = 2"):
        branch["PD1"]


def test_a_pair_where_values_are_meant_is_told():
    with pytest.warns(RuntimeWarning, match=r"two values, no bounds: np.linspace\(2.8, 3.0, 100\)"):
        assert len(saltus.run_sweep(LOGISTIC, "r", (2.8, 3.0), x0=[0.3]).values) == 2
