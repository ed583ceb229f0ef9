"""Numba's decorators, with compiled code kept in files that are checked before they run.

Numba does not check its cache. A file that was cut short stops every later run; one with a flipped byte computes wrong
results. Two processes that compile a function for different arguments may get each other's code. Here each compiled
function has a file of its own with a digest. The file is valid for the sources of the function and of the kernels that
it calls, whose code it holds. What does not match is compiled and written anew.
"""

from __future__ import annotations

import hashlib
import pickle
import stat
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache, partial
from pathlib import Path
from types import FunctionType
from typing import Any

import llvmlite
import numba
import numpy as np
from numba.core import event, sigutils
from numba.core.caching import FunctionCache
from numba.core.ccallback import CFunc
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import cpu_target
from numba.core.serialize import dumps

from saltus.system.cache import read_checked, warn_not_kept, write_checked
from saltus.system.numba_tools import inner, inner_expressions, inner_numbers, inner_statements, inner_values, lowering

__all__ = ["LOWERED", "Addressed", "Generated", "cfunc", "generated", "keep_checked", "kernel", "njit", "shared"]

_LOWERED_BY = tuple(
    str(module.__file__) for module in (inner, inner_expressions, inner_numbers, inner_statements, inner_values)
)  # modules on which the code of inner functions depends

LOWERED = "saltus:lowered"  # kind of Numba's events that tell of a generated function's compilation


def njit(**options: Any) -> Callable[[FunctionType], Any]:
    """Return a decorator that is `numba.njit`; with ``cache=True`` compiled code is kept in checked files."""
    kept = options.pop("cache", False)
    if options.pop("inner", False):
        return partial(inner.inner, pasted=options.get("inline") == "always", fast=options.get("fastmath", ()))

    def compiled(function: FunctionType) -> Any:
        dispatcher = numba.njit(no_cfunc_wrapper=True, **options)(function)  # no function is passed as a value
        return keep_checked(dispatcher, function) if kept else dispatcher

    return compiled


def shared(**options: Any) -> Callable[[FunctionType], Any]:
    """Return a decorator as `njit` of what inner functions call, too: there the function is an inner one."""

    def compiled(function: FunctionType) -> Any:
        dispatcher = njit(**options)(function)
        dispatcher.inner = inner.Inner(function, False, tuple(sorted(options.get("fastmath", ()))))
        return dispatcher

    return compiled


def kernel(function: FunctionType) -> Any:
    """Return a kernel for Python to call: an inner function, and a line of Numba's that unpacks its arguments.

    Numba analyses that line alone. Compiled code is kept in checked files.
    """
    called, name = inner.inner(function), function.__name__
    arguments = ", ".join(called.inner.parameters)
    scope: dict[str, Any] = {"__name__": function.__module__, "called": called}
    text = f"def {name}({arguments}):\n    return called({arguments})"
    exec(compile(text, function.__code__.co_filename, "exec"), scope)
    dispatcher = numba.njit(no_cfunc_wrapper=True, error_model="numpy")(scope[name])
    dispatcher.inner, dispatcher.__doc__ = called.inner, function.__doc__
    return keep_checked(dispatcher, function)


def cfunc(signature: Any, **options: Any) -> Callable[[FunctionType], Any]:
    """Return a decorator as `numba.cfunc`: compiled when the address is first asked for, and kept in checked files."""
    arguments = sigutils.normalize_signature(signature)

    def compiled(function: FunctionType) -> Any:
        return keep_checked(_Callback(function, arguments, locals={}, options=dict(options)), function)

    return compiled


def generated(*, fast: bool = False) -> Callable[[FunctionType], Generated]:
    """Return a decorator of generated functions ``(k, m, x, p, out)``; `fast` ones may fuse sums with products."""
    return lambda function: Generated(function, fast)


def keep_checked(compiler: Any, function: FunctionType) -> Any:
    """Return a compiler of Numba's, which from now on keeps code in checked files of the folder that Numba chooses."""
    if not hasattr(compiler, "enable_caching"):  # NUMBA_DISABLE_JIT: the function itself
        return compiler
    if (files := _files_of(function)) is not None:
        compiler.enable_caching()
        compiler._cache._cache_file = files
    return compiler


def _files_of(function: FunctionType) -> _CheckedFiles | None:
    """Return where a function's code is kept; None where there is no such place, or anybody can write there."""
    try:
        chosen = FunctionCache(function)
    except RuntimeError as error:  # no folder can be written: the code lives as long as the process
        warn_not_kept(Path(function.__code__.co_filename).parent, str(error))
        return None
    folder = Path(chosen.cache_path)
    if folder.is_dir() and folder.stat().st_mode & stat.S_IWOTH:
        return None  # what anybody can write is not run
    return _CheckedFiles(folder, chosen._impl.filename_base, function)  # its name, its first line, Python's version


class Generated:
    """A generated function, compiled when its address is first asked for, and kept in a checked file.

    Its text is that of the file, or the global name ``TEXT``.
    """

    _kind = "generated"

    def __init__(self, function: FunctionType, fast: bool) -> None:
        self._function, self._fast, self._files = function, fast, _files_of(function)
        self._library: Any = None
        self._address: int | None = None

    @property
    def address(self) -> int:
        """Where the machine code begins; valid in this process, as long as this object lives."""
        with global_compiler_lock:
            if self._address is None:
                self._library = self._compiled()
                self._address = lowering.code_of(self._library, self._library.name)
            return self._address

    def _compiled(self) -> Any:
        """Return the library, from the file or compiled now; the symbol has its name."""
        codegen, text = cpu_target.target_context.codegen(), self._text()
        sources = _digest(lowering.__file__), hashlib.sha256(text).hexdigest()
        key = self._kind, codegen.magic_tuple(), sources, self._fast
        if self._files is not None and (found := self._files.load(key)) is not None:
            return codegen.unserialize_library(found)
        name = self._function.__name__
        symbol = f"{name}_{hashlib.sha256(repr((key, self._function.__module__)).encode()).hexdigest()[:16]}"
        with event.trigger_event(LOWERED, data={"name": name}):
            library = self._lowered(symbol)
        if self._files is not None:
            self._files.save(key, library.serialize_using_object_code())
        return library

    def _lowered(self, symbol: str) -> Any:
        function = lowering.function_in(self._text(), self._function.__name__)
        return lowering.library_of(function, symbol, fast=self._fast)

    def _text(self) -> bytes:
        text: bytes | None = self._function.__globals__.get("TEXT")
        return Path(self._function.__code__.co_filename).read_bytes() if text is None else text


class Addressed(Generated):
    """An inner function that kernels call by its address; `shared` has made it.

    Its code holds that of all functions that it calls.
    """

    _kind = "addressed"

    def __init__(self, function: Any, kinds: Sequence[Any]) -> None:
        super().__init__(function.py_func, bool(function.inner.fast))
        self._inner, self._kinds = function.inner, kinds

    def _lowered(self, symbol: str) -> Any:
        return self._inner.library(self._kinds, symbol)


class _Callback(CFunc):
    """A function called by its address, compiled when that is first asked for."""

    _wrapper_address: int | None

    @property
    def address(self) -> int:
        """Where the machine code begins; valid in this process, as long as this object lives."""
        with global_compiler_lock:  # compiled a second time, the code whose address was handed out would be freed
            if self._wrapper_address is None:
                self.compile()
            assert self._wrapper_address is not None
        return self._wrapper_address


class _CheckedFiles:
    """Compiled code of one function: what Numba's cache asks of its files.

    Parameters
    ----------
    folder : Path
        Where the files are; Numba makes it.
    base : str
        How their names begin.
    function : function
        The function to compile.
    """

    def __init__(self, folder: Path, base: str, function: FunctionType) -> None:
        self._folder, self._base, self._function = folder, base, function

    def load(self, key: tuple[Any, ...]) -> Any:
        """Return what was saved under a key from the same sources; None where there is nothing of the kind."""
        stored = read_checked(self._file(key))
        begin = self._origin(key)
        return None if stored is None or not stored.startswith(begin) else pickle.loads(stored[len(begin) :])

    def save(self, key: tuple[Any, ...], data: Any) -> None:
        """Keep what was compiled."""
        content = self._origin(key) + dumps(data)
        try:
            write_checked(self._file(key), content)
        except OSError as error:
            warn_not_kept(self._folder, error.strerror or str(error))

    def flush(self) -> None:
        """Forget all that is kept."""
        for file in self._folder.glob(f"{self._base}.*.nbc"):
            file.unlink(missing_ok=True)

    def _file(self, key: tuple[Any, ...]) -> Path:
        """One file for each signature and processor; newer code takes the place of older."""
        signature, processor, _, *launch = key  # the third is the function's own code
        digest = hashlib.sha256(repr((signature, processor, *launch)).encode()).hexdigest()[:16]
        return self._folder / f"{self._base}.{digest}.nbc"

    def _origin(self, key: tuple[Any, ...]) -> bytes:
        """Digest of all that the code depends on."""
        versions = (numba.__version__, llvmlite.__version__, sys.version)
        functions = list(_with_called(self._function))
        sources = [_digest(file) for file in sorted({f.__code__.co_filename for f in functions} | set(_LOWERED_BY))]
        constants = sorted({found for function in functions for found in _constants(function)})
        return hashlib.sha256(repr((key, versions, sources, constants)).encode()).digest()


def _constants(function: FunctionType) -> Iterator[tuple[str, str]]:
    """Names and values of the numbers that a function takes from its module, which may be those of another file."""
    for name in function.__code__.co_names:
        value = function.__globals__.get(name)
        if isinstance(value, np.ndarray):
            yield name, repr((value.shape, value.tolist()))
        elif isinstance(value, int | float) or (
            isinstance(value, tuple) and all(isinstance(item, int | float) for item in value)
        ):
            yield name, repr(value)


def _with_called(function: FunctionType) -> Iterator[FunctionType]:
    """Return a function and the compiled functions that it calls, at any depth."""
    found, waiting = {function}, [function]
    while waiting:
        function = waiting.pop()
        yield function
        for name in function.__code__.co_names:
            thing = function.__globals__.get(name)
            called = getattr(thing, "py_func", None) or getattr(thing, "_defn", None)
            if isinstance(called, FunctionType) and called not in found:
                found.add(called)
                waiting.append(called)


@lru_cache(maxsize=1024)
def _digest(file: str) -> str:
    """Digest of a source file as this process first saw it; empty where there is none."""
    try:
        return hashlib.sha256(Path(file).read_bytes()).hexdigest()
    except OSError:
        return ""
