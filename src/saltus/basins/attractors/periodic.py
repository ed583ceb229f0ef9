"""Periodic attractors: the orbit solver finds orbits near recurrent motions and in cages."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from saltus.basins.attractors.following import FollowedMotions
from saltus.basins.attractors.found import NEAR, REST, SAME, Found
from saltus.basins.attractors.invariant_set import cage_of
from saltus.basins.attractors.trapping import (
    OrbitEllipsoids,
    contracting,
    core_of,
    largest_multiplier,
    map_jacobians,
    metric_of,
    orbit_jacobians,
)
from saltus.errors import ConvergenceError, SaltusError
from saltus.flow.event_logs import events_after
from saltus.orbits import PeriodicOrbit, orbit_near, solve_orbit
from saltus.system.angles import wrapped
from saltus.system.maps import flowing

if TYPE_CHECKING:
    from numpy.typing import NDArray


__all__ = ["LONGEST", "MOST_ATTEMPTS", "PeriodicSearch", "in_order"]

LONGEST = 16  # period of a recurrent motion, in strobes, up to which the orbit solver is asked at once

MOST_ATTEMPTS = 8  # motions of a stretch for which the orbit solver is asked in vain, at most

_BESIDE = 1e-2  # distance from a motion in vain, over the states' scale, within which no other is tried

_AGREE = 0.01  # difference of two computations of the largest multiplier that is rounding

_REST = 1e-10  # distance of a state from its image, over the states' scale, of a fixed point
_STILL = 1e-11  # range of a state along an orbit, over its scale, of an equilibrium


class PeriodicSearch(FollowedMotions):
    """The search for periodic orbits and equilibria; its arguments are those of `FollowedMotions`."""

    def find_caged(self) -> None:
        """Find the periodic orbit that each mode's cage holds."""
        system = flowing(self.system)
        for index, mode in enumerate([] if self.system.angles else system.mode_names):  # no circle is a modal amplitude
            cage = cage_of(system, self.parameters, mode)
            if cage is None:
                continue
            found = self._corrected(cage.centre, index, 1)
            if found is not None and found.period == 1 and cage.sizes(found.points)[0] < cage.bound:
                found.cage = cage
                self.contracts(found)
                self.found.append(found)

    def _find_periodic(
        self, path: NDArray[np.float64], x: NDArray[np.float64], modes: NDArray[np.int64]
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Hand recurrent motions to the orbit solver; return the motions that remain to be followed."""
        gaps = np.array(
            [np.abs(self._apart(path[turns:], path[:-turns])).max(axis=0) for turns in range(1, LONGEST + 1)]
        ).max(axis=2)
        recurs = (gaps < NEAR).any(axis=0)
        turns = np.argmax(gaps < NEAR, axis=0) + 1
        if not self.sampled:  # what comes back without being at rest is on a cycle to which the looks are locked
            recurs &= turns == 1
            recurs[recurs] = self._speeds(x[recurs], modes[recurs]) < NEAR
        remaining = ~self._held(x, modes)
        tried = np.zeros(len(x), dtype=bool)
        attempts = 0
        while attempts < MOST_ATTEMPTS and (left := np.flatnonzero(remaining & recurs & ~tried)).size:
            i = left[0]
            found = self._corrected(x[i], int(modes[i]), int(turns[i]))
            if found is not None and not self._known(found) and (self.contracts(found) or found.orbit is not None):
                self.found.append(found)
                remaining &= ~found.holds(x, modes)
            else:
                attempts += 1
            tried |= np.abs(self._apart(x, x[i])).max(axis=1) < _BESIDE
            tried[i] = True
        return x[remaining], modes[remaining]

    def as_found(self, orbit: PeriodicOrbit) -> Found:
        """Return a stable orbit as an attractor, with its cage or its ellipsoid.

        Raises
        ------
        ConvergenceError
            No ellipsoid that is larger than rounding contracts to the orbit.
        """
        found = self.periodic(orbit)
        caged = next((other for other in self.found if other.cage is not None and self._alike(other, found)), None)
        if caged is not None:
            found.cage, found.ellipsoid, found.core = caged.cage, caged.ellipsoid, caged.core
        elif not self.contracts(found):
            hint = "its multipliers are too near the unit circle, or it grazes"
            raise ConvergenceError("trapping region", float(np.abs(orbit.multipliers).max()), 0, hint)
        return found

    def _known(self, found: Found) -> bool:
        """Return whether an attractor is a known one, met again by a motion that was not yet near it."""
        return any(self._alike(other, found) for other in self.found)

    def _alike(self, one: Found, other: Found) -> bool:
        if one.kind != other.kind or len(one.points) != len(other.points):
            return False
        # the least of points that a circle's ends part may be another one
        shifts = range(len(one.points) if self.circles.size else 1)
        ways = (np.abs(self._apart(np.roll(one.points, k, axis=0), other.points)).max() for k in shifts)
        return any(float(way) < SAME for way in ways)

    def _apart(self, one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the differences of states over their scales, those of angles half a turn at most."""
        return wrapped(one - other, self.circles) / self.scale

    def _corrected(self, x: NDArray[np.float64], mode: int, turns: int) -> Found | None:
        """Return the stable periodic orbit near a motion, None without one."""
        if self.system.phase is None:
            return self._equilibrium(x, mode) if turns == 1 else None
        try:
            orbit = self._orbit(x, mode, turns)
            points, modes = self._strobes(orbit)
            if len(points) > 1:
                first = _first(points, self.scale)
                orbit = self._orbit(points[first], int(modes[first]), len(points))
        except SaltusError:
            return None
        return self.periodic(orbit) if orbit.stable and orbit.admissible else None

    def _orbit(self, x: NDArray[np.float64], mode: int, turns: int) -> PeriodicOrbit:
        """Return the orbit near a motion that recurs after a number of turns of the phase."""
        if turns <= LONGEST:
            # one that is next to rest recurs by the region's size, but not by its own
            with suppress(ConvergenceError):
                return orbit_near(flowing(self.system), self.parameters, x, self.system.mode_names[mode], settle=1.0)
        names, start = self.system.mode_names, self.system.full_state(x)
        log = events_after(flowing(self.system), self.p, start, mode, periods=turns)
        events = np.flatnonzero(log.transition >= 0)
        modes = [mode, *log.mode_after[events]]
        ends = [self.system.transition_names[k] for k in log.transition[events]]
        states = [start, *log.x_after[events]]
        durations = np.diff([0.0, *log.time[events], log.t_end])
        guess = zip([names[k] for k in modes], [*ends, None], states, durations, strict=True)
        return solve_orbit(flowing(self.system), self.parameters, list(guess))

    def periodic(self, orbit: PeriodicOrbit) -> Found:
        """Return the attractor of a stable orbit of a forced system."""
        points, _ = self._strobes(orbit)
        points = in_order(points, self.scale)
        names = self.system.mode_names
        turns = tuple(orbit.winding.values()) if self.system.angles else ()
        moved = (orbit.highs - orbit.lows)[: len(self.scale)] / self.scale
        touches = any(k >= 0 for k in orbit.form.transitions)
        still = not touches and float(moved.max()) < _STILL
        return Found(
            REST if still else f"period-{len(points)}",
            points,
            orbit,
            frozenset(names[k] for k in orbit.form.modes),
            touches,
            turns=turns,
            decay=float(np.abs(orbit.multipliers).max()) ** (1.0 / len(points)),
        )

    def _strobes(self, orbit: PeriodicOrbit) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Return states and modes at phase 0, one for each period of the phase."""
        x = wrapped(orbit.x0, self.circles)[None, :]
        mode = np.array([self.ensemble.starting_mode(orbit.x0)], np.int64)
        points, modes = [x[0]], [mode[0]]
        for _ in range(orbit.form.turns - 1):
            x, mode = self.precise.strobe(x, mode)
            points.append(x[0])
            modes.append(mode[0])
        return np.array(points), np.array(modes)

    def contracts(self, found: Found) -> bool:
        """Give a periodic attractor the ellipsoid in which motions contract; return whether there is one."""
        metric = self._metric(found)
        if metric is not None:
            metric = replace(metric, circles=self.circles)
        if metric is not None and self.by_mode:
            modes = found.modes
            if modes is None:
                modes = np.array([self.ensemble.starting_mode(x) for x in found.points])
            metric = replace(metric, modes=modes, absent=self.ensemble.lacked(found.points, modes))
        if metric is None:
            return False
        if self.is_virtual(found):
            found.core = found.ellipsoid = contracting(self.precise, metric, self.rng, self._beside(found))
        elif (inner := contracting(self.precise, metric, self.rng)) is not None:
            found.ellipsoid, found.core = inner, core_of(self.ensemble, inner, self.rng)
        return found.ellipsoid is not None

    def _metric(self, found: Found) -> OrbitEllipsoids | None:
        """Return the metric in which the linearised map contracts; None without one."""
        if found.orbit is None:
            jacobians = map_jacobians(self.precise, found.points, self.scale, found.modes)
            if not np.isfinite(jacobians).all():
                return None
            found.decay = largest_multiplier(jacobians)
            return metric_of(found.points, jacobians, self.scale)
        try:
            jacobians = orbit_jacobians(found.orbit, found.points)
        except SaltusError:
            return None
        largest = float(np.abs(found.orbit.multipliers).max())
        if not np.isfinite(jacobians).all() or not abs(largest_multiplier(jacobians) - largest) < _AGREE:
            return None
        return metric_of(found.points, jacobians, self.scale)

    def _speeds(self, x: NDArray[np.float64], modes: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the largest rate of each state, shape (m, n), over an interval between two looks and its scale."""
        system, names = flowing(self.system), self.system.mode_names
        fields = [system.field(names[k], row, parameters=self.parameters) for row, k in zip(x, modes, strict=True)]
        rates = np.abs(np.reshape(fields, x.shape) * self.ensemble.period / self.scale)
        return np.asarray(rates.max(axis=1, initial=0.0))

    def _equilibrium(self, x: NDArray[np.float64], mode: int) -> Found | None:
        """Return the stable equilibrium near a state of a system without a phase."""
        for _ in range(20):
            image, _ = self.precise.strobe(x[None], np.array([mode]))
            apart = wrapped(image[0] - x, self.circles)
            if not np.isfinite(apart).all():
                return None
            if np.max(np.abs(apart) / self.scale) < _REST:
                break
            slope = map_jacobians(self.precise, x[None], self.scale, np.array([mode]))[0] - np.eye(len(x))
            if not np.isfinite(slope).all() or np.linalg.cond(slope) > 1e6:
                return None
            x = wrapped(x - np.linalg.solve(slope, apart), self.circles)
        else:
            return None
        if self._speeds(x[None], np.array([mode]))[0] > SAME:
            return None
        name = self.system.mode_names[mode]
        return Found(REST, x[None], None, frozenset([name]), touches=False, modes=np.array([mode]))


def in_order(points: NDArray[np.float64], scale: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the points of a cycle in the order of visits, from the least on."""
    return np.roll(points, -_first(points, scale), axis=0)


def _first(points: NDArray[np.float64], scale: NDArray[np.float64]) -> int:
    """Return the index of the least point, by rounded values in the order of the states."""
    rounded = np.round(points / scale, 6)
    return int(np.lexsort(rounded.T[::-1])[0])
