"""Generated Taylor series against closed forms: every operation of a definition, coefficient by coefficient."""

from __future__ import annotations

import ctypes
import subprocess
import sys

import mpmath
import numpy as np
import pytest

from saltus.errors import NotAnalyticError
from saltus.system.derivatives import Symbolic
from saltus.system.expressions import FUNCTIONS
from saltus.system.hybrid import HybridSystem, Mode, Transition
from saltus.system.writing.taylor import series_of_mode

ORDER = 8

NOW = 0.4
"""Where the clock stands."""

A = 0.7
"""The parameter a."""

OF_TIME = {
    "sin(2*t - 1)": lambda t: mpmath.sin(2 * t - 1),
    "cos(2*t - 1)": lambda t: mpmath.cos(2 * t - 1),
    "tan(t)": mpmath.tan,
    "asin(t)": mpmath.asin,
    "acos(t)": mpmath.acos,
    "atan(2*t)": lambda t: mpmath.atan(2 * t),
    "sinh(t)": mpmath.sinh,
    "cosh(t)": mpmath.cosh,
    "tanh(3*t)": lambda t: mpmath.tanh(3 * t),
    "asinh(t)": mpmath.asinh,
    "acosh(t + 1)": lambda t: mpmath.acosh(t + 1),
    "atanh(t)": mpmath.atanh,
    "exp(-3*t)": lambda t: mpmath.exp(-3 * t),
    "log(t)": mpmath.log,
    "sqrt(t)": mpmath.sqrt,
    "erf(t)": mpmath.erf,
    "atan2(t - 1, t - 2)": lambda t: mpmath.atan2(t - 1, t - 2),
    "atan2(t, 1 + t**2)": lambda t: mpmath.atan2(t, 1 + t**2),
    "a + t - 1": lambda t: mpmath.mpf(A) + t - 1,
    "a - 3*t": lambda t: mpmath.mpf(A) - 3 * t,
    "(t - 1)*(t + a)*sin(t)*exp(t)": lambda t: (t - 1) * (t + mpmath.mpf(A)) * mpmath.sin(t) * mpmath.exp(t),
    "sin(t)*sin(t)": lambda t: mpmath.sin(t) ** 2,
    "sin(t)/(2 + cos(3*t))": lambda t: mpmath.sin(t) / (2 + mpmath.cos(3 * t)),
    "a/t": lambda t: mpmath.mpf(A) / t,
    "(t - 1)**7": lambda t: (t - 1) ** 7,
    "(t - 1)**(-3)": lambda t: (t - 1) ** -3,
    "(t - 0.4)**5": lambda t: (t - mpmath.mpf(NOW)) ** 5,
    "(t - 0.4)**3.0": lambda t: (t - mpmath.mpf(NOW)) ** 3,
    "t**(5/2)": lambda t: t ** mpmath.mpf(2.5),
    "t**(-1.5)": lambda t: t ** mpmath.mpf(-1.5),
    "t**(1/3)": lambda t: mpmath.cbrt(t),
    "t**a": lambda t: t ** mpmath.mpf(A),
    "(t - 1)**(2*a + b)": lambda t: (t - 1) ** 3,
    "a**t": lambda t: mpmath.mpf(A) ** t,
    "t**t": lambda t: t**t,
    "(1 + t)**sin(t)": lambda t: (1 + t) ** mpmath.sin(t),
    "exp(sin(cos(t)))": lambda t: mpmath.exp(mpmath.sin(mpmath.cos(t))),
    "abs(a - 1)*sign(a)*t": lambda t: abs(mpmath.mpf(A) - 1) * t,
}
"""Functions of a clock t, and the same by mpmath."""

OF_STATE = {
    "x": (1.5, lambda s: 1.5 * mpmath.exp(s)),
    "x**2": (0.5, lambda s: 1 / (2 - s)),
    "-x**3": (0.8, lambda s: 1 / mpmath.sqrt(2 * s + 1 / mpmath.mpf(0.8) ** 2)),
    "x*(1 - x)": (0.25, lambda s: 1 / (1 + 3 * mpmath.exp(-s))),
    "1 + x**2": (0.0, mpmath.tan),
    "sqrt(1 - x**2)": (0.0, mpmath.sin),
    "sqrt(x)": (2.25, lambda s: (mpmath.mpf(1.5) + s / 2) ** 2),
    "-x**(3/2)": (0.25, lambda s: 1 / (2 + s / 2) ** 2),
    "x**a": (1.0, lambda s: (1 + (1 - mpmath.mpf(A)) * s) ** (1 / (1 - mpmath.mpf(A)))),
    "exp(-x)": (0.5, lambda s: mpmath.log(mpmath.exp(0.5) + s)),
    "1/x": (0.5, lambda s: mpmath.sqrt(mpmath.mpf(0.25) + 2 * s)),
    "cos(x)": (0.0, lambda s: 2 * mpmath.atan(mpmath.tanh(s / 2))),
    "1/cosh(x)": (0.0, mpmath.asinh),
    "x*log(x)": (2.0, lambda s: mpmath.mpf(2) ** mpmath.exp(s)),
}
"""Fields of one state, its start, and the motion."""


def coefficients(system, x, mode=0, parameters=None, w=0.0, order=ORDER):
    """Coefficients of all columns of a mode, shape (order + 1, column), from the compiled function."""
    series = system.series(order)
    numbers = ctypes.POINTER(ctypes.c_double)
    function = ctypes.CFUNCTYPE(None, ctypes.c_int64, ctypes.c_int64, numbers, numbers, numbers)
    start = np.append(system.full_state(x), w)
    p, out = series.constants(system.parameter_vector(parameters)), np.full((series.order + 1, series.stride), np.nan)
    function(int(series.addresses[1]))(mode, 0, *(a.ctypes.data_as(numbers) for a in (start, p, out)))
    return out


def expanded(function, at, order=ORDER):
    with mpmath.workdps(60):
        return np.array([float(c) for c in mpmath.taylor(function, mpmath.mpf(at), order)])


@pytest.fixture(scope="module")
def of_time():
    """Columns of integrals of all functions of a clock, then of the functions as events."""
    states = [f"y{i}" for i in range(len(OF_TIME))]
    field = dict(zip(states, OF_TIME, strict=True)) | {"t": "1"}
    events = [Transition("m", "m", text, 1, name=f"e{i}") for i, text in enumerate(OF_TIME)]
    system = HybridSystem((*states, "t"), {"a": A, "b": 1.6}, {"m": Mode(field)}, events)
    return coefficients(system, [*np.zeros(len(states)), NOW])


@pytest.fixture(scope="module")
def of_state():
    states = [f"x{i}" for i in range(len(OF_STATE))]
    texts = (
        text.replace("exp", "EXP").replace("x", state).replace("EXP", "exp")
        for text, state in zip(OF_STATE, states, strict=True)
    )
    system = HybridSystem(tuple(states), {"a": A}, {"m": Mode(dict(zip(states, texts, strict=True)))}, [])
    return coefficients(system, [start for start, _ in OF_STATE.values()])


def test_every_analytic_function_of_expressions_is_in_these_tests():
    analytic = set(FUNCTIONS) - {"abs", "Abs", "sign", "Max", "Min", "degrees", "radians"}
    assert all(any(f"{name}(" in text for text in OF_TIME) for name in analytic)


@pytest.mark.parametrize("text", OF_TIME)
def test_integral_of_a_function_of_time_has_its_coefficients(of_time, text):
    column = of_time[:, list(OF_TIME).index(text)]
    slopes = expanded(OF_TIME[text], NOW)
    assert column[0] == 0.0
    assert column[1:] * np.arange(1, ORDER + 1) == pytest.approx(slopes[:-1], rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("text", OF_TIME)
def test_an_event_function_has_the_coefficients_of_its_expression(of_time, text):
    n = len(OF_TIME) + 1
    column = of_time[:, n + 2 + list(OF_TIME).index(text)]
    assert column == pytest.approx(expanded(OF_TIME[text], NOW), rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("text", OF_STATE)
def test_motion_has_the_coefficients_of_its_closed_form(of_state, text):
    column = of_state[:, list(OF_STATE).index(text)]
    assert column == pytest.approx(expanded(OF_STATE[text][1], 0.0), rel=1e-12, abs=1e-13)


def test_a_state_is_an_exponent():
    system = HybridSystem(("x", "y"), {"a": 2.0}, {"m": Mode({"x": "1", "y": "a**x + x**x"})}, [])
    found = coefficients(system, [1.5, 0.0])[1:, 1] * np.arange(1, ORDER + 1)
    assert found == pytest.approx(expanded(lambda x: 2**x + x**x, 1.5)[:-1], rel=1e-12)


def test_functions_of_the_phase_have_their_coefficients():
    texts = {
        "sin(theta)": lambda t: mpmath.sin(t),
        "cos(3*theta - c)": lambda t: mpmath.cos(3 * t - mpmath.mpf("0.3")),
        "sin(2*theta + c)": lambda t: mpmath.sin(2 * t + mpmath.mpf("0.3")),
        "c*sin(-theta)": lambda t: -mpmath.mpf("0.3") * mpmath.sin(t),
        "cos(theta)**3": lambda t: mpmath.cos(t) ** 3,
        "exp(sin(theta + 1))": lambda t: mpmath.exp(mpmath.sin(t + 1)),
        "tan(theta)": mpmath.tan,
        "sin(theta + cos(theta))": lambda t: mpmath.sin(t + mpmath.cos(t)),
    }
    states = [f"y{i}" for i in range(len(texts))]
    modes = {"m": Mode(dict(zip(states, texts, strict=True)))}
    system = HybridSystem(tuple(states), {"c": 0.3, "w": 1.7}, modes, [], phase=("theta", "w"))
    found = coefficients(system, [*np.zeros(len(states)), 1.1])
    for i, function in enumerate(texts.values()):
        slopes = expanded(lambda s, f=function: f(mpmath.mpf("1.1") + mpmath.mpf("1.7") * s), 0.0)[:-1]
        assert found[1:, i] * np.arange(1, ORDER + 1) == pytest.approx(slopes, rel=1e-12, abs=1e-12)


def test_each_mode_has_its_own_series():
    modes = {"grow": Mode({"x": "a*x"}), "swing": Mode({"x": "sin(x)"})}
    rows = [Transition("grow", "swing", "x - 2", 1), Transition("swing", "grow", "x**2 - 9", 1)]
    system = HybridSystem(("x",), {"a": A}, modes, rows)
    grow, swing = coefficients(system, [1.0], 0), coefficients(system, [1.0], 1)
    moves = expanded(lambda s: 2 * mpmath.atan(mpmath.tan(0.5) * mpmath.exp(s)), 0.0)
    assert grow[:, 0] == pytest.approx(expanded(lambda s: mpmath.exp(A * s), 0.0), rel=1e-12)
    assert grow[:, 3] == pytest.approx(grow[:, 0] - np.array([2.0] + [0.0] * ORDER), rel=1e-12)
    assert swing[:, 0] == pytest.approx(moves, rel=1e-12)
    squared = np.polynomial.polynomial.polymul(moves, moves)[: ORDER + 1]
    assert swing[:, 3] == pytest.approx(squared - np.array([9.0] + [0.0] * ORDER), rel=1e-12, abs=1e-12)


def test_coefficients_do_not_depend_on_the_order():
    modes = {"m": Mode({"x": "v", "v": "-sin(x) + x**2*v - v/(2 + x)"})}
    system = HybridSystem(("x", "v"), {}, modes, [])
    few, many = coefficients(system, [0.3, 0.2], order=5), coefficients(system, [0.3, 0.2], order=13)
    assert few[:, :2] == pytest.approx(many[:6, :2], rel=1e-13)


@pytest.mark.parametrize("text", ["abs(x)", "sign(x - 1)", "x*abs(sin(x))", "sqrt(x**2)"])
def test_the_absolute_value_or_sign_of_a_state_has_no_series(text):
    field = HybridSystem(("x",), {}, {"m": Mode({"x": text})}, [])
    assert field.series(ORDER) is None
    with pytest.raises(NotAnalyticError, match="has no Taylor series where its argument changes sign"):
        series_of_mode(Symbolic(field), 0, ORDER, str)


def test_an_event_of_the_absolute_value_of_a_state_has_no_series():
    system = HybridSystem(("x",), {}, {"m": Mode({"x": "1"})}, [Transition("m", "m", "abs(x) - 2", 1)])
    assert system.series(ORDER) is None


def test_a_series_at_a_singularity_is_not_finite():
    system = HybridSystem(("x",), {}, {"m": Mode({"x": "sqrt(x)"})}, [])
    assert not np.all(np.isfinite(coefficients(system, [0.0])[:, 0]))


def test_a_series_that_was_compiled_before_needs_no_sympy():
    code = (
        "import sys; from saltus import HybridSystem; "
        "found = HybridSystem.smooth({'x': 'v', 'v': '-sin(x)'}).series(7); print(found.order, 'sympy' in sys.modules)"
    )
    told = [subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True) for _ in range(2)]
    assert told[-1].stdout.split() == ["7", "False"]
