"""Systems and maps that can be explored: a model by its key, one in a file of the user, or one at hand."""

from __future__ import annotations

import json
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

from saltus.config_files import attribute_of
from saltus.errors import InputError
from saltus.explorer.kinds import kind_of
from saltus.system import HybridSystem, Map
from saltus.system.plain import system_from

__all__ = ["Subject", "definition_of", "of_file", "of_system", "of_text", "system_of"]

_SYSTEMS = (HybridSystem, Map)
_ALLOWED = "a HybridSystem or a Map"


class Subject(NamedTuple):
    """A system or a map to explore.

    Attributes
    ----------
    key : str
        What sessions of the same system have in common.
    definition : str
        The definition as JSON.
    lines : tuple of str
        Python that makes the system, under the name ``system``.
    x0 : tuple of float
        A state at which to start; empty for that of its kind.
    ranges : mapping of str to (float, float)
        Ranges of parameters in which it is of interest.
    """

    key: str
    definition: str
    lines: tuple[str, ...]
    x0: tuple[float, ...] = ()
    ranges: dict[str, tuple[float, float]] = {}  # noqa: RUF012  # a named tuple's default, which nobody changes

    @property
    def start(self) -> tuple[float, ...]:
        """The state at which to start."""
        return self.x0 or (kind_of(self.system).start,) * len(self.system.states)

    @property
    def system(self) -> HybridSystem | Map:
        """The system itself."""
        return system_of(self.definition)


@lru_cache(maxsize=16)
def system_of(definition: str) -> HybridSystem | Map:
    """Return the system or the map of a definition in JSON.

    Examples
    --------
    >>> system_of(of_system(HybridSystem.smooth({"x": "v", "v": "-sin(x)"})).definition).states
    ('x', 'v')
    """
    return system_from(json.loads(definition))


def definition_of(system: HybridSystem | Map) -> str:
    """Return the definition of a system as JSON."""
    return json.dumps(system.definition())


def of_system(system: HybridSystem | Map, key: str = "") -> Subject:
    """Return a system at hand as a subject; its Python is the definition in full.

    Raises
    ------
    InputError
        It is neither a hybrid system nor a map.
    """
    if not isinstance(system, _SYSTEMS):
        raise InputError("system", type(system).__name__, _ALLOWED)
    lines = ("import saltus", "", f"system = saltus.{type(system).__name__}.from_definition({system.definition()!r})")
    return Subject(key or system.name or "system", definition_of(system), lines)


def of_text(path: Path) -> Subject:
    """Return the system in a file of equations as text.

    Raises
    ------
    InputError
        There is no such file, or its text is no system: the message names the line.
    """
    from saltus.explorer.equations import LONGEST, read_equations

    try:
        if path.stat().st_size > 4 * LONGEST:
            raise InputError("SYSTEM", str(path), f"a file of at most {LONGEST} characters")
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError("SYSTEM", str(path), "a text file that can be read", str(error)) from None
    return of_system(read_equations(text), str(path.absolute()))


def of_file(reference: str, folder: Path) -> Subject:
    """Return the system that ``file.py:name`` or ``module:name`` names; the file is run.

    Parameters
    ----------
    reference : str
        File or module, and the name of the system in it.
    folder : Path
        Folder from which the file or module is looked for.

    Raises
    ------
    InputError
        There is no such file, name or system.
    """
    place, _, name = reference.rpartition(":")
    if not place or not name:
        hint = f"{reference}:oscillator, where the file has oscillator = saltus.HybridSystem(...)"
        raise InputError("SYSTEM", reference, "FILE.py:NAME or MODULE:NAME", hint if reference.endswith(".py") else "")
    path = Path(place)
    if path.suffix == ".py":
        if not (folder / path).is_file():
            raise InputError("SYSTEM", place, "a file that exists")
        home, module = (folder / path).absolute().parent, path.stem
    else:
        home, module = folder.absolute(), place
    system = attribute_of(f"{module}:{name}", home, "SYSTEM")
    if not isinstance(system, _SYSTEMS):
        raise InputError("SYSTEM", reference, f"{_ALLOWED}; {name} is of type {type(system).__name__}")
    lines = (
        "import sys",
        "",
        "import saltus",
        "",
        f"sys.path.insert(0, {str(home)!r})",
        f"from {module} import {name.partition('.')[0]}",
        "",
        f"system = {name}",
    )
    return Subject(f"{home / path.name if path.suffix == '.py' else place}:{name}", definition_of(system), lines)
