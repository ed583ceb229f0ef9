"""Texts, names, sequences, mappings and paths as a user hands them in."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from itertools import islice
from pathlib import Path
from types import MappingProxyType
from typing import Any

from saltus.errors import InputError, UnknownNameError, nearest

__all__ = [
    "chosen",
    "listed",
    "mapping",
    "named_values",
    "names",
    "path",
    "text",
]

MOST_ITEMS = 10**5  # most items of a sequence whose items are looked at one by one
_LONGEST_PART = 255  # bytes in a part of a path, at most: the limit of common file systems


def text(name: str, value: object, allowed: str = "text") -> str:
    """Return a text.

    Raises
    ------
    InputError
        It is none.
    """
    if not isinstance(value, str):
        raise InputError(name, value, allowed)
    return value


def chosen(name: str, value: object, known: Iterable[str], *, instead: str = "", hint: str = "") -> str:
    """Return a name that is among those known.

    Parameters
    ----------
    known : iterable of str
        What it may be.
    instead : str, optional
        What else is allowed, to be read after "one of a, b".
    hint : str, optional
        What to do about it; by default which of the names is nearest.

    Raises
    ------
    InputError
        It is not among them.

    Examples
    --------
    >>> chosen("mode", "fligth", ("flight", "contact"))
    Traceback (most recent call last):
        ...
    saltus.errors.InputError: mode = 'fligth': must be one of flight, contact; did you mean 'flight'?
    """
    names_ = tuple(known)
    if isinstance(value, str) and value in names_:
        return value
    allowed = f"one of {', '.join(names_)}" if names_ else "left out, as there is none"
    raise InputError(name, value, allowed + instead, nearest(value, names_) or hint)


class _NamedValues(dict[str, Any]):
    """Values by name; a name that is not there is told with those that are."""

    def __init__(self, what: str, values: Mapping[str, Any]) -> None:
        super().__init__(values)
        self.what = what

    def __missing__(self, name: object) -> Any:
        allowed = f"one of {', '.join(self)}" if self else "left out, as there is none"
        raise UnknownNameError(self.what, name, allowed, nearest(name, self))


def named_values(what: str, values: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return values by name that cannot be changed; `what` is what messages call a name that is not there.

    Examples
    --------
    >>> named_values("parameter", {"Omega": 1.0})["Omga"]
    Traceback (most recent call last):
        ...
    saltus.errors.UnknownNameError: parameter = 'Omga': must be one of Omega; did you mean 'Omega'?
    """
    return MappingProxyType(_NamedValues(what, values))


def listed(name: str, value: object, allowed: str, *, most: int = MOST_ITEMS) -> tuple[Any, ...]:
    """Return the items of a sequence or of any other iterable, but a text or a mapping.

    Raises
    ------
    InputError
        It is none, or has more than `most` items.

    Examples
    --------
    >>> listed("parameters", ("A", "e", "w"), "two names", most=2)
    Traceback (most recent call last):
        ...
    saltus.errors.InputError: parameters = ('A', 'e', 'w'): must be two names
    """
    if isinstance(value, str):
        raise InputError(name, value, allowed)
    found = tuple(islice(_lazily(name, value, allowed), most + 1))
    if len(found) > most:
        raise InputError(name, value, allowed, f"these are more than {most}" if most == MOST_ITEMS else "")
    return found


def names(name: str, value: object, what: str, *, least: int = 0) -> tuple[str, ...]:
    """Return the texts of a sequence, each of them once; `what` says what they are, as in "names of states".

    Raises
    ------
    InputError
        It is no sequence of texts, one stands there twice, or they are fewer than `least`.

    Examples
    --------
    >>> names("observables", "max(z)", "observables")
    Traceback (most recent call last):
        ...
    saltus.errors.InputError: observables = 'max(z)': must be a sequence of observables; put it into a list
    """
    allowed = f"a sequence of {what}" + (", at least one" if least == 1 else "")
    if isinstance(value, str):
        raise InputError(name, value, allowed, "put it into a list")
    found: dict[str, None] = {}
    for item in _lazily(name, value, allowed):
        if not isinstance(item, str):
            raise InputError(name, item, allowed)
        if item in found:
            raise InputError(name, item, "named once")
        found[item] = None
    if len(found) < least:
        raise InputError(name, value, allowed)
    return tuple(found)


def _lazily(name: str, value: object, allowed: str) -> Iterator[Any]:
    """Go through an iterable up to where the caller has seen enough of it."""
    if isinstance(value, bytes | bytearray | Mapping) or not isinstance(value, Iterable):
        raise InputError(name, value, allowed)
    try:
        yield from value
    except InputError:
        raise
    except Exception as error:  # a generator of one's own, or an array without dimensions
        raise InputError(name, value, allowed, f"{type(error).__name__}: {error}") from error


def mapping(name: str, value: object, what: str, *, known: Iterable[str] | None = None) -> dict[str, Any]:
    """Return a mapping whose keys are texts, as a dict; empty for None.

    Parameters
    ----------
    what : str
        What it maps, as in "names to numbers".
    known : iterable of str, optional
        The keys it may have.

    Raises
    ------
    InputError
        It is no mapping, a key is no text, or not among those known.

    Examples
    --------
    >>> mapping("weights", [1.0], "coordinates to lengths")
    Traceback (most recent call last):
        ...
    saltus.errors.InputError: weights = [1.0]: must be a mapping of coordinates to lengths
    """
    allowed = f"a mapping of {what}"
    if value is None:
        return {}
    if not isinstance(value, Mapping):
        raise InputError(name, value, allowed)
    try:
        found = dict(value)
    except Exception as error:  # of a mapping that only seems to be one
        raise InputError(name, value, allowed, f"{type(error).__name__}: {error}") from error
    for key in found:
        if known is not None:
            chosen(name, key, known)
        elif not isinstance(key, str):
            raise InputError(f"a name in {name}", key, "text")
    return found


def path(name: str, value: object, what: str = "the path of a file") -> Path:
    """Return a path on disk; whether anything is there is not looked at.

    Raises
    ------
    InputError
        It is neither a text nor path-like, or no file system takes it.

    Examples
    --------
    >>> path("path", 3)
    Traceback (most recent call last):
        ...
    saltus.errors.InputError: path = 3: must be the path of a file; a text, or path-like
    """
    try:
        given = os.fspath(value)  # type: ignore[call-overload]
    except Exception:
        given = None
    if not isinstance(given, str) or not given:
        hint = "os.fsdecode makes a text of bytes" if isinstance(given, bytes) else "a text, or path-like"
        raise InputError(name, value, what, hint)
    try:
        parts = [len(os.fsencode(part)) for part in Path(given).parts]
    except UnicodeEncodeError:
        raise InputError(name, value, what, "it has characters that file names cannot have here") from None
    if "\0" in given:
        raise InputError(name, value, what, "it has a null character")
    if max(parts, default=0) > _LONGEST_PART:
        raise InputError(name, value, what, f"a part of it is longer than {_LONGEST_PART} bytes")
    return Path(given)
