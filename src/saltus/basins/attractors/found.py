"""Settings of a search for attractors, and the record of one attractor."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from saltus import checks
from saltus.basins.attractors.cloud import EXTENT, Cloud, distances
from saltus.basins.attractors.invariant_set import Cage
from saltus.basins.attractors.trapping import (
    OrbitEllipsoids,
)
from saltus.flow.recurring.criteria import Criteria
from saltus.orbits import PeriodicOrbit
from saltus.system.angles import on_circles, wrapped

if TYPE_CHECKING:
    from numpy.typing import NDArray


__all__ = ["FEWEST_SAMPLES", "LIMIT_CYCLE", "NEAR", "REST", "SAME", "AttractorOptions", "Found", "Stay", "renamed"]

LIMIT_CYCLE = "limit cycle"  # kind of a periodic orbit of a system without a phase
REST = "rest"  # kind of an equilibrium

NEAR = 1e-3  # distance, over the states' scale, within which a motion recurs or is on an attractor
SAME = 1e-6  # distance, over the states' scale, within which two orbits are one

FEWEST_SAMPLES = 1000  # default samples of a region, at least

# Counts of a search in files of version 0.1 and before, and their names today.
_COUNTS = {"seeds": "starts", "motions": "motions"}

_CENSORED = 3.0  # -ln 0.05: strobes followed without a departure, over the mean stay, at most, at 95 %


@dataclass(frozen=True, kw_only=True)
class AttractorOptions:
    """How attractors are sought, and their trapping regions measured.

    Parameters
    ----------
    starts : int
        Count of motions from the region. An attractor whose basin is a small share w of the region is missed with a
        probability of about ``(1 - w)^starts``; ``starts = 3/w`` finds it at 95 %.
    also : sequence of states
        States, each in the system's order, from which motions start besides. From a state of its basin an attractor is
        found however small its basin is. `Basins.label_error` tells a state on each attractor that was missed.
    motions : int or None
        Count of the motions that will be labelled, by default 40 000, and for `map_basins` the count of its cells. The
        search takes at most about ten times as long as their labelling. Trapping regions are enlarged while this saves
        time, and have as many samples as time allows, at least 1000.
    interval : float or None
        Time between two strobes of a system without a phase. For a map a strobe is an iteration.
    rng : int or numpy.random.Generator
        What random numbers are drawn from: the same seed and inputs give the same attractors.
    longest : int
        Strobes after which a motion that has not settled is given up.
    samples : int or None
        Motions followed from inside each trapping region that is measured. By default between 1000 and 20 000: making
        and measuring all regions then takes about six times as long as labelling the motions.
    safety : float
        Share of the squared distance of a sample that ends elsewhere at which a plane cuts it off.
    tolerance : float
        Tolerance of a step of the ensemble.
    limit : float, optional
        Size beyond which a state that grows has diverged. By default a million, or a million times the region's half
        width or the largest size of the problem, as in `simulate`.
    max_steps : int
        Steps that all motions of a system without a phase may take which lanes cannot follow, as those of stiff
        systems. A search that needs more raises a `StiffnessError`, where this can be foreseen, at once.
    criteria : Criteria
        Criteria that tell quasi-periodic from chaotic motions.

    Examples
    --------
    >>> from saltus.options import AttractorOptions
    >>> AttractorOptions(starts=32, samples=500).starts
    32
    """

    starts: int = 256
    also: tuple[tuple[float, ...], ...] = ()
    motions: int | None = None
    interval: float | None = None
    rng: int | np.random.Generator = 0
    longest: int = 4000
    samples: int | None = None
    safety: float = 0.8
    tolerance: float = 1e-8
    limit: float | None = None
    max_steps: int = 100_000_000
    criteria: Criteria = field(default_factory=Criteria)

    def __post_init__(self) -> None:
        for name in ("starts", "longest", "max_steps", *(["motions"] if self.motions is not None else [])):
            count = checks.size if name == "starts" else checks.count
            object.__setattr__(self, name, count(f"AttractorOptions.{name}", getattr(self, name)))
        also = checks.listed("AttractorOptions.also", self.also, "states")
        states = (checks.array("AttractorOptions.also", state, "states, each a row of numbers") for state in also)
        object.__setattr__(self, "also", tuple(tuple(np.atleast_1d(state).tolist()) for state in states))
        if self.interval is not None:
            object.__setattr__(self, "interval", checks.positive("AttractorOptions.interval", self.interval))
        checks.generator("AttractorOptions.rng", self.rng)
        if self.samples is not None:
            object.__setattr__(self, "samples", checks.size("AttractorOptions.samples", self.samples, 100))
        if self.limit is not None:
            object.__setattr__(self, "limit", checks.positive("AttractorOptions.limit", self.limit))
        for name, largest in (("safety", 1.0), ("tolerance", 1e-2)):
            value = checks.positive(f"AttractorOptions.{name}", getattr(self, name))
            object.__setattr__(self, name, checks.between(f"AttractorOptions.{name}", value, 0.0, largest))
        checks.instance("AttractorOptions.criteria", self.criteria, Criteria)


def renamed(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return a search as written today; up to version 0.1 its counts stood apart, and other settings in ``search``."""
    found = dict(given)
    options = {
        "rng" if key == "random_seed" else key: value for key, value in (found.pop("search", None) or {}).items()
    }
    options |= {new: found.pop(old) for old, new in _COUNTS.items() if old in found}
    return found | ({"options": options | dict(found.get("options") or {})} if options else {})


class Stay(NamedTuple):
    """How long motions stay on an attractor that is no periodic orbit."""

    motions: int  # count of the motions followed
    strobes: float  # sum of their stays
    left: int  # count of those that ended elsewhere

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
    """Record of one attractor that was found."""

    kind: str
    # shape (k, n): states at strobes; those of a periodic orbit in the order of visits, the least first
    points: NDArray[np.float64]
    orbit: PeriodicOrbit | None
    visited: frozenset[str]  # modes that the attractor visits
    touches: bool  # whether the attractor meets an event
    # shape (k,): indices of the modes at the points; None where it is the first that each allows
    modes: NDArray[np.int64] | None = None
    cage: Cage | None = None
    ellipsoid: OrbitEllipsoids | None = None  # ellipsoids in which motions contract
    core: OrbitEllipsoids | None = None  # smaller ellipsoids in which motions count as settled
    stay: Stay | None = None  # stay of motions, where measured
    turns: tuple[int, ...] = ()  # whole turns that each angle of the system makes until the attractor recurs
    decay: float = math.nan  # asymptotic factor by which distances shrink from strobe to strobe, NaN where unknown

    @property
    def period(self) -> int:
        """Strobes after which the attractor recurs, 0 for one without period."""
        if self.kind == REST:
            return 1
        return int(self.kind.removeprefix("period-")) if self.kind.startswith("period-") else 0

    @property
    def name(self) -> str:
        """Its rotation number where an angle rotates, turns over strobes or periods of a cycle; else its kind."""
        if not any(self.turns):
            return self.kind
        turns = str(self.turns[0]) if len(self.turns) == 1 else f"({', '.join(map(str, self.turns))})"
        return f"rotation {turns}/{self.period or 1}"

    def along(self, count: int) -> NDArray[np.float64]:
        """Return states all along the orbit, shape (about `count`, n); none without an orbit."""
        if self.orbit is None:
            return np.empty((0, self.points.shape[1]))
        return wrapped(self.orbit.states_along(count)[1], self.orbit.system.angle_places)

    def holds(self, x: NDArray[np.float64], modes: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return which states, shape (m, n), in given modes, are certain to end on this attractor."""
        held = np.zeros(len(x), dtype=bool)
        if self.core is not None:
            held |= self.core.holds(x, modes)
        if self.cage is not None:
            held |= (modes == self.cage.mode) & (self.cage.sizes(x) < self.cage.bound)
        return held

    def carries(self, path: NDArray[np.float64], scale: NDArray[np.float64], circles: NDArray[np.int64]) -> bool:
        """Return whether a motion that visits some states, shape (k, n), is on this attractor, or creeps to it.

        A motion creeps to an orbit where it is near the orbit's points, measured by the scale or the orbit's extent.
        `circles` are the places of the angles.
        """
        if self.kind == LIMIT_CYCLE and self.orbit is not None:  # its points are dense, the motion's may be few
            return Cloud(self.points, scale, circles).holds(path[-len(path) // 2 :])
        if not self.period:
            return Cloud(self.points, scale, circles).same(path)
        n, orbit = len(scale), self.orbit
        extent = np.ptp(self.points, axis=0) if orbit is None else (orbit.highs - orbit.lows)[:n]
        unit = np.clip(extent, EXTENT * scale, scale)
        own, units = on_circles(self.points, unit, circles)
        its = on_circles(path[-2 * self.period :], unit, circles)[0]
        return float(distances(own / units, its / units).max()) < NEAR
