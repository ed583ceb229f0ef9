"""Files that instruments write: Igor binary waves, and the files of Nanosurf, as columns with names and units."""

from __future__ import annotations

import logging
import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from saltus.errors import InputError

__all__ = ["READERS", "FileColumn"]

_INSTALL = "pip install 'saltus[files]'"
_ONE_DIMENSION = (1, 2, 3)  # versions of Igor's format whose waves have one dimension
_END_OF_HEADER = b"#!"  # what a .nid file has between its header and its numbers
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
_FRAMES = {
    "Spec forward": ("Spec", "Forward"),
    "Spec backward": ("Spec", "Backward"),
    "Spec fwd pause": ("Spec", "Pause Forward"),
    "Spec bwd pause": ("Spec", "Pause Backward"),
    "Frequency sweep": ("Sweep", "Sweep"),
    "Frequency sweep SHO": ("Sweep", "SHO"),
    "Spectrum FFT": ("Sweep", "FFT"),
    "Spectrum Fit": ("Sweep", "Fit"),
}  # frames of a .nid file that are curves, and where NSFopen puts them


class FileColumn(NamedTuple):
    """A column of a file.

    Attributes
    ----------
    name : str
        Its name in the file.
    unit : str or None
        Its unit as the file has it; None where the file has none.
    lines : tuple of ndarray
        Its numbers, one array a curve.
    """

    name: str
    unit: str | None
    lines: tuple[NDArray[np.float64], ...]


def _igor_columns(path: Path) -> list[FileColumn]:
    """Return the columns of an Igor binary wave: one a column of the wave, and its scaled rows as ``x``."""
    try:
        from igor2 import binarywave
    except ImportError as missing:
        raise InputError("path", str(path), "read where igor2 is installed", _INSTALL) from missing
    logging.getLogger("igor2").addHandler(logging.NullHandler())  # what it tells of a broken file is in its exception
    loaded = _parsed(path, "an Igor binary wave (.ibw)", binarywave.load)
    wave, flat = loaded["wave"], loaded["version"] in _ONE_DIMENSION
    values, header = np.asarray(wave["wData"]), wave["wave_header"]
    if values.dtype.kind not in "fiu" or not 1 <= values.ndim <= 2:
        told = f"{values.ndim} dimensions of {'numbers' if values.dtype.kind in 'fiu' else values.dtype.name}"
        raise InputError("path", str(path), "a wave of real numbers in one column or several", f"it has {told}")
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


def _nid_columns(path: Path) -> list[FileColumn]:
    """Return the curves of a Nanosurf .nid file: one column a channel of a frame, and ``Dim0``, along which they go."""
    try:
        from NSFopen.read import nid_read
    except ImportError as missing:
        raise InputError("path", str(path), "read where NSFopen is installed", _INSTALL) from missing
    kind = "a .nid file of Nanosurf"
    found = _parsed(path, kind, lambda stream: nid_read(stream, dataframe=False))
    columns: list[FileColumn] = _parsed(
        path, kind, lambda _: list(_nid_frames(found.param["HeaderDump"], found.data, path))
    )
    if not columns:
        raise InputError("path", str(path), f"a file with curves: {', '.join(_FRAMES)}")
    return columns


def _nid_frames(header: Mapping[str, Mapping[str, str]], data: Any, path: Path) -> Iterator[FileColumn]:
    _check_nid_numbers(header, path)
    told = set[str]()
    for one in _nid_sets(header):
        frame, channel = one["Frame"], one["Dim2Name"]
        if frame not in _FRAMES:
            continue
        if (along := f"{frame}: Dim0") not in told:
            told.add(along)
            yield FileColumn(along, _utf8(one["Dim0Unit"]) or None, _nid_along(one))
        if f"{frame}: {channel}" in told:
            channel += "2"  # as NSFopen calls it
        if f"{frame}: {channel}" in told:
            raise ValueError(f"{frame} has three channels of the name {one['Dim2Name']}")
        told.add(f"{frame}: {channel}")
        group, part = _FRAMES[frame]
        lines = tuple(np.array(line, dtype=float) for line in data[group][part][channel])
        yield FileColumn(f"{frame}: {_utf8(channel)}", _utf8(one["Dim2Unit"]) or None, lines)


def _nid_along(one: Mapping[str, str]) -> tuple[NDArray[np.float64], ...]:
    """Return what the curves of a channel go along: from the least value over the range, both ends included."""
    count, points = int(one["Lines"]), one["Points"]
    own = "LineDim0Min" in one
    found = []
    for start in [f"LineDim{i}" if own else "Dim0" for i in range(count)]:
        steps = np.linspace(0.0, 1.0, int(one.get(f"{start}Points", points)))
        found.append(float(one[f"{start}Min"]) + float(one[f"{start}Range"]) * steps)
    return tuple(found)


def _nid_sets(header: Mapping[str, Mapping[str, str]]) -> list[Mapping[str, str]]:
    """Return the entries of a .nid file's channels, in the order of their numbers."""
    top = header["DataSet"]
    keys = [
        f"Gr{group}-Ch{channel}"
        for group in range(int(top["GroupCount"]))
        for channel in range(int(top[f"Gr{group}-Count"]))
    ]
    return [header[top[key]] for key in keys if key in top]


def _check_nid_numbers(header: Mapping[str, Mapping[str, str]], path: Path) -> None:
    """Raise where the numbers of a .nid file are not those that its header describes.

    NSFopen takes as many bytes from the end of the file as the header wants, whatever they are.
    """
    sets = _nid_sets(header)
    forms = {(one["SaveMode"], one["SaveBits"], one["SaveSign"], one["SaveOrder"]) for one in sets}
    if forms - {("Binary", bits, "Signed", "Intel") for bits in ("16", "32")} or len(forms) != 1:
        raise ValueError(f"numbers are saved as {sorted(forms)}, not as signed ones of 16 or 32 bits")
    size = sum(int(one["Points"]) * int(one["Lines"]) * int(one["SaveBits"]) // 8 for one in sets)
    content = path.read_bytes()
    start = len(content) - size
    if size <= 0 or start < len(_END_OF_HEADER) or content[:start].find(_END_OF_HEADER) != start - len(_END_OF_HEADER):
        raise ValueError(f"its header describes {size} bytes of numbers, and the file does not have them")


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


def _utf8(text: str) -> str:
    """Return a text of a .nid file, which NSFopen decodes byte by byte, as what the file has."""
    try:
        return text.encode("latin-1").decode("utf-8")
    except UnicodeDecodeError:
        return text


READERS: dict[str, Callable[[Path], list[FileColumn]]] = {
    ".ibw": _igor_columns,
    ".nid": _nid_columns,
    ".nhf": _nhf_columns,
}
