"""The ways that an experiment takes along the sheets of a curve: stable stretches, and jumps between them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from saltus.afm.curves.windows import Window, carried_on
from saltus.afm.models.parts import driven_mode
from saltus.afm.models.settling import described, settled, stays_in_contact
from saltus.afm.probe.units import suffix
from saltus.continuation import Branch, SpecialPoint
from saltus.continuation.many.retracing import orbits_at
from saltus.continuation.results.crossings import extremes_of
from saltus.continuation.results.sheets import Stretch, stretches_of
from saltus.errors import ConvergenceError
from saltus.orbits import PeriodicOrbit

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Asked", "Landing", "Way", "landings_of", "ways_of"]

_BEYOND = (1e-3, 1e-2)  # shares of `_scale` by which a motion is moved beyond a fold; next to it nothing settles soon
_WIDTHS = 10.0  # scale along the frequency, in widths of the resonance
_SAME = 1e-4  # distance of extremes, over the largest one, up to which a settled motion is on a sheet
_MOST_JUMPS = 50  # jumps on a way, at most
_DOUBLED = 0.1  # difference of extremes just beyond a period doubling, over the largest one, that is no jump
_ROUNDING = 1e-12  # difference of parameters, relative, that is rounding
_END = 1e-9  # distance from the end of the range, over the range, that is rounding


class Landing(NamedTuple):
    """Where a stable stretch ends, and where a motion settles that starts just beyond."""

    value: float  # the parameter
    before: PeriodicOrbit  # the last motion of the stretch
    after: PeriodicOrbit  # the motion that settles
    window: bool = False  # whether other motions lie between them


@dataclass
class Way:
    """The way of an experiment."""

    points: list[tuple[int, int]] = field(default_factory=list)  # sheet and point, in order
    first_behind: list[int] = field(default_factory=list)  # places in `points` of the first ones behind a jump
    jumps: list[Landing] = field(default_factory=list)
    windows: list[Window] = field(default_factory=list)  # parts without a motion that is followed
    lost: list[Landing] = field(default_factory=list)  # motions on no sheet on which it lands
    stopped: str = ""  # why the way ends


def _told(orbit: PeriodicOrbit) -> str:
    if stays_in_contact(orbit):
        pulled = "static pull-in: " if orbit.min["elastic_nN"] < 0.0 else ""
        return f"{pulled}beyond, the tip stays in {' and '.join(dict.fromkeys(m for m, _ in orbit.signature))}"
    return f"the motion settles on no sheet of the curve, but on {described(orbit)}"


def ways_of(branches: Sequence[Branch], bounds: tuple[float, float], *, windows: bool = True) -> tuple[Way, Way]:
    """Return the ways of an experiment through the parameter's range, to lower and to higher values.

    Parameters
    ----------
    branches : sequence of Branch
        The sheets.
    bounds : (float, float)
        The parameter's range.
    windows : bool, optional
        Whether they go on behind windows without a followed motion, which takes long; else they end there.
    """
    down = _way_along(branches, -1.0, bounds, None, windows)
    through = "end of the range" in down.stopped
    return down, _way_along(branches, 1.0, bounds, down.points[-1] if through else None, windows)


def _way_along(
    branches: Sequence[Branch], sign: float, bounds: tuple[float, float], start: tuple[int, int] | None, windows: bool
) -> Way:
    """Return the way of an experiment through the parameter's range.

    Parameters
    ----------
    branches : sequence of Branch
        The sheets.
    sign : {1.0, -1.0}
        Whether the parameter grows or falls.
    bounds : (float, float)
        The parameter's range.
    start : (int, int), optional
        Sheet and point where the way begins; by default the stable motion nearest to the end of the range.
    windows : bool
        As `ways_of` takes it.
    """
    way, stretches = Way(), stretches_of(branches)
    name, span, end = branches[0].parameter, bounds[1] - bounds[0], bounds[1 if sign > 0.0 else 0]

    def reach(stretch: Stretch, *, last: bool) -> float:
        return float(branches[stretch.sheet].values[stretch.points[-1 if last == (sign > 0.0) else 0]])

    if not stretches:
        way.stopped = "no sheet is stable"
        return way
    own = [
        stretch
        for stretch in stretches
        if start is not None and start[0] == stretch.sheet and start[1] in stretch.points
    ]
    if own:
        here = own[0]
    else:
        here = min(stretches, key=lambda stretch: sign * reach(stretch, last=False))
        others = [one for one in stretches if abs(reach(one, last=False) - reach(here, last=False)) <= _END * span]
        if name == "f_kHz" and len(others) > 1:
            here = _from_rest(branches, others, reach(here, last=False)) or here
    begin = -np.inf
    while True:
        order = here.points if sign > 0.0 else here.points[::-1]
        way.points += [(here.sheet, i) for i in order if sign * branches[here.sheet].values[i] >= begin]
        if abs(reach(here, last=True) - end) <= _END * span:
            held = _held_in(branches[here.sheet], order[-1])
            way.stopped = f"{name} = {end:.9g}: the end of the range{held and f'; the tip stays in {held}'}"
            return way
        if len(way.jumps) >= _MOST_JUMPS:
            way.stopped = f"{name} = {reach(here, last=True):.9g}: no more than {_MOST_JUMPS} jumps are followed"
            return way
        landing = _landing(branches[here.sheet], here, sign, span)
        others = [one for one in stretches if one != here]
        target = None if isinstance(landing, str) else _target(branches, others, landing.after)
        if target is None:
            told = _ended(way, branches[here.sheet], here, landing, sign)
            passed = _passed(way, branches, others, here, told, sign, bounds) if windows else None
            if passed is None:
                return way
            target, landing = passed
            way.jumps.append(landing)
            way.first_behind.append(len(way.points))
            here, begin = target, sign * landing.after.parameters[name]
            continue
        assert not isinstance(landing, str)
        if not _is_doubled(landing):
            way.jumps.append(landing._replace(after=_at_the_end(branches[target.sheet], landing)))
            way.first_behind.append(len(way.points))
        here, begin = target, sign * landing.value


def _ended(way: Way, branch: Branch, here: Stretch, landing: Landing | str, sign: float) -> str:
    """Say why a way ends behind a stretch, keep the motion on no sheet, and return what it is in words."""
    if isinstance(landing, Landing):
        told = _told(landing.after)
        kind = f"other motions, first {described(landing.after).split(':')[0]}"
        way.lost.append(landing)
    else:
        kind = told = landing.split(": ", 1)[-1]
    way.stopped = f"{branch.parameter} = {_end_of(branch, here, sign)[1]:.9g}: {told}"
    return kind


def _passed(
    way: Way,
    branches: Sequence[Branch],
    stretches: Sequence[Stretch],
    here: Stretch,
    kind: str,
    sign: float,
    bounds: tuple[float, float],
) -> tuple[Stretch, Landing] | None:
    """Return the stretch that is met behind a window of such motions, and where; None where none is met."""
    branch = branches[here.sheet]
    name, span, end = branch.parameter, bounds[1] - bounds[0], bounds[1 if sign > 0.0 else 0]
    last, value = _end_of(branch, here, sign)
    if last is None:
        return None
    nearest = value
    for orbit in carried_on(branch, value, last, end, span):
        place = orbit.parameters[name]
        target = _target(branches, stretches, orbit)
        if target is None:
            way.lost.append(Landing(value, last, orbit, window=True))
            nearest = place
            continue
        reached, met = _begin_of(branches[target.sheet], target, sign, (nearest, orbit))
        way.stopped = ""
        way.windows.append(Window(value, met, kind))
        return target, Landing(value, last, reached, window=True)
    return None


def _end_of(branch: Branch, stretch: Stretch, sign: float) -> tuple[PeriodicOrbit | None, float]:
    """Return the last motion of a stretch in a direction, None where it is not known, and the parameter there."""
    last = stretch.points[-1 if sign > 0.0 else 0]
    value = float(branch.values[last])
    ahead = [point for point in _beside(branch, last) if sign * (point.value(branch.parameter) - value) >= 0.0]
    if ahead:
        first = min(ahead, key=lambda point: abs(point.arclength - branch.arclength[last]))
        return first.orbit, first.value(branch.parameter)
    try:
        return branch.solution(last), value
    except ConvergenceError:
        return None, value


def _beside(branch: Branch, point: int) -> list[SpecialPoint]:
    """Return the special points between a point of a branch and its neighbours."""
    return [special for special in branch.special_points if abs(special.position - point) <= 1.0]


def _begin_of(
    branch: Branch, stretch: Stretch, sign: float, met: tuple[float, PeriodicOrbit]
) -> tuple[PeriodicOrbit, float]:
    """Return the first motion of a stretch where it begins behind the place before, and else the one that was met."""
    before, orbit = met
    place = orbit.parameters[branch.parameter]
    first, begins = _end_of(branch, stretch, -sign)
    if first is not None and sign * (begins - before) > 0.0 and sign * (place - begins) > 0.0:
        return first, begins
    return orbit, place


def _from_rest(branches: Sequence[Branch], stretches: Sequence[Stretch], value: float) -> Stretch | None:
    """Return the stretch on which a tip at rest settles, of several at the end of a range; None where it is on none."""
    branch = branches[stretches[0].sheet]
    at = {**branch.solution(stretches[0].points[0]).parameters, branch.parameter: value}
    found = settled(branch.system, at, np.zeros(len(branch.system.states)))
    return None if isinstance(found, str) else _target(branches, stretches, found)


def _is_doubled(landing: Landing) -> bool:
    """Return whether a motion goes on with twice the period and nearly the same extremes: nothing jumps."""
    before, after = extremes_of(landing.before), extremes_of(landing.after)
    doubled = landing.after.form.turns == 2 * landing.before.form.turns
    return doubled and float(np.abs(after - before).max()) <= _DOUBLED * float(np.abs(before).max())


def _held_in(branch: Branch, point: int) -> str:
    """Return the modes in which the tip stays at a point, or nothing where it comes off."""
    modes = dict.fromkeys(branch.forms[branch.form[point]].modes)
    return "" if 0 in modes else " and ".join(branch.system.mode_names[mode] for mode in modes)


def _landing(branch: Branch, stretch: Stretch, sign: float, span: float) -> Landing | str:
    """Return where a motion settles beyond the end of a stable stretch, or what it does instead."""
    before, value = _end_of(branch, stretch, sign)
    if before is None:
        return f"{branch.parameter} = {value:.9g}: the orbit at its point cannot be found again"
    asked, known = Asked.beyond(branch.parameter, before, sign * span, value), landings_of(branch)
    if asked not in known:
        known[asked] = asked.landing(before)
    return known[asked]


class Asked(NamedTuple):
    """Where beyond the end of a stretch a motion is to settle."""

    parameter: str
    value: float  # the parameter at the end
    scale: float  # over which difference of it motions change, with the sign of the way
    x0: bytes  # the state at the end

    @classmethod
    def beyond(cls, parameter: str, before: PeriodicOrbit, span: float, value: float | None = None) -> Asked:
        """Return where a motion is to settle beyond the last one, in the direction of `span`."""
        value = before.parameters[parameter] if value is None else value
        return cls(
            parameter, value, math.copysign(min(abs(span), _scale(parameter, before)), span), before.x0.tobytes()
        )

    def landing(self, before: PeriodicOrbit) -> Landing | str:
        """Return where a motion settles that starts beyond the last one, or what it does instead."""
        told = ""
        for share in _BEYOND:
            beyond = {**before.parameters, self.parameter: self.value + share * self.scale}
            after = settled(before.system, beyond, before.x0)
            if not isinstance(after, str):
                return Landing(self.value, before, after)
            told = told or f"{self.parameter} = {self.value:.9g}: {after}"
        return told


def landings_of(branch: Branch) -> dict[Asked, Landing | str]:
    """Return where motions settle beyond the ends of a branch's stretches, as far as it is known.

    A branch keeps this, as the ways of a curve are sought again after each new sheet.
    """
    known: dict[Asked, Landing | str] = vars(branch).setdefault("_landings", {})
    return known


def _scale(parameter: str, orbit: PeriodicOrbit) -> float:
    """Return over which difference of a parameter motions change, however wide the range is.

    That is the size of the motion or the distance, or some widths of the resonance.
    """
    p = orbit.parameters
    if parameter == "f_kHz":
        return _WIDTHS * p["f_kHz"] / p[f"Q{suffix(driven_mode(orbit.system))}"]
    return max(abs(p[parameter]), orbit.max["D_nm"] - orbit.min["D_nm"])


def _at_the_end(branch: Branch, landing: Landing) -> PeriodicOrbit:
    """Return the motion of a sheet at the value where a stretch ended, of which the settled one is a neighbour."""
    if not float(branch.values.min()) <= landing.value <= float(branch.values.max()):
        return landing.after
    wanted = extremes_of(landing.after)
    found = _orbits_at(branch, landing.value) or (landing.after,)
    return min(found, key=lambda orbit: float(np.abs(extremes_of(orbit) - wanted).max()))


def _orbits_at(branch: Branch, value: float) -> tuple[PeriodicOrbit, ...]:
    """Return the orbits of a branch at a value; a branch keeps them, as `landings_of` does."""
    kept: dict[float, tuple[PeriodicOrbit, ...]] = vars(branch).setdefault("_orbits_at", {})
    if value not in kept:
        kept[value] = orbits_at(branch, value)
    return kept[value]


def _target(branches: Sequence[Branch], stretches: Sequence[Stretch], settled: PeriodicOrbit) -> Stretch | None:
    """Return the stable stretch on which a settled motion lies; None where it lies on none."""
    n, here = len(settled.system.states), settled.parameters[branches[0].parameter]
    wanted = extremes_of(settled)

    def values(stretch: Stretch) -> NDArray[np.float64]:
        found: NDArray[np.float64] = branches[stretch.sheet].values[list(stretch.points)]
        return found

    def away(stretch: Stretch) -> float:
        branch, at = branches[stretch.sheet], list(stretch.points)
        columns = np.hstack([branch.lows[at][:, :n], branch.highs[at][:, :n]]).T
        return float(
            max(abs(np.interp(here, values(stretch), column) - w) for column, w in zip(columns, wanted, strict=True))
        )

    def is_over(stretch: Stretch) -> bool:
        """Return whether a stretch may come to the motion's parameter: it goes on to special points at its ends."""
        branch, (first, last) = branches[stretch.sheet], (stretch.points[0], stretch.points[-1])
        ends = [special.value(branch.parameter) for point in (first, last) for special in _beside(branch, point)]
        ends += [float(branch.values[first]), float(branch.values[last])]
        return min(ends) - rounding <= here <= max(ends) + rounding

    rounding = _ROUNDING * abs(here)
    covering = [one for one in stretches if is_over(one)]
    if not covering:
        return None
    nearest = min(covering, key=away)
    for orbit in _orbits_at(branches[nearest.sheet], here):
        if orbit.stable and float(np.abs(extremes_of(orbit) - wanted).max()) <= _SAME * float(np.abs(wanted).max()):
            return nearest
    return None
