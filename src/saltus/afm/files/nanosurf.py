"""Files of Nanosurf: .nid, an INI header with integers behind it, and .nhf, which is HDF5."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from saltus.afm.files.columns import FileColumn, FileContents, bounded, numbers_of, parsed, whole
from saltus.afm.files.hdf5 import check_room, opened
from saltus.errors import InputError
from saltus.extras import check_installed

__all__ = ["read_nhf", "read_nid"]

_LEVER = r"DataSet\Calibration\Cantilever"  # section of the lever's constants
_CALIBRATION = {
    "k_N_m": ("Spring Constant", "N/m", "N/m"),
    "f0_kHz": ("Frequency", "Hz", "kHz"),
    "Q": ("Q Factor", "", ""),
}  # of a thermal tune: by the entry, its unit, the unit wanted
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


def read_nid(path: Path) -> FileContents:
    """Return the curves of a Nanosurf .nid file: one column a channel of a frame, and ``Dim0``, along which they go."""
    found: FileContents = parsed(path, "a .nid file of Nanosurf", lambda name: _nid(Path(name)))
    if not found.columns:
        raise InputError("path", str(path), f"a file with curves: {', '.join(_FRAMES)}")
    return found


def _nid(path: Path) -> FileContents:
    text, mark, content = whole(path).partition(_END_OF_HEADER)
    if not mark:
        raise ValueError("its header has no end")
    header = _nid_header(text)
    constants = {
        key.rstrip(": "): bounded(value)
        for section in (_LEVER, "DataSet-Info")
        for key, value in header.get(section, {}).items()
        if value
    }
    columns = tuple(_nid_frames(_nid_sets(header), content))
    return FileContents("a .nid file of Nanosurf", columns, constants, numbers_of(constants, _CALIBRATION))


def _nid_frames(sets: list[Mapping[str, str]], content: bytes) -> Iterator[FileColumn]:
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


def read_nhf(path: Path) -> FileContents:
    """Return the curves of a Nanosurf .nhf file, which is HDF5: one column a channel of a segment."""
    check_installed("h5py")
    import h5py

    def read(stream: Any) -> list[FileColumn]:
        found: list[FileColumn] = []
        with opened(stream) as file:
            if int(file.attrs["nsf_file_version_major"]) != _NHF_VERSION:
                raise ValueError(f"its format has version {file.attrs['nsf_file_version_major']}, not {_NHF_VERSION}")
            groups: list[Any] = []
            file.visititems(lambda _, item: groups.append(item) if isinstance(item, h5py.Group) else None)
            for group in groups:
                title = group.attrs.get("segment_name", group.name.strip("/"))
                channels = [item for item in group.values() if isinstance(item, h5py.Dataset)]
                found += [_nhf_column(f"{title}: ", group, one) for one in channels if "signal_name" in one.attrs]
        return found

    columns: list[FileColumn] = parsed(path, "a .nhf file of Nanosurf", read)
    if not columns:
        raise InputError("path", str(path), "a file with calibrated channels of spectroscopy")
    return FileContents("a .nhf file of Nanosurf", tuple(columns))


def _nhf_column(start: str, group: Any, dataset: Any) -> FileColumn:
    """Return a channel in its calibrated unit: its type's range of stored numbers is the calibration's range."""
    attributes = dataset.attrs
    least, most = _NHF_TYPES[attributes["dataset_element_type"]]
    low, high = (float(attributes[f"signal_calibration_{end}"]) for end in ("min", "max"))
    check_room(dataset)
    stored = np.asarray(dataset)
    values = (stored.astype(float).ravel() - least) * ((high - low) / (most - least)) + low
    values[stored.ravel() == dataset.fillvalue] = np.nan
    unit = str(attributes["signal_calibration_unit"])
    inner = re.search(r"\(([^)]+)\)", unit)
    source = attributes.get("dataset_block_size_source")
    lines = [values]
    if source is not None:
        sizes = [one for one in group.values() if one.attrs.get("dataset_block_size_id") == source]
        check_room(sizes[0])
        ends = np.cumsum(np.asarray(sizes[0]).ravel().astype(int))
        if ends[-1] != values.size:
            raise ValueError(f"{attributes['signal_name']} has {values.size} numbers, and its blocks {ends[-1]}")
        lines = np.split(values, ends[:-1])
    return FileColumn(f"{start}{attributes['signal_name']}", (inner[1] if inner else unit) or None, tuple(lines))
