"""Inner functions of kernels: they become LLVM code of the kernel that calls them, without Numba's analysis of types.

An inner function computes with numbers, pointers and records of these. The types of its arguments give all others, in
one pass through its text. A name that is an integer in one place and a float in another is a float, and the pass begins
anew. The code goes into the caller's module, so that LLVM sees a kernel once, whole. Numba lowers the elementary
functions. The measurement is in docs/decisions/0031-inner-functions-are-lowered-directly.md.
"""

from __future__ import annotations

import ast
import builtins
import inspect
import textwrap
from collections import Counter
from collections.abc import Iterable, Sequence
from functools import cache, cached_property
from types import FunctionType
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import fastmathpass
from numba.core.callconv import create_error_model
from numba.core.registry import cpu_target
from numba.extending import intrinsic

from saltus.system.numba_tools import lowering
from saltus.system.numba_tools.inner_statements import Lowering, WidenedError
from saltus.system.numba_tools.inner_values import flat, handed, key_of, numba_type, of_key, parts, taken, unpacked

__all__ = ["Inner", "inner"]

_MADE = "saltus_inner"  # attribute of a module: the inner functions that it has


def inner(function: FunctionType, *, pasted: bool = False, fast: Iterable[str] = ()) -> Any:
    """Return a function for kernels to call, which is lowered into each of them.

    Parameters
    ----------
    function : function
        Its text.
    pasted : bool
        Whether it is always copied into its callers.
    fast : iterable of str
        LLVM's flags of its sums and products.
    """
    made = Inner(function, pasted, tuple(sorted(fast)))
    names = ", ".join(made.parameters)
    scope: dict[str, Any] = {"typed": made.typed}
    exec(f"def {function.__name__}(context, {names}):\n    return typed([{names}])", scope)
    called = intrinsic(scope[function.__name__])
    called.py_func, called.inner = function, made
    return called


class Inner:
    """An inner function: its text, and the types of its results by the types of its arguments."""

    def __init__(self, function: FunctionType, pasted: bool, fast: tuple[str, ...]) -> None:
        self.function, self.pasted, self.fast = function, pasted, fast
        self.parameters = list(inspect.signature(function).parameters)
        self._results: dict[Any, Any] = {}
        self._widened: dict[Any, dict[str, Any]] = {}

    @cached_property
    def tree(self) -> ast.FunctionDef:
        """The syntax tree; the text is that of the file, or the global name ``TEXT``."""
        text = self.function.__globals__.get("TEXT")
        if text is not None:
            return lowering.function_in(text, self.function.__name__)
        found = ast.parse(textwrap.dedent(inspect.getsource(self.function))).body[0]
        assert isinstance(found, ast.FunctionDef)
        return found

    @cached_property
    def stores(self) -> Counter[str]:
        """How often the text sets each of its names."""
        return Counter(n.id for n in ast.walk(self.tree) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store))

    @cached_property
    def outside(self) -> dict[str, Any]:
        """What the names of the text stand for that it does not set itself."""
        cells = zip(self.function.__code__.co_freevars, self.function.__closure__ or (), strict=True)
        return vars(builtins) | self.function.__globals__ | {n: cell.cell_contents for n, cell in cells}

    def typed(self, kinds: Sequence[Any]) -> Any:
        """Return Numba's signature of a call with arguments of some types, and what lowers the call."""
        kinds = [types.unliteral(kind) for kind in kinds]
        key = tuple(key_of(kind) for kind in kinds)

        def lower(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            values = [taken(context, builder, kind, value) for kind, value in zip(kinds, arguments, strict=True)]
            return handed(context, builder, signature.return_type, self.called(context, builder, values))

        return numba_type(self.returned(key))(*kinds), lower

    def called(self, context: Any, builder: Any, arguments: Sequence[Any]) -> Any:
        """Return the result of a call; the function is written into the module first, where it is not there."""
        key = tuple(value.key for value in arguments)
        returned, made = self.returned(key), builder.module.__dict__.setdefault(_MADE, {})
        if (self, key) not in made:
            made[self, key] = self._written(context, builder.module, key)
        value = builder.call(made[self, key], [part for argument in arguments for part in flat(argument)])
        return unpacked(builder, returned, value)

    def returned(self, key: Any) -> Any:
        """Return the key of what the function returns for arguments of these keys."""
        if key not in self._results:
            widened: dict[str, Any] = {}
            while key not in self._results:
                code = ir.Function(ir.Module(), _signature(None, key), self.function.__name__)
                try:
                    self._results[key] = Lowering(_context(), self, code, widened).lower(self._named(key, code.args))
                except WidenedError as wider:
                    widened[wider.name] = wider.kind
            self._widened[key] = widened
        return self._results[key]

    def _written(self, context: Any, module: ir.Module, key: Any) -> ir.Function:
        """Return the function in a module."""
        returned = self.returned(key)
        name = module.get_unique_name(f"saltus.{self.function.__module__}.{self.function.__name__}")
        code = ir.Function(module, _signature(returned, key), name)
        code.linkage = "internal"
        if self.pasted:
            code.attributes.add("alwaysinline")
        Lowering(context, self, code, self._widened[key], returned).lower(self._named(key, code.args))
        if self.fast:
            fastmathpass.FastFloatBinOpVisitor(self.fast).visit_Function(code)
        return code

    def library(self, kinds: Sequence[Any], symbol: str) -> Any:
        """Return a library of Numba's with the function, compiled for arguments of some types.

        The caller holds Numba's lock.
        """
        context = _context()

        def write(module: ir.Module) -> None:
            code = self._written(context, module, tuple(key_of(kind) for kind in kinds))
            code.name, code.linkage = symbol, ""

        return lowering.linked(context, symbol, write)

    def _named(self, key: Any, values: Iterable[Any]) -> dict[str, Any]:
        rest = iter(values)
        return {name: of_key(kind, rest) for name, kind in zip(self.parameters, key, strict=True)}


def _signature(returned: Any, key: Any) -> ir.FunctionType:
    """Return LLVM's type of a function of arguments of these keys; without the key of a result it returns nothing."""
    found = [] if returned is None else parts(returned)
    whole = ir.VoidType() if not found else found[0] if len(found) == 1 else ir.LiteralStructType(found)
    return ir.FunctionType(whole, [part for kind in key for part in parts(kind)])


@cache
def _context() -> Any:
    """Return Numba's context with which types are sought."""
    cpu_target.target_context.refresh()
    context = cpu_target.target_context.subtarget()
    context.error_model = create_error_model("numpy", context)
    context.enable_nrt = True
    return context
