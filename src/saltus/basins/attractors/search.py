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
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from saltus import checks
from saltus.basins.attractors.contraction import check_contraction, growth_of, nothing_attracts, preserves
from saltus.basins.attractors.invariant_set import Cage, cage_of
from saltus.basins.attractors.trapping import (
    OrbitEllipsoids,
    admits_start,
    contracting,
    core_of,
    largest_multiplier,
    map_jacobians,
    metric_of,
    orbit_jacobians,
)
from saltus.basins.telling import Progress, Telling
from saltus.ensemble.ensemble import Ensemble
from saltus.ensemble.traps import DIVERGED, Traps
from saltus.errors import ConvergenceError, InputError, SaltusError
from saltus.flow.event_logs import events_after
from saltus.flow.motion import allowed_modes, starting_mode
from saltus.flow.motion_kind import Criteria, classify
from saltus.flow.simulation import simulate
from saltus.orbits import PeriodicOrbit, find_orbit, solve_orbit
from saltus.orbits.floquet import nontrivial

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from saltus.system import HybridSystem

__all__ = ["LIMIT_CYCLE", "LONGEST", "MOTIONS", "REST", "AttractorSearch", "Found", "Search", "Stay"]

LIMIT_CYCLE, REST = "limit cycle", "rest"
LONGEST = 16
"""Strobes after which a motion recurs that the orbit solver is asked about at once."""

_STRIDE = 64
_PATIENCE = 500
_WINDOW = 512
_NEAR, _SAME, _BESIDE = 1e-3, 1e-6, 1e-2
"""Parts of the states' scale: within which a motion recurs, two orbits are one, a second motion is not tried."""

_MANY, _SETTLED = 100, 1e-5
"""Strobes after which a motion recurs that the orbit solver is asked about at all; within which part of the scale."""

_AGREE = 0.01
"""Difference of the largest multiplier from that of the product of an orbit's Jacobians that is still rounding."""

_MEMBERS, _FEW, _PUSH, _LIVES = 128, 16, 1e-6, 10.0
"""Motions that tell how long others stay on an attractor, and how many do where lanes cannot follow them; their
distance from it, as a part of its extent; the mean stay, in times as long as they are followed, below which it is none.
"""

_CENSORED = 3.0
"""Mean stays in all that motions are followed without a departure, at the most, at 95 %: -ln 0.05."""

_REST = 1e-10
_MOST = 8
_PRECISE = 1e-11
_OVERLAP, _REACH, _TYPICAL = 0.9, 3.0, 0.98
"""Part of a motion's points that lie within so many typical distances of another's; quantile of these distances."""

_EXTENT = 1e-9
_STATES = 400
"""Random states of the region that tell whether one may allow several modes."""

_PLACES, _LOOKS = (0.17, 0.41, 0.63, 0.89), 65
"""Parts of the region's width at which motions start that tell the size of a state that is frozen; looks at each."""

_ALONE = 100.0
"""Times as long as lanes that the event-driven flow takes for a period."""

MOTIONS = 40_000
"""Motions that will be labelled, where it is not told how many."""

_TRANSIENTS = 16
"""Attractors that motions were found to leave after which only periodic orbits count: an angle that runs on, say, makes
endless copies of a transient."""

_NEUTRAL = 4
"""Motions along which volumes stay as they are after which no other is taken for an attractor that is no orbit."""

_STILL = 1e-11
"""Part of the scale by which a state at rest seems to move."""

_COMMENSURATE = 1e-3
_GOLDEN = 0.6180339887


@dataclass(frozen=True)
class Search:
    """How attractors are looked for, and their trapping regions measured.

    Parameters
    ----------
    random_seed : int
        Of all random numbers: the same inputs give the same attractors.
    longest : int
        Strobes after which a motion that has not settled is given up.
    samples : int or None
        Motions that are followed from inside each trapping region that is measured. By default so many, between 1000
        and 20 000, that making and measuring all of them takes about six times as long as labelling the motions.
    safety : float
        Part of the squared distance of a sample that ends elsewhere at which a plane is set that leaves it out.
    tolerance : float
        Of a step of the ensemble.
    limit : float
        A state with a component beyond it has diverged; times the half width of the region where that is above 1.
    criteria : Criteria
        By which quasi-periodic and chaotic motions are told apart.
    """

    random_seed: int = 0
    longest: int = 4000
    samples: int | None = None
    safety: float = 0.8
    tolerance: float = 1e-8
    limit: float = 1e6
    criteria: Criteria = field(default_factory=Criteria)

    def __post_init__(self) -> None:
        for name, least in (("random_seed", 0), ("longest", 1)):
            object.__setattr__(self, name, checks.count(f"Search.{name}", getattr(self, name), least))
        if self.samples is not None:
            object.__setattr__(self, "samples", checks.size("Search.samples", self.samples, 100))
        for name, largest in (("safety", 1.0), ("tolerance", 1e-2), ("limit", math.inf)):
            value = checks.positive(f"Search.{name}", getattr(self, name))
            object.__setattr__(self, name, checks.between(f"Search.{name}", value, 0.0, largest))
        checks.instance("Search.criteria", self.criteria, Criteria)


class Stay(NamedTuple):
    """How long motions stay on an attractor that is no periodic orbit.

    Attributes
    ----------
    motions : int
        How many were followed.
    strobes : float
        How long they stayed, all together.
    left : int
        How many of them ended elsewhere.
    """

    motions: int
    strobes: float
    left: int

    @property
    def mean(self) -> float:
        """Mean stay in strobes, where motions leave at a constant rate; infinite where none did."""
        return self.strobes / self.left if self.left else math.inf

    def __str__(self) -> str:
        if not self.left:
            return f"none of {self.motions} motions left it in {self.strobes:.3g} strobes: mean stay > " + (
                f"{self.strobes / _CENSORED:.2g} at 95 %"
            )
        error = self.mean / math.sqrt(self.left)
        return f"a transient: {self.left} of {self.motions} motions left it, mean stay {self.mean:.2g} +- {error:.1g}"


@dataclass(eq=False)
class Found:
    """One attractor, as it was found.

    Attributes
    ----------
    kind : str
    points : ndarray, shape (k, n)
        States at strobes: of a periodic orbit in the order of visits, the least first.
    orbit : PeriodicOrbit or None
    visited : frozenset of str
        Modes that it visits.
    touches : bool
        Whether it meets an event.
    cage : Cage or None
    ellipsoid : OrbitEllipsoids or None
        In which motions contract.
    core : OrbitEllipsoids or None
        The part of it in which they are accounted for.
    stay : Stay or None
        How long motions stay, where that was measured.
    decay : float
        Factor by which distances from it shrink in a strobe in the end, NaN where that is not known.
    """

    kind: str
    points: NDArray[np.float64]
    orbit: PeriodicOrbit | None
    visited: frozenset[str]
    touches: bool
    cage: Cage | None = None
    ellipsoid: OrbitEllipsoids | None = None
    core: OrbitEllipsoids | None = None
    stay: Stay | None = None
    decay: float = math.nan

    @property
    def period(self) -> int:
        """Strobes after which it recurs, 0 where it does not."""
        if self.kind == REST:
            return 1
        return int(self.kind.removeprefix("period-")) if self.kind.startswith("period-") else 0

    def holds(self, x: NDArray[np.float64], modes: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return which states, shape (m, n), in which modes, are certain to end here."""
        held = np.zeros(len(x), dtype=bool)
        if self.core is not None:
            held |= self.core.holds(x, modes)
        if self.cage is not None:
            held |= (modes == self.cage.mode) & (self.cage.sizes(x) < self.cage.bound)
        return held

    def carries(self, path: NDArray[np.float64], scale: NDArray[np.float64]) -> bool:
        """Return whether a motion that visits some states, shape (k, n), is on this attractor, or creeps to it.

        It creeps to an orbit where it is beside its points, in parts of the scale or of what the orbit extends over.
        """
        if not self.period:
            return _Cloud(self.points, scale).same(path)
        n, orbit = len(scale), self.orbit
        extent = np.ptp(self.points, axis=0) if orbit is None else (orbit.highs - orbit.lows)[:n]
        unit = np.clip(extent, _EXTENT * scale, scale)
        return float(_distances(self.points / unit, path[-2 * self.period :] / unit).max()) < _NEAR


class AttractorSearch:
    """Motions on their way to attractors, and the attractors found so far.

    Parameters
    ----------
    system : HybridSystem
    parameters : mapping of str to float
    low, high : ndarray, shape (n,)
        The region.
    interval : float or None
        Time between strobes of a system without a phase.
    search : Search
    motions : int, optional
        How many motions will be labelled: trapping regions are measured as well as that is worth.
    progress : callable, optional
        Called as `map_basins` calls it.
    """

    def __init__(
        self,
        system: HybridSystem,
        parameters: Mapping[str, float] | None,
        low: NDArray[np.float64],
        high: NDArray[np.float64],
        interval: float | None,
        search: Search,
        motions: int = MOTIONS,
        progress: Progress | None = None,
    ) -> None:
        self.system, self.parameters, self.search = system, dict(parameters or {}), search
        self.low, self.high, self.interval = low, high, interval
        self.scale = self._sizes()
        self.limit = search.limit * max(1.0, float(self.scale.max()))
        self.ensemble, self.precise = (
            Ensemble(system, self.parameters, tolerance=tolerance, interval=interval, scale=self.scale)
            for tolerance in (search.tolerance, _PRECISE)
        )
        self.p = self.ensemble.p
        self.rng = np.random.default_rng(search.random_seed)
        self.found: list[Found] = []
        self.dropped: list[Found] = []
        self.astray = np.empty((0, len(low)))
        self.neutral = 0
        self.motions, self.told = motions, Telling(progress)

    def _sizes(self) -> NDArray[np.float64]:
        """Size of each state: half the region's width, or how far motions go from the value at which it is frozen."""
        half = 0.5 * (self.high - self.low)
        if (half > 0.0).all():
            return np.asarray(half)
        how_long: dict[str, Any] = {"periods": 1} if self.interval is None else {"t_end": self.interval}
        gone = []
        for part in _PLACES:
            start = self.low + part * (self.high - self.low)
            with suppress(SaltusError):
                motion = simulate(self.system, self.parameters, start, **how_long)
                states = motion(np.linspace(0.0, motion.t_end, _LOOKS))[:, : len(half)]
                gone.append(np.abs(states - start).max(axis=0))
        sizes = np.median(gone, axis=0) if gone else half
        return np.where(half > 0.0, half, np.where(sizes > 0.0, sizes, half.max() or 1.0))

    # ---- what is followed ----

    @cached_property
    def overlap(self) -> bool:
        """Whether states of the region allow several modes, of which motions from samples have the first."""
        x = np.random.default_rng(self.search.random_seed).uniform(self.low, self.high, (_STATES, len(self.low)))
        return any(len(list(allowed_modes(self.system, self.system.full_state(row), self.p))) > 1 for row in x)

    @property
    def spent(self) -> float:
        """What motions have cost so far, in periods of lanes."""
        return self.ensemble.periods + _ALONE * self.ensemble.periods_alone

    def in_lanes(self, x: NDArray[np.float64]) -> bool:
        """Return whether lanes follow motions from some states: all others take a hundred times as long."""
        work = self.ensemble.work.sum()
        self.ensemble.strobe(x)
        return bool(self.ensemble.work.sum() > work)

    def seeds(self, count: int) -> NDArray[np.float64]:
        """Return the states from which motions are followed, of `count` Sobol points those that one can start from."""
        from scipy.stats import qmc

        points = qmc.Sobol(len(self.low), seed=self.rng).random_base2(max(count - 1, 1).bit_length())[:count]
        x = self.low + (self.high - self.low) * points
        kept: NDArray[np.float64] = x[[admits_start(self.ensemble, row) for row in x]]
        return kept

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

    def _bounded(self, x: NDArray[np.float64]) -> NDArray[np.bool_]:
        with np.errstate(invalid="ignore"):
            return np.asarray((np.abs(x) < self.limit).all(axis=-1))

    def _path(
        self, x: NDArray[np.float64], modes: NDArray[np.int64], count: int
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
        """States of the motions at `count` more strobes, shape (count + 1, m, n), and where they end."""
        states, at = [x], modes
        for _ in range(count):
            x, at = self.ensemble.strobe(x, at)
            states.append(x)
        path = np.array(states)
        kept = self._bounded(path).all(axis=0)
        self.astray = np.concatenate([self.astray, path[0, ~kept]])
        return path[:, kept], x[kept], at[kept]

    # ---- periodic attractors ----

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
        recurs = (gaps < _NEAR).any(axis=0)
        turns = np.argmax(gaps < _NEAR, axis=0) + 1
        remaining = ~self._held(x, modes)
        tried = np.zeros(len(x), dtype=bool)
        attempts = 0
        while attempts < _MOST and (left := np.flatnonzero(remaining & recurs & ~tried)).size:
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

    def _held(self, x: NDArray[np.float64], modes: NDArray[np.int64]) -> NDArray[np.bool_]:
        held = np.zeros(len(x), dtype=bool)
        for found in self.found:
            held |= found.holds(x, modes)
        return held

    def _near(self, x: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which states lie where motions contract to an attractor: slow ones are still on their way to it."""
        near = np.zeros(len(x), dtype=bool)
        for found in self.found:
            if found.ellipsoid is not None:
                near |= found.ellipsoid.holds(x)
        return near

    def _known(self, found: Found) -> bool:
        """Whether an attractor is one of those found, met once more before it was near enough."""
        return any(self._alike(other, found) for other in self.found)

    def _alike(self, one: Found, other: Found) -> bool:
        if one.kind != other.kind or len(one.points) != len(other.points):
            return False
        return float((np.abs(one.points - other.points) / self.scale).max()) < _SAME

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
        points = _in_order(points, self.scale)
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
        if float(np.max(speed * self.ensemble.period / self.scale)) > _SAME:
            return None
        name = self.system.mode_names[mode]
        return Found(REST, x[None], None, frozenset([name]), touches=False)

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
            if not (cloud := _Cloud(clouds[i], self.scale)).stationary():
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
            if attempts >= _MOST or not turns:
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
                log = events_after(self.system, self.p, x, mode, t=_WINDOW * period)
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
            REST if kind.period == 1 and not forced and float(moved.max()) < _SAME else kind.label,
            _in_order(cloud[-kind.period :], self.scale) if is_periodic else cloud,
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


class _Cloud:
    """What one motion visits, in units of its extent, and how near to each other its points are."""

    def __init__(self, points: NDArray[np.float64], scale: NDArray[np.float64]) -> None:
        self.unit = np.maximum(np.ptp(points, axis=0), _EXTENT * scale)
        self.points = points / self.unit
        self.reach = _REACH * max(float(np.quantile(_distances(self.points[::2], self.points[1::2]), _TYPICAL)), 1e-6)

    def stationary(self) -> bool:
        """Whether the second half visits what the first did."""
        return self._alike(*np.array_split(self.points, 2))

    def same(self, points: NDArray[np.float64]) -> bool:
        """Whether another motion visits the same states."""
        return self._alike(self.points, points / self.unit)

    def _alike(self, these: NDArray[np.float64], those: NDArray[np.float64]) -> bool:
        both = (_distances(these, those), _distances(those, these))
        return all(float(np.mean(distances <= self.reach)) >= _OVERLAP for distances in both)


def _distances(these: NDArray[np.float64], those: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance of each of those points from the nearest of these."""
    from scipy.spatial import cKDTree

    return np.asarray(cKDTree(these).query(those)[0])


def _same_cycle(one: PeriodicOrbit, other: PeriodicOrbit, scale: NDArray[np.float64]) -> bool:
    """Whether two limit cycles are one, started from two of its points."""
    apart = np.abs([one.lows - other.lows, one.highs - other.highs])[:, : len(scale)] / scale
    return abs(one.period - other.period) < _SAME * one.period and float(apart.max()) < _NEAR * _NEAR


def _recurrence(path: NDArray[np.float64]) -> int:
    """After how many strobes a path recurs, 0 where it does not, or after too many or few for the orbit solver."""
    apart = np.abs(path[-2::-1] - path[-1]).max(axis=1)
    turns = int(np.argmax(apart < _SETTLED)) + 1
    if not LONGEST < turns <= _MANY or float(np.abs(path[-turns:] - path[-2 * turns : -turns]).max()) >= _SETTLED:
        return 0
    return turns


def _in_order(points: NDArray[np.float64], scale: NDArray[np.float64]) -> NDArray[np.float64]:
    """The points of a cycle in the order of visits, beginning with the first by their values."""
    return np.roll(points, -_first(points, scale), axis=0)


def _first(points: NDArray[np.float64], scale: NDArray[np.float64]) -> int:
    """Index of the point that comes first in the order of the states, told by their rounded values."""
    rounded = np.round(points / scale, 6)
    return int(np.lexsort(rounded.T[::-1])[0])
