"""Curves of HDF5 files: each one-dimensional dataset of numbers is a column, groups with numbers are its curves."""

from __future__ import annotations

import math
import mmap
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from saltus.afm.files.columns import FileColumn, FileContents, Lines, bounded, in_ways, numbers_of, parsed
from saltus.errors import InputError
from saltus.extras import check_installed

__all__ = ["check_room", "opened", "read_hdf5"]

_KIND = "an HDF5 file with curves"
_MOST = 2**28  # bytes of one dataset, at most
# end of the type of a text of any length in a file, behind the size of its descriptor: bytes of 8 bits
_OF_BYTES = bytes([0, 0, 0, 1, 0, 0, 0, 0, 0, 8, 0])
_DESCRIPTORS = (12, 16)  # bytes of a descriptor: a length of 4, an address of 4 or 8, an index of 4
_UNITS = ("unit", "units", "Unit", "Units")  # attributes that tell a dataset's unit
_CALIBRATION = {
    "k_N_m": ("spring constant", "N/m", "N/m"),
    "invols_nm_V": ("sensitivity", "m/V", "nm/V"),
}  # of afmformats, by the entry, its unit, the unit wanted
_WAYS = {0: "approach", 1: "retract"}  # what the column `segment` of afmformats has


@contextmanager
def opened(path: str | Path) -> Iterator[Any]:
    """Give an HDF5 file; whatever h5py raises of a broken one comes as it is, and `ValueError` of too long a text."""
    check_installed("h5py")
    import h5py

    _check_texts(Path(path))
    with h5py.File(path, "r") as file:
        yield file


def _check_texts(path: Path) -> None:
    """Raise `ValueError` where an attribute tells a text longer than its file: HDF5 would make room before it looks.

    HDF5 File Format Specification 3.0, IV.A.2.d (datatype), IV.A.2.b (dataspace) and IV.A.2.m (attribute): behind the
    type, which older messages fill up to 8 bytes, are the dataspace and the descriptors.
    """
    size = path.stat().st_size
    if not size:
        return
    with path.open("rb") as stream, mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as held:
        at = held.find(_OF_BYTES)
        while at >= 0:
            begin = at - 9
            wide = int.from_bytes(held[begin + 4 : begin + 8], "little") if begin >= 0 else 0
            if wide in _DESCRIPTORS and held[begin] & 15 == 9:
                for filled in (0, 4):
                    _check_lengths(held, at + len(_OF_BYTES) + filled, wide)
            at = held.find(_OF_BYTES, at + 1)


def _check_lengths(held: mmap.mmap, at: int, wide: int) -> None:
    """Raise `ValueError` where a dataspace is at a place, and a descriptor behind it tells more bytes than the file."""
    head = held[at : at + 8]
    if len(head) < 8 or head[0] not in (1, 2) or head[1] > 1 or head[2] > 1 or (head[0] == 1 and any(head[3:])):
        return
    first = at + (8 if head[0] == 1 else 4)
    count = int.from_bytes(held[first : first + 8], "little") if head[1] else 1
    begin = first + 8 * head[1] * (1 + head[2])
    for k in range(count if count * wide <= len(held) - begin else 0):
        length = int.from_bytes(held[begin + k * wide : begin + k * wide + 4], "little")
        if length > len(held):
            raise ValueError(f"an attribute tells a text of {length:,} bytes, and the file has {len(held):,}")


def check_room(dataset: Any) -> None:
    """Raise `ValueError` where a dataset tells more numbers than the file has stored, or too many."""
    size = math.prod(dataset.shape) * dataset.dtype.itemsize
    if size > _MOST:
        raise ValueError(f"{dataset.name} has {size:,} bytes, more than {_MOST:,}")
    if dataset.chunks is None:
        stored = min(dataset.id.get_storage_size(), Path(dataset.file.filename).stat().st_size)
        if size > stored:
            raise ValueError(f"{dataset.name} has {size:,} bytes, and the file stores {stored:,}")
        return
    chunk = math.prod(dataset.chunks) * dataset.dtype.itemsize
    wanted = math.prod(-(-n // m) for n, m in zip(dataset.shape, dataset.chunks, strict=True))
    stored = dataset.id.get_num_chunks()
    if chunk > _MOST or stored < wanted:
        raise ValueError(f"{dataset.name} has {wanted:,} chunks of {chunk:,} bytes, and the file stores {stored:,}")


def read_hdf5(path: Path) -> FileContents:
    """Return the curves of an HDF5 file with units and attributes."""
    found: FileContents = parsed(path, _KIND, lambda name: _read(Path(name)))
    if not found.columns:
        raise InputError("path", str(path), _KIND, "it has no dataset of numbers in one dimension")
    return found


def _read(path: Path) -> FileContents:
    places: dict[str, list[tuple[tuple[int, ...], str, int]]] = {}
    units: dict[str, str | None] = {}
    with opened(path) as file:
        import h5py

        constants = _attributes(file)
        groups: list[Any] = []

        def seen(_: str, item: Any) -> None:
            if isinstance(item, h5py.Group):
                groups.append(item)
            elif item.ndim == 1 and item.dtype.kind in "fiu" and item.size:
                check_room(item)
                parts = item.name.strip("/").split("/")
                name = ": ".join(part for part in parts if not part.isdecimal()) or item.name.strip("/")
                numbers = tuple(int(part) for part in parts if part.isdecimal())
                unit = next((_text(item.attrs[key]) for key in _UNITS if key in item.attrs), None)
                if units.setdefault(name, unit) != unit:
                    raise ValueError(f"curves of {name} have the units {units[name]} and {unit}")
                places.setdefault(name, []).append((numbers, item.name, item.size))

        file.visititems(seen)
        for group in sorted(groups, key=lambda one: one.name):
            for key, value in _attributes(group).items():
                constants.setdefault(key, value)
    columns = [_column(path, name, units[name], sorted(found)) for name, found in places.items()]
    calibration = numbers_of(constants, _CALIBRATION) if "imaging mode" in constants else {}
    return FileContents("an HDF5 file", tuple(columns + _in_ways(columns)), constants, calibration)


def _column(path: Path, name: str, unit: str | None, places: list[tuple[tuple[int, ...], str, int]]) -> FileColumn:
    def line(at: int) -> NDArray[np.float64]:
        read: NDArray[np.float64] = parsed(path, _KIND, lambda _: _numbers(path, places[at][1]))
        return read

    return FileColumn(name, unit, Lines([size for _, _, size in places], line))


def _numbers(path: Path, name: str) -> NDArray[np.float64]:
    with opened(path) as file:
        check_room(file[name])
        stored: NDArray[np.float64] = np.asarray(file[name]).astype(float)
        return stored


def _in_ways(columns: list[FileColumn]) -> list[FileColumn]:
    """Return the columns of both ways where a single curve has a column that numbers the ways."""
    ways = next((column for column in columns if column.name == "segment" and len(column.lines) == 1), None)
    if ways is None:
        return []
    numbers = ways.lines[0].astype(int)
    parts = {}
    for number, way in _WAYS.items():
        rows = np.flatnonzero(numbers == number)
        if len(rows) and rows[-1] - rows[0] + 1 == len(rows):
            parts[way] = slice(int(rows[0]), int(rows[-1]) + 1)
    same = [one for one in columns if one is not ways and one.sizes == ways.sizes]
    return in_ways(same, parts)


def _attributes(item: Any) -> dict[str, str]:
    """Return attributes that are texts or single numbers."""
    found = {}
    for key, value in item.attrs.items():
        if np.ndim(value) == 0 and re.match(r"[^\n]{1,60}$", str(key)):
            found[str(key)] = bounded(_text(value))
    return found


def _text(value: Any) -> str:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)
