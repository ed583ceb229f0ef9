"""The text of an inner function, lowered to LLVM code statement after statement."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Sequence
from typing import Any

from llvmlite import ir

from saltus.system.numba_tools.inner_expressions import Expressions
from saltus.system.numba_tools.inner_numbers import INT, NONE, WIDTH, alike
from saltus.system.numba_tools.inner_values import (
    WORD,
    Array,
    Outside,
    Record,
    Scalar,
    Slot,
    flat,
    of_key,
    packed,
    parts,
)

__all__ = ["Lowering", "WidenedError"]


class WidenedError(Exception):
    """A name, or a result, is wider than what was assigned to it first.

    Attributes
    ----------
    name : str
        The name; of a record's item with its number.
    kind : numba type
        What it has to be.
    """

    def __init__(self, name: str, kind: Any) -> None:
        super().__init__(name, kind)
        self.name, self.kind = name, kind


class Lowering(Expressions):
    """A function that becomes LLVM code.

    Parameters
    ----------
    context, function, code
        As `Numbers` takes them.
    widened : dict of str to numba type
        Names that must be wider than what is assigned to them first.
    returned : key
        Of the result, where it is known; else only types are sought.
    """

    def __init__(self, context: Any, function: Any, code: ir.Function, widened: dict[str, Any], *returned: Any) -> None:
        super().__init__(context, function, code, not returned)
        self._widened = widened
        self._returned: Any = returned[0] if returned else None
        self._end = code.append_basic_block("end")
        self._ends: list[tuple[list[Any], ir.Block]] = []  # results, and the blocks from which they come
        self._depth = 0  # of branches and loops
        self._around: list[tuple[Any, Any]] = []  # blocks to which `continue` and `break` go
        self._left: list[Any] = []  # blocks to which a `break` goes

    def lower(self, arguments: dict[str, Any]) -> Any:
        """Write the function; return the key of its result."""
        for name, value in arguments.items():
            self._names[name] = value
            if name in self._function.stores and not isinstance(value, Array):
                self._names[name] = self._slot(name, value.key)
                self._put(self._names[name], value)
        self._statements(self._function.tree.body)
        if not self._builder.block.is_terminated:
            self._return(Scalar(NONE, None))
        self._leave()
        self._at_entry().branch(self._start)
        return self._returned

    def _statements(self, body: Iterable[ast.stmt]) -> None:
        for statement in body:
            if self._builder.block.is_terminated:
                return
            self._statement(statement)

    def _statement(self, statement: ast.stmt) -> None:
        match statement:
            case ast.Assign(targets=targets, value=value):
                found = self._value(value)
                for target in targets:
                    self._assign(target, found)
            case ast.AugAssign(target=ast.Name() as target):
                self._assign(
                    target, self._combined(statement, self._value(_loaded(target)), self._value(statement.value))
                )
            case ast.AugAssign(target=ast.Subscript() as target):
                place, kind = self._place(target, self._value(target.value))
                before = Scalar(kind, self._builder.load(place))
                self._store(place, kind, self._combined(statement, before, self._value(statement.value)))
            case ast.Expr(value=ast.Constant()) | ast.Pass():
                pass
            case ast.Expr(value=value):
                self._value(value)
            case ast.If():
                self._branch(statement)
            case ast.For(orelse=[]):
                self._loop(statement)
            case ast.While(orelse=[]):
                self._while(statement)
            case ast.Continue():
                self._builder.branch(self._around[-1][0])
            case ast.Break():
                self._left.append(self._around[-1][1])
                self._builder.branch(self._around[-1][1])
            case ast.Return(value=value):
                self._return(Scalar(NONE, None) if value is None else self._value(value))
            case _:
                raise self._refused(statement)

    def _return(self, value: Any) -> None:
        if isinstance(value, Array) or (isinstance(value, Record) and any(isinstance(i, Array) for i in value.items)):
            raise NotImplementedError(f"{self._function.function.__qualname__} returns an array, which ends with it")
        if self._sought:
            if self._returned is None:
                self._returned = self._widest("return", value.key)
            self._take_in("return", self._returned, value.key)
            self._builder.unreachable()
            return
        self._ends.append((flat(self._converted(value, self._returned)), self._builder.block))
        self._builder.branch(self._end)

    def _leave(self) -> None:
        """Write the end to which all returns lead: arrays made here are freed."""
        self._builder.position_at_end(self._end)
        if not self._ends:
            self._builder.unreachable()
            return
        values = []
        for i, kind in enumerate(parts(self._returned)):
            values.append(self._builder.phi(kind))
            for parted, block in self._ends:
                values[-1].add_incoming(parted[i], block)
        for place in self._kept:
            self._context.nrt.free(self._builder, self._builder.load(place))
        whole = packed(self._builder, of_key(self._returned, iter(values)))
        if whole is None:
            self._builder.ret_void()
        else:
            self._builder.ret(whole)

    def _branch(self, statement: ast.If) -> None:
        behind = self._code.append_basic_block()
        body: list[ast.stmt] = [statement]
        reached = False
        self._depth += 1
        while len(body) == 1 and isinstance(chosen := body[0], ast.If):
            yes, no = self._code.append_basic_block(), self._code.append_basic_block()
            self._builder.cbranch(self._truth(chosen.test), yes, no)
            self._builder.position_at_end(yes)
            reached = self._apart(chosen.body, behind) or reached
            self._builder.position_at_end(no)
            body = chosen.orelse
        reached = self._apart(body, behind) or reached
        self._depth -= 1
        self._builder.position_at_end(behind)
        if not reached:
            self._builder.unreachable()

    def _apart(self, body: Sequence[ast.stmt], behind: ir.Block) -> bool:
        """Write statements that lead to a block; return whether they do."""
        self._statements(body)
        goes_on = not self._builder.block.is_terminated
        if goes_on:
            self._builder.branch(behind)
        return goes_on

    def _while(self, statement: ast.While) -> None:
        test, inside, behind = (self._code.append_basic_block() for _ in range(3))
        self._builder.branch(test)
        self._builder.position_at_end(test)
        for_ever = isinstance(statement.test, ast.Constant) and statement.test.value is True
        if for_ever:
            self._builder.branch(inside)
        else:
            self._builder.cbranch(self._truth(statement.test), inside, behind)
        self._builder.position_at_end(inside)
        self._inside(statement.body, test, behind)
        self._builder.position_at_end(behind)
        if for_ever and behind not in self._left:
            self._builder.unreachable()

    def _inside(self, body: Sequence[ast.stmt], again: ir.Block, behind: ir.Block) -> None:
        self._depth += 1
        self._around.append((again, behind))
        self._apart(body, again)
        self._around.pop()
        self._depth -= 1

    def _loop(self, statement: ast.For) -> None:
        start, stop, step, items = self._counted(statement.iter)
        test, inside, again, behind = (self._code.append_basic_block() for _ in range(4))
        before = self._builder.block
        self._builder.branch(test)
        self._builder.position_at_end(test)
        index = self._builder.phi(WORD)
        index.add_incoming(start, before)
        self._builder.cbranch(self._builder.icmp_signed("<" if step > 0 else ">", index, stop), inside, behind)
        self._builder.position_at_end(inside)
        self._depth += 1
        number = Scalar(INT, index)
        self._assign(statement.target, number if items is None else self._item(items, number, statement))
        self._depth -= 1
        self._inside(statement.body, again, behind)
        self._builder.position_at_end(again)
        index.add_incoming(self._builder.add(index, WORD(step), flags=("nsw",)), again)
        self._builder.branch(test)
        self._builder.position_at_end(behind)

    def _counted(self, node: ast.expr) -> tuple[Any, Any, int, Any]:
        """Return first, stop and step of a loop's counter, and the record that is counted, None for a range."""
        if not (isinstance(node, ast.Call) and self._outside(node.func) is range):
            items = self._value(node)
            if not isinstance(items, Record):
                raise self._refused(node)
            return WORD(0), WORD(len(items.items)), 1, items
        given = [self._value(argument) for argument in node.args]
        step = given[2].known if len(given) == 3 else 1
        if not step:
            raise self._refused(node)
        first, stop = (Scalar(INT, WORD(0)), given[0]) if len(given) == 1 else given[:2]
        return self._integer(first), self._integer(stop), step, None

    # ---- names ----

    def _slot(self, name: str, key: Any) -> Slot:
        """Return a place on the stack for values of a key, or wider ones where the name has such."""
        key = self._widest(name, key)
        entry = self._at_entry()
        return Slot(key, [entry.alloca(kind) for kind in parts(key)])

    def _widest(self, name: str, key: Any) -> Any:
        if isinstance(key, tuple):
            return key[0], tuple(self._widest(f"{name}.{i}", item) for i, item in enumerate(key[1]))
        return self._widened.get(name, key) if key in WIDTH else key

    def _put(self, slot: Slot, value: Any) -> None:
        for place, part in zip(slot.places, flat(self._converted(value, slot.key)), strict=True):
            self._builder.store(part, place)

    def _assign(self, target: ast.expr, value: Any) -> None:
        match target:
            case ast.Tuple(elts=targets):
                if not isinstance(value, Record) or len(value.items) != len(targets):
                    raise self._refused(target)
                for one, item in zip(targets, value.items, strict=True):
                    self._assign(one, item)
            case ast.Subscript():
                place, kind = self._place(target, self._value(target.value))
                self._store(place, kind, value)
            case ast.Name(id=name):
                self._name(name, value)
            case _:
                raise self._refused(target)

    def _name(self, name: str, value: Any) -> None:
        before = self._names.get(name)
        if isinstance(value, (Array, Outside)) or (
            self._depth == 0 and before is None and self._function.stores[name] == 1
        ):
            if self._depth and before is not None:
                raise NotImplementedError(f"{name} becomes another array within a branch or a loop")
            self._names[name] = value
            return
        if not isinstance(before, Slot) or not alike(before.key, value.key):
            if self._depth and before is not None:
                raise NotImplementedError(f"{name}, {before.key}, becomes {value.key} within a branch or a loop")
            self._names[name] = before = self._slot(name, value.key)
        self._take_in(name, before.key, value.key)
        self._put(before, value)

    def _take_in(self, name: str, key: Any, other: Any) -> None:
        """Raise where what is assigned to a name of a key is wider, or of another kind."""
        if isinstance(key, tuple) and isinstance(other, tuple) and key[0] is other[0] and len(key[1]) == len(other[1]):
            for i, (one, two) in enumerate(zip(key[1], other[1], strict=True)):
                self._take_in(f"{name}.{i}", one, two)
        elif key in WIDTH and other in WIDTH:
            if WIDTH[other] > WIDTH[key]:
                raise WidenedError(name, other)
        elif key != other:
            raise NotImplementedError(f"{name} is {key} and {other} in {self._function.function.__qualname__}")


def _loaded(node: ast.Name) -> ast.Name:
    return ast.Name(node.id, ast.Load())
