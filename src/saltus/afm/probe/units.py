"""Units and plausible ranges of the instrument's quantities: nm, nN, us, kHz, N/m, GPa, aJ.

These units are consistent: nN = (N/m) nm, aJ = nN nm, nN = GPa nm**2, pW = aJ/us. Only kHz (1e-3 per us) and
Pa s (1e-3 nN us/nm**2) bring factors, which the formulas contain.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from saltus import checks
from saltus.errors import InputError

__all__ = [
    "ENERGY_EV",
    "NONE_INSISTS",
    "QUANTITIES",
    "Quantity",
    "check_changes",
    "check_drive_frequency",
    "check_lever",
    "checked",
    "other_unit",
    "quantity_of",
    "suffix",
]

ENERGY_EV = 6.241509074460763  # eV in 1 aJ, by the definition of the SI

# Units in which a value may have been meant, and what it is to be multiplied by.
_OTHER_UNITS = {
    "nm": {"m": 1e9, "um": 1e3, "pm": 1e-3, "mm": 1e6, "fm": 1e-6},
    "N/m": {"mN/m": 1e-3, "nN/m": 1e-9, "N/nm": 1e9, "uN/m": 1e-6, "N/mm": 1e3, "N/um": 1e6},
    "kHz": {"Hz": 1e-3, "MHz": 1e3, "GHz": 1e6, "mHz": 1e-6, "THz": 1e9},
    "GPa": {"Pa": 1e-9, "MPa": 1e-3, "kPa": 1e-6, "TPa": 1e3},
    "aJ": {"J": 1e18, "zJ": 1e-3, "fJ": 1e3, "pJ": 1e6, "nJ": 1e9, "yJ": 1e-6},
    "nN": {"N": 1e9, "uN": 1e3, "pN": 1e-3, "mN": 1e6, "fN": 1e-6},
    "Pa s": {"mPa s": 1e-3, "uPa s": 1e-6, "kPa s": 1e3, "MPa s": 1e6, "GPa s": 1e9},
    "uN s/m": {"N s/m": 1e6, "nN s/m": 1e-3, "mN s/m": 1e3, "pN s/m": 1e-6},
    "mC/m^2": {"C/m^2": 1e3, "uC/m^2": 1e-3, "nC/m^2": 1e-6},
    "us": {"s": 1e6, "ms": 1e3, "ns": 1e-3},
    "1/ms": {"1/s": 1e-3, "1/us": 1e3},
    "um": {"m": 1e6, "nm": 1e-3, "mm": 1e3},
    "nm/V": {"m/V": 1e9, "um/V": 1e3, "pm/V": 1e-3},
    "m": {"um": 1e-6, "mm": 1e-3, "nm": 1e-9, "cm": 1e-2},
    "kg/m^3": {"g/cm^3": 1e3},
    "Pa": {"GPa": 1e9, "MPa": 1e6, "kPa": 1e3},
    "degrees": {"rad": 180.0 / math.pi},
    "nm^3": {"m^3": 1e27, "um^3": 1e9, "zL": 1e3, "aL": 1e6, "fL": 1e9},
    "V": {"mV": 1e-3, "kV": 1e3, "uV": 1e-6},
    "A nm^2": {"A m^2": 1e18, "emu": 1e15},
    "ng": {"kg": 1e12, "g": 1e9, "pg": 1e-3, "ug": 1e3, "mg": 1e6, "fg": 1e-6},
}
_FASTEST = 100.0  # frequency of a drive, over the highest natural one, from which on it is a slip of units
_SLOWEST = 900.0  # lowest natural frequency, over that of a drive, from which on it is a slip of units
_NEAR = 30.0  # ratio of a frequency and a natural one up to which it may have been meant
_NG_IN_KG = 1e12  # nanograms in a kilogram
_LIGHTEST_NG = 2e-4  # modal mass; 0.1 N/m and 3.5 MHz are among the smallest levers that are used
_HEAVIEST_NG = 7e5  # modal mass; tuning forks have up to 5e5 ng
_USUAL_NG = (1e-2, 1e3)  # modal masses of usual levers
_SLIPS = (1e3, 1e6, 1e9)  # factors by which a value may be too small or too large, where no unit explains it


class Quantity(NamedTuple):
    """What values of a quantity are allowed and plausible."""

    unit: str  # its unit; empty for a number
    # low, high: plausible absolute values
    low: float
    high: float
    sign: str = "0+"  # {"+", "0+", "any"}: whether it must be positive, may be zero as well, or may have any sign
    below: str = ""  # what a value below `low` means, in words


_OVERDAMPED = "below 0.5 a lever creeps back to rest and does not swing; in water Q is 1 to 5"
_COLD = "in degrees C? then add 273.15"

QUANTITIES = {
    "k_N_m": Quantity("N/m", 1e-3, 1e4, "+"),
    "f0_kHz": Quantity("kHz", 0.1, 1e5, "+"),  # of higher modes too
    "f_kHz": Quantity("kHz", 0.1, 1e5, "+"),
    "Q": Quantity("", 0.5, 1e7, "+", _OVERDAMPED),
    "R_nm": Quantity("nm", 0.5, 1e5, "+"),
    "tip_mass_ng": Quantity("ng", 1e-4, 1e5),
    "A0_nm": Quantity("nm", 1e-3, 1e4),
    "A_nm": Quantity("nm", 1e-3, 1e4, "+"),
    "Y_nm": Quantity("nm", 1e-4, 1e4),
    "F0_nN": Quantity("nN", 1e-6, 1e5),
    "Zc_nm": Quantity("nm", 1e-5, 1e5, "any"),
    "H_aJ": Quantity("aJ", 1e-4, 1e2, "any"),
    "a0_nm": Quantity("nm", 0.05, 2.0, "+"),
    "E_GPa": Quantity("GPa", 1e-6, 2e3),
    "c_uNs_m": Quantity("uN s/m", 1e-6, 1e4),
    "eta_Pa_s": Quantity("Pa s", 1e-3, 1e7),
    "w_N_m": Quantity("N/m", 1e-5, 10.0, "+"),
    "w1_N_m": Quantity("N/m", 1e-5, 10.0, "+"),
    "w2_N_m": Quantity("N/m", 1e-5, 10.0),
    "gamma_N_m": Quantity("N/m", 1e-4, 2.0),
    "h_nm": Quantity("nm", 0.01, 1e3, "+"),
    "on_nm": Quantity("nm", 0.01, 1e3),
    "off_nm": Quantity("nm", 0.01, 1e4, "+"),
    "k1_N_m": Quantity("N/m", 1e-4, 1e5, "+"),
    "k2_N_m": Quantity("N/m", 1e-4, 1e5, "+"),
    "sigma_nm": Quantity("nm", 0.05, 10.0, "+"),
    "F_nN": Quantity("nN", 1e-4, 1e4, "any"),
    "l_nm": Quantity("nm", 0.01, 1e3, "+"),
    "U_aJ": Quantity("aJ", 1e-4, 1e4),
    "D0_nm": Quantity("nm", 0.01, 1e2, "+"),
    "debye_nm": Quantity("nm", 0.05, 1e4, "+"),
    "tip_mC_m2": Quantity("mC/m^2", 1e-3, 1e3, "any"),
    "sample_mC_m2": Quantity("mC/m^2", 1e-3, 1e3, "any"),
    "setpoint_nm": Quantity("nm", 1e-3, 1e4, "+"),
    "Ki_1_ms": Quantity("1/ms", 1e-6, 1e6),
    "tau_us": Quantity("us", 1e-2, 1e7, "+"),
    "permittivity": Quantity("", 1.0, 200.0, "+"),
    "half_angle_deg": Quantity("degrees", 1.0, 89.0, "+"),
    "cone_height_nm": Quantity("nm", 10.0, 1e6, "+"),
    "punch_nm": Quantity("nm", 0.5, 1e6, "+"),
    "thickness_nm": Quantity("nm", 1.0, 1e7, "+"),
    "nu": Quantity("", 1e-3, 0.5),
    "V_nm3": Quantity("nm^3", 1e-2, 1e12, "+"),
    "contact_angle_deg": Quantity("degrees", 0.1, 89.0),
    "bias_V": Quantity("V", 1e-4, 100.0, "any"),
    "cpd_V": Quantity("V", 1e-4, 10.0, "any"),
    "tip_A_nm2": Quantity("A nm^2", 1e-4, 1e6, "any"),
    "sample_A_nm2": Quantity("A nm^2", 1e-4, 1e6, "any"),
    "centres_nm": Quantity("nm", 0.05, 1e5, "+"),
    "density_kg_m3": Quantity("kg/m^3", 1e-3, 2e4, "+"),
    "viscosity_Pa_s": Quantity("Pa s", 1e-6, 10.0, "+"),
    "length_um": Quantity("um", 5.0, 2e3, "+"),
    "width_um": Quantity("um", 1.0, 5e2, "+"),
    "T_K": Quantity("K", 60.0, 500.0, "+", _COLD),
    "invols_nm_V": Quantity("nm/V", 0.1, 1e5, "+"),
}


def quantity_of(name: str) -> Quantity | None:
    """Return the quantity that a name stands for, that of the first mode for ``k_N_m_2``; None for a name of one's own.

    Examples
    --------
    >>> quantity_of("k_N_m_2").unit, quantity_of("stickiness")
    ('N/m', None)
    """
    return QUANTITIES.get(re.sub(r"_[2-9]\d*$", "", name))


NONE_INSISTS = "no other value is taken"  # hint of functions without the argument check


def checked(
    name: str,
    value: object,
    *,
    plausible: bool = True,
    insists: str = "check=False insists",
    quantity: Quantity | None = None,
) -> float:
    """Return the value of a quantity, in its unit.

    Parameters
    ----------
    name : str
        The quantity, as ``"R_nm"``.
    value : object
        Its value.
    plausible : bool, optional
        Whether a value outside the plausible range is refused.
    insists : str, optional
        How the value can be used nevertheless, for the hint.
    quantity : Quantity, optional
        What is allowed; by default what the name stands for.

    Raises
    ------
    InputError
        It is not a finite number, its sign is not allowed, or it is implausible. The hint names the slip of units that
        would explain the value.

    Examples
    --------
    >>> checked("R_nm", 10)
    10.0
    >>> checked("R_nm", 10e-9)
    Traceback (most recent call last):
        ...
    saltus.errors.InputError: R_nm = 1e-08: must be between 0.5 and 100000 nm; in m? ...
    """
    quantity = quantity_of(name) if quantity is None else quantity
    if quantity is None:
        return checks.number(name, value)
    if quantity.sign == "+":
        number = checks.positive(name, value, quantity.unit)
    elif quantity.sign == "0+":
        number = checks.non_negative(name, value, quantity.unit)
    else:
        number = checks.number(name, value, unit=quantity.unit)
    if plausible and number != 0.0 and not _within(quantity, number):
        allowed = f"between {quantity.low:g} and {quantity.high:g} {quantity.unit}".rstrip()
        raise InputError(name, value, allowed, f"{_slip(quantity, number)}{insists}")
    return number


def check_changes(own: Mapping[str, float], changes: Mapping[str, float]) -> None:
    """Raise `InputError` where a value is implausible that takes the place of a plausible one of a model.

    Parameters
    ----------
    own : mapping of str to float
        The model's parameters.
    changes : mapping of str to float
        Values that take their place.

    Raises
    ------
    InputError
        A value is not plausible. The hint names the slip of units that would explain it.

    Examples
    --------
    >>> check_changes({"R_nm": 12.0}, {"R_nm": 12e-9})
    Traceback (most recent call last):
        ...
    saltus.errors.InputError: R_nm = 1.2e-08: must be ... in m? then it is 12 nm; a model with such a value insists
    """
    insists = "a model with such a value insists"
    for name, value in changes.items():
        quantity = quantity_of(name)
        if quantity is not None and name in own and (own[name] == 0.0 or _within(quantity, own[name])):
            checked(name, value, insists=insists)
    if "f_kHz" in changes and "f_kHz" in own and _turns_with(own["f_kHz"], _natural(own)):
        check_drive_frequency("f_kHz", changes["f_kHz"], _natural({**own, **changes}), insists)


def check_drive_frequency(
    name: str, f_kHz: float, f0_kHz: Sequence[float], insists: str = "check=False insists"
) -> None:
    """Raise `InputError` where the frequency of a drive is a slip of units beside those of a probe's modes.

    Parameters
    ----------
    name : str
        What it is called.
    f_kHz : float
        The frequency of the drive.
    f0_kHz : sequence of float
        The natural frequencies.
    insists : str, optional
        How the value can be used nevertheless, for the hint.

    Raises
    ------
    InputError
        It is 100 times the highest natural frequency or more, or the 900th part of the lowest or less.

    Examples
    --------
    >>> check_drive_frequency("f_kHz", 75e3, [75.0])
    Traceback (most recent call last):
        ...
    saltus.errors.InputError: f_kHz = 75000.0: must be ... 75 kHz; in Hz? then it is 75 kHz; check=False insists
    """
    if _turns_with(f_kHz, f0_kHz):
        return
    low, high = min(f0_kHz) / _SLOWEST, _FASTEST * max(f0_kHz)
    allowed = f"between {low:.3g} and {high:.3g} kHz beside natural frequencies of {_listed(f0_kHz)} kHz"
    slip = other_unit("kHz", [f_kHz], lambda one: min(f0_kHz) / _NEAR <= one[0] <= _NEAR * max(f0_kHz))
    raise InputError(name, f_kHz, allowed, f"{slip}{insists}")


def other_unit(unit: str, values: Sequence[float], fits: Callable[[Sequence[float]], bool]) -> str:
    """Return the question whether values were meant in another unit, with "; " behind; nothing where none fits.

    Parameters
    ----------
    unit : str
        The unit in which the values are taken.
    values : sequence of float
        One value, or the ends of a range.
    fits : callable
        Whether values in `unit` are plausible.

    Examples
    --------
    >>> other_unit("kHz", [45e3, 80e3], lambda ends: ends[1] < 1e3)
    'in Hz? then it is 45 to 80 kHz; '
    """
    for other, factor in _OTHER_UNITS.get(unit, {}).items():
        meant = [value * factor for value in values]
        if fits(meant):
            return f"in {other}? then it is {' to '.join(f'{one:g}' for one in meant)} {unit}; "
    return ""


def check_lever(k_N_m: float, f0_kHz: float) -> None:
    """Raise `InputError` where no lever has both a stiffness and a natural frequency, by its modal mass.

    Examples
    --------
    >>> check_lever(3.0, 75.0)
    >>> check_lever(3.0, 75e3)
    Traceback (most recent call last):
        ...
    saltus.errors.InputError: f0_kHz = 75000.0: must be ... in Hz? then it is 75 kHz; check=False insists
    """
    mass = _mass_ng(k_N_m, f0_kHz)
    if _LIGHTEST_NG <= mass <= _HEAVIEST_NG:
        return
    low, high = (math.sqrt(k_N_m / one * _NG_IN_KG) / (math.tau * 1e3) for one in (_HEAVIEST_NG, _LIGHTEST_NG))
    allowed = f"between {low:.3g} and {high:.3g} kHz beside k_N_m = {k_N_m:g}"
    slip = other_unit("kHz", [f0_kHz], lambda one: _USUAL_NG[0] <= _mass_ng(k_N_m, one[0]) <= _USUAL_NG[1])
    told = f"its modal mass would be {mass:.2g} ng; "
    raise InputError("f0_kHz", f0_kHz, allowed, f"{told}{slip}check=False insists")


def _mass_ng(k_N_m: float, f0_kHz: float) -> float:
    """Return the mass k/omega**2 of a mode, in ng."""
    return k_N_m / (math.tau * f0_kHz * 1e3) ** 2 * _NG_IN_KG


def _natural(parameters: Mapping[str, float]) -> list[float]:
    """Return the natural frequencies among parameters, in kHz."""
    return [value for name, value in parameters.items() if re.fullmatch(r"f0_kHz(_[2-9]\d*)?", name)]


def _turns_with(f_kHz: float, f0_kHz: Sequence[float]) -> bool:
    """Return whether a drive's frequency is no slip of units beside natural frequencies."""
    return not f0_kHz or min(f0_kHz) / _SLOWEST < f_kHz < _FASTEST * max(f0_kHz)


def _listed(values: Sequence[float]) -> str:
    return ", ".join(f"{value:g}" for value in values)


def _within(quantity: Quantity, number: float) -> bool:
    return quantity.low <= abs(number) <= quantity.high


def _slip(quantity: Quantity, number: float) -> str:
    """Return the question whether another unit was meant, an empty text where nothing makes the number plausible."""
    if quantity.below and abs(number) < quantity.low:
        return f"{quantity.below}; "
    if told := other_unit(quantity.unit, [number], lambda one: _within(quantity, one[0])):
        return told
    too, power = ("small", 1.0) if abs(number) < quantity.low else ("large", -1.0)
    for slip in _SLIPS:
        if _within(quantity, number * slip**power):
            return f"{slip:g} times too {too}? then it is {number * slip**power:g} {quantity.unit}".rstrip() + "; "
    return ""


def suffix(number: int) -> str:
    """Return what a parameter's name ends with that belongs to a mode or a drive: nothing for the first.

    Examples
    --------
    >>> suffix(1), suffix(2)
    ('', '_2')
    """
    return "" if number == 1 else f"_{number}"
