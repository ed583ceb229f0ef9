"""Modules of functions that are generated from a definition: one file each, in the user's cache folder.

A file is named after the mathematics of the definition, and after a digest of the sources that write such files. It
stays valid when other sources change.
"""

from __future__ import annotations

import hashlib
import json
import sys
import threading
import weakref
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

from saltus.errors import DefinitionError
from saltus.system.cache import cache_folder, let_numba_cache, read_checked, warn_not_kept, write_checked
from saltus.system.periodicity import fade_rates

if TYPE_CHECKING:
    from saltus.system.definition import Definition
    from saltus.system.writing.writer import Writer

__all__ = ["Kind", "module_of", "source_file"]


@dataclass(frozen=True)
class Kind:
    """A kind of generated module."""

    name: str  # the kind in the name of a file
    # returns the writer of such a text, given the definition's `Symbolic` and what else the text depends on
    writer: Callable[..., Writer]
    sources: tuple[str, ...]  # modules below ``saltus`` that the text comes from


def source_file(kind: Kind, system: Definition, *variant: object) -> Path:
    """Return the file of a generated text, written now unless an equal definition has one.

    Raises
    ------
    DefinitionError
        An expression of the definition cannot be read.
    """
    file = _file(kind, system, variant)
    _text(file, kind, system, variant)
    return file


def _file(kind: Kind, system: Definition, variant: tuple[object, ...]) -> Path:
    from importlib.metadata import version

    mathematics = {
        key: value
        for key, value in system.definition().items()
        if key not in ("name", "groups", "regimes", "angles", "made_of")
    }
    mathematics["parameters"] = list(system.parameters)
    for key in ("positive", "parameter_bounds"):
        mathematics.pop(key)
    mathematics |= {"fades": fades} if (fades := fade_rates(system)) else {}
    versions = [_digest(kind.sources), version("numba"), version("sympy"), sys.version_info[:2]]
    text = json.dumps([mathematics, *versions, kind.name, *variant])
    digest = hashlib.sha256(text.encode()).hexdigest()[:20]
    return cache_folder() / f"system_{digest}.py"


@cache
def _digest(sources: tuple[str, ...]) -> str:
    """A digest of the modules that write a text, so that files of an older text are not used."""
    digest, package = hashlib.sha256(), Path(__file__).parents[1]
    for name in sources:
        digest.update((package / f"{name.replace('.', '/')}.py").read_bytes())
    return digest.hexdigest()


_UNWRITTEN: dict[str, bytes] = {}  # texts that found no place on disk, by the names of their files


def _text(file: Path, kind: Kind, system: Definition, variant: tuple[object, ...]) -> bytes:
    """Return the text of a generated file; what is not there or not whole is written anew."""
    text = _UNWRITTEN.get(file.name) or read_checked(file)
    if text is None:
        from saltus.system.derivatives import Symbolic
        from saltus.system.writing.writer import module_text

        try:
            text = "".join(module_text(kind.writer(Symbolic(system), *variant))).encode()
        except RecursionError:
            allowed = "nested less deeply"
            raise DefinitionError("the definition", system.name, allowed, "SymPy cannot differentiate it") from None
        try:
            write_checked(file, text)
        except OSError as error:
            _UNWRITTEN[file.name] = text
            warn_not_kept(file.parent, error.strerror or str(error))
    return text


_LOADED: weakref.WeakValueDictionary[str, ModuleType] = weakref.WeakValueDictionary()
_RECENT: deque[ModuleType] = deque(maxlen=8)  # for systems that are made again and again
_LOADING = threading.RLock()  # held while a module is loaded: another thread must not see half of one


def module_of(kind: Kind, system: Definition, *variant: object) -> ModuleType:
    """Return a module of generated functions, which the definition keeps; what runs is the text that was checked."""
    file = _file(kind, system, variant)
    name = f"saltus_{file.stem}"
    with _LOADING:
        module = _LOADED.get(name)
        if module is None:
            text = _text(file, kind, system, variant)
            let_numba_cache()
            module = ModuleType(name)
            module.__file__ = str(file)
            module.__dict__["TEXT"] = text
            # Numba looks a module up by its name; the one that it finds keeps nothing alive
            sys.modules[name] = found = ModuleType(name)
            weakref.finalize(module, _forget, name, found)
            exec(compile(text, file, "exec"), module.__dict__)
            _LOADED[name] = module
            _RECENT.append(module)
        vars(system).setdefault("_modules", {})[name] = module  # addresses are valid as long as the module is
    return module


def _forget(name: str, found: ModuleType) -> None:
    if sys.modules.get(name) is found:  # not that of a module loaded meanwhile
        del sys.modules[name]
