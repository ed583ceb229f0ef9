"""What an instrument shows of a periodic orbit: amplitude, lag, energies, virial, forces."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from saltus import checks
from saltus.afm.models.parts import check_model
from saltus.afm.models.readings import READINGS, formulas, regime, shown_between, turns_of
from saltus.orbits.orbit import PeriodicOrbit

__all__ = ["Observables", "observables"]


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
    >>> from saltus.afm.models.orbit_observables import observables
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

        Returns
        -------
        float, in nm

        Raises
        ------
        InputError
            `order` is below 1.
        """
        name = f"amplitude(deflection_nm, {checks.count('order', order) * turns_of(self.orbit.system)})"
        return self.orbit.observe(name)[name]


def observables(orbit: PeriodicOrbit, *, of: str | int = "deflection", phase_convention: str = "lag90") -> Observables:
    """Return what an instrument shows of an orbit of `saltus.afm.model`.

    Parameters
    ----------
    orbit : PeriodicOrbit
        The orbit.
    of : {"deflection", "tip"} or int, optional
        Of what amplitude and lag are told: the deflection that light shows, the tip itself, which moves with a shaken
        base, or the displacement of one mode, counted from 1.
    phase_convention : {"lag90", "bruker0", "asylum"}, optional
        What an instrument shows of the lag. ``lag90`` shows ``lag_deg`` itself. ``bruker0`` shows ``90 - lag_deg``:
        0 at resonance, positive where the sample repels, from above -180 to 180. ``asylum`` shows ``lag_deg``: 90 at
        resonance, above it where the sample attracts, below it where it repels. The latter two add the entry
        ``shown_phase_deg``. An offset or a sign that was set at the instrument comes on top.

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
        ``E_ts_1_eV``         energy that the sample takes, from amplitude and lag alone; see below
        ``virial_1_eV``       virial from amplitude and lag alone
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

        The readings by one harmonic are what an instrument computes. A mode may have the amplitude A and the lag phi
        under the force F of the drive. Then the energy is ``pi F A sin(phi) - pi k A**2 f/(f0 Q)``, the virial
        ``(k A**2 (1 - (f/f0)**2) - F A cos(phi))/2``. A tip that moves more than this mode, as with a
        shaken base, counts as it moves. They miss the higher harmonics, which `E_ts_eV` and `virial_eV` have.

    Raises
    ------
    InputError
        The orbit is of another system, the probe has no such mode, or there is no such convention.

    References
    ----------
    J. P. Cleveland, B. Anczykowski, A. E. Schmid, V. B. Elings, Appl. Phys. Lett. 72, 2613 (1998): the energies.
    A. San Paulo, R. Garcia, Phys. Rev. B 64, 193411 (2001): the virial.

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
    check_model(orbit.system, "orbit")
    texts = formulas(orbit.system, of, phase_convention)
    found = orbit.observe(*texts.values())
    values: dict[str, Any] = {name: found[text] for name, text in texts.items()}
    for name in values:
        if name.startswith("lag_deg"):
            values[name] %= 360.0
        elif name.startswith("shown_phase_deg"):
            values[name] = shown_between(values[name], phase_convention)
    values = dict.fromkeys(READINGS, math.nan) | values
    return Observables(orbit, values | {"stable": orbit.stable, "regime": regime(values["virial_eV"])})
