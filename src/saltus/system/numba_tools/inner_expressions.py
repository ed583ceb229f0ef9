"""Expressions of inner functions: names, entries of arrays, conditions, calls."""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.dispatcher import Dispatcher

from saltus.system.numba_tools import pointers
from saltus.system.numba_tools.inner_numbers import BOOL, DOUBLE, FLOAT, INT, NONE, TRUTH, WIDTH, Numbers, common
from saltus.system.numba_tools.inner_values import (
    WORD,
    Array,
    Outside,
    Record,
    Scalar,
    Slot,
    blank,
    flat,
    key_of,
    llvm_type,
    numba_type,
    of_key,
    parts,
    taken,
)

__all__ = ["Expressions"]

_BYTES = ir.IntType(8).as_pointer()
_DTYPES = {np.int64: INT, np.float64: FLOAT}
_SIGNS = {ast.Eq: "==", ast.NotEq: "!=", ast.Gt: ">", ast.GtE: ">=", ast.Lt: "<", ast.LtE: "<="}
_TO_INTEGERS = (math.floor, math.ceil)
_TO_TRUTHS = (math.isnan, math.isfinite, math.isinf)


class Expressions(Numbers):
    """The expressions of a function that becomes LLVM code; the arguments are those of `Numbers`."""

    def __init__(self, context: Any, function: Any, code: ir.Function, sought: bool) -> None:
        super().__init__(context, function, code, sought)
        self._names: dict[str, Any] = {}
        self._kept: list[Any] = []  # places of the addresses of arrays made here

    def _value(self, node: ast.expr) -> Any:
        match node:
            case ast.Name(id=name):
                return self._named(name, node)
            case ast.Constant(value=value):
                return self._known(value, node)
            case ast.Tuple(elts=items):
                return Record(tuple(self._items(items)))
            case ast.Subscript():
                return self._entry_of(node)
            case ast.Attribute():
                return self._attribute(node)
            case ast.BinOp():
                return self._combined(node, self._value(node.left), self._value(node.right))
            case ast.UnaryOp():
                return self._unary(node)
            case ast.Compare():
                return self._compared(node)
            case ast.BoolOp():
                return self._either(node)
            case ast.IfExp():
                return self._choice(node)
            case ast.Call():
                return self._call(node)
        raise self._refused(node)

    def _named(self, name: str, node: ast.AST) -> Any:
        if name in self._names:
            found = self._names[name]
            if isinstance(found, Slot):
                return of_key(found.key, iter([self._builder.load(place) for place in found.places]))
            return found
        if name in self._function.stores or name not in self._function.outside:
            raise self._refused(node)
        return self._known(self._function.outside[name], node)

    def _outside(self, node: ast.expr) -> Any:
        """Return the function, class or module that an expression names; None for other expressions."""
        if isinstance(node, ast.Name) and node.id not in self._names:
            return self._function.outside.get(node.id)
        if isinstance(node, ast.Attribute) and (found := self._outside(node.value)) is not None:
            return getattr(found, node.attr, None)
        return None

    def _known(self, value: Any, node: ast.AST) -> Any:
        """Return a constant of the text or of its module."""
        match value:
            case bool() | int() | float() | np.bool_() | np.integer() | np.floating():
                return self._number(value)
            case tuple():
                kind = type(value) if hasattr(value, "_fields") else None
                return Record(tuple(self._known(item, node) for item in value), kind)
            case np.ndarray():
                return self._table(value, node)
            case None | str():
                raise self._refused(node)
        return Outside(value)

    def _table(self, value: Any, node: ast.AST) -> Array:
        kind = {"f": FLOAT, "i": INT}.get(value.dtype.kind)
        if kind is None or value.dtype.itemsize != 8:
            raise self._refused(node)
        item = llvm_type(kind)
        content = ir.Constant(ir.ArrayType(item, value.size), [item(number) for number in value.ravel().tolist()])
        held = ir.GlobalVariable(self._code.module, content.type, self._code.module.get_unique_name("saltus.numbers"))
        held.global_constant, held.linkage, held.initializer = True, "internal", content
        shape = tuple(WORD(length) for length in value.shape)
        return Array(
            types.Array(kind, value.ndim, "C", readonly=True), self._builder.gep(held, [WORD(0), WORD(0)]), shape
        )

    def _attribute(self, node: ast.Attribute) -> Any:
        if (found := self._outside(node)) is not None:
            return self._known(found, node)
        value = self._value(node.value)
        if isinstance(value, Record) and value.kind is not None:
            return value.items[value.kind._fields.index(node.attr)]  # type: ignore[attr-defined]
        if isinstance(value, Array) and node.attr == "shape":
            return Record(tuple(Scalar(INT, length) for length in value.shape))
        if isinstance(value, Array) and node.attr == "size":
            size = value.shape[0]
            for length in value.shape[1:]:
                size = self._builder.mul(size, length)
            return Scalar(INT, size)
        raise self._refused(node)

    def _place(self, node: ast.Subscript, value: Any) -> tuple[Any, Any]:
        """Return the address of an entry, and the type there."""
        if isinstance(value, Array):
            indices = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
            if len(indices) != len(value.shape):
                raise self._refused(node)
            at = WORD(0)
            for index, length in zip(indices, value.shape, strict=True):
                given = self._value(index)
                number = self._integer(given)
                if not (given.known is not None and given.known >= 0):
                    negative = self._builder.icmp_signed("<", number, WORD(0))
                    number = self._builder.select(negative, self._builder.add(number, length), number)
                at = self._builder.add(self._builder.mul(at, length), number) if len(indices) > 1 else number
            return self._builder.gep(value.data, [at]), value.key.dtype
        if not (isinstance(value, Scalar) and isinstance(value.key, types.CPointer)):
            raise self._refused(node)
        return self._builder.gep(value.value, [self._integer(self._value(node.slice))]), value.key.dtype

    def _store(self, place: Any, kind: Any, value: Any) -> None:
        if value.key not in WIDTH or (kind != FLOAT and value.key == FLOAT):
            raise NotImplementedError(f"{value.key} is stored as {kind} in {self._function.function.__qualname__}")
        self._builder.store(self._converted(value, kind).value, place)

    def _entry_of(self, node: ast.Subscript) -> Any:
        value = self._value(node.value)
        if isinstance(value, Record):
            return self._item(value, self._value(node.slice), node)
        place, kind = self._place(node, value)
        return Scalar(kind, self._builder.load(place))

    def _item(self, value: Record, index: Any, node: ast.AST) -> Any:
        if index.known is not None:
            return value.items[index.known]
        keys = {item.key for item in value.items}
        if len(keys) != 1 or not keys <= WIDTH.keys():
            raise self._refused(node)
        found = value.items[-1].value
        for i in range(len(value.items) - 2, -1, -1):
            here = self._builder.icmp_signed("==", index.value, WORD(i))
            found = self._builder.select(here, value.items[i].value, found)
        return Scalar(value.items[0].key, found)

    def _truth(self, node: ast.expr) -> Any:
        if isinstance(node, ast.BoolOp):
            tests = [lambda value=value: self._truth(value) for value in node.values]
            return self._shortened(tests, stop=isinstance(node.op, ast.Or)).value
        return self._as_truth(self._value(node)).value

    def _unary(self, node: ast.UnaryOp) -> Any:
        if isinstance(node.op, ast.Not):
            return Scalar(BOOL, self._builder.xor(self._truth(node.operand), TRUTH(1)))
        value = self._value(node.operand)
        if not isinstance(node.op, ast.USub) or value.key not in WIDTH:
            raise self._refused(node)
        if value.known is not None:
            return self._number(-value.known)
        if value.key == FLOAT:
            return Scalar(FLOAT, self._applied(operator.neg, FLOAT, value.value))
        return Scalar(INT, self._builder.neg(self._integer(value)))

    def _compared(self, node: ast.Compare) -> Any:
        if any(type(sign) not in _SIGNS for sign in node.ops):
            raise self._refused(node)
        left, tests = self._value(node.left), []
        rest = iter(zip(node.ops, node.comparators, strict=True))

        def following() -> Any:
            nonlocal left
            sign, other = next(rest)
            before, left = left, self._value(other)
            return self._comparison(_SIGNS[type(sign)], before, left)

        tests = [following] * len(node.ops)
        return self._shortened(tests, stop=False)

    def _either(self, node: ast.BoolOp) -> Any:
        """Return conditions joined: as a value, what is joined is a condition itself."""

        def condition(value: ast.expr) -> Any:
            found = self._value(value)
            if found.key != BOOL:
                raise self._refused(node)
            return found.value

        tests = [lambda value=value: condition(value) for value in node.values]
        return self._shortened(tests, stop=isinstance(node.op, ast.Or))

    def _shortened(self, tests: Sequence[Callable[[], Any]], *, stop: bool) -> Scalar:
        """Return the result of conditions in turn, up to the first that decides."""
        found = tests[0]()
        if len(tests) == 1:
            return Scalar(BOOL, found)
        behind, decided = self._code.append_basic_block(), []
        for test in tests[1:]:
            following = self._code.append_basic_block()
            decided.append(self._builder.block)
            self._builder.cbranch(found, *((behind, following) if stop else (following, behind)))
            self._builder.position_at_end(following)
            found = test()
        last = self._builder.block
        self._builder.branch(behind)
        self._builder.position_at_end(behind)
        result = self._builder.phi(TRUTH)
        for block in decided:
            result.add_incoming(TRUTH(int(stop)), block)
        result.add_incoming(found, last)
        return Scalar(BOOL, result)

    def _choice(self, node: ast.IfExp) -> Any:
        yes, no, behind = (self._code.append_basic_block() for _ in range(3))
        self._builder.cbranch(self._truth(node.test), yes, no)
        found = []
        for block, chosen in ((yes, node.body), (no, node.orelse)):
            self._builder.position_at_end(block)
            value = self._value(chosen)
            found.append((value, self._builder.block))
        key = common(found[0][0].key, found[1][0].key)
        values = []
        for value, block in found:
            self._builder.position_at_end(block)
            values.append((flat(self._converted(value, key)), block))
            self._builder.branch(behind)
        self._builder.position_at_end(behind)
        joined = []
        for i, kind in enumerate(parts(key)):
            joined.append(self._builder.phi(kind))
            for one, block in values:
                joined[-1].add_incoming(one[i], block)
        return of_key(key, iter(joined))

    # ---- calls ----

    def _call(self, node: ast.Call) -> Any:
        thing = self._outside(node.func)
        if thing is None or node.keywords:
            raise self._refused(node)
        if (rule := _RULES.get(thing)) is not None:
            return rule(self, node)
        arguments = self._items(node.args)
        if (function := getattr(thing, "inner", None)) is not None:
            if self._sought:
                return blank(function.returned(tuple(argument.key for argument in arguments)))
            return function.called(self._context, self._builder, arguments)
        if isinstance(thing, type) and hasattr(thing, "_fields"):
            defaults = thing._field_defaults  # type: ignore[attr-defined]
            rest = [self._known(defaults[name], node) for name in thing._fields[len(arguments) :]]
            return Record((*arguments, *rest), thing)
        if hasattr(thing, "_defn"):
            return self._intrinsic(thing, arguments)
        if isinstance(thing, Dispatcher):
            return self._dispatched(thing, arguments)
        if thing in (int, types.int64, types.intp):
            return self._to_integer(*arguments)
        if thing in (float, types.float64):
            return self._converted(arguments[0], FLOAT)
        if thing in (max, min):
            return self._extreme(">" if thing is max else "<", arguments)
        if thing is abs:
            return self._absolute(*arguments)
        if thing is len:
            (value,) = arguments
            return self._number(len(value.items)) if isinstance(value, Record) else Scalar(INT, value.shape[0])
        if getattr(thing, "__module__", "") == "math":
            returned = INT if thing in _TO_INTEGERS else BOOL if thing in _TO_TRUTHS else FLOAT
            return Scalar(returned, self._applied(thing, returned, *map(self._float, arguments)))
        raise self._refused(node)

    def _items(self, nodes: Iterable[ast.expr]) -> list[Any]:
        found = []
        for argument in nodes:
            if isinstance(argument, ast.Starred):
                found += self._value(argument.value).items
            else:
                found.append(self._value(argument))
        return found

    def _intrinsic(self, thing: Any, arguments: Sequence[Any]) -> Any:
        given = [Scalar(types.CPointer(a.key.dtype), a.data) if isinstance(a, Array) else a for a in arguments]
        signature, lower = thing._defn(None, *[numba_type(value.key) for value in given])
        if signature.args and isinstance(signature.args[-1], types.StarArgTuple | types.StarArgUniTuple):
            given = self._starred(given, signature.args[-1])
        values = [self._converted(value, kind).value if kind in WIDTH else value.value
                  for value, kind in zip(given, signature.args, strict=True)]  # fmt: skip
        found = lower(self._context, self._builder, signature, values)
        if signature.return_type in (types.void, NONE):
            return Scalar(NONE, None)
        return taken(self._context, self._builder, signature.return_type, found)

    def _starred(self, given: Sequence[Any], kind: Any) -> list[Any]:
        """Return the arguments of an intrinsic whose last ones are one tuple of a type."""
        fixed = len(given) - len(kind.types)
        row = [self._converted(*pair).value for pair in zip(given[fixed:], kind.types, strict=True)]
        return [*given[:fixed], Scalar(kind, self._context.make_tuple(self._builder, kind, row))]

    def _dispatched(self, thing: Any, arguments: Sequence[Any]) -> Any:
        """Call a function of Numba's that returns a float; where it raises, that is NaN."""
        if not all(isinstance(argument, Scalar) for argument in arguments):
            raise NotImplementedError(f"{thing} of arrays or records in {self._function.function.__qualname__}")
        kinds = tuple(argument.key for argument in arguments)
        thing.compile(kinds)
        found = thing.overloads[kinds]
        if self._sought:
            return blank(key_of(found.signature.return_type))
        self._context.active_code_library.add_linking_library(found.library)
        values = [argument.value for argument in arguments]
        status, value = self._context.call_internal_no_propagate(self._builder, found.fndesc, found.signature, values)
        if found.signature.return_type != FLOAT:
            raise NotImplementedError(f"{thing} returns {found.signature.return_type}")
        return Scalar(FLOAT, self._builder.select(status.is_ok, value, DOUBLE(math.nan)))

    # ---- what has a rule of its own ----

    def _pointer(self, node: ast.Call) -> Any:
        value, at = self._items(node.args)
        if isinstance(value, Array):
            return Scalar(types.CPointer(value.key.dtype), self._builder.gep(value.data, [self._integer(at)]))
        return Scalar(value.key, self._builder.gep(value.value, [self._integer(at)]))

    def _apart_arguments(self, node: ast.Call) -> Any:
        for argument in self._code.args:
            if isinstance(argument.type, ir.PointerType):
                argument.add_attribute("noalias")
        return Scalar(NONE, None)

    def _outlined(self, node: ast.Call) -> Any:
        self._code.attributes.add("noinline")
        return Scalar(NONE, None)

    def _keep(self, node: ast.Call) -> Any:
        return Scalar(NONE, None)

    def _stack(self, node: ast.Call) -> Any:
        kind = self._outside(node.args[0])
        count = self._integer(self._value(node.args[1]))
        return Scalar(types.CPointer(kind), self._builder.alloca(llvm_type(kind), count))

    def _invoke(self, node: ast.Call) -> Any:
        address, arguments = self._items(node.args)
        values = flat(arguments)
        kind = ir.FunctionType(DOUBLE, [value.type for value in values])
        return Scalar(FLOAT, self._builder.call(self._builder.inttoptr(address.value, kind.as_pointer()), values))

    def _empty(self, node: ast.Call) -> Array:
        """Return a new array of floats or integers, which lives until the function returns, or makes the next one."""
        length = self._integer(self._value(node.args[0]))
        kind = _DTYPES.get(self._outside(node.args[1])) if len(node.args) > 1 else FLOAT
        if kind is None:
            raise self._refused(node)
        entry = self._at_entry()
        place = entry.alloca(_BYTES)
        entry.store(ir.Constant(_BYTES, None), place)
        self._context.nrt.free(self._builder, self._builder.load(place))
        self._kept.append(place)
        data = self._context.nrt.allocate_unchecked(self._builder, self._builder.mul(length, WORD(8)))
        self._builder.store(data, place)
        data = self._builder.bitcast(data, llvm_type(kind).as_pointer())
        return Array(types.Array(kind, 1, "C"), data, (length,))

    def _zeros(self, node: ast.Call) -> Array:
        array = self._empty(node)
        cgutils.memset(self._builder, array.data, self._builder.mul(array.shape[0], WORD(8)), 0)
        return array

    def _array(self, node: ast.Call) -> Any:
        """Return a new array of a few numbers of a kind."""
        (given,) = self._items(node.args)
        (kind,) = {item.key for item in given.items}
        data = self._at_entry().alloca(llvm_type(kind), len(given.items))
        for i, item in enumerate(given.items):
            self._builder.store(item.value, self._builder.gep(data, [WORD(i)]))
        return Array(types.Array(kind, 1, "C"), data, (WORD(len(given.items)),))


_RULES: dict[Any, Callable[[Expressions, ast.Call], Any]] = {
    pointers.pointer: Expressions._pointer,
    pointers.apart: Expressions._apart_arguments,
    pointers.outlined: Expressions._outlined,
    pointers.keep: Expressions._keep,
    pointers.stack: Expressions._stack,
    pointers.invoke: Expressions._invoke,
    np.empty: Expressions._empty,
    np.zeros: Expressions._zeros,
    np.array: Expressions._array,
}
