r"""Force curves of Bruker's NanoScope (.spm, .pfc, .001): a header of lines that begin with ``\``, then integers."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from saltus.afm.files.columns import FileColumn, FileContents, Lines, bounded, numbers_of, parsed
from saltus.errors import InputError

__all__ = ["read_nanoscope"]

_KIND = "a file of Bruker's NanoScope with force curves"
_STARTS = (b"\\*Force file list", b"\\*File list")
_END = b"\\*File list end"
_HEADER = 2**22  # bytes of a header, at most
_CHANNEL = "Ciao force image list"  # sections of channels with curves
_VALUE = re.compile(
    r"V (?:\[(?P<soft>[^\]]*)\] *)?(?:\((?P<scale>[-+.\deE]+) [^)]*/LSB\) *)?(?P<value>[-+.\deE]+) *(?P<unit>\S*)"
)  # of an entry: soft scale, hard scale, hard value
_NAME = re.compile(r'S \[[^\]]*\] "(?P<name>[^"]*)"')  # of a selection: the name that is shown
_SECTIONS = ("Equipment list", "Scanner list", "Ciao scan list", "Ciao force list", _CHANNEL)
_TOLD = re.compile(
    r"sens|spring|frequen|freq\b|drive|amplitude|setpoint|ramp|tip|scan rate|velocity|q factor|version|date",
    re.IGNORECASE,
)  # in the names of entries that are kept
_CALIBRATION = {
    "k_N_m": ("Spring Constant", "N/m", "N/m"),
    "R_nm": ("Tip Radius", "nm", "nm"),
    "invols_nm_V": ("Sens. DeflSens", "nm/V", "nm/V"),
    "amplitude_invols_nm_V": ("Sens. Amplitude", "nm/V", "nm/V"),
    "f_kHz": ("Drive Frequency", "Hz", "kHz"),
}  # by the entry, its unit, the unit wanted


class _Section(NamedTuple):
    title: str
    entries: dict[str, str]


def read_nanoscope(path: Path) -> FileContents:
    """Return the force curves of a file of Bruker: one column a channel and way, and ``ramp``, which the piezo goes."""
    found: FileContents = parsed(path, _KIND, lambda name: _read(Path(name)))
    if not found.columns:
        hint = "it has images only; saltus reads curves"
        raise InputError("path", str(path), _KIND, hint)
    return found


def _read(path: Path) -> FileContents:
    size = path.stat().st_size
    with open(path, "rb") as file:
        head = file.read(min(size, _HEADER))
    if not head.startswith(_STARTS):
        raise ValueError("it does not begin with a list of NanoScope")
    text, mark, _ = head.partition(_END)
    if not mark:
        raise ValueError("its header has no end")
    sections = _sections(text.decode("latin-1"))
    everywhere = {key: value for section in sections for key, value in section.entries.items()}
    channels = [section.entries for section in sections if section.title == _CHANNEL]
    columns: list[FileColumn] = []
    for entries in channels:
        if (new := _columns(path, size, everywhere, entries)) is not None:
            columns += [one for one in new if one.name not in [column.name for column in columns]]
    constants = {
        key: bounded(value)
        for section in sections
        if section.title in _SECTIONS
        for key, value in section.entries.items()
        if _TOLD.search(key)
    }
    return FileContents("force curves of Bruker's NanoScope", tuple(columns), constants, _calibration(everywhere))


def _calibration(everywhere: Mapping[str, str]) -> dict[str, float]:
    """Return the constants of probe and detector, without the scales before their hard values."""
    plain = {}
    for key, text in everywhere.items():
        value = _VALUE.match(text)
        plain[key] = f"{value['value']} {value['unit']}" if value else text
    return numbers_of(plain, _CALIBRATION)


def _sections(text: str) -> list[_Section]:
    """Return the sections of a header with their entries; groups, as ``@4:``, are left out of the names."""
    found: list[_Section] = []
    for line in text.splitlines():
        if line.startswith("\\*"):
            found.append(_Section(line[2:].strip(), {}))
        elif line.startswith("\\") and found:
            key, mark, value = re.sub(r"^\\(@(\d+:)?)?", "", line).partition(":")
            if mark:
                found[-1].entries[key.strip()] = value.strip()
    return found


def _columns(
    path: Path, size: int, everywhere: Mapping[str, str], entries: Mapping[str, str]
) -> list[FileColumn] | None:
    """Return the columns of a channel: both ways, and what the piezo goes; None for one without numbers."""
    name = _NAME.match(entries.get("Image Data", ""))
    if name is None:
        return None
    begin, length = int(entries["Data offset"]), int(entries["Data length"])
    counts = [int(one) for one in entries["Samps/line"].split()]
    counts = counts * 2 if len(counts) == 1 else counts
    depth = int(entries.get("Bytes/pixel", "2"))
    if depth not in (2, 4) or len(counts) != 2 or min(counts) < 0 or min(begin, length) <= 0:
        raise ValueError(f"channel {name['name']} has {depth} bytes a number, {length} in all, curves of {counts}")
    if begin + length > size:
        raise ValueError(f"channel {name['name']} ends at byte {begin + length}, and the file has {size}")
    together = sum(counts)
    if not together or length % (depth * together):
        raise ValueError(f"{length} bytes are no curves of {together} numbers of {depth} bytes")
    curves = length // (depth * together)
    factor, unit = _scale(everywhere, entries, depth)

    def numbers(first: int, count: int) -> Lines:
        def line(at: int) -> NDArray[np.float64]:
            place = begin + depth * (at * together + first)
            stored = np.fromfile(path, dtype=f"<i{depth}", count=count, offset=place)
            return stored * factor

        return Lines([count] * curves, line)

    ways = {"approach": (0, counts[0]), "retract": (counts[0], counts[1])}
    ways = {way: place for way, place in ways.items() if place[1]}
    found = [FileColumn(f"{way}: {name['name']}", unit, numbers(*place)) for way, place in ways.items()]
    ramp = _value(everywhere, entries.get("Ramp size", everywhere.get("Ramp size", "")))
    if ramp is not None and path.suffix.lower() != ".pfc":
        for way, (_, count) in ways.items():
            step = ramp[0] / count
            going = Lines([count] * curves, lambda _, step=step, count=count: step * np.arange(count))  # type: ignore[misc]
            found.append(FileColumn(f"{way}: ramp", ramp[1], going))
    return found


def _value(everywhere: Mapping[str, str], text: str) -> tuple[float, str] | None:
    """Return a value with its unit after its soft scale."""
    value = _VALUE.match(text)
    if value is None:
        return None
    factor, unit = _soft(everywhere, value["soft"])
    number = float(value["value"]) * factor
    return (number, unit if unit is not None else value["unit"]) if math.isfinite(number) else None


def _soft(everywhere: Mapping[str, str], name: str | None) -> tuple[float, str | None]:
    """Return the number and the unit of a soft scale, as 40 and nm of 40 nm/V; (1, None) where there is none."""
    if not name:
        return 1.0, None
    found = _VALUE.match(everywhere.get(name, ""))
    if found is None:
        raise ValueError(f"the scale {name} is missing")
    unit = found["unit"].split("/")[0].replace("~", "µ").replace("º", "°")
    return float(found["value"]), unit or None


def _scale(everywhere: Mapping[str, str], entries: Mapping[str, str], depth: int) -> tuple[float, str | None]:
    """Return the factor and the unit of a channel's integers; (1, None) where their size is not told.

    A number is the integer times the hard scale in brackets, times the soft scale. Of integers of 32 bits the bracket
    may still tell the scale of 16 bits: it is taken if it agrees with the hard value over the whole range.
    """
    value = _VALUE.match(entries.get("Z scale", ""))
    if value is None or value["scale"] is None:
        return 1.0, None
    hard, whole = float(value["scale"]), float(value["value"])
    if depth == 4:
        if not any(math.isclose(hard * 2.0**bits, whole, rel_tol=1e-4) for bits in (16, 32)):
            return 1.0, None
        hard = whole / 2.0**32
    factor, unit = _soft(everywhere, value["soft"])
    if not math.isfinite(hard * factor) or hard * factor == 0.0:
        raise ValueError(f"the scale of a channel is {hard * factor}")
    return hard * factor, unit if unit is not None else value["unit"].replace("º", "°") or None
