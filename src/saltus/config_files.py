"""Configuration files in TOML: reading one, names of things in modules, calls with the entries of a table."""

from __future__ import annotations

import importlib
import sys
import tomllib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from inspect import Parameter, signature
from pathlib import Path
from traceback import extract_tb
from typing import Any

from saltus.errors import InputError, SaltusError, nearest

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
        There is no such module or attribute, or its code has a mistake: the message has its file and line.

    Examples
    --------
    >>> attribute_of("math:pi", Path("."), "value")
    3.141592653589793
    """
    module, _, name = reference.partition(":")
    with _importable(folder):
        try:
            found: Any = importlib.import_module(module)
        except (Exception, SystemExit) as error:
            if place := _place_of(error):
                kind = "" if isinstance(error, SaltusError) else f"{type(error).__name__}: "
                told = f"{place}: {kind}{error.msg if isinstance(error, SyntaxError) else error}"
                raise InputError(key, reference, "code that runs without an error", told) from error
            if not isinstance(error, ImportError | ValueError):
                raise
            raise InputError(key, reference, "a module that can be imported, and its attribute", str(error)) from None
    for part in name.split("."):
        if not hasattr(found, part):
            hint = nearest(part, [other for other in dir(found) if not other.startswith("_")])
            raise InputError(key, reference, f"an attribute of {module}", hint)
        found = getattr(found, part)
    return found


def _place_of(error: BaseException) -> str:
    """Return file and line of a mistake in a module that was imported; empty where the module was not found."""
    if isinstance(error, SyntaxError) and error.filename is not None:
        return f"{_shortest(error.filename)}, line {error.lineno}"
    skipped = (__file__, importlib.__file__)
    frames = [f for f in extract_tb(error.__traceback__) if f.filename not in skipped and f.filename[0] != "<"]
    home = Path(frames[0].filename).parent if frames else Path()
    own = [frame for frame in frames if Path(frame.filename).is_relative_to(home)]
    mine = [frame for frame in own if not {"site-packages", __package__} & {*Path(frame.filename).parts}]
    return f"{_shortest(mine[-1].filename)}, line {mine[-1].lineno}" if mine else ""


def _shortest(file: str) -> str:
    """Return the name of a file, relative to this folder if it is below it."""
    path = Path(file)
    return str(path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path)


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
