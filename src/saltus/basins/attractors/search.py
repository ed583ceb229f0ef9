"""Attractors by recurrence: motions from many starts are followed until they settle, then corrected by Newton's method.

1. Seeds are a scrambled Sobol sequence over a region, and the centres of all cages. Their motions advance together, in
   stretches that double.
2. After each stretch, motions that recur after 1 to `LONGEST` strobes are handed to the orbit solver. Its orbit is an
   attractor if it is stable and admissible. A slow passage by a saddle recurs too, but the orbit there is unstable. All
   motions in the attractor's trapping region then count as settled.
3. Motions that are not periodic after `_PATIENCE` strobes are told apart by features. Each must be stationary: the
   second half of its points is as near to the first as the odd points are to the even ones. Motions that visit the same
   states are on one attractor, whose kind follows by `saltus.flow.motion_kind`. Motions that recur after more than
   `LONGEST` strobes are handed to the orbit solver then.
4. From each attractor that is no periodic orbit, `_MEMBERS` motions are followed for `longest` strobes more. If their
   mean stay is less than `_LIVES` times as long, the set is a transient, and is dropped.

   docs/theory/basins.md, "Attractors by recurrence", derives the method.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from saltus.basins.attractors.cloud import EXTENT, Cloud, extent_of
from saltus.basins.attractors.contraction import (
    check_contraction,
    grows,
    keeps,
    nothing_attracts,
    preserves,
    shrinking,
)
from saltus.basins.attractors.found import FEWEST_SAMPLES, LIMIT_CYCLE, NEAR, REST, SAME, Found, Stay
from saltus.basins.attractors.pace import approach
from saltus.basins.attractors.periodic import LONGEST, MOST_ATTEMPTS, PeriodicSearch, in_order
from saltus.ensemble.traps import DIVERGED, Traps
from saltus.errors import SaltusError, StiffnessError
from saltus.flow.motion_kind import UNRESOLVED, classify
from saltus.orbits import PeriodicOrbit, orbit_near
from saltus.orbits.stability.floquet import nontrivial
from saltus.system.angles import on_circles, wrapped
from saltus.system.maps import flowing

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.flow.variational import Growth


__all__ = ["AttractorSearch"]

_STRIDE = 64  # strobes of the first stretch; each is twice as long as the last
_PATIENCE = 500  # strobes after which motions that are not periodic are told apart by features
_WINDOW = 512  # strobes of each half of a motion whose features are compared

_MANY = 100  # period of a recurrent motion, in strobes, up to which the orbit solver is asked at all
_SETTLED = 1e-5  # distance of its recurrence, over the states' scale

_MEMBERS = 128  # motions that measure how long others stay on an attractor
_FEW = 16  # the same where lanes cannot follow them
_PUSH = 1e-6  # their distance from the attractor at the start, over its extent
_LIVES = 10.0  # mean stay on an attractor, in times `AttractorOptions.longest`, below which it is a transient

_TRANSIENTS = 16  # transients found after which only periodic orbits count: a growing angle makes endless copies

_LONGER = 4  # times as many strobes decide whether volumes keep their size
_NEUTRAL = 4  # motions of constant volume after which only periodic orbits count

_PILOTS = 4  # starts whose motions tell how many steps a strobe takes
_SAMPLED = 16  # strobes for which each sample of a region is followed, about

_FOLLOWED = "looking for attractors"  # what a report says of motions from the starts


class AttractorSearch(PeriodicSearch):
    """The search for all attractors; its arguments are those of `FollowedMotions`.

    `relaxed` is how many strobes motions were followed besides, so that they come to slow attractors.
    """

    relaxed = 0
    _relaxing = 0

    def follow(self, x: NDArray[np.float64]) -> None:
        """Follow motions from given states until each has settled or is given up."""
        self._check_effort(x)
        self.find_caged()
        if not self.found:
            check_contraction(self.ensemble, x, self.options.longest)
        self.settle(x)
        if self.neutral and not self.found:
            where = f"along {self.neutral} motions"
            raise nothing_attracts(self.system.name, self.parameters, where, self.options.longest)

    def _check_effort(self, x: NDArray[np.float64]) -> None:
        """Raise `StiffnessError` where a search must take more steps than it may: of some starts, followed to a look.

        It follows all starts for a stretch, and samples of a region until they are there.
        """
        effort, pilots = self.ensemble.effort, x[:: -(-len(x) // _PILOTS)]
        most = effort.most
        if most == math.inf:
            return
        strobes = len(x) * (_STRIDE + 2 * LONGEST) + (self.options.samples or FEWEST_SAMPLES) * _SAMPLED
        effort.most = effort.steps + len(pilots) * math.ceil(most / strobes)
        try:
            self.ensemble.strobe(pilots)
        except StiffnessError as error:
            needed = f"a search from {len(x)} starts needs {strobes} intervals, with {most:g} steps (max_steps) in all"
            told = "; ".join(filter(None, (str(error.args[4]), needed)))
            raise StiffnessError(error.time, error.state, error.mode, error.steps, told, error.stiff) from None
        finally:
            effort.most = most

    def settle(self, x: NDArray[np.float64]) -> None:
        """Follow motions from given states until each has settled on an attractor, known or new, or is given up."""
        modes = np.array([self.ensemble.starting_mode(row) for row in x], np.int64)
        done, stride = 0, _STRIDE
        self.reporter.expect(len(x))
        while len(x) and done < self.options.longest:
            before = len(x)
            x, modes, done = self._advance(x, modes, done, stride)
            self.reporter.step(before - len(x), _FOLLOWED)
            stride *= 2
        self.reporter.step(len(x), _FOLLOWED)

    def _advance(
        self, x: NDArray[np.float64], modes: NDArray[np.int64], done: int, stride: int, own: Found | None = None
    ) -> tuple[NDArray[np.float64], NDArray[np.int64], int]:
        """Follow motions for a stretch, and find the attractors that they then are on, except `own`.

        Return the states and modes of unsettled motions, and the strobes done.
        """
        ends, at = self.ensemble.strobe(x, modes, stride)
        kept = self._bounded(ends)
        self.astray = x[~kept]
        path, x, modes = self._path(ends[kept], at[kept], 2 * LONGEST)
        done += stride + 2 * LONGEST
        x, modes = self._find_periodic(path, x, modes)
        if len(x) and done >= min(_PATIENCE, self.options.longest):
            done += 2 * _WINDOW
            x, modes = self._find_aperiodic(x, modes, own, last=done >= self.options.longest)
        return x, modes, done

    # ---- all others ----

    def _find_aperiodic(
        self, x: NDArray[np.float64], modes: NDArray[np.int64], own: Found | None, *, last: bool
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Tell stationary motions apart by their clouds; return the unsettled motions, and those on `own`."""
        path, x, modes = self._path(x, modes, 2 * _WINDOW)
        clouds = path[1:].transpose(1, 0, 2)
        remaining = ~self._held(x, modes)
        if last:
            remaining &= ~self._near(x)
        settling = np.zeros(len(x), dtype=bool)
        self._find_long(clouds, x, modes, remaining)
        sampled, in_vain = self.sampled, 0
        for i in range(len(x)):
            if settling[i] or not remaining[i] or self.neutral >= _NEUTRAL or self._drifts:
                continue
            regionless = [found for found in self.found if found.ellipsoid is None and found.cage is None]
            if known := [found for found in regionless if found.carries(clouds[i], self.scale, self.circles)]:
                remaining[i] = own in known
                continue
            if any(transient.carries(clouds[i], self.scale, self.circles) for transient in self.dropped):
                continue
            if not (cloud := Cloud(clouds[i], self.scale, self.circles)).stationary():
                if own is None and in_vain < MOST_ATTEMPTS and (centre := self._centre_of(clouds[i])) is not None:
                    remaining[i] = not self._spirals_in(clouds[i], *centre, int(modes[i]))
                    in_vain += remaining[i]
                    if not remaining[i]:
                        continue
                # strobes that nearly lock to a cycle see no curve
                if not sampled and in_vain < MOST_ATTEMPTS:
                    found = self._cycle_near(clouds[i, -1], x[i], int(modes[i]))
                    in_vain += found is None
                    if found is not None:
                        self.found.append(found)
                        remaining[i] = False
                continue
            members = [j for j in np.flatnonzero(remaining) if j == i or cloud.same(clouds[j])]
            found = self._featured(clouds[i], x[i], int(modes[i]), last=last)
            if self._relaxing:  # all motions come to it, and to its like, before they are told apart
                return self._relaxed(x[remaining], modes[remaining], own, last=last)
            if found is None:
                settling[members] = True
                continue
            self.found.append(found)
            remaining[members] = False
        return x[remaining], modes[remaining]

    def _relaxed(
        self, x: NDArray[np.float64], modes: NDArray[np.int64], own: Found | None, *, last: bool
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Follow unsettled motions for as long as they take to a slow attractor, and tell them apart then."""
        self.relaxed, count = self.relaxed + self._relaxing, self._relaxing
        self._relaxing = 0
        ends, at = self.ensemble.strobe(x, modes, count)
        kept = self._bounded(ends)
        self.astray = np.concatenate([self.astray, x[~kept]])
        return self._find_aperiodic(ends[kept], at[kept], own, last=last)

    def _find_long(
        self,
        clouds: NDArray[np.float64],
        x: NDArray[np.float64],
        modes: NDArray[np.int64],
        remaining: NDArray[np.bool_],
    ) -> None:
        """Hand motions that recur after many strobes to the orbit solver; they are settled if it finds an orbit."""
        attempts = 0
        for i in np.flatnonzero(remaining):
            table, sizes = on_circles(clouds[i], self.scale, self.circles)
            turns = _recurrence(table / sizes)
            if attempts >= MOST_ATTEMPTS or not turns:
                continue
            if any(found.period and found.carries(clouds[i], self.scale, self.circles) for found in self.found):
                remaining[i] = False
                continue
            found = self._corrected(x[i], int(modes[i]), turns)
            if found is not None and found.carries(clouds[i], self.scale, self.circles):
                self.contracts(found)
                self.found.append(found)
                remaining[i] = False
            else:
                attempts += 1

    def _featured(self, cloud: NDArray[np.float64], x: NDArray[np.float64], mode: int, *, last: bool) -> Found | None:
        """Return the attractor on which a motion has settled; None for one still on its way to a periodic orbit."""
        period, criteria, sampled = self.ensemble.period, self.options.criteria, self.sampled
        strobes = 2 * _WINDOW
        try:
            growth = self.ensemble.growth(x, mode, strobes, None)
            modes, touches = self.ensemble.visited(x, mode, _WINDOW)
            # behind an event all motions may be on one line, whatever volumes do: a thermostat's cycle attracts at once
            held = not touches and self._keeps_volumes(growth, x, mode)
            if held or preserves(growth, strobes, self.options.longest):
                self.neutral += 1
                return None
        except SaltusError:
            return None
        exponent, error = (float(value[0]) * period for value in (growth.exponents, growth.errors))
        slow = shrinking(growth) * period
        wanted = approach(math.exp(slow), 1.0 / NEAR)
        if wanted > strobes:
            self._relaxing = max(min(wanted, int(self.budget / self.options.starts)) - self.relaxed, 0)
            if self._relaxing:
                return None
            error = max(error, -slow)  # directions are slow as well to turn to the one that shrinks least
        rounding = criteria.noise * self.options.tolerance * self.scale
        table, rounding = on_circles(cloud, rounding, self.circles)
        kind = classify(table, exponent, error, criteria, rounding, autonomous=not sampled)
        is_periodic = kind.period > 0
        if kind.label == UNRESOLVED and not last:
            return None
        if is_periodic and sampled and kind.period <= LONGEST and not last:
            return None
        moved = extent_of(cloud, self.circles) / self.scale
        found = Found(
            REST
            if kind.period == 1 and not sampled and float(moved.max()) < SAME
            else f"period-{kind.period}"
            if is_periodic
            else kind.label,
            in_order(cloud[-kind.period :], self.scale) if is_periodic else cloud,
            None,
            frozenset(self.system.mode_names[k] for k in modes),
            touches,
            decay=math.exp(slow) if wanted > strobes else math.nan,
        )
        return found if sampled or exponent > criteria.exponent + error else self._as_limit_cycle(found, x, mode)

    def _keeps_volumes(self, growth: Growth, x: NDArray[np.float64], mode: int) -> bool:
        """Return whether volumes keep their mean size on a motion that is not chaotic: then it attracts nothing.

        Where that is so within the error of the mean, a longer look decides.
        """
        if keeps(growth) and not grows(growth):
            return keeps(self.ensemble.growth(x, mode, _LONGER * 2 * _WINDOW, None))
        return False

    def _spirals_in(self, cloud: NDArray[np.float64], centre: NDArray[np.float64], turns: int, mode: int) -> bool:
        """Return whether a motion comes nearer to a stable orbit about which it turns; a new orbit is added."""
        found = self._corrected(centre, mode, turns)
        if found is None or not found.period:
            return False
        known = next((other for other in self.found if self._alike(other, found)), None)
        if known is None and not self.contracts(found):
            return False
        ellipsoid = found.ellipsoid if known is None else known.ellipsoid
        if ellipsoid is None:
            return False
        sizes = ellipsoid.sizes(cloud).min(axis=1)
        first, second = np.array_split(sizes, 2)
        if not second.max() < first.max():
            return False
        if known is None:
            self.found.append(found)
        return True

    def _cycle_near(self, x: NDArray[np.float64], start: NDArray[np.float64], mode: int) -> Found | None:
        """Return the stable limit cycle on which a motion of a system without a phase is; None without one."""
        seen = Found(LIMIT_CYCLE, x[None], None, frozenset(), touches=False)
        found = self._as_limit_cycle(seen, start, mode)
        if found is None or found.orbit is None or not found.carries(x[None], self.scale, self.circles):
            return None
        form, names = found.orbit.form, self.system.mode_names
        visited = frozenset(names[k] for k in form.modes)
        return replace(found, visited=visited, touches=any(k >= 0 for k in form.transitions))

    def _as_limit_cycle(self, found: Found, x: NDArray[np.float64], mode: int) -> Found | None:
        """Return the stable limit cycle near a motion; None for a known or unstable one.

        Its points are those of the cycle, as the motion may still be on its way to it. Without an orbit nearby, the
        motion is returned as found.
        """
        try:
            orbit = orbit_near(flowing(self.system), self.parameters, x, self.system.mode_names[mode])
        except SaltusError:
            return found
        if not orbit.stable:
            return None
        if any(self._is_on(other, orbit) for other in self.found):
            return None
        moduli = np.abs(nontrivial(orbit.multipliers, autonomous=True))
        decay = float(moduli.max(initial=0.0)) ** (self.ensemble.period / orbit.period)
        turns = tuple(orbit.winding.values()) if self.system.angles else ()
        cycle = replace(found, kind=LIMIT_CYCLE, orbit=orbit, turns=turns, decay=decay)
        return replace(cycle, points=cycle.along(2 * _WINDOW))

    def _is_on(self, found: Found, orbit: PeriodicOrbit) -> bool:
        """Return whether a limit cycle is a known one, started from another of its points."""
        if found.orbit is None or found.kind != LIMIT_CYCLE:
            return False
        if not self.circles.size:
            return _same_cycle(found.orbit, orbit, self.scale)
        if abs(found.orbit.period - orbit.period) >= SAME * orbit.period:
            return False
        start = wrapped(
            orbit.x0[None, : len(self.scale)], self.circles
        )  # where a rotation starts, its extremes are too
        return found.carries(start, self.scale, self.circles)

    def _centre_of(self, path: NDArray[np.float64]) -> tuple[NDArray[np.float64], int] | None:
        """Return what `_centre` does of a path whose angles may pass an end of their circle."""
        if (centre := _centre(self._on_a_sheet(path), self.scale)) is None:
            return None
        return wrapped(centre[0], self.circles), centre[1]

    def _on_a_sheet(self, path: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a path, shape (k, n), whose angles are within half a turn of the last ones."""
        return path[-1] + wrapped(path - path[-1], self.circles) if self.circles.size else path

    # ---- transients ----

    def drop_transients(self) -> None:
        """Follow motions from every attractor without a periodic orbit; drop those that motions leave too soon."""
        while (found := next((each for each in self.found if self._unmeasured(each)), None)) is not None:
            if not self._drifts:
                self.reporter.expect(_MEMBERS)
                found.stay = self._stay(found)
                self.reporter.step(_MEMBERS, "looking for transients")
            if found.stay is None or found.stay.mean < _LIVES * self.options.longest:
                self.found.remove(found)
                self.dropped.append(found)

    @property
    def _drifts(self) -> bool:
        """Whether motions go from transient to transient, so that only periodic orbits count as attractors."""
        return len(self.dropped) >= _TRANSIENTS

    def _unmeasured(self, found: Found) -> bool:
        return found.stay is None and found.orbit is None and found.ellipsoid is None and found.cage is None

    def _stay(self, found: Found) -> Stay:
        """Return how long motions stay on an attractor; add the attractors to which they leave."""
        count = _MEMBERS if self.in_lanes(found.points[:1]) else _FEW
        starts = found.points[np.arange(count) * len(found.points) // count]
        x = starts + _PUSH * np.ptp(starts, axis=0) * self.rng.standard_normal(starts.shape)
        modes = np.full(len(x), -1, np.int64)
        done, stride, strobes, left = 0, _STRIDE, 0.0, 0
        while len(x) and done < self.options.longest:
            begun, before = done, len(x)
            x, modes, done = self._advance(x, modes, done, stride, found)
            gone = before - len(x) - len(self.astray) + self._diverging(self.astray, done - begun)
            strobes += (done - begun) * _mean_count(before, before - gone)
            left, stride = left + gone, 2 * stride
        return Stay(count, strobes, left)

    def _diverging(self, x: NDArray[np.float64], longest: int) -> int:
        """Return how many motions diverge; motions astray may also have events that accumulate."""
        labels, _ = self.ensemble.settle(x, Traps(len(self.low), limit=self.limit), longest)
        return int((labels == DIVERGED).sum())


def _centre(path: NDArray[np.float64], scale: NDArray[np.float64]) -> tuple[NDArray[np.float64], int] | None:
    """Return the state about which a path, shape (k, n), turns ever nearer, and after how many strobes it is back.

    None for a path that does not shrink. A slow spiral's mean is far nearer to its centre than any of its states.
    """
    whole = np.ptp(path, axis=0)
    parts = {turns: path[len(path) % turns :: turns] for turns in range(1, LONGEST + 1)}
    turns = next((k for k, part in parts.items() if (np.ptp(part, axis=0) < 0.5 * whole + EXTENT * scale).all()), 1)
    first, second = np.array_split(parts[turns], 2)
    before, after = np.ptp(first, axis=0), np.ptp(second, axis=0)
    if (after > before + EXTENT * scale).any() or not (after < before).any():
        return None
    return np.asarray(second.mean(axis=0)), turns


def _mean_count(before: int, after: int) -> float:
    """Return the mean count over a stretch of a population that decays at a constant rate; 0 left counts as 1/2."""
    return (before - after) / math.log(before / max(after, 0.5)) if after < before else float(before)


def _same_cycle(one: PeriodicOrbit, other: PeriodicOrbit, scale: NDArray[np.float64]) -> bool:
    """Return whether two limit cycles are one, started from two of its points."""
    apart = np.abs([one.lows - other.lows, one.highs - other.highs])[:, : len(scale)] / scale
    return abs(one.period - other.period) < SAME * one.period and float(apart.max()) < NEAR * NEAR


def _recurrence(path: NDArray[np.float64]) -> int:
    """Return the strobes after which a path recurs, above `LONGEST` and up to `_MANY`; else 0."""
    apart = np.abs(path[-2::-1] - path[-1]).max(axis=1)
    turns = int(np.argmax(apart < _SETTLED)) + 1
    if not LONGEST < turns <= _MANY or float(np.abs(path[-turns:] - path[-2 * turns : -turns]).max()) >= _SETTLED:
        return 0
    return turns
