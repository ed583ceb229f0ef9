"""Curves of Gwyddion's files (.gwy): graphs and point spectra in a tree of objects."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from saltus.afm.files.columns import FileColumn, FileContents, bounded, parsed, whole
from saltus.errors import InputError

__all__ = ["read_gwyddion"]

_KIND = "a file of Gwyddion (.gwy) with graphs or spectra"
_MAGIC = b"GWYP"
_DEPTH = 24  # objects within each other, at most
_ATOMS = {"b": ("<?", 1), "c": ("<b", 1), "i": ("<i", 4), "q": ("<q", 8), "d": ("<d", 8)}
_ARRAYS = {"C": "<i1", "I": "<i4", "Q": "<i8", "D": "<f8"}


@dataclass(frozen=True)
class _Object:
    """An object of the tree: its kind and its components."""

    kind: str
    parts: dict[str, Any] = field(default_factory=dict)

    def text(self, name: str) -> str:
        """Return a component that is a text; an empty one where there is none."""
        found = self.parts.get(name, "")
        return found if isinstance(found, str) else ""

    def unit(self, name: str) -> str:
        """Return the unit of a component; an empty one is the unit of a number."""
        found = self.parts.get(name)
        return found.text("unitstr") if isinstance(found, _Object) else ""

    def numbers(self, name: str) -> NDArray[np.float64]:
        """Return a component that is an array of numbers."""
        found = self.parts.get(name)
        if not isinstance(found, np.ndarray) or found.dtype.kind != "f":
            raise ValueError(f"{self.kind} has no numbers {name}")
        return found

    def objects(self, name: str, kind: str) -> list[_Object]:
        """Return a component that is an array of objects of one kind."""
        found = self.parts.get(name, [])
        if not isinstance(found, list) or any(not isinstance(one, _Object) or one.kind != kind for one in found):
            raise ValueError(f"{self.kind} has other things than {kind} as {name}")
        return found


class _Reader:
    """Reads components; each size is checked against the end of what it is in."""

    def __init__(self, content: bytes) -> None:
        self.content = content

    def object(self, at: int, end: int, depth: int = 0) -> tuple[_Object, int]:
        """Return an object and where it ends."""
        if depth > _DEPTH:
            raise ValueError("objects lie too deep")
        kind, at = self.word(at, end)
        (size,) = self.fixed("<I", at, end)
        at, stop = at + 4, at + 4 + size
        if stop > end:
            raise ValueError(f"{kind} ends at byte {stop}, and what it is in at {end}")
        parts: dict[str, Any] = {}
        while at < stop:
            name, at = self.word(at, stop)
            (letter,) = self.fixed("<c", at, stop)
            parts[name], at = self.value(letter.decode("latin-1"), at + 1, stop, depth)
        return _Object(kind, parts), stop

    def value(self, letter: str, at: int, end: int, depth: int) -> tuple[Any, int]:
        """Return the value of a component and where it ends."""
        if letter in _ATOMS:
            form, size = _ATOMS[letter]
            return self.fixed(form, at, end)[0], at + size
        if letter == "s":
            return self.word(at, end)
        if letter == "o":
            return self.object(at, end, depth + 1)
        if letter not in _ARRAYS and letter not in "SO":
            raise ValueError(f"a component has the type {letter!r}")
        (count,) = self.fixed("<I", at, end)
        at += 4
        if letter in _ARRAYS:
            kind = np.dtype(_ARRAYS[letter])
            if at + count * kind.itemsize > end:
                raise ValueError(f"an array of {count} numbers has room for {(end - at) // kind.itemsize}")
            return np.frombuffer(self.content, kind, count, at), at + count * kind.itemsize
        found = []
        for _ in range(count):  # each takes a byte at least, so that a wrong count soon meets the end
            one, at = self.word(at, end) if letter == "S" else self.object(at, end, depth + 1)
            found.append(one)
        return found, at

    def word(self, at: int, end: int) -> tuple[str, int]:
        """Return a text that ends with a zero, and where what follows begins."""
        stop = self.content.find(b"\0", at, end)
        if stop < 0:
            raise ValueError("a text has no end")
        return self.content[at:stop].decode("utf-8"), stop + 1

    def fixed(self, form: str, at: int, end: int) -> tuple[Any, ...]:
        """Return numbers of a fixed size."""
        if at + struct.calcsize(form) > end:
            raise ValueError("an object ends within a number")
        return struct.unpack_from(form, self.content, at)


def read_gwyddion(path: Path) -> FileContents:
    """Return the curves of a file of Gwyddion: abscissae and ordinates of its graphs and of its spectra."""
    found: FileContents = parsed(path, _KIND, lambda name: _read(Path(name)))
    if not found.columns:
        raise InputError("path", str(path), _KIND, "it has none; images and curve maps are not read")
    return found


def _read(path: Path) -> FileContents:
    content = whole(path)
    if not content.startswith(_MAGIC):
        raise ValueError("it does not begin with GWYP")
    top, end = _Reader(content).object(len(_MAGIC), len(content))
    if end != len(content):
        raise ValueError(f"its objects end at byte {end}, and the file at {len(content)}")
    columns: list[FileColumn] = []
    constants: dict[str, str] = {}
    for name, part in sorted(top.parts.items()):
        if isinstance(part, _Object) and part.kind in ("GwyGraphModel", "GwySpectra"):
            known = [column.name for column in columns]
            found = _graph(part) if part.kind == "GwyGraphModel" else _spectra(part)
            columns += [_renamed(column, known) for column in found]
        elif isinstance(part, _Object) and name.endswith("meta"):
            constants |= {key: bounded(value) for key, value in part.parts.items() if isinstance(value, str)}
    return FileContents("curves of Gwyddion", tuple(columns), constants)


def _renamed(column: FileColumn, known: list[str]) -> FileColumn:
    """Return a column whose name no other has."""
    name, number = column.name, 1
    while name in known:
        number += 1
        name = f"{column.name} ({number})"
    known.append(name)
    return column._replace(name=name)


def _graph(graph: _Object) -> Iterator[FileColumn]:
    """Give abscissa and ordinate of each curve of a graph, by the curve's description."""
    title = graph.text("title") or "graph"
    along = graph.text("bottom_label") or "x"
    for number, curve in enumerate(graph.objects("curves", "GwyGraphCurveModel"), 1):
        x, y = curve.numbers("xdata"), curve.numbers("ydata")
        if len(x) != len(y):
            raise ValueError(f"a curve has {len(x)} abscissae and {len(y)} ordinates")
        name = curve.text("description") or f"curve {number}"
        yield FileColumn(f"{title}: {name}: {along}", graph.unit("x_unit"), (x,))
        yield FileColumn(f"{title}: {name}", graph.unit("y_unit"), (y,))


def _spectra(spectra: _Object) -> Iterator[FileColumn]:
    """Give abscissae and ordinates of point spectra, one curve a point."""
    lines = spectra.objects("data", "GwyDataLine")
    if not lines:
        return
    title = spectra.text("title") or "spectra"
    x, y = [], []
    for line in lines:
        values, extent = line.numbers("data"), float(line.parts.get("real", 1.0))
        if len(values) != line.parts.get("res"):
            raise ValueError(f"a spectrum has {len(values)} numbers, and its header tells {line.parts.get('res')}")
        x.append(float(line.parts.get("off", 0.0)) + extent * (np.arange(len(values)) + 0.5) / len(values))
        y.append(values)
    units = {name: {line.unit(name) for line in lines} for name in ("si_unit_x", "si_unit_y")}
    if any(len(found) > 1 for found in units.values()):
        raise ValueError(f"spectra of one set have several units: {units}")
    along = spectra.text("spec_xlabel") or "x"
    yield FileColumn(f"{title}: {along}", lines[0].unit("si_unit_x"), tuple(x))
    yield FileColumn(f"{title}: {spectra.text('spec_ylabel') or 'y'}", lines[0].unit("si_unit_y"), tuple(y))
