"""Slips of units where values are taken in SI units: nm given for m, GPa for Pa."""

from __future__ import annotations

import warnings
from typing import NamedTuple

__all__ = ["warn_of_slips"]


class _Taken(NamedTuple):
    """In which unit a value is taken, what it may have been meant in, and its plausible range."""

    unit: str
    meant: str
    factor: float  # by which a value is to be multiplied that was meant so
    # low, high: plausible values, in `unit`
    low: float
    high: float


_TAKEN = {
    "R": _Taken("m", "nm", 1e-9, 5e-10, 1e-4),
    "a0": _Taken("m", "nm", 1e-9, 1e-11, 1e-8),
    "eta": _Taken("m", "nm", 1e-9, 1e-10, 1e-4),
    "H": _Taken("J", "aJ", 1e-18, 1e-22, 1e-16),
    "E_star": _Taken("Pa", "GPa", 1e9, 1e3, 2e12),
    "length": _Taken("m", "um", 1e-6, 1e-6, 1e-2),
    "width": _Taken("m", "um", 1e-6, 1e-7, 1e-3),
    "thickness": _Taken("m", "um", 1e-6, 1e-8, 1e-3),
    "density": _Taken("kg/m^3", "g/cm^3", 1e3, 100.0, 2.5e4),
    "young": _Taken("Pa", "GPa", 1e9, 1e6, 2e12),
    "length_um": _Taken("um", "m", 1e6, 1.0, 1e4),
    "width_um": _Taken("um", "m", 1e6, 0.1, 1e3),
    "thickness_um": _Taken("um", "m", 1e6, 1e-2, 1e3),
    "young_GPa": _Taken("GPa", "Pa", 1e-9, 1e-3, 2e3),
}


def warn_of_slips(**values: float) -> None:
    """Warn of values that are not plausible in the unit in which they are taken, but are in the customary one.

    Units of one's own, as lengths in gaps, are used as well: nothing is refused.

    Examples
    --------
    >>> import warnings
    >>> with warnings.catch_warnings(record=True) as told:
    ...     warnings.simplefilter("always")
    ...     warn_of_slips(R=20.0, H=1e-19)
    >>> print(told[0].message)
    saltus: R = 20 m; in nm? then it is 2e-08 m
    """
    for name, value in values.items():
        taken = _TAKEN[name]
        meant = taken.factor * value
        if not taken.low <= value <= taken.high and taken.low <= meant <= taken.high:
            told = f"saltus: {name} = {value:g} {taken.unit}; in {taken.meant}? then it is {meant:g} {taken.unit}"
            warnings.warn(told, RuntimeWarning, stacklevel=4)
