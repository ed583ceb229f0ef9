"""What an application adds to the explorer, handed over as data: models by key, readings and films of their orbits."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from saltus.errors import InputError, nearest
from saltus.explorer.subjects import of_file, of_text

if TYPE_CHECKING:
    from saltus.explorer.subjects import Subject
    from saltus.orbits import PeriodicOrbit
    from saltus.system import HybridSystem

__all__ = ["Application"]


@dataclass(frozen=True)
class Application:
    """An application, as far as the explorer shows it.

    Its functions are handed to other processes: each must stand in a module.
    """

    titles: Mapping[str, str]  # the models by key, with a line for each
    make: Callable[[str], Subject]  # returns the `Subject` of a key
    # returns what an instrument shows of an orbit, by name; empty for an orbit of another system
    readings: Callable[[PeriodicOrbit], Mapping[str, Any]]
    films: Callable[[HybridSystem], bool]  # returns whether orbits of a system can be filmed
    # films an orbit: called with the orbit, the file's path and ``progress``, it returns the path
    film: Callable[..., Path]

    def subject(self, key: str) -> Subject:
        """Return a model.

        Raises
        ------
        InputError
            There is no such model.
        """
        if key not in self.titles:
            raise InputError(
                "SYSTEM", key, f"one of {', '.join(self.titles)}, or FILE.py:NAME", nearest(key, self.titles)
            )
        return self.make(key)

    def named(self, text: str) -> Subject:
        """Return the system that an argument of ``saltus explore`` names.

        Parameters
        ----------
        text : str
            ``FILE.py:NAME`` or ``MODULE:NAME``, whose code is run, ``FILE.txt`` with equations, or the key of a model.

        Raises
        ------
        InputError
            There is no such system.
        """
        if text.endswith(".txt"):
            return of_text(Path(text))
        return of_file(text, Path.cwd()) if ":" in text or text.endswith(".py") else self.subject(text)
