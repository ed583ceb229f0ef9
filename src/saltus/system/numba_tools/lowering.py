"""Machine code of generated functions, without Numba's analysis of types: their text is a small language of floats.

A generated function ``(k, m, x, p, out) -> None`` assigns arithmetic and elementary functions of floats to names and to
entries of `out`. It branches on the integer `k`. It loops over columns, and over tuples of floats and integers. The
type of each name is plain from the text, so that the text becomes LLVM code in one pass: five times faster than by
Numba, and with less memory. Elementary functions are those of Numba, and its optimisation follows. So the bits of the
results are those of `numba.cfunc` with ``error_model="numpy"``, except for floors beyond 64 bits, which are right here.
The measurement is in docs/decisions/0029-generated-code-is-lowered-directly.md.
"""

from __future__ import annotations

import ast
import itertools
import math
import operator
from collections.abc import Callable, Iterable, Sequence
from functools import cache, lru_cache
from typing import Any

from llvmlite import ir
from numba import float64
from numba.core import fastmathpass
from numba.core.cpu_options import FastMathOptions
from numba.core.registry import cpu_target

__all__ = ["code_of", "function_in", "library_of", "linked"]

_DOUBLE = ir.DoubleType()
_INTEGER = ir.IntType(64)
_TRUTH = ir.IntType(1)
_POINTER = _DOUBLE.as_pointer()
_INTEGERS = _INTEGER.as_pointer()
_SIGNATURE = ir.FunctionType(ir.VoidType(), [_INTEGER, _INTEGER, _POINTER, _POINTER, _POINTER])

_OF_FLOATS = {ast.Add: "fadd", ast.Sub: "fsub", ast.Mult: "fmul", ast.Div: "fdiv"}
_OF_INTEGERS = {ast.Add: "add", ast.Sub: "sub", ast.Mult: "mul"}
_COMPARED = {ast.Eq: "==", ast.Gt: ">", ast.GtE: ">=", ast.Lt: "<", ast.LtE: "<="}
_EXTREMES = {"max": ">", "min": "<"}

_FAST = ("contract", "nsz")  # what the compiler may do with a fast function's sums: fuse products, ignore signs of 0
_LATE = 3  # products of a sum that are added last, as they come last


def code_of(library: Any, symbol: str) -> int:
    """Return where a function's machine code begins; valid in this process, as long as the library lives."""
    address = library.get_pointer_to_function(symbol)
    if not address:
        raise RuntimeError(f"{symbol} is not in the library {library.name}")
    return int(address)


def library_of(function: ast.FunctionDef, symbol: str, *, fast: bool) -> Any:
    """Return a library of Numba's with the compiled function; the caller holds Numba's lock.

    Parameters
    ----------
    function : ast.FunctionDef
        The function ``(k, m, x, p, out)``.
    symbol : str
        What it is called among all that the process has compiled.
    fast : bool
        Whether sums may be fused with products.

    Raises
    ------
    NotImplementedError
        The text has something else than generated functions have.
    """
    context = _context()

    def write(module: ir.Module) -> None:
        _Lowering(context, ir.Function(module, _SIGNATURE, symbol)).lower(function)
        if fast:
            fastmathpass.rewrite_module(module, FastMathOptions(set(_FAST)))

    return linked(context, symbol, write)


def linked(context: Any, symbol: str, write: Callable[[ir.Module], None]) -> Any:
    """Return a library of Numba's with what is written into its module; the caller holds Numba's lock."""
    library = context.codegen().create_library(symbol)
    library.enable_object_caching()
    module = library.create_ir_module(symbol)
    with context.push_code_library(library):
        write(module)
    library.add_ir_module(module)
    library.finalize()
    return library


@cache
def _context() -> Any:
    """Return Numba's context of this processor, which knows how to lower the functions of `math`."""
    context = cpu_target.target_context
    context.refresh()
    return context


def function_in(text: bytes, name: str) -> ast.FunctionDef:
    """Return the syntax tree of a function of a module's text."""
    (found,) = (node for node in _parsed(text).body if isinstance(node, ast.FunctionDef) and node.name == name)
    return found


@lru_cache(maxsize=1)
def _parsed(text: bytes) -> ast.Module:
    return ast.parse(text)


class _Lowering:
    """A function that becomes LLVM code, statement after statement.

    A name has one value at each place: what a branch or a loop assigns is not seen behind it.
    """

    def __init__(self, context: Any, code: ir.Function) -> None:
        self._context, self._code = context, code
        self._builder = ir.IRBuilder(code.append_basic_block())
        self._names: dict[str, Any] = {}
        self._outside: frozenset[str] = frozenset()  # names that a loop may not change
        self._tuples = itertools.count()
        self._implementations: dict[Any, Callable[..., Any]] = {}
        self._expressions: dict[type[ast.expr], Callable[[Any], Any]] = {
            ast.Name: self._name,
            ast.Constant: self._constant,
            ast.Subscript: lambda node: self._builder.load(self._entry(node)),
            ast.Tuple: self._tuple,
            ast.UnaryOp: self._negative,
            ast.BinOp: self._operation,
            ast.Compare: self._comparison,
            ast.BoolOp: self._either,
            ast.IfExp: self._choice,
            ast.Call: self._call,
        }

    def lower(self, function: ast.FunctionDef) -> None:
        """Write the code of a function."""
        self._names = {argument.arg: value for argument, value in zip(function.args.args, self._code.args, strict=True)}
        self._statements(function.body)
        self._builder.ret_void()

    # ---- statements ----

    def _statements(self, body: Iterable[ast.stmt]) -> None:
        for statement in body:
            match statement:
                case ast.Assign(targets=[ast.Name(id=name)], value=value):
                    if name in self._outside:
                        raise NotImplementedError(f"a loop that changes {name}")
                    self._names[name] = self._value(value)
                case ast.Assign(targets=[ast.Subscript() as target], value=value):
                    found = self._float(value)
                    self._builder.store(found, self._entry(target))
                case ast.If():
                    self._branch(statement)
                case ast.For(
                    iter=ast.Call(func=ast.Name(id="range"), args=[*begin, stop]),
                    target=ast.Name(id=counter),
                    orelse=[],
                ) if counter not in self._names and len(begin) < 2:
                    first = self._integer(begin[0]) if begin else _INTEGER(0)
                    self._loop(counter, first, self._integer(stop), statement.body)
                case ast.Pass() | ast.Expr(value=ast.Constant()):
                    pass
                case _:
                    raise NotImplementedError(ast.unparse(statement))

    def _blocks(self, count: int) -> list[ir.Block]:
        return [self._code.append_basic_block() for _ in range(count)]

    def _branch(self, statement: ast.If) -> None:
        (behind,), before = self._blocks(1), self._names
        body: list[ast.stmt] = [statement]
        while len(body) == 1 and isinstance(chosen := body[0], ast.If):  # each `elif`: there may be hundreds
            yes, no = self._blocks(2)
            self._builder.cbranch(self._truth(chosen.test), yes, no)
            self._builder.position_at_end(yes)
            self._apart(chosen.body, before, behind)
            self._builder.position_at_end(no)
            body = chosen.orelse
        self._apart(body, before, behind)
        self._builder.position_at_end(behind)

    def _apart(self, body: Sequence[ast.stmt], before: dict[str, Any], behind: ir.Block) -> None:
        """Write statements of whose names nothing is seen behind them."""
        self._names = dict(before)
        self._statements(body)
        self._builder.branch(behind)
        self._names = before

    def _loop(self, counter: str, first: Any, last: Any, body: Sequence[ast.stmt]) -> None:
        test, inside, behind = self._blocks(3)
        above = self._builder.block
        self._builder.branch(test)
        self._builder.position_at_end(test)
        index = self._builder.phi(_INTEGER)
        index.add_incoming(first, above)
        self._builder.cbranch(self._builder.icmp_signed("<", index, last), inside, behind)
        self._builder.position_at_end(inside)
        before, outside = dict(self._names), self._outside
        self._outside = frozenset(before)
        self._names[counter] = index
        self._statements(body)
        self._names, self._outside = before, outside
        index.add_incoming(self._builder.add(index, _INTEGER(1), flags=("nsw",)), self._builder.block)
        self._builder.branch(test)
        self._builder.position_at_end(behind)

    # ---- expressions ----

    def _value(self, node: ast.expr) -> Any:
        if (lower := self._expressions.get(type(node))) is None:
            raise NotImplementedError(ast.unparse(node))
        return lower(node)

    def _of_type(self, wanted: ir.Type, node: ast.expr) -> Any:
        value = self._value(node)
        if value.type != wanted:
            raise NotImplementedError(f"{ast.unparse(node)} where LLVM wants {wanted}")
        return value

    def _truth(self, node: ast.expr) -> Any:
        return self._of_type(_TRUTH, node)

    def _integer(self, node: ast.expr) -> Any:
        return self._of_type(_INTEGER, node)

    def _float(self, node: ast.expr) -> Any:
        return self._as_float(self._value(node))

    def _as_float(self, value: Any) -> Any:
        if value.type == _DOUBLE:
            return value
        if value.type != _INTEGER:
            raise NotImplementedError(f"a number of LLVM's type {value.type}")
        if isinstance(value, ir.Constant):
            return _DOUBLE(float(value.constant))
        return self._builder.sitofp(value, _DOUBLE)

    def _entry(self, node: ast.Subscript) -> Any:
        """Return the address of an entry of `x`, `p`, `out` or a tuple."""
        entries = self._value(node.value)
        if entries.type not in (_POINTER, _INTEGERS):
            raise NotImplementedError(f"{ast.unparse(node)}, an entry of a number")
        return self._builder.gep(entries, [self._integer(node.slice)])

    def _tuple(self, node: ast.Tuple) -> Any:
        """Return where the entries of a tuple begin: integers are constants, floats stand on the stack."""
        values = [self._value(entry) for entry in node.elts]
        if values and all(isinstance(value, ir.Constant) and value.type == _INTEGER for value in values):
            kept = ir.GlobalVariable(
                self._code.module, ir.ArrayType(_INTEGER, len(values)), f"{self._code.name}.{next(self._tuples)}"
            )
            kept.initializer, kept.global_constant, kept.linkage = kept.value_type(values), True, "internal"
            return self._builder.gep(kept, [_INTEGER(0), _INTEGER(0)])
        with self._builder.goto_entry_block():
            room = self._builder.alloca(_DOUBLE, size=len(values))
        for i, value in enumerate(values):
            self._builder.store(self._as_float(value), self._builder.gep(room, [_INTEGER(i)]))
        return room

    def _name(self, node: ast.Name) -> Any:
        if node.id not in self._names:
            raise NotImplementedError(f"{node.id}, which has no value there")
        return self._names[node.id]

    def _constant(self, node: ast.Constant) -> Any:
        match node.value:
            case bool():
                raise NotImplementedError(ast.unparse(node))
            case float(number):
                return _DOUBLE(number)
            case int(number):
                return _INTEGER(number)
        raise NotImplementedError(ast.unparse(node))

    def _negative(self, node: ast.UnaryOp) -> Any:
        if not isinstance(node.op, ast.USub):
            raise NotImplementedError(ast.unparse(node))
        value = self._value(node.operand)
        if isinstance(value, ir.Constant):
            return value.type(-value.constant)
        return self._applied(operator.neg, self._as_float(value))

    def _operation(self, node: ast.BinOp) -> Any:
        terms = [node]  # a long sum is nested to the left
        while isinstance(terms[-1].left, ast.BinOp):
            terms.append(terms[-1].left)
        value = self._value(terms[-1].left)
        for term in reversed(terms):
            value = self._combined(term, value, self._value(term.right))
        return value

    def _combined(self, node: ast.BinOp, left: Any, right: Any) -> Any:
        kind = type(node.op)
        if kind in _OF_INTEGERS and left.type == right.type == _INTEGER:
            return getattr(self._builder, _OF_INTEGERS[kind])(left, right)
        left, right = self._as_float(left), self._as_float(right)
        if kind is ast.Pow:
            return self._applied(operator.pow, left, right)
        if kind not in _OF_FLOATS:
            raise NotImplementedError(ast.unparse(node))
        return getattr(self._builder, _OF_FLOATS[kind])(left, right)

    def _comparison(self, node: ast.Compare) -> Any:
        if len(node.ops) != 1 or type(node.ops[0]) not in _COMPARED:
            raise NotImplementedError(ast.unparse(node))
        sign = _COMPARED[type(node.ops[0])]
        left, right = self._value(node.left), self._value(node.comparators[0])
        if left.type == right.type == _INTEGER:
            return self._builder.icmp_signed(sign, left, right)
        return self._builder.fcmp_ordered(sign, self._as_float(left), self._as_float(right))

    def _either(self, node: ast.BoolOp) -> Any:
        if not isinstance(node.op, ast.Or):
            raise NotImplementedError(ast.unparse(node))
        found = self._truth(node.values[0])
        for other in node.values[1:]:  # which has no effect where a true condition precedes it
            found = self._builder.select(found, _TRUTH(True), self._truth(other))
        return found

    def _choice(self, node: ast.IfExp) -> Any:
        yes, no, behind = self._blocks(3)
        self._builder.cbranch(self._truth(node.test), yes, no)
        found = []
        for block, chosen in ((yes, node.body), (no, node.orelse)):
            self._builder.position_at_end(block)
            found.append((self._float(chosen), self._builder.block))
            self._builder.branch(behind)
        self._builder.position_at_end(behind)
        result = self._builder.phi(_DOUBLE)
        for value, block in found:
            result.add_incoming(value, block)
        return result

    def _call(self, node: ast.Call) -> Any:
        if node.keywords or not node.args:
            raise NotImplementedError(ast.unparse(node))
        values = [self._float(argument) for argument in node.args]
        match node.func:
            case ast.Attribute(value=ast.Name(id="math"), attr="floor"):  # a float: no integer holds all results
                floor = self._code.module.declare_intrinsic("llvm.floor", [_DOUBLE])
                return self._builder.call(floor, values)
            case ast.Attribute(value=ast.Name(id="math"), attr=name) if hasattr(math, name):
                return self._applied(getattr(math, name), *values)
            case ast.Name(id="abs"):
                return self._applied(abs, *values)
            case ast.Name(id="products"):
                return self._products(values)
            case ast.Name(id=name) if name in _EXTREMES:
                return self._extreme(_EXTREMES[name], values)
        raise NotImplementedError(ast.unparse(node))

    def _applied(self, function: Callable[..., Any], *values: Any) -> Any:
        """Return the result of a function that Numba implements, of floats."""
        key = function, len(values)
        if key not in self._implementations:
            self._implementations[key] = self._context.get_function(function, float64(*[float64] * len(values)))
        return self._implementations[key](self._builder, values)

    def _extreme(self, sign: str, values: Sequence[Any]) -> Any:
        """Return the greatest or the least value; as in Python, that before a NaN."""
        found = values[0]
        for value in values[1:]:
            found = self._builder.select(self._builder.fcmp_ordered(sign, value, found), value, found)
        return found

    def _products(self, factors: Sequence[Any]) -> Any:
        """Return a0*b0 + a1*b1 + ... of factors in turn, the last products added last.

        A step of a Taylor series is a chain of sums that wait for each other. Those that come last, the last three
        products, are added to the sum of the others, which is taken in pairs.
        """
        pairs = list(zip(factors[::2], factors[1::2], strict=True))
        count = max(len(pairs) - _LATE, 1)
        sums = []
        for i in range(0, count, 2):
            total = self._product(pairs[i])
            sums.append(total if i + 1 == count else self._sum(total, self._product(pairs[i + 1])))
        while len(sums) > 1:
            halves = [sums[i : i + 2] for i in range(0, len(sums), 2)]
            sums = [self._sum(*half) if len(half) == 2 else half[0] for half in halves]
        (total,) = sums
        for pair in pairs[count:]:
            total = self._sum(total, self._product(pair))
        return total

    def _product(self, pair: tuple[Any, Any]) -> Any:
        return self._builder.fmul(*pair, flags=_FAST)

    def _sum(self, left: Any, right: Any) -> Any:
        return self._builder.fadd(left, right, flags=_FAST)
