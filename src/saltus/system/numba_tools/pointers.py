"""Pointers of compiled functions, calls by address, and the options by which functions are compiled."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core.errors import TypingError
from numba.extending import intrinsic

# Options of functions that only other kernels call, and that are written into each of them.
INNER: dict[str, Any] = {"inner": True}
PART: dict[str, Any] = {"inner": True, "inline": "always"}  # of functions pasted into their callers
# Options of functions that only kernels call, and that need more of NumPy than inner functions have.
ARRAYS: dict[str, Any] = {"error_model": "numpy", "no_cpython_wrapper": True}


@intrinsic
def apart(typingctx):
    """Declare that no two arguments of the function share memory, so that its loops vectorise without checks of it."""

    def lower(context, builder, signature, arguments):
        for argument in builder.function.args:
            if isinstance(argument.type, ir.PointerType):
                argument.add_attribute("noalias")
        return context.get_dummy_value()

    return types.void(), lower


@intrinsic
def outlined(typingctx):
    """Declare that the function is not to be copied into those that call it, which saves compiling it over and over."""

    def lower(context, builder, signature, arguments):
        builder.function.attributes.add("noinline")
        return context.get_dummy_value()

    return types.void(), lower


def entries(context, builder, type_, value):
    """Where the entries of a contiguous array begin; a pointer is one already."""
    return value if isinstance(type_, types.CPointer) else context.make_array(type_)(context, builder, value).data


@intrinsic
def pointer(typingctx, array, at):
    """Return the address of an entry of a contiguous array, flat, or of what a pointer points to.

    Pointers are what kernels hand to each other: indexing one compiles in half the time, and it is one argument, not
    seven. The array must live on: see `keep`.
    """
    if isinstance(array, types.Array) and array.layout != "C":
        raise TypingError("a pointer needs a contiguous array")
    signature = types.CPointer(array.dtype)(array, types.int64)

    def lower(context, builder, signature, arguments):
        return builder.gep(entries(context, builder, signature.args[0], arguments[0]), [arguments[1]])

    return signature, lower


@intrinsic
def numbers_at(typingctx, address):
    """Return a pointer to the numbers at an address; the array that holds them must live on."""
    signature = types.CPointer(types.float64)(types.int64)

    def lower(context, builder, signature, arguments):
        return builder.inttoptr(arguments[0], context.get_value_type(signature.return_type))

    return signature, lower


@intrinsic
def stack(typingctx, kind, count):
    """Return a pointer to `count` numbers of a type, on the stack: for a few states, and never inside a loop."""
    signature = types.CPointer(kind.dtype)(kind, types.int64)

    def lower(context, builder, signature, arguments):
        return builder.alloca(context.get_value_type(signature.return_type.dtype), arguments[1])

    return signature, lower


@intrinsic
def keep(typingctx, array):
    """Do nothing with an array, which lives until here though only pointers to it were used."""

    def lower(context, builder, signature, arguments):
        return context.get_dummy_value()

    return types.void(array), lower


@intrinsic
def invoke(typingctx, address, arguments):
    """Call a compiled function, which returns a number, by its address; its arguments are a tuple of numbers and pointers.

    What is called so is compiled apart from its callers, and not at all where nobody needs it.
    """
    kinds = types.Tuple([types.unliteral(kind) for kind in arguments])

    def lower(context, builder, signature, given):
        values = [builder.extract_value(given[1], i) for i in range(len(kinds))]
        kind = ir.FunctionType(ir.DoubleType(), [value.type for value in values])
        return builder.call(builder.inttoptr(given[0], kind.as_pointer()), values)

    return types.float64(types.int64, kinds), lower


@intrinsic
def call(typingctx, address, k, m, x, x_at, p, out, out_at):
    """Call a generated function by its address, on flat arrays, or pointers, from the given offsets."""
    signature = types.void(types.int64, types.int64, types.int64, x, types.int64, p, out, types.int64)

    def lower(context, builder, signature, arguments):
        address, k, m, x, x_at, p, out, out_at = arguments
        double, integer = ir.DoubleType().as_pointer(), ir.IntType(64)
        kind = ir.FunctionType(ir.VoidType(), [integer, integer, double, double, double])
        pointers = []
        for value, type_, at in (
            (x, signature.args[3], x_at),
            (p, signature.args[5], None),
            (out, signature.args[6], out_at),
        ):
            data = entries(context, builder, type_, value)
            pointers.append(data if at is None else builder.gep(data, [at]))
        builder.call(builder.inttoptr(address, kind.as_pointer()), [k, m, *pointers])
        return context.get_dummy_value()

    return signature, lower
