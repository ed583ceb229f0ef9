"""How attractors are looked for, and what each is, as it was found."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from saltus import checks
from saltus.basins.attractors.cloud import EXTENT, Cloud, distances
from saltus.basins.attractors.invariant_set import Cage
from saltus.basins.attractors.trapping import (
    OrbitEllipsoids,
)
from saltus.flow.motion_kind import Criteria
from saltus.orbits import PeriodicOrbit

if TYPE_CHECKING:
    from numpy.typing import NDArray


__all__ = ["LIMIT_CYCLE", "NEAR", "REST", "SAME", "Found", "Search", "Stay"]

LIMIT_CYCLE, REST = "limit cycle", "rest"

NEAR, SAME = 1e-3, 1e-6
"""Parts of the states' scale: within which a motion recurs or is on an attractor, two orbits are one."""

_CENSORED = 3.0
"""Mean stays in all that motions are followed without a departure, at the most, at 95 %: -ln 0.05."""


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
            return Cloud(self.points, scale).same(path)
        n, orbit = len(scale), self.orbit
        extent = np.ptp(self.points, axis=0) if orbit is None else (orbit.highs - orbit.lows)[:n]
        unit = np.clip(extent, EXTENT * scale, scale)
        return float(distances(self.points / unit, path[-2 * self.period :] / unit).max()) < NEAR
