"""Readings of an instrument as formulas in observables: amplitude, lag, energies, virial, forces; units and names."""

from __future__ import annotations

import math
import re
from typing import NamedTuple

from saltus import checks
from saltus.afm.modelling import suffix
from saltus.afm.units import ENERGY_EV
from saltus.errors import InputError
from saltus.system import HybridSystem

__all__ = ["READINGS", "Reading", "check_model", "drives_of", "formulas", "readings_of", "regime", "turns_of"]

_DRIVEN = re.compile(r"(A0_nm|F0_nN|Y_nm)(?:_(\d+))?")
_NEEDED = {"deflection_nm", "force_nN", "drive_pW", "medium_pW", "sample_pW", "virial_aJ"}


class Reading(NamedTuple):
    """One reading.

    Attributes
    ----------
    unit : str
        Its unit; empty for a number.
    long_name : str
        What it is, for axes.
    """

    unit: str
    long_name: str


READINGS = {
    "amplitude_nm": Reading("nm", "amplitude"),
    "lag_deg": Reading("degrees", "lag behind the drive"),
    "deflection_pm": Reading("pm", "mean deflection"),
    "E_ts_eV": Reading("eV", "energy to the sample in a cycle"),
    "E_ext_eV": Reading("eV", "energy of the drive in a cycle"),
    "E_med_eV": Reading("eV", "energy to the medium in a cycle"),
    "virial_eV": Reading("eV", "virial"),
    "peak_force_nN": Reading("nN", "greatest force"),
    "peak_elastic_nN": Reading("nN", "greatest elastic force"),
    "min_force_nN": Reading("nN", "least force"),
    "indentation_nm": Reading("nm", "greatest indentation"),
    "contact_fraction": Reading("", "share of the time in contact"),
    "contact_time_us": Reading("us", "time in contact in a cycle"),
}


def check_model(system: HybridSystem, argument: str) -> None:
    """Raise `InputError` where a system is none of `saltus.afm.model`."""
    if not set(system.output_names) >= _NEEDED:
        raise InputError(argument, system.name or "a hybrid system", "one of saltus.afm.model")


def drives_of(system: HybridSystem) -> list[int]:
    """Return the numbers of a model's drives, from 1."""
    found = (_DRIVEN.fullmatch(name) for name in system.parameter_names)
    return sorted(int(name[2] or 1) for name in found if name is not None)


def turns_of(system: HybridSystem) -> int:
    """Return how many periods of the first drive a turn of a model's phase has."""
    assert system.phase is not None
    divisor = re.fullmatch(r".*/(\d+)", system.phase[1])
    return int(divisor[1]) if divisor else 1


def formulas(system: HybridSystem, of: str | int = "deflection") -> dict[str, str]:
    """Return the readings of a model's orbits as formulas in observables.

    Parameters
    ----------
    system : HybridSystem
        A model of `saltus.afm.model`.
    of : {"deflection", "tip"} or int, optional
        Of what amplitude and lag are told, as `saltus.afm.observables` takes it.

    Returns
    -------
    dict of str to str
        Formulas by the readings' names; further drives' amplitudes and lags end with their number.

    Raises
    ------
    InputError
        The system is no such model, or the probe has no such mode.
    """
    check_model(system, "system")
    seen, turns = _subject(system, of), turns_of(system)
    waves = {}
    for number in drives_of(system):
        end = suffix(number)
        order = round(system.parameters.get(f"ratio{end}", 1.0) * turns)
        lead = f" + phase_deg{end}" if f"phase_deg{end}" in system.parameters else ""
        waves[f"amplitude_nm{end}"] = f"amplitude({seen}, {order})"
        waves[f"lag_deg{end}"] = f"90 - degrees(phase({seen}, {order})){lead}"
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
        "peak_force_nN": "max(force_nN)",
        "peak_elastic_nN": "max(elastic_nN)",
        "min_force_nN": "min(force_nN)",
        **(contact if touching else {}),
    }


def readings_of(name: str) -> Reading:
    """Return unit and long name of a reading; those of a further drive are the first one's."""
    first = re.sub(r"_\d+$", "", name)
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
    modes = sum(re.fullmatch(r"z\d+_nm", name) is not None for name in system.states)
    return f"z{checks.count('of', of, 1, modes, 'modes')}_nm"
