"""Exponents of a definition: a function next to nothing for most of the time may become large within a step.

Neither the last terms of a Taylor series nor the stages of a Runge-Kutta step show a pulse that lies ahead, such as
``exp(300*(cos(s) - 1))``. Its exponent shows it, as an exponent varies as slowly as what it is made of.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import sympy

if TYPE_CHECKING:
    from collections.abc import Iterable

__all__ = ["Exponent", "exponent_of", "exponents_in"]

_HIGH = 16  # power from which on it counts as a function with an exponent: a Taylor series has as many terms
_WAY = 8.0  # way of an exponent between two places that are looked at
_ENDS = 800.0  # size of an exponent beyond which exp is nothing or infinite with any coefficient: 1e308 is e^709
_AT_REST = 45.0  # size of an argument beyond which tanh rests: at 1 to within 1e-39
_LEAST = -1e4  # exponents below are this, as that of 0 is


class Exponent(NamedTuple):
    """What a function grows with, as ``exp(value)``, and the size of the value beyond which the function rests."""

    value: sympy.Expr
    rest: float = _ENDS

    def weight(self, value: str) -> str:
        """Text of 1 over how far an exponent may go from its value, a text."""
        return f"1.0/max({_WAY!r}, abs({value}) - {self.rest!r})"

    def way(self, one: str, other: str) -> str:
        """Text of the distance of two values, both texts, over what is allowed."""
        one, other = (f"max({value}, {_LEAST!r})" for value in (one, other))
        return f"abs({other} - {one})*{self.weight(f'min(abs({one}), abs({other}))')}"


def exponent_of(function: sympy.Expr, parameters: set[sympy.Expr]) -> Exponent | None:
    """Return the exponent of a function; None for one that has none.

    A power with a parameter as its exponent has none: it is a contact law, with a power below 3.

    Examples
    --------
    >>> exponent_of(sympy.exp(sympy.Symbol("x")), set()).value
    x
    """
    if function.is_Pow:
        base, power = function.as_base_exp()
        high = power > _HIGH if power.is_number else not power.free_symbols <= parameters
        return Exponent(power * sympy.log(sympy.Abs(base))) if high else None
    match function.func.__name__:
        case "exp" | "sinh" | "cosh":
            return Exponent(function.args[0])
        case "tanh":
            return Exponent(function.args[0], _AT_REST)
        case "erf":
            return Exponent(-(function.args[0] ** 2))
    return None


def exponents_in(expressions: Iterable[sympy.Expr], parameters: set[sympy.Expr]) -> list[Exponent]:
    """Return the exponents of all functions in expressions that vary along a motion, each once.

    Examples
    --------
    >>> x, y = sympy.symbols("x y")
    >>> [exponent.value for exponent in exponents_in([sympy.exp(x) + y, y + sympy.exp(x)], set())]
    [x]
    """
    functions = {f for e in expressions for f in e.atoms(sympy.Function, sympy.Pow) if not f.free_symbols <= parameters}
    found = {exponent_of(function, parameters) for function in functions}
    return sorted((e for e in found if e is not None), key=lambda e: (sympy.default_sort_key(e.value), e.rest))
