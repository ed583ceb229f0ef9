"""Values of any expression along many states at once, by NumPy: an arithmetic grammar, never `eval`, and no SymPy."""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from saltus.errors import InputError, nearest
from saltus.system.expressions import FUNCTIONS

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from saltus.system.hybrid import HybridSystem

__all__ = ["check_expression", "evaluate"]

_Value: TypeAlias = Any  # float64 or an array of them
_Term: TypeAlias = Callable[[Mapping[str, _Value]], _Value]


def evaluate(
    system: HybridSystem,
    text: str,
    states: ArrayLike,
    modes: ArrayLike,
    parameters: Mapping[str, float] | None = None,
) -> NDArray[np.float64]:
    """Return the value of an expression at states, shape (m,).

    Parameters
    ----------
    system : HybridSystem
        Whose names the expression uses.
    text : str
        An expression in the states, the phase, the parameters and the outputs; numbers, ``pi``, ``+ - * / **``,
        parentheses and the functions of definitions (``sin``, ``sqrt``, ``atan2``, ...). As in definitions, the root
        of a negative number is 0.
    states : array_like, shape (m, all states)
        Full states, the phase last.
    modes : array_like of int, shape (m,)
        Index of the mode of each: an output may be another expression in each mode.
    parameters : mapping of str to float, optional
        Values that differ from the defaults.

    Returns
    -------
    ndarray, shape (m,)
        Infinite or NaN where the expression has no value.

    Raises
    ------
    InputError
        The text is not an expression, or uses a name that is not there.

    Examples
    --------
    >>> from saltus.system.hybrid import HybridSystem, Mode
    >>> fall = HybridSystem(("z", "v"), {"g": 2.0}, {"free": Mode({"z": "v", "v": "-g"})}, outputs={"T": "v**2/2"})
    >>> evaluate(fall, "T + g*z", [[1.0, 0.0], [0.0, -2.0]], [0, 0])
    array([2., 2.])
    """
    expression = _known(system, text)
    table = np.atleast_2d(np.asarray(states, dtype=np.float64))
    at = np.broadcast_to(np.asarray(modes, dtype=np.int64), len(table))
    constants: dict[str, _Value] = {name: np.float64(value) for name, value in system.resolve(parameters).items()}
    values = np.empty(len(table))
    with np.errstate(all="ignore"):
        for mode in np.unique(at).tolist():
            rows = at == mode
            columns = table.T if rows.all() else table[rows].T
            names = constants | dict(zip(system.all_states, columns, strict=True))
            outputs = expression.names.intersection(system.output_names)
            key = system.mode_names[mode]
            here = {name: _read(system.outputs[name][key]).value(names) for name in outputs}
            values[rows] = expression.value(names | here)
    return values


def check_expression(system: HybridSystem, text: str) -> None:
    """Raise `InputError` where `evaluate` cannot read the text, or does not know a name in it."""
    _known(system, text)


@dataclass(frozen=True)
class _Expression:
    """What an expression computes from the values of its names."""

    value: _Term
    names: frozenset[str]


def _known(system: HybridSystem, text: str) -> _Expression:
    if not isinstance(text, str):
        raise InputError("expression", text, "text")
    expression = _read(text.strip())
    known = (*system.all_states, *system.parameter_names, *system.output_names)
    if unknown := sorted(expression.names.difference(known)):
        allowed = f"in {', '.join(known)} and pi, but {unknown[0]!r} is unknown"
        raise InputError("expression", text, allowed, nearest(unknown[0], known))
    return expression


@lru_cache(maxsize=512)
def _read(text: str) -> _Expression:
    try:
        tree = ast.parse(text, mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise InputError("expression", text, "an expression", "as in 'a*sin(theta) - v**2'") from None
    return _build(tree, text)


def _build(node: ast.expr, text: str) -> _Expression:
    """Return the expression of a node; the grammar is that of `saltus.system.expressions.parse`."""
    match node:
        case ast.Constant(value=bool()):
            pass
        case ast.Constant(value=int(number) | float(number)):
            return _constant(float(number))
        case ast.Name(id="pi"):
            return _constant(math.pi)
        case ast.Name(id=name):
            return _Expression(lambda values: values[name], frozenset((name,)))
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            inner = _build(operand, text)
            return _Expression(lambda values: -inner.value(values), inner.names)
        case ast.UnaryOp(op=ast.UAdd(), operand=operand):
            return _build(operand, text)
        case ast.BinOp(left=base, op=ast.Pow(), right=exponent):
            return _power(_build(base, text), _build(exponent, text))
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATORS:
            return _applied(_OPERATORS[type(op)], _build(left, text), _build(right, text))
        case ast.Call(func=ast.Name(id=name), args=args, keywords=[]) if name in FUNCTIONS:
            wanted = 2 if name == "atan2" else 1
            if len(args) == wanted:
                return _applied(_function(FUNCTIONS[name]), *(_build(argument, text) for argument in args))
            raise InputError("expression", text, f"an expression in which {name} has {wanted} argument(s)")
        case ast.Call(func=ast.Name(id=name)) if name not in FUNCTIONS:
            allowed = f"in the functions {', '.join(FUNCTIONS)}, but {name!r} is unknown"
            raise InputError("expression", text, allowed, nearest(name, FUNCTIONS))
        case _:
            pass
    allowed = "an expression of numbers, names, + - * / **, parentheses and functions"
    raise InputError("expression", text, allowed, "'^' is written '**'" if "^" in text else "")


_OPERATORS: Mapping[type[ast.operator], Callable[..., _Value]] = {
    ast.Add: np.add, ast.Sub: np.subtract, ast.Mult: np.multiply, ast.Div: np.divide,
}  # fmt: skip

_OWN: Mapping[str, Callable[..., _Value]] = {
    "asin": np.arcsin, "acos": np.arccos, "atan": np.arctan, "atan2": np.arctan2,
    "asinh": np.arcsinh, "acosh": np.arccosh, "atanh": np.arctanh, "Abs": np.abs,
    "sqrt": lambda x: np.sqrt(np.maximum(x, 0.0)),
    "sign": lambda x: np.copysign(1.0, x),
}  # fmt: skip
"""Functions of another name in NumPy, or as compiled code means them: roots are 0 below 0, no sign is 0."""


def _function(name: str) -> Callable[..., _Value]:
    if name == "erf":
        from scipy.special import erf

        return erf  # type: ignore[no-any-return]
    found: Callable[..., _Value] = _OWN[name] if name in _OWN else getattr(np, name)
    return found


def _constant(number: float) -> _Expression:
    value = np.float64(number)
    return _Expression(lambda values: value, frozenset())


def _applied(function: Callable[..., _Value], *terms: _Expression) -> _Expression:
    names = frozenset().union(*(term.names for term in terms))
    if len(terms) == 1:
        (only,) = terms
        return _Expression(lambda values: function(only.value(values)), names)
    left, right = terms
    return _Expression(lambda values: function(left.value(values), right.value(values)), names)


def _power(base: _Expression, exponent: _Expression) -> _Expression:
    """Return a power; a half-integer one is 0 for a negative base, as in compiled code, whose stages overshoot."""
    if not exponent.names:
        with np.errstate(all="ignore"):
            number = float(exponent.value({}))
        if (2.0 * number).is_integer() and not number.is_integer():
            return _applied(lambda x: np.power(np.maximum(x, 0.0), number), base)
    return _applied(np.power, base, exponent)
