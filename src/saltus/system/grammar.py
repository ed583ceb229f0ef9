"""The grammar of expressions: allowed parts, largest size, values of constants.

A text is taken apart by Python's own grammar and never run. Every constant part is computed in floating point first:
what has no real, finite value there is refused before anything slower sees it.
"""

from __future__ import annotations

import ast
import math
import unicodedata
from collections.abc import Callable, Collection, Iterator
from typing import NoReturn

from saltus.errors import DefinitionError, InputError, nearest

__all__ = ["CHARACTERS", "FUNCTIONS", "chain", "chosen_among", "clipped", "syntax_tree"]

# Functions that an expression may call, and SymPy's names for them.
FUNCTIONS = {
    "sin": "sin", "cos": "cos", "tan": "tan", "asin": "asin", "acos": "acos", "atan": "atan", "atan2": "atan2",
    "sinh": "sinh", "cosh": "cosh", "tanh": "tanh", "asinh": "asinh", "acosh": "acosh", "atanh": "atanh",
    "exp": "exp", "log": "log", "sqrt": "sqrt", "abs": "Abs", "Abs": "Abs", "sign": "sign", "erf": "erf",
    "Max": "Max", "Min": "Min", "degrees": "deg", "radians": "rad",
}  # fmt: skip

CHARACTERS = 200_000  # longest text
_NODES = 20_000  # most numbers, names, signs and calls in one
_DEPTH = 32  # deepest nesting of functions, powers and brackets; a sum or a product is one level, however long
_LISTED = 160  # characters of the known names that a message lists

_TIMES = ("t", "time")  # what a definition may call the time, which no expression knows
_CHOICES = ("Max", "Min")  # functions that choose one of their arguments

_SUM = (ast.Add, ast.Sub)
_PRODUCT = (ast.Mult, ast.Div)

_VALUES: dict[str, Callable[..., float]] = {
    **{name: getattr(math, name) for name in FUNCTIONS if hasattr(math, name)},
    "abs": abs, "Abs": abs, "sign": lambda x: math.copysign(1.0, x), "Max": max, "Min": min,
}  # fmt: skip


def syntax_tree(text: str, names: Collection[str], where: str, error: type[InputError] = DefinitionError) -> ast.expr:
    """Return the checked tree of an expression, with names spelled as they are declared.

    Parameters
    ----------
    names : collection of str
        Declared names; they win over ``pi`` and over functions.
    where : str
        Which part of the definition it is, for messages.
    error : type, optional
        Class of the exception that is raised.

    Raises
    ------
    InputError
        The text is no expression, is too large, uses an unknown name, or has a constant part without a real and finite
        value; of the type `error`.

    Examples
    --------
    >>> ast.unparse(syntax_tree("a*sin(theta) - 1/3", ["a", "theta"], "event"))
    'a * sin(theta) - 1 / 3'
    """
    reader = _Reader(text.strip(), names, where, error)
    tree = reader.tree()
    reader.value(tree)
    return tree


def chosen_among(text: str, names: Collection[str]) -> dict[str, set[str]]:
    """Return the calls of ``Max`` and ``Min`` in an expression, each with the names among their arguments.

    Parameters
    ----------
    names : collection of str
        Declared names.

    Examples
    --------
    >>> {call: sorted(used) for call, used in chosen_among("k*Max(x, 2*a)", ["x", "a", "k"]).items()}
    {'Max(x, 2*a)': ['a', 'x']}
    """
    if not any(f"{name}(" in text for name in _CHOICES):
        return {}
    tree = syntax_tree(text, names, "expression")
    calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call) and _name_of(node) in _CHOICES]
    return {
        ast.get_source_segment(text.strip(), call) or ast.unparse(call): {
            node.id for node in ast.walk(call) if isinstance(node, ast.Name) and node.id in names
        }
        for call in calls
    }


def chain(node: ast.BinOp) -> tuple[ast.expr, list[ast.BinOp]]:
    """Return the first operand of a sum or a product, and the operations on it from left to right."""
    alike = _alike(node.op)
    operations = [node]
    first = node.left
    while isinstance(first, ast.BinOp) and isinstance(first.op, alike):
        operations.append(first)
        first = first.left
    return first, operations[::-1]


def clipped(text: str, longest: int = 80) -> str:
    """Return a text, with the middle left out where it is long."""
    return text if len(text) <= longest else f"{text[: longest // 2]} ... {text[-longest // 4 :]}"


def _name_of(call: ast.Call) -> str:
    return call.func.id if isinstance(call.func, ast.Name) else ""


def _alike(operator: ast.operator) -> tuple[type[ast.operator], ...]:
    return next((group for group in (_SUM, _PRODUCT) if isinstance(operator, group)), ())


class _Reader:
    """One expression on its way to a checked tree."""

    def __init__(self, text: str, names: Collection[str], where: str, error: type[InputError]) -> None:
        self.text, self.where, self.error = text, where, error
        # Python's grammar reads the micro sign, for one, as the Greek letter
        self.names = {unicodedata.normalize("NFKC", name): name for name in names}

    def tree(self) -> ast.expr:
        """The tree, if the expression is not too large."""
        if len(self.text) > CHARACTERS:
            self.refuse(f"an expression of at most {CHARACTERS} characters", f"it has {len(self.text)}")
        try:
            tree = ast.parse(self.text, mode="eval").body
        except (SyntaxError, ValueError):
            self.refuse("an expression", self.power_sign() or "as in 'a*sin(theta) - v**2'")
        except (RecursionError, MemoryError):
            self.refuse("an expression of fewer levels, or of fewer terms", "long sums can be added in brackets")
        for count, depth in enumerate(_depths(tree), 1):
            if count > _NODES:
                self.refuse(f"an expression of at most {_NODES} numbers, names and operations")
            if depth > _DEPTH:
                self.refuse(f"an expression of at most {_DEPTH} levels of brackets, functions and powers")
        return tree

    def value(self, node: ast.expr) -> float | None:
        """Value of a constant part, None of any other; raise where it is no expression."""
        match node:
            case ast.Constant(value=bool()):
                pass
            case ast.Constant(value=int() | float()):
                return self.number(node)
            case ast.Name(id=name):
                return self.named(node, name)
            case ast.UnaryOp(op=ast.USub() | ast.UAdd() as sign, operand=operand):
                inner = self.value(operand)
                return -inner if inner is not None and isinstance(sign, ast.USub) else inner
            case ast.BinOp(op=ast.Add() | ast.Sub() | ast.Mult() | ast.Div()):
                return self.chained(node)
            case ast.BinOp(left=left, op=ast.Pow(), right=right):
                return self.applied(node, _power, self.value(left), self.value(right))
            case ast.Call(func=ast.Name(id=name), args=args, keywords=[]):
                return self.called(node, name, args)
            case _:
                pass
        self.refuse("an expression of numbers, names, + - * / **, parentheses and functions", self.power_sign())

    def number(self, node: ast.Constant) -> float:
        try:
            value = float(node.value)  # type: ignore[arg-type]
        except OverflowError:
            value = math.inf
        if math.isinf(value):
            self.no_value(node, "is too large for a float")
        mantissa = self.source(node).lower().replace("_", "").partition("e")[0] if value == 0.0 else ""
        if isinstance(node.value, float) and mantissa.strip("0."):
            self.no_value(node, "is too small for a float")
        return value

    def named(self, node: ast.Name, name: str) -> float | None:
        if name in self.names:
            node.id = self.names[name]
            return None
        if name == "pi":
            return math.pi
        hint = "it is a function: give it its argument" if name in FUNCTIONS else nearest(name, self.names)
        if name in _TIMES and not hint:
            hint = "a drive turns with a phase: phase=('theta', 'w') and cos(theta) in place of cos(w*t)"
        known = " and ".join(part for part in (clipped(", ".join(self.names.values()), _LISTED), "pi") if part)
        self.refuse(f"in {known}, but {clipped(name)!r} is unknown", hint)

    def called(self, node: ast.Call, name: str, args: list[ast.expr]) -> float | None:
        if name in self.names:
            hint = f"another name for it leaves {name} the function" if name in FUNCTIONS else "a product needs a *"
            self.refuse(f"an expression in which {name!r} is not called: the definition declares it", hint)
        if name not in FUNCTIONS:
            allowed = f"in the functions {', '.join(FUNCTIONS)}, but {clipped(name)!r} is unknown"
            self.refuse(allowed, nearest(name, FUNCTIONS))
        wanted = 2 if name == "atan2" or name in _CHOICES else 1
        if len(args) != wanted and not (name in _CHOICES and len(args) > wanted):
            more = " or more" if name in _CHOICES else ""
            self.refuse(f"an expression in which {name} has {wanted}{more} argument(s)")
        return self.applied(node, _VALUES[name], *map(self.value, args))

    def chained(self, node: ast.BinOp) -> float | None:
        first, operations = chain(node)
        total = self.value(first)
        for operation in operations:
            total = self.applied(operation, _OPERATIONS[type(operation.op)], total, self.value(operation.right))
        return total

    def applied(self, node: ast.expr, function: Callable[..., float], *values: float | None) -> float | None:
        """A function of values, where all are known."""
        known = [value for value in values if value is not None]
        if len(known) < len(values):
            return None
        value: complex
        try:
            value = function(*known)
        except ZeroDivisionError:
            self.no_value(node, "divides by zero")
        except OverflowError:
            value = math.inf
        except ValueError:
            value = 1j
        if not isinstance(value, float | int):
            self.no_value(node, "has no real value")
        if not math.isfinite(value):
            self.no_value(node, "is too large for a float")
        if value == 0.0 and _is_never_zero(function, known):
            self.no_value(node, "is too small for a float")
        return value

    def no_value(self, node: ast.expr, why: str) -> NoReturn:
        self.refuse(f"of real numbers that a float can hold, but {clipped(self.source(node))} {why}")

    def source(self, node: ast.expr) -> str:
        return ast.get_source_segment(self.text, node) or ast.unparse(node)

    def power_sign(self) -> str:
        return "'^' is written '**'" if "^" in self.text else ""

    def refuse(self, allowed: str, hint: str = "") -> NoReturn:
        raise self.error(self.where, clipped(self.text), allowed, hint) from None


def _depths(tree: ast.expr) -> Iterator[int]:
    """Depth of every node, those of a sum or a product counted as one level."""
    stack: list[tuple[ast.AST, int]] = [(tree, 1)]
    while stack:
        node, depth = stack.pop()
        yield depth
        goes_on = node.left if isinstance(node, ast.BinOp) and _continues(node) else None
        children = (child for child in ast.iter_child_nodes(node) if not isinstance(child, ast.operator | ast.unaryop))
        stack += [
            (child, depth if child is goes_on else depth + 1)
            for child in children
            if not isinstance(child, ast.expr_context)
        ]


def _continues(node: ast.BinOp) -> bool:
    return isinstance(node.left, ast.BinOp) and isinstance(node.left.op, _alike(node.op))


def _power(base: float, exponent: float) -> float:
    if base == 0.0 and exponent < 0.0:
        raise ZeroDivisionError
    return base**exponent  # type: ignore[no-any-return]


def _product(a: float, b: float) -> float:
    return a * b


def _quotient(a: float, b: float) -> float:
    return a / b


_OPERATIONS: dict[type[ast.operator], Callable[[float, float], float]] = {
    ast.Add: lambda a, b: a + b, ast.Sub: lambda a, b: a - b, ast.Mult: _product, ast.Div: _quotient,
}  # fmt: skip


def _is_never_zero(function: Callable[..., float], values: list[float]) -> bool:
    """Whether a result of 0 is one that a float cannot hold."""
    match function, values:
        case (f, [a, b]) if f is _product:
            return a != 0.0 and b != 0.0
        case (f, [a, _]) if f is _quotient or f is _power:
            return a != 0.0
        case _:
            return function is math.exp
