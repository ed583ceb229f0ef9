"""What the names of inner functions stand for while they are lowered: numbers, pointers, arrays, records of these.

A record is taken apart: LLVM sees its numbers and pointers alone, as arguments and as results too. The key of a value
is its type: Numba's type of a number, a pointer or an array, and of a record the class with the keys of its items.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from llvmlite import ir
from numba import types

__all__ = [
    "WORD",
    "Array",
    "Outside",
    "Record",
    "Scalar",
    "Slot",
    "blank",
    "flat",
    "handed",
    "key_of",
    "llvm_type",
    "numba_type",
    "of_key",
    "packed",
    "parts",
    "taken",
    "unpacked",
]

WORD = ir.IntType(64)
_KINDS = {types.boolean: ir.IntType(1), types.int64: WORD, types.float64: ir.DoubleType()}


@dataclass(frozen=True)
class Scalar:
    """A number or a pointer: its key, LLVM's value, and the number where the text has it."""

    key: Any
    value: Any
    known: Any = None


@dataclass(frozen=True)
class Record:
    """A tuple, or a named one."""

    items: tuple[Any, ...]
    kind: type | None = None

    @property
    def key(self) -> Any:
        """The class, and the keys of the items."""
        return self.kind, tuple(item.key for item in self.items)


@dataclass(frozen=True)
class Array:
    """A contiguous array: where it begins, and the lengths of its axes."""

    key: Any
    data: Any
    shape: tuple[Any, ...]


@dataclass(frozen=True)
class Outside:
    """A function, a class or a module that the text names."""

    thing: Any
    key: Any = None


class Slot:
    """A name that is assigned to more than once: a place on the stack for each part of its value."""

    def __init__(self, key: Any, places: list[Any]) -> None:
        self.key, self.places = key, places


def key_of(kind: Any) -> Any:
    """Return the key of a type of Numba's.

    Raises
    ------
    NotImplementedError
        Inner functions have no values of the type.
    """
    if isinstance(kind, types.BaseTuple):
        return getattr(kind, "instance_class", None), tuple(key_of(item) for item in kind.types)
    if isinstance(kind, types.Array) and kind.layout == "C" and kind.dtype in _KINDS:
        return kind
    if isinstance(kind, types.Integer):
        return types.int64
    if kind in _KINDS or kind is types.none or (isinstance(kind, types.CPointer) and kind.dtype in _KINDS):
        return kind
    raise NotImplementedError(f"a value of type {kind} in an inner function")


def numba_type(key: Any) -> Any:
    """Return Numba's type of a key."""
    if isinstance(key, tuple):
        return types.BaseTuple.from_types([numba_type(item) for item in key[1]], key[0])
    return key


def parts(key: Any) -> list[ir.Type]:
    """Return LLVM's types of what a value of a key is taken apart into."""
    if isinstance(key, tuple):
        return [part for item in key[1] for part in parts(item)]
    if isinstance(key, types.Array):
        return [_KINDS[key.dtype].as_pointer(), *[WORD] * key.ndim]
    return [] if key is types.none else [llvm_type(key)]


def llvm_type(key: Any) -> ir.Type:
    """Return LLVM's type of a number or a pointer."""
    return _KINDS[key.dtype].as_pointer() if isinstance(key, types.CPointer) else _KINDS[key]


def flat(value: Any) -> list[Any]:
    """Return LLVM's values that a value is taken apart into."""
    if isinstance(value, Record):
        return [part for item in value.items for part in flat(item)]
    if isinstance(value, Array):
        return [value.data, *value.shape]
    return [] if value.key is types.none else [value.value]


def of_key(key: Any, values: Iterator[Any]) -> Any:
    """Return the value of a key that is put together from LLVM's values."""
    if isinstance(key, tuple):
        return Record(tuple(of_key(item, values) for item in key[1]), key[0])
    if isinstance(key, types.Array):
        data = next(values)
        return Array(key, data, tuple(next(values) for _ in range(key.ndim)))
    return Scalar(key, None if key is types.none else next(values))


def blank(key: Any) -> Any:
    """Return a value of a key that nobody computes."""
    return of_key(key, (ir.Constant(kind, ir.Undefined) for kind in parts(key)))


def packed(builder: Any, value: Any) -> Any:
    """Return a value as LLVM's function returns it; None for nothing."""
    values = flat(value)
    if len(values) < 2:
        return values[0] if values else None
    whole = ir.Constant(ir.LiteralStructType([part.type for part in values]), ir.Undefined)
    for i, part in enumerate(values):
        whole = builder.insert_value(whole, part, i)
    return whole


def unpacked(builder: Any, key: Any, value: Any) -> Any:
    """Return the value of a key that LLVM's function returned."""
    count = len(parts(key))
    return of_key(key, iter([builder.extract_value(value, i) for i in range(count)] if count > 1 else [value]))


def taken(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    """Return a value of Numba's, of Numba's type, as inner functions have it."""
    if isinstance(kind, types.BaseTuple):
        items = [taken(context, builder, item, builder.extract_value(value, i)) for i, item in enumerate(kind.types)]
        return Record(tuple(items), getattr(kind, "instance_class", None))
    if isinstance(kind, types.Array):
        array = context.make_array(kind)(context, builder, value)
        return Array(kind, array.data, tuple(builder.extract_value(array.shape, i) for i in range(kind.ndim)))
    key = key_of(kind)
    return Scalar(key, None if key is types.none else context.cast(builder, value, kind, key))


def handed(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    """Return a value of inner functions as Numba has it."""
    if isinstance(kind, types.BaseTuple):
        items = [handed(context, builder, item, part) for item, part in zip(kind.types, value.items, strict=True)]
        return context.make_tuple(builder, kind, items)
    return context.get_dummy_value() if kind is types.none else value.value
