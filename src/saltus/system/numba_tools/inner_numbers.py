"""Arithmetic of inner functions: numbers of three widths, conditions, integers and floats, as Numba has them."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types

from saltus.system.numba_tools.inner_values import WORD, Record, Scalar, llvm_type

__all__ = ["BOOL", "DOUBLE", "FLOAT", "INT", "NONE", "TRUTH", "WIDTH", "Numbers", "alike", "common"]

BOOL = types.boolean
INT = types.int64
FLOAT = types.float64
NONE = types.none
WIDTH = {BOOL: 0, INT: 1, FLOAT: 2}
"""Of a number: one may stand where a wider one is wanted."""

DOUBLE = ir.DoubleType()
TRUTH = ir.IntType(1)
_OF_FLOATS = {ast.Add: "fadd", ast.Sub: "fsub", ast.Mult: "fmul", ast.Div: "fdiv"}
_OF_INTEGERS = {
    ast.Add: "add", ast.Sub: "sub", ast.Mult: "mul", ast.BitOr: "or_", ast.BitAnd: "and_", ast.BitXor: "xor",
    ast.LShift: "shl", ast.RShift: "ashr",
}  # fmt: skip
_KNOWN = {ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.BitOr: operator.or_}
_OF_WHOLE = {ast.FloorDiv: operator.floordiv, ast.Mod: operator.mod}


class Numbers:
    """The arithmetic of a function that becomes LLVM code.

    Parameters
    ----------
    context : Numba's target context
        What lowers elementary functions.
    function : Inner
        The function.
    code : ir.Function
        What is written.
    sought : bool
        Whether types alone are sought.
    """

    def __init__(self, context: Any, function: Any, code: ir.Function, sought: bool) -> None:
        self._context, self._function, self._code, self._sought = context, function, code, sought
        self._entry = code.append_basic_block("entry")
        self._start = code.append_basic_block("start")
        self._builder = ir.IRBuilder(self._start)

    def _refused(self, node: ast.AST) -> NotImplementedError:
        return NotImplementedError(f"{ast.unparse(node)} in the inner function {self._function.function.__qualname__}")

    def _at_entry(self) -> ir.IRBuilder:
        """Return what writes at the function's beginning, where places on the stack are taken."""
        return ir.IRBuilder(self._entry)

    def _number(self, value: Any) -> Scalar:
        """Return a number that the text has."""
        match value:
            case bool() | np.bool_():
                return Scalar(BOOL, TRUTH(int(value)), bool(value))
            case int() | np.integer():
                return Scalar(INT, WORD(int(value)), int(value))
        return Scalar(FLOAT, DOUBLE(float(value)), float(value))

    def _integer(self, value: Any) -> Any:
        if value.key not in (INT, BOOL):
            raise NotImplementedError(f"{value.key} as an index or a bound in {self._function.function.__qualname__}")
        return self._converted(value, INT).value

    def _float(self, value: Any) -> Any:
        return self._converted(value, FLOAT).value

    def _converted(self, value: Any, key: Any) -> Any:
        """Return a value as one of another key, which is not narrower."""
        if isinstance(key, tuple):
            if not isinstance(value, Record) or len(value.items) != len(key[1]):
                raise NotImplementedError(f"{value.key} as {key}")
            return Record(tuple(self._converted(*pair) for pair in zip(value.items, key[1], strict=True)), key[0])
        if value.key == key:
            return value
        if value.key not in WIDTH or key not in WIDTH or WIDTH[key] < WIDTH[value.key]:
            raise NotImplementedError(f"{value.key} as {key} in {self._function.function.__qualname__}")
        if isinstance(value.value, ir.Constant) and value.known is not None:
            return self._number({INT: int, FLOAT: float}[key](value.known))
        if value.key == BOOL:
            value = Scalar(INT, self._builder.zext(value.value, WORD))
        return value if key == INT else Scalar(FLOAT, self._builder.sitofp(value.value, DOUBLE))

    def _as_truth(self, value: Any) -> Scalar:
        if value.key == BOOL:
            return value  # type: ignore[no-any-return]
        if value.key == INT:
            return Scalar(BOOL, self._builder.icmp_signed("!=", value.value, WORD(0)))
        if value.key == FLOAT:
            return Scalar(BOOL, self._builder.fcmp_unordered("!=", value.value, DOUBLE(0.0)))
        raise NotImplementedError(f"{value.key} as a condition in {self._function.function.__qualname__}")

    def _combined(self, node: Any, left: Any, right: Any) -> Any:
        kind = type(node.op)
        if left.key not in WIDTH or right.key not in WIDTH:
            raise self._refused(node)
        if kind is ast.Pow:
            return self._power(left, right)
        whole = left.key != FLOAT and right.key != FLOAT
        if whole and kind is not ast.Div:
            if left.known is not None and right.known is not None and kind in _KNOWN:
                return self._number(_KNOWN[kind](left.known, right.known))
            logical = left.key == right.key == BOOL and kind in (ast.BitOr, ast.BitAnd, ast.BitXor)
            a, b = (left.value, right.value) if logical else (self._integer(left), self._integer(right))
            if kind in _OF_INTEGERS:
                return Scalar(BOOL if logical else INT, getattr(self._builder, _OF_INTEGERS[kind])(a, b))
            return Scalar(INT, self._whole(kind, a, b))
        a, b = self._float(left), self._float(right)
        if kind in _OF_WHOLE:
            return Scalar(FLOAT, self._applied(_OF_WHOLE[kind], FLOAT, a, b))
        if kind not in _OF_FLOATS:
            raise self._refused(node)
        return Scalar(FLOAT, getattr(self._builder, _OF_FLOATS[kind])(a, b, flags=self._function.fast))

    def _whole(self, kind: type, a: Any, b: Any) -> Any:
        """Return quotient or rest of integers, rounded down."""
        builder = self._builder
        rest = builder.srem(a, b)
        differ = builder.icmp_signed("<", builder.xor(rest, b), WORD(0))
        below = builder.and_(builder.icmp_signed("!=", rest, WORD(0)), differ)
        if kind is ast.Mod:
            return builder.select(below, builder.add(rest, b), rest)
        quotient = builder.sdiv(a, b)
        return builder.select(below, builder.sub(quotient, WORD(1)), quotient)

    def _power(self, left: Any, right: Any) -> Any:
        if (
            right.key == INT
            and right.known is not None
            and left.key in (INT, FLOAT)
            and (right.known >= 0 or left.key == FLOAT)
        ):
            return self._whole_power(left, right.known)
        if right.key != FLOAT:
            raise NotImplementedError(f"a power with an integer computed in {self._function.function.__qualname__}")
        return Scalar(FLOAT, self._applied(operator.pow, FLOAT, self._float(left), self._float(right)))

    def _whole_power(self, left: Any, exponent: int) -> Any:
        """Return a power with a known exponent, by products of squares."""
        multiply = self._builder.mul if left.key == INT else self._builder.fmul
        one, square, left_over = left.value.type(1), left.value, abs(exponent)
        found = one
        while left_over:
            if left_over & 1:
                found = square if found is one else multiply(found, square)
            left_over >>= 1
            if left_over:
                square = multiply(square, square)
        return Scalar(left.key, self._builder.fdiv(one, found) if exponent < 0 else found)

    def _applied(self, function: Callable[..., Any], returned: Any, *values: Any) -> Any:
        """Return the result of a function of floats that Numba lowers."""
        return self._applied_as(function, returned(*[FLOAT] * len(values)), *values)

    def _applied_as(self, function: Callable[..., Any], signature: Any, *values: Any) -> Any:
        if self._sought:
            return ir.Constant(llvm_type(signature.return_type), ir.Undefined)
        return self._context.get_function(function, signature)(self._builder, values)

    def _comparison(self, sign: str, left: Any, right: Any) -> Any:
        if left.key not in WIDTH or right.key not in WIDTH:
            raise NotImplementedError(f"{left.key} {sign} {right.key} in {self._function.function.__qualname__}")
        if left.key != FLOAT and right.key != FLOAT:
            return self._builder.icmp_signed(sign, self._integer(left), self._integer(right))
        compare = self._builder.fcmp_unordered if sign == "!=" else self._builder.fcmp_ordered
        return compare(sign, self._float(left), self._float(right))

    def _to_integer(self, value: Any) -> Any:
        if value.key == FLOAT:
            return Scalar(INT, self._builder.fptosi(value.value, WORD))
        return self._converted(value, INT)

    def _extreme(self, sign: str, values: Sequence[Any]) -> Any:
        """Return the greatest or the least value; as in Python, that before a NaN."""
        key = values[0].key
        for value in values[1:]:
            key = common(key, value.key)
        found, *rest = (self._converted(value, key) for value in values)
        for value in rest:
            better = self._comparison(sign, value, found)
            found = Scalar(key, self._builder.select(better, value.value, found.value))
        return found

    def _absolute(self, value: Any) -> Any:
        if value.key == FLOAT:
            return Scalar(FLOAT, self._applied(abs, FLOAT, value.value))
        number = self._integer(value)
        negative = self._builder.icmp_signed("<", number, WORD(0))
        return Scalar(INT, self._builder.select(negative, self._builder.neg(number), number))


def alike(key: Any, other: Any) -> bool:
    """Whether a name may have values of both keys, the wider one in the place of the other."""
    if isinstance(key, tuple) and isinstance(other, tuple):
        return key[0] is other[0] and len(key[1]) == len(other[1]) and all(map(alike, key[1], other[1]))
    return key == other or (key in WIDTH and other in WIDTH)


def common(key: Any, other: Any) -> Any:
    """Return the wider one of two keys.

    Raises
    ------
    NotImplementedError
        There is none.
    """
    if isinstance(key, tuple) and isinstance(other, tuple) and len(key[1]) == len(other[1]):
        return key[0], tuple(map(common, key[1], other[1]))
    if key in WIDTH and other in WIDTH:
        return max(key, other, key=WIDTH.__getitem__)
    if key != other:
        raise NotImplementedError(f"{key} or {other}")
    return key
