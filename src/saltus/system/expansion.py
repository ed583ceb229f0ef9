"""Products and powers of sums multiplied out, where the result is short enough to be written."""

from __future__ import annotations

from collections.abc import Set
from math import comb

import sympy

__all__ = ["can_be_expanded", "expanded", "proportional"]

_TERMS = 20_000  # most terms of an expansion, some seconds


def expanded(expression: sympy.Expr) -> sympy.Expr:
    """Return `sympy.expand` of an expression; the expression itself where that has too many terms."""
    return sympy.expand(expression) if can_be_expanded(expression) else expression


def proportional(one: sympy.Expr, other: sympy.Expr, variables: Set[sympy.Symbol]) -> bool:
    """Whether the ratio of two expressions, other than 0, knows none of the variables: both are 0 at once.

    Examples
    --------
    >>> a, b, x, y = sympy.symbols("a b x y")
    >>> proportional(a * x - a * y, x - y, {x, y}), proportional(a * x - b * y, x - y, {x, y})
    (True, False)
    """
    common = one.free_symbols & variables
    if common != other.free_symbols & variables:
        return False
    return all(expanded(one * other.diff(x) - other * one.diff(x)) == 0 for x in common)


def can_be_expanded(expression: sympy.Expr) -> bool:
    """Whether no sum in the expanded expression has more than 20 000 terms.

    Examples
    --------
    >>> x, y, z = sympy.symbols("x y z")
    >>> can_be_expanded((x + y + z) ** 100), can_be_expanded((x + y + z) ** 500)
    (True, False)
    """
    return _terms(expression) <= _TERMS


def _terms(expression: sympy.Expr) -> int:
    """Terms of the expanded expression, by a bound from above; of its arguments where those have more."""
    if not expression.args:
        return 1
    inner = [_terms(argument) for argument in expression.args]
    if expression.is_Add:
        return sum(inner)
    count = 1
    if expression.is_Mul:
        for terms in inner:
            count = min(count * terms, _TERMS + 1)
    elif expression.is_Pow and expression.exp.is_Rational:
        power = int(abs(expression.exp))
        count = comb(power + inner[0] - 1, power) if power * inner[0] <= _TERMS else _TERMS + 1
    return max(count, *inner)
