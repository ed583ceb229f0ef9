"""Sheets of a curve: those of given motions, those on which ways land, and those on which motions settle."""

from __future__ import annotations

import math
from collections.abc import Container, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from saltus.afm.curves.curve import Curve
from saltus.afm.curves.routes import Asked, Landing, landings_of, ways_of
from saltus.afm.models.parts import driven_mode, parts_of
from saltus.afm.models.readings import drives_of, turns_of
from saltus.afm.models.settling import (
    Known,
    described,
    periods_of_patience,
    settled_orbit,
    starts_about,
    stays_in_contact,
)
from saltus.afm.probe.units import suffix
from saltus.continuation import Branch, StepControl, continue_orbit
from saltus.continuation.branches import continue_until
from saltus.continuation.many.retracing import is_on, orbits_at
from saltus.continuation.many.way import is_interrupted
from saltus.continuation.results.sheets import stretches_of
from saltus.errors import ConvergenceError, SaltusError
from saltus.orbits import PeriodicOrbit, find_orbit, solve_orbit
from saltus.progress import Progress
from saltus.system.evaluate import evaluate

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.progress import Report
    from saltus.system import HybridSystem

__all__ = [
    "CLEAR",
    "CLEAR_NM",
    "STEPS",
    "UNSTABLE_FROM",
    "Tracing",
    "free_amplitude",
    "free_orbit",
    "reached",
    "sheet_again",
    "traced",
    "whole",
]

CLEAR = 3.0  # gap of the far start, over the free amplitude
_RESTS = 400  # displacements at which a rest of the probe is looked for
_MOST_SHEETS = 8  # sheets that are sought beyond the first ones
_GAP = 1e-3  # width of a gap between stable stretches, over the range, in which a motion is followed
_EIGHTHS = 8  # parts of the range, between which a motion is followed where no motion is stable
_TOUCHING = 1.2  # distance up to which a tip may touch, over the free amplitude
_DEEPEST = 2.0  # depth of indentation down to which a rest in contact is looked for, over the distance
_LONGEST = 4  # turns of the phase in the period of a motion whose sheet is followed, at most
UNSTABLE_FROM = ("SN", "PD", "TR", "BP")  # special points at which a branch's motions may lose their stability
STEPS = StepControl(pieces=32)  # steps where none are given; motions of more pieces are saddles, far from any motion
_INTERRUPTED = "interrupted: sheets may be missing"
CLEAR_NM = 20.0  # least gap of the far start, in nm
_SHARES = (0.15, 0.3, 0.45)  # distances at which motions start, over the free amplitude
_HALF_WIDTHS = (-2.0, 0.0, 2.0)  # frequencies at which motions start, from the resonance, in its half widths
_DRAWN = 0.5  # by how much a tip is drawn back, over the free amplitude


class Tracing(NamedTuple):
    """How sheets are traced: along what, over which range, with which steps, reported to whom."""

    along: str
    bounds: tuple[float, float]
    steps: StepControl | None
    progress: bool | Report


def traced(how: Tracing, starts: tuple[PeriodicOrbit, ...], of: str | int, places: int) -> Curve:
    """Return the curve of the sheets through some motions, of those that jumps lead to, and of settled motions.

    An interrupt keeps the sheets that were found. The curve tells it all along the range, as sheets may be missing.
    """
    found: list[Curve] = []
    try:
        found.extend(_ever_fuller(how, starts, of, places))
    except KeyboardInterrupt as interrupt:
        if isinstance(interrupt, _InterruptedBranch) and not found:
            found.append(Curve(starts[0].system, how.along, how.bounds, (interrupt.branch,), of))
        if not found:
            raise
        (low, high), curve = how.bounds, found[-1]
        told = tuple((low + k / _EIGHTHS * (high - low), _INTERRUPTED) for k in range(_EIGHTHS + 1))
        return replace(curve, failures=(*curve.failures, *told))
    return found[-1]


def _ever_fuller(how: Tracing, starts: tuple[PeriodicOrbit, ...], of: str | int, places: int) -> Iterator[Curve]:
    """Yield a curve again and again, each time with the sheets that were found in between."""
    curve = reached(how, starts, of)
    yield curve
    system, p, (low, high) = curve.system, curve.branches[0].parameters, how.bounds
    alike = _free_state(system, p) if how.along == "Zc_nm" else None

    def asked(curve: Curve, place: float) -> Curve:
        there = {**p, how.along: place}
        free = alike if how.along == "Zc_nm" else _free_state(system, there)
        return _with_asked(curve, how, place, _starts(system, there, free))

    for place in _asked_places(curve, how):
        yield (curve := asked(curve, place))
    yield (curve := _with_resonance(curve, how))
    for place in _uncovered(curve, [low + k / _EIGHTHS * (high - low) for k in range(1, _EIGHTHS)]):
        yield (curve := asked(curve, place))
    for k in range(places):
        place = low + (k + 0.5) / places * (high - low)
        yield (curve := _with_asked(curve, how, place, _everywhere(curve, {**p, how.along: place})))


def _asked_places(curve: Curve, how: Tracing) -> list[float]:
    """Return where motions start: both ends and the middle, and places in the range that do not depend on it."""
    (low, high), p = how.bounds, curve.branches[0].parameters
    free, end = free_amplitude(curve.system, p), suffix(driven_mode(curve.system))
    if how.along == "Zc_nm":
        begin, stop = max(low, 0.0), min(high, _TOUCHING * free)  # where a tip may touch and come off
        own = [share * free for share in _SHARES]
    else:
        begin, stop = low, high
        f0, width = p.get(f"f0_kHz{end}", low), 0.5 / p.get(f"Q{end}", 1.0)
        own = [f0 * (1.0 + k * width) for k in _HALF_WIDTHS]
    begin, stop = (begin, stop) if begin < stop else (low, high)
    return [high, low, 0.5 * (begin + stop), *(place for place in own if low < place < high)]


def reached(how: Tracing, starts: tuple[PeriodicOrbit, ...], of: str | int) -> Curve:
    """Return the curve of the sheets through some motions, and of those that jumps lead to."""
    branches: list[Branch] = []
    for start in starts:
        if not any(is_on(branch, start) for branch in branches):
            branches.append(_sheet(start, how))
    return _with_landings(Curve(starts[0].system, how.along, how.bounds, tuple(branches), of), how)


def _with_landings(curve: Curve, how: Tracing) -> Curve:
    """Return a curve with the sheets on which its ways land."""
    tried = set[tuple[float, float]]()
    for _ in range(_MOST_SHEETS):
        lost = _lost(curve, how, tried, windows=False) or _lost(curve, how, tried, windows=True)
        if not lost:
            return curve
        found = min(lost, key=lambda landing: (landing.window, landing.after.form.turns))
        tried.add(_place(found, how))
        curve = _with_sheet(curve, found.after, how)
    return curve


def _lost(curve: Curve, how: Tracing, tried: Container[tuple[float, float]], *, windows: bool) -> list[Landing]:
    """Return the landings of a curve's ways on motions that are on no sheet, and whose sheets were not yet sought."""
    if windows:
        _tell(how, "windows of other motions are passed")
    ways = curve.ways if windows else ways_of(curve.branches, curve.bounds, windows=False)
    landings = (one for way in ways for one in way.lost)
    return [one for one in landings if _is_traced(one.after, how) and _place(one, how) not in tried]


def _tell(how: Tracing, text: str) -> None:
    """Tell what begins, which takes long where motions do not settle."""
    if callable(how.progress):
        how.progress(Progress(0, None, 0.0, text))


def _place(landing: Landing, how: Tracing) -> tuple[float, float]:
    """Return where a motion was lost, and where it has landed."""
    return landing.value, landing.after.parameters[how.along]


def _with_resonance(curve: Curve, how: Tracing) -> Curve:
    """Return a curve along a frequency whose range is beside the resonance, with the sheet that comes from there."""
    p, (low, high) = curve.branches[0].parameters, how.bounds
    f0 = p.get(f"f0_kHz{suffix(driven_mode(curve.system))}", low)
    if how.along != "f_kHz" or low <= f0 <= high:
        return curve
    at = {**p, "f_kHz": f0}
    with suppress(SaltusError):  # a motion that does not settle leads nowhere
        start = find_orbit(curve.system, at, np.zeros(len(curve.system.states)), settle=periods_of_patience(at))
        way = whole(
            continue_orbit(start, "f_kHz", (min(low, f0), max(high, f0)), steps=how.steps or STEPS, stop_at="SN")
        )
        for orbit in (one for place in (low, high) for one in orbits_at(way, place)):
            if _is_traced(orbit, how) and not any(is_on(branch, orbit) for branch in curve.branches):
                curve = _with_landings(_with_sheet(curve, orbit, how), how)
    return curve


def _with_asked(curve: Curve, how: Tracing, place: float, starts: Sequence[_Start]) -> Curve:
    """Return a curve with the sheets of motions that settle at a place, and in words what the others do."""
    system, parameters = curve.system, {**curve.branches[0].parameters, how.along: place}
    here = [orbit for branch in curve.branches for orbit in orbits_at(branch, place)]
    known = [Known.of(orbit) for orbit in here if orbit.stable and orbit.admissible]
    told = []
    for start in starts:
        where = f"{how.along} = {place:.6g}, {start.words}"
        _tell(how, f"a motion settles at {where}")
        try:
            found = settled_orbit(system, parameters, start.x0, start.mode, known)
        except SaltusError as error:
            told.append((place, f"{where}: {error}"))
            continue
        if any(found is one.orbit for one in known):
            continue
        known.append(Known.of(found))
        if found.form.turns > _LONGEST:
            told.append((place, f"{where}: {described(found)}, whose sheet is not followed"))
        elif not any(is_on(branch, found) for branch in curve.branches):
            curve = _with_landings(_with_sheet(curve, found, how), how)
    return replace(curve, failures=(*curve.failures, *told))


def _free_state(system: HybridSystem, parameters: Mapping[str, float]) -> NDArray[np.float64] | None:
    """Return where the motion far from the sample starts; None where a law that reaches far leaves none."""
    free = free_amplitude(system, parameters)
    with suppress(SaltusError):
        return free_orbit(system, {**parameters, "Zc_nm": CLEAR * free + CLEAR_NM}, free).x0
    return None


class _Start(NamedTuple):
    """Where a motion starts: words, state, and the mode where the state does not decide."""

    words: str
    x0: NDArray[np.float64]
    mode: str | None = None


def _starts(system: HybridSystem, parameters: Mapping[str, float], free_x0: NDArray[np.float64] | None) -> list[_Start]:
    """Return initial states: rest, the free motion, the tip drawn back, and a rest in contact where there is one."""
    starts = [_Start("from rest", np.zeros(len(system.states)))]
    if free_x0 is not None:
        starts.append(_Start("from the free motion", free_x0))
    z = system.states.index("z1_nm")
    drawn = np.zeros(len(system.states))
    drawn[z] = _DRAWN * free_amplitude(system, parameters)
    starts.append(_Start(f"from the tip drawn back by {drawn[z]:.6g} nm", drawn))
    for mode in system.mode_names[1:2]:
        gaps = np.concatenate([-np.geomspace(_DEEPEST * max(abs(parameters["Zc_nm"]), 1.0), 1e-3, _RESTS), [0.0]])
        unbent = float(
            evaluate(system, "D_nm", np.zeros((1, len(system.all_states))), 1, parameters)[0]
        )  # a base moves
        bends = gaps - unbent
        missing = _missing(system, parameters, bends, 1)
        rests = np.flatnonzero((missing[:-1] > 0.0) & (missing[1:] <= 0.0))
        x0 = np.zeros(len(system.states))
        x0[z] = bends[rests[0]] if rests.size else -unbent
        starts.append(_Start("from contact", x0, mode))
    return starts


def _everywhere(curve: Curve, parameters: Mapping[str, float]) -> list[_Start]:
    """Return the initial states of `starts_about`, with the largest displacement of a curve."""
    z = curve.system.states.index("z1_nm")
    largest = max(float(np.abs([branch.lows[:, z], branch.highs[:, z]]).max()) for branch in curve.branches)
    states = starts_about(curve.system, parameters, largest)
    return [_Start(f"from start {k} of {len(states)}", x0) for k, x0 in enumerate(states, 1)]


def _with_sheet(curve: Curve, start: PeriodicOrbit, how: Tracing) -> Curve:
    """Return a curve with the sheet of a motion in place of those that lie on it."""
    sheet = _sheet(start, how)
    others = [branch for branch in curve.branches if not is_on(sheet, branch.solution(len(branch) // 2))]
    return replace(curve, branches=(*others, sheet))


def _is_traced(orbit: PeriodicOrbit, how: Tracing) -> bool:
    """Return whether a sheet is followed through a motion: it is stable, in the range, and has no long period."""
    inside = how.bounds[0] <= orbit.parameters[how.along] <= how.bounds[1]
    return inside and orbit.stable and orbit.form.turns <= _LONGEST


def _uncovered(curve: Curve, places: Sequence[float]) -> Iterator[float]:
    """Yield those of some places, then the middles of gaps without them, at which a curve has no stable motion."""
    (low, high), asked = curve.bounds, list(places)

    def covered() -> list[tuple[float, float]]:
        reached = (curve.branches[one.sheet].values[list(one.points)] for one in stretches_of(curve.branches))
        return sorted((float(values[0]), float(values[-1])) for values in reached)

    open_places = [place for place in asked if not any(begin <= place <= end for begin, end in covered())]
    yield from open_places
    reach = low
    for begin, end in [*covered(), (high, high)]:
        if begin - reach > _GAP * (high - low) and not any(reach <= place <= begin for place in open_places):
            yield 0.5 * (reach + begin)
        reach = max(reach, end)


def _sheet(start: PeriodicOrbit, how: Tracing) -> Branch:
    """Return the branch through a motion; it ends at its first fold if this is the static pull-in.

    Beyond the static pull-in the branch is that of a static saddle, whose multipliers cost much and tell nothing. The
    same is a saddle in the well of a force without a contact, where `STEPS` end the branch. A
    motion of several turns of the phase is followed as long as it is stable: its branch goes on for long.
    """
    along, bounds, given, progress = how
    steps = given or STEPS
    if start.form.turns > 1 or (along == "Zc_nm" and stays_in_contact(start)):
        return whole(continue_orbit(start, along, bounds, steps=steps, stop_at=UNSTABLE_FROM, progress=progress))
    if along != "Zc_nm" or not _has_rest(start, bounds[0]):
        return _over_folds(start, how, steps)
    return whole(continue_orbit(start, along, bounds, steps=steps, progress=progress))


def _over_folds(start: PeriodicOrbit, how: Tracing, steps: StepControl) -> Branch:
    """Return the branch through a motion; both its directions end at their first folds if one is the static pull-in."""
    along, bounds, _, progress = how
    known: dict[Asked, Landing | str] = {}
    pulled: dict[float, bool] = {}  # of each direction that has come to a fold

    def until(fold: PeriodicOrbit, way: float) -> bool:
        if way not in pulled and not any(pulled.values()):
            asked = Asked.beyond(along, fold, way * (bounds[1] - bounds[0]))
            known[asked] = landing = asked.landing(fold)
            pulled[way] = isinstance(landing, Landing) and stays_in_contact(landing.after)
        return any(pulled.values())

    sheet = whole(continue_until(start, along, bounds, until, steps=steps, progress=progress))
    if pulled.get(1.0) and not pulled.get(-1.0, True):  # the direction that was followed first went over its fold
        sheet = whole(continue_orbit(start, along, bounds, steps=steps, stop_at="SN", progress=progress))
    elif not pulled or any(pulled.values()):
        sheet = replace(sheet, options={**sheet.options, "stop_at": ["SN"]})
    landings_of(sheet).update(known)
    return sheet


def sheet_again(start: PeriodicOrbit, known: Branch, how: Tracing) -> Branch:
    """Return the branch through a motion, at other parameters than one known that goes over all its folds."""
    if known.options["stop_at"] or start.form.turns > 1:
        return _sheet(start, how)
    return whole(continue_orbit(start, how.along, how.bounds, steps=how.steps or STEPS, progress=how.progress))


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
    softness = sum(1.0 / parameters[f"k_N_m{suffix(i)}"] for i in range(1, parts_of(system).probe.modes + 1))
    states = np.zeros((len(bends), len(system.all_states)))
    states[:, 0] = bends
    return np.asarray(evaluate(system, "force_nN", states, mode, parameters) * softness - bends)


def free_orbit(system: HybridSystem, parameters: Mapping[str, float], free: float) -> PeriodicOrbit:
    """Return the motion far from the sample, from a guess with an amplitude of that size."""
    first, x0 = system.mode_names[0], np.zeros(len(system.states))
    x0[system.states.index(f"v{driven_mode(system)}_nm_us")] = 2e-3 * math.pi * parameters["f_kHz"] * free
    assert system.phase is not None
    period = 1e3 * turns_of(system) / parameters["f_kHz"]
    try:
        return solve_orbit(system, parameters, [(first, system.phase[0], x0, period)])
    except ConvergenceError:
        return find_orbit(system, parameters, x0, settle=periods_of_patience(parameters))


def free_amplitude(system: HybridSystem, parameters: Mapping[str, float]) -> float:
    """Return the sum of the drives' amplitudes at resonance, in nm: no free motion is larger."""
    total, stiffness, quality = 0.0, parameters["k_N_m"], parameters["Q"]
    for number in drives_of(system):
        end = suffix(number)
        total += abs(parameters.get(f"A0_nm{end}", 0.0))
        total += abs(parameters.get(f"F0_nN{end}", 0.0)) / stiffness * max(quality, 1.0)
        dragged = parts_of(system).drives.parts[number - 1].fluid == "rests"
        total += abs(parameters.get(f"Y_nm{end}", 0.0)) * (1.0 + 1.6 * (max(quality, 1.0) + dragged))
    return total


def whole(branch: Branch) -> Branch:
    """Return a branch; pass on the interrupt that ended it, as no way is known on a part of a curve."""
    if is_interrupted(branch):
        raise _InterruptedBranch(branch)
    return branch


class _InterruptedBranch(KeyboardInterrupt):
    """An interrupt that ended a branch, with the part that was followed."""

    def __init__(self, branch: Branch) -> None:
        super().__init__()
        self.branch = branch
