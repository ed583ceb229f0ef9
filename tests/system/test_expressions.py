"""Expressions are read by an arithmetic grammar, and nothing in them is run."""

import keyword
import random
from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest
import sympy
from hypothesis import given, strategies as st

from saltus.errors import DefinitionError
from saltus.system.derivatives import _smooth_diff
from saltus.system.expansion import can_be_expanded, expanded
from saltus.system.expressions import check_name, parse, text_of
from saltus.system.grammar import FUNCTIONS

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


@pytest.mark.parametrize("name", [*keyword.kwlist, "__x", "__class__", "1x", "x y", "", 3, None])
def test_names_that_python_keeps_are_refused(name):
    with pytest.raises(DefinitionError, match="^states = "):
        check_name(name, "states")


@pytest.mark.parametrize(
    "name", ["E", "I", "N", "S", "Q", "O", "C", "gamma", "beta", "zeta", "pi", "oo", "nan", "sin", "_x", "\u03a9"]
)
def test_every_other_name_means_what_is_declared(name):
    assert check_name(name, "states") == name
    assert parse(f"2*{name} + x", ("x", name), "event") == 2 * sympy.Symbol(name, real=True) + x


def test_the_micro_sign_of_a_keyboard_is_the_name_that_was_declared():
    assert parse("2*\u00b5 + \u00b5", ("\u00b5",), "event") == 3 * sympy.Symbol("\u00b5", real=True)


def test_a_function_whose_name_is_declared_cannot_be_called():
    with pytest.raises(DefinitionError, match="'sin' is not called: the definition declares it; another name for it"):
        parse("sin(x)", ("x", "sin"), "event")


def test_a_function_without_an_argument_is_told():
    with pytest.raises(DefinitionError, match="'sin' is unknown; it is a function: give it its argument"):
        parse("2*sin", ("x",), "event")


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("sqrt(-1)", "sqrt(-1) has no real value"),
        ("x + log(-1)", "log(-1) has no real value"),
        ("acosh(0.5)", "acosh(0.5) has no real value"),
        ("(-8)**(1/3)", "(-8)**(1/3) has no real value"),
        ("log(0)", "log(0) has no real value"),
        ("exp(1e5)", "exp(1e5) is too large"),
        ("1e308*10", "1e308*10 is too large"),
        ("9**9**9", "9**9**9 is too large"),
        ("2**10000000", "2**10000000 is too large"),
        ("exp(exp(exp(1000)))", "exp(1000) is too large"),
        ("sin(1e400)", "1e400 is too large"),
        ("9" * 400, "is too large"),
        ("10**-400", "10**-400 is too small"),
        ("1e-400*x", "1e-400 is too small"),
        ("1e-200*1e-200", "1e-200*1e-200 is too small"),
        ("1/0", "1/0 divides by zero"),
        ("0**-1", "0**-1 divides by zero"),
        ("0*(1/0)", "1/0 divides by zero"),
        ("x/(y - y)", "it divides by zero"),
        ("1/tan(pi/2)", "tan(pi/2) has none"),
        ("atan2(0, 0)", "atan2(0, 0) has none"),
        ("sqrt(-x**2)", "sqrt(-x**2) has none"),
        ("1e200*x*1e200", "1e200*x*1e200 has none"),
        ("(((x**999*1e300)**999)**999)**999", "has none"),
        ("(-2)**x", "a negative number has no power that varies"),
        ("x**(10**9)", "of exponents between -1000 and 1000"),
        ("(x*10**300)**(10**9)", "of exponents between"),
        ("exp(10**9*log(x*10**300))", "of exponents between"),
        ("(1000000001/1000000000)**(10**9)", "of exact numbers of at most 30000 digits"),
        ("asin(sin(10**300))", "that SymPy can work out"),
    ],
)
def test_constants_without_a_real_finite_value_are_told_in_a_line(text, reason):
    with pytest.raises(DefinitionError) as caught:
        parse(text, NAMES, "mode 'm'")
    message = str(caught.value)
    assert message.startswith("mode 'm' = ")
    assert reason in message
    assert "\n" not in message
    assert len(message) < 300


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("x" * 200_001, "of at most 200000 characters; it has 200001"),
        ("(" + ")+(".join(["+".join(["x*y"] * 600)] * 12) + ")", "of at most 20000 numbers, names and operations"),
        ("sin(" * 40 + "x" + ")" * 40, "of at most 32 levels"),
        ("x**" * 40 + "x", "of at most 32 levels"),
        ("-" * 100 + "x", "of at most 32 levels"),
        ("-" * 100_000 + "x", "of fewer levels"),
        ("+".join(["x"] * 10_000), "of fewer levels, or of fewer terms; long sums can be added in brackets"),
        ("*".join(f"(x + {i})" for i in range(450)), "whose derivatives have at most 200000 operations"),
    ],
    ids=range(8),
)
def test_what_is_too_large_is_told_in_a_line(text, reason):
    with pytest.raises(DefinitionError) as caught:
        parse(text, NAMES, "event")
    assert reason in str(caught.value)
    assert len(str(caught.value)) < 300


def test_a_long_sum_is_an_expression():
    assert parse("+".join(["x"] * 1000), NAMES, "event") == 1000 * x


def test_powers_of_sums_that_cannot_be_written_out_are_not_expanded():
    assert can_be_expanded((x + y + a) ** 100)
    assert not can_be_expanded(x * (x + y + a + x * y + a**2) ** 999)
    assert not can_be_expanded(sympy.prod(x + y**k for k in range(1, 30)))
    power = (x + y + a + x * y) ** 999
    assert expanded(power) == power
    assert expanded(x * (x + y)) == x**2 + x * y


@pytest.mark.parametrize(
    ("inner", "slope"), [(sympy.log(x), 1 / x), (sympy.sqrt(x), 1 / (2 * sympy.sqrt(x))), (x**a, a * x ** (a - 1))]
)
def test_absolute_values_of_what_sympy_takes_for_complex_have_real_derivatives(inner, slope):
    derivative = _smooth_diff(y * sympy.Abs(inner) + sympy.sign(inner), x)
    for at in (0.3, 1.7):
        values = {x: at, y: 2.0, a: 0.7}
        expected = 2.0 * sympy.sign(inner.subs(values)) * slope.subs(values)
        assert float(derivative.subs(values)) == pytest.approx(float(expected), rel=1e-14)


_ATOMS = (
    "x",
    "y",
    "a",
    "2",
    "0",
    "3.5",
    "1e300",
    "1e-300",
    "pi",
    "0.5",
    "1e400",
    "E",
    "\u00b5",
    "True",
    "1j",
    "'s'",
    "x[0]",
)
_JUNK = "xa019.+-*/()[]{}:=,'\"\\ \n\t#@!%^&|~<>\u03bb\u00b5\u00b2\x00\u202e\ud800"


def _random_text(rng, depth):
    kind = rng.random()
    if depth == 0 or kind < 0.25:
        return rng.choice(_ATOMS[:10] if rng.random() < 0.9 else _ATOMS)
    if kind < 0.6:
        return f"({_random_text(rng, depth - 1)}{rng.choice('+-*/')}{_random_text(rng, depth - 1)})"
    if kind < 0.75:
        return f"{_random_text(rng, depth - 1)}**{_random_text(rng, depth - 1)}"
    if kind < 0.8:
        return f"-{_random_text(rng, depth - 1)}"
    name = rng.choice(tuple(FUNCTIONS))
    arguments = [_random_text(rng, depth - 1) for _ in range(2 if name == "atan2" else 1)]
    return f"{name}({', '.join(arguments)})"


@pytest.mark.campaign
def test_a_thousand_random_texts_are_expressions_or_told():
    rng = random.Random(20)
    texts = [_random_text(rng, rng.randrange(1, 5)) for _ in range(700)]
    texts += ["".join(rng.choice(_JUNK) for _ in range(rng.randrange(1, 25))) for _ in range(300)]
    read, messages = 0, []
    for text in texts:
        try:
            expression = parse(text, NAMES, "event")
        except DefinitionError as error:
            messages.append(str(error))
            continue
        read += 1
        assert not expression.has(sympy.I, sympy.zoo, sympy.nan, sympy.oo)
        [_smooth_diff(expression, symbol) for symbol in expression.free_symbols]
    assert 200 < read < 800
    assert max(map(len, messages)) < 400


@pytest.mark.parametrize(
    "expression",
    [sympy.I * x, sympy.oo, sympy.zoo, sympy.nan, sympy.Symbol("x + 1"), sympy.Matrix([x]), x < y],
)
def test_what_sympy_writes_as_a_name_or_as_no_expression_is_refused(expression):
    with pytest.raises(DefinitionError):
        parse(text_of(expression, "event"), ("x", "y", "I", "oo", "zoo", "nan"), "event")


@pytest.mark.parametrize("constant", [sympy.E, sympy.pi, sympy.EulerGamma, sympy.Catalan, sympy.GoldenRatio])
def test_a_constant_of_sympy_is_not_the_symbol_of_its_name(constant):
    names = ("x", str(constant))
    assert float(parse(text_of(constant + 0 * x, "event", names), names, "event")) == pytest.approx(float(constant))


@pytest.mark.parametrize("value", [np.float64(0.1), np.float32(0.5), np.int64(3), Fraction(2, 7), Decimal("0.1"), 3])
def test_numbers_of_every_kind_are_expressions(value):
    assert float(parse(text_of(value, "event"), (), "event")) == float(value)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 10**400, Decimal("NaN")])
def test_what_is_no_finite_number_is_no_expression(value):
    with pytest.raises(DefinitionError, match="must be a finite number"):
        text_of(value, "event")


@pytest.mark.campaign
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
