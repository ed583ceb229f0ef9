"""Bounds of any expression over boxes of states, and whether a few places in a box show all that it does there.

Interval arithmetic encloses the values. Beside the bounds goes a mark, *plain*. No function within the expression
varies in the box by much more than its own scale. None has a corner, a jump or a pole there. Samples of a plain
expression miss nothing. Of another one they may, and the box is to be divided.

References
----------
R. E. Moore, R. B. Kearfott, M. J. Cloud, Introduction to Interval Analysis, SIAM 2009.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np

from saltus.errors import InputError
from saltus.scales import RESOLVED, RESOLVED_RATIO
from saltus.system.grammar import FUNCTIONS, chain, syntax_tree
from saltus.system.once import once

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.system.definition import Definition

__all__ = ["Range", "enclose", "is_polynomial", "may_jump"]

_TURN = 2.0 * math.pi


class Range(NamedTuple):
    """Bounds over boxes, and the mark; shape (box,) each, or numbers where all boxes have the same."""

    low: Any
    high: Any
    plain: Any

    @property
    def width(self) -> Any:
        """Greatest less least value; infinite where both are."""
        with np.errstate(invalid="ignore"):
            width = self.high - self.low
        return np.where(np.isnan(width), math.inf, width)

    @property
    def mixed(self) -> Any:
        """Whether both signs, or 0, are among the values."""
        return (self.low <= 0.0) & (self.high >= 0.0)

    @property
    def nearest(self) -> Any:
        """Least absolute value."""
        return np.where(self.mixed, 0.0, np.minimum(np.abs(self.low), np.abs(self.high)))


_Term: TypeAlias = "Callable[[Mapping[str, Range]], Range]"


def enclose(
    system: Definition,
    text: str,
    boxes: tuple[NDArray[np.float64], NDArray[np.float64]],
    modes: NDArray[np.int64],
    parameters: Mapping[str, float],
) -> Range:
    """Return bounds of an expression over boxes of states.

    Parameters
    ----------
    system : Definition
        The system whose names the expression uses.
    text : str
        The expression, as `saltus.system.evaluate.evaluate` takes it.
    boxes : tuple of ndarray, shape (box, all states)
        Least and greatest full states.
    modes : ndarray of int, shape (box,)
        Index of the mode of each.
    parameters : mapping of str to float
        All parameters.
    """
    names = (*system.all_states, *system.parameter_names, *system.output_names)
    term, used = _read(text, names)
    count = len(modes)
    low, high, plain = np.empty(count), np.empty(count), np.empty(count, dtype=bool)
    fixed = {name: Range(value, value, True) for name, value in parameters.items()}
    outputs = used.intersection(system.output_names)
    with np.errstate(all="ignore"):
        for mode in np.unique(modes).tolist():
            rows = modes == mode
            known = fixed | {
                name: Range(a, b, True)
                for name, a, b in zip(system.all_states, boxes[0][rows].T, boxes[1][rows].T, strict=True)
            }
            key = system.mode_names[mode]
            here = {name: _read(system.outputs[name][key], names)[0](known) for name in outputs}
            low[rows], high[rows], plain[rows] = term(known | here)
    return Range(low, high, plain)


@once
def is_polynomial(system: Definition, text: str) -> bool:
    """Return whether an expression is, in every mode, a polynomial of low degree in the states."""
    names = (*system.all_states, *system.parameter_names, *system.output_names)
    moving = frozenset(system.all_states)
    texts = [text]
    used = _read(text, names)[1].intersection(system.output_names)
    texts += [system.outputs[name][mode] for name in used for mode in system.mode_names]
    degrees = [_degree(syntax_tree(one, names, "expression", InputError), moving | used) for one in texts]
    return max(degrees) <= 2 if used else degrees[0] <= 4


@once
def may_jump(system: Definition, text: str) -> bool:
    """Return whether an expression may jump within a mode: it has a sign, or divides by what has a corner.

    Where it has corners alone, as a modulus or the largest of several, its integral has a derivative.
    """
    names = (*system.all_states, *system.parameter_names, *system.output_names)
    used = _read(text, names)[1].intersection(system.output_names)
    texts = [text, *(system.outputs[name][mode] for name in used for mode in system.mode_names)]
    trees = [syntax_tree(one, names, "expression", InputError) for one in texts]
    if any(_called(tree) & _JUMPS for tree in trees):
        return True
    bent = {name for name, tree in zip(["", *(n for n in used for _ in system.mode_names)], trees, strict=True)
            if _called(tree) & _CORNERS}  # fmt: skip
    return any(_divides(node) and (_called(node.right) & _CORNERS or _named(node.right) & bent or
               (isinstance(node.op, ast.Pow) and (_called(node.left) & _CORNERS or _named(node.left) & bent)))
               for tree in trees for node in ast.walk(tree) if isinstance(node, ast.BinOp))  # fmt: skip


_JUMPS = frozenset({"sign", "atan2"})
_CORNERS = frozenset({"abs", "Abs", "Max", "Min"})


def _called(tree: ast.AST) -> frozenset[str]:
    calls = (node.func for node in ast.walk(tree) if isinstance(node, ast.Call))
    return frozenset(function.id for function in calls if isinstance(function, ast.Name))


def _named(tree: ast.AST) -> frozenset[str]:
    return frozenset(node.id for node in ast.walk(tree) if isinstance(node, ast.Name))


def _divides(node: ast.BinOp) -> bool:
    """Return whether a quotient, or a power that may have a negative exponent."""
    if isinstance(node.op, ast.Div):
        return True
    return isinstance(node.op, ast.Pow) and not (
        isinstance(node.right, ast.Constant) and isinstance(node.right.value, int | float) and node.right.value > 0
    )


def _degree(node: ast.expr, moving: frozenset[str]) -> float:
    """Return the degree of a checked tree in the names that move; infinite for what is no polynomial."""
    match node:
        case ast.Name(id=name):
            return 1.0 if name in moving else 0.0
        case ast.UnaryOp(operand=operand):
            return _degree(operand, moving)
        case ast.BinOp(left=base, op=ast.Pow(), right=ast.Constant(value=int(power))) if power >= 0:
            return _degree(base, moving) * power
        case ast.BinOp(left=base, op=ast.Pow(), right=power):
            return math.inf if _degree(base, moving) or _degree(power, moving) else 0.0
        case ast.BinOp():
            first, operations = chain(node)
            degree = _degree(first, moving)
            for one in operations:
                right = _degree(one.right, moving)
                if isinstance(one.op, ast.Div):
                    degree = math.inf if right else degree
                else:
                    degree = degree + right if isinstance(one.op, ast.Mult) else max(degree, right)
            return degree
        case ast.Call(args=args):
            return math.inf if any(_degree(argument, moving) for argument in args) else 0.0
    return 0.0


@lru_cache(maxsize=512)
def _read(text: str, names: tuple[str, ...]) -> tuple[_Term, frozenset[str]]:
    tree = syntax_tree(text, names, "expression", InputError)
    used = frozenset(node.id for node in ast.walk(tree) if isinstance(node, ast.Name))
    return _build(tree, frozenset(names)), used


def _build(node: ast.expr, names: frozenset[str]) -> _Term:
    """Return the bounds of a checked tree."""
    match node:
        case ast.Constant(value=int(number) | float(number)):
            return _constant(float(number))
        case ast.Name(id=name) if name in names:
            return lambda values: values[name]
        case ast.Name():
            return _constant(math.pi)
        case ast.UnaryOp(op=sign, operand=operand):
            inner = _build(operand, names)
            return (lambda values: _negative(inner(values))) if isinstance(sign, ast.USub) else inner
        case ast.BinOp(left=base, op=ast.Pow(), right=exponent):
            below, above = _build(base, names), _build(exponent, names)
            return lambda values: _power(below(values), above(values))
        case ast.BinOp():
            first, operations = chain(node)
            steps = [(_OPERATORS[type(operation.op)], _build(operation.right, names)) for operation in operations]
            return _chained(_build(first, names), steps)
        case ast.Call(func=ast.Name(id=name), args=args):
            known, terms = FUNCTIONS[name], [_build(argument, names) for argument in args]
            if len(terms) == 1:
                (only,), function = terms, _OF_ONE[known]
                return lambda values: function(only(values))
            return _chained(terms[0], [(_OF_TWO[known], term) for term in terms[1:]])
    raise AssertionError(node)


def _constant(number: float) -> _Term:
    value = Range(number, number, True)
    return lambda values: value


def _chained(first: _Term, steps: list[tuple[Callable[[Range, Range], Range], _Term]]) -> _Term:
    def bounds(values: Mapping[str, Range]) -> Range:
        total = first(values)
        for operator, term in steps:
            total = operator(total, term(values))
        return total

    return bounds


def _bounded(low: Any, high: Any, plain: Any) -> Range:
    """Return a range in which what cannot be told is unbounded."""
    return Range(np.where(np.isnan(low), -np.inf, low), np.where(np.isnan(high), np.inf, high), plain)


def _negative(a: Range) -> Range:
    return Range(-a.high, -a.low, a.plain)


def _sum(a: Range, b: Range) -> Range:
    return _bounded(a.low + b.low, a.high + b.high, a.plain & b.plain)


def _difference(a: Range, b: Range) -> Range:
    return _bounded(a.low - b.high, a.high - b.low, a.plain & b.plain)


def _product(a: Range, b: Range) -> Range:
    corners = [_times(x, y) for x in (a.low, a.high) for y in (b.low, b.high)]
    low = np.minimum(np.minimum(corners[0], corners[1]), np.minimum(corners[2], corners[3]))
    high = np.maximum(np.maximum(corners[0], corners[1]), np.maximum(corners[2], corners[3]))
    return _bounded(low, high, a.plain & b.plain)


def _times(x: Any, y: Any) -> Any:
    """Return a product in which 0 times an unbounded value is 0: a bound of the values, none of which is infinite."""
    product = np.multiply(x, y)
    return np.where(np.isnan(product) & (np.equal(x, 0.0) | np.equal(y, 0.0)), 0.0, product)


def _inverse(a: Range) -> Range:
    low, high = np.where(a.mixed, -np.inf, np.divide(1.0, a.high)), np.where(a.mixed, np.inf, np.divide(1.0, a.low))
    low = np.where(a.mixed & (np.asarray(a.low) >= 0.0), np.divide(1.0, a.high), low)
    high = np.where(a.mixed & (np.asarray(a.high) <= 0.0), np.divide(1.0, a.low), high)
    return _bounded(low, high, a.plain & _apart(a))


def _apart(a: Range) -> Any:
    """Whether a range keeps away from 0, seen from its own width."""
    most = np.maximum(np.abs(a.low), np.abs(a.high))
    return (a.nearest > 0.0) & (most <= RESOLVED_RATIO * a.nearest)


def _quotient(a: Range, b: Range) -> Range:
    return _product(a, _inverse(b))


def _power(a: Range, b: Range) -> Range:
    if np.ndim(b.low) == 0 and b.low == b.high:
        exponent = float(b.low)
        return _whole_power(a, int(exponent)) if exponent == int(exponent) else _root_power(a, exponent)
    grown = _exp(_product(b, _log(Range(np.maximum(a.low, 0.0), np.maximum(a.high, 0.0), a.plain))))
    return Range(np.where(np.asarray(a.low) < 0.0, np.minimum(grown.low, 0.0), grown.low), grown.high, grown.plain)


def _whole_power(a: Range, exponent: int) -> Range:
    if exponent < 0:
        return _inverse(_whole_power(a, -exponent))
    low, high = np.power(a.low, exponent), np.power(a.high, exponent)
    if exponent % 2 == 0 and exponent:
        low, high = np.where(a.mixed, 0.0, np.minimum(low, high)), np.maximum(low, high)
    most = np.maximum(np.abs(a.low), np.abs(a.high))
    plain = a.plain if exponent <= 2 else a.plain & ((exponent <= 4) | (exponent * a.width <= RESOLVED * most))
    return _bounded(low, high, plain)


def _root_power(a: Range, exponent: float) -> Range:
    """Return a broken power, which is 0 of what is negative."""
    if exponent < 0.0:
        below = np.asarray(a.high) < 0.0
        found = _inverse(_root_power(a, -exponent))
        return Range(np.where(below, np.inf, found.low), np.where(below, np.inf, found.high), found.plain | below)
    low, high = np.power(np.maximum(a.low, 0.0), exponent), np.power(np.maximum(a.high, 0.0), exponent)
    return Range(low, high, a.plain & ((np.asarray(a.high) <= 0.0) | ((np.asarray(a.low) > 0.0) & _apart(a))))


def _monotone(function: Callable[[Any], Any], scale: Callable[[Range], Any]) -> Callable[[Range], Range]:
    """Return the bounds of a function that grows, and is resolved up to a width of its argument."""
    return lambda a: _bounded(function(a.low), function(a.high), a.plain & (a.width <= scale(a)))


_exp = _monotone(np.exp, lambda a: RESOLVED)


def _log(a: Range) -> Range:
    outside = np.asarray(a.high) < 0.0  # no value there: nothing to find
    low, high = np.log(np.maximum(a.low, 0.0)), np.log(np.maximum(a.high, 0.0))
    return Range(low, high, a.plain & (outside | ((np.asarray(a.low) > 0.0) & _apart(a))))


def _cosine(a: Range) -> Range:
    full = a.width >= _TURN
    ends = np.cos(a.low), np.cos(a.high)
    top = full | (np.floor(a.high / _TURN) * _TURN >= a.low)
    bottom = full | (np.floor((a.high - math.pi) / _TURN) * _TURN + math.pi >= a.low)
    low = np.where(bottom, -1.0, np.minimum(*ends))
    high = np.where(top, 1.0, np.maximum(*ends))
    return _bounded(low, high, a.plain & (a.width <= RESOLVED))


def _sine(a: Range) -> Range:
    return _cosine(Range(a.low - 0.5 * math.pi, a.high - 0.5 * math.pi, a.plain))


def _tangent(a: Range) -> Range:
    sheets = np.floor(a.low / math.pi + 0.5), np.floor(a.high / math.pi + 0.5)
    same = sheets[0] == sheets[1]
    low, high = np.where(same, np.tan(a.low), -np.inf), np.where(same, np.tan(a.high), np.inf)
    edge = np.minimum(a.low / math.pi + 0.5 - sheets[0], sheets[1] + 0.5 - a.high / math.pi) * math.pi
    return Range(low, high, a.plain & same & (a.width <= (RESOLVED_RATIO - 1.0) * edge))


def _on(function: Callable[[Any], Any], least: float, most: float) -> Callable[[Range], Range]:
    """Return the bounds of a growing function that has a domain, with singular ends."""

    def bounds(a: Range) -> Range:
        low, high = np.clip(a.low, least, most), np.clip(a.high, least, most)
        edge = np.minimum(low - least, most - high)
        outside = (np.asarray(a.high) < least) | (np.asarray(a.low) > most)
        plain = a.plain & (outside | (a.width <= (RESOLVED_RATIO - 1.0) * edge))
        return _bounded(function(low), function(high), plain)

    return bounds


def _absolute(a: Range) -> Range:
    high = np.maximum(np.abs(a.low), np.abs(a.high))
    return Range(a.nearest, high, a.plain & ((np.asarray(a.low) >= 0.0) | (np.asarray(a.high) <= 0.0)))


def _sign(a: Range) -> Range:
    one = (np.asarray(a.low) > 0.0) | (np.asarray(a.high) < 0.0)
    return Range(np.copysign(1.0, a.low), np.where(np.asarray(a.high) >= 0.0, 1.0, -1.0), one)


def _largest(a: Range, b: Range) -> Range:
    first, second = np.asarray(a.low) >= b.high, np.asarray(b.low) >= a.high
    plain = np.where(first, a.plain, np.where(second, b.plain, False))
    return Range(np.maximum(a.low, b.low), np.maximum(a.high, b.high), plain)


def _smallest(a: Range, b: Range) -> Range:
    return _negative(_largest(_negative(a), _negative(b)))


def _angle(y: Range, x: Range) -> Range:
    """Return the bounds of atan2; its cut is where y is 0 and x negative."""
    cut = y.mixed & (np.asarray(x.low) <= 0.0)
    corners = [np.arctan2(b, a) for b in (y.low, y.high) for a in (x.low, x.high)]
    low = np.where(cut, -math.pi, np.min(np.broadcast_arrays(*corners), axis=0))
    high = np.where(cut, math.pi, np.max(np.broadcast_arrays(*corners), axis=0))
    near = np.hypot(x.nearest, y.nearest)
    plain = x.plain & y.plain & ~cut & (np.hypot(x.width, y.width) <= (RESOLVED_RATIO - 1.0) * near)
    return Range(low, high, plain)


def _hyperbolic_cosine(a: Range) -> Range:
    return _bounded(
        np.cosh(a.nearest), np.cosh(np.maximum(np.abs(a.low), np.abs(a.high))), a.plain & (a.width <= RESOLVED)
    )


def _error_function(a: Range) -> Range:
    from scipy.special import erf

    return Range(erf(a.low), erf(a.high), a.plain & (a.width <= 0.5 * RESOLVED))


def _near_one(a: Range) -> Any:
    """Return the width that is resolved where the singularities lie beside the axis, about 1 from 0."""
    return 0.25 * RESOLVED * np.maximum(1.0, a.nearest)


def _scaled(factor: float) -> Callable[[Range], Range]:
    return lambda a: Range(factor * a.low, factor * a.high, a.plain)


_OPERATORS: Mapping[type[ast.operator], Callable[[Range, Range], Range]] = {
    ast.Add: _sum,
    ast.Sub: _difference,
    ast.Mult: _product,
    ast.Div: _quotient,
}
_OF_TWO = {"Max": _largest, "Min": _smallest, "atan2": _angle}
_OF_ONE: dict[str, Callable[[Range], Range]] = {
    "sin": _sine, "cos": _cosine, "tan": _tangent, "exp": _exp, "log": _log, "Abs": _absolute, "sign": _sign,
    "sqrt": lambda a: _root_power(a, 0.5), "asin": _on(np.arcsin, -1.0, 1.0),
    "acos": lambda a: _negative(_on(lambda x: -np.arccos(x), -1.0, 1.0)(a)),
    "acosh": _on(np.arccosh, 1.0, math.inf), "atanh": _on(np.arctanh, -1.0, 1.0),
    "atan": _monotone(np.arctan, _near_one), "asinh": _monotone(np.arcsinh, _near_one),
    "tanh": _monotone(np.tanh, lambda a: 0.375 * RESOLVED), "sinh": _monotone(np.sinh, lambda a: RESOLVED),
    "cosh": _hyperbolic_cosine, "erf": _error_function, "Max": lambda a: a, "Min": lambda a: a,
    "deg": _scaled(180.0 / math.pi), "rad": _scaled(math.pi / 180.0),
}  # fmt: skip
