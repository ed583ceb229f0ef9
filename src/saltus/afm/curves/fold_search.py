"""Folds of distance curves over the drive and the distance, and the tip's radius that a critical amplitude tells."""

from __future__ import annotations

import math
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from saltus import checks
from saltus.afm.curves.bistable_region import PLANE, Bistability, turns_of
from saltus.afm.curves.curves import approach_jumps, from_afar
from saltus.afm.models.parts import check_model
from saltus.afm.models.readings import drives_of
from saltus.afm.probe.units import check_changes
from saltus.continuation import Locus, SpecialPoint, StepControl, continue_locus, continue_orbit
from saltus.continuation.results.crossings import extremes_of
from saltus.errors import ConvergenceError, InputError, SaltusError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from saltus.orbits import PeriodicOrbit
    from saltus.progress import Report
    from saltus.system import HybridSystem

__all__ = ["bistability", "tip_radius"]

_HEIGHTS = (0.15, 0.35, 0.6, 0.85, 0.05)  # shares of the range of distance at which folds are sought
_STAGE = 1.25  # ratio of critical amplitudes from one stage of the search for a radius to the next, at most
_ROUNDING = 1e-9  # difference, relative, of amplitudes that is rounding
_MOVES = 3.0  # change of a jump's distance, over that of the free amplitude, up to which two jumps are one
_BESIDE = (1e-3, 1e-2)  # differences, relative, from a turn at which approaches show whether it is the critical one
_SAME = 1e-2  # difference, relative, of amplitude and extremes up to which a fold is that of a locus


def bistability(
    system: HybridSystem,
    *,
    A0_nm: tuple[float, float] = (1.0, 30.0),
    Zc_nm: tuple[float, float] = (0.5, 30.0),
    parameters: Mapping[str, float] | None = None,
    steps: StepControl | None = None,
    progress: bool | Report = False,
) -> Bistability:
    """Return the folds of a model's distance curves, over free amplitude and distance.

    At five distances the motion is followed from the least free amplitude to the largest. From each fold on the way its
    locus over both is followed. A locus that passes between these distances is not found.

    Parameters
    ----------
    system : HybridSystem
        A model of `saltus.afm.model` with one drive, given by its free amplitude.
    A0_nm, Zc_nm : (float, float), optional
        The ranges of free amplitude and distance, in nm.
    parameters : mapping of str to float, optional
        Parameters that differ from the model's.
    steps : StepControl, optional
        Sizes of steps and their limits.
    progress : bool or callable, optional
        True for a bar on stderr, or a function of a `saltus.Progress`.

    Returns
    -------
    Bistability
        ``.cusp``, ``.critical_amplitude_nm``, ``.critical_distance_nm``, ``.least_bistable_amplitude_nm``, ``.loci``;
        `plot` draws them.

    Raises
    ------
    InputError
        The system is no such model, a range is not allowed, or no fold is found within: the hint says where one was
        sought.

    References
    ----------
    R. Garcia, A. San Paulo, Phys. Rev. B 60, 4961 (1999): two stable motions, and the critical amplitude.

    Examples
    --------
    >>> from saltus import afm
    >>> probe = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
    >>> law = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5)
    >>> system = afm.model(probe, law, afm.Drive(A0_nm=12.0), Zc_nm=10.0)
    >>> bistability(system)
    Bistability of tip and sample, 1 mode: 1 locus of folds, A0_nm from 1 to 30, Zc_nm from 0.5 to 30
      cusp                A0_nm = 25.6149973, Zc_nm = 25.1789782
      critical amplitude  A0_nm = 10.5434078, Zc_nm = 5.9804976
      began: Zc_nm = 0.5, A0_nm = 17.9379251: bound reached
      ended: Zc_nm = 0.635070413, A0_nm = 1: bound reached
    """
    _check_drive(system)
    low, high = checks.interval("A0_nm", A0_nm)
    near, far = checks.interval("Zc_nm", Zc_nm)
    checks.positive("A0_nm", low, "nm")
    p = system.resolve(parameters)
    check_changes(system.parameters, p | {"A0_nm": high, "Zc_nm": max(near, far, key=abs)})
    ranges = dict(zip(PLANE, ((low, high), (near, far)), strict=True))
    loci: list[Locus] = []
    failures, told = [], []
    for Zc in (near + share * (far - near) for share in _HEIGHTS):
        place = p | {"A0_nm": low, "Zc_nm": Zc}
        try:
            start = from_afar(system, place, Zc, None)[0]
            branch = continue_orbit(start, "A0_nm", (low, high), steps=steps, progress=progress)
        except SaltusError as error:
            failures.append(f"Zc_nm = {Zc:.6g}: {error}")
            continue
        if "bound reached" not in branch.stopped[1]:
            failures.append(f"Zc_nm = {Zc:.6g}: {branch.stopped[1]}")
        told.append(f"{Zc:.6g}")
        for fold in branch.special_points.of_type("SN"):
            if not any(_passes(locus, fold.orbit) for locus in loci):
                loci.append(continue_locus(fold, PLANE, ranges, steps=steps, progress=progress))
    if not loci:
        hint = "; ".join([f"no distance curve folds on the ways along A0_nm at Zc_nm = {', '.join(told)}", *failures])
        raise InputError("A0_nm, Zc_nm", ranges, "ranges with a fold", hint)
    jumping = _jumping(system, p, loci, (near, far), steps)
    return Bistability(system, (low, high), (near, far), tuple(loci), tuple(failures), jumping)


def _jumping(
    system: HybridSystem,
    p: Mapping[str, float],
    loci: Sequence[Locus],
    Zc_nm: tuple[float, float],
    steps: StepControl | None,
) -> tuple[int, int] | None:
    """Return the turn of least amplitude from which on an approach jumps: number of its locus, and of it there."""
    turns = [(i, point) for i, locus in enumerate(loci) for point in turns_of(locus, "A0_nm", 1.0)]
    for i, point in sorted(turns, key=lambda turn: turn[1].value("A0_nm")):
        if _begins_to_jump(system, p, float(point.value("A0_nm")), Zc_nm, steps):
            return i, [other.label for other in loci[i].special_points].index(point.label)
    return None


def _begins_to_jump(
    system: HybridSystem, p: Mapping[str, float], A0_nm: float, Zc_nm: tuple[float, float], steps: StepControl | None
) -> bool:
    """Return whether an approach at a larger free amplitude has a jump that one at a smaller amplitude lacks.

    Both may jump elsewhere, as a tip does that hardly moves any more next to the sample.
    """

    @cache
    def jumps(share: float) -> list[float]:
        return approach_jumps(system, {**p, "A0_nm": A0_nm * (1.0 + share)}, Zc_nm, steps)

    return any(
        all(abs(jump - before) > _MOVES * (share + _BESIDE[0]) * A0_nm for before in jumps(-_BESIDE[0]))
        for share in _BESIDE
        for jump in jumps(share)
    )


def tip_radius(
    system: HybridSystem,
    critical_amplitude_nm: float,
    *,
    R_nm: tuple[float, float] = (1.0, 100.0),
    Zc_nm: tuple[float, float] = (0.5, 30.0),
    parameters: Mapping[str, float] | None = None,
    steps: StepControl | None = None,
) -> float:
    """Return the tip's radius in nm at which a critical amplitude has been measured.

    At this free amplitude an approach jumps with smaller radii only. So the locus of the folds over radius and distance
    turns there. The turn is followed from the critical amplitude of the model. Two approaches beside the measured
    amplitude check it.

    Parameters
    ----------
    system : HybridSystem
        A model of `saltus.afm.model`, with a radius that is about right.
    critical_amplitude_nm : float
        The critical amplitude, in nm, as `saltus.afm.bistability` finds it.
    R_nm, Zc_nm : (float, float), optional
        The ranges of radius and distance, in nm. The model's radius must lie within.
    parameters : mapping of str to float, optional
        Parameters that differ from the model's.
    steps : StepControl, optional
        Sizes of steps and their limits.

    Returns
    -------
    float
        The radius, in nm.

    Raises
    ------
    InputError
        The system is no such model, or a range is not allowed. The model itself has no critical amplitude up to three
        times the measured one.
    ConvergenceError
        No radius in the range has this critical amplitude, or approaches beside it do not show it.

    References
    ----------
    S. Santos et al., Rev. Sci. Instrum. 83, 043707 (2012): the critical amplitude tells the tip's radius.

    Examples
    --------
    >>> from saltus import afm
    >>> probe = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=8.0)
    >>> law = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5)
    >>> system = afm.model(probe, law, afm.Drive(A0_nm=12.0), Zc_nm=10.0)
    >>> print(f"{tip_radius(system, 10.5434078):.6f}")
    12.000000
    """
    wanted = checks.positive("critical_amplitude_nm", critical_amplitude_nm, "nm")
    _check_drive(system)
    small, large = checks.interval("R_nm", R_nm)
    near, far = checks.interval("Zc_nm", Zc_nm)
    p = system.resolve(parameters)
    check_changes(system.parameters, p | {"A0_nm": wanted, "R_nm": large, "Zc_nm": max(near, far, key=abs)})
    checks.between("the model's R_nm", p["R_nm"], small, large)
    reach = (0.05 * wanted, 3.0 * wanted)
    first = bistability(system, A0_nm=reach, Zc_nm=(near, far), parameters=p, steps=steps).critical
    if first is None:
        hint = f"none is found with A0_nm from {reach[0]:.6g} to {reach[1]:.6g}"
        raise InputError("system", f"R_nm = {p['R_nm']:.6g}", "a model with a critical amplitude", hint)
    reached, here = first, first.value("A0_nm")
    for amplitude in np.geomspace(here, wanted, 1 + _stages(wanted / here))[1:]:
        reached = _critical_at(reached, float(amplitude), (small, large), (near, far), steps)
    radius = float(reached.value("R_nm"))
    if reached is not first and not _begins_to_jump(system, p | {"R_nm": radius}, wanted, (near, far), steps):
        told = f"at R_nm = {radius:.6g} the folds turn, but no approach begins to jump there"
        raise ConvergenceError(f"tip with the critical amplitude {wanted:.6g} nm", np.nan, 0, told)
    return radius


def _stages(ratio: float) -> int:
    """Return in how many stages an amplitude is changed by a ratio; at the next critical one the folds still exist."""
    return 0 if abs(ratio - 1.0) < _ROUNDING else math.ceil(abs(math.log(ratio)) / math.log(_STAGE))


def _critical_at(
    critical: SpecialPoint,
    wanted: float,
    R_nm: tuple[float, float],
    Zc_nm: tuple[float, float],
    steps: StepControl | None,
) -> SpecialPoint:
    """Return the fold at which the radius turns at a free amplitude, from the critical one at another amplitude."""
    here = critical.value("A0_nm")
    between = {"A0_nm": (min(here, wanted), max(here, wanted)), "R_nm": R_nm}
    way = continue_locus(critical.orbit, ("A0_nm", "R_nm"), between, type="SN", steps=steps)
    missed = np.abs(way.column("A0_nm") / wanted - 1.0)
    told = f"at Zc_nm = {critical.orbit.parameters['Zc_nm']:.6g} the folds end: {'; '.join(way.stopped)}"
    if missed.min() < _ROUNDING:
        plane = {"R_nm": R_nm, "Zc_nm": Zc_nm}
        orbit = way.solution(int(np.argmin(missed)))
        locus = continue_locus(orbit, ("R_nm", "Zc_nm"), plane, type="SN", steps=steps)
        turns = turns_of(locus, "R_nm", -1.0)
        if turns:
            begun = _nearest_point(locus, orbit)
            return min(turns, key=lambda point: abs(point.position - begun))
        told = f"the locus of folds has no greatest radius: {'; '.join(locus.stopped)}"
    raise ConvergenceError(f"tip with the critical amplitude {wanted:.6g} nm", np.nan, len(way), told)


def _nearest_point(locus: Locus, orbit: PeriodicOrbit) -> int:
    """Return the point of a locus at which its parameters and extremes are those of an orbit."""
    n = len(orbit.system.states)
    rows = np.hstack([locus.lows[:, :n], locus.highs[:, :n], *(locus.column(name)[:, None] for name in locus.names)])
    wanted = np.append(extremes_of(orbit), [orbit.parameters[name] for name in locus.names])
    return int(np.argmin(np.abs(rows / wanted - 1.0).max(axis=1)))


def _check_drive(system: HybridSystem) -> None:
    """Raise `InputError` where a system is no model with one drive that is given by its free amplitude."""
    check_model(system, "system")
    if drives_of(system) != [1] or "A0_nm" not in system.parameter_names:
        raise InputError("system", system.name, "a model with one drive, as afm.Drive(A0_nm=10.0)")


def _passes(locus: Locus, fold: PeriodicOrbit) -> bool:
    """Return whether a locus passes through a fold: with its distance, amplitude and extremes."""
    n, Zc = len(fold.system.states), fold.parameters["Zc_nm"]
    distance = locus.column("Zc_nm") - Zc
    own = np.column_stack([locus.column("A0_nm"), locus.lows[:, :n], locus.highs[:, :n]])
    wanted = np.append(fold.parameters["A0_nm"], extremes_of(fold))
    for i in np.flatnonzero(distance[1:] * distance[:-1] <= 0.0):
        share = distance[i] / (distance[i] - distance[i + 1]) if distance[i] != distance[i + 1] else 0.0
        between: NDArray[np.float64] = own[i] + share * (own[i + 1] - own[i])
        if np.allclose(between, wanted, rtol=_SAME):
            return True
    return False
