"""What an instrument shows of a periodic orbit: amplitude, lag, energies, virial, forces."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from typing import Any

from saltus import checks
from saltus.afm.modelling import suffix
from saltus.afm.units import ENERGY_EV
from saltus.errors import InputError
from saltus.orbits.orbit import PeriodicOrbit
from saltus.system import HybridSystem

__all__ = ["Observables", "observables"]

_PM_IN_NM = 1e3  # picometres in a nanometre
_DRIVEN = re.compile(r"(A0_nm|F0_nN|Y_nm)(?:_(\d+))?")
_POWERS = ("drive_pW", "medium_pW", "sample_pW")


class Observables(Mapping[str, Any]):
    """Observables of an orbit by name; `observables` lists the names.

    Parameters
    ----------
    orbit : PeriodicOrbit
        The orbit.
    values : mapping of str to float, bool or str
        The observables.

    Examples
    --------
    >>> from saltus.afm.orbit_observables import observables
    """

    def __init__(self, orbit: PeriodicOrbit, values: Mapping[str, Any]) -> None:
        self.orbit = orbit
        self._values = dict(values)

    def __getitem__(self, name: str) -> Any:
        return self._values[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __repr__(self) -> str:
        lines = (f"  {name:18} {f'{value:.9g}' if isinstance(value, float) else value}" for name, value in self.items())
        return "\n".join(["Observables", *lines])

    def harmonic_nm(self, order: int) -> float:
        """Return the amplitude of the deflection at a multiple of the first drive's frequency.

        Parameters
        ----------
        order : int
            Which multiple.

        Returns
        -------
        float, in nm

        Raises
        ------
        InputError
            `order` is below 1.
        """
        name = f"amplitude(deflection_nm, {checks.count('order', order) * _turns(self.orbit)})"
        return self.orbit.observe(name)[name]


def observables(orbit: PeriodicOrbit, *, of: str | int = "deflection") -> Observables:
    """Return what an instrument shows of an orbit of `saltus.afm.model`.

    Parameters
    ----------
    orbit : PeriodicOrbit
        The orbit.
    of : {"deflection", "tip"} or int, optional
        Of what amplitude and lag are told: the deflection that light shows, the tip itself, which moves with a shaken
        base, or the displacement of one mode, counted from 1.

    Returns
    -------
    Observables
        A mapping with the entries

        ====================  ========================================================================================
        ``amplitude_nm``      amplitude at the drive's frequency
        ``lag_deg``           how far it lags behind the drive, from 0 to 360 degrees; 90 at f0 without a sample
        ``deflection_pm``     mean deflection
        ``E_ts_eV``           energy that the sample takes in a cycle of the first drive
        ``E_ext_eV``          energy that the drive puts in
        ``E_med_eV``          energy that the modes' own damping takes
        ``virial_eV``         mean of force times displacement of the tip
        ``peak_force_nN``     greatest force
        ``peak_elastic_nN``   greatest force without its part that depends on the rate
        ``min_force_nN``      least force
        ``indentation_nm``    greatest depth
        ``contact_fraction``  share of the time in contact; NaN for a law without contact, as `indentation_nm`
        ``contact_time_us``   time in contact, in a cycle
        ``stable``            whether the orbit is stable
        ``regime``            "attractive" where the virial is positive, "repulsive" where it is negative
        ====================  ========================================================================================

        Of further drives there are ``amplitude_nm_2``, ``lag_deg_2`` and so on. ``.harmonic_nm(order)`` returns the
        amplitude of the deflection at a multiple of the first drive's frequency.

    Raises
    ------
    InputError
        The orbit is of another system, or the probe has no such mode.

    References
    ----------
    J. P. Cleveland et al., Appl. Phys. Lett. 72, 2613 (1998): energies.
    A. San Paulo, R. Garcia, Phys. Rev. B 64, 193411 (2001): virial.

    Examples
    --------
    >>> from saltus import afm, find_orbit
    >>> probe = afm.Probe(k_N_m=40.0, f0_kHz=300.0, Q=300.0, R_nm=10.0)
    >>> law = afm.VanDerWaals(H_aJ=0.2, a0_nm=0.3) + afm.DMT(E_GPa=1.09)
    >>> system = afm.model(probe, law, afm.Drive(A0_nm=10.0), Zc_nm=8.5)
    >>> seen = observables(find_orbit(system, x0=[0.0, 0.0]))
    >>> seen["regime"], f"{seen['amplitude_nm']:.4f}", f"{seen['lag_deg']:.2f}"
    ('repulsive', '9.6757', '75.37')
    """
    checks.instance("orbit", orbit, PeriodicOrbit)
    system, p = orbit.system, orbit.parameters
    if not {"deflection_nm", "force_nN", *_POWERS} <= set(system.output_names):
        raise InputError("orbit", system.name or "a hybrid system", "one of saltus.afm.model")
    seen_of = _subject(system, of)
    turns = _turns(orbit)
    cycle = 1e3 / p["f_kHz"]
    orders = {number: round(p.get(f"ratio_{number}", 1.0) * turns) for number in _drives(system)}
    waves = {
        number: [f"{kind}({seen_of}, {order})" for kind in ("amplitude", "phase")] for number, order in orders.items()
    }
    means = [f"mean({name})" for name in ("deflection_nm", *_POWERS, "force_nN*(D_nm - Zc_nm)")]
    extremes = ["max(force_nN)", "max(elastic_nN)", "min(force_nN)"]
    touching = "contact" in system.output_names
    depth = ["max(indentation_nm)", "mean(contact)"] if touching else []
    found = orbit.observe(*means, *extremes, *depth, *(name for pair in waves.values() for name in pair))
    values: dict[str, Any] = {}
    for number, (amplitude, angle) in waves.items():
        lead = p.get(f"phase_deg{suffix(number)}", 0.0)
        values[f"amplitude_nm{suffix(number)}"] = found[amplitude]
        values[f"lag_deg{suffix(number)}"] = (90.0 - math.degrees(found[angle]) + lead) % 360.0
    energies = {name: found[f"mean({name}_pW)"] * cycle * ENERGY_EV for name in ("sample", "drive", "medium")}
    virial = found[means[-1]] * ENERGY_EV
    share = found["mean(contact)"] if touching else math.nan
    values |= {
        "deflection_pm": found["mean(deflection_nm)"] * _PM_IN_NM,
        "E_ts_eV": energies["sample"],
        "E_ext_eV": energies["drive"],
        "E_med_eV": energies["medium"],
        "virial_eV": virial,
        "peak_force_nN": found["max(force_nN)"],
        "peak_elastic_nN": found["max(elastic_nN)"],
        "min_force_nN": found["min(force_nN)"],
        "indentation_nm": found["max(indentation_nm)"] if touching else math.nan,
        "contact_fraction": share,
        "contact_time_us": share * cycle,
        "stable": orbit.stable,
        "regime": "attractive" if virial > 0.0 else "repulsive" if virial < 0.0 else "free",
    }
    return Observables(orbit, values)


def _subject(system: HybridSystem, of: str | int) -> str:
    """Return the expression whose amplitude and lag are told."""
    if isinstance(of, str):
        checks.chosen("of", of, ("deflection", "tip"), instead="or the number of a mode")
        return "deflection_nm" if of == "deflection" else "D_nm"
    modes = sum(re.fullmatch(r"z\d+_nm", name) is not None for name in system.states)
    return f"z{checks.count('of', of, 1, modes, 'modes')}_nm"


def _drives(system: HybridSystem) -> list[int]:
    """Numbers of the drives."""
    found = (_DRIVEN.fullmatch(name) for name in system.parameter_names)
    return sorted(int(name[2] or 1) for name in found if name is not None)


def _turns(orbit: PeriodicOrbit) -> int:
    """Periods of the first drive in a turn of the phase."""
    return round(2e-3 * math.pi * orbit.parameters["f_kHz"] / orbit.motion().angle[1])
