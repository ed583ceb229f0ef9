"""Igor binary waves (.ibw), as Asylum Research writes them: columns, and the constants of the note."""

from __future__ import annotations

import io
import logging
import math
import struct
from pathlib import Path
from typing import Any

import numpy as np

from saltus.afm.files.asylum_notes import calibration_of, entries_of, told_of, ways_of
from saltus.afm.files.columns import FileColumn, FileContents, in_ways, parsed, whole
from saltus.errors import InputError
from saltus.extras import check_installed

__all__ = ["read_wave"]

_ONE_DIMENSION = (1, 2, 3)  # versions of Igor's format whose waves have one dimension
_IGOR_SIZES = {1: (8, "2x i"), 2: (16, "2x 2i"), 3: (20, "2x 3i"), 5: (64, "4x 13i")}
# by version: bytes of an Igor file's first header, and in it the sizes of what follows
_IGOR_COUNTS = {1: (42, "i"), 2: (42, "i"), 3: (42, "i"), 5: (12, "i 52x 4i")}
# by version: place in the second header, and there how many numbers the wave has, and along each dimension


def read_wave(path: Path) -> FileContents:
    """Return the columns of an Igor binary wave: one a column of the wave, and its scaled rows as ``x``."""
    check_installed("igor2")
    from igor2 import binarywave

    logging.getLogger("igor2").addHandler(logging.NullHandler())  # what it tells of a broken file is in its exception

    def read(name: str) -> Any:
        content = whole(name)
        _check_igor_sizes(content)
        return binarywave.setup_wave().unpack_stream(io.BytesIO(content))  # `load` keeps what a broken file has set

    loaded = parsed(path, "an Igor binary wave (.ibw)", read)
    wave, flat = loaded["wave"], loaded["version"] in _ONE_DIMENSION
    values, header = np.asarray(wave["wData"]), wave["wave_header"]
    if values.dtype.kind not in "fiu" or not 1 <= values.ndim <= 2 or not values.size:
        told = f"it has {values.size} elements of type {values.dtype.name} in {values.ndim} dimensions"
        raise InputError("path", str(path), "a wave of real numbers in one column or several", told)
    rows = np.arange(len(values))
    if flat:
        x = FileColumn("x", _text(header["xUnits"]) or None, (header["hsA"] * rows + header["hsB"],))
        unit = _text(header["dataUnits"])
    else:
        size = int(wave["bin_header"]["dimEUnitsSize"][0])  # of a unit that is longer than three characters
        unit_of_x = wave["dimension_units"][:size] if size else header["dimUnits"][0]
        x = FileColumn("x", _text(unit_of_x) or None, (header["sfA"][0] * rows + header["sfB"][0],))
        unit = _text(wave["data_units"]) or _text(header["dataUnits"])
    names = [_text(header["bname"])]
    if values.ndim == 2:
        labels = [_text(label) for label in wave["labels"][1][1:]]
        names = [label or f"column {i}" for i, label in enumerate(labels)]
        names += [f"column {i}" for i in range(len(names), values.shape[1])]
    table = values.reshape(len(values), -1).astype(float)
    columns = [FileColumn(name, unit or None, (column,)) for name, column in zip(names, table.T, strict=True)]
    entries = entries_of(bytes(wave["note"]))
    both = in_ways(columns, ways_of(entries, len(values)))
    return FileContents("an Igor binary wave", (x, *columns, *both), told_of(entries), calibration_of(entries))


def _check_igor_sizes(content: bytes) -> None:
    """Raise `ValueError` where an Igor file's headers describe more than the file has.

    igor2 takes memory for what the headers describe, before it reads.
    """
    order = "<" if content[:1] != b"\0" else ">"
    (version,) = struct.unpack_from(f"{order}h", content)
    if version not in _IGOR_SIZES:
        raise ValueError(f"its format has version {version}, not {', '.join(map(str, _IGOR_SIZES))}")
    begin, form = _IGOR_SIZES[version]
    sizes = struct.unpack_from(f"{order}{form}", content)
    place, form = _IGOR_COUNTS[version]
    count, *dimensions = struct.unpack_from(f"{order}{form}", content, begin + place)
    if min(count, *sizes, *dimensions) < 0:
        raise ValueError(f"its headers have the size {min(count, *sizes, *dimensions)}")
    if begin + sum(sizes) > len(content):
        raise ValueError(f"its headers describe {begin + sum(sizes)} bytes, and the file has {len(content)}")
    along = math.prod(size for size in dimensions if size)
    if dimensions and count and along != count:
        raise ValueError(f"its headers describe {count} numbers, and {along} by its dimensions")


def _text(value: Any) -> str:
    """Return a text of an Igor binary wave, given as bytes or as an array of characters."""
    raw = value if isinstance(value, bytes) else np.asarray(value).tobytes()
    text = raw.split(b"\x00", 1)[0]
    try:
        return text.decode("utf-8").strip()
    except UnicodeDecodeError:
        return text.decode("latin-1").strip()
