"""Texts of mathematics to SymPy expressions: an arithmetic grammar, never `eval`."""

from __future__ import annotations

import ast
import keyword
from collections.abc import Collection
from typing import TYPE_CHECKING

from saltus.errors import DefinitionError, nearest

if TYPE_CHECKING:
    import sympy

__all__ = ["CONSTANTS", "FUNCTIONS", "check_name", "parse", "text_of"]

CONSTANTS = ("pi", "E", "I", "oo", "zoo", "nan", "EulerGamma", "GoldenRatio", "Catalan", "TribonacciConstant")
"""Names that mean a constant in SymPy; of these an expression may use `pi` only."""

FUNCTIONS = {
    "sin": "sin", "cos": "cos", "tan": "tan", "asin": "asin", "acos": "acos", "atan": "atan", "atan2": "atan2",
    "sinh": "sinh", "cosh": "cosh", "tanh": "tanh", "asinh": "asinh", "acosh": "acosh", "atanh": "atanh",
    "exp": "exp", "log": "log", "sqrt": "sqrt", "abs": "Abs", "Abs": "Abs", "sign": "sign", "erf": "erf",
}  # fmt: skip
"""Functions that an expression may call, and SymPy's names for them."""

_BINARY = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Pow: "**"}


def check_name(name: object, where: str) -> str:
    """Return `name` if it can name a state, parameter, mode output or phase; raise `DefinitionError` otherwise."""
    if not isinstance(name, str) or not name.isidentifier():
        raise DefinitionError(where, name, "an identifier: letters, digits and underscores, no digit first")
    if keyword.iskeyword(name):
        raise DefinitionError(where, name, "a name that is not a Python keyword", f"call it {name + '_'!r}")
    if name in CONSTANTS:
        raise DefinitionError(where, name, "a name that is not a constant of SymPy", f"call it {name + '_0'!r}")
    if name in FUNCTIONS:
        raise DefinitionError(where, name, "a name that is not a function of expressions", f"call it {name + '_0'!r}")
    return name


def text_of(expression: object, where: str) -> str:
    """Return an expression (text, number or SymPy) as the text that `parse` reads back as the same expression."""
    if isinstance(expression, bool):
        raise DefinitionError(where, expression, "an expression: text, a number or SymPy")
    if isinstance(expression, str):
        return expression.strip()
    if isinstance(expression, int | float):
        return repr(expression)
    if hasattr(expression, "free_symbols"):
        import sympy

        return str(sympy.sstr(expression, full_prec=True))
    raise DefinitionError(where, expression, "an expression: text, a number or SymPy")


def parse(text: str, names: Collection[str], where: str) -> sympy.Expr:
    """Return the SymPy expression that `text` writes in the given names.

    Only numbers, names, ``+ - * / **``, parentheses and the functions of `FUNCTIONS` are read: the text is taken apart
    by Python's own grammar and never run.

    Parameters
    ----------
    text : str
        The expression.
    names : collection of str
        Symbols that it may use (all real).
    where : str
        Which part of the definition it is, for messages.

    Returns
    -------
    sympy.Expr

    Raises
    ------
    DefinitionError
        The text is not an expression, or uses a name that is not there.

    Examples
    --------
    >>> parse("a*sin(theta)**2 - 1/3", ["a", "theta"], "event")
    a*sin(theta)**2 - 1/3
    """
    try:
        tree = ast.parse(text, mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise DefinitionError(where, text, "an expression", "as in 'a*sin(theta) - v**2'") from None
    return _build(tree, text, names, where)


def _build(node: ast.expr, text: str, names: Collection[str], where: str) -> sympy.Expr:
    import sympy

    match node:
        case ast.Constant(value=bool()):
            pass
        case ast.Constant(value=int(value)):
            return sympy.Integer(value)
        case ast.Constant(value=float(value)):
            return sympy.Float(value, 17)
        case ast.Name(id="pi"):
            return sympy.pi
        case ast.Name(id=name):
            if name in names:
                return sympy.Symbol(name, real=True)
            raise DefinitionError(
                where, text, f"in {', '.join(sorted(names))} and pi, but {name!r} is unknown", nearest(name, names)
            )
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return -_build(operand, text, names, where)
        case ast.UnaryOp(op=ast.UAdd(), operand=operand):
            return _build(operand, text, names, where)
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _BINARY:
            a, b = _build(left, text, names, where), _build(right, text, names, where)
            match _BINARY[type(op)]:
                case "+":
                    return a + b
                case "-":
                    return a - b
                case "*":
                    return a * b
                case "/":
                    if b == 0:
                        raise DefinitionError(where, text, "an expression", "it divides by zero")
                    return a / b
                case _:
                    half = b.is_Float and float(2 * b).is_integer()
                    return a ** (sympy.Rational(int(2 * b), 2) if half else b)
        case ast.Call(func=ast.Name(id=name), args=args, keywords=[]) if name in FUNCTIONS:
            wanted = 2 if name == "atan2" else 1
            if len(args) == wanted:
                return getattr(sympy, FUNCTIONS[name])(*(_build(arg, text, names, where) for arg in args))
            raise DefinitionError(where, text, f"an expression in which {name} has {wanted} argument(s)")
        case ast.Call(func=ast.Name(id=name)) if name not in FUNCTIONS:
            raise DefinitionError(
                where,
                text,
                f"in the functions {', '.join(FUNCTIONS)}, but {name!r} is unknown",
                nearest(name, FUNCTIONS),
            )
        case _:
            pass
    allowed = "an expression of numbers, names, + - * / **, parentheses and functions"
    raise DefinitionError(where, text, allowed, "'^' is written '**'" if "^" in text else "")
