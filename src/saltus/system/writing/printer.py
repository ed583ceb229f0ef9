"""Expressions as Python text that is compiled: exact floats, powers as products, no infinite derivatives."""

from __future__ import annotations

import math
from typing import Any, NoReturn

import sympy
from sympy.printing.pycode import PythonCodePrinter

from saltus.errors import DefinitionError
from saltus.system.grammar import clipped
from saltus.system.powers import Power

__all__ = ["code_printer", "is_broken", "without_poles"]

_POLE = "pole"  # name of the function that stands for an inverse broken power


def is_broken(exponent: sympy.Expr) -> bool:
    """Whether an exponent is a number, but no integer."""
    return bool(exponent.is_number) and float(exponent) != math.floor(float(exponent))


def without_poles(expression: sympy.Expr) -> sympy.Expr:
    """Replace inverse broken powers by functions that are zero where their base is.

    A broken power of an event function has a pole on the surface in its second derivatives. The product with the pole
    vanishes there: the direction is tangential, or the time of the segment stands still. A power below 1 has a pole in
    its first derivatives too. For a root, their product with the clustered time's rate has a limit, which the flow of a
    segment adds. For powers above 1/2 this limit is 0.
    """
    pole = sympy.Function(_POLE)

    def has_pole(e: sympy.Expr) -> bool:
        return bool(e.is_Pow and is_broken(e.exp) and e.exp < 0 and not e.base.is_number)

    if not any(map(has_pole, expression.atoms(sympy.Pow))):
        return expression
    return expression.replace(has_pole, lambda e: pole(e.base, e.exp))


def _term(texts: list[str], k: int, *, clamped: bool) -> str:
    """A coefficient times a power and powers of its logarithm; where the base is 0, their limit."""
    base, exponent, _, coefficient = texts
    power = f"{base}**{exponent}"
    if clamped:
        power = f"({power} if {base} >= 0.0 or {exponent} == math.floor({exponent}) else 0.0)"
    logarithm = f"*math.log(abs({base}) if abs({base}) > 0.0 or {exponent} <= 0.0 else 1.0)"
    return f"(0.0 if {coefficient} == 0.0 else {coefficient}*{power}{logarithm * k})"


def code_printer(*, clamped: bool) -> Any:
    """Return what writes Python text; `clamped` where broken powers of negative numbers are 0."""

    def refused(_: object, expr: Any) -> NoReturn:
        shown = "a number that no float can hold" if expr.is_Number else clipped(str(expr), 40)
        raise DefinitionError("derivatives of the definition", shown, "of real numbers and functions of expressions")

    class Printer(PythonCodePrinter):  # type: ignore[misc]
        """Python text that is compiled: exact floats, powers as products."""

        _print_ImaginaryUnit = _print_Infinity = _print_NegativeInfinity = _print_ComplexInfinity = _print_NaN = refused
        _print_not_supported = emptyPrinter = refused

        def _print_Float(self, expr: Any) -> str:
            try:
                value = float(expr)
            except OverflowError:
                value = math.inf
            if not math.isfinite(value) or (value == 0.0 and not expr.is_zero):
                refused(self, expr)
            return repr(value)

        _print_Rational = _print_Float

        def _print_Integer(self, expr: Any) -> str:
            self._print_Float(expr)
            return f"{int(expr)}.0"

        def _print_Pi(self, expr: Any) -> str:
            return repr(float(sympy.pi))

        def _print_Exp1(self, expr: Any) -> str:
            return repr(math.e)

        def _print_sign(self, expr: Any) -> str:
            return f"math.copysign(1.0, {self._print(expr.args[0])})"

        def _print_Abs(self, expr: Any) -> str:
            return f"abs({self._print(expr.args[0])})"

        def _print_Max(self, expr: Any) -> str:
            return f"max({', '.join(map(self._print, expr.args))})"

        def _print_Min(self, expr: Any) -> str:
            return f"min({', '.join(map(self._print, expr.args))})"

        def _print_Pow(self, expr: Any, rational: bool = False, sqrt: str = "math.sqrt") -> str:
            base, exponent = expr.as_base_exp()
            text = f"({self._print(base)})"
            if exponent.is_Rational and exponent.q in (1, 2) and abs(exponent.p) <= 24:
                power = self._power(text, abs(int(exponent.p)), int(exponent.q))
                return power if exponent.p > 0 else f"(1.0/{power})"
            power = f"({self._print(exponent)})"
            if not clamped or (exponent.is_number and not is_broken(exponent)):
                return f"({text}**{power})"
            if exponent.is_number:
                return f"(max({text}, 0.0)**{power})"
            return f"({text}**{power} if {text} >= 0.0 or {power} == math.floor({power}) else 0.0)"

        def _print_Function(self, expr: Any) -> str:
            if isinstance(expr, Power):
                return _term([f"({self._print(part)})" for part in expr.args], int(expr.args[2]), clamped=clamped)
            if expr.func.__name__ != _POLE:
                return str(super()._print_Function(expr))
            base, exponent = f"({self._print(expr.args[0])})", expr.args[1]
            power = f"{base}**({self._print(exponent)})"
            if exponent.is_Rational and exponent.q == 2:
                power = f"1.0/{self._power(base, -int(exponent.p), 2)}"
            return f"({power} if {base} > 0.0 else 0.0)"

        @staticmethod
        def _power(base: str, p: int, q: int) -> str:
            whole, half = divmod(p, q)
            factors = [base] * whole
            if half:
                # stages of a step overshoot the surface where a root begins
                factors.append(f"math.sqrt(max({base}, 0.0))" if clamped else f"math.sqrt({base})")
            return f"({'*'.join(factors)})"

    return Printer({"fully_qualified_modules": True, "allow_unknown_functions": False})
