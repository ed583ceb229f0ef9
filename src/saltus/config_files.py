"""Configuration files in TOML: reading one, names of things in modules, calls with the entries of a table."""

from __future__ import annotations

import sys
import tomllib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from importlib import import_module
from inspect import Parameter, signature
from pathlib import Path
from typing import Any

from saltus.errors import InputError, nearest

__all__ = ["attribute_of", "called", "read_toml"]


def read_toml(path: Path) -> dict[str, Any]:
    """Return the entries of a TOML file.

    Raises
    ------
    InputError
        There is no such file, or it is no TOML.

    Examples
    --------
    >>> read_toml(Path("nowhere.toml"))
    Traceback (most recent call last):
        ...
    saltus.errors.InputError: config = 'nowhere.toml': must be a file that can be read; No such file or directory
    """
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError("config", str(path), "a file that can be read", error.strerror or str(error)) from None
    except (UnicodeDecodeError, tomllib.TOMLDecodeError, RecursionError) as error:
        raise InputError("config", str(path), "a TOML file", str(error)) from None


def attribute_of(reference: str, folder: Path, key: str) -> Any:
    """Return what ``module:attribute`` names; the module is imported, and so its code runs.

    Parameters
    ----------
    reference : str
        Module and attribute.
    folder : Path
        Folder in which the module is looked for before the other ones of Python.
    key : str
        Key of the reference, for messages.

    Raises
    ------
    InputError
        There is no such module or attribute.

    Examples
    --------
    >>> attribute_of("math:pi", Path("."), "value")
    3.141592653589793
    """
    module, _, name = reference.partition(":")
    with _importable(folder):
        try:
            found: Any = import_module(module)
        except (ImportError, ValueError) as error:
            raise InputError(key, reference, "a module that can be imported, and its attribute", str(error)) from None
    for part in name.split("."):
        if not hasattr(found, part):
            hint = nearest(part, [other for other in dir(found) if not other.startswith("_")])
            raise InputError(key, reference, f"an attribute of {module}", hint)
        found = getattr(found, part)
    return found


@contextmanager
def _importable(folder: Path) -> Iterator[None]:
    """Let Python import modules from a folder, too."""
    place = str(folder.absolute())
    sys.path.insert(0, place)
    try:
        yield
    finally:
        sys.path.remove(place)


def called(make: Callable[..., Any], arguments: Mapping[str, Any], table: str) -> Any:
    """Return the result of a callable with the entries of a table as arguments.

    Parameters
    ----------
    make : callable
        What is called.
    arguments : mapping of str to object
        The table's entries.
    table : str
        The table's name, for messages; empty for the file itself.

    Raises
    ------
    InputError
        An entry that is no argument of the callable, or a missing argument.

    Examples
    --------
    >>> called(complex, {"real": 1.0}, "number")
    (1+0j)
    """
    parameters = signature(make).parameters.values()
    taken = [p for p in parameters if p.kind in (Parameter.POSITIONAL_OR_KEYWORD, Parameter.KEYWORD_ONLY)]
    names = [parameter.name for parameter in taken]
    if not any(parameter.kind is Parameter.VAR_KEYWORD for parameter in parameters):
        for name in arguments:
            if name not in names:
                where = f" in [{table}]" if table else ""
                raise InputError("key", name, f"one of {', '.join(names)}{where}", nearest(name, names))
    for parameter in taken:
        if parameter.default is Parameter.empty and parameter.name not in arguments:
            raise InputError(f"{table}.{parameter.name}".removeprefix("."), None, "given")
    return make(**arguments)
