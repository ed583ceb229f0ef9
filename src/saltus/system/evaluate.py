"""Values of any expression along many states at once, by NumPy: an arithmetic grammar, never `eval`, and no SymPy."""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from saltus.errors import InputError
from saltus.system.grammar import FUNCTIONS, chain, syntax_tree

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from saltus.system.definition import Definition

__all__ = ["Expression", "check_expression", "evaluate", "read_expression"]

_Value: TypeAlias = Any  # float64 or an array of them
_Term: TypeAlias = Callable[[Mapping[str, _Value]], _Value]


def _held(system: Definition, parameters: Mapping[str, float] | None) -> Mapping[str, float]:
    """Return the values of all parameters; those of a solution under way may be out of their bounds."""
    if parameters is not None and all(name in parameters for name in system.parameter_names):
        return {name: parameters[name] for name in system.parameter_names}
    return system.resolve(parameters)


def evaluate(
    system: Definition,
    text: str,
    states: ArrayLike,
    modes: ArrayLike,
    parameters: Mapping[str, float] | None = None,
) -> NDArray[np.float64]:
    """Return the value of an expression at states, shape (m,).

    Parameters
    ----------
    system : Definition
        The system whose names the expression uses.
    text : str
        An expression in the states, the phase, the parameters and the outputs; numbers, ``pi``, ``+ - * / **``,
        parentheses and the functions of definitions (``sin``, ``sqrt``, ``atan2``, ...). As in definitions, a
        broken power of a negative number is 0.
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
        The text is not an expression, uses a name that is not there, or has a constant part without a value.

    Examples
    --------
    >>> from saltus.system import HybridSystem, Mode
    >>> fall = HybridSystem(("z", "v"), {"g": 2.0}, {"free": Mode({"z": "v", "v": "-g"})}, outputs={"T": "v**2/2"})
    >>> evaluate(fall, "T + g*z", [[1.0, 0.0], [0.0, -2.0]], [0, 0])
    array([2., 2.])
    """
    expression = _known(system, text)
    table = np.atleast_2d(np.asarray(states, dtype=np.float64))
    at = np.broadcast_to(np.asarray(modes, dtype=np.int64), len(table))
    constants: dict[str, _Value] = {name: np.float64(value) for name, value in _held(system, parameters).items()}
    known = (*system.all_states, *system.parameter_names)
    values = np.empty(len(table))
    with np.errstate(all="ignore"):
        for mode in np.unique(at).tolist():
            rows = at == mode
            columns = table.T if rows.all() else table[rows].T
            names = constants | dict(zip(system.all_states, columns, strict=True))
            outputs = expression.names.intersection(system.output_names)
            key = system.mode_names[mode]
            here = {name: read_expression(system.outputs[name][key], known).value(names) for name in outputs}
            values[rows] = expression.value(names | here)
    return values


def check_expression(system: Definition, text: str) -> None:
    """Raise `InputError` where `evaluate` cannot read the text, or does not know a name in it."""
    _known(system, text)


@dataclass(frozen=True)
class Expression:
    """What an expression computes from the values of its names."""

    value: _Term
    names: frozenset[str]


def _known(system: Definition, text: str) -> Expression:
    if not isinstance(text, str):
        raise InputError("expression", text, "text")
    return read_expression(text, (*system.all_states, *system.parameter_names, *system.output_names))


@lru_cache(maxsize=512)
def read_expression(text: str, names: tuple[str, ...]) -> Expression:
    """Return an expression in some names, which is evaluated by NumPy; raise `InputError` where it is none."""
    return _build(syntax_tree(text, names, "expression", InputError), frozenset(names))


def _build(node: ast.expr, names: frozenset[str]) -> Expression:
    """Return the expression of a checked tree."""
    match node:
        case ast.Constant(value=int(number) | float(number)):
            return _constant(float(number))
        case ast.Name(id=name) if name in names:
            return Expression(lambda values: values[name], frozenset((name,)))
        case ast.Name():
            return _constant(math.pi)
        case ast.UnaryOp(op=sign, operand=operand):
            inner = _build(operand, names)
            return _applied(np.negative, inner) if isinstance(sign, ast.USub) else inner
        case ast.BinOp(left=base, op=ast.Pow(), right=exponent):
            return _power(_build(base, names), _build(exponent, names))
        case ast.BinOp():
            first, operations = chain(node)
            steps = [(_OPERATORS[type(operation.op)], _build(operation.right, names)) for operation in operations]
            return _chained(_build(first, names), steps)
        case ast.Call(func=ast.Name(id=name), args=args):
            function, terms = _function(FUNCTIONS[name]), [_build(argument, names) for argument in args]
            return (
                _applied(function, *terms)
                if len(terms) == 1
                else _chained(terms[0], [(function, t) for t in terms[1:]])
            )
    raise AssertionError(node)


_OPERATORS: Mapping[type[ast.operator], Callable[..., _Value]] = {
    ast.Add: np.add, ast.Sub: np.subtract, ast.Mult: np.multiply, ast.Div: np.divide,
}  # fmt: skip

# Functions of another name in NumPy, or as compiled code means them: roots are 0 below 0, no sign is 0.
_OWN: Mapping[str, Callable[..., _Value]] = {
    "asin": np.arcsin, "acos": np.arccos, "atan": np.arctan, "atan2": np.arctan2,
    "asinh": np.arcsinh, "acosh": np.arccosh, "atanh": np.arctanh, "Abs": np.abs,
    "sqrt": lambda x: np.sqrt(np.maximum(x, 0.0)),
    "sign": lambda x: np.copysign(1.0, x),
    "deg": np.degrees, "rad": np.radians,
    "Max": np.maximum, "Min": np.minimum,
}  # fmt: skip


def _function(name: str) -> Callable[..., _Value]:
    if name == "erf":
        from scipy.special import erf

        return erf  # type: ignore[no-any-return]
    found: Callable[..., _Value] = _OWN[name] if name in _OWN else getattr(np, name)
    return found


def _constant(number: float) -> Expression:
    value = np.float64(number)
    return Expression(lambda values: value, frozenset())


def _applied(function: Callable[..., _Value], *terms: Expression) -> Expression:
    names = frozenset().union(*(term.names for term in terms))
    if len(terms) == 1:
        (only,) = terms
        return Expression(lambda values: function(only.value(values)), names)
    left, right = terms
    return Expression(lambda values: function(left.value(values), right.value(values)), names)


def _chained(first: Expression, steps: list[tuple[Callable[..., _Value], Expression]]) -> Expression:
    """Return a sum or a product, however long."""

    def value(values: Mapping[str, _Value]) -> _Value:
        total = first.value(values)
        for operator, term in steps:
            total = operator(total, term.value(values))
        return total

    return Expression(value, first.names.union(*(term.names for _, term in steps)))


def _power(base: Expression, exponent: Expression) -> Expression:
    """Return a power; a broken one is 0 for a negative base, as in compiled code, whose stages overshoot."""

    def value(x: _Value, a: _Value) -> _Value:
        return np.power(np.where((x < 0.0) & (a != np.floor(a)), 0.0, x), a)

    return _applied(value, base, exponent)
