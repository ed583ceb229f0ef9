"""Systems that can be explored: the models of this package, one in a file of the user, or one at hand."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from saltus.config_files import attribute_of
from saltus.errors import InputError, nearest
from saltus.system import HybridSystem

if TYPE_CHECKING:
    from saltus.system import Map

__all__ = ["Subject", "built_in", "of_file", "of_system", "system_of", "titles"]

_TAPPING = {"tapping-mode-1": 1, "tapping-mode-2": 2}  # the paper's models, and their modes


class Subject(NamedTuple):
    """A system to explore.

    Attributes
    ----------
    key : str
        What sessions of the same system have in common.
    definition : str
        The definition as JSON.
    lines : tuple of str
        Python that makes the system, under the name ``system``.
    x0 : tuple of float
        A state at which to start; empty for zeros.
    ranges : mapping of str to (float, float)
        Ranges of parameters in which it is of interest.
    """

    key: str
    definition: str
    lines: tuple[str, ...]
    x0: tuple[float, ...] = ()
    ranges: dict[str, tuple[float, float]] = {}  # noqa: RUF012  # a named tuple's default, which nobody changes

    @property
    def system(self) -> HybridSystem:
        """The system itself."""
        return system_of(self.definition)


@lru_cache(maxsize=16)
def system_of(definition: str) -> HybridSystem:
    """Return the system of a definition in JSON.

    Examples
    --------
    >>> system_of(of_system(HybridSystem.smooth({"x": "v", "v": "-sin(x)"})).definition).states
    ('x', 'v')
    """
    return HybridSystem.from_definition(json.loads(definition))


def of_system(system: HybridSystem | Map, key: str = "") -> Subject:
    """Return a system at hand as a subject; its Python is the definition in full.

    Raises
    ------
    InputError
        It is no hybrid system.
    """
    if not isinstance(system, HybridSystem):
        raise InputError("system", type(system).__name__, "a HybridSystem", "a Map has `diagram` and `plot`")
    plain = system.definition()
    lines = ("import saltus", "", f"system = saltus.HybridSystem.from_definition({plain!r})")
    return Subject(key or system.name or "system", json.dumps(plain), lines)


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
        raise InputError("SYSTEM", reference, "FILE.py:NAME or MODULE:NAME", _hint(reference))
    path = Path(place)
    if path.suffix == ".py":
        if not (folder / path).is_file():
            raise InputError("SYSTEM", place, "a file that exists")
        home, module = (folder / path).absolute().parent, path.stem
    else:
        home, module = folder.absolute(), place
    system = attribute_of(f"{module}:{name}", home, "SYSTEM")
    if not isinstance(system, HybridSystem):
        raise InputError("SYSTEM", reference, f"a HybridSystem; {name} is of type {type(system).__name__}")
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
    return Subject(f"{home / path.name if path.suffix == '.py' else place}:{name}", of_system(system).definition, lines)


def built_in(key: str) -> Subject:
    """Return a model of this package.

    Raises
    ------
    InputError
        There is no such model.

    Examples
    --------
    >>> built_in("tapping-mode-1").system.states
    ('q1', 'v1')
    """
    known = titles()
    if key not in known:
        raise InputError("SYSTEM", key, f"one of {', '.join(known)}, or FILE.py:NAME", nearest(key, known))
    if key in _TAPPING:
        return _tapping(key, _TAPPING[key])
    return _instrument(key)


def titles() -> Mapping[str, str]:
    """Return the models of this package by key, with a line for each."""
    from saltus.afm.files.sets import entries_of, names

    found = {key: f"Tapping mode as in the paper, {modes} mode{'s' * (modes > 1)}" for key, modes in _TAPPING.items()}
    return found | {name: str(entries_of(name).get("title", name)) for name in names()}


def _tapping(key: str, modes: int) -> Subject:
    from saltus.afm import table1, tapping_mode

    lines = ("import saltus", "from saltus import afm", "", f"system = afm.tapping_mode(afm.table1(), modes={modes})")
    definition = of_system(tapping_mode(table1(), modes=modes)).definition
    x0 = (-0.67, *[0.0] * (modes - 1), 0.75, *[0.0] * (modes - 1))
    return Subject(key, definition, lines, x0, {"Omega": (0.8, 1.4), "ybar": (0.02, 0.3)})


def _instrument(key: str) -> Subject:
    from saltus.afm.files.configuration import named_experiment

    lines = (
        "import saltus",
        "from saltus.afm.files.configuration import named_experiment",
        "",
        f"system = named_experiment({key!r}).model()",
    )
    experiment = named_experiment(key)
    along, ends = experiment.curve.get("along", ""), experiment.curve.get("range", ())
    ranges = {along: (float(ends[0]), float(ends[1]))} if len(ends) == 2 else {}
    return Subject(key, of_system(experiment.model()).definition, lines, (), ranges)


def _hint(reference: str) -> str:
    if reference.endswith(".py"):
        return f"{reference}:oscillator, where the file has oscillator = saltus.HybridSystem(...)"
    return nearest(reference, titles())
