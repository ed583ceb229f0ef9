"""Periodic attractors: where motions recur or a cage holds one, the orbit solver finds the orbit."""

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
from saltus.flow.motion import starting_mode
from saltus.orbits import PeriodicOrbit, find_orbit, solve_orbit

if TYPE_CHECKING:
    from numpy.typing import NDArray


__all__ = ["LONGEST", "MOST_ATTEMPTS", "PeriodicSearch", "in_order"]

LONGEST = 16
"""Strobes after which a motion recurs that the orbit solver is asked about at once."""

MOST_ATTEMPTS = 8
"""Motions in a stretch that the orbit solver is asked about in vain."""

_BESIDE = 1e-2
"""Part of the states' scale within which a second motion is not tried."""

_AGREE = 0.01
"""Difference of the largest multiplier from that of the product of an orbit's Jacobians that is still rounding."""

_REST = 1e-10
_STILL = 1e-11
"""Part of the scale by which a state at rest seems to move."""


class PeriodicSearch(FollowedMotions):
    """The search for periodic orbits and equilibria; its arguments are those of `FollowedMotions`."""

    def find_caged(self) -> None:
        """Find the periodic orbit that each mode's cage holds."""
        for index, mode in enumerate(self.system.mode_names):
            cage = cage_of(self.system, self.parameters, mode)
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
        """Take the motions that recur to the orbit solver; return what remains to be followed."""
        gaps = np.array(
            [np.abs(path[turns:] - path[:-turns]).max(axis=0) / self.scale for turns in range(1, LONGEST + 1)]
        ).max(axis=2)
        recurs = (gaps < NEAR).any(axis=0)
        turns = np.argmax(gaps < NEAR, axis=0) + 1
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
            tried |= (np.abs(x - x[i]) / self.scale).max(axis=1) < _BESIDE
            tried[i] = True
        return x[remaining], modes[remaining]

    def as_found(self, orbit: PeriodicOrbit) -> Found:
        """Return a stable orbit as an attractor, with its cage or its ellipsoid.

        Raises
        ------
        ConvergenceError
            Motions do not contract to it in any ellipsoid that can be told from it.
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
        """Whether an attractor is one of those found, met once more before it was near enough."""
        return any(self._alike(other, found) for other in self.found)

    def _alike(self, one: Found, other: Found) -> bool:
        if one.kind != other.kind or len(one.points) != len(other.points):
            return False
        return float((np.abs(one.points - other.points) / self.scale).max()) < SAME

    def _corrected(self, x: NDArray[np.float64], mode: int, turns: int) -> Found | None:
        """The stable periodic orbit near a motion, None where there is none."""
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
        """The orbit near a motion that recurs after some turns of the phase."""
        if turns <= LONGEST:
            # one that is next to rest recurs by the region's size, but not by its own
            with suppress(ConvergenceError):
                return find_orbit(self.system, self.parameters, x, self.system.mode_names[mode], settle=1.0)
        names, start = self.system.mode_names, self.system.full_state(x)
        log = events_after(self.system, self.p, start, mode, periods=turns)
        events = np.flatnonzero(log.transition >= 0)
        modes = [mode, *log.mode_after[events]]
        ends = [self.system.transition_names[k] for k in log.transition[events]]
        states = [start, *log.x_after[events]]
        durations = np.diff([0.0, *log.time[events], log.t_end])
        guess = zip([names[k] for k in modes], [*ends, None], states, durations, strict=True)
        return solve_orbit(self.system, self.parameters, list(guess))

    def periodic(self, orbit: PeriodicOrbit) -> Found:
        """Return the attractor of a stable orbit of a forced system."""
        points, _ = self._strobes(orbit)
        points = in_order(points, self.scale)
        names = self.system.mode_names
        moved = (orbit.highs - orbit.lows)[: len(self.scale)] / self.scale
        touches = any(k >= 0 for k in orbit.form.transitions)
        still = not touches and float(moved.max()) < _STILL
        return Found(
            REST if still else f"period-{len(points)}",
            points,
            orbit,
            frozenset(names[k] for k in orbit.form.modes),
            touches,
            decay=float(np.abs(orbit.multipliers).max()) ** (1.0 / len(points)),
        )

    def _strobes(self, orbit: PeriodicOrbit) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """States and modes at phase 0, one for each period of the phase."""
        x = orbit.x0[None, :]
        mode = np.array([starting_mode(self.system, self.system.full_state(orbit.x0), self.p)], np.int64)
        points, modes = [orbit.x0], [mode[0]]
        for _ in range(orbit.form.turns - 1):
            x, mode = self.precise.strobe(x, mode)
            points.append(x[0])
            modes.append(mode[0])
        return np.array(points), np.array(modes)

    def contracts(self, found: Found) -> bool:
        """Give a periodic attractor the ellipsoid in which motions contract; return whether there is one."""
        metric = self._metric(found)
        if metric is not None and self.overlap:
            full = [self.system.full_state(point) for point in found.points]
            metric = replace(metric, modes=np.array([starting_mode(self.system, x, self.p) for x in full]))
        found.ellipsoid = None if metric is None else contracting(self.precise, metric, self.rng)
        found.core = None if found.ellipsoid is None else core_of(self.ensemble, found.ellipsoid, self.rng)
        return found.ellipsoid is not None

    def _metric(self, found: Found) -> OrbitEllipsoids | None:
        """The metric in which the linearised map contracts; None where it does not, or cannot be had."""
        if found.orbit is None:
            jacobians = map_jacobians(self.precise, found.points, self.scale)
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

    def _equilibrium(self, x: NDArray[np.float64], mode: int) -> Found | None:
        """The stable equilibrium near a state of a system without a phase."""
        for _ in range(20):
            image, _ = self.precise.strobe(x[None], np.array([mode]))
            apart = image[0] - x
            if not np.isfinite(apart).all():
                return None
            if np.max(np.abs(apart) / self.scale) < _REST:
                break
            slope = map_jacobians(self.precise, x[None], self.scale)[0] - np.eye(len(x))
            if not np.isfinite(slope).all() or np.linalg.cond(slope) > 1e6:
                return None
            x = x - np.linalg.solve(slope, apart)
        else:
            return None
        speed = np.abs(self.system.field(self.system.mode_names[mode], x, self.parameters))
        if float(np.max(speed * self.ensemble.period / self.scale)) > SAME:
            return None
        name = self.system.mode_names[mode]
        return Found(REST, x[None], None, frozenset([name]), touches=False)


def in_order(points: NDArray[np.float64], scale: NDArray[np.float64]) -> NDArray[np.float64]:
    """The points of a cycle in the order of visits, beginning with the first by their values."""
    return np.roll(points, -_first(points, scale), axis=0)


def _first(points: NDArray[np.float64], scale: NDArray[np.float64]) -> int:
    """Index of the point that comes first in the order of the states, told by their rounded values."""
    rounded = np.round(points / scale, 6)
    return int(np.lexsort(rounded.T[::-1])[0])
