"""Attractors by recurrence: seeds are followed until each has settled, and what they settle on is corrected.

1. Seeds are a scrambled Sobol sequence over a region, and the centres of all cages. They are advanced together, in
   stretches that double.
2. After each stretch, motions that recur after 1 to `LONGEST` strobes are handed to the orbit solver. What it converges
   to is an attractor if it is stable and admissible: a slow passage by a saddle recurs, too, but the orbit there is
   unstable. All motions in its trapping region are then accounted for.
3. Motions that have not become periodic after `_PATIENCE` strobes are told apart by features: each must be stationary,
   i.e. the second half of what it visits is as near to the first as the odd points are to the even ones; those that
   visit the same states are one attractor; `saltus.flow.classify` says of which kind it is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from saltus.basins.cage import Cage, cage_of
from saltus.basins.trapping import Ellipsoid, admits_start, contracting, core_of, metric_of, orbit_jacobians
from saltus.errors import ConvergenceError, InputError, SaltusError
from saltus.flow.classify import Criteria, classify
from saltus.flow.counts import checked_count
from saltus.flow.ensemble import Ensemble
from saltus.flow.run import is_number, starting_mode
from saltus.flow.simulate import events_after
from saltus.flow.variational import growth_along
from saltus.orbits import PeriodicOrbit, find_orbit

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from saltus.system import HybridSystem

__all__ = ["LIMIT_CYCLE", "LONGEST", "Found", "Hunt", "Search"]

LIMIT_CYCLE = "limit cycle"
LONGEST = 16
"""Strobes after which a motion recurs that the orbit solver is asked about."""

_STRIDE = 64
_PATIENCE = 500
_WINDOW = 512
_NEAR, _SAME, _BESIDE = 1e-3, 1e-6, 1e-2
"""Parts of the states' scale: within which a motion recurs, two orbits are one, a second motion is not tried."""

_REST = 1e-10
_MOST = 8
_PRECISE = 1e-11
_OVERLAP, _REACH, _TYPICAL = 0.9, 3.0, 0.98
"""Part of a motion's points that lie within so many typical distances of another's; quantile of these distances."""

_EXTENT = 1e-9
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
    samples : int
        Motions that are followed from inside each trapping region that is measured.
    safety : float
        Part of the largest such region found, by the square of its radius, that is kept.
    tolerance : float
        Of a step of the ensemble.
    limit : float
        A state with a component beyond it has diverged.
    criteria : Criteria
        By which quasi-periodic and chaotic motions are told apart.
    """

    random_seed: int = 0
    longest: int = 4000
    samples: int = 20_000
    safety: float = 0.5
    tolerance: float = 1e-8
    limit: float = 1e6
    criteria: Criteria = field(default_factory=Criteria)

    def __post_init__(self) -> None:
        for name, least in (("random_seed", 0), ("longest", 1), ("samples", 100)):
            object.__setattr__(self, name, checked_count(f"Search.{name}", getattr(self, name), least))
        for name, most in (("safety", 1.0), ("tolerance", 1e-2), ("limit", math.inf)):
            if not is_number(value := getattr(self, name)) or not 0.0 < value < math.inf or value > most:
                raise InputError(f"Search.{name}", value, f"a number between 0 and {most:g}")
            object.__setattr__(self, name, float(value))
        if not isinstance(self.criteria, Criteria):
            raise InputError("Search.criteria", self.criteria, "a Criteria")


@dataclass
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
    ellipsoid : Ellipsoid or None
        In which motions contract.
    core : Ellipsoid or None
        The part of it in which they are accounted for.
    """

    kind: str
    points: NDArray[np.float64]
    orbit: PeriodicOrbit | None
    visited: frozenset[str]
    touches: bool
    cage: Cage | None = None
    ellipsoid: Ellipsoid | None = None
    core: Ellipsoid | None = None

    @property
    def period(self) -> int:
        """Strobes after which it recurs, 0 where it does not."""
        return int(self.kind.removeprefix("period-")) if self.kind.startswith("period-") else 0

    def holds(self, x: NDArray[np.float64], modes: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return which states, shape (m, n), in which modes, are certain to end here."""
        held = np.zeros(len(x), dtype=bool)
        if self.core is not None:
            held |= self.core.holds(x)
        if self.cage is not None:
            held |= (modes == self.cage.mode) & (self.cage.sizes(x) < self.cage.bound)
        return held


class Hunt:
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
    """

    def __init__(
        self,
        system: HybridSystem,
        parameters: Mapping[str, float] | None,
        low: NDArray[np.float64],
        high: NDArray[np.float64],
        interval: float | None,
        search: Search,
    ) -> None:
        self.system, self.parameters, self.search = system, dict(parameters or {}), search
        self.low, self.high, self.interval = low, high, interval
        half = 0.5 * (high - low)
        self.scale = np.where(half > 0.0, half, half.max() or 1.0)
        self.ensemble, self.precise = (
            Ensemble(system, self.parameters, tolerance=tolerance, interval=interval, scale=self.scale)
            for tolerance in (search.tolerance, _PRECISE)
        )
        self.p = self.ensemble.p
        self.rng = np.random.default_rng(search.random_seed)
        self.found: list[Found] = []

    # ---- what is followed ----

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
        modes = np.array([starting_mode(self.system, self.system.full_state(row), self.p) for row in x], np.int64)
        done, stride = 0, _STRIDE
        while len(x) and done < self.search.longest:
            x, modes = self._kept(*self.ensemble.strobe(x, modes, stride))
            path, x, modes = self._path(x, modes, 2 * LONGEST)
            done += stride + 2 * LONGEST
            stride *= 2
            x, modes = self._find_periodic(path, x, modes)
            if len(x) and done >= min(_PATIENCE, self.search.longest):
                done += 2 * _WINDOW
                x, modes = self._find_aperiodic(x, modes, last=done >= self.search.longest)

    def _kept(self, x: NDArray[np.float64], modes: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        with np.errstate(invalid="ignore"):
            kept = (np.abs(x) < self.search.limit).all(axis=1)
        return x[kept], modes[kept]

    def _path(
        self, x: NDArray[np.float64], modes: NDArray[np.int64], count: int
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
        """States of the motions at `count` more strobes, shape (count + 1, m, n), and where they end."""
        states, at = [x], modes
        for _ in range(count):
            x, at = self.ensemble.strobe(x, at)
            states.append(x)
        path = np.array(states)
        with np.errstate(invalid="ignore"):
            kept = (np.abs(path) < self.search.limit).all(axis=(0, 2))
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
            if found is not None and not self._known(found) and self.contracts(found):
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
            found.cage = caged.cage
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
            orbit = self._orbit(x, mode)
            points, modes = self._strobes(orbit)
            if len(points) > 1:
                first = _first(points, self.scale)
                orbit = self._orbit(points[first], int(modes[first]))
        except SaltusError:
            return None
        return self.periodic(orbit)

    def _orbit(self, x: NDArray[np.float64], mode: int) -> PeriodicOrbit:
        return find_orbit(self.system, self.parameters, x, self.system.mode_names[mode], settle=1.0)

    def periodic(self, orbit: PeriodicOrbit) -> Found:
        """Return the attractor of a stable orbit of a forced system."""
        points, _ = self._strobes(orbit)
        points = np.roll(points, -_first(points, self.scale), axis=0)
        names = self.system.mode_names
        return Found(
            f"period-{len(points)}",
            points,
            orbit,
            frozenset(names[k] for k in orbit.form.modes),
            any(k >= 0 for k in orbit.form.transitions),
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
        jacobians = orbit_jacobians(self.precise, found.points, self.scale)
        metric = metric_of(found.points, jacobians, self.scale) if np.isfinite(jacobians).all() else None
        found.ellipsoid = None if metric is None else contracting(self.ensemble, metric, self.rng)
        found.core = None if found.ellipsoid is None else core_of(self.ensemble, found.ellipsoid, self.rng)
        return found.ellipsoid is not None

    def _equilibrium(self, x: NDArray[np.float64], mode: int) -> Found | None:
        """The stable equilibrium near a state of a system without a phase."""
        for _ in range(20):
            image, _ = self.precise.strobe(x[None], np.array([mode]))
            apart = image[0] - x
            if not np.isfinite(apart).all():
                return None
            if np.max(np.abs(apart) / self.scale) < _REST:
                break
            slope = orbit_jacobians(self.precise, x[None], self.scale)[0] - np.eye(len(x))
            if not np.isfinite(slope).all() or np.linalg.cond(slope) > 1e6:
                return None
            x = x - np.linalg.solve(slope, apart)
        else:
            return None
        speed = np.abs(self.system.field(self.system.mode_names[mode], x, self.parameters))
        if float(np.max(speed * self.ensemble.period / self.scale)) > _SAME:
            return None
        name = self.system.mode_names[mode]
        return Found("period-1", x[None], None, frozenset([name]), touches=False)

    # ---- all others ----

    def _find_aperiodic(
        self, x: NDArray[np.float64], modes: NDArray[np.int64], *, last: bool
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Tell stationary motions apart by what they visit; return those that are still on their way."""
        path, x, modes = self._path(x, modes, 2 * _WINDOW)
        clouds = path[1:].transpose(1, 0, 2)
        remaining = ~self._held(x, modes)
        if last:
            remaining &= ~self._near(x)
        settling = np.zeros(len(x), dtype=bool)
        for i in range(len(x)):
            if settling[i] or not remaining[i] or not (cloud := _Cloud(clouds[i], self.scale)).stationary():
                continue
            members = [j for j in np.flatnonzero(remaining) if j == i or cloud.same(clouds[j])]
            found = self._featured(clouds[i], x[i], int(modes[i]), last=last)
            if found is None:
                settling[members] = True
            else:
                self.found.append(found)
                remaining[members] = False
        return x[remaining], modes[remaining]

    def _featured(self, cloud: NDArray[np.float64], x: NDArray[np.float64], mode: int, *, last: bool) -> Found | None:
        """The attractor on which a motion has settled, None where it is still on its way to a periodic orbit."""
        period, criteria, forced = self.ensemble.period, self.search.criteria, self.system.phase is not None
        strobes = 2 * _WINDOW
        try:
            if forced:
                growth = growth_along(self.system, self.p, x, mode, periods=strobes, exponents=1)
                log = events_after(self.system, self.p, x, mode, periods=_WINDOW)
            else:
                growth = growth_along(self.system, self.p, x, mode, t=strobes * period, exponents=1)
                log = events_after(self.system, self.p, x, mode, t=_WINDOW * period)
        except SaltusError:
            return None
        exponent, error = (float(value[0]) * period for value in (growth.exponents, growth.errors))
        rounding = criteria.noise * self.search.tolerance * self.scale
        kind = classify(cloud, exponent, error, criteria, rounding)
        is_periodic = kind.label.startswith("period-")
        if is_periodic and forced and kind.period <= LONGEST and not last:
            return None
        indices = {mode, *log.mode_before.tolist(), *log.mode_after.tolist()}
        found = Found(
            kind.label,
            cloud[-kind.period :] if is_periodic else cloud,
            None,
            frozenset(self.system.mode_names[k] for k in indices),
            bool(np.any(log.transition >= 0)),
        )
        return found if forced or exponent > criteria.exponent + error else self._as_limit_cycle(found, cloud, x, mode)

    def _as_limit_cycle(self, found: Found, cloud: NDArray[np.float64], x: NDArray[np.float64], mode: int) -> Found:
        """A motion without a phase that does not spread, as a limit cycle if it is one.

        Raises
        ------
        InputError
            Strobes would see but a few points of it.
        """
        try:
            found.orbit = find_orbit(self.system, self.parameters, x, self.system.mode_names[mode])
        except SaltusError:
            return found
        turns = np.arange(1, 4 * LONGEST + 1) * self.ensemble.period / found.orbit.period
        if float(np.abs(turns - np.round(turns)).min()) < _COMMENSURATE:
            allowed = f"in no ratio of small integers to the period {found.orbit.period:.9g} of a limit cycle"
            raise InputError("interval", self.ensemble.period, allowed, f"try {_GOLDEN * self.ensemble.period:.9g}")
        found.kind, found.points = LIMIT_CYCLE, cloud
        return found


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


def _first(points: NDArray[np.float64], scale: NDArray[np.float64]) -> int:
    """Index of the point that comes first in the order of the states, told by their rounded values."""
    rounded = np.round(points / scale, 6)
    return int(np.lexsort(rounded.T[::-1])[0])
