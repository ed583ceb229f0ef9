"""Distance curves and frequency curves of a model, from afar over all folds."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from saltus import checks
from saltus.afm.curve import Curve
from saltus.afm.modelling import driven_mode, frequency_of, suffix
from saltus.afm.readings import drives_of, formulas, turns_of
from saltus.afm.routes import is_pulled_in
from saltus.afm.settling import periods_of_patience, settled, settled_orbit, starts_about, stays_in_contact
from saltus.afm.units import check_changes
from saltus.continuation import Branch, StepControl, continue_orbit
from saltus.continuation.way import is_interrupted
from saltus.errors import ConvergenceError, SaltusError
from saltus.fitting.sheets import stretches_of
from saltus.fitting.tracing import is_on, orbits_at
from saltus.orbits import PeriodicOrbit, find_orbit, solve_orbit
from saltus.system.evaluate import evaluate

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.progress import Report
    from saltus.system import HybridSystem

__all__ = ["Tracing", "distance_curve", "frequency_curve", "from_afar", "jumps_on_approach", "sheet_again"]

_CLEAR = 3.0  # gap of the far start, over the free amplitude
_RESTS = 400  # displacements at which a rest of the probe is looked for
_MOST_SHEETS = 8  # sheets that are sought beyond the first ones
_EIGHTHS = 8  # parts of the range, between which a motion is followed where no motion is stable
_TOUCHING = 1.2  # distance up to which a tip may touch, over the free amplitude
_ONE = slice(1, 2)  # which of the starts: the tip drawn back by half of the largest displacement
_DEEPEST = 2.0  # depth of indentation down to which a rest in contact is looked for, over the distance
_LONGEST = 4  # turns of the phase in the period of a motion whose sheet is followed, at most
_UNSTABLE_FROM = ("SN", "PD", "TR", "BP")  # special points at which a branch's motions may lose their stability
_STEPS = StepControl(pieces=32)  # steps where none are given; motions of more pieces are saddles, far from any motion
_ROUNDING = 1e-12  # distance from the end of a way, over its begin, that is rounding
_CLEAR_NM = 20.0  # least gap of the far start, in nm


def distance_curve(
    system: HybridSystem,
    bounds: tuple[float, float],
    *,
    f_kHz: float | str | None = None,
    parameters: Mapping[str, float] | None = None,
    of: str | int = "deflection",
    steps: StepControl | None = None,
    starts: int = 0,
    progress: bool | Report = False,
) -> Curve:
    """Return the readings of a model along the distance ``Zc_nm``, from afar over all folds.

    The free motion far from the sample is followed towards it. Where the ways of an experiment jump to a motion that
    the branch does not have, this motion is followed as a further sheet. A curve whose way ends because the tip is
    pulled in and stays in contact says so.

    A sheet onto which no way jumps is found by motions that settle on it. At both ends of the range and in the middle
    they start from rest, with the free motion, and in contact. One more starts with the tip drawn back by half of the
    largest displacement. So does one at each eighth of the range where the curve has no stable motion. `starts` asks
    for more. A sheet that no motion settles on is missed, as is one of more than four periods.

    Parameters
    ----------
    system : HybridSystem
        A model of `saltus.afm.model`.
    bounds : (float, float)
        The range of ``Zc_nm``, in nm; below 0 the cantilever is pressed into the sample.
    f_kHz : float or {"f0", "peak"}, optional
        Frequency of the first drive; by default the model's.
    parameters : mapping of str to float, optional
        Parameters that differ from the model's.
    of : {"deflection", "tip"} or int, optional
        Of what amplitude and lag are told, as `saltus.afm.observables` takes it.
    steps : StepControl, optional
        Sizes of steps and their limits.
    starts : int, optional
        Places, in equal distances, at each of which motions from 17 starts are followed as well, as
        `saltus afm observe` does. Each place takes as long as some curves: 0.2 to 4 s.
    progress : bool or callable, optional
        True for a bar on stderr, or a function of a `saltus.Progress`.

    Returns
    -------
    Curve

    Raises
    ------
    InputError
        The system is no such model, or a value is not allowed.
    ConvergenceError
        No motion is found at the upper end.

    Examples
    --------
    >>> from saltus import afm
    >>> probe = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
    >>> law = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5)
    >>> system = afm.model(probe, law, afm.Drive(A0_nm=12.0), Zc_nm=20.0)
    >>> curve = distance_curve(system, (5.0, 14.0))
    >>> for jump in curve.jumps:
    ...     print(f"{jump.direction} at {jump.value:.4f} nm: {jump.before_nm:.3f} to {jump.after_nm:.3f} nm")
    approach at 9.8783 nm: 9.847 to 10.600 nm
    retract at 11.5029 nm: 11.986 to 11.188 nm
    >>> [round(afm.observables(orbit)["amplitude_nm"], 5) for orbit in curve.at(Zc_nm=10.0)]
    [10.7157, 10.04805, 9.89528]
    """
    formulas(system, of)  # raises where it cannot be told
    low, high = checks.interval("bounds", bounds)
    p = _at_frequency(system, system.resolve(parameters), f_kHz)
    check_changes(system.parameters, p | {"Zc_nm": max(low, high, key=abs)})
    checks.count("starts", starts, 0)
    first = from_afar(system, p, high, steps)
    return _traced(Tracing("Zc_nm", (low, high), steps, progress), first, of, starts)


def frequency_curve(
    system: HybridSystem,
    bounds: tuple[float, float],
    *,
    Zc_nm: float | None = None,
    parameters: Mapping[str, float] | None = None,
    of: str | int = "deflection",
    steps: StepControl | None = None,
    starts: int = 0,
    progress: bool | Report = False,
) -> Curve:
    """Return the readings of a model along the frequency ``f_kHz`` of its first drive, over all folds.

    The motion at the lower end of the range is reached from afar. Further sheets are found as `distance_curve` does. If
    the range is beside the resonance, the motion there is followed to the range. The way down begins where a tip
    at rest settles at the upper end.

    Parameters
    ----------
    system : HybridSystem
        A model of `saltus.afm.model`.
    bounds : (float, float)
        The range of ``f_kHz``, in kHz.
    Zc_nm : float, optional
        Distance, in nm; by default the model's.
    parameters : mapping of str to float, optional
        Parameters that differ from the model's.
    of, steps, starts, progress : optional
        As `distance_curve` takes them.

    Returns
    -------
    Curve

    Raises
    ------
    InputError
        The system is no such model, or a value is not allowed.
    ConvergenceError
        No motion is found at the lower end.

    Examples
    --------
    >>> from saltus import afm
    >>> probe = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
    >>> law = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5)
    >>> system = afm.model(probe, law, afm.Drive(A0_nm=12.0), Zc_nm=8.5)
    >>> tune = frequency_curve(system, (298.0, 302.0))
    >>> [f"{jump.direction} at {jump.value:.4f} kHz" for jump in tune.jumps]
    ['down at 300.0501 kHz', 'down at 299.2872 kHz', 'up at 299.4915 kHz']
    """
    formulas(system, of)  # raises where it cannot be told
    low, high = checks.interval("bounds", bounds)
    p = system.resolve(parameters) | ({} if Zc_nm is None else {"Zc_nm": Zc_nm})
    p |= {"f_kHz": low}
    check_changes(system.parameters, p | {"f_kHz": high})
    checks.count("starts", starts, 0)
    first = from_afar(system, p, p["Zc_nm"], steps)
    return _traced(Tracing("f_kHz", (low, high), steps, progress), first, of, starts)


def from_afar(
    system: HybridSystem, parameters: Mapping[str, float], Zc_nm: float, steps: StepControl | None
) -> tuple[PeriodicOrbit, ...]:
    """Return the motions at a distance to which the free motion afar leads, towards the sample."""
    steps = steps or _STEPS
    patience = periods_of_patience(parameters)
    free = _free_amplitude(system, parameters)
    far = max(Zc_nm, _CLEAR * free, free + _CLEAR_NM)
    start = _free_orbit(system, dict(parameters) | {"Zc_nm": far}, free)
    if far == Zc_nm:
        return (start,)
    branch = _whole(continue_orbit(start, "Zc_nm", (Zc_nm, far), steps=steps, directions="down", stop_at="SN"))
    folds = branch.special_points.of_type("SN")
    if folds and is_pulled_in(branch, folds[0], (Zc_nm, far)):
        return (find_orbit(system, {**parameters, "Zc_nm": Zc_nm}, folds[0].orbit.x0, settle=patience),)
    if folds:
        branch = _whole(continue_orbit(start, "Zc_nm", (Zc_nm, far), steps=steps, directions="down"))
    end = float(branch.values.min())
    if abs(end - Zc_nm) <= _ROUNDING * far:
        return branch.at(end)
    if end > Zc_nm:  # it ends where a hysteretic law is met: beyond, the motion is another
        return (find_orbit(system, {**parameters, "Zc_nm": Zc_nm}, branch.orbit(-1).x0, settle=patience),)
    return branch.at(Zc_nm)


def jumps_on_approach(
    system: HybridSystem, parameters: Mapping[str, float], Zc_nm: tuple[float, float], steps: StepControl | None
) -> bool:
    """Return whether an approach from afar jumps in a range of distance."""
    how = Tracing("Zc_nm", Zc_nm, steps, progress=False)
    curve = _reached(how, from_afar(system, parameters, Zc_nm[1], steps), "deflection")
    return any(jump.direction == curve.directions[0] for jump in curve.jumps)


def _free_orbit(system: HybridSystem, parameters: Mapping[str, float], free: float) -> PeriodicOrbit:
    """Return the motion far from the sample, from a guess with an amplitude of that size."""
    first, x0 = system.mode_names[0], np.zeros(len(system.states))
    x0[system.states.index(f"v{driven_mode(system)}_nm_us")] = 2e-3 * math.pi * parameters["f_kHz"] * free
    assert system.phase is not None
    period = 1e3 * turns_of(system) / parameters["f_kHz"]
    try:
        return solve_orbit(system, parameters, [(first, system.phase[0], x0, period)])
    except ConvergenceError:
        return find_orbit(system, parameters, x0, settle=periods_of_patience(parameters))


def _free_amplitude(system: HybridSystem, parameters: Mapping[str, float]) -> float:
    """Return the sum of the drives' amplitudes at resonance, in nm: no free motion is larger."""
    total, stiffness, quality = 0.0, parameters["k_N_m"], parameters["Q"]
    for number in drives_of(system):
        end = suffix(number)
        total += abs(parameters.get(f"A0_nm{end}", 0.0))
        total += abs(parameters.get(f"F0_nN{end}", 0.0)) / stiffness * max(quality, 1.0)
        total += abs(parameters.get(f"Y_nm{end}", 0.0)) * (1.0 + 1.6 * max(quality, 1.0))
    return total


def _at_frequency(system: HybridSystem, p: dict[str, float], f_kHz: float | str | None) -> dict[str, float]:
    if f_kHz is None:
        return p
    end = suffix(driven_mode(system))
    return p | {"f_kHz": checks.positive("f_kHz", frequency_of(f_kHz, p[f"f0_kHz{end}"], p[f"Q{end}"]), "kHz")}


class Tracing(NamedTuple):
    """How sheets are traced: along what, over which range, with which steps, reported to whom."""

    along: str
    bounds: tuple[float, float]
    steps: StepControl | None
    progress: bool | Report


def _traced(how: Tracing, starts: tuple[PeriodicOrbit, ...], of: str | int, places: int) -> Curve:
    """Return the curve of the sheets through some motions, of those that jumps lead to, and of settled motions."""
    curve = _reached(how, starts, of)
    low, high = how.bounds
    begin, end = _tapping_range(curve, how)
    for place in (high, low, 0.5 * (begin + end)):
        curve = _with_asked(curve, how, place)
    curve = _with_settled(_with_resonance(curve, how), how, begin + (end - begin) / _EIGHTHS, _ONE)
    for k in range(1, _EIGHTHS):
        place = low + k / _EIGHTHS * (high - low)
        if not _is_covered(curve, place):
            curve = _with_settled(curve, how, place, _ONE)
    for k in range(places):
        curve = _with_settled(curve, how, low + (k + 0.5) / places * (high - low), slice(None))
    return curve


def _reached(how: Tracing, starts: tuple[PeriodicOrbit, ...], of: str | int) -> Curve:
    """Return the curve of the sheets through some motions, and of those that jumps lead to."""
    branches: list[Branch] = []
    for start in starts:
        if not any(is_on(branch, start) for branch in branches):
            branches.append(_sheet(start, how))
    return _with_landings(Curve(starts[0].system, how.along, how.bounds, tuple(branches), of), how)


def _with_landings(curve: Curve, how: Tracing) -> Curve:
    """Return a curve with the sheets on which its ways land."""
    tried = set[float]()
    for _ in range(_MOST_SHEETS):
        lost = [way.beyond for way in curve.ways if way.beyond is not None and way.beyond.value not in tried]
        found = next((landing for landing in lost if _is_traced(landing.after, how)), None)
        if found is None:
            return curve
        tried.add(found.value)
        curve = _with_sheet(curve, found.after, how)
    return curve


def _with_settled(curve: Curve, how: Tracing, place: float, which: slice) -> Curve:
    """Return a curve with the sheets on which motions settle that start at a place, from some of the starts there."""
    parameters = {**curve.branches[0].orbit(0).parameters, how.along: place}
    z = curve.system.states.index("z1_nm")
    largest = max(float(np.abs([branch.lows[:, z], branch.highs[:, z]]).max()) for branch in curve.branches)
    for x0 in starts_about(curve.system, parameters, largest)[which]:
        found = settled(curve.system, parameters, x0)
        if isinstance(found, str) or not _is_traced(found, how):
            continue
        if not any(is_on(branch, found) for branch in curve.branches):
            curve = _with_landings(_with_sheet(curve, found, how), how)
    return curve


def _tapping_range(curve: Curve, how: Tracing) -> tuple[float, float]:
    """Return the part of a range of distance in which a tip may touch and come off; the whole where it has none."""
    low, high = how.bounds
    free = _free_amplitude(curve.system, curve.branches[0].parameters)
    begin, end = max(low, 0.0), min(high, _TOUCHING * free)
    return (begin, end) if how.along == "Zc_nm" and begin < end else (low, high)


def _with_resonance(curve: Curve, how: Tracing) -> Curve:
    """Return a curve along a frequency whose range is beside the resonance, with the sheet that comes from there."""
    p, (low, high) = curve.branches[0].orbit(0).parameters, how.bounds
    f0 = p.get(f"f0_kHz{suffix(driven_mode(curve.system))}", low)
    if how.along != "f_kHz" or low <= f0 <= high:
        return curve
    at = {**p, "f_kHz": f0}
    with suppress(SaltusError):  # a motion that does not settle leads nowhere
        start = find_orbit(curve.system, at, np.zeros(len(curve.system.states)), settle=periods_of_patience(at))
        way = _whole(
            continue_orbit(start, "f_kHz", (min(low, f0), max(high, f0)), steps=how.steps or _STEPS, stop_at="SN")
        )
        for orbit in (one for place in (low, high) for one in orbits_at(way, place)):
            if _is_traced(orbit, how) and not any(is_on(branch, orbit) for branch in curve.branches):
                curve = _with_landings(_with_sheet(curve, orbit, how), how)
    return curve


def _with_asked(curve: Curve, how: Tracing, place: float) -> Curve:
    """Return a curve with the sheets of motions that settle at a place from rest, the free motion, and contact."""
    parameters = {**curve.branches[0].orbit(0).parameters, how.along: place}
    found = list[PeriodicOrbit]()
    for x0, mode in _starts(curve.system, parameters):
        with suppress(SaltusError):  # a motion that does not settle has no sheet
            found.append(settled_orbit(curve.system, parameters, x0, mode))
    for orbit in found:
        if _is_traced(orbit, how, held=True) and not any(is_on(branch, orbit) for branch in curve.branches):
            curve = _with_landings(_with_sheet(curve, orbit, how), how)
    return curve


def _starts(system: HybridSystem, parameters: Mapping[str, float]) -> list[tuple[NDArray[np.float64], str | None]]:
    """Return initial states and modes: rest, the free motion, and a rest in contact where there is one."""
    starts: list[tuple[NDArray[np.float64], str | None]] = [(np.zeros(len(system.states)), None)]
    free = _free_amplitude(system, parameters)
    with suppress(SaltusError):
        far = {**parameters, "Zc_nm": _CLEAR * free + _CLEAR_NM}
        starts.append((_free_orbit(system, far, free).x0, None))
    for mode in system.mode_names[1:2]:
        gaps = np.concatenate([-np.geomspace(_DEEPEST * max(abs(parameters["Zc_nm"]), 1.0), 1e-3, _RESTS), [0.0]])
        bends = gaps - parameters["Zc_nm"]
        missing = _missing(system, parameters, bends, 1)
        rests = np.flatnonzero((missing[:-1] > 0.0) & (missing[1:] <= 0.0))
        x0 = np.zeros(len(system.states))
        x0[system.states.index("z1_nm")] = bends[rests[0]] if rests.size else -parameters["Zc_nm"]
        starts.append((x0, mode))
    return starts


def _with_sheet(curve: Curve, start: PeriodicOrbit, how: Tracing) -> Curve:
    """Return a curve with the sheet of a motion in place of those that lie on it."""
    sheet = _sheet(start, how)
    others = [branch for branch in curve.branches if not is_on(sheet, branch.orbit(len(branch) // 2))]
    return Curve(curve.system, how.along, how.bounds, (*others, sheet), curve.of)


def _is_traced(orbit: PeriodicOrbit, how: Tracing, *, held: bool = False) -> bool:
    """Return whether a sheet is followed through a motion: it is stable, in the range, and has no long period.

    A distance curve ends where a way is pulled in; it has motions that stay in contact only if they are asked for.
    """
    inside = how.bounds[0] <= orbit.parameters[how.along] <= how.bounds[1]
    held = held or how.along != "Zc_nm" or not stays_in_contact(orbit)
    return inside and orbit.stable and orbit.form.turns <= _LONGEST and held


def _is_covered(curve: Curve, place: float) -> bool:
    """Return whether a curve has a stable motion at a place."""
    reached = (curve.branches[stretch.sheet].values[list(stretch.points)] for stretch in stretches_of(curve.branches))
    return any(float(values[0]) <= place <= float(values[-1]) for values in reached)


def _sheet(start: PeriodicOrbit, how: Tracing) -> Branch:
    """Return the branch through a motion; it ends at its first fold if this is the static pull-in.

    Beyond the static pull-in the branch is that of a static saddle, whose multipliers cost much and tell nothing. The
    same is a saddle in the well of a force without a contact, where `_STEPS` end the branch. A
    motion of several turns of the phase is followed as long as it is stable: its branch goes on for long.
    """
    along, bounds, given, progress = how
    steps = given or _STEPS
    if start.form.turns > 1 or (along == "Zc_nm" and stays_in_contact(start)):
        return _whole(continue_orbit(start, along, bounds, steps=steps, stop_at=_UNSTABLE_FROM, progress=progress))
    if along != "Zc_nm" or not _has_rest(start, bounds[0]):
        first = _whole(continue_orbit(start, along, bounds, steps=steps, stop_at="SN", progress=progress))
        folds = first.special_points.of_type("SN")
        if not folds or any(is_pulled_in(first, fold, bounds) for fold in folds):
            return first
    return _whole(continue_orbit(start, along, bounds, steps=steps, progress=progress))


def sheet_again(start: PeriodicOrbit, known: Branch, how: Tracing) -> Branch:
    """Return the branch through a motion, at other parameters than one known that goes over all its folds."""
    if known.options["stop_at"] or start.form.turns > 1:
        return _sheet(start, how)
    return _whole(continue_orbit(start, how.along, how.bounds, steps=how.steps or _STEPS, progress=how.progress))


def _has_rest(orbit: PeriodicOrbit, Zc_nm: float) -> bool:
    """Return whether a probe at a distance has a rest in the first mode, so that nothing has pulled it in before."""
    system, parameters = orbit.system, {**orbit.parameters, "Zc_nm": Zc_nm}
    bends = np.linspace(-1.0, 0.0, _RESTS) * max(abs(Zc_nm), 1.0)
    missing = np.where(bends + Zc_nm > 0.0, _missing(system, parameters, bends, 0), np.nan)
    return bool(np.any((missing[:-1] > 0.0) & (missing[1:] < 0.0)))


def _missing(
    system: HybridSystem, parameters: Mapping[str, float], bends: NDArray[np.float64], mode: int
) -> NDArray[np.float64]:
    """Return by how much the tip's force in a mode would bend the probe more than it is bent; at a rest by nothing."""
    modes = [name for name in system.states if name.startswith("z")]
    softness = sum(1.0 / parameters[f"k_N_m{suffix(i)}"] for i in range(1, len(modes) + 1))
    states = np.zeros((len(bends), len(system.all_states)))
    states[:, 0] = bends
    return np.asarray(evaluate(system, "force_nN", states, mode, parameters) * softness - bends)


def _whole(branch: Branch) -> Branch:
    """Return a branch; pass on the interrupt that ended it, as no way is known on a part of a curve."""
    if is_interrupted(branch):
        raise KeyboardInterrupt
    return branch
