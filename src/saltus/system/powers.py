"""Powers whose exponent varies or is a parameter: their derivatives are finite wherever their limits are.

SymPy writes the derivative of ``x**n`` as ``n*x**n/x``, and that along ``n`` as ``x**n*log(x)``: 0/0 and 0 times
infinity at x = 0, where both are 0 for n > 1.
"""

from __future__ import annotations

from typing import Any

import sympy

__all__ = ["Power", "opened", "slope_of"]


class Power(sympy.Function):  # type: ignore[misc]
    """The term ``coefficient * base**exponent * log(base)**k``, which is its limit where the base is 0."""

    nargs = (4,)

    def fdiff(self, argindex: int = 1) -> Any:
        """Return the derivative in one of base, exponent, k and coefficient; k is a number."""
        base, exponent, k, coefficient = self.args
        if argindex == 1:
            lower = Power(base, exponent - 1, k - 1, k * coefficient) if k > 0 else sympy.S.Zero
            return Power(base, exponent - 1, k, exponent * coefficient) + lower
        return Power(base, exponent, k + 1, coefficient) if argindex == 2 else Power(base, exponent, k, sympy.S.One)

    def _eval_evalf(self, prec: int) -> Any:
        base, exponent, k, coefficient = self.args
        return (coefficient * base**exponent * sympy.log(base) ** k)._eval_evalf(prec)


def slope_of(expression: sympy.Expr, symbol: sympy.Symbol) -> sympy.Expr:
    """Return the derivative of an expression, in which derivatives of varying powers are each a `Power`.

    Examples
    --------
    >>> x, n = sympy.symbols("x n", real=True)
    >>> slope_of(x**n, x), slope_of(x**n, n), slope_of(x**3, x)
    (Power(x, n - 1, 0, n), Power(x, n, 1, 1), 3*x**2)
    """
    if not any(map(_varies, expression.atoms(sympy.Pow))):
        return sympy.diff(expression, symbol)
    terms = expression.replace(_varies, lambda power: Power(power.base, power.exp, sympy.S.Zero, sympy.S.One))
    return sympy.diff(terms, symbol).replace(_is_plain, lambda power: power.args[0] ** power.args[1])


def opened(expression: sympy.Expr) -> sympy.Expr:
    """Return an expression with each `Power` written as the product that it is."""
    return expression.replace(
        lambda e: isinstance(e, Power), lambda e: e.args[3] * e.args[0] ** e.args[1] * sympy.log(e.args[0]) ** e.args[2]
    )


def _varies(e: sympy.Expr) -> bool:
    return bool(e.is_Pow and not e.exp.is_number and not e.base.is_number)


def _is_plain(e: sympy.Expr) -> bool:
    return isinstance(e, Power) and e.args[2] == 0 and e.args[3] == 1
