"""Readings of an instrument as formulas in observables: amplitude, lag, energies, virial, forces; units and names."""

from __future__ import annotations

import math
import re
from fractions import Fraction
from typing import Any, NamedTuple

from saltus import checks
from saltus.afm.models.parts import check_model, driven_mode, parts_of
from saltus.afm.probe.units import ENERGY_EV, suffix
from saltus.errors import InputError
from saltus.system import HybridSystem

__all__ = [
    "CONVENTIONS",
    "READINGS",
    "Reading",
    "drives_of",
    "formulas",
    "lag_of",
    "readings_of",
    "regime",
    "shown_between",
    "shown_phase",
    "turns_of",
]


class Reading(NamedTuple):
    """One reading."""

    unit: str  # its unit; empty for a number
    long_name: str  # what it is, for axes


READINGS = {
    "amplitude_nm": Reading("nm", "amplitude"),
    "lag_deg": Reading("degrees", "lag behind the drive"),
    "deflection_pm": Reading("pm", "mean deflection"),
    "E_ts_eV": Reading("eV", "energy to the sample in a cycle"),
    "E_ext_eV": Reading("eV", "energy of the drive in a cycle"),
    "E_med_eV": Reading("eV", "energy to the medium in a cycle"),
    "virial_eV": Reading("eV", "virial"),
    "E_ts_1_eV": Reading("eV", "energy to the sample by one harmonic"),
    "virial_1_eV": Reading("eV", "virial by one harmonic"),
    "peak_force_nN": Reading("nN", "greatest force"),
    "peak_elastic_nN": Reading("nN", "greatest elastic force"),
    "min_force_nN": Reading("nN", "least force"),
    "indentation_nm": Reading("nm", "greatest indentation"),
    "contact_fraction": Reading("", "share of the time in contact"),
    "contact_time_us": Reading("us", "time in contact in a cycle"),
}

# Of what curves have besides readings.
_FURTHER = {
    "Zc_nm": Reading("nm", "distance"),
    "f_kHz": Reading("kHz", "frequency of the first drive"),
    "harmonic_nm": Reading("nm", "amplitude of a harmonic of the deflection"),
}

# What is shown of the lag, as a formula in it, and the name for axes.
CONVENTIONS = {
    "lag90": ("{lag}", READINGS["lag_deg"].long_name),
    "bruker0": ("90 - ({lag})", "phase, bruker0"),
    "asylum": ("{lag}", "phase, asylum"),
}
_SHOWN = "shown_phase_deg"  # reading of conventions other than lag90


def drives_of(system: HybridSystem) -> list[int]:
    """Return the numbers of a model's drives, from 1."""
    return list(range(1, len(parts_of(system).drives.parts) + 1))


def turns_of(system: HybridSystem) -> int:
    """Return how many periods of the first drive a turn of a model's phase has.

    Raises
    ------
    InputError
        The model has no drive, as a self-excited one.
    """
    if system.phase is None:
        raise InputError("system", system.name, "a driven model", "frequency_shift has readings of a self-excited one")
    return parts_of(system).drives.turns


def formulas(system: HybridSystem, of: str | int = "deflection", phase_convention: str = "lag90") -> dict[str, str]:
    """Return the readings of a model's orbits as formulas in observables.

    Parameters
    ----------
    of : {"deflection", "tip"} or int, optional
        Of what amplitude and lag are told, as `saltus.afm.observables` takes it.
    phase_convention : {"lag90", "bruker0", "asylum"}, optional
        What is shown of the lag, as `saltus.afm.observables` takes it.

    Returns
    -------
    dict of str to str
        Formulas by the readings' names; further drives' amplitudes and lags end with their number.

    Raises
    ------
    InputError
        The system is no such model, the probe has no such mode, or there is no such convention.
    """
    check_model(system, "system")
    drives = parts_of(system).drives.parts
    if free := [f"theta_{number}" for number, drive in enumerate(drives, 1) if not drive.repeats]:
        hint = f"no motion of it repeats while {', '.join(free)} turns freely: simulate it"
        raise InputError("system", system.name, "a model whose drives repeat", hint)
    checks.chosen("phase_convention", phase_convention, CONVENTIONS)
    seen, turns = _subject(system, of), turns_of(system)
    waves = {}
    for number in drives_of(system):
        end = suffix(number)
        order = int(Fraction(drives[number - 1].ratio) * turns)
        lead = f" + phase_deg{end}" if drives[number - 1].phase_deg else ""
        waves[f"amplitude_nm{end}"] = f"amplitude({seen}, {order})"
        waves[f"lag_deg{end}"] = lag = f"90 - degrees(phase({seen}, {order})){lead}"
        if phase_convention != "lag90":
            waves[f"{_SHOWN}{end}"] = shown_phase(lag, phase_convention)
    cycle = f"*1e3/f_kHz*{ENERGY_EV!r}"
    touching = "contact" in system.output_names
    contact = {
        "indentation_nm": "max(indentation_nm)",
        "contact_fraction": "mean(contact)",
        "contact_time_us": "mean(contact)*1e3/f_kHz",
    }
    return {
        **waves,
        "deflection_pm": "mean(deflection_nm)*1e3",
        "E_ts_eV": f"mean(sample_pW){cycle}",
        "E_ext_eV": f"mean(drive_pW){cycle}",
        "E_med_eV": f"mean(medium_pW){cycle}",
        "virial_eV": f"mean(virial_aJ)*{ENERGY_EV!r}",
        **_by_one_harmonic(system),
        "peak_force_nN": "max(force_nN)",
        "peak_elastic_nN": "max(elastic_nN)",
        "min_force_nN": "min(force_nN)",
        **(contact if touching else {}),
    }


def _by_one_harmonic(system: HybridSystem) -> dict[str, str]:
    """Return formulas of the energy and the virial that the harmonic at the first drive's frequency tells.

    The balance of the driven mode at this frequency gives the force there, from amplitudes and phases alone:
    ``(k - m omega**2 + i omega k/(omega_0 Q)) z - F``.
    """
    if "drive_nN" not in system.output_names:
        return {}
    order, number = turns_of(system), driven_mode(system)
    end = suffix(number)
    z, tip, force = (f"amplitude({name}, {order})" for name in (f"z{number}_nm", "D_nm", "drive_nN"))
    behind, pushed = (f"(phase({name}, {order}) - phase(D_nm, {order}))" for name in (f"z{number}_nm", "drive_nN"))
    ratio = f"(f_kHz/f0_kHz{end})"
    spring, drag = f"k_N_m{end}*(1 - {ratio}**2)", f"k_N_m{end}*{ratio}/Q{end}"
    lost = f"{force}*sin({pushed}) - {z}*({spring}*sin({behind}) + {drag}*cos({behind}))"
    held = f"{z}*({spring}*cos({behind}) - {drag}*sin({behind})) - {force}*cos({pushed})"
    return {"E_ts_1_eV": f"pi*{tip}*({lost})*{ENERGY_EV!r}", "virial_1_eV": f"0.5*{tip}*({held})*{ENERGY_EV!r}"}


def shown_phase(lag: str, phase_convention: str) -> str:
    """Return the phase that a convention shows, as a formula in a lag.

    Examples
    --------
    >>> shown_phase("lag_deg", "bruker0")
    '90 - (lag_deg)'
    """
    return CONVENTIONS[phase_convention][0].format(lag=lag)


def lag_of(phase: Any, phase_convention: str) -> Any:
    """Return the lag of a phase that a convention shows, a number or a column; conventions are their own inverses.

    Examples
    --------
    >>> lag_of(30.0, "bruker0"), lag_of(30.0, "asylum")
    (60.0, 30.0)
    """
    return 90.0 - phase if phase_convention == "bruker0" else phase


def shown_between(phase: float, phase_convention: str) -> float:
    """Return a shown phase in the range of its convention, in degrees.

    That is above -180 and up to 180 for ``bruker0``, and from 0 to below 360 for the others.

    Examples
    --------
    >>> shown_between(-200.0, "bruker0"), shown_between(-200.0, "asylum")
    (160.0, 160.0)
    """
    return 180.0 - (180.0 - phase) % 360.0 if phase_convention == "bruker0" else phase % 360.0


def readings_of(name: str, phase_convention: str = "lag90") -> Reading:
    """Return unit and long name of a reading, or of what a curve is along; a further drive has those of the first."""
    if name in _FURTHER:
        return _FURTHER[name]
    first = re.sub(r"_\d+$", "", name)
    if first == _SHOWN:
        return Reading("degrees", CONVENTIONS[phase_convention][1])
    return READINGS[name if name in READINGS else first]


def regime(virial: float) -> str:
    """Return the regime that the sign of a virial tells."""
    if math.isnan(virial) or virial == 0.0:
        return "free"
    return "attractive" if virial > 0.0 else "repulsive"


def _subject(system: HybridSystem, of: str | int) -> str:
    """Return the expression whose amplitude and lag are told."""
    if isinstance(of, str):
        checks.chosen("of", of, ("deflection", "tip"), instead=", or the number of a mode")
        return "deflection_nm" if of == "deflection" else "D_nm"
    return f"z{checks.count('of', of, 1, parts_of(system).probe.modes, 'modes')}_nm"
