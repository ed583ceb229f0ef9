"""The rounding of an expression as text: a running error bound, which the value brings along term by term.

The bound counts roundings of 1: times the spacing of floats it is the error, to first order, of the value that is
computed from states with errors of their own. It knows where large terms cancel, which no slope shows: the slopes of
``cos(x) - 1`` vanish with it.

References
----------
N. J. Higham, Accuracy and Stability of Numerical Algorithms, 2nd edition, SIAM 2002, section 3.3 (running errors).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import sympy

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

__all__ = ["LEAST", "rounding_lines"]

LEAST = "2.220446049250313e-16"  # spacing of floats at 1
_SMALLEST = "1e-300"  # base of a power that is 0
_CHOOSES = ("Max", "Min")


def rounding_lines(
    expression: sympy.Expr, text: Callable[[sympy.Expr], str], errors: Mapping[sympy.Expr, str]
) -> tuple[list[str], str, str]:
    """Return statements that compute an expression with its rounding, and the texts of both.

    Parameters
    ----------
    expression : sympy expression
        What is computed.
    text : callable
        Writes an expression as text.
    errors : mapping of symbol to str
        Texts of the errors of those symbols that have one, in roundings of 1.

    Examples
    --------
    >>> x = sympy.Symbol("x")
    >>> rounding_lines(x - 1, str, {x: "size"})
    (['v0 = x - 1', 'r0 = size + abs(v0)'], 'v0', 'r0')
    """
    shared, (last,) = sympy.cse([expression], symbols=sympy.numbered_symbols("c_"))
    writer = _Roundings(text, dict(errors))
    for symbol, value in shared:
        writer.known[symbol] = writer.of(value)
    value, rounding = writer.of(last)
    return writer.lines, text(value), rounding


class _Roundings:
    """Writes the statements; `known` has the value and the rounding of what is written already."""

    def __init__(self, text: Callable[[sympy.Expr], str], errors: dict[sympy.Expr, str]) -> None:
        self._text, self._errors = text, errors
        self.lines: list[str] = []
        self.known: dict[sympy.Expr, tuple[sympy.Expr, str]] = {}
        self._count = 0

    def of(self, expression: sympy.Expr) -> tuple[sympy.Expr, str]:
        """Value of an expression, a symbol or a number, and the text of its rounding, "" where it has none."""
        if expression in self.known:
            return self.known[expression]
        if expression in self._errors:
            return expression, self._errors[expression]
        if not expression.args or expression.is_number:
            return expression, "" if _is_exact(expression) else f"abs({self._text(expression)})"
        parts = [self.of(part) for part in expression.args]
        values = [value for value, _ in parts]
        value = self._named("v", self._text(expression.func(*values, evaluate=False)))
        own = [f"abs({value})"]
        if isinstance(expression, sympy.Add):
            terms = [error for _, error in parts if error]
            # one sum of two is rounded once; of more, each may be as large as all terms together
            own = own if len(values) == 2 else [f"abs({self._text(term)})" for term in values]
        elif isinstance(expression, sympy.Abs):
            terms, own = [error for _, error in parts if error], []
        elif expression.func.__name__ in _CHOOSES:
            terms, own = (
                [f"max({', '.join(error or '0.0' for _, error in parts)})"] if any(e for _, e in parts) else [],
                [],
            )
        elif isinstance(expression, sympy.sign):
            terms, own = [], []
        else:
            terms = [self._carried(expression, parts, i) for i, (_, error) in enumerate(parts) if error]
        rounding = self._named("r", " + ".join([*terms, *own]) or "0.0")
        self.known[expression] = value, str(rounding)
        return self.known[expression]

    def _carried(self, expression: sympy.Expr, parts: list[tuple[sympy.Expr, str]], i: int) -> str:
        """Text of what the rounding of part i does to a product, power or function."""
        error = parts[i][1]
        if isinstance(expression, sympy.Mul):
            others = [f"abs({self._text(other)})" for j, (other, _) in enumerate(parts) if j != i]
            return "*".join([*others, f"({error})"])
        if expression.is_Pow:
            return self._carried_by_power(parts, i)
        symbols = [sympy.Dummy(real=True) for _ in parts]
        values = dict(zip(symbols, (value for value, _ in parts), strict=True))
        return f"abs({self._text(sympy.diff(expression.func(*symbols), symbols[i]).xreplace(values))})*({error})"

    def _carried_by_power(self, parts: list[tuple[sympy.Expr, str]], i: int) -> str:
        """The same of a base, or of an exponent: next to 0 a broken power is as steep as its base is uncertain."""
        (base, _), (exponent, _) = parts
        error, power = parts[i][1], self._text(exponent)
        least = f"max(abs({self._text(base)}), {_SMALLEST})"
        if i == 1:
            return f"abs({self._text(base**exponent)}*math.log({least}))*({error})"
        if exponent.is_Integer and exponent > 0:
            return f"abs({self._text(exponent * base ** (exponent - 1))})*({error})"
        return f"abs({power})*max({least}, {LEAST}*({error}))**({power} - 1.0)*({error})"

    def _named(self, letter: str, text: str) -> sympy.Symbol:
        if letter == "v":
            self._count += 1
        name = f"{letter}{self._count - 1}"
        self.lines.append(f"{name} = {text}")
        return sympy.Symbol(name)  # not real: no state or parameter of that name is this symbol


def _is_exact(number: sympy.Expr) -> bool:
    """Whether a number is a float as it stands."""
    if not number.is_number:
        return True  # a parameter: that of the system which moves
    return bool(number.is_Rational) and math.log2(number.q).is_integer()
