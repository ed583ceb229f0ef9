"""State of a search for attractors: the motions under way, and the attractors found so far."""

from __future__ import annotations

import math
from contextlib import suppress
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.basins.attractors.closed_sides import ClosedSides
from saltus.basins.attractors.found import AttractorOptions, Found
from saltus.ensemble.ensemble import Ensemble, limit_at
from saltus.ensemble.traps import Ellipsoids, Traps
from saltus.errors import SaltusError
from saltus.flow.shares import limit_of
from saltus.flow.simulation import simulate
from saltus.flow.starting import allowed_modes
from saltus.progress import Reporter
from saltus.system.maps import flowing
from saltus.work import interrupt_waits

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

    from saltus.system import HybridSystem, Map

__all__ = ["FollowedMotions"]

_BOUND = 1e6  # least size of a diverged state, in units of the region's largest half width or of 1

_PRECISE = 1e-11  # tolerance of a step of the second, more precise ensemble
_STATES = 400  # random states of the region that tell whether a state may allow several modes

_PLACES = (0.17, 0.41, 0.63, 0.89)  # starts, over the region's width, of motions that size a frozen state
_LOOKS = 65  # states of each such motion that are looked at

_ALONE = 100.0  # time of the event-driven flow for a period, over that of a lane

_MOTIONS = 40_000  # default count of the motions that will be labelled


class FollowedMotions:
    """Motions on their way to attractors, and the attractors found so far.

    Parameters
    ----------
    system : HybridSystem or Map
    parameters : mapping of str to float
    low, high : ndarray, shape (n,)
        The region.
    options : AttractorOptions
    reporter : Reporter, optional
        Counts the motions that have been followed.
    """

    def __init__(
        self,
        system: HybridSystem | Map,
        parameters: Mapping[str, float] | None,
        low: NDArray[np.float64],
        high: NDArray[np.float64],
        options: AttractorOptions,
        reporter: Reporter | None = None,
    ) -> None:
        self.system, self.parameters, self.options = system, dict(parameters or {}), options
        self.low, self.high, self.interval = low, high, options.interval
        self.circles = system.angle_places
        self.scale = self._sizes()
        self.p = system.parameter_vector(self.parameters)
        self.limit = self._limit()
        self.ensemble, self.precise = self._engines()
        self.rng = np.random.default_rng(options.rng)
        self.found: list[Found] = []
        self.dropped: list[Found] = []
        self.virtual: list[Found] = []
        self.astray = np.empty((0, len(low)))
        self.neutral = 0
        self.motions, self.reporter = options.motions or _MOTIONS, reporter or Reporter(False)

    budget = 2e7  # strobes that the regions of one attractor, or the fates of all starts, may take: tens of seconds

    @property
    def sampled(self) -> bool:
        """Whether strobes are returns to a section: those of a system with a phase, and the states of a map."""
        return self.system.phase is not None

    def _limit(self) -> float:
        """Return the size of a diverged state."""
        if self.options.limit is not None:
            return self.options.limit
        farthest = np.maximum(np.abs(self.low), np.abs(self.high))
        return limit_of(self.system.compiled, self.p, farthest, _BOUND * max(1.0, float(self.scale.max())))

    def _within(self) -> float:
        """Return the size of a state that an engine calls diverged, even between strobes: it is never below `limit`."""
        return max(self.limit, limit_at(self.system, self.p, self.scale, None))

    def _engines(self) -> tuple[Any, Any]:
        """Return what follows motions, and the same with a tighter tolerance."""
        system, interval = flowing(self.system), self.interval
        first, second = (
            Ensemble(
                system, self.parameters, tolerance=tolerance, interval=interval, scale=self.scale, limit=self._within()
            )
            for tolerance in (self.options.tolerance, _PRECISE)
        )
        second.effort = first.effort
        first.effort.most = self.options.max_steps
        return first, second

    def _way(self, start: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how far a motion goes in each state between two strobes."""
        how_long: dict[str, Any] = {"periods": 1} if self.interval is None else {"t_end": self.interval}
        motion = simulate(flowing(self.system), self.parameters, start, **how_long)
        states = motion(np.linspace(0.0, motion.t_end, _LOOKS))[:, : len(start)]
        return np.asarray(np.abs(states - start).max(axis=0))

    def _sizes(self) -> NDArray[np.float64]:
        """Return the size of each state: half the region's width, or for a frozen state the distance motions go.

        That of an angle is half a turn at most.
        """
        half = 0.5 * (self.high - self.low)
        if not (half > 0.0).all():
            gone = []
            for part in _PLACES:
                with suppress(SaltusError):
                    gone.append(self._way(self.low + part * (self.high - self.low)))
            sizes = np.median(gone, axis=0) if gone else half
            half = np.where(half > 0.0, half, np.where(sizes > 0.0, sizes, half.max() or 1.0))
        half[self.circles] = np.minimum(half[self.circles], math.pi)  # nothing on a circle is farther away
        return np.asarray(half)

    @cached_property
    def by_mode(self) -> bool:
        """Whether a trapping region holds motions of one mode only: states allow several, or modes lack some states.

        Motions from samples start in the first mode that a state allows.
        """
        if any(mode.states is not None for mode in self.system.modes.values()):
            return True
        x = np.random.default_rng(self.options.rng).uniform(self.low, self.high, (_STATES, len(self.low)))
        system = flowing(self.system)
        return any(len(list(allowed_modes(system, self.system.full_state(row), self.p))) > 1 for row in x)

    @cached_property
    def _closed_sides(self) -> ClosedSides:
        return ClosedSides(flowing(self.system), self.p, self.low, self.high, self.scale)

    def drop_virtual(self, starts: NDArray[np.float64]) -> None:
        """Set aside what lies beyond an event to whose other side no motion comes, nor any from given starts."""
        if not any(self.is_virtual(found) for found in self.found):
            return
        cores = [found.core.as_traps(0) for found in self.found if found.core is not None]
        traps = Traps(len(self.low), Ellipsoids.joined(cores) if cores else None, limit=self.limit)
        _, ends, modes = self.ensemble.arrivals(starts, traps, self.options.longest)
        self._closed_sides.watch(starts, ends, modes)
        self.virtual += [found for found in self.found if self.is_virtual(found)]
        self.found = [found for found in self.found if found not in self.virtual]

    def is_virtual(self, found: Found) -> bool:
        """Return whether an attractor meets no event, and lies wholly beyond one to whose other side no motion comes.

        A simulation that starts there stays there, since it does not meet an event that it is past already.
        """
        return not found.touches and len(found.visited) == 1 and self._closed_sides.hold(found.points, *found.visited)

    def _beside(self, found: Found) -> Callable[[NDArray[np.float64]], bool]:
        """Return what tells whether all of some states lie beyond the events that a virtual set lies beyond."""
        events = self._closed_sides.events(found.points, *found.visited)
        return lambda x: all(self._closed_sides.lie_beyond(k, x) for k in events)

    @property
    def spent(self) -> float:
        """Time spent on motions so far, in periods of lanes."""
        return float(self.ensemble.periods + _ALONE * self.ensemble.periods_alone)

    def in_lanes(self, x: NDArray[np.float64]) -> bool:
        """Return whether lanes follow motions from given states; other engines take a hundred times as long."""
        work = self.ensemble.work.sum()
        self.ensemble.strobe(x)
        return bool(self.ensemble.work.sum() > work)

    def starts(self, count: int) -> NDArray[np.float64]:
        """Return the admissible starts among `count` Sobol points of the region."""
        from scipy.stats import qmc

        with interrupt_waits():  # SciPy loses it while it reads its tables, and gives wrong points from then on
            sequence = qmc.Sobol(len(self.low), seed=self.rng)
        points = sequence.random_base2(max(count - 1, 1).bit_length())[:count]
        x = self.low + (self.high - self.low) * points
        kept: NDArray[np.float64] = x[[self.ensemble.admits(row) for row in x]]
        return kept

    def _bounded(self, x: NDArray[np.float64]) -> NDArray[np.bool_]:
        with np.errstate(invalid="ignore"):
            return np.asarray((np.abs(x) < self.limit).all(axis=-1))

    def _path(
        self, x: NDArray[np.float64], modes: NDArray[np.int64], count: int
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
        """Return the motions' states at `count` more strobes, shape (count + 1, m, n), and their ends and modes."""
        states, at = [x], modes
        for _ in range(count):
            x, at = self.ensemble.strobe(x, at)
            states.append(x)
        path = np.array(states)
        kept = self._bounded(path).all(axis=0)
        self.astray = np.concatenate([self.astray, path[0, ~kept]])
        return path[:, kept], x[kept], at[kept]

    def _held(self, x: NDArray[np.float64], modes: NDArray[np.int64]) -> NDArray[np.bool_]:
        held = np.zeros(len(x), dtype=bool)
        for found in self.found:
            held |= found.holds(x, modes)
        return held

    def _near(self, x: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which states lie where motions contract to an attractor; slow motions there are on their way to it."""
        near = np.zeros(len(x), dtype=bool)
        for found in self.found:
            if found.ellipsoid is not None:
                near |= found.ellipsoid.holds(x)
        return near
