"""Notes of Asylum Research: lines ``name: value`` in waves and .ARDF files; what they tell of probe and curve."""

from __future__ import annotations

import re
from collections.abc import Mapping

from saltus.afm.files.columns import bounded, numbers_of

__all__ = ["calibration_of", "entries_of", "told_of", "ways_of"]

_CALIBRATION = {
    "k_N_m": ("SpringConstant", "N/m", "N/m"),
    "invols_nm_V": ("InvOLS", "m/V", "nm/V"),
    "amplitude_invols_nm_V": ("AmpInvOLS", "m/V", "nm/V"),
    "f_kHz": ("DriveFrequency", "Hz", "kHz"),
    "f0_kHz": ("ThermalFrequency", "Hz", "kHz"),
    "Q": ("ThermalQ", "", ""),
}  # by the entry, its unit, the unit wanted
_TOLD = re.compile(
    r"(Amp2?)?InvOLS|SpringConstant|Thermal(Q|Frequency|Temperature|DC|WhiteNoise)|Tune(Freq|Q|Peak)Result|"
    r"Drive(Frequency|Amplitude)1?|FreeAir(Amplitude|Phase)2?|PhaseOffset1?|.*(LVDT|Piezo)Sens|ImagingMode|"
    r"MicroscopeModel|Date|Time|Indexes|Direction|Trigger(Point|Channel)|(Approach|Retract)Velocity|NumPtsPerSec|"
    r"ForceDist|Version|ResFreq[12]"
)  # entries that are kept
_NAMES = {1.0: "approach", -1.0: "retract"}


def entries_of(note: bytes) -> dict[str, str]:
    """Return the entries of a note by their names; the first of several that have one name."""
    try:
        text = note.decode("utf-8")
    except UnicodeDecodeError:
        text = note.decode("latin-1")
    found: dict[str, str] = {}
    for line in re.split(r"[\r\n]+", text.split("\0", 1)[0]):
        name, mark, value = line.partition(":")
        if mark and name.strip():
            found.setdefault(bounded(name), bounded(value))
    return found


def calibration_of(entries: Mapping[str, str]) -> dict[str, float]:
    """Return the constants of the probe and its detector."""
    return numbers_of(entries, _CALIBRATION)


def told_of(entries: Mapping[str, str]) -> dict[str, str]:
    """Return the entries that say how a curve was measured."""
    return {name: value for name, value in entries.items() if _TOLD.fullmatch(name)}


def ways_of(entries: Mapping[str, str], size: int) -> dict[str, slice]:
    """Return where each way lies in a curve of `size` points; nothing where the note does not tell it for this size."""
    try:
        places = [int(one) for one in entries["Indexes"].strip(",").split(",")]
        ways = [float(one) for one in entries["Direction"].strip(",").split(",")]
    except (KeyError, ValueError):
        return {}
    if len(places) != len(ways) or places != sorted(set(places)) or places[:1] != [0] or places[-1] != size - 1:
        return {}
    found: dict[str, slice] = {}
    for begin, end, way in zip(places, places[1:], ways[1:], strict=False):
        name = _NAMES.get(way)
        if name in found:
            return {}
        if name is not None:
            found[name] = slice(begin, end + (end == size - 1))
    return found
