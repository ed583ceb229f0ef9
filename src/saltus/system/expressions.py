"""Texts of mathematics to SymPy expressions: an arithmetic grammar, never `eval`."""

from __future__ import annotations

import ast
import keyword
import math
import numbers
import re
import unicodedata
from collections.abc import Collection, Mapping
from decimal import Decimal
from typing import TYPE_CHECKING, Any, NoReturn

from saltus import checks
from saltus.errors import DefinitionError
from saltus.system.grammar import CHARACTERS, FUNCTIONS, chain, clipped, syntax_tree

if TYPE_CHECKING:
    import sympy

__all__ = ["NAME", "Names", "check_name", "parse", "text_of"]

_EXPONENT = 1000  # largest exponent of what varies
_DIGITS = 30_000  # most digits of an exact power of two whole numbers
NAME = re.compile(r"(?<![\w.])[^\W\d]\w*")  # a name in a text, not the exponent of a number
_DERIVATIVES = 200_000  # most operations that the first derivatives of an expression may have, by a bound from above


def check_name(name: object, where: str) -> str:
    """Return `name` if it can name a state, parameter, output or phase; raise `DefinitionError` otherwise.

    Names that are declared win over functions and constants: only what cannot be read in an expression is refused.
    """
    if not isinstance(name, str) or not name.isidentifier():
        raise DefinitionError(where, name, "an identifier: letters, digits and underscores, no digit first")
    if keyword.iskeyword(name):
        raise DefinitionError(where, name, "a name that is not a Python keyword", f"call it {name + '_'!r}")
    if name.startswith("__"):
        raise DefinitionError(where, name, "a name that does not begin with two underscores")
    return name


class Names(tuple[str, ...]):
    """The names that a definition declares, and sub-expressions with names of their own, which `text_of` writes out.

    Parameters
    ----------
    names : iterable of str
        States, phase and parameters.

    Examples
    --------
    >>> names = Names(("x", "a")).with_let({"gap": "a - x", "force": "1/gap**2"})
    >>> text_of("2*force - gap", "output 'F'", names)
    '2*(1/(a - x)**2) - (a - x)'
    """

    let: Mapping[str, str]

    def with_let(self, let: Mapping[str, object]) -> Names:
        """Return the names with sub-expressions, each of which may use those before it.

        Parameters
        ----------
        let : mapping of str to expression
            The sub-expressions by name.

        Raises
        ------
        DefinitionError
            A name that is no identifier or is declared already, or what is no expression.
        """
        found = Names(self)
        found.let = known = {}
        for name, expression in let.items():
            key = _normal(check_name(name, "let"))
            if key in map(_normal, self):
                raise DefinitionError("let", name, "a name that no state, phase or parameter has")
            text = text_of(expression, f"let {name!r}", found)
            syntax_tree(text, found, f"let {name!r}")
            known[key] = f"({text})"
        return found

    def written_out(self, text: str, where: str) -> str:
        """Return a text with the sub-expressions in place of their names."""
        let = getattr(self, "let", {})
        if not let:
            return text
        full = NAME.sub(lambda found: let.get(_normal(found[0]), found[0]), text)
        if len(full) > CHARACTERS:
            allowed = f"an expression of at most {CHARACTERS} characters, sub-expressions written out"
            raise DefinitionError(where, clipped(text), allowed, f"it has {len(full)}")
        return full


def text_of(expression: object, where: str, names: Collection[str] = ("pi",)) -> str:
    """Return an expression (text, number or SymPy) as the text that `parse` reads back as the same expression.

    `names` are those that the definition declares: where ``pi`` is among them, SymPy's constant is written otherwise.
    """
    if isinstance(expression, numbers.Real | Decimal) and checks.is_real(expression):
        return _number_text(expression, where)
    if isinstance(expression, str):
        text = expression.strip()
    elif hasattr(type(expression), "free_symbols"):
        text = _sympy_text(expression, where, "acos(-1)" if "pi" in names else "pi")
    else:
        raise DefinitionError(where, expression, "an expression: text, a number or SymPy")
    return names.written_out(text, where) if isinstance(names, Names) else text


def _normal(name: str) -> str:
    """A name as Python's grammar reads it: the micro sign, for one, as the Greek letter."""
    return unicodedata.normalize("NFKC", name)


def _number_text(number: numbers.Real | Decimal, where: str) -> str:
    try:
        value = float(number)
    except (OverflowError, ValueError):
        value = math.inf
    if not math.isfinite(value):
        raise DefinitionError(where, value, "a finite number")
    match number:
        case numbers.Integral():
            return repr(int(number))
        case numbers.Rational():
            return f"{int(number.numerator)}/{int(number.denominator)}"
        case _:
            return repr(value)


def _sympy_text(expression: Any, where: str, pi: str) -> str:
    import sympy
    from sympy.printing.str import StrPrinter

    def refused(_printer: object, part: object) -> NoReturn:
        raise DefinitionError(where, clipped(str(expression)), f"of real, finite numbers, but {part} is in it")

    class Printer(StrPrinter):  # type: ignore[misc]
        """Text in which no constant has the name of a symbol."""

        _print_ImaginaryUnit = _print_Infinity = _print_NegativeInfinity = _print_ComplexInfinity = _print_NaN = refused

        def _print_Symbol(self, expr: Any) -> str:
            if not str(expr.name).isidentifier():
                raise DefinitionError(where, expr.name, "a symbol whose name is an identifier")
            return str(expr.name)

        _print_Dummy = _print_Symbol

        def _print_Float(self, expr: Any) -> str:
            return repr(float(expr))

        def _print_Exp1(self, _: Any) -> str:
            return "exp(1)"

        def _print_Pi(self, _: Any) -> str:
            return pi

        def _print_NumberSymbol(self, expr: Any) -> str:
            return repr(float(expr))

        _print_EulerGamma = _print_Catalan = _print_GoldenRatio = _print_TribonacciConstant = _print_NumberSymbol

    if not isinstance(expression, sympy.Expr):
        raise DefinitionError(where, clipped(str(expression)), "an expression: text, a number or SymPy")
    try:
        return str(Printer().doprint(expression))
    except RecursionError:
        raise DefinitionError(where, type(expression), "an expression", "it is nested too deeply") from None


def parse(text: str, names: Collection[str], where: str) -> sympy.Expr:
    """Return the SymPy expression that `text` writes in the given names.

    Only numbers, names, ``+ - * / **``, parentheses, ``pi`` and the functions of `FUNCTIONS` are read: the text is
    taken apart by Python's own grammar and never run.

    Parameters
    ----------
    names : collection of str
        Symbols that it may use (all real); they win over ``pi`` and over functions.
    where : str
        Which part of the definition it is, for messages.

    Returns
    -------
    sympy.Expr

    Raises
    ------
    DefinitionError
        The text is not an expression, or uses an unknown name. A part has no real and finite value. The expression is
        too large to be differentiated.

    Examples
    --------
    >>> parse("a*sin(theta)**2 - 1/3", ["a", "theta"], "event")
    a*sin(theta)**2 - 1/3
    """
    text = text.strip()
    tree = syntax_tree(text, names, where)
    try:
        return _Builder(text, frozenset(names), where).built(tree)
    except DefinitionError:
        raise
    except Exception as error:  # SymPy raises many kinds, of its own faults as well
        allowed = "an expression that SymPy can work out"
        raise DefinitionError(where, clipped(text), allowed, f"{type(error).__name__} in SymPy") from error


class _Builder:
    """The SymPy expression of a checked tree."""

    def __init__(self, text: str, names: frozenset[str], where: str) -> None:
        self.text, self.names, self.where = text, names, where

    def built(self, tree: ast.expr) -> sympy.Expr:
        """The expression, if its numbers and exponents are in range and its derivatives not too large."""
        import sympy

        expression = self.real(self.build(tree), tree)
        if not all(map(_fits, expression.atoms(sympy.Number))):
            self.no_value(tree)
        for power in expression.atoms(sympy.Pow):
            if not power.base.is_number and power.exp.is_number:
                self.check_exponent(power.exp)
        if _size_of_derivatives(expression)[1] > _DERIVATIVES:
            self.refuse(f"an expression whose derivatives have at most {_DERIVATIVES} operations")
        return expression

    def build(self, node: ast.expr) -> sympy.Expr:
        import sympy

        match node:
            case ast.Constant(value=int(value)):
                return sympy.Integer(value)
            case ast.Constant(value=float(value)):
                return sympy.Float(value, 17)
            case ast.Name(id=name):
                return sympy.Symbol(name, real=True) if name in self.names else sympy.pi
            case ast.UnaryOp(op=sign, operand=operand):
                inner = self.build(operand)
                return -inner if isinstance(sign, ast.USub) else inner
            case ast.BinOp(op=ast.Add() | ast.Sub()):
                first, operations = chain(node)
                terms = [self.build(first)]
                for operation in operations:
                    term = self.build(operation.right)
                    terms.append(term if isinstance(operation.op, ast.Add) else -term)
                return self.finite(sympy.Add(*terms), node)
            case ast.BinOp(op=ast.Mult() | ast.Div()):
                return self.product(node)
            case ast.BinOp(left=left, op=ast.Pow(), right=right):
                return self.real(self.power(self.build(left), self.build(right)), node)
            case ast.Call(func=ast.Name(id=name), args=args):
                return self.real(self.call(name, [self.build(arg) for arg in args]), node)
        raise AssertionError(node)

    def product(self, node: ast.BinOp) -> sympy.Expr:
        first, operations = chain(node)
        total = self.build(first)
        for operation in operations:
            factor = self.build(operation.right)
            if isinstance(operation.op, ast.Div) and factor.is_zero:
                self.refuse("an expression", "it divides by zero")
            total = self.finite(total * factor if isinstance(operation.op, ast.Mult) else total / factor, operation)
        return total

    def power(self, base: sympy.Expr, exponent: sympy.Expr) -> sympy.Expr:
        import sympy

        if exponent.is_Float and float(2 * exponent).is_integer():
            exponent = sympy.Rational(int(2 * exponent), 2)
        if base.is_Rational and exponent.is_Rational:
            if abs(float(exponent)) * math.log10(max(abs(base.p), base.q)) > _DIGITS:
                self.refuse(f"of exact numbers of at most {_DIGITS} digits", "2.0 for 2 makes a number a float")
        elif not base.is_Float and exponent.is_number:
            self.check_exponent(exponent)
        return base**exponent

    def call(self, name: str, arguments: list[sympy.Expr]) -> sympy.Expr:
        import sympy

        from saltus.system.choices import CHOICES

        if name == "exp":  # SymPy writes exp(c*log(x)) as a power
            for term in sympy.Add.make_args(arguments[0]):
                if term.has(sympy.log) and not term.is_number:
                    self.check_exponent(term.as_coeff_Mul()[0])
        if name in CHOICES:
            return CHOICES[name](*arguments)
        return getattr(sympy, FUNCTIONS[name])(*arguments)

    def real(self, expression: sympy.Expr, node: ast.expr) -> sympy.Expr:
        """The expression, if it is real and finite as far as SymPy can tell."""
        import sympy

        if expression.has(sympy.I, sympy.zoo, sympy.oo, -sympy.oo, sympy.nan, sympy.AccumBounds):
            self.no_value(node)
        is_negative = expression.is_Pow and expression.base.is_number and expression.base.is_negative
        if is_negative and not expression.exp.is_integer:
            self.refuse("of real numbers", "a negative number has no power that varies")
        return self.finite(expression, node)

    def finite(self, expression: sympy.Expr, node: ast.expr) -> sympy.Expr:
        """The expression, if its leading number is one that a float can hold."""
        import sympy

        if expression is sympy.zoo or not _fits(expression.as_coeff_Mul()[0]):
            self.no_value(node)
        return expression

    def check_exponent(self, exponent: sympy.Expr) -> None:
        if abs(exponent) > _EXPONENT:
            self.refuse(f"of exponents between -{_EXPONENT} and {_EXPONENT}")

    def no_value(self, node: ast.expr) -> NoReturn:
        source = clipped(ast.get_source_segment(self.text, node) or self.text)
        self.refuse(f"of real numbers that a float can hold, but {source} has none")

    def refuse(self, allowed: str, hint: str = "") -> NoReturn:
        raise DefinitionError(self.where, clipped(self.text), allowed, hint)


def _fits(number: sympy.Expr) -> bool:
    """Whether a number is one that a float can hold."""
    try:
        value = float(number)
    except (OverflowError, TypeError):
        return False
    return math.isfinite(value) and (value != 0.0 or bool(number.is_zero))


def _size_of_derivatives(expression: sympy.Expr) -> tuple[int, int]:
    """Operations of an expression, and a bound from above for those of its derivative."""
    if not expression.args:
        return 1, int(expression.is_Symbol)
    parts = [_size_of_derivatives(argument) for argument in expression.args]
    size = 1 + sum(own for own, _ in parts)
    varying = [slope for _, slope in parts if slope]
    if expression.is_Add:
        return size, sum(varying)
    return size, sum(slope + size for slope in varying)
