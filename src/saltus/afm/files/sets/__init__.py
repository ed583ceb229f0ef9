"""Named parameter sets, each a configuration of `saltus afm` with its title and its source."""

from __future__ import annotations

import tomllib
from importlib.resources import files
from typing import Any

from saltus.errors import InputError, nearest

__all__ = ["entries_of", "names", "text_of"]


def names() -> tuple[str, ...]:
    """Return the names of all sets.

    Examples
    --------
    >>> "lever-s" in names()
    True
    """
    found = (file.name for file in files(__name__).iterdir())
    return tuple(sorted(name.removesuffix(".toml") for name in found if name.endswith(".toml")))


def text_of(name: str) -> str:
    """Return a set as the text of a TOML file.

    Raises
    ------
    InputError
        There is no such set.

    Examples
    --------
    >>> text_of("lever_s")
    Traceback (most recent call last):
        ...
    saltus.errors.InputError: set = 'lever_s': must be one of ...; did you mean 'lever-s'?
    """
    known = names()
    if name not in known:
        raise InputError("set", name, f"one of {', '.join(known)}", nearest(name, known))
    return files(__name__).joinpath(f"{name}.toml").read_text(encoding="utf-8")


def entries_of(name: str) -> dict[str, Any]:
    """Return the entries of a set; raise `InputError` where there is none of this name.

    Examples
    --------
    >>> entries_of("lever-s")["probe"]
    {'k_N_m': 26.0, 'f0_kHz': 300.0, 'Q': 400.0, 'R_nm': 12.0}
    """
    return tomllib.loads(text_of(name))
