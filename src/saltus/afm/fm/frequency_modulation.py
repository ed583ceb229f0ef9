"""Frequency shift and excitation of a probe that is held at one amplitude, along the distance."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from saltus import checks
from saltus.afm.fm.self_excitation import excited_mode, self_excited
from saltus.afm.fm.shift_curve import FrequencyShift, shift_readings
from saltus.afm.probe.units import check_changes, suffix
from saltus.errors import ConvergenceError, SaltusError
from saltus.flow import simulate
from saltus.orbits import PeriodicOrbit, solve_orbit

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import ArrayLike

    from saltus.system import HybridSystem

    Guess = Sequence[tuple[str, str | None, ArrayLike, float]]

__all__ = ["frequency_shift"]

_CLEAR_NM = 20.0  # least gap of the far start, in nm, in addition to twice the amplitude
_LEAST = 2.0**-12  # least step along the distance, over the whole one
_PERIODS = 4.0  # periods of a simulation that tells in which modes the motion runs
_SAME = 0.2  # change of the period, relative, up to which an orbit is the neighbour of another


def frequency_shift(
    system: HybridSystem,
    bounds: tuple[float, float],
    A_nm: float,
    *,
    points: int = 41,
    parameters: Mapping[str, float] | None = None,
) -> FrequencyShift:
    """Return the frequency shift of a self-excited probe at constant amplitude, along the distance ``Zc_nm``.

    Each point is a periodic orbit of `self_excited`, whose driven mode has the first harmonic `A_nm`, and whose
    excitation is sought. From afar, the probe is brought towards the sample.

    Parameters
    ----------
    system : HybridSystem
        A model of `saltus.afm.model` with one drive of one mode, given by its free amplitude.
    bounds : (float, float)
        The range of ``Zc_nm``, in nm.
    A_nm : float
        The amplitude, in nm.
    points : int, optional
        How many distances, equally far apart.
    parameters : mapping of str to float, optional
        Parameters that differ from the model's.

    Returns
    -------
    FrequencyShift
        From the largest distance to the least that is reached; ``stopped`` says why none is nearer.

    Raises
    ------
    InputError
        The system is no such model, or a value is not allowed.
    ConvergenceError
        No motion is found at the largest distance.

    References
    ----------
    F. J. Giessibl, Phys. Rev. B 56, 16010 (1997): shift of small forces; docs/afm/loops.md has the second order.
    B. Gotsmann, C. Seidel, B. Anczykowski, H. Fuchs, Phys. Rev. B 60, 11051 (1999): dissipation by the excitation.

    Examples
    --------
    >>> from saltus import afm
    >>> probe = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
    >>> law = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5)
    >>> system = afm.model(probe, law, afm.Drive(A0_nm=10.0), Zc_nm=14.0)
    >>> far = frequency_shift(system, (13.0, 14.0), 10.0, points=3)
    >>> far.column("shift_Hz").round(3).tolist()
    [-2.944, -3.713, -4.832]
    """
    number = excited_mode(system)
    low, high = checks.interval("bounds", bounds)
    count = checks.count("points", points, 2)
    alone = self_excited(system, A_nm)
    amplitude = alone.parameters["A_nm"]
    given = {name: value for name, value in system.resolve(parameters).items() if name in alone.parameters}
    check_changes(system.parameters, given | {"Zc_nm": max(low, high, key=abs)})
    fix = {f"amplitude(z{number}_nm, 1)": amplitude}
    f0 = given[f"f0_kHz{suffix(number)}"]
    start = np.zeros(len(alone.states))
    start[alone.states.index(f"v{number}_nm_us")] = 2e-3 * math.pi * f0 * amplitude
    afar = given | {"A0_nm": amplitude, "Zc_nm": high + 2.0 * amplitude + _CLEAR_NM}
    free: Guess = [(alone.mode_names[0], None, start, 1e3 / f0)]
    orbit = _moved(solve_orbit(alone, afar, free, fix=fix, free="A0_nm"), high, fix)
    rows, stopped = [], f"Zc_nm = {low:.9g}: the end of the range"
    for Zc in np.linspace(high, low, count):
        try:
            orbit = _moved(orbit, float(Zc), fix)
        except SaltusError as error:
            stopped = str(error)
            break
        rows.append(shift_readings(orbit, number))
    columns = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    return FrequencyShift(alone, amplitude, columns, stopped)


def _moved(orbit: PeriodicOrbit, Zc: float, fix: Mapping[str, float]) -> PeriodicOrbit:
    """Return the orbit of the same amplitude at another distance, in as many steps as it takes."""
    whole = step = Zc - orbit.parameters["Zc_nm"]
    while orbit.parameters["Zc_nm"] != Zc:
        here = orbit.parameters["Zc_nm"]
        place = Zc if abs(Zc - here) <= abs(step) else here + step
        try:
            orbit = _neighbour(orbit, place, fix)
        except SaltusError as error:
            step *= 0.5
            if abs(step) < _LEAST * abs(whole):
                told = f"no orbit of this amplitude is found beyond Zc_nm = {here:.9g}"
                raise ConvergenceError(told, math.nan, 0, str(error)) from error
    return orbit


def _neighbour(orbit: PeriodicOrbit, Zc: float, fix: Mapping[str, float]) -> PeriodicOrbit:
    """Return the orbit at a distance near; where it runs in other modes, a simulation tells in which."""
    p = {**orbit.parameters, "Zc_nm": Zc}
    own: Guess = [(part.mode, part.transition or None, part.state, part.duration) for part in orbit.segments]
    try:
        found = solve_orbit(orbit.system, p, own, fix=fix, free="A0_nm")
    except ConvergenceError:
        found = None
    if found is None or not found.admissible:
        found = solve_orbit(orbit.system, p, _simulated(orbit, p), fix=fix, free="A0_nm")
    if not found.admissible or abs(found.period / orbit.period - 1.0) > _SAME:
        raise ConvergenceError("orbit of the same amplitude", found.residual, 0, "another kind of motion is found")
    return found


def _simulated(orbit: PeriodicOrbit, parameters: Mapping[str, float]) -> Guess:
    """Return a round of the motion from an orbit's state at other parameters, as a guess."""
    first = orbit.segments[0]
    motion = simulate(orbit.system, parameters, first.state, mode=first.mode, t_end=_PERIODS * orbit.period)
    names = [str(event["name"]) for event in motion.events]
    again = [i for i, name in enumerate(names) if name == names[-1]]
    if len(again) < 2:
        return [(first.mode, None, first.state, orbit.period)]
    events = motion.events[again[-2] : again[-1] + 1]
    return [
        (str(end["mode_before"]), str(end["name"]), begin["after"], float(end["time"] - begin["time"]))
        for begin, end in pairwise(events)
    ]
