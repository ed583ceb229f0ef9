"""Iterations of a map as the returns that a sweep follows and measures: each is one, and takes the time 1."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from saltus.errors import DivergenceError, InputError
from saltus.flow.poincare import PoincareReturns
from saltus.flow.sizes import units_along
from saltus.flow.variational import Average, Growth
from saltus.maps.code import code_of
from saltus.maps.growth import growth_of_map
from saltus.maps.iterates import path_from
from saltus.maps.observing import check_map_observables, observe_states
from saltus.result import frozen
from saltus.system.angles import on_circles, wrapped

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from saltus.checks.states import StateLike
    from saltus.flow.motion_kind import Kind
    from saltus.flow.recurring.criteria import Criteria
    from saltus.sweeps.options import SweepOptions
    from saltus.system import Map

__all__ = ["MapReturns"]

_EPS = 2.0**-52  # rounding of a state, over its size


@dataclass(frozen=True)
class MapReturns:
    """Iterations of a map, as `saltus.sweeps.returns.Returns` describes them."""

    system: Map
    x0: NDArray[np.float64]
    discard: int
    keep: int
    exponents: int
    criteria: Criteria
    faults: ClassVar[tuple[type[Exception], ...]] = (DivergenceError,)
    looks: ClassVar[int] = 5  # iterates are cheap
    growth_error: ClassVar[float] = 0.0
    autonomous: ClassVar[bool] = False

    @classmethod
    def checked(cls, system: Map, x0: StateLike | None, options: SweepOptions) -> MapReturns:
        """Return the iterations of a map after checks of the options that depend on it."""
        for name in ("mode", "section", "limit"):
            if (value := getattr(options, name)) is not None:
                raise InputError(f"SweepOptions.{name}", value, "left out for a map", "every iteration is a return")
        if options.lanes:
            raise InputError("SweepOptions.lanes", True, "left out for a map", "iterates are followed one by one")
        x = system.full_state(np.zeros(len(system.states)) if x0 is None else x0)
        return cls(system, x, options.discard, options.keep, options.exponents, options.criteria)

    def described(self) -> dict[str, Any]:
        """Return the settings as plain data."""
        return {"x0": self.x0.tolist(), "mode": None, "section": None, "rtol": 0.0, "atol": 0.0}

    def ready(self, vectors: Sequence[NDArray[np.float64]], *, given: bool) -> MapReturns:
        """Return the same: a motion of a map starts anywhere."""
        return self

    def load(self, p: NDArray[np.float64]) -> None:
        """Load the compiled functions, before threads ask for them."""
        self._path(p, self.x0, 0, 1)

    def start(
        self, p: NDArray[np.float64], end: tuple[NDArray[np.float64], int] | None
    ) -> tuple[NDArray[np.float64], int]:
        """Return state and piece from which a motion starts that follows another one's end."""
        x = self.x0 if end is None else end[0]
        return x, self.system.piece_index(x, p)

    def settled(self, p: NDArray[np.float64], x: NDArray[np.float64], mode: int, count: int) -> PoincareReturns:
        """Return states after those that are dropped."""
        states, pieces = self._path(p, x, self.discard + 1, count)
        times = np.arange(self.discard + 1.0, self.discard + 1.0 + count)
        return PoincareReturns(
            frozen(states),
            frozen(pieces, np.int64),
            frozen(times),
            frozen(wrapped(states[-1], self.system.angle_places)),
            int(pieces[-1]),
        )

    @property
    def unit(self) -> float:
        """Size of the start, 1 at most; 1 where it is 0."""
        return min(float(np.abs(self.x0).max(initial=0.0)), 1.0) or 1.0

    def fitting(self, p: NDArray[np.float64], found: PoincareReturns) -> MapReturns:
        """Return the same: iterates have no tolerance."""
        return self

    def by_lanes(self, p: NDArray[np.float64], *, growing: bool) -> None:
        """Return None: iterations have no lanes."""

    def settled_together(self, starts: Sequence[Any], count: int) -> Sequence[None]:
        """Return None for each: iterations have no lanes."""
        return [None] * len(starts)

    def grown_together(self, settled: Sequence[Any], count: int) -> Sequence[None]:
        """Return None for each: iterations have no lanes."""
        return [None] * len(settled)

    def mean_time(self, found: PoincareReturns) -> float:
        """Return the time of an iteration, 1."""
        return 1.0

    def growth(self, p: NDArray[np.float64], x: NDArray[np.float64], mode: int, returns: int, time: float) -> Growth:
        """Return the growth of perturbations over some iterations; over whole rounds of a periodic motion.

        States that never come back, as those that fade, do not tell how long a round is.
        """
        states, _ = self._path(p, x, 0, returns // 2 + 1)
        places = self.system.angle_places
        apart = np.abs(wrapped(states[1:] - states[0], places))
        back = apart <= self.criteria.recurrence * np.abs(wrapped(states, places)).max(axis=0)
        telling = back.any(axis=0)
        near = np.flatnonzero(back[:, telling].all(axis=1) & telling.any())
        rounds = int(near[0]) + 1 if near.size else 1
        average = Average(periods=max(-(-returns // rounds) * rounds, 2), discard=max(returns // 4, 1))
        return growth_of_map(self.system, p, x, average=average, exponents=self.exponents)

    def compared(
        self, p: NDArray[np.float64], found: PoincareReturns, time: float
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return states whose recurrence is looked at, in their sizes, and differences of them that are rounding."""
        sizes = np.abs(found.states).max(axis=0)
        rounding = np.asarray(self.criteria.noise * _EPS * sizes)
        units = units_along(found.states, sizes, rounding, self.system.angle_places)
        return on_circles(found.states / units, rounding / units, self.system.angle_places)

    def observed(
        self, parameters: Mapping[str, float], found: PoincareReturns, kind: Kind, observables: Sequence[str]
    ) -> list[float]:
        """Return observables over the period of a periodic motion, else over the states kept."""
        last = min(kind.period or self.keep, len(found.states))
        return observe_states(self.system, parameters, found.states[-last:], found.modes[-last:], observables)

    def check_observables(self, observables: Sequence[str]) -> None:
        """Raise `InputError` where a name is no observable of a motion."""
        check_map_observables(self.system, observables)

    def _path(
        self, p: NDArray[np.float64], x: NDArray[np.float64], discard: int, count: int
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        return path_from(self.system, p, code_of(self.system, p), x, discard, count)
