"""Factors from the units that files name to those of readings: a prefix of the SI and a unit."""

from __future__ import annotations

import math
from typing import NamedTuple

__all__ = ["factor_between"]


class _Unit(NamedTuple):
    """What a unit measures, and how large it is."""

    dimension: str
    size: float
    prefixed: bool = False


_UNITS = {
    "m": _Unit("length", 1.0, prefixed=True),
    "Hz": _Unit("frequency", 1.0, prefixed=True),
    "s": _Unit("time", 1.0, prefixed=True),
    "N": _Unit("force", 1.0, prefixed=True),
    "J": _Unit("energy", 1.0, prefixed=True),
    "eV": _Unit("energy", 1.602176634e-19, prefixed=True),  # exact by the definition of the SI
    "rad": _Unit("angle", 180.0 / math.pi, prefixed=True),
    "degrees": _Unit("angle", 1.0),
    "degree": _Unit("angle", 1.0),
    "deg": _Unit("angle", 1.0),
    "°": _Unit("angle", 1.0),
    "%": _Unit("share", 0.01),
    "1": _Unit("share", 1.0),
    "": _Unit("share", 1.0),
}
_PREFIXES = {
    "a": 1e-18, "f": 1e-15, "p": 1e-12, "n": 1e-9, "u": 1e-6, "µ": 1e-6, "μ": 1e-6, "m": 1e-3, "k": 1e3, "M": 1e6,
    "G": 1e9,
}  # fmt: skip


def factor_between(unit: str, wanted: str) -> float | None:
    """Return by what a number in a unit is multiplied so that it is in another one; None where there is no such number.

    Parameters
    ----------
    unit : str
        A unit as it stands in a file, as ``"m"``, ``"µm"`` or ``"°"``.
    wanted : str
        The other unit; empty for a share.

    Returns
    -------
    float or None

    Examples
    --------
    >>> factor_between("MHz", "kHz"), factor_between("V", "nm")
    (1000.0, None)
    """
    known, other = _unit(unit), _unit(wanted)
    if known is None or other is None or known.dimension != other.dimension:
        return None
    ratio = known.size / other.size
    power = round(math.log10(ratio))
    # a power of ten is rounded once, so that 1 um is 1000 nm to the last digit
    return float(f"1e{power}") if math.isclose(ratio, 10.0**power, rel_tol=1e-12) else ratio


def _unit(text: str) -> _Unit | None:
    text = text.strip()
    if text in _UNITS:
        return _UNITS[text]
    unit = _UNITS.get(text[1:])
    if unit is None or not unit.prefixed or text[0] not in _PREFIXES:
        return None
    return _Unit(unit.dimension, _PREFIXES[text[0]] * unit.size)
