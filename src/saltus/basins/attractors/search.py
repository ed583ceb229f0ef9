"""Attractors by recurrence: seeds are followed until each has settled, and what they settle on is corrected.

1. Seeds are a scrambled Sobol sequence over a region, and the centres of all cages. They are advanced together, in
   stretches that double.
2. After each stretch, motions that recur after 1 to `LONGEST` strobes are handed to the orbit solver. What it converges
   to is an attractor if it is stable and admissible: a slow passage by a saddle recurs, too, but the orbit there is
   unstable. All motions in its trapping region are then accounted for.
3. Motions that have not become periodic after `_PATIENCE` strobes are told apart by features: each must be stationary,
   i.e. the second half of what it visits is as near to the first as the odd points are to the even ones; those that
   visit the same states are one attractor; `saltus.flow.motion_kind` says of which kind it is. What recurs after more
   than `LONGEST` strobes is handed to the orbit solver then.
4. Of each attractor that is no periodic orbit `_MEMBERS` motions are followed for `Search.longest` strobes more. If
   they leave it at such a rate that they stay for less than `_LIVES` times as long on average, it is dropped: it is a
   transient.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from saltus.basins.attractors.cloud import Cloud
from saltus.basins.attractors.contraction import check_contraction, growth_of, nothing_attracts, preserves
from saltus.basins.attractors.found import LIMIT_CYCLE, NEAR, REST, SAME, Found, Stay
from saltus.basins.attractors.periodic import LONGEST, MOST_ATTEMPTS, PeriodicSearch, in_order
from saltus.ensemble.traps import DIVERGED, Traps
from saltus.errors import InputError, SaltusError
from saltus.flow.event_logs import events_after
from saltus.flow.motion import starting_mode
from saltus.flow.motion_kind import classify
from saltus.orbits import PeriodicOrbit, find_orbit
from saltus.orbits.floquet import nontrivial

if TYPE_CHECKING:
    from numpy.typing import NDArray


__all__ = ["AttractorSearch"]

_STRIDE = 64
_PATIENCE = 500
_WINDOW = 512

_MANY, _SETTLED = 100, 1e-5
"""Strobes after which a motion recurs that the orbit solver is asked about at all; within which part of the scale."""

_MEMBERS, _FEW, _PUSH, _LIVES = 128, 16, 1e-6, 10.0
"""Motions that tell how long others stay on an attractor, and how many do where lanes cannot follow them; their
distance from it, as a part of its extent; the mean stay, in times as long as they are followed, below which it is none.
"""

_TRANSIENTS = 16
"""Attractors that motions were found to leave after which only periodic orbits count: an angle that runs on, say, makes
endless copies of a transient."""

_NEUTRAL = 4
"""Motions along which volumes stay as they are after which no other is taken for an attractor that is no orbit."""

_COMMENSURATE = 1e-3
_GOLDEN = 0.6180339887


class AttractorSearch(PeriodicSearch):
    """The search for all attractors; its arguments are those of `FollowedMotions`."""

    def follow(self, x: NDArray[np.float64]) -> None:
        """Follow motions from some states until each is accounted for, or given up."""
        self.find_caged()
        if not self.found:
            check_contraction(self.ensemble, x, self.search.longest)
        modes = np.array([starting_mode(self.system, self.system.full_state(row), self.p) for row in x], np.int64)
        done, stride = 0, _STRIDE
        self.told.expect(len(x))
        while len(x) and done < self.search.longest:
            before = len(x)
            x, modes, done = self._advance(x, modes, done, stride)
            self.told.step(before - len(x))
            stride *= 2
        self.told.step(len(x))
        if self.neutral and not self.found:
            where = f"along {self.neutral} motions"
            raise nothing_attracts(self.system.name, self.parameters, where, self.search.longest)

    def _advance(
        self, x: NDArray[np.float64], modes: NDArray[np.int64], done: int, stride: int, own: Found | None = None
    ) -> tuple[NDArray[np.float64], NDArray[np.int64], int]:
        """Follow motions for a stretch, and find the attractors that they are on then, except for their own.

        Those that are not accounted for, and the strobes done.
        """
        ends, at = self.ensemble.strobe(x, modes, stride)
        kept = self._bounded(ends)
        self.astray = x[~kept]
        path, x, modes = self._path(ends[kept], at[kept], 2 * LONGEST)
        done += stride + 2 * LONGEST
        x, modes = self._find_periodic(path, x, modes)
        if len(x) and done >= min(_PATIENCE, self.search.longest):
            done += 2 * _WINDOW
            x, modes = self._find_aperiodic(x, modes, own, last=done >= self.search.longest)
        return x, modes, done

    # ---- all others ----

    def _find_aperiodic(
        self, x: NDArray[np.float64], modes: NDArray[np.int64], own: Found | None, *, last: bool
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Tell stationary motions apart by what they visit; return those still on their way, or on their own one."""
        path, x, modes = self._path(x, modes, 2 * _WINDOW)
        clouds = path[1:].transpose(1, 0, 2)
        remaining = ~self._held(x, modes)
        if last:
            remaining &= ~self._near(x)
        settling = np.zeros(len(x), dtype=bool)
        self._find_long(clouds, x, modes, remaining)
        for i in range(len(x)):
            if settling[i] or not remaining[i] or self.neutral >= _NEUTRAL or self._drifts:
                continue
            regionless = [found for found in self.found if found.ellipsoid is None and found.cage is None]
            if known := [found for found in regionless if found.carries(clouds[i], self.scale)]:
                remaining[i] = own in known
                continue
            if any(transient.carries(clouds[i], self.scale) for transient in self.dropped):
                continue
            if not (cloud := Cloud(clouds[i], self.scale)).stationary():
                continue
            members = [j for j in np.flatnonzero(remaining) if j == i or cloud.same(clouds[j])]
            found = self._featured(clouds[i], x[i], int(modes[i]), last=last)
            if found is None:
                settling[members] = True
                continue
            self.found.append(found)
            remaining[members] = False
        return x[remaining], modes[remaining]

    def _find_long(
        self,
        clouds: NDArray[np.float64],
        x: NDArray[np.float64],
        modes: NDArray[np.int64],
        remaining: NDArray[np.bool_],
    ) -> None:
        """Take motions that recur after many strobes to the orbit solver; they do not remain if it finds an orbit."""
        attempts = 0
        for i in np.flatnonzero(remaining):
            turns = _recurrence(clouds[i] / self.scale)
            if attempts >= MOST_ATTEMPTS or not turns:
                continue
            if any(found.period and found.carries(clouds[i], self.scale) for found in self.found):
                remaining[i] = False
                continue
            found = self._corrected(x[i], int(modes[i]), turns)
            if found is not None and found.carries(clouds[i], self.scale):
                self.contracts(found)
                self.found.append(found)
                remaining[i] = False
            else:
                attempts += 1

    def _featured(self, cloud: NDArray[np.float64], x: NDArray[np.float64], mode: int, *, last: bool) -> Found | None:
        """The attractor on which a motion has settled, None where it is still on its way to a periodic orbit."""
        period, criteria, forced = self.ensemble.period, self.search.criteria, self.system.phase is not None
        strobes = 2 * _WINDOW
        try:
            growth = growth_of(self.ensemble, x, mode, strobes, None)
            if forced:
                log = events_after(self.system, self.p, x, mode, periods=_WINDOW)
            else:
                log = events_after(self.system, self.p, x, mode, t_end=_WINDOW * period)
        except SaltusError:
            return None
        if preserves(growth, strobes, self.search.longest):
            self.neutral += 1
            return None
        exponent, error = (float(value[0]) * period for value in (growth.exponents, growth.errors))
        rounding = criteria.noise * self.search.tolerance * self.scale
        kind = classify(cloud, exponent, error, criteria, rounding)
        is_periodic = kind.label.startswith("period-")
        if is_periodic and forced and kind.period <= LONGEST and not last:
            return None
        indices = {mode, *log.mode_before.tolist(), *log.mode_after.tolist()}
        moved = np.ptp(cloud, axis=0) / self.scale
        found = Found(
            REST if kind.period == 1 and not forced and float(moved.max()) < SAME else kind.label,
            in_order(cloud[-kind.period :], self.scale) if is_periodic else cloud,
            None,
            frozenset(self.system.mode_names[k] for k in indices),
            bool(np.any(log.transition >= 0)),
        )
        return found if forced or exponent > criteria.exponent + error else self._as_limit_cycle(found, x, mode)

    def _as_limit_cycle(self, found: Found, x: NDArray[np.float64], mode: int) -> Found | None:
        """A motion without a phase that does not spread, as a limit cycle if it is near one; None where that is known.

        Its points are those of the cycle itself: the motion may still be on its way to it.

        Raises
        ------
        InputError
            Strobes would see but a few points of it.
        """
        try:
            orbit = find_orbit(self.system, self.parameters, x, self.system.mode_names[mode])
        except SaltusError:
            return found
        if not orbit.stable:
            return None
        if any(other.orbit is not None and _same_cycle(other.orbit, orbit, self.scale) for other in self.found):
            return None
        turns = np.arange(1, 4 * LONGEST + 1) * self.ensemble.period / orbit.period
        if float(np.abs(turns - np.round(turns)).min()) < _COMMENSURATE:
            allowed = f"in no ratio of small integers to the period {orbit.period:.9g} of a limit cycle"
            raise InputError("interval", self.ensemble.period, allowed, f"try {_GOLDEN * self.ensemble.period:.9g}")
        path, _, _ = self._path(orbit.x0[None], np.array([orbit.form.modes[0]]), 2 * _WINDOW)
        moduli = np.abs(nontrivial(orbit.multipliers, autonomous=True))
        decay = float(moduli.max(initial=0.0)) ** (self.ensemble.period / orbit.period)
        return replace(found, kind=LIMIT_CYCLE, points=path[1:, 0], orbit=orbit, decay=decay)

    # ---- transients ----

    def drop_transients(self) -> None:
        """Follow motions from every attractor that is no periodic orbit, and drop those that they leave too soon."""
        while (found := next((each for each in self.found if self._unmeasured(each)), None)) is not None:
            if not self._drifts:
                self.told.expect(_MEMBERS)
                found.stay = self._stay(found)
                self.told.step(_MEMBERS)
            if found.stay is None or found.stay.mean < _LIVES * self.search.longest:
                self.found.remove(found)
                self.dropped.append(found)

    @property
    def _drifts(self) -> bool:
        """Whether motions go from transient to transient, so that what they visit for a while is no attractor."""
        return len(self.dropped) >= _TRANSIENTS

    def _unmeasured(self, found: Found) -> bool:
        return found.stay is None and found.orbit is None and found.ellipsoid is None and found.cage is None

    def _stay(self, found: Found) -> Stay:
        """How long motions stay on an attractor; where they go then is found, too."""
        count = _MEMBERS if self.in_lanes(found.points[:1]) else _FEW
        starts = found.points[np.arange(count) * len(found.points) // count]
        x = starts + _PUSH * np.ptp(starts, axis=0) * self.rng.standard_normal(starts.shape)
        modes = np.full(len(x), -1, np.int64)
        done, stride, strobes, left = 0, _STRIDE, 0.0, 0
        while len(x) and done < self.search.longest:
            begun, before = done, len(x)
            x, modes, done = self._advance(x, modes, done, stride, found)
            gone = before - len(x) - len(self.astray) + self._diverging(self.astray, done - begun)
            strobes += (done - begun) * _mean_count(before, before - gone)
            left, stride = left + gone, 2 * stride
        return Stay(count, strobes, left)

    def _diverging(self, x: NDArray[np.float64], longest: int) -> int:
        """How many motions diverge: where events accumulate they cannot be followed either."""
        labels, _ = self.ensemble.settle(x, Traps(len(self.low), limit=self.limit), longest)
        return int((labels == DIVERGED).sum())


def _mean_count(before: int, after: int) -> float:
    """Mean count of what decays at a constant rate, half of one being left where none is."""
    return (before - after) / math.log(before / max(after, 0.5)) if after < before else float(before)


def _same_cycle(one: PeriodicOrbit, other: PeriodicOrbit, scale: NDArray[np.float64]) -> bool:
    """Whether two limit cycles are one, started from two of its points."""
    apart = np.abs([one.lows - other.lows, one.highs - other.highs])[:, : len(scale)] / scale
    return abs(one.period - other.period) < SAME * one.period and float(apart.max()) < NEAR * NEAR


def _recurrence(path: NDArray[np.float64]) -> int:
    """After how many strobes a path recurs, 0 where it does not, or after too many or few for the orbit solver."""
    apart = np.abs(path[-2::-1] - path[-1]).max(axis=1)
    turns = int(np.argmax(apart < _SETTLED)) + 1
    if not LONGEST < turns <= _MANY or float(np.abs(path[-turns:] - path[-2 * turns : -turns]).max()) >= _SETTLED:
        return 0
    return turns
