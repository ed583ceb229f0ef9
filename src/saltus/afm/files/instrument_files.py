"""Files that instruments write: Igor binary waves, and the files of Nanosurf, as columns with names and units."""

from __future__ import annotations

import io
import logging
import math
import re
import struct
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from saltus.errors import InputError

__all__ = ["READERS", "FileColumn"]

_INSTALL = "pip install 'saltus[files]'"
_ONE_DIMENSION = (1, 2, 3)  # versions of Igor's format whose waves have one dimension
_IGOR_SIZES = {1: (8, "2x i"), 2: (16, "2x 2i"), 3: (20, "2x 3i"), 5: (64, "4x 13i")}
# by version: bytes of an Igor file's first header, and in it the sizes of what follows
_IGOR_COUNTS = {1: (42, "i"), 2: (42, "i"), 3: (42, "i"), 5: (12, "i 52x 4i")}
# by version: place in the second header, and there how many numbers the wave has, and along each dimension
_END_OF_HEADER = b"\r\n#!"  # what a .nid file has between its header and its numbers
_NHF_VERSION = 2  # version of the .nhf format that is read
_NHF_TYPES = {
    "int16": (-(2.0**15) + 1.0, 2.0**15 - 1.0),
    "int32": (-(2.0**31) + 1.0, 2.0**31 - 1.0),
    "int64": (-(2.0**63) + 1.0, 2.0**63 - 1.0),
    "uint8": (0.0, 2.0**8 - 2.0),
    "uint16": (0.0, 2.0**16 - 2.0),
    "uint32": (0.0, 2.0**32 - 2.0),
    "uint64": (0.0, 2.0**64 - 2.0),
    "double": (0.0, 1.0),
}  # stored numbers that stand for the least and the greatest value, by the type of a .nhf file's elements
_FRAMES = (
    "Spec forward",
    "Spec backward",
    "Spec fwd pause",
    "Spec bwd pause",
    "Frequency sweep",
    "Frequency sweep SHO",
    "Spectrum FFT",
    "Spectrum Fit",
)  # frames of a .nid file that are curves; all others are images


class FileColumn(NamedTuple):
    """A column of a file."""

    name: str  # its name in the file
    unit: str | None  # its unit as the file has it; None where the file has none
    lines: tuple[NDArray[Any], ...]  # its numbers, one array a curve; of a text file its cells


def _igor_columns(path: Path) -> list[FileColumn]:
    """Return the columns of an Igor binary wave: one a column of the wave, and its scaled rows as ``x``."""
    try:
        from igor2 import binarywave
    except ImportError as missing:
        raise InputError("path", str(path), "read where igor2 is installed", _INSTALL) from missing
    logging.getLogger("igor2").addHandler(logging.NullHandler())  # what it tells of a broken file is in its exception

    def read(name: str) -> Any:
        content = Path(name).read_bytes()
        _check_igor_sizes(content)
        return binarywave.setup_wave().unpack_stream(io.BytesIO(content))  # `load` keeps what a broken file has set

    loaded = _parsed(path, "an Igor binary wave (.ibw)", read)
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
    return [x, *(FileColumn(name, unit or None, (column,)) for name, column in zip(names, table.T, strict=True))]


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


def _nid_columns(path: Path) -> list[FileColumn]:
    """Return the curves of a Nanosurf .nid file: one column a channel of a frame, and ``Dim0``, along which they go."""
    columns: list[FileColumn] = _parsed(path, "a .nid file of Nanosurf", lambda name: list(_nid_frames(Path(name))))
    if not columns:
        raise InputError("path", str(path), f"a file with curves: {', '.join(_FRAMES)}")
    return columns


def _nid_frames(path: Path) -> Iterator[FileColumn]:
    text, mark, content = path.read_bytes().partition(_END_OF_HEADER)
    if not mark:
        raise ValueError("its header has no end")
    sets = _nid_sets(_nid_header(text))
    sizes = [int(one["Points"]) * int(one["Lines"]) * int(one["SaveBits"]) // 8 for one in sets]
    if sum(sizes) != len(content):
        raise ValueError(f"its header describes {sum(sizes)} bytes of numbers, and the file has {len(content)}")
    told: list[str] = []
    for one, size, end in zip(sets, sizes, np.cumsum(sizes).tolist(), strict=True):
        if one["Frame"] not in _FRAMES:
            continue
        along, name = f"{one['Frame']}: Dim0", f"{one['Frame']}: {one['Dim2Name']}"
        if along not in told:
            told.append(along)
            yield FileColumn(along, one.get("Dim0Unit"), _nid_along(one))
        told.append(name)
        name = name if told.count(name) == 1 else f"{name} ({told.count(name)})"
        yield FileColumn(name, one.get("Dim2Unit"), _nid_numbers(one, content[end - size : end]))


def _nid_header(text: bytes) -> dict[str, dict[str, str]]:
    """Return the sections of a .nid file's header with their entries."""
    try:
        lines = text.decode("utf-8").splitlines()
    except UnicodeDecodeError:
        lines = text.decode("latin-1").splitlines()
    sections: dict[str, dict[str, str]] = {}
    entries: dict[str, str] = {}
    for line in lines:
        if line.startswith("[") and line.endswith("]"):
            entries = sections.setdefault(line[1:-1], {})
        else:
            key, _, value = line.partition("=")
            entries[key] = value.strip()
    return sections


def _nid_sets(header: Mapping[str, Mapping[str, str]]) -> list[Mapping[str, str]]:
    """Return the entries of a .nid file's channels, in the order of their numbers."""
    top = header["DataSet"]
    keys = [
        f"Gr{group}-Ch{channel}"
        for group in range(int(top["GroupCount"]))
        for channel in range(int(top[f"Gr{group}-Count"]))
    ]
    return [header[top[key]] for key in keys if key in top]


def _nid_counts(one: Mapping[str, str]) -> list[int]:
    """Return how many points each curve of a channel has: fewer than there is room for where it ended early."""
    room = int(one["Points"])
    counts = [int(one.get(f"LineDim{i}Points", room)) for i in range(int(one["Lines"]))]
    if any(not 0 <= count <= room for count in counts):
        raise ValueError(f"a curve of {max(counts)} points has room for {room}")
    return counts


def _nid_along(one: Mapping[str, str]) -> tuple[NDArray[np.float64], ...]:
    """Return what the curves of a channel go along: from the least value over the range, both ends included."""
    names = [f"LineDim{i}" if f"LineDim{i}Min" in one else "Dim0" for i in range(int(one["Lines"]))]
    return tuple(
        float(one[f"{name}Min"]) + float(one[f"{name}Range"]) * np.linspace(0.0, 1.0, count)
        for name, count in zip(names, _nid_counts(one), strict=True)
    )


def _nid_numbers(one: Mapping[str, str], content: bytes) -> tuple[NDArray[np.float64], ...]:
    """Return the curves of a channel: integers whose whole range is the channel's."""
    form = one["SaveMode"], one["SaveSign"], one["SaveOrder"]
    if form != ("Binary", "Signed", "Intel"):
        raise ValueError(f"numbers are saved as {' '.join(form)}, not as Binary Signed Intel")
    bits = int(one["SaveBits"])
    stored = np.frombuffer(content, dtype=f"<i{bits // 8}").reshape(int(one["Lines"]), int(one["Points"]))
    values = (stored.astype(float) + 2.0 ** (bits - 1)) / 2.0**bits * float(one["Dim2Range"]) + float(one["Dim2Min"])
    return tuple(line[:count] for line, count in zip(values, _nid_counts(one), strict=True))


def _nhf_columns(path: Path) -> list[FileColumn]:
    """Return the curves of a Nanosurf .nhf file, which is HDF5: one column a channel of a segment."""
    import h5py

    def read(stream: Any) -> list[FileColumn]:
        found: list[FileColumn] = []
        with h5py.File(stream, "r") as file:
            if int(file.attrs["nsf_file_version_major"]) != _NHF_VERSION:
                raise ValueError(f"its format has version {file.attrs['nsf_file_version_major']}, not {_NHF_VERSION}")
            groups: list[Any] = []
            file.visititems(lambda _, item: groups.append(item) if isinstance(item, h5py.Group) else None)
            for group in groups:
                title = group.attrs.get("segment_name", group.name.strip("/"))
                channels = [item for item in group.values() if isinstance(item, h5py.Dataset)]
                found += [_nhf_column(f"{title}: ", group, one) for one in channels if "signal_name" in one.attrs]
        return found

    columns: list[FileColumn] = _parsed(path, "a .nhf file of Nanosurf", read)
    if not columns:
        raise InputError("path", str(path), "a file with calibrated channels of spectroscopy")
    return columns


def _nhf_column(start: str, group: Any, dataset: Any) -> FileColumn:
    """Return a channel in its calibrated unit: its type's range of stored numbers is the calibration's range."""
    attributes = dataset.attrs
    least, most = _NHF_TYPES[attributes["dataset_element_type"]]
    low, high = (float(attributes[f"signal_calibration_{end}"]) for end in ("min", "max"))
    stored = np.asarray(dataset)
    values = (stored.astype(float).ravel() - least) * ((high - low) / (most - least)) + low
    values[stored.ravel() == dataset.fillvalue] = np.nan
    unit = str(attributes["signal_calibration_unit"])
    inner = re.search(r"\(([^)]+)\)", unit)
    source = attributes.get("dataset_block_size_source")
    lines = [values]
    if source is not None:
        sizes = [one for one in group.values() if one.attrs.get("dataset_block_size_id") == source]
        ends = np.cumsum(np.asarray(sizes[0]).ravel().astype(int))
        if ends[-1] != values.size:
            raise ValueError(f"{attributes['signal_name']} has {values.size} numbers, and its blocks {ends[-1]}")
        lines = np.split(values, ends[:-1])
    return FileColumn(f"{start}{attributes['signal_name']}", (inner[1] if inner else unit) or None, tuple(lines))


def _parsed(path: Path, kind: str, read: Callable[[Any], Any]) -> Any:
    """Return what a library reads from a file; raise `InputError` where it cannot, for whatever reason."""
    try:
        with open(path, "rb"):
            pass
    except OSError as error:
        raise InputError("path", str(path), f"{kind} that can be read", error.strerror or str(error)) from error
    try:
        return read(str(path))
    except Exception as error:  # the libraries raise what comes, from AssertionError to struct.error
        first = next(iter(str(error).splitlines()), "")
        hint = f"it is another file, or a part is missing ({type(error).__name__}: {first})"
        raise InputError("path", str(path), kind, hint) from error


def _text(value: Any) -> str:
    """Return a text of an Igor binary wave, given as bytes or as an array of characters."""
    raw = value if isinstance(value, bytes) else np.asarray(value).tobytes()
    text = raw.split(b"\x00", 1)[0]
    try:
        return text.decode("utf-8").strip()
    except UnicodeDecodeError:
        return text.decode("latin-1").strip()


READERS: dict[str, Callable[[Path], list[FileColumn]]] = {
    ".ibw": _igor_columns,
    ".nid": _nid_columns,
    ".nhf": _nhf_columns,
}
