"""The stable orbits at a place: those on a curve, and those on which motions from several starts settle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from saltus.afm.models.settling import settled_orbit, starts_about
from saltus.continuation.results.crossings import extremes_of
from saltus.errors import SaltusError

if TYPE_CHECKING:
    from saltus.afm.curves.curve import Curve
    from saltus.orbits import PeriodicOrbit

__all__ = ["StableOrbits", "stable_orbits"]

_SAME = 1e-5  # distance of extremes, over the largest one, up to which two orbits are one


@dataclass(frozen=True)
class StableOrbits:
    """The stable orbits that were found at a place."""

    orbits: tuple[PeriodicOrbit, ...]  # those on the curve, sheet after sheet, then the others
    unstable: int  # how many unstable orbits the curve has there
    beside: int  # how many of the stable ones are on no sheet of the curve
    unsettled: int  # how many motions settled on no periodic orbit


def stable_orbits(curve: Curve, place: float) -> StableOrbits:
    """Return the stable orbits at a place of a curve.

    Motions from rest and from two amplitudes at eight phases are followed as well. They may settle on an orbit that no
    way from afar reaches. One that has a small basin may be missed all the same.

    Parameters
    ----------
    place : float
        Where: a distance or a frequency, whichever the curve is along.

    Raises
    ------
    InputError
        The curve does not come to the place.

    Examples
    --------
    >>> from saltus import afm
    >>> probe = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=40.0, R_nm=12.0)
    >>> law = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5)
    >>> curve = afm.distance_curve(afm.model(probe, law, afm.Drive(A0_nm=12.0), Zc_nm=5.0), (4.0, 6.0))
    >>> found = stable_orbits(curve, 5.0)
    >>> len(found.orbits), found.beside, found.unsettled
    (1, 0, 0)
    """
    here = curve.at(place)
    known: list[PeriodicOrbit] = []
    for orbit in here:
        _add(known, orbit)
    on_curve, unsettled = len(known), 0
    unstable = sum(not orbit.stable for orbit in here)
    parameters = here[0].parameters
    z = curve.system.states.index("z1_nm")
    largest = max(float(max(abs(orbit.lows[z]), abs(orbit.highs[z]))) for orbit in here)
    for x0 in starts_about(curve.system, parameters, largest):
        try:
            _add(known, settled_orbit(curve.system, parameters, x0))
        except SaltusError:
            unsettled += 1
    return StableOrbits(tuple(known), unstable, len(known) - on_curve, unsettled)


def _add(known: list[PeriodicOrbit], orbit: PeriodicOrbit) -> None:
    """Add a stable orbit that is not known; sheets of a curve may overlap."""
    if orbit.stable and orbit.admissible and not any(_same(orbit, one) for one in known):
        known.append(orbit)


def _same(one: PeriodicOrbit, other: PeriodicOrbit) -> bool:
    mine, theirs = extremes_of(one), extremes_of(other)
    return bool(np.abs(mine - theirs).max() <= _SAME * np.abs(theirs).max())
