"""Force curves of JPK (.jpk-force, .jpk-force-map, .jpk-qi-data): an archive of properties and of integers."""

from __future__ import annotations

import re
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from saltus.afm.files.columns import FileColumn, FileContents, Lines, bounded, parsed
from saltus.errors import InputError

__all__ = ["read_jpk"]

_KIND = "a file of JPK with force curves"
_HEADER = 2**20  # bytes of a file of properties, at most
_NUMBERS = 2**28  # bytes of one channel of one curve, at most
_CONVERSIONS = 8  # conversions that follow each other, at most
_TYPES = {
    "signedshort": ">i2",
    "signedshort-limited": ">i2",
    "unsignedshort": ">u2",
    "unsignedshort-limited": ">u2",
    "signedinteger": ">i4",
    "signedinteger-limited": ">i4",
    "unsignedinteger": ">u4",
    "unsignedinteger-limited": ">u4",
    "float": ">f4",
    "float-data": ">f4",
    "double": ">f8",
    "double-data": ">f8",
}  # of stored numbers, by the encoder
_WAYS = {"extend": "approach", "retract": "retract", "pause": "pause", "modulation": "modulation"}
_SEGMENT = re.compile(r"(?P<curve>(?:index/(?P<number>\d+)/)?)segments/(?P<segment>\d+)/segment-header\.properties")
_SHARED = re.compile(r"(?P<head>.*)\.(?P<kind>[a-z-]+)\.\*")
_TOLD = re.compile(
    r"file-format-version|.*\.(instrument|source-software)|.*-header\.(duration|time-stamp|num-points)|"
    r".*-settings\.(setpoint|z-start|z-end|style)|.*(frequency|amplitude|phase)[^.]*(\.value)?|"
    r"channel\..*\.conversion\.\w+\.scaling\.(multiplier|offset)",
    re.IGNORECASE,
)  # entries of the header that are kept


class _Slot(NamedTuple):
    """A channel in one of its units: what each curve has of it."""

    unit: str | None
    places: list[tuple[str, str]]  # of each curve: folder of the segment, channel
    sizes: list[int]


def read_jpk(path: Path) -> FileContents:
    """Return the curves of a file of JPK: a column for each channel of a segment, in each unit that is calibrated."""
    found: FileContents = parsed(path, _KIND, lambda name: _read(Path(name)))
    if not found.columns:
        raise InputError("path", str(path), _KIND, "it has no segment with numbers")
    return found


def _read(path: Path) -> FileContents:
    with zipfile.ZipFile(path) as archive:
        sizes = {one.filename: one.file_size for one in archive.infolist()}
        main = _properties(archive, "header.properties", sizes)
        shared = _properties(archive, "shared-data/header.properties", sizes)
        slots: dict[tuple[str, str], _Slot] = {}
        first: dict[str, str] = {}
        for folder, way in _segments(archive, sizes, shared):
            entries = _segment(archive, folder, sizes, shared)
            first = first or entries
            for channel in entries.get("channels.list", "").split():
                file = entries.get(f"channel.{channel}.data.file.name")
                if file is None:  # its numbers are told, not stored
                    continue
                count = sizes[f"{folder}{file}"] // np.dtype(_type(entries, channel)).itemsize
                for slot in _slots(entries, channel):
                    name = f"{way}: {channel}" + (f" ({slot})" if slot else "")
                    one = slots.setdefault((name, slot), _Slot(_unit(entries, channel, slot), [], []))
                    one.places.append((folder, channel))
                    one.sizes.append(count)
    columns = [_column(path, name, slot, one) for (name, slot), one in slots.items()]
    constants = {key: bounded(value) for key, value in (main | first).items() if value and _TOLD.fullmatch(key)}
    return FileContents("force curves of JPK", tuple(columns), constants, _calibration(first))


def _column(path: Path, name: str, slot: str, one: _Slot) -> FileColumn:
    def line(at: int) -> NDArray[np.float64]:
        folder, channel = one.places[at]
        read: NDArray[np.float64] = parsed(path, _KIND, lambda _: _numbers(path, folder, channel, slot))
        return read

    return FileColumn(name, one.unit, Lines(one.sizes, line))


def _numbers(path: Path, folder: str, channel: str, slot: str) -> NDArray[np.float64]:
    """Return the numbers of a channel of a segment after its conversions."""
    with zipfile.ZipFile(path) as archive:
        sizes = {one.filename: one.file_size for one in archive.infolist()}
        entries = _segment(archive, folder, sizes, _properties(archive, "shared-data/header.properties", sizes))
        kind = np.dtype(_type(entries, channel))
        content = _content(archive, f"{folder}{entries[f'channel.{channel}.data.file.name']}", sizes, _NUMBERS)
    told = entries.get(f"channel.{channel}.data.num-points", entries.get("force-segment-header.num-points"))
    count = len(content) // kind.itemsize
    if len(content) % kind.itemsize or (told is not None and count > int(told)):
        raise ValueError(f"channel {channel} has {len(content)} bytes, and its header tells {told} points")
    values = np.frombuffer(content, dtype=kind).astype(float)
    scalings = [f"{_encoder(entries, channel)}.scaling", *_chain(entries, channel, slot)]
    for scaling in scalings:
        if f"{scaling}.multiplier" not in entries and scaling == scalings[0]:
            continue  # numbers that are stored as they are
        if entries.get(f"{scaling}.type", "linear") != "linear":
            raise ValueError(f"{scaling} is {entries[f'{scaling}.type']}, not linear")
        values = values * float(entries[f"{scaling}.multiplier"]) + float(entries.get(f"{scaling}.offset", "0"))
    return values


def _segments(archive: zipfile.ZipFile, sizes: Mapping[str, int], shared: Mapping[str, str]) -> list[tuple[str, str]]:
    """Return the folder of each segment, curve after curve, and the name of its way."""
    found = [match for name in sizes if (match := _SEGMENT.fullmatch(name))]
    found.sort(key=lambda match: (int(match["number"] or 0), int(match["segment"])))
    names: dict[int, str] = {}
    for match in found:
        segment = int(match["segment"])
        if segment not in names:
            entries = _segment(archive, match[0].removesuffix("segment-header.properties"), sizes, shared)
            style = entries.get("force-segment-header.settings.segment-settings.style", "")
            style = style or entries.get("force-segment-header.settings.style", f"segment {segment}")
            way = _WAYS.get(style, style)
            before = sum(name.split(" #")[0] == way for name in names.values())
            names[segment] = way if not before else f"{way} {before + 1}"
    return [(match[0].removesuffix("segment-header.properties"), names[int(match["segment"])]) for match in found]


def _segment(
    archive: zipfile.ZipFile, folder: str, sizes: Mapping[str, int], shared: Mapping[str, str]
) -> dict[str, str]:
    """Return the properties of a segment with those that it shares with others."""
    entries = _properties(archive, f"{folder}segment-header.properties", sizes)
    for key, number in list(entries.items()):
        if match := _SHARED.fullmatch(key):
            start = f"{match['kind']}.{number}."
            entries |= {
                f"{match['head']}.{name.removeprefix(start)}": value
                for name, value in shared.items()
                if name.startswith(start)
            }
    return entries


def _properties(archive: zipfile.ZipFile, name: str, sizes: Mapping[str, int]) -> dict[str, str]:
    """Return the entries of a file of Java's properties; none where there is no such file."""
    if name not in sizes:
        return {}
    text = _content(archive, name, sizes, _HEADER).decode("latin-1")
    found = {}
    for line in text.splitlines():
        if not line.startswith(("#", "!")) and "=" in line:
            key, _, value = line.partition("=")
            found[key.strip()] = re.sub(r"\\(.)", r"\1", value.strip())
    return found


def _content(archive: zipfile.ZipFile, name: str, sizes: Mapping[str, int], most: int) -> bytes:
    """Return a file of the archive, checked by its sum; raise `ValueError` where it is larger than it may be."""
    if sizes[name] > most:
        raise ValueError(f"{name} has {sizes[name]} bytes, more than {most}")
    with archive.open(name) as stream:
        content = stream.read(sizes[name] + 1)
    if len(content) != sizes[name]:
        raise ValueError(f"{name} has {len(content)} bytes, and the archive tells {sizes[name]}")
    return content


def _encoder(entries: Mapping[str, str], channel: str) -> str:
    old = f"channel.{channel}.data.encoder"
    return old if f"{old}.type" in entries else f"channel.{channel}.encoder"


def _type(entries: Mapping[str, str], channel: str) -> str:
    """Return how the numbers of a channel are stored."""
    for key in (f"{_encoder(entries, channel)}.type", f"channel.{channel}.data.type", f"channel.{channel}.type"):
        if entries.get(key) in _TYPES:
            return _TYPES[entries[key]]
    raise ValueError(f"numbers of channel {channel} are stored as {entries.get(f'channel.{channel}.type')}")


def _slots(entries: Mapping[str, str], channel: str) -> list[str]:
    """Return the units of a channel: the one that is shown, without a name, and all that are calibrated."""
    conversions = f"channel.{channel}.conversion-set.conversions"
    listed = entries.get(f"{conversions}.list", "").split()
    base = entries.get(f"{conversions}.base", "")
    defined = [
        one
        for one in dict.fromkeys([base, *listed])
        if one == base or entries.get(f"channel.{channel}.conversion-set.conversion.{one}.defined") == "true"
    ]
    shown = entries.get(f"{conversions}.default", base)
    return ["", *(one for one in defined if one and one != shown)]


def _chain(entries: Mapping[str, str], channel: str, slot: str) -> list[str]:
    """Return the scalings that lead from the stored unit of a channel to another."""
    start = f"channel.{channel}.conversion-set"
    base = entries.get(f"{start}.conversions.base", "")
    at, found = slot or entries.get(f"{start}.conversions.default", base), list[str]()
    while at != base:
        if len(found) == _CONVERSIONS:
            raise ValueError(f"the conversions of channel {channel} do not end at {base}")
        found.append(f"{start}.conversion.{at}.scaling")
        at = entries[f"{start}.conversion.{at}.base-calibration-slot"]
    return found[::-1]


def _unit(entries: Mapping[str, str], channel: str, slot: str) -> str | None:
    chain = _chain(entries, channel, slot)
    scaling = chain[-1] if chain else f"{_encoder(entries, channel)}.scaling"
    return entries.get(f"{scaling}.unit.unit", entries.get(f"{scaling}.unit"))


def _calibration(entries: Mapping[str, str]) -> dict[str, float]:
    """Return stiffness and sensitivity: what leads from the deflection to a force, and from V to the deflection."""
    found: dict[str, float] = {}
    start = "channel.vDeflection.conversion-set.conversion"
    for name, slot, factor in (("k_N_m", "force", 1.0), ("invols_nm_V", "distance", 1e9)):
        text = entries.get(f"{start}.{slot}.scaling.multiplier")
        if text is not None and entries.get(f"{start}.{slot}.defined") == "true":
            found[name] = float(f"{float(text) * factor:.15g}")
    return found
