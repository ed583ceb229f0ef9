"""Values of expressions along states: what compiled code computes, and by the same grammar."""

import contextlib
import subprocess
import sys

import numpy as np
import pytest
import sympy
from hypothesis import given, strategies as st

from saltus.afm import table1, tapping_mode
from saltus.errors import InputError
from saltus.system.evaluate import check_expression, evaluate
from saltus.system.expressions import FUNCTIONS, parse
from saltus.system.hybrid import HybridSystem, Mode, Transition

EPS = np.finfo(float).eps


@pytest.fixture(scope="module")
def system():
    return HybridSystem(
        states=("x", "y"),
        parameters={"a": 2.0, "b": 0.5},
        modes={"slow": Mode({"x": "y", "y": "-x"}), "fast": Mode({"x": "2*y", "y": "-2*x"})},
        transitions=[Transition("slow", "fast", "x", 1), Transition("fast", "slow", "x", -1)],
        phase=("theta", "a"),
        outputs={"height": {"slow": "x + 1", "fast": "b*(1 - x)**(3/2)"}},
    )


STATES = np.array([[0.2, -0.4, 0.3], [1.7, 0.6, 3.0], [-0.8, 0.1, 6.0]])


@pytest.mark.parametrize("modes", [1, 2])
@pytest.mark.parametrize("name", ["z", "v", "force"])
def test_outputs_are_what_compiled_code_returns(modes, name):
    tip, rng = tapping_mode(table1(), modes), np.random.default_rng(5)
    states = rng.normal(size=(40, 2 * modes + 1))
    at = rng.integers(0, 2, size=40)
    values = {"Omega": 1.1, "E_star": 7e9}
    p, out = tip.compiled.extended(tip.parameter_vector(values)), np.empty(3)
    expected = []
    for x, mode in zip(states, at.tolist(), strict=True):
        tip.compiled.call("outputs", mode, 0, x, p, out)
        expected.append(out[tip.output_names.index(name)])
    # some dozen operations, with a gap that may be a tenth of its terms under a power of 2
    np.testing.assert_allclose(evaluate(tip, name, states, at, values), expected, rtol=1000 * EPS)


@pytest.mark.parametrize(
    "text",
    ["x + 2*y", "-x**2/3", "a**x - b", "sin(theta)*cos(y) + pi", "atan2(y, x)", "+abs(x)**(1/3)", "x**-2", "2**0.5*y",
     "exp(-x**2)*erf(y)", "log(1 + x**2)", "sign(x)*tanh(a*y)", "sqrt(x**2 + y**2)", "x/(1 + y/a)", "1e-3*x"],
)  # fmt: skip
def test_values_are_those_of_sympy(system, text):
    names = ("x", "y", "theta", "a", "b")
    symbols = [sympy.Symbol(name, real=True) for name in names]
    expression = parse(text, names, "test")
    found = evaluate(system, text, STATES, [0, 1, 0])
    for value, row in zip(found, STATES, strict=True):
        place = dict(zip(symbols, map(sympy.Float, [*row, 2.0, 0.5]), strict=True))
        assert value == pytest.approx(float(expression.subs(place)), rel=100 * EPS)


@pytest.mark.parametrize("name", sorted(set(FUNCTIONS) - {"atan2"}))
def test_every_function_of_definitions_is_known(system, name):
    argument = {"acosh": "1 + 0.3*x**2", "Max": "0.3*x, x, 1", "Min": "0.3*x, x, 1"}.get(name, "0.3*x")
    values = evaluate(system, f"{name}({argument})", STATES[1:2], [0])
    expected = parse(f"{name}({argument})", ("x",), "test").subs({sympy.Symbol("x", real=True): 1.7})
    assert values[0] == pytest.approx(float(expected), rel=10 * EPS)


def test_outputs_have_the_expression_of_their_mode(system):
    np.testing.assert_allclose(
        evaluate(system, "height + y", [[0.0, 1.0, 0.0], [0.0, 1.0, 0.0]], [0, 1]), [2.0, 1.5], rtol=EPS
    )


def test_roots_of_negative_numbers_are_zero_as_in_compiled_code(system):
    beyond = [[3.0, 0.0, 0.0]]
    assert evaluate(system, "height", beyond, [1]).tolist() == [0.0]
    assert evaluate(system, "sqrt(1 - x) + (1 - x)**2.5", beyond, [0]).tolist() == [0.0]


def test_what_has_no_value_is_not_finite_and_does_not_warn(system):
    assert evaluate(system, "1/y", [[0.0, 0.0, 0.0]], [0]).tolist() == [np.inf]
    assert np.isnan(evaluate(system, "log(x)", [[-1.0, 0.0, 0.0]], [0])[0])
    assert evaluate(system, "10**(400 + x)", [[0.0, 0.0, 0.0]], [0]).tolist() == [np.inf]


def test_a_constant_has_a_value_at_every_state(system):
    assert evaluate(system, "2*a", STATES, [0, 1, 1], {"a": 3.0}).tolist() == [6.0, 6.0, 6.0]
    assert evaluate(system, "x", np.empty((0, 3)), np.empty(0, dtype=int)).shape == (0,)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("heigth", "must be in x, y, theta, a, b, height and pi, but 'heigth' is unknown; did you mean 'height'?"),
        ("sinn(x)", "but 'sinn' is unknown; did you mean 'sin'?"),
        ("x +", "must be an expression; as in 'a*sin(theta) - v**2'"),
        ("x^2", "must be an expression of numbers, names, + - * / **, parentheses and functions; '^' is written '**'"),
        ("sin(x, y)", "must be an expression in which sin has 1 argument(s)"),
        ("", "must be an expression"),
        ("True", "must be an expression of numbers"),
        ("__import__('os').system('true')", "must be an expression of numbers"),
        ("x.real", "must be an expression of numbers"),
        ("x[0]", "must be an expression of numbers"),
        ("(lambda: 1)()", "must be an expression of numbers"),
        ("10**400", "must be of real numbers that a float can hold, but 10**400 is too large for a float"),
        ("sqrt(-1)*x", "but sqrt(-1) has no real value"),
        (3.0, "must be text"),
    ],
)
def test_what_is_no_expression_is_told(system, text, message):
    with pytest.raises(InputError) as caught:
        check_expression(system, text)
    assert message in str(caught.value)


@pytest.mark.campaign
@given(st.text(max_size=30))
def test_any_text_is_a_value_or_an_input_error(text):
    rest = HybridSystem(("x",), {}, {"free": Mode({"x": "-x"})})
    with contextlib.suppress(InputError):
        assert evaluate(rest, text, [[0.5]], [0]).shape == (1,)


def test_nothing_of_sympy_or_numba_is_needed():
    code = "import sys, saltus.system.evaluate; sys.exit('sympy' in sys.modules or 'numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
