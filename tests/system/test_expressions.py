"""Expressions are read by an arithmetic grammar, and nothing in them is run."""

import keyword

import numpy as np
import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st

from saltus import DefinitionError
from saltus.system.expressions import CONSTANTS, FUNCTIONS, check_name, parse, text_of

NAMES = ("x", "y", "a")
x, y, a = (sympy.Symbol(name, real=True) for name in NAMES)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("x + 2*y", x + 2 * y),
        ("-x**2/3", -(x**2) / 3),
        ("1/3", sympy.Rational(1, 3)),
        ("(a - x)**(3/2)", (a - x) ** sympy.Rational(3, 2)),
        ("sin(x)*cos(y) + pi", sympy.sin(x) * sympy.cos(y) + sympy.pi),
        ("atan2(y, x)", sympy.atan2(y, x)),
        ("sqrt(abs(x))", sympy.sqrt(sympy.Abs(x))),
        ("+x", x),
    ],
)
def test_arithmetic_is_read_as_sympy_reads_it(text, expected):
    assert sympy.simplify(parse(text, NAMES, "event") - expected) == 0


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os')",
        "__import__('os').system('true')",
        "x.__class__",
        "x[0]",
        "lambda: 1",
        "[x for x in y]",
        "x if y else a",
        "'x'",
        "f'{x}'",
        "x; y",
        "x = 1",
        "",
        "x +",
        "True",
        "1j",
        "x < y",
        "sin(x, y)",
        "sin(x=1)",
        "x @ y",
        "x // y",
        "x % y",
        "x^2",
        "1/0",
        "(" * 2000 + "x" + ")" * 2000,
    ],
)
def test_what_is_no_expression_is_refused_and_not_run(text):
    with pytest.raises(DefinitionError, match="^mode 'm' = "):
        parse(text, NAMES, "mode 'm'")


def test_import_is_named_as_an_unknown_function():
    with pytest.raises(DefinitionError) as caught:
        parse("__import__('os')", NAMES, "mode 'm'")
    assert "'__import__' is unknown" in str(caught.value)


def test_power_sign_of_other_languages_is_hinted_at():
    with pytest.raises(DefinitionError, match=r"'\^' is written '\*\*'$"):
        parse("x^2", NAMES, "event")


def test_unknown_name_suggests_the_nearest():
    with pytest.raises(DefinitionError, match="'Omga' is unknown; did you mean 'Omega'"):
        parse("Omga*x", ("x", "Omega"), "transition 't'")


@pytest.mark.parametrize("name", [*CONSTANTS, *FUNCTIONS, *keyword.kwlist, "1x", "x y", "", 3])
def test_names_that_mean_something_else_are_refused(name):
    with pytest.raises(DefinitionError, match="^states = "):
        check_name(name, "states")


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_a_number_keeps_all_its_digits(value):
    assert float(parse(text_of(value, "event"), (), "event")) == value


def test_sympy_expression_becomes_the_text_that_reads_back_equal():
    expression = sympy.exp(-x) * sympy.Float(0.1, 17) + sympy.Rational(2, 7) * y**3
    assert np.isclose(
        float((parse(text_of(expression, "event"), NAMES, "event") - expression).subs({x: 0.3, y: 1.7})), 0.0
    )


@pytest.mark.parametrize("value", [None, True, [1], {"x": 1}, object()])
def test_other_objects_are_no_expressions(value):
    with pytest.raises(DefinitionError, match="an expression: text, a number or SymPy"):
        text_of(value, "mode 'm'")
