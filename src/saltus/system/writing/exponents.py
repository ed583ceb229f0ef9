"""Exponents of a definition: a function next to nothing for most of the time may become large within a step.

Neither the last terms of a Taylor series nor the stages of a Runge-Kutta step show a pulse that lies ahead, such as
``exp(300*(cos(s) - 1))``. Its exponent shows it, as an exponent varies as slowly as what it is made of.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import sympy

if TYPE_CHECKING:
    from collections.abc import Iterable

__all__ = ["Exponent", "beyond", "exponent_of", "exponents_in", "kinks_in"]

_HIGH = 16  # power from which on it counts as a function with an exponent: a Taylor series has as many terms
_LOW = (
    -2.5
)  # power up to which it does: far from its pulse, of a width 1e-3, it is below 1e-12 of what the pulse brings
_WAY = 8.0  # way of an exponent between two places that are looked at
_SHARE = 0.75  # of the way to where a function at rest wakes, that its exponent may go
_ENDS = 800.0  # size of an exponent beyond which exp is nothing or infinite with any coefficient: 1e308 is e^709
_AT_REST = 45.0  # size of an argument beyond which tanh rests: at 1 to within 1e-39
_LEAST = -1e4  # exponents below are this, as that of 0 is
UNSEEN = 4.0  # what counts as the way where something may go unseen: more than any step may go
_TURNING = 6.0  # slope over bend of a parabola up to which it turns nearby: places are not equal, nor is it one
_NEAR = 0.2  # extreme of an argument, over its range in two parts of a step, below which it may reach beyond 0


_WITH = (sympy.Function, sympy.Pow, sympy.Mul)  # what may have an exponent


class Exponent(NamedTuple):
    """What a function grows with, as ``exp(value)``, and the size of the value beyond which the function rests."""

    value: sympy.Expr
    rest: float = _ENDS

    def weight(self, value: str) -> str:
        """Text of 1 over how far an exponent may go from its value, a text."""
        return f"1.0/max({_WAY!r}, {_SHARE!r}*(abs({value}) - {self.rest!r}))"

    def way(self, one: str, other: str) -> str:
        """Text of the distance of two values, both texts, over what is allowed."""
        one, other = (f"max({value}, {_LEAST!r})" for value in (one, other))
        return f"abs({other} - {one})*{self.weight(f'min(abs({one}), abs({other}))')}"

    def woken(self, *places: str) -> str:
        """Text of whether a function at rest in three places, texts of its value, may wake between: `UNSEEN` or 0."""
        awake = [f"(abs({value}) - {self.rest!r})" for value in places]
        return f"({beyond(*awake)} if min({', '.join(awake)}) > 0.0 else 0.0)"


def exponent_of(
    function: sympy.Expr, parameters: set[sympy.Expr], phase: sympy.Symbol | None = None
) -> Exponent | None:
    """Return the exponent of a function; None for one that has none.

    A power of a state with a parameter as its exponent has none: it is a contact law, with a power below 3.

    Examples
    --------
    >>> exponent_of(sympy.exp(sympy.Symbol("x")), set()).value
    x
    """
    if function.is_Pow:
        base, power = function.as_base_exp()
        if power.is_number:
            high = power > _HIGH or power <= _LOW
        else:
            high = not power.free_symbols <= parameters or base.free_symbols <= parameters | {phase}
        return Exponent(power / 2 * sympy.log(base**2)) if high else None
    if function.is_Mul:
        return _of_product(function, parameters)
    match function.func.__name__:
        case "exp" | "sinh" | "cosh":
            return Exponent(function.args[0])
        case "tanh":
            return Exponent(function.args[0], _AT_REST)
        case "erf":
            return Exponent(-(function.args[0] ** 2))
    return None


def _of_product(product: sympy.Expr, parameters: set[sympy.Expr]) -> Exponent | None:
    """Return the exponent of a product's negative powers, none of which has one by itself."""
    powers = [f.as_base_exp() for f in product.args if f.is_Pow and not f.free_symbols <= parameters]
    low = [(base, power) for base, power in powers if power.is_number and _LOW < power < 0]
    if sum(power for _, power in low) > _LOW:
        return None
    return Exponent(sympy.Add(*(power / 2 * sympy.log(base**2) for base, power in low)))


def exponents_in(
    expressions: Iterable[sympy.Expr], parameters: set[sympy.Expr], phase: sympy.Symbol | None = None
) -> list[Exponent]:
    """Return the exponents of all functions in expressions that vary along a motion, each once.

    Examples
    --------
    >>> x, y = sympy.symbols("x y")
    >>> [exponent.value for exponent in exponents_in([sympy.exp(x) + y, y + sympy.exp(x)], set())]
    [x]
    """
    functions = {f for e in expressions for f in e.atoms(*_WITH) if not f.free_symbols <= parameters}
    found = {exponent_of(function, parameters, phase) for function in functions}
    return sorted((e for e in found if e is not None), key=lambda e: (sympy.default_sort_key(e.value), e.rest))


def kinks_in(expressions: Iterable[sympy.Expr], parameters: set[sympy.Expr]) -> list[sympy.Expr]:
    """Return arguments of moduli and signs that vary along a motion: at their zeros there is a kink or a jump.

    Examples
    --------
    >>> x, y = sympy.symbols("x y")
    >>> kinks_in([abs(x - 1), sympy.sign(y)], set())
    [y, x - 1]
    """
    found = {call.args[0] for expression in expressions for call in expression.atoms(sympy.Abs, sympy.sign)}
    return sorted((kink for kink in found if not kink.free_symbols <= parameters), key=sympy.default_sort_key)


def beyond(a: str, b: str, c: str) -> str:
    """Text of whether what has a kink at 0 may reach beyond it unseen between three places: `UNSEEN`, else 0.

    It does where the parabola through its values a, b, c turns next to 0, or where b alone lies beyond.

    Examples
    --------
    >>> text = beyond("a", "b", "c")
    >>> eval(text, {"a": 1.0, "b": 1e-3, "c": 1.0}), eval(text, {"a": 1.0, "b": 0.5, "c": 1e-3})
    (4.0, 0.0)
    """
    bend, slope = f"(0.5*({a} + {c}) - {b})", f"(0.5*({c} - {a}))"
    extreme = f"({b} - {slope}*{slope}/(4.0*{bend}))"
    near = f"{extreme}*{b} < {_NEAR!r}*abs({b})*(max({a}, {b}, {c}) - min({a}, {b}, {c}))"
    turning = f"abs({slope}) <= {_TURNING!r}*abs({bend})"
    inside = f"({UNSEEN!r} if {near} else 0.0) if {turning} else 0.0"
    outside = f"{UNSEEN!r} if max({a}*{b}, {b}*{c}) < 0.0 else 0.0"
    return f"(({inside}) if min({a}*{b}, {b}*{c}, {b}*{bend}) > 0.0 else ({outside}))"
