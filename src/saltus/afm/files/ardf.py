"""Force curves of Asylum Research's .ARDF files: elements with sums, tables of contents, curves behind each other."""

from __future__ import annotations

import mmap
import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from saltus.afm.files.asylum_notes import calibration_of, entries_of, told_of
from saltus.afm.files.columns import FileColumn, FileContents, Lines, parsed
from saltus.errors import InputError

__all__ = ["read_ardf"]

_KIND = "a file of Asylum Research (.ARDF) with force curves"
_HEAD = 16  # bytes of an element's header: sum, size, kind, a number
_TABLE = 32  # bytes of the header of a table of contents
_DATA = 56  # bytes of a curve's header, before its numbers
_NOTE = 2**24  # bytes of a note, at most
_CURVE = (b"VSET", b"VNAM", b"VDAT", b"XDAT")  # kinds of elements that a curve has


class _Element(NamedTuple):
    kind: bytes
    begin: int
    end: int


class _Place(NamedTuple):
    """Where the numbers of a channel of a curve are, and where its ways begin and end."""

    at: int
    size: int
    ways: tuple[int, int, int]


def read_ardf(path: Path) -> FileContents:
    """Return the force curves of an .ARDF file: one column a channel, and one for each way where the ways are told."""
    found: FileContents = parsed(path, _KIND, lambda name: _read(Path(name)))
    if not found.columns:
        raise InputError("path", str(path), _KIND, "it has images only; saltus reads curves")
    return found


@contextmanager
def _mapped(path: Path) -> Iterator[mmap.mmap]:
    with open(path, "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
        yield content


def _read(path: Path) -> FileContents:
    with _mapped(path) as content:
        if _element(content, 0, b"ARDF").end > len(content):
            raise ValueError("its first element is cut off")
        files, at = _table(content, _HEAD, b"FTOC")
        texts, _ = _table(content, at, b"TTOC")
        note = b"".join(_note(content, place) for kind, place in texts if kind == b"TOFF")
        columns: list[FileColumn] = []
        for kind, place in files:
            if kind == b"VOLM":
                columns += _volume(content, path, place, [column.name for column in columns])
    entries = entries_of(note)
    return FileContents("force curves of Asylum Research", tuple(columns), told_of(entries), calibration_of(entries))


def _element(content: mmap.mmap, at: int, kind: bytes = b"", *, summed: bool = True) -> _Element:
    """Return the element at a place; raise `ValueError` where its size, kind or sum is wrong."""
    if at < 0 or at + _HEAD > len(content):
        raise ValueError(f"an element is expected at byte {at}, and the file has {len(content)}")
    told, size, found, _ = struct.unpack_from("<II4sI", content, at)
    if size < _HEAD or at + size > len(content):
        raise ValueError(f"the element at byte {at} has {size} bytes, and the file {len(content)}")
    if kind and found != kind:
        raise ValueError(f"at byte {at} is {found!r}, not {kind!r}")
    if summed and zlib.crc32(content[at + 4 : at + size]) != told:
        raise ValueError(f"the sum of the element at byte {at} is wrong")
    return _Element(found, at, at + size)


def _table(content: mmap.mmap, at: int, kind: bytes) -> tuple[list[tuple[bytes, int]], int]:
    """Return the entries of a table of contents, as kind and place, and where the table ends."""
    if _element(content, at, kind).end < at + _TABLE:
        raise ValueError(f"the table at byte {at} is too short")
    count, size = struct.unpack_from("<II", content, at + 24)
    begin, end = at + _TABLE, at + _TABLE + count * size
    if size < 24 or end > len(content):
        raise ValueError(f"the table at byte {at} has {count} entries of {size} bytes, and the file {len(content)}")
    found = []
    for place in range(begin, end, size):
        if struct.unpack_from("<II", content, place) == (0, 0):  # an entry that is not used
            continue
        entry = _element(content, place)
        if entry.end != place + size:
            raise ValueError(f"the entry at byte {place} has another size than its table's")
        found.append((entry.kind, struct.unpack_from("<Q", content, entry.end - 8)[0]))
    return found, end


def _note(content: mmap.mmap, at: int) -> bytes:
    """Return the text of a note."""
    element = _element(content, at, b"TEXT")
    (size,) = struct.unpack_from("<I", content, at + 20)
    if size > min(_NOTE, element.end - at - 24):
        raise ValueError(f"the note at byte {at} has {size} bytes and room for {element.end - at - 24}")
    return content[at + 24 : at + 24 + size] + b"\r"


def _volume(content: mmap.mmap, path: Path, at: int, known: list[str]) -> list[FileColumn]:
    """Return the columns of a set of curves."""
    _, at = _table(content, at, b"VOLM")
    _, at = _table(content, at, b"TTOC")
    channels: list[tuple[str, str]] = []
    while (element := _element(content, at)).kind != b"VTOC":
        if element.kind == b"VCHN":
            names = struct.unpack_from("<32s32s", content[at : element.end], _HEAD)
            name, unit = (text.split(b"\0", 1)[0].decode("latin-1").strip() for text in names)
            channels.append((name, unit))
        at = element.end
    lines, _ = _table(content, at, b"VTOC")
    found: list[list[_Place]] = [[] for _ in channels]
    seen: set[int] = set()
    for kind, place in lines:
        if kind == b"VOFF" and place:
            _follow(content, place, found, seen)
    columns = []
    for (name, unit), places in zip(channels, found, strict=True):
        if places:
            columns += _columns(path, name if name not in known else f"{name} ({known.count(name) + 1})", unit, places)
    return columns


def _follow(content: mmap.mmap, at: int, found: list[list[_Place]], seen: set[int]) -> None:
    """Add the curves of a line: sets of elements behind each other."""
    line: int | None = None
    while at not in seen and at + _HEAD <= len(content):
        element = _element(content, at, summed=False)
        if element.kind not in _CURVE:
            break
        seen.add(at)
        if element.kind == b"VSET":
            _element(content, at)
            number = struct.unpack_from("<I", content, at + 20)[0]
            if line not in (None, number):
                break
            line = number
        if element.kind == b"VDAT":
            if element.end < at + _DATA:
                raise ValueError(f"the curve at byte {at} is too short")
            _, _, _, count, channel, *ways = struct.unpack_from("<8I", content, at + _HEAD)
            if channel >= len(found) or at + _DATA + 4 * count > element.end:
                raise ValueError(f"the curve at byte {at} has {count} numbers of channel {channel}")
            found[channel].append(_Place(at, count, (ways[0], ways[1], ways[2])))
        at = element.end


def _columns(path: Path, name: str, unit: str, places: list[_Place]) -> list[FileColumn]:
    """Return the column of a channel, and those of its ways."""

    def lines(parts: list[slice]) -> Lines:
        def line(at: int) -> NDArray[np.float64]:
            read: NDArray[np.float64] = parsed(path, _KIND, lambda _: _numbers(path, places[at]))
            return read[parts[at]]

        sizes = [len(range(*part.indices(place.size))) for part, place in zip(parts, places, strict=True)]
        return Lines(sizes, line)

    columns = [FileColumn(name, unit or None, lines([slice(None)] * len(places)))]
    if all(begin < turn < end == place.size - 1 for place in places for begin, turn, end in [place.ways]):
        there = [slice(place.ways[0], place.ways[1]) for place in places]
        back = [slice(place.ways[1], None) for place in places]
        columns += [FileColumn(f"approach: {name}", unit or None, lines(there))]
        columns += [FileColumn(f"retract: {name}", unit or None, lines(back))]
    return columns


def _numbers(path: Path, place: _Place) -> NDArray[np.float64]:
    """Return the numbers of a curve, checked by their sum."""
    with _mapped(path) as content:
        _element(content, place.at, b"VDAT")
        begin = place.at + _DATA
        return np.frombuffer(content[begin : begin + 4 * place.size], "<f4").astype(float)
