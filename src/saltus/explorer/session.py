"""A session: a system, the steps that were taken, their results; kept in a folder as it goes, told as Python."""

from __future__ import annotations

import json
import os
import re
import shutil
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self
from uuid import uuid4

from saltus import checks
from saltus.errors import InputError, SaltusError
from saltus.explorer.colours import colour_of
from saltus.explorer.numerics import Numerics
from saltus.explorer.solutions import observable_of
from saltus.explorer.steps import Place, Step, Sweep, step_from
from saltus.explorer.subjects import Subject, system_of
from saltus.files import whole_file, write_sealed
from saltus.result import READ, SESSION, load, netcdf, reading, result_in, tagged

if TYPE_CHECKING:
    from saltus.result import Result
    from saltus.system import HybridSystem, Map

__all__ = ["Entry", "Session", "Settings", "folder_of", "is_vacant", "new_folder", "removed", "sessions_in", "told_end"]

_NOTES = "session.json"  # file of a session's folder that has all but the results
_FORMAT = 1  # of this file
_LONGEST = 2**22  # bytes that it may have
_RESULT = re.compile(r"[a-z]+[0-9]+")  # what a result is called
_ID = re.compile(r"[0-9a-f]{12}")  # what a session's folder is called


@dataclass(frozen=True)
class Entry:
    """One step that was taken."""

    name: str  # what the result is called, as ``"branch1"``
    step: Step  # the call
    result: Result  # what it returned
    seconds: float = 0.0  # how long it took
    notes: tuple[str, ...] = ()  # warnings that came meanwhile


@dataclass
class Settings:
    """What is set on the page, apart from the results."""

    parameters: dict[str, float]  # values of the fields
    x0: tuple[float, ...]  # start state
    mode: str | None = None  # mode of the start
    sets: dict[str, dict[str, Any]] = field(default_factory=dict)  # values of parameters and start, saved by name
    axes: tuple[str, ...] = ()  # what the diagram shows: abscissa and ordinate; empty for the default ones
    fixed: set[str] = field(default_factory=set)  # which axes the user chose, ``"x"``, ``"y"``: others follow results
    chosen: dict[str, str] = field(default_factory=dict)  # parameters by what they are chosen for, as ``"sweep"``
    # ranges that were typed, by what they are for and by parameter
    ranges: dict[str, dict[str, tuple[float, float]]] = field(default_factory=dict)
    more_axes: list[tuple[str, ...]] = field(default_factory=list)  # those of further diagrams
    planes: tuple[str, ...] = ()  # what the phase portrait shows
    layers: tuple[str, ...] = ("live",)  # what is ticked to be drawn in it, too
    selected: Place | None = None  # the solution that the right side shows
    hidden: set[str] = field(default_factory=set)  # names of results that are not drawn
    numerics: Numerics = field(default_factory=Numerics)  # steps, tolerances, the section of sweeps


class Session:
    """What a page shows, without the page.

    Parameters
    ----------
    subject : Subject
        The system.
    folder : Path
        Folder in which the session is kept; it is made.

    Attributes
    ----------
    entries : list of Entry
        Steps in the order in which they were taken.
    settings : Settings
        What is set on the page.
    name : str
        What the person calls it; empty without.
    forgotten : bool
        Whether nothing is kept any more, since the folder was deleted.
    """

    def __init__(self, subject: Subject, folder: Path) -> None:
        self.subject, self.folder = subject, folder
        self.system: HybridSystem | Map = subject.system
        self.entries: list[Entry] = []
        self.settings = Settings(dict(self.system.parameters), subject.start)
        self.name = ""
        self._written: set[str] = set()
        self.forgotten = False
        folder.mkdir(parents=True, exist_ok=True)

    @property
    def results(self) -> dict[str, Any]:
        """Results by name."""
        return {entry.name: entry.result for entry in self.entries}

    @property
    def last(self) -> str:
        """Name of the last result; empty without."""
        return self.entries[-1].name if self.entries else ""

    def entry(self, name: str) -> Entry:
        """Return the entry of a name."""
        return next(entry for entry in self.entries if entry.name == name)

    def changed(self) -> dict[str, float]:
        """Return the parameters that differ from the system's own."""
        own = self.system.parameters
        return {name: value for name, value in self.settings.parameters.items() if value != own[name]}

    def add(self, step: Step, result: Result, seconds: float = 0.0, notes: tuple[str, ...] = ()) -> Entry:
        """Add the result of a step; `write` keeps it.

        Parameters
        ----------
        step : Step
            The call.
        result : Result
            What it returned.
        seconds : float, optional
            How long it took.
        notes : tuple of str, optional
            Warnings that came meanwhile.
        """
        numbers = [int(entry.name.removeprefix(step.noun)) for entry in self.entries if entry.step.noun == step.noun]
        entry = Entry(f"{step.noun}{max(numbers, default=0) + 1}", step, result, seconds, notes)
        self.entries.append(entry)
        return entry

    def write(self, entry: Entry) -> None:
        """Write the result of an entry into the folder, and all notes.

        Raises
        ------
        InputError
            The folder cannot be written.
        """
        if self.forgotten:
            return
        entry.result.save(self.folder / f"{entry.name}.nc")
        self._written.add(entry.name)
        self.keep()

    def undo(self) -> Entry | None:
        """Drop the last step; return it."""
        if not self.entries:
            return None
        last = self.entries.pop()
        if self.settings.selected is not None and self.settings.selected.of == last.name:
            self.settings.selected = None
        self.settings.hidden.discard(last.name)
        self._removed(last.name)
        return last

    def replace(self, name: str) -> None:
        """Drop one step on which no other rests, to make room for a better one.

        Raises
        ------
        InputError
            Another step needs it.
        """
        if any(name in entry.step.needs for entry in self.entries):
            raise InputError("result", name, "one on which no other rests")
        self.entries = [entry for entry in self.entries if entry.name != name]
        if self.settings.selected is not None and self.settings.selected.of == name:
            self.settings.selected = None
        self._removed(name)

    def _removed(self, name: str) -> None:
        """Remove the file of a result that is no entry any more, after it has left the notes."""
        self._written.discard(name)
        self.keep()
        (self.folder / f"{name}.nc").unlink(missing_ok=True)

    def keep(self, *, closed: bool = False) -> None:
        """Write down all but the results; `closed` says that the person has left on purpose."""
        if self.forgotten:
            return
        written = [entry for entry in self.entries if entry.name in self._written]
        notes = self._notes(written) | {"closed": closed, "at": time.time()}
        with whole_file(self.folder / _NOTES, "session") as draft:
            draft.write_text(json.dumps(notes), encoding="utf-8")

    def _notes(self, entries: list[Entry]) -> dict[str, Any]:
        kept = self.settings
        return {
            "format": _FORMAT,
            "name": self.name,
            "subject": [*self.subject[:4], dict(self.subject.ranges)],
            "entries": [
                {"name": e.name, "step": e.step.model_dump(), "seconds": e.seconds, "notes": list(e.notes)}
                for e in entries
            ],
            "parameters": kept.parameters,
            "x0": list(kept.x0),
            "mode": kept.mode,
            "sets": kept.sets,
            "axes": list(kept.axes),
            "fixed": sorted(kept.fixed),
            "chosen": kept.chosen,
            "ranges": kept.ranges,
            "more_axes": [list(axes) for axes in kept.more_axes],
            "planes": list(kept.planes),
            "layers": list(kept.layers),
            "selected": None if kept.selected is None else kept.selected.model_dump(),
            "hidden": sorted(kept.hidden),
            "numerics": kept.numerics.model_dump(exclude_defaults=True),
        }

    @classmethod
    def reopened(cls, folder: Path) -> Self:
        """Return the session that a folder holds.

        Parameters
        ----------
        folder : Path
            The folder.

        Raises
        ------
        InputError
            The folder holds no session, or a damaged one.
        """
        notes = _read_notes(folder)
        results = {name: load(folder / f"{name}.nc") for name in _names(notes)}
        session = cls._made(notes, results, folder)
        session._written = set(results)
        return session

    @classmethod
    def unpacked(cls, file: Path, folder: Path) -> Self:
        """Return the session in a file of `packed`, kept from now on in a folder.

        Parameters
        ----------
        file : Path
            The file.
        folder : Path
            The folder of the new session.

        Raises
        ------
        InputError
            The file holds no session, or a damaged one.
        """
        from saltus.extras import xr

        with reading(file), xr.open_datatree(file, **READ) as tree:
            text = tree.attrs.get(SESSION)
            datasets = {name: node.to_dataset().load() for name, node in tree.children.items()}
        notes = _checked(text, file)
        if missing := [name for name in _names(notes) if name not in datasets]:
            raise InputError("path", str(file), "a whole session", f"{missing[0]} is missing")
        results = {name: result_in(datasets[name], file) for name in _names(notes)}
        session = cls._made(notes, results, folder)
        for entry in session.entries:
            session.write(entry)
        session.keep()
        return session

    def packed(self, file: Path) -> Path:
        """Write the whole session to one NetCDF file, with a group for each result.

        Parameters
        ----------
        file : Path
            The file.

        Raises
        ------
        InputError
            The file cannot be written.
        """
        from saltus.extras import xr

        root = xr.Dataset(attrs={SESSION: json.dumps(self._notes(self.entries))})
        groups = {entry.name: tagged(entry.result) for entry in self.entries}
        write_sealed(file, netcdf({"": root, **groups}))
        return file

    @classmethod
    def _made(cls, notes: Mapping[str, Any], results: Mapping[str, Result], folder: Path) -> Self:
        """Return a session of notes and results, both checked here."""
        try:
            key, definition, lines, x0, ranges = notes["subject"]
            subject = Subject(str(key), str(definition), tuple(map(str, lines)), tuple(map(float, x0)), _ranges(ranges))
            system_of(subject.definition)
            session = cls(subject, folder)
            session.name = str(notes.get("name", ""))
            for plain in notes["entries"]:
                step, told = step_from(plain["step"]), tuple(map(str, plain["notes"]))
                entry = Entry(plain["name"], step, results[plain["name"]], float(plain["seconds"]), told)
                session.entries.append(entry)
            own, kept = session.system.parameters, session.settings
            kept.parameters = {name: float(notes["parameters"].get(name, own[name])) for name in own}
            kept.x0, kept.mode = tuple(map(float, notes["x0"])), notes["mode"]
            kept.sets, kept.hidden = dict(notes["sets"]), set(map(str, notes["hidden"]))
            kept.axes, kept.planes = tuple(map(str, notes["axes"])), tuple(map(str, notes["planes"]))
            kept.numerics = Numerics.model_validate(notes.get("numerics", {}))
            kept.fixed = set(map(str, notes.get("fixed", ())))
            kept.chosen = {str(use): str(name) for use, name in notes.get("chosen", {}).items()}
            kept.ranges = {str(use): _ranges(given) for use, given in notes.get("ranges", {}).items()}
            kept.more_axes = [(str(x), str(y)) for x, y in notes.get("more_axes", ())]
            kept.layers = tuple(map(str, notes.get("layers", kept.layers)))
            kept.selected = None if notes["selected"] is None else Place.model_validate(notes["selected"])
        except SaltusError:
            raise
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            why = " ".join(f"{type(error).__name__}: {error}".split())
            raise InputError("path", str(folder), "a whole session", why) from error
        return session

    def _plot_text(self, entry: Entry) -> str:
        """Return Python that draws a result on the diagram's axes, up to the closing bracket; empty where none does."""
        colour = f"colour={colour_of(self.entries.index(entry), entry.result)!r}"
        if entry.step.noun in ("branch", "locus"):
            return f"{entry.name}.plot({', '.join(map(repr, self.settings.axes))}, {colour}"
        if not isinstance(entry.step, Sweep) or self.settings.axes[:1] != (entry.step.parameter,):
            return ""
        seen = observable_of(self.settings.axes[1], self.system)
        known = (*self.system.states, *entry.step.observables)
        return f"{entry.name}.plot({seen!r}, {colour}" if seen in known else ""

    def script(self) -> str:
        """Return Python that computes everything that the session has, and draws its diagram.

        Examples
        --------
        >>> import tempfile
        >>> from saltus import HybridSystem
        >>> from saltus.explorer.subjects import of_system
        >>> subject = of_system(HybridSystem.smooth({"x": "v", "v": "cos(s) - x - v"}, phase=("s", "1")))
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     print(Session(subject, Path(folder)).script().splitlines()[0])
        import saltus
        """
        lines = [*self.subject.lines]
        if any("np." in entry.step.text() for entry in self.entries):
            lines.insert(lines.index("import saltus"), "import numpy as np")
        lines.append("")
        lines += [f"{entry.name} = {entry.step.text()}" for entry in self.entries]
        drawn = [e for e in self.entries if e.name not in self.settings.hidden]
        plots = [told for entry in drawn if (told := self._plot_text(entry))]
        if plots:
            lines += ["", f"ax = {plots[0]})"]
            lines += [f"{told}, ax=ax, legend=False)" for told in plots[1:]]
            lines += ['ax.figure.savefig("diagram.png", dpi=200)']
        return "\n".join(lines) + "\n"


def sessions_in(home: Path) -> list[tuple[Path, Mapping[str, Any]]]:
    """Return folder and notes of the sessions in a folder, the newest first; damaged ones are left out."""
    found = []
    for folder in home.iterdir() if home.is_dir() else ():
        if _ID.fullmatch(folder.name):
            try:
                found.append((folder, _read_notes(folder)))
            except InputError:
                continue
    return sorted(found, key=lambda pair: -float(pair[1].get("at", 0.0)))


def new_folder(home: Path) -> Path:
    """Return a folder for a new session, made, for this user alone."""
    folder = home / uuid4().hex[:12]
    folder.mkdir(parents=True, mode=0o700)
    return folder


def folder_of(home: Path, name: object) -> Path | None:
    """Return the folder of the session of a name, if there is one; no name leads out of `home`."""
    if not isinstance(name, str) or not _ID.fullmatch(name) or not (home / name / _NOTES).is_file():
        return None
    return home / name


def is_vacant(folder: Path) -> bool:
    """Return whether a session's folder holds no results, neither in its notes nor as files."""
    files = [path.stem for path in folder.glob("*.nc")]  # one of a killed server may not have come into the notes
    return not _names(_read_notes(folder)) and not any(map(_RESULT.fullmatch, files))


def removed(folder: Path) -> None:
    """Delete a session's folder."""
    shutil.rmtree(folder, ignore_errors=True)


def told_end(result: Any) -> str:
    """Return why a curve or another result ended, in words; empty where nothing ends."""
    stopped = getattr(result, "stopped", "")
    reasons = [stopped] if isinstance(stopped, str) else [*dict.fromkeys(stopped)]
    return "; ".join(reason for reason in reasons if reason)


def _read_notes(folder: Path) -> Mapping[str, Any]:
    path = folder / _NOTES
    try:
        if os.path.getsize(path) > _LONGEST:
            raise InputError("session", str(folder), "notes of at most 4 MB")
        content = path.read_bytes()
    except OSError as error:
        raise InputError("session", str(folder), "a folder of a session", error.strerror or "") from None
    return _checked(content.decode(errors="replace"), folder)


def _checked(text: object, place: Path) -> Mapping[str, Any]:
    """Return notes that are what `_notes` makes, as far as their form goes."""
    try:
        notes = json.loads(checks.text("session", text))
        if not isinstance(notes, dict) or notes["format"] != _FORMAT:
            raise InputError("session", str(place), f"a session of format {_FORMAT}")
        if not all(map(_RESULT.fullmatch, _names(notes))):
            raise InputError("session", str(place), "one whose results are named as branch1")
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise InputError("session", str(place), "a file or folder of a session", f"{type(error).__name__}") from None
    return notes


def _ranges(plain: Mapping[str, Any]) -> dict[str, tuple[float, float]]:
    return {str(name): (float(low), float(high)) for name, (low, high) in plain.items()}


def _names(notes: Mapping[str, Any]) -> list[str]:
    return [str(entry["name"]) for entry in notes["entries"]]
